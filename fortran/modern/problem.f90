module problem
  !! The equations that the modern methods solve, divided by the moments (equations 16-18):
  !! omega' = M(t) + (A w2 w3, B w1 w3, C w1 w2), M(t) = constant + rate t + sines + cosines.
  !! A wave is one of the sines or cosines.
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  implicit none(type, external)
  private

  public :: request_nodes

  type, public :: problem_t
    real(dp) :: coefficients(3)                    !! A, B, C, without unit
    real(dp) :: constant(3)                        !! torque over moment, rad/s2
    real(dp) :: rate(3)                            !! torque over moment, rad/s3
    integer :: n_sines
    integer :: n_cosines
    ! Associated only if there is a wave.
    real(dp), pointer, contiguous :: sines(:, :)   !! amplitude (3) in rad/s2, frequency in rad/s
    real(dp), pointer, contiguous :: cosines(:, :) !! as sines
  end type problem_t

  type, public :: request_t
    !! What is to be computed.
    real(dp) :: omega(3)                           !! at time 0, rad/s
    real(dp) :: tolerance                          !! largest error, over the largest |omega|
    real(dp) :: effort                             !! factor on the work limit
    real(dp), pointer, contiguous :: times(:)      !! s
  end type request_t

  type, public :: step_request_t
    !! A step of a system of ordinary differential equations.
    real(dp) :: t, t_end                        !! beginning and latest end, s
    real(dp) :: trial                           !! length that is tried first, s; positive
    real(dp) :: relative                        !! tolerance that decides the order
    real(dp), pointer, contiguous :: state(:)
    real(dp), pointer, contiguous :: tolerances(:) !! allowed errors of the unknowns in the step
    !! whether a step ends a few rounding errors beyond a switch, or beyond a break before t_end
    logical :: is_beyond = .false.
    logical :: may_be_long = .true. !! whether a step needs no series where none converges
  end type step_request_t

  type, public :: step_t
    !! A step that was taken: the state is the sum of the terms at its end.
    real(dp) :: h                               !! s
    real(dp) :: stop                            !! next break, or t_end, s
    real(dp) :: t                               !! time at its end, s
    integer :: order, status, expansions        !! status of the module statuses
    real(dp), pointer, contiguous :: terms(:, :) !! (0:, unknowns); 0 beyond the order
    real(dp), pointer, contiguous :: state(:)
    logical :: is_switched = .false.            !! whether it ended where a switch changes
  end type step_t

  type, public :: variation_request_t
    !! Derivatives of a solution with respect to parameters, the columns.
    real(dp) :: tolerance                       !! relative
    real(dp) :: effort                          !! factor on the work limit
    real(dp), pointer, contiguous :: state(:)   !! at time 0
    real(dp), pointer, contiguous :: starts(:, :) !! (unknowns, columns): derivatives at time 0
    !! (unknowns, columns): the combination that is the partial derivative of a rate; 0 for none
    integer, pointer, contiguous :: forcings(:, :)
    real(dp), pointer, contiguous :: times(:)   !! s
  end type variation_request_t

  type, bind(c), public :: event_search_t
    !! What event_search.c reads, and the roots that it finds.
    integer(c_int) :: n_pieces, m, n_own, n_slots, most, n_roots
    type(c_ptr) :: edges, values, points, refining, to_coefficients, left, right, settings, roots
  end type event_search_t

  type, public :: variation_t
    !! The derivatives at the first n_rows times.
    real(dp), pointer, contiguous :: rows(:, :, :) !! (unknowns, columns, times)
    integer :: n_rows, status                   !! status of the module statuses
  end type variation_t

  type, public :: solution_t
    !! What was computed. A kernel sets the components that it has.
    real(dp), pointer, contiguous :: rows(:, :)    !! omega at the first n_rows times, rad/s
    !! (4, 0:n): column 0 is the attitude at time 0, by the caller; null if not requested
    real(dp), pointer, contiguous :: attitudes(:, :) => null()
    !! (states, 0:n): the user's own states, as attitudes; and the least sizes to which their
    !! errors are relative
    real(dp), pointer, contiguous :: own(:, :) => null()
    real(dp), pointer, contiguous :: own_sizes(:) => null()
    ! The unknowns at nodes of each part of a step; null if not requested.
    real(dp), pointer, contiguous :: nodes(:) => null()          !! from 0 to 1
    real(dp), pointer, contiguous :: at_nodes(:, :, :) => null() !! (unknowns, nodes, parts)
    real(dp), pointer, contiguous :: ends(:) => null()           !! 0 and the ends of parts, s
    integer :: n_steps = 0                                       !! may exceed the number of `ends`
    real(dp) :: between = 0.0_dp !! largest error of polynomials through the nodes, relative
    integer :: n_rows                              !! number of rows that hold a result
    integer :: status                              !! of the module statuses
    integer(int64) :: steps = 0                    !! of the last integration
    integer(int64) :: evaluations                  !! right-hand sides
    real(dp) :: needed                             !! effort that the times require
    real(dp) :: error                              !! estimated, over the largest |omega|
    real(dp) :: growth                             !! error amplification; negative: unknown
    real(dp) :: spent                              !! steps of all integrations
    !! switch of a tape along which the solution slides, or that is touched so that an error decides
    !! whether it changes; at the time `needed`
    integer :: switch = 0
  end type solution_t

contains

  subroutine request_nodes(solution, nodes, ends, at_nodes)
    !! Request the unknowns at nodes of each step.
    type(solution_t), intent(inout) :: solution
    real(dp), intent(in), target, contiguous :: nodes(:)            !! in parts of a step
    real(dp), intent(inout), target, contiguous :: ends(:)          !! one more than steps, s
    real(dp), intent(inout), target, contiguous :: at_nodes(:, :, :) !! (unknowns, nodes, steps)

    ends(1) = 0.0_dp
    solution%nodes => nodes
    solution%ends => ends
    solution%at_nodes => at_nodes
  end subroutine request_nodes

end module problem

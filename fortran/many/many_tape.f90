module many_tape
  !! Many bodies under one torque that depends on the state: side by side, and one after the other
  !! those that this leaves.
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: i1, NEEDS_FALLBACK, of_body
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use levels, only: tape_bodies, tape_solve
  use places, only: EFFORT, TOLERANCE, WAVES
  use prepared_scale, only: is_result, LARGE
  use problem, only: request_t, solution_t
  use statuses, only: COMPLETE, INTERRUPTED, REFUSED
  use tape, only: arrays_of, COARSEST, tape_bodies_t, tape_of, tape_t
  implicit none(type, external)
  private

  integer, parameter :: BETWEEN_LOOKS = 64 ! bodies between polls for an interrupt

  type, public :: many_t
    !! Bodies with their results. An array with one column, or one set, applies to all bodies.
    integer :: n, n_rows, n_own   !! numbers of bodies, of results of a body, and of own states
    real(dp), pointer, contiguous :: omega0(:, :)     !! (3, n), rad/s
    real(dp), pointer, contiguous :: attitude0(:, :)  !! (4, 0 or n), unit quaternions
    real(dp), pointer, contiguous :: own0(:, :)       !! (n, n_own)
    !! (n_own): the least sizes to which errors of own states are relative
    real(dp), pointer, contiguous :: own_sizes(:)
    !! (n_rows, 1 or n), s: of one sign, and ordered away from 0
    real(dp), pointer, contiguous :: times(:, :)
    real(dp), pointer, contiguous :: parameters(:, :) !! (parameters, 0, 1 or n): inputs of the tape
    real(dp), pointer, contiguous :: omega(:, :, :)     !! (3, n_rows, n)
    real(dp), pointer, contiguous :: attitude(:, :, :)  !! (4, n_rows, 0 or n)
    real(dp), pointer, contiguous :: own(:, :, :)       !! (n_rows, n, n_own)
    integer(i1), pointer, contiguous :: status(:, :)    !! (n_rows, n)
    !! (2, n_rows, 0 or n): relative error and amplification; negative: unknown
    real(dp), pointer, contiguous :: estimates(:, :, :)
  end type many_t

  public :: solve_tape_bodies

contains

  subroutine solve_tape_bodies(packed, alone, many, n_left, raised)
    !! Compute the unknowns of each body at its times.
    real(dp), intent(in), target, contiguous :: packed(0:) !! the scene, as in prepared.f90
    !! The same for one body, with its parameters as the constants of the first combinations. The
    !! constants change. If it is empty, bodies that are left keep the status NEEDS_FALLBACK.
    real(dp), intent(inout), target, contiguous :: alone(0:)
    type(many_t), intent(inout) :: many
    integer, intent(out) :: n_left     !! number of bodies that are not solved side by side
    integer, intent(out) :: raised     !! not 0: interrupted by the user
    type(tape_t) :: tape
    real(dp), pointer, contiguous :: times(:)
    integer :: i

    raised = 0
    n_left = 0
    many%status = NEEDS_FALLBACK
    if (many%n_rows == 0) return
    call solve_lanes(packed, many, raised)
    if (size(alone) == 0) return
    tape = tape_of(alone(WAVES:))
    do i = 1, many%n
      if (many%status(1, i) /= NEEDS_FALLBACK) cycle
      n_left = n_left + 1
      if (raised == 0 .and. mod(n_left, BETWEEN_LOOKS) == 0) raised = interrupt_raised()
      if (raised /= 0) return
      if (size(many%parameters, 2) > 0) then
        tape%constants(:size(many%parameters, 1)) = &
          many%parameters(:, of_body(size(many%parameters, 2), i))
      end if
      times => many%times(:, of_body(size(many%times, 2), i))
      call solve_alone(tape, request_t(many%omega0(:, i), alone(TOLERANCE), alone(EFFORT), times), &
                       many, i, raised)
    end do
  end subroutine solve_tape_bodies

  subroutine solve_lanes(packed, many, raised)
    !! Solve bodies side by side; the status of a body that this leaves is unchanged.
    real(dp), intent(in), target, contiguous :: packed(0:)
    type(many_t), intent(in) :: many
    integer, intent(out) :: raised
    type(tape_t) :: equations
    type(tape_bodies_t) :: bodies

    equations = tape_of(packed(WAVES:))
    bodies%tape = arrays_of(equations, c_null_ptr, c_null_ptr, c_null_ptr)
    bodies%table_starts = c_loc(equations%table_starts)
    bodies%breaks = c_loc(equations%breaks)
    bodies%pieces = c_loc(equations%pieces)
    bodies%tolerance = min(packed(TOLERANCE), COARSEST)
    bodies%n_slots = equations%n_slots
    bodies%n_tables = size(equations%table_starts, 1) - 1
    bodies%n = many%n
    bodies%n_rows = many%n_rows
    bodies%n_own = many%n_own
    bodies%n_times = size(many%times, 2)
    bodies%omega0 = c_loc(many%omega0)
    bodies%attitude0 = c_loc(many%attitude0)
    bodies%own0 = c_loc(many%own0)
    bodies%own_sizes = c_loc(many%own_sizes)
    bodies%times = c_loc(many%times)
    bodies%omega = c_loc(many%omega)
    bodies%attitude = c_loc(many%attitude)
    bodies%own = c_loc(many%own)
    bodies%status = c_loc(many%status)
    bodies%estimates = c_null_ptr
    if (size(many%estimates, 3) > 0) bodies%estimates = c_loc(many%estimates)
    bodies%n_parameters = size(many%parameters, 1)
    bodies%n_sets = 0
    if (bodies%n_parameters > 0) bodies%n_sets = size(many%parameters, 2)
    bodies%parameters = c_loc(many%parameters)
    call tape_bodies(bodies)
    raised = bodies%interrupted
  end subroutine solve_lanes

  subroutine solve_alone(tape, request, many, i, raised)
    !! Solve body i: all its times by one integration, or each by its own if that fails.
    type(tape_t), intent(in) :: tape
    type(request_t), intent(in) :: request
    type(many_t), intent(inout) :: many
    integer, intent(in) :: i
    integer, intent(inout) :: raised
    integer :: row, status

    call solve_rows(tape, request, many, i, 1, many%n_rows, status)
    do row = 1, merge(many%n_rows, 0, status /= COMPLETE .and. many%n_rows > 1)
      if (status == INTERRUPTED) exit
      call solve_rows(tape, request, many, i, row, row, status)
    end do
    if (status == INTERRUPTED) raised = 1
  end subroutine solve_alone

  subroutine solve_rows(tape, request, many, i, first, last, status)
    !! Integrate to some times of body i, and set its results there.
    type(tape_t), intent(in) :: tape
    type(request_t), intent(in) :: request
    type(many_t), intent(inout) :: many
    integer, intent(in) :: i, first, last
    integer, intent(out) :: status
    type(solution_t) :: solution
    real(dp), target :: rows(3, last - first + 1), times(last - first + 1), sizes(many%n_own)
    real(dp), target :: attitudes(4, 0:last - first + 1), own(many%n_own + 1, 0:last - first + 1)
    real(dp) :: nan, largest
    integer :: column

    ! ieee_value is not used: its module makes the binary depend on libgfortran.
    nan = transfer(huge(0_int64), 1.0_dp)
    column = min(i, size(many%attitude0, 2))
    times = request%times(first:last)
    sizes = many%own_sizes(:many%n_own)
    own = 0.0_dp
    own(:many%n_own, 0) = many%own0(i, :)
    attitudes = 0.0_dp
    if (column > 0) attitudes(:, 0) = many%attitude0(:, column)
    largest = maxval(abs(request%omega))
    solution%status = REFUSED
    solution%rows => rows
    if (column > 0) solution%attitudes => attitudes
    if (many%n_own > 0) then
      solution%own => own
      solution%own_sizes => sizes
    end if
    ! A recorded torque is not rescaled here; `solve` does that.
    if (all(abs(request%omega) <= huge(nan)) .and. all(abs(attitudes(:, 0)) <= huge(nan)) &
        .and. all(abs(own(:, 0)) <= huge(nan)) .and. all(abs(times) <= huge(nan)) &
        .and. all(abs(tape%constants) <= huge(nan)) &
        .and. (largest <= LARGE .and. (largest*LARGE >= 1.0_dp .or. .not. largest > 0.0_dp))) then
      call tape_solve(tape, request_t(request%omega, request%tolerance, request%effort, times), &
                      solution)
    end if
    status = solution%status
    many%status(first:last, i) = int(status, i1)
    if (.not. is_result(status)) then
      rows = nan
      attitudes = nan
      own = nan
      solution%error = nan
      solution%growth = nan
    end if
    many%omega(:, first:last, i) = rows
    if (column > 0) many%attitude(:, first:last, i) = attitudes(:, 1:)
    if (many%n_own > 0) many%own(first:last, i, :) = transpose(own(:many%n_own, 1:))
    if (size(many%estimates, 3) > 0) then
      many%estimates(1, first:last, i) = solution%error
      many%estimates(2, first:last, i) = solution%growth
    end if
  end subroutine solve_rows

end module many_tape

module bodies
  !! Many bodies with their initial omegas: the input of the kernels for ensembles. An array with
  !! one column applies to all bodies. A wave is one sine or cosine term of the torque. Bodies that
  !! these kernels cannot solve accurately are left to the single-body kernel (solve_prepared of
  !! prepared.f90).
  use, intrinsic :: iso_c_binding, only: c_int8_t
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: i1 = c_int8_t
  integer, parameter, public :: LANES = 64   !! bodies side by side, one in each lane
  integer, parameter, public :: A_GROUP = 8  !! bodies in a register: blocks are multiples of it
  integer(i1), parameter, public :: NEEDS_FALLBACK = -1_i1 !! status: left to the single-body kernel
  ! Status before the multi-lane kernels run: which of them solves the body (see many_kinds.f90).
  integer(i1), parameter, public :: FREE = -2_i1    !! no torque: the closed form
  integer(i1), parameter, public :: STEPPED = -3_i1 !! constant torque: a fixed step
  integer(i1), parameter, public :: RAMPED = -4_i1  !! torque without waves: the series
  integer(i1), parameter, public :: WAVED = -5_i1   !! torque with waves: the series
  integer, parameter, public :: MOST_WAVES = 16 !! of a body in a lane; the single-body kernel
  !! takes any number

  type, public :: bodies_t
    logical :: by_moments       !! body in kg m2, torque in N m; else A, B, C and rad/s2
    real(dp) :: tolerance       !! relative
    real(dp) :: step            !! s, of the methods with a fixed step
    real(dp) :: effort          !! factor on the work limit of each body
    integer :: n                !! number of bodies
    real(dp), pointer, contiguous :: body(:, :)         !! (3, 1 or n)
    !! (3, 0, 1 or n): moments, over any number, of bodies by coefficients; 0: unknown
    real(dp), pointer, contiguous :: moments(:, :)
    real(dp), pointer, contiguous :: constant(:, :)     !! (3, 1 or n)
    real(dp), pointer, contiguous :: rate(:, :)         !! (3, 1 or n)
    real(dp), pointer, contiguous :: sines(:, :, :)     !! (4, waves, 1 or n), as in problem_t
    real(dp), pointer, contiguous :: cosines(:, :, :)   !! (4, waves, 1 or n)
    logical :: is_rounded = .false.                    !! as ROUNDED of the module places
    real(dp), pointer, contiguous :: omega0(:, :)       !! (3, n), rad/s
    real(dp), pointer, contiguous :: times(:)           !! (1 or n), s
    real(dp), pointer, contiguous :: attitude0(:, :)    !! (4, 0, 1 or n), quaternions
    real(dp), pointer, contiguous :: attitude(:, :)     !! (4, 0 or n), results
    !! (2, 0 or n), results: estimated relative error, and amplification; negative: unknown
    real(dp), pointer, contiguous :: estimates(:, :)
    !! (n_rows), s: of one sign, ordered away from 0; the last is the time of all bodies; or null
    real(dp), pointer, contiguous :: row_times(:) => null()
    integer, pointer, contiguous :: places(:) => null() !! (n_rows), of each row in the results
    real(dp), pointer, contiguous :: omega_rows(:, :, :) => null()    !! (3, places, n), results
    real(dp), pointer, contiguous :: attitude_rows(:, :, :) => null() !! (4, places, 0 or n)
    !! (2, places, 0 or n), results: as `estimates`
    real(dp), pointer, contiguous :: estimate_rows(:, :, :) => null()
    integer(i1) :: mark         !! status of the bodies that a kernel must solve
    integer :: n_waves          !! largest number of waves that act on one of them
  end type bodies_t

  public :: acts, coefficients_of, has_torque, last_row, of_body, put_attitude, put_estimates, &
            with_attitude

contains

  pure integer function of_body(count, i)
    !! Return the column of body i in an array of `count` columns.
    integer, intent(in) :: count, i

    of_body = merge(1, i, count == 1)
  end function of_body

  pure logical function with_attitude(bodies)
    !! Return whether attitudes are requested.
    type(bodies_t), intent(in) :: bodies

    with_attitude = size(bodies%attitude0, 2) > 0
  end function with_attitude

  pure integer function last_row(bodies)
    !! Return the number of results of a body.
    type(bodies_t), intent(in) :: bodies

    last_row = 1
    if (associated(bodies%row_times)) last_row = size(bodies%row_times)
  end function last_row

  subroutine put_estimates(bodies, i, row, error, growth)
    !! Store the estimates of body i if they are requested.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    integer, intent(in) :: row     !! of the results, if there are several of a body
    real(dp), intent(in) :: error  !! of the result, relative; negative: unknown
    real(dp), intent(in) :: growth !! error amplification; negative: unknown

    if (associated(bodies%row_times)) then
      if (size(bodies%estimate_rows, 3) > 0) then
        bodies%estimate_rows(:, bodies%places(row), i) = [error, growth]
      end if
    else if (size(bodies%estimates, 2) > 0) then
      bodies%estimates(:, i) = [error, growth]
    end if
  end subroutine put_estimates

  subroutine put_attitude(bodies, i, row, attitude)
    !! Store an attitude of body i.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i, row        !! as in put_estimates
    real(dp), intent(in) :: attitude(4)

    if (associated(bodies%row_times)) then
      bodies%attitude_rows(:, bodies%places(row), i) = attitude
    else
      bodies%attitude(:, i) = attitude
    end if
  end subroutine put_attitude

  pure function coefficients_of(bodies, i) result(a)
    !! Compute A, B, C of equations 13-15.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    real(dp) :: a(3)

    a = bodies%body(:, of_body(size(bodies%body, 2), i))
    if (bodies%by_moments) a = [(a(2) - a(3))/a(1), (a(3) - a(1))/a(2), (a(1) - a(2))/a(3)]
  end function coefficients_of

  pure logical function acts(wave)
    !! Return whether an amplitude of a wave is not zero. A wave that is not finite acts, so that
    !! its body has no result.
    real(dp), intent(in) :: wave(4)  !! as in problem_t

    acts = .not. (abs(wave(1)) <= 0.0_dp .and. abs(wave(2)) <= 0.0_dp .and. abs(wave(3)) <= 0.0_dp &
                  .and. abs(wave(4)) <= huge(wave))
  end function acts

  pure logical function has_torque(vector)
    !! Return whether a constant torque or its rate is not zero. NaN is not zero.
    real(dp), intent(in) :: vector(3)

    has_torque = .not. (abs(vector(1)) <= 0.0_dp .and. abs(vector(2)) <= 0.0_dp &
                        .and. abs(vector(3)) <= 0.0_dp)
  end function has_torque

end module bodies

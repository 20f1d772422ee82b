module prepared
  !! One door for a solver that was prepared: all that does not change lies packed in one array,
  !! so that a call from Python converts three arguments and not fourteen.
  use, intrinsic :: iso_fortran_env, only: int64
  use fixed_step, only: fixed_step_rows, IMPROVED_EULER, RUNGE_KUTTA_4, TAYLOR_3
  use gauss_collocation, only: gauss_rows
  use kinds, only: dp
  use levels, only: quick_solve, taylor_solve
  use sphere, only: sphere_rows
  use statuses, only: COMPLETE, OVERFLOW, REFUSED
  use torque_free, only: torque_free_end
  implicit none(type, external)
  private

  ! Places in the packed array; pyharness/solver.py fills it.
  integer, parameter :: METHOD = 1
  integer, parameter :: TOLERANCE = 2    ! relative, of the series
  integer, parameter :: STEP = 3         ! s, of the methods with a fixed step
  integer, parameter :: N_SINES = 4
  integer, parameter :: N_COSINES = 5
  integer, parameter :: COEFFICIENTS = 6 ! three
  integer, parameter :: M_CONSTANT = 9   ! three, 1/s2
  integer, parameter :: M_RATE = 12      ! three, 1/s3
  integer, parameter :: STATUS = 15      ! out
  integer, parameter :: STEPS = 16       ! out: steps, or right-hand sides, of the last call
  integer, parameter :: WAVES = 17       ! four for each sine, then for each cosine

  ! Values of METHOD; 10 + s is Gauss collocation of s stages.
  integer, parameter :: TORQUE_FREE = 1
  integer, parameter :: SPHERE = 2
  integer, parameter :: SERIES = 3
  integer, parameter :: EULER_STEPS = 4
  integer, parameter :: TAYLOR_3_STEPS = 5
  integer, parameter :: RUNGE_KUTTA_STEPS = 6
  integer, parameter :: QUICK = 7           ! Runge-Kutta for few digits
  integer, parameter :: QUICK_OR_SERIES = 8 ! whichever takes fewer operations
  integer, parameter :: GAUSS = 10

  public :: solve_prepared

contains

  subroutine solve_prepared(packed, n_packed, omega0, t_end, omega)
    !! Angular velocity at `t_end` by the method that was prepared; NaN unless STATUS is 0.
    integer, intent(in) :: n_packed
    real(dp), intent(inout) :: packed(n_packed)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    real(dp) :: times(1)
    real(dp) :: rows(3, 1)
    real(dp) :: reached(4)
    integer :: sines
    integer :: cosines
    integer :: cosines_at
    integer :: n_rows
    integer :: ended
    integer :: count
    integer :: evaluations

    sines = int(packed(N_SINES))
    cosines = int(packed(N_COSINES))
    cosines_at = WAVES + 4*sines
    times(1) = t_end
    count = 0
    select case (int(packed(METHOD)))
    case (TORQUE_FREE)
      call torque_free_end(packed(COEFFICIENTS:COEFFICIENTS + 2), omega0, t_end, omega, ended)
    case (SPHERE)
      call sphere_rows(packed(M_CONSTANT), packed(M_RATE), sines, packed(WAVES), cosines, &
                       packed(cosines_at), omega0, 1, times, rows, n_rows, ended)
      omega = rows(:, 1)
    case (SERIES, QUICK, QUICK_OR_SERIES)
      ended = REFUSED
      if (int(packed(METHOD)) /= SERIES) then
        call quick_solve(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                         packed(WAVES), cosines, packed(cosines_at), omega0, packed(TOLERANCE), &
                         t_end, int(packed(METHOD)) - QUICK, omega, ended, count)
      end if
      if (ended /= COMPLETE .and. int(packed(METHOD)) /= QUICK) then
        call taylor_solve(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                          packed(WAVES), cosines, packed(cosines_at), omega0, packed(TOLERANCE), &
                          1, times, rows, n_rows, ended, count)
        omega = rows(:, 1)
      end if
    case (EULER_STEPS:RUNGE_KUTTA_STEPS)
      call fixed_step_rows(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                           packed(WAVES), cosines, packed(cosines_at), omega0, 1, times, &
                           fixed_method(int(packed(METHOD))), packed(STEP), rows, n_rows, ended, &
                           count, evaluations)
      omega = rows(:, 1)
    case default
      call gauss_rows(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                      packed(WAVES), cosines, packed(cosines_at), omega0, 1, times, &
                      int(packed(METHOD)) - GAUSS, packed(STEP), rows, reached, n_rows, ended, &
                      count)
      omega = rows(:, 1)
    end select
    ! A start that is not finite may come back as it is, at time 0 for one.
    if (ended == COMPLETE .and. .not. all(abs(omega) <= huge(t_end))) ended = OVERFLOW
    packed(STATUS) = real(ended, dp)
    packed(STEPS) = real(count, dp)
    ! Not ieee_value: that module ties the binary to libgfortran.
    if (ended /= COMPLETE) omega = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared

  pure integer function fixed_method(code)
    !! The fixed-step method of a value of METHOD.
    integer, intent(in) :: code

    select case (code)
    case (EULER_STEPS)
      fixed_method = IMPROVED_EULER
    case (TAYLOR_3_STEPS)
      fixed_method = TAYLOR_3
    case default
      fixed_method = RUNGE_KUTTA_4
    end select
  end function fixed_method

end module prepared

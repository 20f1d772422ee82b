module prepared
  !! One door for a solver that was prepared: all that does not change lies packed in one array,
  !! so that a call from Python converts three arguments and not fourteen.
  use, intrinsic :: iso_fortran_env, only: int64
  use fixed_step, only: fixed_step_rows, IMPROVED_EULER, RUNGE_KUTTA_4, TAYLOR_3
  use gauss_collocation, only: gauss_rows
  use kinds, only: dp
  use levels, only: quick_solve, taylor_solve
  use sphere, only: sphere_rows
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW, REFUSED
  use torque_free, only: torque_free_end
  implicit none(type, external)
  private

  ! Places in the packed array; pyharness/methods/prepared.py fills it, and any number of threads read it.
  integer, parameter :: METHOD = 1
  integer, parameter :: TOLERANCE = 2    ! relative, of the series
  integer, parameter :: STEP = 3         ! s, of the methods with a fixed step
  integer, parameter :: N_SINES = 4
  integer, parameter :: N_COSINES = 5
  integer, parameter :: COEFFICIENTS = 6 ! three
  integer, parameter :: M_CONSTANT = 9   ! three, 1/s2
  integer, parameter :: M_RATE = 12      ! three, 1/s3
  integer, parameter :: EFFORT = 15      ! factor on the limits
  integer, parameter :: WAVES = 16       ! four for each sine, then for each cosine

  ! Values of METHOD; 10 + s is Gauss collocation of s stages.
  integer, parameter :: TORQUE_FREE = 1
  integer, parameter :: SPHERE = 2
  integer, parameter :: SERIES = 3
  integer, parameter :: EULER_STEPS = 4
  integer, parameter :: TAYLOR_3_STEPS = 5
  integer, parameter :: RUNGE_KUTTA_STEPS = 6
  integer, parameter :: QUICK = 7           ! Runge-Kutta for few digits
  integer, parameter :: QUICK_OR_SERIES = 8 ! whichever takes fewer operations
  integer, parameter :: FREE_OR_SERIES = 9  ! the closed form, or the series where it refuses
  integer, parameter :: GAUSS = 10

  ! Beyond it, or below its inverse, products of omegas may overflow or underflow, though the
  ! solution is an ordinary number.
  real(dp), parameter :: LARGE = 2.0_dp**300
  integer, parameter :: MOST_POWER = 1000
  ! With few digits the series' own tolerance is cheap, and its estimate of growth is coarse.
  real(dp), parameter :: AUTO_SHARE = 0.25_dp

  public :: solve_prepared

contains

  subroutine solve_prepared(packed, n_packed, omega0, t_end, omega, status, steps)
    !! Angular velocity at `t_end` by the method that was prepared; NaN unless `status` is 0.
    integer, intent(in) :: n_packed
    real(dp), intent(in) :: packed(n_packed)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: status     !! of the module statuses
    integer(int64), intent(out) :: steps !! or right-hand sides, of Gauss collocation
    real(dp) :: largest

    largest = max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3)))
    if (largest <= LARGE .and. largest*LARGE >= 1.0_dp) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps)
    else
      call solve_near_one(packed, n_packed, omega0, t_end, largest, omega, status, steps)
    end if
    ! Not ieee_value: that module ties the binary to libgfortran.
    if (status /= COMPLETE) omega = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared

  subroutine solve_near_one(packed, n_packed, omega0, t_end, largest, omega, status, steps)
    !! The same in units that bring omega near 1, by a power of two: it changes no digit.
    integer, intent(in) :: n_packed
    real(dp), intent(in) :: packed(n_packed)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(in) :: largest    !! of omega0, rad/s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: status     !! of the module statuses
    integer(int64), intent(out) :: steps !! or right-hand sides, of Gauss collocation
    real(dp) :: copy(n_packed)
    real(dp) :: start(3)
    real(dp) :: reach      ! omega0 and what the torque gives, rad/s
    real(dp) :: share      ! of its amplitude that a wave comes to
    real(dp) :: time       ! in the new units
    integer :: power       ! omega is 2**power times what it is in the new units
    integer :: i

    reach = largest
    do i = 0, 2
      reach = max(reach, abs(packed(M_CONSTANT + i)*t_end), abs(packed(M_RATE + i)*t_end*t_end))
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 4, 4
      share = 1.0_dp
      ! A slow sine never comes to its amplitude.
      if (i < WAVES + 4*int(packed(N_SINES))) share = min(1.0_dp, abs(packed(i + 3)*t_end))
      reach = max(reach, maxval(abs(packed(i:i + 2)*t_end*share)))
    end do
    power = 0
    if (reach > 0.0_dp .and. reach <= huge(reach)) then
      if (.not. (reach <= LARGE .and. reach*LARGE >= 1.0_dp)) power = exponent(reach)
    end if
    power = max(-MOST_POWER, min(MOST_POWER, power))
    time = scale(t_end, power)
    copy = packed
    ! Where the step plays no part it may be no number in the new unit.
    if (in_steps(int(packed(METHOD)))) copy(STEP) = scale(packed(STEP), power)
    do i = 0, 2
      copy(M_CONSTANT + i) = scale(scale(packed(M_CONSTANT + i), -power), -power)
      copy(M_RATE + i) = scale(scale(scale(packed(M_RATE + i), -power), -power), -power)
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 1
      copy(i) = scale(packed(i), -power)
      if (mod(i - WAVES, 4) /= 3) copy(i) = scale(copy(i), -power)
    end do
    ! In so short a time that it, or a torque, is no number then, products don't matter.
    if (.not. (all(abs(copy) <= huge(time)) .and. abs(time) <= huge(time) &
               .and. (abs(time) >= tiny(time) .or. .not. abs(t_end) > 0.0_dp))) power = 0
    if (power == 0) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps)
      return
    end if
    do i = 1, 3
      start(i) = scale(omega0(i), -power)
    end do
    call solve_as_given(copy, n_packed, start, time, omega, status, steps)
    ! Else omega means nothing, and may be no number at all.
    if (status == COMPLETE) then
      do i = 1, 3
        omega(i) = scale(omega(i), power)
      end do
      if (.not. all(abs(omega) <= huge(time))) status = OVERFLOW
    end if
  end subroutine solve_near_one

  subroutine solve_as_given(packed, n_packed, omega0, t_end, omega, ended, count)
    !! The same without a look at the scale; omega means nothing unless `ended` is 0.
    integer, intent(in) :: n_packed
    real(dp), intent(in) :: packed(n_packed)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: ended      !! of the module statuses
    integer(int64), intent(out) :: count !! or right-hand sides, of Gauss collocation
    real(dp) :: times(1)
    real(dp) :: rows(3, 1)
    real(dp) :: reached(4)
    real(dp) :: tolerance_left
    integer :: sines
    integer :: cosines
    integer :: cosines_at
    integer :: n_rows
    integer :: quick_steps
    integer(int64) :: evaluations
    real(dp) :: needed

    sines = int(packed(N_SINES))
    cosines = int(packed(N_COSINES))
    cosines_at = WAVES + 4*sines
    times(1) = t_end
    count = 0
    select case (int(packed(METHOD)))
    case (TORQUE_FREE, FREE_OR_SERIES)
      call torque_free_end(packed(COEFFICIENTS:COEFFICIENTS + 2), omega0, t_end, omega, ended)
      if (ended == REFUSED .and. int(packed(METHOD)) == FREE_OR_SERIES) then
        call taylor_solve(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                          packed(WAVES), cosines, packed(cosines_at), omega0, packed(TOLERANCE), &
                          packed(EFFORT), 1, times, rows, n_rows, ended, count, needed)
        omega = rows(:, 1)
      end if
    case (SPHERE)
      call sphere_rows(packed(M_CONSTANT), packed(M_RATE), sines, packed(WAVES), cosines, &
                       packed(cosines_at), omega0, packed(EFFORT), 1, times, rows, n_rows, ended, &
                       needed)
      omega = rows(:, 1)
    case (SERIES, QUICK, QUICK_OR_SERIES)
      ended = REFUSED
      tolerance_left = packed(TOLERANCE)
      if (int(packed(METHOD)) /= SERIES) then
        tolerance_left = AUTO_SHARE*tolerance_left
        call quick_solve(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                         packed(WAVES), cosines, packed(cosines_at), omega0, packed(TOLERANCE), &
                         packed(EFFORT), t_end, int(packed(METHOD)) - QUICK, omega, ended, &
                         quick_steps)
        count = quick_steps
      end if
      if (ended /= COMPLETE .and. ended /= INTERRUPTED .and. int(packed(METHOD)) /= QUICK) then
        call taylor_solve(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                          packed(WAVES), cosines, packed(cosines_at), omega0, tolerance_left, &
                          packed(EFFORT), 1, times, rows, n_rows, ended, count, needed)
        omega = rows(:, 1)
      end if
    case (EULER_STEPS:RUNGE_KUTTA_STEPS)
      call fixed_step_rows(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                           packed(WAVES), cosines, packed(cosines_at), omega0, 1, times, &
                           fixed_method(int(packed(METHOD))), packed(STEP), packed(EFFORT), rows, &
                           n_rows, ended, count, evaluations, needed)
      omega = rows(:, 1)
    case default
      call gauss_rows(packed(COEFFICIENTS), packed(M_CONSTANT), packed(M_RATE), sines, &
                      packed(WAVES), cosines, packed(cosines_at), omega0, 1, times, &
                      int(packed(METHOD)) - GAUSS, packed(STEP), packed(EFFORT), rows, reached, &
                      n_rows, ended, count)
      omega = rows(:, 1)
    end select
    ! A start that is not finite may come back as it is, at time 0 for one.
    if (ended == COMPLETE) then
      if (.not. all(abs(omega) <= huge(t_end))) ended = OVERFLOW
    end if
  end subroutine solve_as_given

  pure logical function in_steps(code)
    !! Whether the method of a value of METHOD goes in steps that are given.
    integer, intent(in) :: code

    in_steps = code > GAUSS .or. (code >= EULER_STEPS .and. code <= RUNGE_KUTTA_STEPS)
  end function in_steps

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

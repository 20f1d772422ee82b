module prepared
  !! The entry point for prepared solvers. All data that does not change from call to call is packed
  !! in one array, so that a call from Python converts three arguments instead of fourteen.
  use, intrinsic :: iso_fortran_env, only: int64
  use fixed_step, only: fixed_step_rows
  use gauss_collocation, only: gauss_rows
  use kinds, only: dp
  use levels, only: quick_solve, taylor_solve
  use methods, only: CLOSED_FORM, CLOSED_FORM_OR_TAYLOR, GAUSS, IMPROVED_EULER, QUICK, &
                     QUICK_OR_TAYLOR, RK4, SPACE_TORQUE, SPHERE, TAYLOR
  use places, only: COEFFICIENTS, COEFFICIENTS_LOW, CONSTANT, EFFORT, METHOD, MOMENTS, &
                    MOMENTS_LOW, N_COSINES, N_SINES, RATE, STEP, TOLERANCE, WAVES
  use problem, only: problem_t
  use space_torque, only: space_torque_solve
  use sphere, only: sphere_rows
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW, REFUSED, SENSITIVE
  use torque_free, only: torque_free_rows
  use torque_free_attitude, only: torque_free_attitude_rows
  implicit none(type, external)
  private

  ! Above it, or below its inverse, products of omegas may overflow or underflow although the
  ! solution is in range.
  real(dp), parameter :: LARGE = 2.0_dp**300
  integer, parameter :: MOST_POWER = 1000

  public :: solve_prepared, solve_prepared_attitude, unpack

contains

  subroutine solve_prepared(packed, n_packed, omega0, t_end, omega, status, steps, found)
    !! Compute the angular velocity at `t_end` by the prepared method; NaN if there is no result.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps !! or right-hand sides, of Gauss collocation
    real(dp), intent(out) :: found(2)  !! estimated relative error, amplification; negative: unknown
    real(dp) :: largest

    largest = max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3)))
    if (largest <= LARGE .and. largest*LARGE >= 1.0_dp) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps, found)
    else
      call solve_near_one(packed, n_packed, omega0, t_end, largest, omega, status, steps, found)
    end if
    ! ieee_value is not used: its module makes the binary depend on libgfortran.
    if (.not. is_result(status)) omega = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared

  subroutine solve_near_one(packed, n_packed, omega0, t_end, largest, omega, status, steps, found)
    !! Solve in units that bring omega near 1. The scale is a power of two, so no digit changes.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(in) :: largest    !! largest component of omega0, rad/s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps !! or right-hand sides, of Gauss collocation
    real(dp), intent(out) :: found(2)  !! relative, so independent of the units
    real(dp), target :: copy(0:n_packed - 1)
    real(dp) :: start(3)
    real(dp) :: reach      ! bound of omega0 and of what the torque adds, rad/s
    real(dp) :: share      ! part of its amplitude that a wave reaches
    real(dp) :: time       ! in the new units
    integer :: power       ! omega is 2**power times its value in the new units
    integer :: code, i

    reach = largest
    do i = 0, 2
      reach = max(reach, abs(packed(CONSTANT + i)*t_end), abs(packed(RATE + i)*t_end*t_end))
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 4, 4
      share = 1.0_dp
      ! A slow sine does not reach its amplitude.
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
    ! A step that the method does not use may be out of range in the new units.
    code = int(packed(METHOD))
    if (code > GAUSS .or. (code >= IMPROVED_EULER .and. code <= RK4)) then
      copy(STEP) = scale(packed(STEP), power)
    end if
    do i = 0, 2
      copy(CONSTANT + i) = scale(scale(packed(CONSTANT + i), -power), -power)
      copy(RATE + i) = scale(scale(scale(packed(RATE + i), -power), -power), -power)
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 1
      copy(i) = scale(packed(i), -power)
      if (mod(i - WAVES, 4) /= 3) copy(i) = scale(copy(i), -power)
    end do
    ! If the time or a torque is out of range then, the time is so short that products do not
    ! matter.
    if (.not. (all(abs(copy) <= huge(time)) .and. abs(time) <= huge(time) &
               .and. (abs(time) >= tiny(time) .or. .not. abs(t_end) > 0.0_dp))) power = 0
    if (power == 0) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps, found)
      return
    end if
    do i = 1, 3
      start(i) = scale(omega0(i), -power)
    end do
    call solve_as_given(copy, n_packed, start, time, omega, status, steps, found)
    ! Without a result omega has no meaning and may be NaN.
    if (is_result(status)) then
      do i = 1, 3
        omega(i) = scale(omega(i), power)
      end do
      if (.not. all(abs(omega) <= huge(time))) status = OVERFLOW
    end if
  end subroutine solve_near_one

  subroutine solve_as_given(packed, n_packed, omega0, t_end, omega, ended, count, found)
    !! Solve without regard to the scale. Without a result omega has no meaning.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: ended      !! code of the module statuses
    integer(int64), intent(out) :: count !! or right-hand sides, of Gauss collocation
    real(dp), intent(out) :: found(2)  !! estimated relative error, amplification; negative: unknown
    type(problem_t) :: problem
    real(dp) :: times(1)
    real(dp) :: reached(4)
    integer :: code, n_rows, quick_steps
    integer(int64) :: evaluations
    real(dp) :: needed, estimates(3), no_attitude(4, 1)

    code = int(packed(METHOD))
    times(1) = t_end
    count = 0
    found = -1.0_dp
    select case (code)
    case (CLOSED_FORM, CLOSED_FORM_OR_TAYLOR)
      call torque_free_rows(packed(COEFFICIENTS:COEFFICIENTS + 2), &
                            packed(COEFFICIENTS_LOW:COEFFICIENTS_LOW + 2), omega0, 1, times, &
                            omega, n_rows, ended)
      if (ended == REFUSED .and. code == CLOSED_FORM_OR_TAYLOR) then
        call unpack(packed, n_packed, problem)
        call taylor_solve(problem, omega0, packed(TOLERANCE), packed(EFFORT), 1, times, omega, &
                          0, no_attitude, n_rows, ended, count, needed, estimates)
        found = estimates(:2)
      end if
    case (SPHERE)
      call unpack(packed, n_packed, problem)
      call sphere_rows(problem, omega0, packed(EFFORT), 1, times, omega, n_rows, ended, needed)
    case (TAYLOR, QUICK, QUICK_OR_TAYLOR)
      call unpack(packed, n_packed, problem)
      ended = REFUSED
      if (code /= TAYLOR) then
        call quick_solve(problem, omega0, packed(TOLERANCE), packed(EFFORT), t_end, &
                         merge(1, 0, code == QUICK_OR_TAYLOR), omega, ended, quick_steps, &
                         found(1))
        ! A negative number of steps tells the caller that the kernel chose quick.
        count = merge(-quick_steps, quick_steps, code == QUICK_OR_TAYLOR)
        if (code == QUICK .and. ended == SENSITIVE) then
          call compare_with_series(problem, omega0, packed(TOLERANCE), packed(EFFORT), times, &
                                   omega, ended, found)
        end if
      end if
      if (ended /= COMPLETE .and. ended /= INTERRUPTED .and. code /= QUICK) then
        call taylor_solve(problem, omega0, packed(TOLERANCE), packed(EFFORT), 1, times, omega, &
                          0, no_attitude, n_rows, ended, count, needed, estimates)
        found = estimates(:2)
      end if
    case (IMPROVED_EULER:RK4)
      call unpack(packed, n_packed, problem)
      call fixed_step_rows(problem, omega0, 1, times, code, packed(STEP), packed(EFFORT), omega, &
                           n_rows, ended, count, evaluations, needed)
    case default
      call unpack(packed, n_packed, problem)
      call gauss_rows(problem, omega0, 1, times, code - GAUSS, packed(STEP), packed(EFFORT), &
                      omega, reached, n_rows, ended, count)
    end select
    ! A start that is not finite may be returned as it is, for example at time 0.
    if (is_result(ended)) then
      if (.not. all(abs(omega) <= huge(t_end))) ended = OVERFLOW
    end if
  end subroutine solve_as_given

  subroutine compare_with_series(problem, omega0, tolerance, effort, times, omega, ended, found)
    !! Compare with the series a result whose method does not measure the amplification of rounding
    !! errors: compute its error and amplification.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: tolerance, effort
    real(dp), intent(in) :: times(1)   !! s
    real(dp), intent(in) :: omega(3)   !! the result, rad/s
    integer, intent(inout) :: ended    !! SENSITIVE, or COMPLETE if the series excludes that
    real(dp), intent(inout) :: found(2) !! estimated relative error, amplification; below 0: unknown
    real(dp) :: other(3, 1), no_attitude(4, 1)
    real(dp) :: needed, estimates(3)
    integer :: n_rows, ended_other
    integer(int64) :: count

    call taylor_solve(problem, omega0, tolerance, effort, 1, times, other, 0, no_attitude, n_rows, &
                      ended_other, count, needed, estimates)
    if (ended_other == INTERRUPTED) ended = INTERRUPTED
    if (.not. is_result(ended_other)) then
      found = -1.0_dp
      return
    end if
    found(1) = max(found(1), maxval(abs(omega - other(:, 1))) &
                   /max(maxval(abs(omega0)), maxval(abs(omega)), tiny(needed))) + estimates(1)
    found(2) = estimates(2)
    if (ended_other == COMPLETE .and. found(1) <= tolerance) ended = COMPLETE
  end subroutine compare_with_series

  subroutine solve_prepared_attitude(packed, n_packed, start, t_end, state, status, steps, found)
    !! Compute angular velocity and attitude at `t_end`; NaN if there is no result.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: start(7)   !! omega, rad/s, and a unit quaternion, scalar first
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: state(7)
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps
    real(dp), intent(out) :: found(2)  !! estimated relative error, amplification; negative: unknown
    type(problem_t) :: problem
    real(dp) :: times(1)
    integer :: code, n_rows
    real(dp) :: needed, estimates(3), attitudes(4, 0:1)

    code = int(packed(METHOD))
    times(1) = t_end
    steps = 0
    found = -1.0_dp
    if (.not. (all(abs(start) <= huge(t_end)) .and. abs(t_end) <= huge(t_end))) then
      status = OVERFLOW
    else
      status = REFUSED
      attitudes(:, 0) = start(4:)
      if (code == SPACE_TORQUE) then
        call unpack(packed, n_packed, problem)
        call space_torque_solve(problem, &
                                maxval(packed(MOMENTS:MOMENTS + 2))/packed(MOMENTS:MOMENTS + 2), &
                                start(:3), packed(TOLERANCE), packed(EFFORT), 1, times, state(:3), &
                                attitudes, n_rows, status, steps, needed, estimates)
        state(4:) = attitudes(:, 1)
        found = estimates(:2)
      else if (code /= TAYLOR) then
        call torque_free_attitude_rows(packed(MOMENTS:MOMENTS + 2), &
                                       packed(MOMENTS_LOW:MOMENTS_LOW + 2), start(:3), &
                                       start(4:), 1, times, state(:3), state(4:), n_rows, status)
      end if
      if (status == REFUSED .and. code /= CLOSED_FORM) then
        call unpack(packed, n_packed, problem)
        call taylor_solve(problem, start(:3), packed(TOLERANCE), packed(EFFORT), 1, times, &
                          state(:3), 1, attitudes, n_rows, status, steps, needed, estimates)
        state(4:) = attitudes(:, 1)
        found = estimates(:2)
      end if
    end if
    if (.not. is_result(status)) state = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared_attitude

  pure logical function is_result(status)
    !! Return whether there is an omega, even if rounding errors have cost all of its digits.
    integer, intent(in) :: status

    is_result = status == COMPLETE .or. status == SENSITIVE
  end function is_result

  subroutine unpack(packed, n_packed, problem)
    !! Unpack the coefficients and the torque. The waves are not copied.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    type(problem_t), intent(out) :: problem
    integer :: middle

    problem%coefficients = packed(COEFFICIENTS:COEFFICIENTS + 2)
    problem%constant = packed(CONSTANT:CONSTANT + 2)
    problem%rate = packed(RATE:RATE + 2)
    problem%n_sines = int(packed(N_SINES))
    problem%n_cosines = int(packed(N_COSINES))
    ! The pointers are set only if there is a wave, to save time.
    if (problem%n_sines + problem%n_cosines > 0) then
      middle = WAVES + 4*problem%n_sines
      problem%sines(1:4, 1:problem%n_sines) => packed(WAVES:middle - 1)
      problem%cosines(1:4, 1:problem%n_cosines) => packed(middle:middle + 4*problem%n_cosines - 1)
    end if
  end subroutine unpack

end module prepared

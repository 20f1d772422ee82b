module prepared
  !! The entry point for prepared solvers. All data that does not change from call to call is packed
  !! in one array, so that a call from Python converts three arguments instead of fourteen.
  use, intrinsic :: iso_fortran_env, only: int64
  use fixed_step, only: fixed_step_rows
  use gauss_collocation, only: gauss_rows
  use kinds, only: dp
  use levels, only: quick_solve, tape_solve, taylor_solve
  use methods, only: CLOSED_FORM, CLOSED_FORM_OR_TAYLOR, FIXED, GAUSS, QUICK, QUICK_OR_TAYLOR, &
                     SPHERE, TAPE, TAYLOR
  use places, only: COEFFICIENTS, COEFFICIENTS_LOW, CONSTANT, EFFORT, METHOD, MOMENTS, &
                    MOMENTS_LOW, N_COSINES, N_SINES, RATE, STEP, TOLERANCE, WAVES
  use prepared_scale, only: bring_near_one, is_result, LARGE, scale_back
  use problem, only: problem_t, request_t, solution_t
  use sphere, only: sphere_rows
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW, REFUSED, SENSITIVE
  use tape, only: tape_of
  use torque_free, only: torque_free_rows
  use torque_free_attitude, only: torque_free_attitude_rows
  implicit none(type, external)
  private

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
    real(dp), intent(out) :: found(3)  !! error, amplification, steps in all; below 0: unknown
    real(dp) :: largest

    largest = max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3)))
    if (int(packed(METHOD)) == TAPE) then
      call solve_recorded(packed, omega0, t_end, omega, status, steps, found)
    else if (largest <= LARGE .and. largest*LARGE >= 1.0_dp) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps, found)
    else
      call solve_near_one(packed, n_packed, omega0, t_end, omega, status, steps, found)
    end if
    ! ieee_value is not used: its module makes the binary depend on libgfortran.
    if (.not. is_result(status)) omega = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared

  subroutine solve_recorded(packed, start, t_end, state, status, steps, found)
    !! Solve a scene with a recorded torque: omega, or omega and attitude.
    real(dp), intent(in), target, contiguous :: packed(0:)
    real(dp), intent(in), contiguous :: start(:) !! (3 or 7): rad/s, and a unit quaternion
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(inout), target, contiguous :: state(:) !! as start
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps
    real(dp), intent(out) :: found(3)  !! error, amplification, steps in all; below 0: unknown
    type(solution_t) :: solution
    real(dp), target :: times(1), attitudes(4, 0:1)
    real(dp) :: largest

    times(1) = t_end
    steps = 0
    found = -1.0_dp
    status = REFUSED
    if (.not. (all(abs(start) <= huge(t_end)) .and. abs(t_end) <= huge(t_end))) return
    largest = maxval(abs(start(:3)))
    ! A recorded torque is not rescaled here; `solve` does that.
    if (.not. (largest <= LARGE .and. (largest*LARGE >= 1.0_dp .or. .not. largest > 0.0_dp))) return
    solution%rows(1:3, 1:1) => state(:3)
    if (size(start) > 3) then
      attitudes(:, 0) = start(4:)
      solution%attitudes(1:4, 0:1) => attitudes
    end if
    call tape_solve(tape_of(packed(WAVES:)), &
                    request_t(start(:3), packed(TOLERANCE), packed(EFFORT), times), solution)
    if (size(start) > 3) state(4:) = attitudes(:, 1)
    status = solution%status
    steps = solution%steps
    found = [solution%error, solution%growth, solution%spent]
  end subroutine solve_recorded

  subroutine solve_near_one(packed, n_packed, omega0, t_end, omega, status, steps, found)
    !! Solve in units that bring omega near 1.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: omega(3)  !! rad/s
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps !! or right-hand sides, of Gauss collocation
    real(dp), intent(out) :: found(3)  !! relative, so independent of the units
    real(dp), target :: copy(0:n_packed - 1)
    real(dp) :: start(3)
    real(dp) :: time       ! in the new units
    integer :: power       ! omega is 2**power times its value in the new units

    call bring_near_one(packed, n_packed, omega0, t_end, copy, start, time, power)
    if (power == 0) then
      call solve_as_given(packed, n_packed, omega0, t_end, omega, status, steps, found)
      return
    end if
    call solve_as_given(copy, n_packed, start, time, omega, status, steps, found)
    call scale_back(power, omega, status)
  end subroutine solve_near_one

  subroutine solve_as_given(packed, n_packed, omega0, t_end, omega, ended, count, found)
    !! Solve without regard to the scale. Without a result omega has no meaning.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out), target :: omega(3)  !! rad/s
    integer, intent(out) :: ended      !! code of the module statuses
    integer(int64), intent(out) :: count !! or right-hand sides, of Gauss collocation
    real(dp), intent(out) :: found(3)  !! error, amplification, steps in all; below 0: unknown
    type(problem_t) :: problem
    type(solution_t) :: solution
    real(dp), target :: times(1)
    real(dp) :: reached(4)
    integer :: code, n_rows

    code = int(packed(METHOD))
    times(1) = t_end
    count = 0
    found = -1.0_dp
    ended = REFUSED
    if (code == CLOSED_FORM .or. code == CLOSED_FORM_OR_TAYLOR) then
      call torque_free_rows(packed(COEFFICIENTS:COEFFICIENTS + 2), &
                            packed(COEFFICIENTS_LOW:COEFFICIENTS_LOW + 2), omega0, 1, times, &
                            omega, n_rows, ended)
    end if
    if (ended == REFUSED .and. code /= CLOSED_FORM) then
      call unpack(packed, n_packed, problem)
      solution%rows(1:3, 1:1) => omega
      associate (request => request_t(omega0, packed(TOLERANCE), packed(EFFORT), times))
        select case (code)
        case (SPHERE)
          call sphere_rows(problem, request, solution)
        case (CLOSED_FORM_OR_TAYLOR, TAYLOR, QUICK, QUICK_OR_TAYLOR)
          call solve_by_series(problem, request, code, solution, found)
        case (FIXED + 1:)
          call fixed_step_rows(problem, request, code, packed(STEP), solution)
        case (GAUSS + 1:GAUSS + 8)
          call gauss_rows(problem, request, code - GAUSS, packed(STEP), solution, reached)
          solution%steps = solution%evaluations
        case default
          solution%status = REFUSED
        end select
      end associate
      ended = solution%status
      count = solution%steps
    end if
    ! A start that is not finite may be returned as it is at time 0, and a steady omega at any time.
    if (is_result(ended)) then
      if (.not. (all(abs(omega) <= huge(t_end)) .and. abs(t_end) <= huge(t_end))) ended = OVERFLOW
    end if
  end subroutine solve_as_given

  subroutine solve_by_series(problem, request, code, solution, found)
    !! Solve by the series, or by quick where this is requested or faster.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request
    integer, intent(in) :: code         !! of the module methods
    type(solution_t), intent(inout) :: solution
    real(dp), intent(out) :: found(3)   !! error, amplification, steps in all; below 0: unknown

    found = -1.0_dp
    if (code == QUICK .or. code == QUICK_OR_TAYLOR) then
      call quick_solve(problem, request, merge(1, 0, code == QUICK_OR_TAYLOR), solution)
      found(1) = solution%error
      if (code == QUICK) then
        if (solution%status == SENSITIVE) then
          call compare_with_series(problem, request, solution%rows(:, 1), solution%status, found)
        end if
        return
      end if
      ! A negative number of steps tells the caller that the kernel chose quick.
      solution%steps = -solution%steps
      if (solution%status == COMPLETE .or. solution%status == INTERRUPTED) return
    end if
    call taylor_solve(problem, request, solution)
    found = [solution%error, solution%growth, solution%spent]
  end subroutine solve_by_series

  subroutine compare_with_series(problem, request, omega, ended, found)
    !! Compute the error and the error amplification of a result by the series, because the method
    !! of the result does not measure them.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request
    real(dp), intent(in) :: omega(3)   !! the result, rad/s
    integer, intent(inout) :: ended    !! SENSITIVE, or COMPLETE if the series excludes that
    real(dp), intent(inout) :: found(3) !! error, amplification, steps in all; below 0: unknown
    real(dp), target :: other(3, 1)
    type(solution_t) :: solution

    solution%rows => other
    call taylor_solve(problem, request, solution)
    if (solution%status == INTERRUPTED) ended = INTERRUPTED
    if (.not. is_result(solution%status)) then
      found = -1.0_dp
      return
    end if
    found(1) = max(found(1), maxval(abs(omega - other(:, 1))) &
                   /max(maxval(abs(request%omega)), maxval(abs(omega)), tiny(found))) &
               + solution%error
    found(2) = solution%growth
    if (solution%status == COMPLETE .and. found(1) <= request%tolerance) ended = COMPLETE
  end subroutine compare_with_series

  subroutine solve_prepared_attitude(packed, n_packed, start, t_end, state, status, steps, found)
    !! Compute angular velocity and attitude at `t_end`; NaN if there is no result.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: start(7)   !! omega, rad/s, and a unit quaternion, scalar first
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out), target :: state(7)
    integer, intent(out) :: status     !! code of the module statuses
    integer(int64), intent(out) :: steps
    real(dp), intent(out) :: found(3)  !! error, amplification, steps in all; below 0: unknown
    type(problem_t) :: problem
    type(solution_t) :: solution
    real(dp), target :: times(1), attitudes(4, 0:1)
    real(dp), target :: copy(0:n_packed - 1) ! in units that bring omega near 1
    real(dp) :: omega0(3)   ! in these units
    real(dp) :: largest     ! omega at time 0, rad/s
    real(dp) :: both(3, 2)  ! moments and their low parts, kg m2
    integer :: code, n_rows
    integer :: power        ! of two, by which omega was divided

    code = int(packed(METHOD))
    times(1) = t_end
    steps = 0
    found = -1.0_dp
    if (code == TAPE) then
      call solve_recorded(packed, start, t_end, state, status, steps, found)
    else if (.not. (all(abs(start) <= huge(t_end)) .and. abs(t_end) <= huge(t_end))) then
      status = OVERFLOW
    else
      status = REFUSED
      if (code /= TAYLOR) then
        both(:, 1) = packed(MOMENTS:MOMENTS + 2)
        both(:, 2) = packed(MOMENTS_LOW:MOMENTS_LOW + 2)
        call torque_free_attitude_rows(both, start, 1, times, state(:3), state(4:), n_rows, status)
      end if
      if (status == REFUSED .and. code /= CLOSED_FORM) then
        power = 0
        largest = maxval(abs(start(:3)))
        if (.not. (largest <= LARGE .and. largest*LARGE >= 1.0_dp)) then
          call bring_near_one(packed, n_packed, start(:3), t_end, copy, omega0, times(1), power)
        end if
        if (power == 0) then
          omega0 = start(:3)
          times(1) = t_end
          call unpack(packed, n_packed, problem)
        else
          call unpack(copy, n_packed, problem)
        end if
        attitudes(:, 0) = start(4:)
        solution%rows(1:3, 1:1) => state(:3)
        solution%attitudes(1:4, 0:1) => attitudes
        associate (request => request_t(omega0, packed(TOLERANCE), packed(EFFORT), times))
          call taylor_solve(problem, request, solution)
        end associate
        state(4:) = attitudes(:, 1)
        status = solution%status
        call scale_back(power, state(:3), status)
        steps = solution%steps
        found = [solution%error, solution%growth, solution%spent]
      end if
    end if
    if (.not. is_result(status)) state = transfer(huge(0_int64), 1.0_dp)
  end subroutine solve_prepared_attitude

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

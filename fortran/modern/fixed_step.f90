module fixed_step
  !! The methods of III.2 with a fixed step: improved Euler (eq. 29), three terms of the Taylor
  !! series (eq. 30), classical Runge-Kutta (eq. 31).
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use methods, only: IMPROVED_EULER, RK4, TAYLOR_3
  use problem, only: problem_t, request_t, solution_t
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, REFUSED
  use torque_law, only: torque_at, torque_rate_at
  implicit none(type, external)
  private

  ! Work limit without waves. It is some ten seconds, unless the caller allows more.
  real(dp), parameter :: MOST_STEPS = 4e8_dp
  real(dp), parameter :: COUNTABLE = 1e18_dp  ! steps: more cannot be counted
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 1e6_dp ! steps between polls, without waves
  real(dp), parameter :: EXCESS = 1e-6_dp     ! the last step may be longer by this part

  public :: fixed_step_rows

contains

  subroutine fixed_step_rows(problem, request, method, step, solution)
    !! Compute the angular velocity at each of the times, which are ordered away from 0. Between two
    !! times there are as many whole steps as fit, then a shorter step. If the rest is at most the
    !! part EXCESS of a step, the last whole step is longer instead. The status is COMPLETE,
    !! OVERFLOW, GAVE_UP, INTERRUPTED, or REFUSED for an unknown method.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request         !! its tolerance is not used
    integer, intent(in) :: method                  !! IMPROVED_EULER, TAYLOR_3 or RK4
    real(dp), intent(in) :: step                   !! s, above 0
    type(solution_t), intent(inout) :: solution    !! without estimates
    real(dp) :: y(3)
    real(dp) :: begin, h, n_steps
    real(dp) :: total          ! number of steps to all times
    real(dp) :: cost           ! cost of a step, in steps without waves
    integer(int64) :: stride   ! steps between polls for an interrupt
    integer(int64) :: unseen   ! steps since the last poll
    integer(int64) :: done     ! steps taken towards this time
    integer(int64) :: piece
    integer :: i

    solution%n_rows = 0
    solution%status = REFUSED
    if (per_step(method) == 0) return
    solution%status = GAVE_UP
    ! A varying torque costs as much as the rest of the step, and a wave twice that.
    cost = 1.0_dp + 2.0_dp*real(problem%n_sines + problem%n_cosines, dp) &
           + merge(1.0_dp, 0.0_dp, any(abs(problem%rate) > 0.0_dp))
    solution%steps = 0
    solution%evaluations = 0
    total = 0.0_dp
    begin = 0.0_dp
    do i = 1, size(request%times)
      total = total + steps_to(request%times(i) - begin, step)
      begin = request%times(i)
    end do
    solution%needed = total*cost/MOST_STEPS
    if (.not. total <= min(COUNTABLE, request%effort*(MOST_STEPS/cost))) return
    stride = 1 + int(STEPS_BETWEEN_LOOKS/cost, int64)
    unseen = 0
    y = request%omega
    begin = 0.0_dp
    do i = 1, size(request%times)
      h = sign(step, request%times(i) - begin)
      n_steps = steps_to(request%times(i) - begin, step)
      solution%steps = solution%steps + int(n_steps, int64)
      solution%evaluations = per_step(method)*solution%steps
      done = 0
      do
        if (unseen >= stride) then
          unseen = 0
          if (interrupt_raised() /= 0) then
            solution%status = INTERRUPTED
            return
          end if
        end if
        piece = min(int(n_steps, int64) - 1 - done, stride)
        if (piece == 0) exit
        call advance(problem, method, begin, h, done, done + piece, y)
        done = done + piece
        unseen = unseen + piece
      end do
      begin = begin + h*(n_steps - 1.0_dp)
      call advance(problem, method, begin, request%times(i) - begin, 0_int64, 1_int64, y)
      begin = request%times(i)
      unseen = unseen + 1
      if (.not. all(abs(y) <= huge(step))) then
        solution%status = OVERFLOW
        return
      end if
      solution%rows(:, i) = y
      solution%n_rows = i
    end do
    solution%status = COMPLETE
  end subroutine fixed_step_rows

  pure real(dp) function steps_to(time, step)
    !! Return the number of steps in a time.
    real(dp), intent(in) :: time                   !! s
    real(dp), intent(in) :: step                   !! s

    steps_to = max(1.0_dp, aint(abs(time)/step + (1.0_dp - EXCESS)))
  end function steps_to

  pure integer function per_step(method)
    !! Return the number of right-hand sides and their derivatives in a step; 0 for an unknown
    !! method.
    integer, intent(in) :: method

    select case (method)
    case (IMPROVED_EULER, TAYLOR_3)
      per_step = 2
    case (RK4)
      per_step = 4
    case default
      per_step = 0
    end select
  end function per_step

  pure subroutine advance(problem, method, begin, h, first, last, y)
    !! Take the steps after number `first`, up to number `last`, of a sequence of equal steps.
    type(problem_t), intent(in) :: problem
    integer, intent(in) :: method
    real(dp), intent(in) :: begin                  !! s
    real(dp), intent(in) :: h                      !! s
    integer(int64), intent(in) :: first, last
    real(dp), intent(inout) :: y(3)                !! rad/s
    real(dp) :: a(3)
    real(dp) :: m(3), m_middle(3), m_end(3), m_slope(3)
    real(dp) :: k1(3), k2(3), k3(3), k4(3)
    real(dp) :: t
    logical :: varies
    integer(int64) :: n

    varies = problem%n_sines + problem%n_cosines > 0 .or. any(abs(problem%rate) > 0.0_dp)
    if (method == RK4 .and. .not. varies) then
      call runge_kutta_constant(problem, h, last - first, y)
      return
    end if
    a = problem%coefficients
    m = problem%constant
    m_middle = problem%constant
    m_end = problem%constant
    m_slope = 0.0_dp
    if (varies) then
      t = begin
      if (first > 0) t = (begin + real(first - 1, dp)*h) + h
      call torque_at(problem, t, 0.0_dp, m_end)
    end if
    do n = first + 1, last
      if (varies) then
        t = begin + real(n - 1, dp)*h
        m = m_end
        call torque_at(problem, t + h, 0.0_dp, m_end)
        if (method == RK4) then
          call torque_at(problem, t + 0.5_dp*h, 0.0_dp, m_middle)
        else if (method == TAYLOR_3) then
          call torque_rate_at(problem, t, m_slope)
        end if
      end if
      k1 = rates(a, m, y)
      select case (method)
      case (IMPROVED_EULER)
        ! Eq. 29: the mean of the rates at both ends of the step.
        k2 = rates(a, m_end, y + h*k1)
        y = y + (0.5_dp*h)*(k1 + k2)
      case (TAYLOR_3)
        ! Eq. 30: omega + h omega' + h**2/2 omega''.
        k2(1) = m_slope(1) + a(1)*(k1(2)*y(3) + y(2)*k1(3))
        k2(2) = m_slope(2) + a(2)*(k1(3)*y(1) + y(3)*k1(1))
        k2(3) = m_slope(3) + a(3)*(k1(1)*y(2) + y(1)*k1(2))
        y = y + h*(k1 + (0.5_dp*h)*k2)
      case (RK4)
        ! Eq. 31: classical Runge-Kutta.
        k2 = rates(a, m_middle, y + (0.5_dp*h)*k1)
        k3 = rates(a, m_middle, y + (0.5_dp*h)*k2)
        k4 = rates(a, m_end, y + h*k3)
        y = y + (h/6.0_dp)*((k1 + k4) + 2.0_dp*(k2 + k3))
      case default
        return ! unknown methods are refused before
      end select
    end do
  end subroutine advance

  pure function rates(a, m, y) result(f)
    !! Evaluate the right-hand sides of equations 16-18, rad/s2.
    real(dp), intent(in) :: a(3), m(3), y(3)
    real(dp) :: f(3)

    f(1) = m(1) + a(1)*(y(2)*y(3))
    f(2) = m(2) + a(2)*(y(3)*y(1))
    f(3) = m(3) + a(3)*(y(1)*y(2))
  end function rates

  pure subroutine runge_kutta_constant(problem, h, n_steps, y)
    !! Eq. 31 for a constant torque. The coefficients contain half a step, and each stage adds the
    !! rates of the previous one. The run time is the latency from one product to the next.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: h
    integer(int64), intent(in) :: n_steps
    real(dp), intent(inout) :: y(3)
    real(dp), parameter :: third = 1.0_dp/3.0_dp
    real(dp) :: a1, a2, a3, m1, m2, m3 ! coefficients and torque times half a step
    real(dp) :: u1, u2, u3 ! omega at the beginning of the step
    real(dp) :: b1, b2, b3 ! the same plus the torque times half a step
    real(dp) :: v1, v2, v3, w1, w2, w3 ! omega at the stages
    real(dp) :: p1, p2, p3 ! products at u times half a step
    real(dp) :: q1, q2, q3 ! the same at v
    real(dp) :: s1, s2, s3 ! sums of the increments
    integer(int64) :: n

    a1 = 0.5_dp*h*problem%coefficients(1)
    a2 = 0.5_dp*h*problem%coefficients(2)
    a3 = 0.5_dp*h*problem%coefficients(3)
    m1 = 0.5_dp*h*problem%constant(1)
    m2 = 0.5_dp*h*problem%constant(2)
    m3 = 0.5_dp*h*problem%constant(3)
    u1 = y(1)
    u2 = y(2)
    u3 = y(3)
    do n = 1, n_steps
      b1 = u1 + m1
      b2 = u2 + m2
      b3 = u3 + m3
      p1 = a1*(u2*u3)
      p2 = a2*(u3*u1)
      p3 = a3*(u1*u2)
      v1 = b1 + p1
      v2 = b2 + p2
      v3 = b3 + p3
      q1 = a1*(v2*v3)
      q2 = a2*(v3*v1)
      q3 = a3*(v1*v2)
      w1 = b1 + q1
      w2 = b2 + q2
      w3 = b3 + q3
      ! The sum of the increments k1 + 2 k2 + 2 k3 + k4 is not computed from v - u and w - u. The
      ! rounding errors of these differences are the same from step to step and would dominate after
      ! a million steps.
      s1 = (m1 + p1) + 2.0_dp*(m1 + q1)
      s2 = (m2 + p2) + 2.0_dp*(m2 + q2)
      s3 = (m3 + p3) + 2.0_dp*(m3 + q3)
      v1 = 2.0_dp*(m1 + a1*(w2*w3))
      v2 = 2.0_dp*(m2 + a2*(w3*w1))
      v3 = 2.0_dp*(m3 + a3*(w1*w2))
      s1 = s1 + v1
      s2 = s2 + v2
      s3 = s3 + v3
      v1 = u1 + v1
      v2 = u2 + v2
      v3 = u3 + v3
      s1 = s1 + (m1 + a1*(v2*v3))
      s2 = s2 + (m2 + a2*(v3*v1))
      s3 = s3 + (m3 + a3*(v1*v2))
      u1 = u1 + third*s1
      u2 = u2 + third*s2
      u3 = u3 + third*s3
    end do
    y = [u1, u2, u3]
  end subroutine runge_kutta_constant

end module fixed_step

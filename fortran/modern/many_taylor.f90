module many_taylor
  !! Many bodies under torque, side by side: Taylor series with a step of its own for each. A body
  !! that has come to its end makes room for the next one. What a step leaves out is measured,
  !! carried to the end and taken off there; where it, or what the motion makes of it, is too much
  !! to be sure of, the body is left to the single kernel.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: bodies_t, i1, LANES, LEFT, of_body, single_of
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use many_circular, only: sine_cosine_lanes
  use problem, only: problem_t
  use statuses, only: COMPLETE
  use taylor_plan, only: plan
  implicit none(type, external)
  private

  integer, parameter :: SLOTS = 16           ! bodies on their way
  integer, parameter :: MOST_ORDER = 24
  integer, parameter :: MOST_WAVES = 16      ! else the single kernel, for which no torque is many
  integer, parameter :: BETWEEN_LOOKS = 100000 ! at the user, steps of all slots
  ! A step may leave out so much more than that of a single march, whose order it does not choose:
  ! what it leaves out is known and taken off.
  real(dp), parameter :: MORE = 30.0_dp
  real(dp), parameter :: TRUSTED = 0.3_dp    ! error that is taken off, in tolerances
  real(dp), parameter :: MOST_GROWTH = 200.0_dp
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter :: SURE = 0.03_dp      ! rounding times growth, in tolerances
  real(dp), parameter :: A_STEP = 2.0_dp     ! radians about the body in a step
  real(dp), parameter :: SHORTEST = 1e-7_dp  ! step over the time
  real(dp), parameter :: WAVES_ERR = 16.0_dp*2.0_dp**(-53) ! of each radian of a wave
  real(dp), parameter :: FAR = 1e60_dp       ! from 1: products of such rates are numbers
  real(dp), parameter :: RIDGE = 1.001_dp
  real(dp), parameter :: LEAST = 1e-290_dp
  real(dp), parameter :: MOST_BITS = 2.0_dp**57

  type :: slots_t
    real(dp), dimension(SLOTS, 3) :: w, low   !! omega and its rounding, rad/s
    real(dp), dimension(SLOTS, 3) :: a        !! A, B, C
    real(dp), dimension(SLOTS, 3) :: constant, rate !! torque over moment
    real(dp), dimension(SLOTS, 3) :: error    !! left out and carried so far, rad/s
    real(dp), dimension(SLOTS, 3) :: small    !! a difference
    real(dp), dimension(SLOTS) :: growth      !! its largest size
    real(dp), dimension(SLOTS) :: t, rest     !! s
    real(dp), dimension(SLOTS) :: h           !! the step before, s
    real(dp), dimension(SLOTS) :: scale       !! largest omega so far, rad/s
    real(dp), dimension(SLOTS) :: share       !! that the last terms may have of it
    real(dp), dimension(SLOTS) :: farthest    !! A_STEP over the coupling
    real(dp) :: torque(SLOTS, 3, MOST_ORDER)  !! what it adds to the terms, rad/s
  end type slots_t

contains

  subroutine many_taylor_solve(bodies_at, omega, status, interrupted) bind(c, name="solve_many_taylor_level")
    !! Angular velocity of each body at its time; status is COMPLETE or LEFT.
    type(c_ptr), intent(in), value :: bodies_at           !! a bodies_t, through C
    real(c_double), intent(inout) :: omega(3, *)          !! rad/s
    integer(i1), intent(inout) :: status(*)
    integer(c_int), intent(out) :: interrupted            !! 1: by the user
    type(bodies_t), pointer :: bodies
    type(slots_t) :: s
    real(dp) :: waves(4, MOST_WAVES, SLOTS)
    integer :: body(SLOTS)   ! in each slot; 0: none
    integer :: n_sines, n_waves, order, next, active, i, unseen

    call c_f_pointer(bodies_at, bodies)
    interrupted = 0
    n_sines = size(bodies%sines, 2)
    n_waves = n_sines + size(bodies%cosines, 2)
    if (n_waves > MOST_WAVES) then
      status(:bodies%n) = LEFT
      return
    end if
    order = order_for(bodies%tolerance)
    call fill(s)
    body = 0
    next = 0
    active = 0
    unseen = 0
    do
      do i = 1, SLOTS
        if (body(i) > 0) then
          if (is_going(s, i)) cycle
          call take_out(bodies%tolerance, s, i, omega(:, body(i)), status(body(i)))
          active = active - 1
          body(i) = 0
        end if
        do while (next < bodies%n)
          next = next + 1
          call put_in(bodies, next, s, i, waves(:, :, i), status(next))
          if (status(next) == LEFT) cycle
          body(i) = next
          active = active + 1
          exit
        end do
        ! An empty slot goes on as it is: no number that takes the processor longer.
        if (body(i) == 0) s%rest(i) = 0.0_dp
      end do
      if (active == 0) exit
      call torque_terms(order, n_sines, n_waves, waves, s)
      call step(order, SLOTS, s)
      unseen = unseen + 1
      if (unseen >= BETWEEN_LOOKS) then
        unseen = 0
        interrupted = merge(1, 0, interrupt_raised() /= 0)
        if (interrupted /= 0) return
      end if
    end do
  end subroutine many_taylor_solve

  pure integer function order_for(tolerance)
    !! One of unroll_many.py: the same for all, so that a body's result does not depend on others.
    real(dp), intent(in) :: tolerance

    if (tolerance >= 1e-4_dp) then
      order_for = 8
    else if (tolerance >= 3e-8_dp) then
      order_for = 12
    else if (tolerance >= 3e-13_dp) then
      order_for = 18
    else
      order_for = 24
    end if
  end function order_for

  pure subroutine fill(s)
    !! A body at rest in each slot.
    type(slots_t), intent(inout) :: s

    s%w = 0.0_dp
    s%low = 0.0_dp
    s%a = 0.0_dp
    s%constant = 0.0_dp
    s%rate = 0.0_dp
    s%error = 0.0_dp
    s%small = 0.0_dp
    s%growth = 0.0_dp
    s%t = 0.0_dp
    s%rest = 0.0_dp
    s%h = 1.0_dp
    s%scale = 1.0_dp
    s%share = 1.0_dp
    s%farthest = 1.0_dp
    s%torque = 0.0_dp
  end subroutine fill

  subroutine put_in(bodies, n, s, i, waves, status)
    !! Body n into slot i; LEFT where it is none for here.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: n, i
    type(slots_t), intent(inout) :: s
    real(dp), intent(inout), target :: waves(4, MOST_WAVES)
    integer(i1), intent(out) :: status
    type(problem_t) :: problem
    real(dp) :: omega(3), time, scale, share, h, coupling, sizes(3)
    integer :: order

    status = LEFT
    omega = bodies%omega0(:, n)
    time = bodies%times(of_body(size(bodies%times), n))
    call single_of(bodies, n, problem, waves)
    scale = max(abs(omega(1)), abs(omega(2)), abs(omega(3)))
    if (.not. (scale <= FAR .and. scale >= 1.0_dp/FAR)) return
    if (.not. (abs(time) <= FAR .and. abs(time) >= 1.0_dp/FAR)) return
    if (.not. (all(abs(problem%coefficients) <= FAR) .and. all(abs(problem%constant) <= FAR) &
               .and. all(abs(problem%rate) <= FAR))) return
    if (problem%n_sines + problem%n_cosines > 0) then
      problem%sines => waves(:, :problem%n_sines)
      problem%cosines => waves(:, problem%n_sines + 1:problem%n_sines + problem%n_cosines)
      if (.not. all(abs(waves(:, :problem%n_sines + problem%n_cosines)) <= FAR)) return
      if (.not. maxval(abs(waves(4, :problem%n_sines + problem%n_cosines)))*abs(time)*WAVES_ERR &
          <= SURE*bodies%tolerance) return
    end if
    call plan(problem, scale, bodies%tolerance, time, .false., order, share, h)
    sizes = sqrt(abs(problem%coefficients))
    coupling = max(sizes(1)*sizes(2), sizes(2)*sizes(3), sizes(3)*sizes(1))
    if (.not. abs(h) > 1e-3_dp*SHORTEST*abs(time)) return
    s%w(i, :) = omega
    s%low(i, :) = 0.0_dp
    s%a(i, :) = problem%coefficients
    s%constant(i, :) = problem%constant
    s%rate(i, :) = problem%rate
    s%error(i, :) = 0.0_dp
    ! None that a symmetry keeps from growing.
    s%small(i, :) = [0.48_dp, -0.31_dp, 0.21_dp]
    s%growth(i) = 1.0_dp
    s%t(i) = 0.0_dp
    s%rest(i) = time
    s%h(i) = h
    s%scale(i) = scale
    s%share(i) = MORE*share
    s%farthest(i) = A_STEP/max(coupling, LEAST)
    status = COMPLETE
  end subroutine put_in

  pure logical function is_going(s, i)
    !! Whether a slot's body has a way to go, and is none that is left to the single kernel.
    type(slots_t), intent(in) :: s
    integer, intent(in) :: i

    is_going = abs(s%rest(i)) > 0.0_dp .and. s%growth(i) <= MOST_GROWTH &
               .and. abs(s%h(i)) > SHORTEST*abs(s%t(i) + s%rest(i))
  end function is_going

  pure subroutine take_out(tolerance, s, i, omega, status)
    !! What has come of a slot's body.
    real(dp), intent(in) :: tolerance
    type(slots_t), intent(in) :: s
    integer, intent(in) :: i
    real(dp), intent(inout) :: omega(3)
    integer(i1), intent(out) :: status
    real(dp) :: error, scale

    omega = s%w(i, :) + (s%low(i, :) - s%error(i, :))
    error = max(abs(s%error(i, 1)), abs(s%error(i, 2)), abs(s%error(i, 3)))
    scale = max(s%scale(i), abs(omega(1)), abs(omega(2)), abs(omega(3)))
    status = LEFT
    if (.not. abs(s%rest(i)) > 0.0_dp .and. scale <= FAR .and. error <= TRUSTED*tolerance*scale &
        .and. s%growth(i) <= min(MOST_GROWTH, SURE*tolerance/ROUNDING)) then
      status = COMPLETE
    end if
  end subroutine take_out

  subroutine torque_terms(order, n_sines, n_waves, waves, s)
    !! What the torque adds to the terms of a step as long as the one before.
    integer, intent(in) :: order, n_sines, n_waves
    real(dp), intent(in) :: waves(4, MOST_WAVES, SLOTS)
    type(slots_t), intent(inout) :: s
    real(dp), dimension(LANES) :: angle, sine, cosine
    real(dp), dimension(SLOTS) :: turn, power, even, odd
    integer :: axis, i, k, n

    do axis = 1, 3
      do i = 1, SLOTS
        s%torque(i, axis, 1) = s%h(i)*(s%constant(i, axis) + s%rate(i, axis)*s%t(i))
        s%torque(i, axis, 2) = (0.5_dp*s%h(i))*(s%h(i)*s%rate(i, axis))
      end do
    end do
    if (n_waves == 0) return
    s%torque(:, :, 3:order) = 0.0_dp
    do n = 1, n_waves
      do i = 1, SLOTS
        angle(i) = waves(4, n, i)*s%t(i)
        turn(i) = waves(4, n, i)*s%h(i)
        power(i) = s%h(i)
      end do
      call sine_cosine_lanes(SLOTS, angle, sine, cosine)
      ! The derivatives of a wave run value, slope, -value, -slope.
      if (n <= n_sines) then
        even = sine(:SLOTS)
        odd = cosine(:SLOTS)
      else
        even = cosine(:SLOTS)
        odd = -sine(:SLOTS)
      end if
      do k = 1, order
        do axis = 1, 3
          do i = 1, SLOTS
            s%torque(i, axis, k) = s%torque(i, axis, k) + waves(axis, n, i)*(power(i)*even(i))
          end do
        end do
        do i = 1, SLOTS
          power(i) = power(i)*turn(i)*(1.0_dp/real(k + 1, dp))
          angle(i) = -even(i)
          even(i) = odd(i)
          odd(i) = angle(i)
        end do
      end do
    end do
  end subroutine torque_terms

  pure real(dp) function ratio(order, allowed, last)
    !! Of the step with which the last terms would be as large as allowed: the bits of a positive
    !! number, read as an integer, are its logarithm to 6 %.
    integer, intent(in) :: order
    real(dp), intent(in) :: allowed, last
    integer(int64) :: bits
    real(dp) :: power

    bits = transfer(allowed, bits) - transfer(max(last, LEAST), bits)
    power = real(bits, dp)*(1.0_dp/real(order, dp))
    bits = transfer(1.0_dp, bits) + int(max(-MOST_BITS, min(MOST_BITS, power)), int64)
    ratio = transfer(bits, 1.0_dp)
  end function ratio

  ! unroll: many_step
  pure subroutine step(order, m, s)
    !! One step of each slot.
    integer, intent(in) :: order, m
    type(slots_t), intent(inout) :: s
    integer :: i

    do i = 1, m
      call step_of(order, i, s)
    end do
  end subroutine step

  pure subroutine step_of(order, i, s)
    !! The terms with the step before, their ratio to it, the sum, what is left out.
    integer, intent(in) :: order, i
    type(slots_t), intent(inout) :: s
    integer, parameter :: CARRIED = 7, MOMENTS = 8
    real(dp) :: terms(3, 0:MOST_ORDER), f(3), products(3), change(3), total(3), part(3)
    real(dp) :: mean(3), moment(3), c(3), o(3, 3), d(3), e(3), left(3), last4(3, 4)
    real(dp) :: h, r, next, scale, allowed, uu, vv, uv, p, q, determinant
    integer :: j, k

    h = s%h(i)
    f = h*s%a(i, :)
    terms(:, 0) = s%w(i, :)
    do k = 1, order
      products = 0.0_dp
      do j = 0, k - 1
        products = products + cshift(terms(:, j), 1)*cshift(terms(:, k - 1 - j), 2)
      end do
      terms(:, k) = (f/real(k, dp))*products + s%torque(i, :, k)
    end do
    scale = max(s%scale(i), maxval(abs(terms(:, 0))))
    allowed = s%share(i)*scale
    r = ratio(order, allowed, sum(abs(terms(:, order))) + sum(abs(terms(:, order - 1))))
    next = h*r
    if (abs(next)*scale > s%farthest(i)) next = sign(s%farthest(i)/scale, h)
    r = next
    if (abs(s%rest(i)) < 2.0_dp*abs(next)) r = 0.5_dp*s%rest(i)
    if (abs(s%rest(i)) <= abs(next)) r = s%rest(i)
    next = r
    r = next/h
    do k = 1, order
      terms(:, k) = terms(:, k)*r**k
    end do
    f = f*r
    change = s%low(i, :)
    do k = order, 1, -1
      change = change + terms(:, k)
    end do
    total = terms(:, 0) + change
    part = total - terms(:, 0)
    s%low(i, :) = (terms(:, 0) - (total - part)) + (change - part)
    s%w(i, :) = total
    ! As leave_out of taylor_error.f90.
    last4 = terms(:, order - 3:order)/max(allowed, LEAST)
    uu = RIDGE*(sum(last4(:, 3)**2) + sum(last4(:, 2)**2))
    vv = RIDGE*(sum(last4(:, 2)**2) + sum(last4(:, 1)**2))
    uv = sum(last4(:, 3)*last4(:, 2)) + sum(last4(:, 2)*last4(:, 1))
    p = sum(last4(:, 3)*last4(:, 4)) + sum(last4(:, 2)*last4(:, 3))
    q = sum(last4(:, 2)*last4(:, 4)) + sum(last4(:, 1)*last4(:, 3))
    determinant = uu*vv - uv*uv
    r = vv*p - uv*q
    q = uv*p - uu*q
    determinant = max((determinant - r) + q, abs(r - q), abs(q), LEAST)
    left = allowed*(((r - q)/determinant)*last4(:, 4) - (q/determinant)*last4(:, 3))
    ! As carry of taylor_series.f90.
    mean = terms(:, 0)
    moment = 0.0_dp
    do k = 1, MOMENTS
      mean = mean + terms(:, k)/real(k + 1, dp)
      moment = moment + terms(:, k)*(real(k, dp)/real(2*(k + 1)*(k + 2), dp))
    end do
    c = cshift(mean, 1)*cshift(moment, 2) - cshift(mean, 2)*cshift(moment, 1)
    o = 0.0_dp
    o(1, 2) = f(1)*(mean(3) + f(3)*c(3))
    o(1, 3) = f(1)*(mean(2) - f(2)*c(2))
    o(2, 1) = f(2)*(mean(3) - f(3)*c(3))
    o(2, 3) = f(2)*(mean(1) + f(1)*c(1))
    o(3, 1) = f(3)*(mean(2) + f(2)*c(2))
    o(3, 2) = f(3)*(mean(1) - f(1)*c(1))
    do j = 1, 2
      d = merge(s%error(i, :), s%small(i, :), j == 1)
      e = d
      do k = CARRIED, 1, -1
        e = [o(1, 2)*e(2) + o(1, 3)*e(3), o(2, 1)*e(1) + o(2, 3)*e(3), &
             o(3, 1)*e(1) + o(3, 2)*e(2)]/real(k, dp) + d
      end do
      if (j == 1) s%error(i, :) = e - left
      if (j == 2) s%small(i, :) = e
    end do
    s%growth(i) = max(s%growth(i), sum(abs(s%small(i, :))))
    s%t(i) = s%t(i) + next
    s%rest(i) = s%rest(i) - next
    s%h(i) = next
    s%scale(i) = scale
  end subroutine step_of
  ! end unroll

end module many_taylor

module many_taylor
  !! Many bodies under torque side by side: Taylor series with a step of its own for each body. When
  !! a body reaches its end, the next one takes its slot. The truncation error of each step is
  !! estimated, propagated to the end and subtracted there. If this error or its amplification is
  !! too large to rely on the estimate, the body is left to the single-body kernel.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
  use bodies, only: A_GROUP, bodies_t, i1, LANES, last_row, NEEDS_FALLBACK, MOST_WAVES, &
                    put_estimates, with_attitude
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use many_attitudes, only: attitudes_t, begin_attitude, plan_attitudes, remember, take_attitude, &
                            turn
  use many_circular, only: sine_cosine_lanes
  use many_rows, only: begin_rows, error_of, put_last_rows, put_rows, put_turned_rows, &
                       remember_rows, ROUNDING, rows_t, WRONG_ANGLE
  use many_slots, only: BLURRED, FAR, fill, KIND_OF, LEAST, make_ready, MOST_GROWTH, put_in, &
                        ratio, ready_t, SHORTEST, SLOTS, slots_t
  use series, only: MOST_ORDER
  use statuses, only: COMPLETE
  implicit none(type, external)
  private

  integer, parameter :: BETWEEN_LOOKS = 100000 ! steps of all slots between polls for an interrupt
  ! Largest error that is subtracted, in tolerances; less if unknown errors are amplified.
  real(dp), parameter :: TRUSTED = 0.4_dp
  real(dp), parameter :: DOUBTED = 64.0_dp   ! amplification at which it is half of that
  real(dp), parameter :: A_STEP = 3.0_dp     ! largest norm of an exponent that is taken at once
  real(dp), parameter :: RIDGE = 1.001_dp

  public :: many_taylor_solve

contains

  subroutine many_taylor_solve(bodies_at, n, omega, status, interrupted) &
    bind(c, name="solve_many_taylor_level")
    !! Compute omega of each marked body at its time, and its attitude if it is specified at time 0.
    !! Its status becomes COMPLETE, or NEEDS_FALLBACK if it is left to the single-body kernel.
    type(c_ptr), intent(in), value :: bodies_at           !! address of a bodies_t, passed through C
    integer(c_int), intent(in), value :: n                !! number of bodies
    real(c_double), intent(inout) :: omega(3, n)          !! rad/s
    integer(i1), intent(inout) :: status(n)
    integer(c_int), intent(out) :: interrupted            !! 1: interrupted by the user
    type(bodies_t), pointer :: bodies
    type(slots_t) :: s
    real(dp) :: waves(KIND_OF, MOST_WAVES, SLOTS)
    integer :: body(SLOTS)   ! the body in each slot; 0: none
    type(attitudes_t) :: attitudes
    type(ready_t) :: ready
    real(dp) :: ready_waves(KIND_OF, MOST_WAVES, LANES)
    logical :: is_turned
    real(dp) :: error, error_of_attitude
    type(rows_t) :: rows
    logical :: has_rows
    integer :: n_waves, order, active, n_slots, i, j, unseen

    call c_f_pointer(bodies_at, bodies)
    interrupted = 0
    n_waves = bodies%n_waves
    order = order_for(bodies%tolerance)
    call fill(s)
    is_turned = with_attitude(bodies)
    has_rows = associated(bodies%row_times)
    if (is_turned) call plan_attitudes(bodies%tolerance, s, attitudes)
    body = 0
    waves = 0.0_dp
    ready%block%last = 0
    call make_ready(bodies, status, ready_waves, ready)
    n_slots = SLOTS
    if (ready%block%there <= A_GROUP) n_slots = A_GROUP ! one register; the others would stay empty
    active = 0
    unseen = 0
    do
      if (.not. minval(s%going(:n_slots)) > 0.0_dp) then
        do i = 1, n_slots
          if (s%going(i) > 0.0_dp) cycle
          if (body(i) > 0) then
            call take_out(bodies%tolerance, s, i, omega(:, body(i)), status(body(i)))
            error = error_of(s, i)
            if (is_turned) then
              call take_attitude(bodies, body(i), i, trusted_at(s%growth(i)), s, attitudes, &
                                 status(body(i)), error_of_attitude)
              error = error + WRONG_ANGLE*error_of_attitude
            end if
            if (has_rows) then
              bodies%omega_rows(:, bodies%places(last_row(bodies)), body(i)) = omega(:, body(i))
              if (is_turned) call put_last_rows(bodies, body(i), i, s, attitudes, rows)
            end if
            call put_estimates(bodies, body(i), last_row(bodies), error, s%growth(i))
            active = active - 1
          end if
          body(i) = 0
          ! With few bodies, most slots have none.
          if (ready%block%there == 0) cycle
          do
            if (ready%taken == ready%block%there) then
              call make_ready(bodies, status, ready_waves, ready)
              if (ready%block%there == 0) exit
            end if
            j = ready%taken + 1
            ready%taken = j
            status(ready%block%at(j)) = NEEDS_FALLBACK
            if (ready%fits(j) < 0.0_dp) cycle
            call put_in(ready, j, s, i)
            if (n_waves > 0) waves(:, :n_waves, i) = ready_waves(:, :n_waves, j)
            body(i) = ready%block%at(j)
            if (has_rows) call begin_rows(i, rows)
            if (is_turned) call begin_attitude(bodies, body(i), i, A_STEP, s, attitudes)
            active = active + 1
            exit
          end do
        end do
      end if
      if (active == 0) exit
      if (n_waves > 0) then
        do i = 0, n_slots - 1, A_GROUP
          call wave_terms(order, n_waves, i, waves, s)
        end do
      end if
      if ((is_turned .or. has_rows) .and. n_waves == 0) s%torque(:, :, :order) = 0.0_dp
      if (is_turned) call remember(s, attitudes)
      if (has_rows) call remember_rows(s, attitudes, is_turned, rows)
      call step(order, n_waves > 0 .or. is_turned .or. has_rows, n_slots, s)
      if (has_rows) call put_rows(bodies, order, n_slots, body, s, rows)
      if (is_turned) call turn(n_slots, A_STEP, s, attitudes)
      if (is_turned .and. has_rows) then
        call put_turned_rows(bodies, n_slots, body, s, attitudes, rows)
      end if
      unseen = unseen + 1
      if (unseen >= BETWEEN_LOOKS) then
        unseen = 0
        interrupted = merge(1, 0, interrupt_raised() /= 0)
        if (interrupted /= 0) return
      end if
    end do
  end subroutine many_taylor_solve

  pure integer function order_for(tolerance)
    !! Return one of the orders of unroll_many.py. It is the same for all bodies, so that the result
    !! of a body does not depend on the others.
    real(dp), intent(in) :: tolerance

    if (tolerance >= 5e-4_dp) then
      order_for = 8
    else if (tolerance >= 3e-8_dp) then
      order_for = 12
    else
      order_for = 20
    end if
  end function order_for

  pure real(dp) function going(rest, h, t, growth)
    !! Return a value above 0 while the body must be advanced further by this kernel, else 0.
    real(dp), intent(in) :: rest, h, t !! s
    real(dp), intent(in) :: growth

    going = abs(rest)
    if (.not. growth <= MOST_GROWTH) going = 0.0_dp
    if (.not. abs(h) > SHORTEST*abs(t + rest)) going = 0.0_dp
  end function going

  pure subroutine take_out(tolerance, s, i, omega, status)
    !! Take the result of a slot's body, or leave the body to the single-body kernel.
    real(dp), intent(in) :: tolerance
    type(slots_t), intent(in) :: s
    integer, intent(in) :: i
    real(dp), intent(inout) :: omega(3)
    integer(i1), intent(out) :: status
    real(dp) :: scale

    omega = s%w(i, :) + (s%low(i, :) - s%error(i, :))
    scale = max(s%scale(i), abs(omega(1)), abs(omega(2)), abs(omega(3)))
    status = NEEDS_FALLBACK
    ! A sum, because a maximum may lose a NaN.
    if (.not. abs(s%rest(i)) > 0.0_dp .and. sum(abs(omega)) + s%scale(i) <= FAR &
        .and. s%worst(i) <= trusted_at(s%growth(i))*tolerance*scale &
        .and. s%growth(i) <= min(MOST_GROWTH, BLURRED*tolerance/ROUNDING)) then
      status = COMPLETE
    end if
  end subroutine take_out

  pure real(dp) function trusted_at(growth)
    !! Return the largest error that is subtracted, in tolerances.
    real(dp), intent(in) :: growth

    trusted_at = TRUSTED/(1.0_dp + growth/DOUBTED)
  end function trusted_at

  subroutine wave_terms(order, n_waves, before, waves, s)
    !! Compute the terms that waves of the torque add to a step as long as the previous one, for the
    !! slots of one register.
    integer, intent(in) :: order, n_waves
    integer, intent(in) :: before !! number of slots before them
    real(dp), intent(in) :: waves(KIND_OF, MOST_WAVES, SLOTS)
    type(slots_t), intent(inout) :: s
    real(dp), dimension(LANES) :: angle, sine, cosine
    real(dp), dimension(A_GROUP) :: turn, power, even, odd
    integer :: axis, i, k, n

    s%torque(before + 1:before + A_GROUP, :, :order) = 0.0_dp
    do n = 1, n_waves
      do i = 1, A_GROUP
        angle(i) = waves(4, n, before + i)*s%t(before + i)
        turn(i) = waves(4, n, before + i)*s%h(before + i)
        power(i) = s%h(before + i)
      end do
      call sine_cosine_lanes(A_GROUP, angle, sine, cosine)
      ! The derivatives of a wave are its value, slope, -value and -slope in turn.
      do i = 1, A_GROUP
        even(i) = merge(cosine(i), sine(i), waves(KIND_OF, n, before + i) > 0.0_dp)
        odd(i) = merge(-sine(i), cosine(i), waves(KIND_OF, n, before + i) > 0.0_dp)
      end do
      do k = 1, order
        do axis = 1, 3
          do i = 1, A_GROUP
            s%torque(before + i, axis, k) = s%torque(before + i, axis, k) &
                                            + waves(axis, n, before + i)*(power(i)*even(i))
          end do
        end do
        do i = 1, A_GROUP
          power(i) = power(i)*turn(i)*(1.0_dp/real(k + 1, dp))
          angle(i) = -even(i)
          even(i) = odd(i)
          odd(i) = angle(i)
        end do
      end do
    end do
  end subroutine wave_terms

  ! unroll: many_step
  pure subroutine step(order, waves, m, s)
    !! Take one step in each slot.
    integer, intent(in) :: order, m
    logical, intent(in) :: waves !! whether the torque has waves
    type(slots_t), intent(inout) :: s
    integer :: i

    do i = 1, m
      call step_of(order, waves, i, s)
    end do
  end subroutine step

  pure subroutine step_of(order, waves, i, s)
    !! Compute the terms with the previous step, the factor on the step, the sum and the truncation
    !! error.
    integer, intent(in) :: order, i
    logical, intent(in) :: waves
    type(slots_t), intent(inout) :: s
    integer, parameter :: CARRIED = 7, MOMENTS = 8
    real(dp) :: terms(3, 0:MOST_ORDER), f(3), products(3), change(3), total(3), part(3)
    real(dp) :: mean(3), moment(3), c(3), o(3, 3), d(3), e(3), left(3), last4(3, 4)
    real(dp) :: rows(3)
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
      terms(:, k) = (f/real(k, dp))*products
      if (k == 1) terms(:, k) = terms(:, k) + h*(s%constant(i, :) + s%rate(i, :)*s%t(i))
      if (k == 2) terms(:, k) = terms(:, k) + (0.5_dp*h)*(h*s%rate(i, :))
      if (waves) terms(:, k) = terms(:, k) + s%torque(i, :, k)
      if (waves) s%torque(i, :, k) = terms(:, k)
    end do
    scale = max(s%scale(i), maxval(abs(terms(:, 0))))
    allowed = s%local_tolerance(i)*scale
    r = ratio(order, allowed, sum(abs(terms(:, order))) + sum(abs(terms(:, order - 1))))
    next = h*r
    if (abs(next)*s%spin(i) > A_STEP) next = sign(A_STEP/s%spin(i), h)
    r = next
    if (abs(s%rest(i)) < s%two*abs(next)) r = s%part*s%rest(i)
    if (abs(s%rest(i)) <= s%one*abs(next)) r = s%rest(i)
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
    ! Truncation error, as in estimate_truncation of taylor_error.f90.
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
    ! Magnus's series, as in propagate_variations of taylor_series.f90.
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
    ! In these units the matrix of a body is symmetric except for signs.
    s%spin(i) = sqrt(abs(o(1, 2)*o(2, 1)) + abs(o(1, 3)*o(3, 1)) + abs(o(2, 3)*o(3, 2))) &
                /max(abs(next), LEAST)
    rows = 0.0_dp
    do j = 0, 3
      if (j == 0) d = s%error(i, :)
      if (j > 0) d = s%small(i, :, j)
      e = d
      do k = CARRIED, 1, -1
        e = [o(1, 2)*e(2) + o(1, 3)*e(3), o(2, 1)*e(1) + o(2, 3)*e(3), &
             o(3, 1)*e(1) + o(3, 2)*e(2)]/real(k, dp) + d
      end do
      if (j == 0) then
        s%error(i, :) = e - left
        s%worst(i) = max(s%worst(i), sum(abs(s%error(i, :))))
      else
        s%small(i, :, j) = e
        rows = rows + abs(e)
      end if
    end do
    ! Sums, because a maximum may lose a NaN.
    s%growth(i) = max(s%growth(i), rows(1), rows(2), rows(3)) + 0.0_dp*sum(rows)
    s%t(i) = s%t(i) + next
    s%rest(i) = s%rest(i) - next
    s%h(i) = next
    s%scale(i) = scale
    s%going(i) = going(s%rest(i), next, s%t(i), s%growth(i))
  end subroutine step_of
  ! end unroll

end module many_taylor

module taylor
  !! Taylor series, order and step adapted.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use euler_equations, only: INVERSE, torque_terms
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: problem_t
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW
  use taylor_plan, only: plan
  use taylor_series, only: expand_constant, expand_varying, fitting, following, scale_of, &
                           series_t, shorten, size_of
  implicit none(type, external)
  private

  ! Without waves; some ten seconds. A wave costs A_WAVE of a step without any.
  real(dp), parameter :: MOST_STEPS = 1e7_dp
  real(dp), parameter :: A_WAVE = 0.5_dp
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 1e5_dp ! at the user
  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**19
  integer, parameter :: MANY_WAVES = 1000 ! so that a step is worth a look
  real(dp), parameter :: FARTHEST_COUNT = 4e18_dp
  integer, parameter :: MOST_TRIES = 60
  real(dp), parameter :: HOPELESS = 10.0_dp ! times the steps allowed, of the first one's length
  real(dp), parameter :: PLANNED = 3.0_dp ! growth of a difference that the share allows for
  real(dp), parameter :: GROWING = 1.3_dp ! power of time with which steps do, not by chance
  real(dp), parameter :: ANOTHER = 2.2_dp ! marches in the cost of one
  real(dp), parameter :: SAFETY = 10.0_dp  ! one difference may miss where others grow
  real(dp), parameter :: ROUNDING = 2e-16_dp ! relative
  real(dp), parameter :: ASIDE(3) = [1.0_dp, -0.6_dp, 0.3_dp]
  real(dp), parameter :: SLACK = 16.0_dp ! before a step does not pass: orders that vary cost time

  public :: taylor_solve

contains

  subroutine taylor_solve(problem_at, omega, tolerance, effort, n_times, times, rows, n_rows, &
                          status, steps, needed, found) &
    bind(c, name="taylor_solve_level")
    !! Solution at `times`, which lead away from 0 on one side.
    type(c_ptr), intent(in), value :: problem_at        !! a problem_t, through C
    real(c_double), intent(in) :: omega(3)              !! at time 0, rad/s
    real(c_double), intent(in) :: tolerance             !! of the error at `times`, relative
    real(c_double), intent(in) :: effort                !! factor on the steps allowed
    integer(c_int), intent(in), value :: n_times
    real(c_double), intent(in) :: times(n_times)        !! s
    real(c_double), intent(inout) :: rows(3, n_times)   !! omega for n_rows times, rad/s
    integer(c_int), intent(out) :: n_rows
    integer(c_int), intent(out) :: status !! 0 complete, 2 overflow, 4 gave up, 5 interrupted
    integer(c_int64_t), intent(out) :: steps            !! of the last march
    real(c_double), intent(out) :: needed               !! effort, as far as known; where it gave up
    real(c_double), intent(out) :: found(2)             !! error and growth; below 0 where unknown
    type(problem_t), pointer :: problem
    real(dp) :: growth  ! of a small difference on the way
    real(dp) :: known   ! the same, as far as it was reckoned with
    real(dp) :: cost    ! of a step, in steps without waves
    real(dp) :: most    ! steps left
    real(dp) :: spent   ! steps of the marches before
    real(dp) :: ahead   ! steps that this march would need

    call c_f_pointer(problem_at, problem)
    known = PLANNED
    cost = 1.0_dp + A_WAVE*real(problem%n_sines + problem%n_cosines, dp)
    most = min(FARTHEST_COUNT, effort*(MOST_STEPS/cost))
    spent = 0.0_dp
    needed = 0.0_dp
    found = -1.0_dp
    do
      call march(problem, omega, tolerance*(PLANNED/known), most - spent, &
                 1 + int(STEPS_BETWEEN_LOOKS/cost, c_int64_t), n_times, times, rows, n_rows, &
                 status, steps, growth, ahead)
      if (status == GAVE_UP) then
        ! Differences that have grown already will ask for another march, in shorter steps.
        if (growth > known) ahead = ANOTHER*ahead
        needed = (spent + ahead)*cost/MOST_STEPS
        steps = steps + int(spent, c_int64_t)
      end if
      spent = spent + real(steps, dp)
      if (growth <= known .or. status /= COMPLETE .or. tolerance*(PLANNED/known) < ROUNDING) return
      ! What a step errs grew: once more, with less of it.
      known = SAFETY*growth
    end do
  end subroutine taylor_solve

  subroutine march(problem, omega, tolerance, most_steps, stride, n_times, times, rows, n_rows, &
                   status, steps, growth, ahead)
    !! Once from 0 to the last of the times.
    type(problem_t), intent(in) :: problem
    real(c_double), intent(in) :: omega(3)              !! at time 0, rad/s
    real(c_double), intent(in) :: tolerance             !! of the error at `times`, relative
    real(dp), intent(in) :: most_steps
    integer(int64), intent(in) :: stride                !! steps between looks at the user
    integer(c_int), intent(in), value :: n_times
    real(c_double), intent(in) :: times(n_times)        !! s
    real(c_double), intent(inout) :: rows(3, n_times)   !! omega for n_rows times, rad/s
    integer(c_int), intent(out) :: n_rows
    integer(c_int), intent(out) :: status !! 0 complete, 2 overflow, 4 gave up, 5 interrupted
    integer(c_int64_t), intent(out) :: steps
    real(dp), intent(out) :: growth !! of a small difference; looked at where the torque varies
    real(dp), intent(out) :: ahead  !! steps to the end, as far as known; where it gave up
    type(series_t) :: s
    real(dp) :: w(3)          ! omega at the step's beginning, rad/s
    real(dp) :: w_low(3)      ! what its rounding left out
    real(dp) :: change(3)     ! of omega in the step
    real(dp) :: total(3), back(3)
    real(dp) :: t             ! the step's beginning, s
    real(dp) :: t_low         ! what its rounding left out
    real(dp) :: h             ! step, s
    real(dp) :: rest          ! time to go, s
    real(dp) :: next          ! the step after this one, s
    real(dp) :: scale         ! largest |omega| so far, rad/s
    real(dp) :: share         ! part of the scale that the last terms may have
    real(dp) :: allowed       ! the same in rad/s
    real(dp) :: difference(3) ! of a motion beside this one
    real(dp) :: least_difference
    real(dp) :: roots(3)      ! times omega: rates, 1/s, in which the products are alike
    real(dp) :: size
    logical :: varies         ! torque with time
    logical :: at_end
    integer(int64) :: decay   ! logarithm, of the last terms over two orders
    integer(int64) :: best_share ! 65536 over the order aimed at
    integer :: best           ! order aimed at
    integer :: least          ! order from which the step may do
    integer :: most           ! order allowed
    integer :: tries
    integer(int64) :: next_look  ! steps
    integer(int64) :: half_way   ! of the steps allowed
    real(dp) :: t_half           ! the time then, s

    n_rows = 0
    steps = 0
    status = COMPLETE
    growth = 1.0_dp
    ahead = 0.0_dp
    next_look = 1
    half_way = max(1_int64, int(0.5_dp*most_steps, int64))
    t_half = 0.0_dp
    ! With the signs of omega, so that a change of two signs changes no bit.
    difference = sign(ASIDE, omega)
    w = omega
    w_low = 0.0_dp
    t = 0.0_dp
    t_low = 0.0_dp
    rest = times(n_times)
    if (rest == 0.0_dp) then
      rows(:, 1) = omega
      n_rows = 1
      return
    end if
    varies = problem%n_sines + problem%n_cosines > 0 .or. any(problem%rate /= 0.0_dp)
    least_difference = merge(1.0_dp, huge(size), varies)
    roots(1) = sqrt(abs(problem%coefficients(2)*problem%coefficients(3)))
    roots(2) = sqrt(abs(problem%coefficients(1)*problem%coefficients(3)))
    roots(3) = sqrt(abs(problem%coefficients(1)*problem%coefficients(2)))
    scale = max(abs(w(1)), abs(w(2)), abs(w(3)))
    call plan(problem, varies, scale, tolerance, rest, best, most, share, h)
    best_share = 65536/best
    s%left(4, :) = 0.0_dp
    s%right(4, :) = 0.0_dp
    decay = 0
    tries = 0
    do
      ! Equal steps near the end: the last one would be short, and cost as much.
      least = best
      at_end = abs(h) >= abs(rest)
      if (at_end) then
        h = rest
        least = 6
      else if (abs(rest) < 4.0_dp*abs(h)) then
        h = rest/ceiling(rest/h)
        least = 6
      end if
      scale = max(scale, abs(w(1)), abs(w(2)), abs(w(3)))
      allowed = share*scale
      s%left(:, 0) = [w(2), w(1), w(1), 0.0_dp]
      s%right(:, 0) = [w(3), w(3), w(2), 0.0_dp]
      if (varies) then
        s%k1(1) = problem%coefficients(1)*h
        s%k2(1) = problem%coefficients(2)*h
        s%k3(1) = problem%coefficients(3)*h
        call torque_terms(problem, t, t_low, h, most, s%m)
        call expand_varying(s, least, most, SLACK*allowed)
      else
        s%k1 = (problem%coefficients(1)*h)*INVERSE
        s%k2 = (problem%coefficients(2)*h)*INVERSE
        s%k3 = (problem%coefficients(3)*h)*INVERSE
        s%m(:, 1) = h*problem%constant
        call expand_constant(s, least, most, SLACK*allowed)
      end if
      if (steps == 0) then
        call following(h, s, best, best_share, allowed, decay, next)
        scale = max(scale, scale_of(s))
        allowed = share*scale
        ! From rest a torque that grows with time makes every third term only.
        s%last = s%last + size_of(s, s%order - 2)
      end if
      call following(h, s, best, best_share, allowed, decay, next)
      if ((.not. s%last <= SLACK*allowed) .or. (steps == 0 .and. tries == 0)) then
        ! The first step is a guess, and a later one may be too long: the terms need only a factor.
        tries = tries + 1
        if (.not. abs(s%last) <= huge(scale)) then
          if (tries > MOST_TRIES) then
            status = OVERFLOW
            return
          end if
          h = h*0.0625_dp
          if (problem%n_sines + problem%n_cosines > MANY_WAVES) then
            if (interrupt_raised() /= 0) then
              status = INTERRUPTED
              return
            end if
          end if
          cycle
        end if
        next = fitting(h, s, allowed)
        if (abs(next) > abs(rest)) next = rest
        at_end = abs(next) >= abs(rest)
        if (.not. at_end .and. abs(rest) < 4.0_dp*abs(next)) then
          next = rest/ceiling(rest/next)
        end if
        call shorten(s, next/h)
        h = next
      end if
      do while (n_rows < n_times)
        if (abs(times(n_rows + 1) - t) > abs(h)) exit
        if (at_end .and. n_rows + 1 == n_times) exit
        rows(:, n_rows + 1) = w + (w_low + inside(s, ((times(n_rows + 1) - t) - t_low)/h))
        if (.not. all(abs(rows(:, n_rows + 1)) <= huge(scale))) then
          status = OVERFLOW
          return
        end if
        n_rows = n_rows + 1
        if (mod(n_rows, ROWS_BETWEEN_LOOKS) == 0) then
          if (interrupt_raised() /= 0) then
            status = INTERRUPTED
            return
          end if
        end if
      end do
      change(1) = ((s%tail(1) + s%left(2, 3)) + s%left(2, 2)) + s%left(2, 1)
      change(2) = ((s%tail(2) + s%left(1, 3)) + s%left(1, 2)) + s%left(1, 1)
      change(3) = ((s%tail(3) + s%right(1, 3)) + s%right(1, 2)) + s%right(1, 1)
      change = change + w_low
      total = w + change
      back = total - w
      w_low = (w - (total - back)) + (change - back)
      if (varies) then
        call carry(problem%coefficients, (0.25_dp*h)*(w + total), difference)
        size = max(abs(difference(1)), abs(difference(2)), abs(difference(3)))
      else
        ! Its own change is a small difference too, and known; over what grows with the torque.
        size = max(roots(1)*abs(s%left(2, 1)), roots(2)*abs(s%left(1, 1)), &
                   roots(3)*abs(s%right(1, 1)))
        if (size > 0.0_dp) size = size/(abs(h)*(scale*scale))
      end if
      if (size < least_difference) least_difference = size
      if (size > growth*least_difference) growth = size/least_difference
      w = total
      steps = steps + 1
      tries = 1
      if (.not. all(abs(w) <= huge(scale))) then
        status = OVERFLOW
        return
      end if
      if (at_end) then
        n_rows = n_times
        rows(:, n_times) = w + w_low
        return
      end if
      call add_time(t, t_low, h)
      rest = (times(n_times) - t) - t_low
      h = next
      if (steps >= next_look) then
        if (real(steps, dp) >= most_steps) then
          ! As many steps a second as so far, or more as the motion grows faster.
          ahead = 1.0_dp
          if (steps > half_way .and. abs(t) > abs(t_half)) then
            ahead = log(real(steps, dp)/real(half_way, dp))/log(t/t_half)
          end if
          ahead = merge(min(3.0_dp, ahead), 1.0_dp, ahead > GROWING)
          ahead = real(steps, dp)*exp(ahead*log(1.0_dp + abs(rest/t)))
          status = GAVE_UP
        else if (steps == 1 .and. abs(rest) > (HOPELESS*most_steps)*abs(h)) then
          ahead = abs(rest)/max(abs(h), tiny(h))
          status = GAVE_UP
        else if (steps > 1) then
          if (interrupt_raised() /= 0) status = INTERRUPTED
        end if
        if (status /= COMPLETE) return
        next_look = min(steps + stride, max(steps + 1, int(most_steps, int64)))
        if (steps == half_way) t_half = t
        if (steps < half_way) next_look = min(next_look, half_way)
      end if
    end do
  end subroutine march

  pure subroutine carry(coefficients, half, difference)
    !! A small difference of two motions over a step, by the implicit midpoint rule.
    real(dp), intent(in) :: coefficients(3) !! A, B, C
    real(dp), intent(in) :: half(3)         !! half the step times omega in its middle, rad
    real(dp), intent(inout) :: difference(3)
    real(dp) :: a2, a3, b1, b3, c1, c2      ! the products' derivatives, times half the step
    real(dp) :: x, y, z, determinant

    a2 = coefficients(1)*half(2)
    a3 = coefficients(1)*half(3)
    b1 = coefficients(2)*half(1)
    b3 = coefficients(2)*half(3)
    c1 = coefficients(3)*half(1)
    c2 = coefficients(3)*half(2)
    x = difference(1) + a3*difference(2) + a2*difference(3)
    y = difference(2) + b3*difference(1) + b1*difference(3)
    z = difference(3) + c2*difference(1) + c1*difference(2)
    determinant = 1.0_dp - a3*b3 - a2*c2 - b1*c1 - a3*b1*c2 - a2*b3*c1
    determinant = sign(max(0.1_dp, abs(determinant)), determinant)
    difference(1) = ((1.0_dp - b1*c1)*x + (a3 + a2*c1)*y + (a2 + a3*b1)*z)/determinant
    difference(2) = ((b3 + b1*c2)*x + (1.0_dp - a2*c2)*y + (b1 + a2*b3)*z)/determinant
    difference(3) = ((c2 + b3*c1)*x + (c1 + a3*c2)*y + (1.0_dp - a3*b3)*z)/determinant
  end subroutine carry

  pure function inside(s, part) result(change)
    !! Change of omega at a part of the step, rad/s.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: part
    real(dp) :: change(3)
    integer :: k

    change = 0.0_dp
    do k = s%order, 1, -1
      change = (change + [s%left(2, k), s%left(1, k), s%right(1, k)])*part
    end do
  end function inside

  pure subroutine add_time(t, t_low, h)
    !! t + t_low + h, with what the rounding of t left out in t_low.
    real(dp), intent(inout) :: t     !! s
    real(dp), intent(inout) :: t_low !! s
    real(dp), intent(in) :: h        !! s
    real(dp) :: step, total, back

    step = h + t_low
    total = t + step
    back = total - t
    t_low = (t - (total - back)) + (step - back)
    t = total
  end subroutine add_time

end module taylor

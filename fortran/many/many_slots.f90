module many_slots
  !! The bodies under torque that are being integrated side by side, and those that are next.
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: acts, bodies_t, i1, LANES, MOST_WAVES, of_body, with_attitude
  use kinds, only: dp
  use many_columns, only: block_t, columns_of, equations_of, IN_ORDER, next_block, times_of
  use problem, only: problem_t
  use series, only: LONG, MOST_ORDER
  use taylor_plan, only: add_wave_rates, first_step, local_tolerance_of, steady_rates
  use torque_noise, only: torque_noise_of
  implicit none(type, external)
  private

  integer, parameter, public :: SLOTS = 16      !! bodies that are being integrated
  integer, parameter, public :: KIND_OF = 5     !! index in a wave: 1 for a cosine, else 0
  real(dp), parameter :: SURE = 0.03_dp !! error of the waves' angles, in tolerances
  ! Largest rounding error times amplification, in tolerances. This is a third of what the
  ! single-body kernel reports as sensitive, as that kernel measures the amplification from later
  ! instants too.
  real(dp), parameter, public :: BLURRED = 0.1_dp
  real(dp), parameter, public :: SHORTEST = 1e-7_dp !! shortest step over the time
  real(dp), parameter, public :: FAR = 1e60_dp  !! products of rates from 1/FAR to FAR are finite
  ! Factor by which the truncation error of a step may be larger than in an integration of one body,
  ! because it is estimated and subtracted. This factor does not change the order.
  real(dp), parameter :: MORE = 3.0_dp
  real(dp), parameter :: MORE_WITH_WAVES = 2.0_dp ! with waves, whose terms do not come
  ! from one pair of poles
  ! Rounding error of cancelling torques, in roundings of omega, that is always acceptable. A larger
  ! one is acceptable if it is below SURE tolerances even under the largest amplification
  ! MOST_GROWTH.
  real(dp), parameter :: LITTLE = 10.0_dp
  real(dp), parameter, public :: MOST_GROWTH = 1000.0_dp
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter :: WAVES_ERR = 16.0_dp*2.0_dp**(-53) ! rounding error per radian of a wave
  real(dp), parameter, public :: LEAST = 1e-290_dp
  integer, parameter :: SPARE = 12           ! bits of a number that its logarithm does not need
  real(dp), parameter :: MOST_BITS = 2.0_dp**45 ! largest logarithm of a ratio, without those bits
  ! Integers are converted to reals and back by a sum: few processors convert many at once.
  real(dp), parameter :: WHOLE = 1.5_dp*2.0_dp**52

  type, public :: slots_t
    real(dp), dimension(SLOTS, 3) :: w, low   !! omega and its rounding error, rad/s
    real(dp), dimension(SLOTS, 3) :: a        !! A, B, C
    real(dp), dimension(SLOTS, 3) :: constant, rate !! torque over moment: rad/s2, rad/s3
    real(dp), dimension(SLOTS, 3) :: error    !! truncation error, propagated so far, rad/s
    real(dp), dimension(SLOTS) :: worst       !! its largest size so far, as it may decrease again
    real(dp) :: small(SLOTS, 3, 3)            !! state-transition matrix from time 0: row, column
    real(dp), dimension(SLOTS) :: growth      !! its largest norm so far (maximum norm)
    real(dp), dimension(SLOTS) :: t, rest     !! time so far and time to go, s
    real(dp), dimension(SLOTS) :: h           !! previous step, s
    real(dp), dimension(SLOTS) :: scale       !! largest |omega| so far, rad/s
    real(dp), dimension(SLOTS) :: local_tolerance !! largest last terms, relative to scale
    real(dp), dimension(SLOTS) :: spin        !! rate of change of perturbations, 1/s
    real(dp), dimension(SLOTS) :: going       !! above 0 while a body is being integrated
    ! Terms of the waves, rad/s; with attitudes or waves then those of omega.
    real(dp) :: torque(SLOTS, 3, MOST_ORDER)
    ! If the time to go is at most `one` steps, the next step is the last. If it is less than `two`,
    ! the next step is this part of it.
    real(dp) :: one, two, part
  end type slots_t

  type, public :: ready_t
    !! Bodies before their first step.
    real(dp), dimension(LANES, 3) :: w, a, constant, rate
    real(dp), dimension(LANES) :: rest, h, scale, local_tolerance, spin
    real(dp), dimension(LANES) :: fits
    integer :: taken
    type(block_t) :: block
  end type ready_t

  public :: fill, make_ready, put_in, ratio

contains

  pure subroutine fill(s)
    !! Put a body at rest into each slot.
    type(slots_t), intent(inout) :: s

    s%w = 0.0_dp
    s%low = 0.0_dp
    s%a = 0.0_dp
    s%constant = 0.0_dp
    s%rate = 0.0_dp
    s%error = 0.0_dp
    s%small = 0.0_dp
    s%worst = 0.0_dp
    s%growth = 0.0_dp
    s%t = 0.0_dp
    s%rest = 0.0_dp
    s%h = 1.0_dp
    s%scale = 1.0_dp
    s%local_tolerance = 1.0_dp
    s%spin = 1.0_dp
    s%going = 0.0_dp
    s%one = 1.0_dp
    s%two = 2.0_dp
    s%part = 0.5_dp
  end subroutine fill

  subroutine make_ready(bodies, status, waves, r)
    !! Prepare the next marked bodies, as many as there are lanes. r%fits is negative for a body
    !! that is left to the single-body kernel.
    type(bodies_t), intent(in) :: bodies
    integer(i1), intent(in) :: status(bodies%n)
    real(dp), intent(inout) :: waves(KIND_OF, MOST_WAVES, LANES)
    type(ready_t), intent(inout) :: r
    real(dp), dimension(LANES, 3) :: moments
    real(dp), dimension(LANES) :: coupling, gain, rate, turned, fastest
    type(problem_t) :: torque
    real(dp), target :: own(4, MOST_WAVES)
    real(dp) :: push, ramp, tolerance
    real(dp) :: farthest  ! rotation of perturbations, rad
    real(dp) :: cancelled ! noise of a torque above which the body is left
    integer :: i, n

    call next_block(bodies%n, status, bodies%mark, r%block)
    r%taken = 0
    if (r%block%there == 0) return
    tolerance = bodies%tolerance
    call columns_of(bodies%omega0, r%block, LANES, r%w, IN_ORDER)
    call columns_of(bodies%constant, r%block, LANES, r%constant, IN_ORDER)
    call columns_of(bodies%rate, r%block, LANES, r%rate, IN_ORDER)
    call equations_of(bodies, r%block, LANES, r%a, moments)
    r%constant = r%constant/moments
    r%rate = r%rate/moments
    call times_of(bodies%times, r%block, LANES, r%rest)
    do i = 1, LANES
      coupling(i) = max(abs(r%a(i, 1)), abs(r%a(i, 2)), abs(r%a(i, 3)))
      push = max(abs(r%constant(i, 1)), abs(r%constant(i, 2)), abs(r%constant(i, 3)))
      ramp = max(abs(r%rate(i, 1)), abs(r%rate(i, 2)), abs(r%rate(i, 3)))
      r%scale(i) = max(abs(r%w(i, 1)), abs(r%w(i, 2)), abs(r%w(i, 3)))
      call steady_rates(coupling(i), r%scale(i), push, ramp, r%rest(i), gain(i), rate(i))
      ! Numbers that are not finite, or near the limits of the range, may have products that are
      ! not finite.
      r%fits(i) = 1.0_dp
      if (.not. (abs(r%w(i, 1)) + abs(r%w(i, 2)) + abs(r%w(i, 3)) <= FAR &
                 .and. r%scale(i) >= 1.0_dp/FAR)) r%fits(i) = -1.0_dp
      if (.not. (abs(r%rest(i)) <= FAR .and. abs(r%rest(i)) >= 1.0_dp/FAR)) r%fits(i) = -1.0_dp
      if (.not. sum(abs(r%a(i, :))) + sum(abs(r%constant(i, :))) <= FAR) r%fits(i) = -1.0_dp
      if (.not. sum(abs(r%rate(i, :))) <= FAR) r%fits(i) = -1.0_dp
      if (.not. abs(r%a(i, 1)) <= FAR) r%fits(i) = -1.0_dp
    end do
    turned = 0.0_dp
    if (bodies%n_waves > 0) then
      cancelled = max(LITTLE, SURE*tolerance/(ROUNDING*MOST_GROWTH))
      do i = 1, LANES
        call waves_of_body(bodies, r%block%at(i), waves(:, :bodies%n_waves, i))
      end do
      fastest = 0.0_dp
      do n = 1, bodies%n_waves
        do i = 1, LANES
          waves(:3, n, i) = waves(:3, n, i)/moments(i, :)
          call add_wave_rates(waves(:4, n, i), waves(KIND_OF, n, i) <= 0.0_dp, coupling(i), &
                              r%rest(i), gain(i), rate(i), turned(i))
          fastest(i) = max(fastest(i), abs(waves(4, n, i)))
          if (.not. all(abs(waves(:, n, i)) <= FAR)) r%fits(i) = -1.0_dp
        end do
      end do
      do i = 1, LANES
        if (.not. fastest(i)*abs(r%rest(i))*WAVES_ERR <= SURE*tolerance) r%fits(i) = -1.0_dp
        if (r%fits(i) < 0.0_dp) cycle
        torque%constant = r%constant(i, :)
        torque%rate = r%rate(i, :)
        own = waves(:4, :, i)
        torque%n_sines = 0
        do n = 1, bodies%n_waves
          ! Sines precede cosines; the zeros that fill up the array count as either.
          if (waves(KIND_OF, n, i) > 0.0_dp) exit
          torque%n_sines = n
        end do
        torque%n_cosines = bodies%n_waves - torque%n_sines
        torque%sines => own(:, :torque%n_sines)
        torque%cosines => own(:, torque%n_sines + 1:bodies%n_waves)
        if (torque_noise_of(torque, r%rest(i), 1.0_dp, -r%scale(i)) > cancelled) then
          r%fits(i) = -1.0_dp
        end if
      end do
    end if
    ! The attitude rotates even if omega is steady.
    if (with_attitude(bodies)) coupling = max(coupling, 1.0_dp)
    do i = 1, LANES
      r%h(i) = first_step(rate(i), r%rest(i))
      r%local_tolerance(i) = local_tolerance_of(coupling(i), r%scale(i), gain(i), turned(i), &
                                                tolerance, r%rest(i))
      r%local_tolerance(i) = merge(MORE_WITH_WAVES, MORE, bodies%n_waves > 0)*r%local_tolerance(i)
      push = sqrt(abs(r%a(i, 1)))
      ramp = sqrt(abs(r%a(i, 2)))
      rate(i) = sqrt(abs(r%a(i, 3)))
      r%spin(i) = r%scale(i)*max(push*ramp, ramp*rate(i), rate(i)*push)
      if (.not. abs(r%h(i)) > SHORTEST*abs(r%rest(i))) r%fits(i) = -1.0_dp
      ! A long motion needs precise variations.
      farthest = (r%spin(i)*abs(r%rest(i)))*(1.0_dp + gain(i)/r%scale(i))
      if (.not. farthest <= LONG) r%fits(i) = -1.0_dp
    end do
  end subroutine make_ready

  pure subroutine waves_of_body(bodies, body, waves)
    !! Collect the waves that act on a body, sines before cosines. The zeros after them change no
    !! bit.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: body
    real(dp), intent(inout) :: waves(:, :)  !! (KIND_OF, largest number of waves on a body)
    integer :: column, n, there

    there = 0
    waves = 0.0_dp
    column = of_body(size(bodies%sines, 3), body)
    do n = 1, size(bodies%sines, 2)
      if (.not. acts(bodies%sines(:, n, column))) cycle
      there = there + 1
      waves(:4, there) = bodies%sines(:, n, column)
    end do
    column = of_body(size(bodies%cosines, 3), body)
    do n = 1, size(bodies%cosines, 2)
      if (.not. acts(bodies%cosines(:, n, column))) cycle
      there = there + 1
      waves(:4, there) = bodies%cosines(:, n, column)
      waves(KIND_OF, there) = 1.0_dp
    end do
  end subroutine waves_of_body

  pure subroutine put_in(r, j, s, i)
    !! Put prepared body j into slot i.
    type(ready_t), intent(in) :: r
    integer, intent(in) :: j, i
    type(slots_t), intent(inout) :: s
    integer :: axis

    do axis = 1, 3
      s%w(i, axis) = r%w(j, axis)
      s%low(i, axis) = 0.0_dp
      s%a(i, axis) = r%a(j, axis)
      s%constant(i, axis) = r%constant(j, axis)
      s%rate(i, axis) = r%rate(j, axis)
      s%error(i, axis) = 0.0_dp
      s%small(i, axis, :) = 0.0_dp
      s%small(i, axis, axis) = 1.0_dp
    end do
    s%growth(i) = 1.0_dp
    s%worst(i) = 0.0_dp
    s%t(i) = 0.0_dp
    s%rest(i) = r%rest(j)
    s%h(i) = r%h(j)
    s%scale(i) = r%scale(j)
    s%local_tolerance(i) = r%local_tolerance(j)
    s%spin(i) = r%spin(j)
    s%going(i) = 1.0_dp
  end subroutine put_in

  pure real(dp) function ratio(order, allowed, last)
    !! Return the factor on the step with which the last terms would be as large as allowed. The
    !! bits of a positive number, read as an integer, are its logarithm to 6 %.
    integer, intent(in) :: order
    real(dp), intent(in) :: allowed, last
    integer(int64) :: bits
    real(dp) :: power

    bits = ishft(transfer(allowed, bits), -SPARE) - ishft(transfer(max(last, LEAST), bits), -SPARE)
    power = transfer(bits + transfer(WHOLE, bits), power) - WHOLE
    power = max(-MOST_BITS, min(MOST_BITS, power*(1.0_dp/real(order, dp))))
    bits = transfer(power + WHOLE, bits) - transfer(WHOLE, bits)
    ratio = transfer(transfer(1.0_dp, bits) + ishft(bits, SPARE), 1.0_dp)
  end function ratio

end module many_slots

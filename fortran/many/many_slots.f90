module many_slots
  !! Bodies under torque on their way, side by side, and those that are next.
  use bodies, only: bodies_t, LANES, of_body
  use kinds, only: dp
  use many_columns, only: columns_of, equations_of
  use problem, only: problem_t
  use taylor_plan, only: add_wave_rates, share_and_step, steady_rates
  use torque_noise, only: torque_noise_of
  implicit none(type, external)
  private

  integer, parameter, public :: SLOTS = 16      !! bodies on their way
  integer, parameter, public :: MOST_ORDER = 24
  integer, parameter, public :: MOST_WAVES = 16 !! else the single kernel, for which none is many
  real(dp), parameter, public :: SURE = 0.03_dp !! rounding times growth, in tolerances
  real(dp), parameter, public :: SHORTEST = 1e-7_dp !! step over the time
  real(dp), parameter, public :: FAR = 1e60_dp  !! from 1: products of such rates are numbers
  ! A step may leave out so much more than that of a single march, whose order it does not choose:
  ! what it leaves out is known and taken off.
  real(dp), parameter :: MORE = 3.0_dp
  real(dp), parameter :: MORE_WITH_WAVES = 2.0_dp ! whose terms are no sum over one pair of poles
  real(dp), parameter :: CANCELLED = 10.0_dp !! torque of terms that leave so little of each
  real(dp), parameter :: WAVES_ERR = 16.0_dp*2.0_dp**(-53) ! of each radian of a wave
  ! None that a symmetry keeps from growing; of length 1 as growth takes it.
  real(dp), parameter :: DIFFERENCE(3) = [0.48_dp, -0.31_dp, 0.21_dp]

  type, public :: slots_t
    real(dp), dimension(SLOTS, 3) :: w, low   !! omega and its rounding, rad/s
    real(dp), dimension(SLOTS, 3) :: a        !! A, B, C
    real(dp), dimension(SLOTS, 3) :: constant, rate !! torque over moment
    real(dp), dimension(SLOTS, 3) :: error    !! left out and carried so far, rad/s
    real(dp), dimension(SLOTS) :: worst       !! its largest size so far: it may shrink again
    real(dp), dimension(SLOTS, 3) :: small    !! a difference
    real(dp), dimension(SLOTS) :: growth      !! its largest size
    real(dp), dimension(SLOTS) :: t, rest     !! s
    real(dp), dimension(SLOTS) :: h           !! the step before, s
    real(dp), dimension(SLOTS) :: scale       !! largest omega so far, rad/s
    real(dp), dimension(SLOTS) :: share       !! that the last terms may have of it
    real(dp), dimension(SLOTS) :: spin        !! of small differences, 1/s
    real(dp), dimension(SLOTS) :: going       !! above 0 where a body has a way to go
    real(dp) :: torque(SLOTS, 3, MOST_ORDER)  !! what waves add to the terms, rad/s
  end type slots_t

  type, public :: ready_t
    !! Bodies before their first step.
    real(dp), dimension(LANES, 3) :: w, a, constant, rate
    real(dp), dimension(LANES) :: rest, h, scale, share, spin
    real(dp), dimension(LANES) :: fits
    integer :: there, taken
  end type ready_t

  public :: fill, make_ready, put_in

contains

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
    s%worst = 0.0_dp
    s%growth = 0.0_dp
    s%t = 0.0_dp
    s%rest = 0.0_dp
    s%h = 1.0_dp
    s%scale = 1.0_dp
    s%share = 1.0_dp
    s%spin = 1.0_dp
    s%going = 0.0_dp
  end subroutine fill

  subroutine make_ready(bodies, first, waves, r)
    !! The next bodies, as many as there are lanes; r%fits is below 0 of one that is none for here.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: first
    real(dp), intent(inout), target :: waves(4, MOST_WAVES, LANES)
    type(ready_t), intent(inout) :: r
    real(dp), dimension(LANES, 3) :: moments
    real(dp), dimension(LANES) :: coupling, gain, rate, turned, fastest
    type(problem_t) :: torque
    real(dp) :: push, ramp, tolerance
    integer :: i, n, n_sines, n_waves

    r%there = min(LANES, bodies%n - first)
    r%taken = 0
    tolerance = bodies%tolerance
    call columns_of(bodies%omega0, first, LANES, r%w)
    call columns_of(bodies%constant, first, LANES, r%constant)
    call columns_of(bodies%rate, first, LANES, r%rate)
    call equations_of(bodies, first, LANES, r%a, moments)
    r%constant = r%constant/moments
    r%rate = r%rate/moments
    if (size(bodies%times) == 1) then
      r%rest = bodies%times(1)
    else
      r%rest(:r%there) = bodies%times(first + 1:first + r%there)
      r%rest(r%there + 1:) = r%rest(r%there)
    end if
    do i = 1, LANES
      coupling(i) = max(abs(r%a(i, 1)), abs(r%a(i, 2)), abs(r%a(i, 3)))
      push = max(abs(r%constant(i, 1)), abs(r%constant(i, 2)), abs(r%constant(i, 3)))
      ramp = max(abs(r%rate(i, 1)), abs(r%rate(i, 2)), abs(r%rate(i, 3)))
      r%scale(i) = max(abs(r%w(i, 1)), abs(r%w(i, 2)), abs(r%w(i, 3)))
      call steady_rates(coupling(i), r%scale(i), push, ramp, r%rest(i), gain(i), rate(i))
      ! Of numbers that are none, or not far from the end of the range, a product may be.
      r%fits(i) = 1.0_dp
      if (.not. (abs(r%w(i, 1)) + abs(r%w(i, 2)) + abs(r%w(i, 3)) <= FAR &
                 .and. r%scale(i) >= 1.0_dp/FAR)) r%fits(i) = -1.0_dp
      if (.not. (abs(r%rest(i)) <= FAR .and. abs(r%rest(i)) >= 1.0_dp/FAR)) r%fits(i) = -1.0_dp
      if (.not. sum(abs(r%a(i, :))) + sum(abs(r%constant(i, :))) <= FAR) r%fits(i) = -1.0_dp
      if (.not. sum(abs(r%rate(i, :))) <= FAR) r%fits(i) = -1.0_dp
      if (.not. abs(r%a(i, 1)) <= FAR) r%fits(i) = -1.0_dp
    end do
    turned = 0.0_dp
    n_sines = size(bodies%sines, 2)
    n_waves = n_sines + size(bodies%cosines, 2)
    if (n_waves > 0) then
      torque%n_sines = n_sines
      torque%n_cosines = n_waves - n_sines
      fastest = 0.0_dp
      do n = 1, n_waves
        do i = 1, r%there
          if (n <= n_sines) then
            waves(:, n, i) = bodies%sines(:, n, of_body(size(bodies%sines, 3), first + i))
          else
            waves(:, n, i) = bodies%cosines(:, n - n_sines, &
                                            of_body(size(bodies%cosines, 3), first + i))
          end if
          waves(:3, n, i) = waves(:3, n, i)/moments(i, :)
          call add_wave_rates(waves(:, n, i), n <= n_sines, coupling(i), r%rest(i), gain(i), &
                              rate(i), turned(i))
          fastest(i) = max(fastest(i), abs(waves(4, n, i)))
          if (.not. all(abs(waves(:, n, i)) <= FAR)) r%fits(i) = -1.0_dp
        end do
      end do
      do i = 1, r%there
        if (.not. fastest(i)*abs(r%rest(i))*WAVES_ERR <= SURE*tolerance) r%fits(i) = -1.0_dp
        if (r%fits(i) < 0.0_dp) cycle
        torque%constant = r%constant(i, :)
        torque%rate = r%rate(i, :)
        torque%sines => waves(:, :n_sines, i)
        torque%cosines => waves(:, n_sines + 1:n_waves, i)
        if (torque_noise_of(torque, r%rest(i), 1.0_dp, -r%scale(i)) > CANCELLED) then
          r%fits(i) = -1.0_dp
        end if
      end do
    end if
    do i = 1, LANES
      call share_and_step(coupling(i), r%scale(i), gain(i), rate(i), turned(i), tolerance, &
                          r%rest(i), r%share(i), r%h(i))
      r%share(i) = merge(MORE_WITH_WAVES, MORE, n_waves > 0)*r%share(i)
      push = sqrt(abs(r%a(i, 1)))
      ramp = sqrt(abs(r%a(i, 2)))
      rate(i) = sqrt(abs(r%a(i, 3)))
      r%spin(i) = r%scale(i)*max(push*ramp, ramp*rate(i), rate(i)*push)
      if (.not. abs(r%h(i)) > SHORTEST*abs(r%rest(i))) r%fits(i) = -1.0_dp
    end do
  end subroutine make_ready

  pure subroutine put_in(r, j, s, i)
    !! Body j of those that are ready into slot i.
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
      s%small(i, axis) = DIFFERENCE(axis)
    end do
    s%growth(i) = 1.0_dp
    s%worst(i) = 0.0_dp
    s%t(i) = 0.0_dp
    s%rest(i) = r%rest(j)
    s%h(i) = r%h(j)
    s%scale(i) = r%scale(j)
    s%share(i) = r%share(j)
    s%spin(i) = r%spin(j)
    s%going(i) = 1.0_dp
  end subroutine put_in

end module many_slots

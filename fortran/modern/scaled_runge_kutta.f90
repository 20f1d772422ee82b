module scaled_runge_kutta
  !! Classical Runge-Kutta (eq. 31) for few digits: unknowns scaled so that a slope is one fused
  !! multiply-add, waves of the torque integrated exactly, equal steps, checked as they are taken.
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use statuses, only: COMPLETE, GAVE_UP, OVERFLOW, REFUSED
  implicit none(type, external)
  private

  integer, parameter :: MOST_WAVES = 8
  integer, parameter :: MOST_TRIES = 40
  integer, parameter :: EXACT_AGAIN = 64     ! steps until sine and cosine are computed afresh
  real(dp), parameter :: LEAST_STEPS = 4.0_dp ! fewer seams say too little
  real(dp), parameter :: MOST_STEPS = 1e7_dp
  ! Error after time T: about SPREAD (rate h)**4 rate T; from the cases, see tests/test_quick.py.
  real(dp), parameter :: FIRST_GUESS = 0.003_dp
  ! Of the change of slope at the seams of steps, what the error is at the most.
  real(dp), parameter :: SEAM = 0.13_dp
  real(dp), parameter :: SHARE = 0.5_dp      ! of the tolerance: what is not seen takes the rest
  real(dp), parameter :: ENOUGH = 0.75_dp    ! of the aim, where the seams are looked at
  ! Against the series, in steps of this method for a radian of motion: so many, and so many more
  ! for each binary digit: measured in Cases 5 to 7.
  real(dp), parameter :: SERIES_STEPS = 1.9_dp
  real(dp), parameter :: SERIES_STEPS_A_BIT = 0.28_dp
  real(dp), parameter :: WAVE_RADIAN = 0.4_dp ! of a wave, in radians of motion, to the series
  real(dp), parameter :: VARYING = 1.5_dp    ! cost of a step under a torque of time
  real(dp), parameter :: A_WAVE = 0.9_dp     ! and of each wave in it
  real(dp), parameter :: FAST = 8.0_dp       ! frequency of a wave over the rate of the motion
  real(dp), parameter :: WEAK = 0.2_dp
  real(dp), parameter :: RESOLVED_STEPS = 0.7_dp ! for a radian of a wave that counts
  real(dp), parameter :: WAVE_ERROR = 1.0_dp/2880.0_dp ! of Simpson's rule, times radians**4

  type :: motion_t
    real(dp) :: scale(3)     ! angular velocity is scale times unknown, rad/s
    real(dp) :: slope(3)     ! constant torque in the unknowns, 1/s
    real(dp) :: climb(3)     ! rate of the torque, 1/s2
    integer :: waves
    real(dp) :: frequency(MOST_WAVES)    ! rad/s
    real(dp) :: on_sine(3, MOST_WAVES)   ! integral of the wave: these times sine
    real(dp) :: on_versine(3, MOST_WAVES) ! and these times 1 - cosine
    real(dp) :: mean(3)      ! of the waves that are averaged, in the unknowns
    logical :: odd           ! the second sign is minus, as for a body
    integer :: axes(3)       ! of the body
  end type motion_t

  public :: quick_solve

contains

  subroutine quick_solve(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, &
                         omega, tolerance, t_end, contest, result, status, steps) &
    bind(c, name="quick_solve_level")
    !! Angular velocity at `t_end`.
    real(c_double), intent(in) :: coefficients(3)       !! A, B, C
    real(c_double), intent(in) :: m_constant(3)         !! torque over moment, 1/s2
    real(c_double), intent(in) :: m_rate(3)             !! 1/s3
    integer(c_int), intent(in), value :: n_sines
    real(c_double), intent(in) :: sines(4, n_sines)     !! amplitude (3), 1/s2; frequency, rad/s
    integer(c_int), intent(in), value :: n_cosines
    real(c_double), intent(in) :: cosines(4, n_cosines) !! the same
    real(c_double), intent(in) :: omega(3)              !! at time 0, rad/s
    real(c_double), intent(in) :: tolerance             !! relative
    real(c_double), intent(in) :: t_end                 !! s
    integer(c_int), intent(in), value :: contest        !! not 0: REFUSED where a series is faster
    real(c_double), intent(out) :: result(3)            !! rad/s
    integer(c_int), intent(out) :: status               !! COMPLETE, OVERFLOW, REFUSED, GAVE_UP
    integer(c_int), intent(out) :: steps                !! of the last try
    type(motion_t) :: motion
    type(motion_t) :: whole  ! with the waves that are averaged
    logical :: varies
    real(dp) :: start(3)
    real(dp) :: x(3)
    real(dp) :: seams        ! sum of the changes of slope times step
    real(dp) :: rate         ! 1/s
    real(dp) :: rate_0       ! the same at time 0
    real(dp) :: power_5      ! mean of the fifth power of the rate, which grows with the torque
    real(dp) :: n_steps
    real(dp) :: h            ! s
    real(dp) :: aim          ! error, relative
    real(dp) :: error        ! relative
    real(dp) :: size         ! of the unknowns, 1/s
    real(dp) :: wave         ! what it adds to the unknowns, times time
    real(dp) :: resolved     ! steps for a radian of it
    real(dp) :: radians      ! of the motion and of the waves
    real(dp) :: cost         ! in steps under constant torque
    real(dp) :: bits         ! of the tolerance
    integer :: tries
    integer :: n

    aim = SHARE*tolerance
    status = REFUSED
    steps = 0
    result = omega
    if (n_sines + n_cosines > MOST_WAVES) return
   call scaled(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, motion, status)
    if (status /= COMPLETE) return
    start = omega(motion%axes)/motion%scale
    rate_0 = max(abs(start(1)), abs(start(2)), abs(start(3)))
    rate = rate_0 + abs(t_end)*max(abs(motion%slope(1)), abs(motion%slope(2)), abs(motion%slope(3)))
    rate = rate + 0.5_dp*t_end*t_end*max(abs(motion%climb(1)), abs(motion%climb(2)), &
                                         abs(motion%climb(3)))
    do n = 1, motion%waves
      rate = rate + size_of(motion, n)*min(2.0_dp, abs(motion%frequency(n)*t_end))
    end do
    power_5 = rate**5
    if (rate > 1.1_dp*rate_0) power_5 = (rate**6 - rate_0**6)/(6.0_dp*(rate - rate_0))
    n_steps = LEAST_STEPS + abs(t_end)*sqrt(sqrt(FIRST_GUESS*power_5*abs(t_end)/aim))
    varies = motion%waves > 0 .or. any(abs(motion%climb) > 0.0_dp)
    whole = motion
    call average(motion, rate, aim)
    do n = 1, motion%waves
      ! What is left of the waves has to be resolved.
      wave = size_of(motion, n)*abs(t_end)
      resolved = max(RESOLVED_STEPS, sqrt(sqrt(WAVE_ERROR*wave/aim)))
      n_steps = max(n_steps, resolved*abs(motion%frequency(n)*t_end))
    end do
    if (contest /= 0) then
      radians = 0.5_dp*abs(t_end)*(rate_0 + rate)
      do n = 1, whole%waves
        radians = radians + WAVE_RADIAN*abs(whole%frequency(n)*t_end)
      end do
      cost = n_steps
      if (varies) cost = n_steps*(VARYING + A_WAVE*motion%waves)
      bits = 1023.0_dp - real(ishft(transfer(aim, 0_int64), -52), dp)
      if (cost > 10.0_dp + radians*(SERIES_STEPS + SERIES_STEPS_A_BIT*bits)) then
        status = REFUSED
        return
      end if
    end if
    do tries = 1, MOST_TRIES
      if (.not. n_steps <= MOST_STEPS) then
        status = merge(GAVE_UP, OVERFLOW, tries == 1)
        return
      end if
      steps = int(n_steps)
      if (varies) then
        call march_varying(motion, start, t_end, steps, x, seams)
      else if (motion%odd) then
        call march_odd(motion%slope, start, t_end/steps, steps, x, seams)
      else
        call march_even(motion%slope, start, t_end/steps, steps, x, seams)
      end if
      size = max(abs(start(1)), abs(start(2)), abs(start(3)), abs(x(1)), abs(x(2)), abs(x(3)))
      h = abs(t_end)/real(steps, dp)
      ! The seams show an error of third order in the step: the fourth is smaller by rate times h.
      error = SEAM*(seams*h/size)*(sqrt(sqrt(power_5/rate))*h)
      if (error <= ENOUGH*aim) exit
      if (error <= huge(error)) then
        n_steps = 1.0_dp + n_steps*min(8.0_dp, 1.1_dp*sqrt(sqrt(error/aim)))
      else
        n_steps = 4.0_dp*n_steps
      end if
      if (tries == MOST_TRIES) then
        status = OVERFLOW
        return
      end if
    end do
    if (varies) x = x + integral(whole, t_end)
    result(motion%axes) = x*motion%scale
    status = COMPLETE
  end subroutine quick_solve

  pure subroutine scaled(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, &
                         motion, status)
    !! Unknowns in which every product has the coefficient 1 or -1, and -1 only the second.
    real(dp), intent(in) :: coefficients(3)
    real(dp), intent(in) :: m_constant(3)
    real(dp), intent(in) :: m_rate(3)
    integer, intent(in) :: n_sines
    real(dp), intent(in) :: sines(4, n_sines)
    integer, intent(in) :: n_cosines
    real(dp), intent(in) :: cosines(4, n_cosines)
    type(motion_t), intent(out) :: motion
    integer, intent(out) :: status
    real(dp) :: c(3)
    real(dp) :: root(3)
    real(dp) :: turned       ! -1 where all signs are turned by turning the third axis
    integer :: i

    status = REFUSED
    ! The axis whose sign stands alone becomes the second.
    motion%axes = [3, 1, 2]
    if (coefficients(1)*coefficients(2) > 0.0_dp) motion%axes = [2, 3, 1]
    if (coefficients(1)*coefficients(3) > 0.0_dp) motion%axes = [1, 2, 3]
    c = coefficients(motion%axes)
    motion%odd = c(1)*c(2) < 0.0_dp
    turned = 1.0_dp
    if (c(1) < 0.0_dp) turned = -1.0_dp
    root = sqrt(abs(c))
    if (.not. minval(root) > 0.0_dp) return
    motion%scale(1) = 1.0_dp/(root(2)*root(3))
    motion%scale(2) = 1.0_dp/(root(1)*root(3))
    motion%scale(3) = turned/(root(1)*root(2))
    if (.not. maxval(abs(motion%scale)) <= 1e100_dp) return
    motion%slope = m_constant(motion%axes)/motion%scale
    motion%climb = m_rate(motion%axes)/motion%scale
    motion%waves = 0
    do i = 1, n_sines
      call add_wave(sines(1:3, i), sines(4, i), .false., motion)
    end do
    do i = 1, n_cosines
      call add_wave(cosines(1:3, i), cosines(4, i), .true., motion)
    end do
    status = COMPLETE
  end subroutine scaled

  pure subroutine add_wave(amplitude, frequency, is_cosine, motion)
    !! The integral of one more wave; waves of one frequency share their sine and cosine.
    real(dp), intent(in) :: amplitude(3)  !! 1/s2
    real(dp), intent(in) :: frequency     !! rad/s
    logical, intent(in) :: is_cosine
    type(motion_t), intent(inout) :: motion
    real(dp) :: part(3)
    integer :: n

    part = amplitude(motion%axes)/motion%scale
    if (abs(frequency) < 1e-100_dp) then
      if (is_cosine) motion%slope = motion%slope + part
      return
    end if
    do n = 1, motion%waves
      if (abs(motion%frequency(n) - frequency) <= 0.0_dp) exit
    end do
    if (n > motion%waves) then
      motion%waves = n
      motion%frequency(n) = frequency
      motion%on_sine(:, n) = 0.0_dp
      motion%on_versine(:, n) = 0.0_dp
    end if
    if (is_cosine) then
      motion%on_sine(:, n) = motion%on_sine(:, n) + part/frequency
    else
      motion%on_versine(:, n) = motion%on_versine(:, n) + part/frequency
    end if
  end subroutine add_wave

  pure subroutine average(motion, rate, tolerance)
    !! Drop the waves too fast and too weak to matter in the products, but for their mean: they
    !! turn the motion by their integral times the rate over their frequency, forth and back.
    type(motion_t), intent(inout) :: motion
    real(dp), intent(in) :: rate         !! 1/s
    real(dp), intent(in) :: tolerance
    integer :: n
    integer :: kept
    real(dp) :: size

    kept = 0
    motion%mean = 0.0_dp
    do n = 1, motion%waves
      size = size_of(motion, n)
      if (abs(motion%frequency(n)) > FAST*rate .and. &
          size*rate < WEAK*tolerance*abs(motion%frequency(n))*rate) then
        motion%mean = motion%mean + motion%on_versine(:, n)
      else
        kept = kept + 1
        motion%frequency(kept) = motion%frequency(n)
        motion%on_sine(:, kept) = motion%on_sine(:, n)
        motion%on_versine(:, kept) = motion%on_versine(:, n)
      end if
    end do
    motion%waves = kept
  end subroutine average

  pure real(dp) function size_of(motion, n)
    !! Of the integral of wave n, 1/s.
    type(motion_t), intent(in) :: motion
    integer, intent(in) :: n

    size_of = maxval(abs(motion%on_sine(:, n))) + maxval(abs(motion%on_versine(:, n)))
  end function size_of

  pure subroutine march_odd(m, start, h, n_steps, x, seams)
    !! Equal steps under constant torque, signs plus, minus, plus.
    real(dp), intent(in) :: m(3)
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: h
    integer, intent(in) :: n_steps
    real(dp), intent(out) :: x(3)
    real(dp), intent(out) :: seams
    real(dp) :: x1, x2, x3, a1, a2, a3, b1, b2, b3, c1, c2, c3, d1, d2, d3, p1, p2, p3
    real(dp) :: half, sixth, third
    integer :: i

    half = 0.5_dp*h
    sixth = h/6.0_dp
    third = h/3.0_dp
    x1 = start(1)
    x2 = start(2)
    x3 = start(3)
    a1 = m(1) + x2*x3
    a2 = m(2) - x1*x3
    a3 = m(3) + x1*x2
    seams = 0.0_dp
    do i = 1, n_steps
      p1 = x1 + half*a1
      p2 = x2 + half*a2
      p3 = x3 + half*a3
      b1 = m(1) + p2*p3
      b2 = m(2) - p1*p3
      b3 = m(3) + p1*p2
      p1 = x1 + half*b1
      p2 = x2 + half*b2
      p3 = x3 + half*b3
      c1 = m(1) + p2*p3
      c2 = m(2) - p1*p3
      c3 = m(3) + p1*p2
      p1 = x1 + h*c1
      p2 = x2 + h*c2
      p3 = x3 + h*c3
      d1 = m(1) + p2*p3
      d2 = m(2) - p1*p3
      d3 = m(3) + p1*p2
      x1 = ((x1 + sixth*a1) + third*(b1 + c1)) + sixth*d1
      x2 = ((x2 + sixth*a2) + third*(b2 + c2)) + sixth*d2
      x3 = ((x3 + sixth*a3) + third*(b3 + c3)) + sixth*d3
      a1 = m(1) + x2*x3
      a2 = m(2) - x1*x3
      a3 = m(3) + x1*x2
      seams = seams + ((abs(a1 - d1) + abs(a2 - d2)) + abs(a3 - d3))
    end do
    x = [x1, x2, x3]
  end subroutine march_odd

  pure subroutine march_even(m, start, h, n_steps, x, seams)
    !! The same with three signs alike, which no body has.
    real(dp), intent(in) :: m(3)
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: h
    integer, intent(in) :: n_steps
    real(dp), intent(out) :: x(3)
    real(dp), intent(out) :: seams
    real(dp) :: a(3), b(3), c(3), d(3)
    integer :: i

    x = start
    a = m + slopes(x, 1.0_dp)
    seams = 0.0_dp
    do i = 1, n_steps
      b = m + slopes(x + (0.5_dp*h)*a, 1.0_dp)
      c = m + slopes(x + (0.5_dp*h)*b, 1.0_dp)
      d = m + slopes(x + h*c, 1.0_dp)
      x = x + (h/6.0_dp)*(a + 2.0_dp*(b + c) + d)
      a = m + slopes(x, 1.0_dp)
      seams = seams + sum(abs(a - d))
    end do
  end subroutine march_even

  pure subroutine march_varying(motion, start, t_end, n_steps, x, seams)
    !! Equal steps under a torque of time: its integral is exact, and what remains is smooth.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: t_end
    integer, intent(in) :: n_steps
    real(dp), intent(out) :: x(3)
    real(dp), intent(out) :: seams
    real(dp) :: u(3)         ! x without the integral of the torque
    real(dp) :: a(3), b(3), c(3), d(3)
    real(dp) :: s_middle(3)  ! integral of the torque at the step's middle and end
    real(dp) :: s_end(3)
    real(dp) :: sine(MOST_WAVES)
    real(dp) :: cosine(MOST_WAVES)
    real(dp) :: turn_sine(MOST_WAVES)
    real(dp) :: turn_cosine(MOST_WAVES)
    real(dp) :: h
    real(dp) :: sign_2
    logical :: afresh
    integer :: i
    integer :: n

    h = t_end/n_steps
    sign_2 = merge(-1.0_dp, 1.0_dp, motion%odd)
    do n = 1, motion%waves
      turn_sine(n) = sin(0.5_dp*h*motion%frequency(n))
      turn_cosine(n) = cos(0.5_dp*h*motion%frequency(n))
      sine(n) = 0.0_dp
      cosine(n) = 1.0_dp
    end do
    u = start
    a = slopes(u + motion%mean, sign_2)
    seams = 0.0_dp
    do i = 1, n_steps
      afresh = mod(i, EXACT_AGAIN) == 0
      call turn(motion, (i - 0.5_dp)*h, afresh, turn_sine, turn_cosine, sine, cosine, s_middle)
      call turn(motion, i*h, afresh, turn_sine, turn_cosine, sine, cosine, s_end)
      b = slopes((u + (0.5_dp*h)*a) + s_middle, sign_2)
      c = slopes((u + (0.5_dp*h)*b) + s_middle, sign_2)
      d = slopes((u + h*c) + s_end, sign_2)
      u = u + (h/6.0_dp)*((a + d) + 2.0_dp*(b + c))
      a = slopes(u + s_end, sign_2)
      seams = seams + ((abs(a(1) - d(1)) + abs(a(2) - d(2))) + abs(a(3) - d(3)))
    end do
    x = u
  end subroutine march_varying

  pure subroutine turn(motion, t, afresh, turn_sine, turn_cosine, sine, cosine, s)
    !! Waves half a step on, and the integral of the torque there.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t                        !! s
    logical, intent(in) :: afresh                    !! from t, not from half a step before
    real(dp), intent(in) :: turn_sine(MOST_WAVES)    !! of half a step
    real(dp), intent(in) :: turn_cosine(MOST_WAVES)
    real(dp), intent(inout) :: sine(MOST_WAVES)
    real(dp), intent(inout) :: cosine(MOST_WAVES)
    real(dp), intent(out) :: s(3)
    real(dp) :: held
    integer :: n

    s = motion%mean + t*(motion%slope + (0.5_dp*t)*motion%climb)
    do n = 1, motion%waves
      if (afresh) then
        sine(n) = sin(motion%frequency(n)*t)
        cosine(n) = cos(motion%frequency(n)*t)
      else
        held = sine(n)*turn_cosine(n) + cosine(n)*turn_sine(n)
        cosine(n) = cosine(n)*turn_cosine(n) - sine(n)*turn_sine(n)
        sine(n) = held
      end if
      s = s + (motion%on_sine(:, n)*sine(n) + motion%on_versine(:, n)*(1.0_dp - cosine(n)))
    end do
  end subroutine turn

  pure function integral(motion, t) result(s)
    !! The whole torque's integral from 0 to t, in the unknowns.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t
    real(dp) :: s(3)
    integer :: n

    s = t*(motion%slope + (0.5_dp*t)*motion%climb)
    do n = 1, motion%waves
      s = s + motion%on_sine(:, n)*sin(motion%frequency(n)*t) &
          + motion%on_versine(:, n)*(1.0_dp - cos(motion%frequency(n)*t))
    end do
  end function integral

  pure function slopes(x, sign_2) result(f)
    !! Products of the unknowns.
    real(dp), intent(in) :: x(3)
    real(dp), intent(in) :: sign_2
    real(dp) :: f(3)

    f(1) = x(2)*x(3)
    f(2) = sign_2*(x(1)*x(3))
    f(3) = x(1)*x(2)
  end function slopes

end module scaled_runge_kutta

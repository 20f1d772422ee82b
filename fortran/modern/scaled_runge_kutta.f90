module scaled_runge_kutta
  !! Classical Runge-Kutta (eq. 31) for few digits: unknowns scaled so that a slope is one fused
  !! multiply-add, waves of the torque integrated exactly, equal steps of three lengths at once.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: problem_t
  use scaled_motion, only: average, integral, MOST_WAVES, motion_t, reach_of, scaled, &
                           steps_for_waves, turned, versine
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, REFUSED
  implicit none(type, external)
  private

  integer, parameter :: EXACT_AGAIN = 64     ! fours of steps until sine and cosine are made afresh
  real(dp), parameter :: THIRD_PART = 1.0_dp/3.0_dp
  real(dp), parameter :: LEAST_STEPS = 2.0_dp
  real(dp), parameter :: MOST_STEPS = 2e6_dp
  real(dp), parameter :: COUNTABLE = 2e9_dp  ! steps
  integer, parameter :: BETWEEN_LOOKS = 2**17 - 1 ! at the user: turns of the marches' loops
  ! Beyond so many times the steps planned, the motion makes more of rounding than is allowed.
  real(dp), parameter :: MOST_TIMES = 12.0_dp
  ! Error after time T: about FIRST_GUESS (rate h)**4 rate T; from the cases.
  real(dp), parameter :: FIRST_GUESS = 0.0022_dp
  real(dp), parameter :: LONGEST = 1e40_dp ! rad; far beyond what MOST_STEPS can go
  real(dp), parameter :: COARSEST = 0.004_dp ! aim for which steps are so long that they say little
  ! Steps of twice the length err 16 times as much: the gap is 15 times the error that is left.
  real(dp), parameter :: GAIN = 15.0_dp
  real(dp), parameter :: FARTHEST = 0.15_dp  ! gap of the longest steps, relative
  real(dp), parameter :: SHARE = 0.35_dp     ! of the tolerance: two gaps may be small by chance
  ! Start of the longer steps, in errors of averaging; along no axis of growth.
  real(dp), parameter :: ASIDE(3) = [1.0_dp, -0.6_dp, 0.3_dp]
  ! Against the series, in steps of this method for a radian of motion: so many, and so many more
  ! for each binary digit: measured in Cases 5 to 7.
  real(dp), parameter :: SERIES_STEPS = 1.9_dp
  real(dp), parameter :: SERIES_STEPS_A_BIT = 0.28_dp
  real(dp), parameter :: WAVE_RADIAN = 0.4_dp ! of a wave, in radians of motion, to the series
  real(dp), parameter :: VARYING = 1.5_dp    ! cost of a step under a torque of time
  real(dp), parameter :: A_WAVE = 0.9_dp     ! and of each wave in it
  real(dp), parameter :: WEAK = 0.5_dp       ! error of averaging, of the aim

  public :: quick_solve

contains

  subroutine quick_solve(problem_at, omega, tolerance, effort, t_end, contest, result, status, &
                         steps) &
    bind(c, name="quick_solve_level")
    !! Angular velocity at `t_end`.
    type(c_ptr), intent(in), value :: problem_at        !! a problem_t, through C
    real(c_double), intent(in) :: omega(3)              !! at time 0, rad/s
    real(c_double), intent(in) :: tolerance             !! relative
    real(c_double), intent(in) :: effort                !! factor on the steps allowed
    real(c_double), intent(in) :: t_end                 !! s
    integer(c_int), intent(in), value :: contest        !! not 0: REFUSED where a series is faster
    real(c_double), intent(out) :: result(3)            !! rad/s
    integer(c_int), intent(out) :: status               !! any but STOPPED
    integer(c_int), intent(out) :: steps                !! of the last try
    type(problem_t), pointer :: problem
    type(motion_t) :: motion
    logical :: varies
    real(dp) :: start(3)
    real(dp) :: x(3)
    real(dp) :: gaps(3, 2)   ! between steps of one length and of the next
    real(dp) :: top(3)       ! largest unknowns
    real(dp) :: rate         ! 1/s
    real(dp) :: rate_0       ! the same at time 0
    real(dp) :: turn_0       ! the whole way at the first rate, rad
    real(dp) :: turn         ! the same at the last
    real(dp) :: power_5      ! mean of the fifth power of the turn, whose rate grows with the torque
    real(dp) :: n_steps
    real(dp) :: most         ! steps
    real(dp) :: allowed      ! the same, whatever was planned
    real(dp) :: aim          ! error, relative
    real(dp) :: faint        ! what averaging may cost, rad/s
    real(dp) :: left_out     ! what it costs, in the unknowns
    real(dp) :: error        ! relative
    real(dp) :: far          ! what the second gap says of the error
    real(dp) :: radians      ! of the motion and of the waves
    real(dp) :: cost         ! in steps under constant torque
    real(dp) :: bits         ! of the tolerance
    logical :: ended         ! by the user
    integer :: n

    aim = SHARE*tolerance
    status = REFUSED
    steps = 0
    result = omega
    call c_f_pointer(problem_at, problem)
    if (problem%n_sines + problem%n_cosines > MOST_WAVES) return
    call scaled(problem, t_end, motion, status)
    if (status /= COMPLETE) return
    start = omega(motion%axes)/motion%scale
    rate_0 = max(abs(start(1)), abs(start(2)), abs(start(3)))
    rate = rate_0 + abs(t_end)*max(abs(motion%slope(1)), abs(motion%slope(2)), abs(motion%slope(3)))
    rate = rate + 0.5_dp*t_end*t_end*max(abs(motion%climb(1)), abs(motion%climb(2)), &
                                         abs(motion%climb(3)))
    do n = 1, motion%waves
      rate = rate + reach_of(motion, n, t_end)
    end do
    ! In radians, whose powers are numbers whatever the unit of time.
    turn_0 = rate_0*abs(t_end)
    turn = rate*abs(t_end)
    status = GAVE_UP
    if (.not. turn <= LONGEST) return
    power_5 = turn**5
    if (turn > 1.1_dp*turn_0) power_5 = (turn**6 - turn_0**6)/(6.0_dp*(turn - turn_0))
    n_steps = LEAST_STEPS + sqrt(sqrt(FIRST_GUESS*power_5/min(aim, COARSEST)))
    varies = motion%waves > 0 .or. any(abs(motion%climb) > 0.0_dp)
    faint = WEAK*aim*max(abs(omega(1)), abs(omega(2)), abs(omega(3)))
    if (varies) then
      call average(motion, rate, t_end, faint, left_out)
      n_steps = max(n_steps, steps_for_waves(motion, t_end, aim))
    end if
    if (contest /= 0) then
      radians = 0.5_dp*(turn_0 + turn)
      do n = 1, motion%waves
        radians = radians + WAVE_RADIAN*abs(motion%frequency(n)*t_end)
      end do
      cost = n_steps
      if (varies) cost = n_steps*(VARYING + A_WAVE*motion%resolved)
      bits = 1023.0_dp - real(ishft(transfer(aim, 0_int64), -52), dp)
      if (cost > 10.0_dp + radians*(SERIES_STEPS + SERIES_STEPS_A_BIT*bits)) then
        status = REFUSED
        return
      end if
    end if
    allowed = min(COUNTABLE, MOST_STEPS*effort)
    most = min(allowed, MOST_TIMES*n_steps)
    status = GAVE_UP
    do
      if (.not. n_steps <= most) return
      n = int(0.25_dp*(n_steps + 3.0_dp))
      steps = 4*n
      if (varies) then
        call march_varying(motion, start, (GAIN*left_out)*ASIDE, t_end, n, x, gaps, top, &
                           ended)
      else
        call march_constant(motion, start, (0.25_dp*t_end)/n, n, x, gaps, top, ended)
      end if
      if (ended) then
        status = INTERRUPTED
        return
      end if
      ! Not by the error: a maximum passes over what is no number.
      if (.not. sum(abs(gaps)) <= huge(error)) then
        status = merge(GAVE_UP, OVERFLOW, sum(abs(x)) <= huge(error))
        n_steps = 2.0_dp*n_steps
        cycle
      end if
      status = GAVE_UP
      gaps(:, 1) = gaps(:, 1)/GAIN
      if (all(abs(gaps) <= 0.0_dp)) exit
      far = max(1.0_dp/(GAIN*(GAIN + 1.0_dp)), aim/FARTHEST)
      error = max(maxval(abs(gaps(:, 1)*motion%scale)), far*maxval(abs(gaps(:, 2)*motion%scale))) &
              /maxval(abs(top*motion%scale))
      if (error <= aim) exit
      n_steps = 4.0_dp + n_steps*min(8.0_dp, 1.1_dp*sqrt(sqrt(error/aim)))
      if (varies .and. motion%resolved < motion%waves) then
        faint = faint*min(0.1_dp, 0.1_dp*aim/error)
        call average(motion, rate, t_end, faint, left_out)
        n_steps = max(n_steps, steps_for_waves(motion, t_end, aim))
        most = min(allowed, max(most, MOST_TIMES*steps_for_waves(motion, t_end, aim)))
      end if
    end do
    x = x + gaps(:, 1)
    if (varies) x = x + integral(motion, t_end)
    result(motion%axes) = x*motion%scale
    status = COMPLETE
  end subroutine quick_solve

  subroutine march_constant(motion, start, h, fours, x, gaps, top, ended)
    !! Fours of equal steps under constant torque; and beside them, in the time that the processor
    !! waits for them, steps of twice and of four times the length.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: h           !! s
    integer, intent(in) :: fours
    real(dp), intent(out) :: x(3)
    real(dp), intent(out) :: gaps(3, 2) !! from where steps of twice the length lead, and theirs
    real(dp), intent(out) :: top(3)     !! largest size of the unknowns
    logical, intent(out) :: ended       !! by the user
    real(dp) :: x1, x2, x3, a1, a2, a3, b1, b2, b3, c1, c2, c3, d1, d2, d3, p1, p2, p3, m1, m2, m3
    real(dp) :: y(3, 2)                 ! by the longer steps
    real(dp) :: whole, half, third, sixth          ! of a step
    real(dp) :: whole_2, half_2, third_2, sixth_2  ! of the second unknown, with its sign
    real(dp) :: wholes(2, 2), halves(2, 2), thirds(2, 2), sixths(2, 2) ! both, of longer steps
    integer :: i
    integer :: k
    integer :: n

    whole = h
    half = 0.5_dp*h
    third = THIRD_PART*h
    sixth = 0.5_dp*third
    whole_2 = motion%sign_2*whole
    half_2 = motion%sign_2*half
    third_2 = motion%sign_2*third
    sixth_2 = motion%sign_2*sixth
    wholes(1, :) = [2.0_dp*h, 4.0_dp*h]
    wholes(2, :) = motion%sign_2*wholes(1, :)
    halves = 0.5_dp*wholes
    thirds = THIRD_PART*wholes
    sixths = 0.5_dp*thirds
    m1 = motion%slope(1)
    m2 = motion%sign_2*motion%slope(2)
    m3 = motion%slope(3)
    x1 = start(1)
    x2 = start(2)
    x3 = start(3)
    y(:, 1) = start
    y(:, 2) = start
    top = abs(start)
    ended = .false.
    do i = 1, 2*fours
      do k = 1, 1 + mod(i, 2)
        a1 = m1 + y(2, k)*y(3, k)
        a2 = m2 + y(1, k)*y(3, k)
        a3 = m3 + y(1, k)*y(2, k)
        p1 = y(1, k) + halves(1, k)*a1
        p2 = y(2, k) + halves(2, k)*a2
        p3 = y(3, k) + halves(1, k)*a3
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = y(1, k) + halves(1, k)*b1
        p2 = y(2, k) + halves(2, k)*b2
        p3 = y(3, k) + halves(1, k)*b3
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = y(1, k) + wholes(1, k)*c1
        p2 = y(2, k) + wholes(2, k)*c2
        p3 = y(3, k) + wholes(1, k)*c3
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        y(1, k) = ((y(1, k) + sixths(1, k)*a1) + thirds(1, k)*(b1 + c1)) + sixths(1, k)*d1
        y(2, k) = ((y(2, k) + sixths(2, k)*a2) + thirds(2, k)*(b2 + c2)) + sixths(2, k)*d2
        y(3, k) = ((y(3, k) + sixths(1, k)*a3) + thirds(1, k)*(b3 + c3)) + sixths(1, k)*d3
      end do
      do n = 1, 2
        a1 = m1 + x2*x3
        a2 = m2 + x1*x3
        a3 = m3 + x1*x2
        p1 = x1 + half*a1
        p2 = x2 + half_2*a2
        p3 = x3 + half*a3
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = x1 + half*b1
        p2 = x2 + half_2*b2
        p3 = x3 + half*b3
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = x1 + whole*c1
        p2 = x2 + whole_2*c2
        p3 = x3 + whole*c3
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        x1 = ((x1 + sixth*a1) + third*(b1 + c1)) + sixth*d1
        x2 = ((x2 + sixth_2*a2) + third_2*(b2 + c2)) + sixth_2*d2
        x3 = ((x3 + sixth*a3) + third*(b3 + c3)) + sixth*d3
      end do
      top(1) = max(top(1), abs(x1))
      top(2) = max(top(2), abs(x2))
      top(3) = max(top(3), abs(x3))
      if (iand(i, BETWEEN_LOOKS) == 0) then
        ended = interrupt_raised() /= 0
        if (ended) exit
      end if
    end do
    x = [x1, x2, x3]
    gaps(:, 1) = x - y(:, 1)
    gaps(:, 2) = y(:, 1) - y(:, 2)
  end subroutine march_constant

  subroutine march_varying(motion, start, aside, t_end, fours, x, gaps, top, ended)
    !! The same under a torque of time: its integral is exact, and what remains is smooth.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: aside(3)     !! the longer steps start so much off
    real(dp), intent(in) :: t_end        !! s
    integer, intent(in) :: fours
    real(dp), intent(out) :: x(3)        !! without the integral of the torque
    real(dp), intent(out) :: gaps(3, 2)
    real(dp), intent(out) :: top(3)      !! with the integral
    logical, intent(out) :: ended        !! by the user
    real(dp) :: x1, x2, x3, a1, a2, a3, b1, b2, b3, c1, c2, c3, d1, d2, d3, p1, p2, p3, m1, m2, m3
    real(dp) :: y(3, 2)                  ! by the longer steps
    real(dp) :: whole, half, third, sixth          ! of a step
    real(dp) :: whole_2, half_2, third_2, sixth_2  ! of the second unknown, with its sign
    real(dp) :: wholes(2, 2), halves(2, 2), thirds(2, 2), sixths(2, 2) ! both, of longer steps
    real(dp) :: s(3, 0:8)    ! integral of the torque at halves of the steps
    real(dp) :: sines(MOST_WAVES)        ! where the waves are
    real(dp) :: versines(MOST_WAVES)
    real(dp) :: turn_sines(MOST_WAVES)   ! of half a step
    real(dp) :: turn_versines(MOST_WAVES)
    real(dp) :: h
    logical :: afresh
    integer :: begin
    integer :: middle
    integer :: end_
    integer :: i
    integer :: k
    integer :: n

    h = (0.25_dp*t_end)/fours
    whole = h
    half = 0.5_dp*h
    third = THIRD_PART*h
    sixth = 0.5_dp*third
    whole_2 = motion%sign_2*whole
    half_2 = motion%sign_2*half
    third_2 = motion%sign_2*third
    sixth_2 = motion%sign_2*sixth
    wholes(1, :) = [2.0_dp*h, 4.0_dp*h]
    wholes(2, :) = motion%sign_2*wholes(1, :)
    halves = 0.5_dp*wholes
    thirds = THIRD_PART*wholes
    sixths = 0.5_dp*thirds
    do n = 1, motion%resolved
      turn_sines(n) = sin(0.5_dp*h*motion%frequency(n))
      turn_versines(n) = versine(0.5_dp*h*motion%frequency(n))
      sines(n) = 0.0_dp
      versines(n) = 0.0_dp
    end do
    m1 = motion%push(1)
    m2 = motion%sign_2*motion%push(2)
    m3 = motion%push(3)
    x = start
    if (motion%resolved < motion%waves) x = x - turned(motion, x + motion%mean, 0.0_dp)
    x1 = x(1)
    x2 = x(2)
    x3 = x(3)
    y(:, 1) = x + aside
    y(:, 2) = x - GAIN*aside
    top = abs(start)
    s(:, 8) = motion%mean
    ended = .false.
    do i = 1, 2*fours
      if (mod(i, 2) == 1) then
        afresh = mod(i, 2*EXACT_AGAIN) == 1
        s(:, 0) = s(:, 8)
        do n = 1, 8
          call turn(motion, (2*(i - 1) + 0.5_dp*n)*h, afresh, turn_sines, turn_versines, sines, &
                    versines, s(:, n))
        end do
      end if
      do k = 1, 1 + mod(i, 2)
        begin = merge(0, 4, mod(i, 2) == 1)
        middle = begin + 2*k
        end_ = begin + 4*k
        p1 = y(1, k) + s(1, begin)
        p2 = y(2, k) + s(2, begin)
        p3 = y(3, k) + s(3, begin)
        a1 = m1 + p2*p3
        a2 = m2 + p1*p3
        a3 = m3 + p1*p2
        p1 = (y(1, k) + halves(1, k)*a1) + s(1, middle)
        p2 = (y(2, k) + halves(2, k)*a2) + s(2, middle)
        p3 = (y(3, k) + halves(1, k)*a3) + s(3, middle)
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = (y(1, k) + halves(1, k)*b1) + s(1, middle)
        p2 = (y(2, k) + halves(2, k)*b2) + s(2, middle)
        p3 = (y(3, k) + halves(1, k)*b3) + s(3, middle)
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = (y(1, k) + wholes(1, k)*c1) + s(1, end_)
        p2 = (y(2, k) + wholes(2, k)*c2) + s(2, end_)
        p3 = (y(3, k) + wholes(1, k)*c3) + s(3, end_)
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        y(1, k) = ((y(1, k) + sixths(1, k)*a1) + thirds(1, k)*(b1 + c1)) + sixths(1, k)*d1
        y(2, k) = ((y(2, k) + sixths(2, k)*a2) + thirds(2, k)*(b2 + c2)) + sixths(2, k)*d2
        y(3, k) = ((y(3, k) + sixths(1, k)*a3) + thirds(1, k)*(b3 + c3)) + sixths(1, k)*d3
      end do
      do n = 0, 2, 2
        begin = merge(0, 4, mod(i, 2) == 1) + n
        middle = begin + 1
        end_ = begin + 2
        p1 = x1 + s(1, begin)
        p2 = x2 + s(2, begin)
        p3 = x3 + s(3, begin)
        a1 = m1 + p2*p3
        a2 = m2 + p1*p3
        a3 = m3 + p1*p2
        p1 = (x1 + half*a1) + s(1, middle)
        p2 = (x2 + half_2*a2) + s(2, middle)
        p3 = (x3 + half*a3) + s(3, middle)
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = (x1 + half*b1) + s(1, middle)
        p2 = (x2 + half_2*b2) + s(2, middle)
        p3 = (x3 + half*b3) + s(3, middle)
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = (x1 + whole*c1) + s(1, end_)
        p2 = (x2 + whole_2*c2) + s(2, end_)
        p3 = (x3 + whole*c3) + s(3, end_)
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        x1 = ((x1 + sixth*a1) + third*(b1 + c1)) + sixth*d1
        x2 = ((x2 + sixth_2*a2) + third_2*(b2 + c2)) + sixth_2*d2
        x3 = ((x3 + sixth*a3) + third*(b3 + c3)) + sixth*d3
      end do
      top(1) = max(top(1), abs(x1 + s(1, end_)))
      top(2) = max(top(2), abs(x2 + s(2, end_)))
      top(3) = max(top(3), abs(x3 + s(3, end_)))
      if (iand(i, BETWEEN_LOOKS) == 0) then
        ended = interrupt_raised() /= 0
        if (ended) exit
      end if
    end do
    x = [x1, x2, x3]
    gaps(:, 1) = x - y(:, 1)
    gaps(:, 2) = y(:, 1) - y(:, 2)
    if (motion%resolved < motion%waves) x = x + turned(motion, x + s(:, 8), t_end)
  end subroutine march_varying

  pure subroutine turn(motion, t, afresh, turn_sines, turn_versines, sines, versines, s)
    !! Waves half a step on, and the integral of the torque there.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t                          !! s
    logical, intent(in) :: afresh                      !! from t, not from half a step before
    real(dp), intent(in) :: turn_sines(MOST_WAVES)     !! of half a step
    real(dp), intent(in) :: turn_versines(MOST_WAVES)
    real(dp), intent(inout) :: sines(MOST_WAVES)
    real(dp), intent(inout) :: versines(MOST_WAVES)
    real(dp), intent(out) :: s(3)
    real(dp) :: turn_cosine
    real(dp) :: held
    integer :: n

    s = motion%mean + t*(motion%slope + (0.5_dp*t)*motion%climb)
    do n = 1, motion%resolved
      if (afresh) then
        sines(n) = sin(motion%frequency(n)*t)
        versines(n) = versine(motion%frequency(n)*t)
      else
        turn_cosine = 1.0_dp - turn_versines(n)
        held = sines(n)*turn_cosine + (turn_sines(n) - versines(n)*turn_sines(n))
        versines(n) = versines(n)*turn_cosine + (sines(n)*turn_sines(n) + turn_versines(n))
        sines(n) = held
      end if
      s = s + (motion%on_sine(:, n)*sines(n) + motion%on_versine(:, n)*versines(n))
    end do
  end subroutine turn

end module scaled_runge_kutta

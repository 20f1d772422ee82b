module scaled_runge_kutta
  !! Classical Runge-Kutta (eq. 31) for few digits. The unknowns are scaled so that a slope is one
  !! fused multiply-add. The waves of the torque are integrated exactly. Equal steps of three
  !! lengths are taken at once.
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t, request_t, solution_t
  use scaled_march, only: GAIN, march_constant, march_varying, marched_t
  use scaled_motion, only: amplification, average, FAST, integral, MOST_WAVES, motion_t, &
                           reach_of, scaled, steps_for_wave, steps_for_waves
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, REFUSED, SENSITIVE
  use torque_noise, only: torque_noise_of
  implicit none(type, external)
  private

  real(dp), parameter :: LEAST_STEPS = 2.0_dp
  real(dp), parameter :: MOST_STEPS = 2e6_dp
  real(dp), parameter :: COUNTABLE = 2e9_dp  ! steps: more cannot be counted
  ! If more than this multiple of the planned steps is needed, the motion amplifies rounding errors
  ! too much.
  real(dp), parameter :: MOST_TIMES = 12.0_dp
  ! The error after time T is about FIRST_GUESS (rate h)**4 rate T. The factor comes from the cases.
  real(dp), parameter :: FIRST_GUESS = 0.0022_dp
  real(dp), parameter :: LONGEST = 1e40_dp ! rad; far more than MOST_STEPS can cover
  ! For coarser targets, steps would be too long to judge.
  real(dp), parameter :: COARSEST = 3.5e-4_dp
  real(dp), parameter :: FARTHEST = 0.15_dp  ! largest gap of the longest steps, relative
  real(dp), parameter :: SHARE = 0.35_dp     ! target over tolerance: gaps may be small by chance
  ! Offset of the start of the longer steps, in errors of averaging; along no axis of amplification.
  real(dp), parameter :: ASIDE(3) = [1.0_dp, -0.6_dp, 0.3_dp]
  ! Cost of the series, in steps of this method per radian of the motion: a constant part, and a
  ! part for each binary digit. Measured in Cases 5 to 7 and in random scenes.
  real(dp), parameter :: SERIES_STEPS = 1.9_dp
  real(dp), parameter :: SERIES_STEPS_A_BIT = 0.25_dp
  real(dp), parameter :: WAVE_RADIAN = 0.4_dp ! cost of a wave's radian to the series, in radians
  real(dp), parameter :: SERIES_START = 10.0_dp ! cost of the series before its first radian
  real(dp), parameter :: VARYING = 1.7_dp    ! cost of a step under varying torque
  real(dp), parameter :: A_WAVE = 0.6_dp     ! cost of each wave in such a step
  real(dp), parameter :: WAVE_START = 12.0_dp ! cost of each wave before the first step
  ! Square of the least frequency of a wave over the rate of the motion for which this method may be
  ! faster, times the root of the target error. Steps are proportional to its fourth root.
  real(dp), parameter :: PACE = 5.0_dp
  real(dp), parameter :: WORTH = 0.6_dp      ! largest cost to choose this method, over the series'
  real(dp), parameter :: WEAK = 0.5_dp       ! error of averaging over the target

  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  ! Rounding errors of a wave, which is advanced from half step to half step some hundred times
  ! until it is recomputed.
  real(dp), parameter :: OF_WAVES = 32.0_dp
  ! Largest amplified rounding error, in tolerances, for which the series would report complete too.
  ! The series reports sensitive from 0.3 on, and the bound of the amplification comes from steps of
  ! few digits.
  real(dp), parameter :: CERTAIN = 0.1_dp
  ! The integral of the second unknown is expected to be at least this part of its initial value
  ! times the time.
  real(dp), parameter :: KEPT = 0.6_dp
  real(dp), parameter :: BITS_KEPT = 51.0_dp ! limit of the bits of target and amplification,
  ! from 2**-53 and CERTAIN
  real(dp), parameter :: LOG_2 = 0.6931_dp

  public :: quick_solve

contains

  subroutine quick_solve(problem_at, request_at, contest, solution_at) &
    bind(c, name="quick_solve_level")
    !! Compute the angular velocity at the first of the times. The results are row, status, steps of
    !! the last attempt, and error. The status is any but STOPPED. It is SENSITIVE if rounding may
    !! count, which only the series can measure; the error then excludes amplified rounding.
    ! Addresses of a problem_t, a request_t and a solution_t, passed through C.
    type(c_ptr), intent(in), value :: problem_at, request_at, solution_at
    !! not 0: REFUSED if the series is faster, or will be needed anyway
    integer(c_int), intent(in), value :: contest
    type(problem_t), pointer :: problem
    type(request_t), pointer :: request
    type(solution_t), pointer :: solution

    call c_f_pointer(problem_at, problem)
    call c_f_pointer(request_at, request)
    call c_f_pointer(solution_at, solution)
    call solve(problem, request, contest /= 0, solution)
  end subroutine quick_solve

  subroutine solve(problem, request, is_contest, solution)
    !! Compute the angular velocity at the first of the times.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request
    logical, intent(in) :: is_contest
    type(solution_t), intent(inout) :: solution
    type(motion_t) :: motion
    logical :: varies
    real(dp) :: omega(3), start(3), x(3)
    real(dp) :: t_end        ! s
    type(marched_t) :: found
    real(dp) :: rate         ! bound of the unknowns, 1/s
    real(dp) :: rate_0       ! its value at time 0
    real(dp) :: turn_0       ! rate_0 times the whole time, rad
    real(dp) :: turn         ! rate times the whole time, rad
    real(dp) :: power_5      ! mean of x**5 for x from turn_0 to turn
    real(dp) :: n_steps
    real(dp) :: most         ! number of steps allowed
    real(dp) :: allowed      ! the same without regard to the plan
    real(dp) :: aim          ! target error, relative
    real(dp) :: faint        ! allowed error of averaging, rad/s
    real(dp) :: left_out     ! error of averaging, in the unknowns
    real(dp) :: far          ! weight of the second gap in the error
    real(dp) :: bits         ! bits of the target error
    real(dp) :: exponent     ! integral of the logarithmic norm over time
    real(dp) :: bound        ! of the norm of the state-transition matrix
    real(dp) :: noise        ! bound of amplified rounding, relative
    real(dp) :: blurred      ! rounding error of torques that cancel, relative
    integer :: n

    aim = SHARE*request%tolerance
    if (is_contest) aim = min(aim, COARSEST)
    omega = request%omega
    t_end = request%times(1)
    solution%status = REFUSED
    solution%steps = 0
    solution%error = 0.0_dp
    solution%rows(:, 1) = omega
    if (problem%n_sines + problem%n_cosines > MOST_WAVES) return
    bits = 1023.0_dp - real(ishft(transfer(aim, 0_int64), -52), dp)
    if (is_contest) then
      if (is_slower(problem, omega, abs(t_end), aim, bits)) return
    end if
    call scaled(problem, t_end, motion, solution%status)
    if (solution%status /= COMPLETE) return
    start = omega(motion%axes)/motion%scale
    rate_0 = max(abs(start(1)), abs(start(2)), abs(start(3)))
    rate = rate_0 + abs(t_end)*max(abs(motion%slope(1)), abs(motion%slope(2)), abs(motion%slope(3)))
    rate = rate + 0.5_dp*t_end*t_end*max(abs(motion%climb(1)), abs(motion%climb(2)), &
                                         abs(motion%climb(3)))
    do n = 1, motion%waves
      rate = rate + reach_of(motion, n, t_end)
    end do
    ! In radians, whose powers are in range in any unit of time.
    turn_0 = rate_0*abs(t_end)
    turn = rate*abs(t_end)
    solution%status = GAVE_UP
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
    if (is_contest) then
      if (KEPT*abs(start(2)*t_end) > LOG_2*(BITS_KEPT - bits)) then
        solution%status = REFUSED
        return
      end if
    end if
    allowed = min(COUNTABLE, MOST_STEPS*request%effort)
    most = min(allowed, MOST_TIMES*n_steps)
    solution%status = GAVE_UP
    do
      if (.not. n_steps <= most) return
      n = int(0.25_dp*(n_steps + 3.0_dp))
      solution%steps = 4*n
      if (varies) then
        call march_varying(motion, start, (GAIN*left_out)*ASIDE, t_end, n, found)
      else
        call march_constant(motion, start, (0.25_dp*t_end)/n, n, found)
      end if
      if (found%ended) then
        solution%status = INTERRUPTED
        return
      end if
      ! The gaps are tested, not the error: a maximum may lose a NaN.
      if (.not. sum(abs(found%gaps)) <= huge(solution%error)) then
        solution%status = merge(GAVE_UP, OVERFLOW, sum(abs(found%x)) <= huge(solution%error))
        n_steps = 2.0_dp*n_steps
        cycle
      end if
      solution%status = GAVE_UP
      found%gaps(:, 1) = found%gaps(:, 1)/GAIN
      solution%error = 0.0_dp
      if (all(abs(found%gaps) <= 0.0_dp)) exit
      far = max(1.0_dp/(GAIN*(GAIN + 1.0_dp)), aim/FARTHEST)
      solution%error = max(maxval(abs(found%gaps(:, 1)*motion%scale)), &
                           far*maxval(abs(found%gaps(:, 2)*motion%scale))) &
                       /maxval(abs(found%top*motion%scale))
      if (solution%error <= aim) exit
      n_steps = 4.0_dp + n_steps*min(8.0_dp, 1.1_dp*sqrt(sqrt(solution%error/aim)))
      if (varies .and. motion%resolved < motion%waves) then
        faint = faint*min(0.1_dp, 0.1_dp*aim/solution%error)
        call average(motion, rate, t_end, faint, left_out)
        n_steps = max(n_steps, steps_for_waves(motion, t_end, aim))
        most = min(allowed, max(most, MOST_TIMES*steps_for_waves(motion, t_end, aim)))
      end if
    end do
    x = found%x + found%gaps(:, 1)
    if (varies) x = x + integral(motion, t_end)
    solution%rows(motion%axes, 1) = x*motion%scale
    blurred = 0.0_dp
    if (problem%n_sines + problem%n_cosines > 0) then
      blurred = OF_WAVES*ROUNDING*torque_noise_of(problem, t_end, real(solution%steps, dp), &
                                                  maxval(abs(found%top*motion%scale)))
    end if
    ! Each step rounds omega. If perturbations grow at the same rate from step to step, the steps in
    ! the last 1/(1 + exponent) of the time contribute nearly all of the amplified rounding.
    call amplification(motion, t_end, found%spread, found%top, exponent, bound)
    noise = ROUNDING*(1.0_dp + 0.5_dp*real(solution%steps, dp)/(1.0_dp + exponent))*bound
    if (.not. abs(t_end) > 0.0_dp) then
      ! There is no error, not even by the change of units.
      solution%rows(:, 1) = omega
      noise = 0.0_dp
    end if
    solution%error = solution%error + blurred
    solution%status = merge(COMPLETE, SENSITIVE, noise + blurred*bound <= CERTAIN*request%tolerance)
    if (solution%status == COMPLETE) solution%error = solution%error + noise
  end subroutine solve

  pure real(dp) function cost_of_series(radians, bits)
    !! Return the forecast cost of the series in steps of this method under constant torque.
    real(dp), intent(in) :: radians    !! of the motion and of the waves
    real(dp), intent(in) :: bits       !! bits of the target error

    cost_of_series = SERIES_START + radians*(SERIES_STEPS + SERIES_STEPS_A_BIT*bits)
  end function cost_of_series

  logical function is_slower(problem, omega, time, aim, bits)
    !! Return whether this method loses the contest, as it does if no wave is fast. Very slow waves
    !! cost more here than in `solve`. No scaled unknowns are needed, because making them would take
    !! longer than the contest.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: omega(3)   !! rad/s
    real(dp), intent(in) :: time       !! s, from 0
    real(dp), intent(in) :: aim        !! target error, relative
    real(dp), intent(in) :: bits       !! bits of the target error
    real(dp) :: c(3), root(3) ! squares of the rates per omega, and the rates
    real(dp) :: fastest      ! frequency, rad/s
    real(dp) :: rate         ! largest rate of the torque in the unknowns, rad/s3
    real(dp) :: turn_0, turn ! as in solve, rad
    real(dp) :: both         ! squares of these two, summed
    real(dp) :: frequencies(MOST_WAVES) ! which differ, rad/s
    real(dp) :: sizes(MOST_WAVES) ! of the integrals of their waves in the unknowns, rad
    real(dp) :: radians      ! of the motion and of the waves
    real(dp) :: resolved     ! number of the waves that are too slow to be averaged
    real(dp) :: steps        ! number of steps that resolve them
    real(dp) :: cost         ! allowed cost, then the number of steps that it allows
    real(dp) :: f            ! angle of a wave, rad
    integer :: n, waves

    c = abs(problem%coefficients)
    c = [c(2)*c(3), c(1)*c(3), c(1)*c(2)]
    ! Most calls end here, after a few nanoseconds.
    fastest = 0.0_dp
    do n = 1, problem%n_sines
      fastest = max(fastest, abs(problem%sines(4, n)))
    end do
    do n = 1, problem%n_cosines
      fastest = max(fastest, abs(problem%cosines(4, n)))
    end do
    is_slower = fastest*fastest*sqrt(aim) <= PACE*max(c(1)*omega(1)**2, c(2)*omega(2)**2, &
                                                      c(3)*omega(3)**2)
    if (is_slower) return
    root = sqrt(c)
    rate = max(root(1)*abs(problem%rate(1)), root(2)*abs(problem%rate(2)), &
               root(3)*abs(problem%rate(3)))
    turn_0 = time*max(root(1)*abs(omega(1)), root(2)*abs(omega(2)), root(3)*abs(omega(3)))
    turn = turn_0 + time*time*(max(root(1)*abs(problem%constant(1)), &
                                   root(2)*abs(problem%constant(2)), &
                                   root(3)*abs(problem%constant(3))) + 0.5_dp*time*rate)
    waves = 0
    do n = 1, problem%n_sines
      call add(problem%sines(:, n), 2.0_dp)
    end do
    do n = 1, problem%n_cosines
      call add(problem%cosines(:, n), 1.0_dp)
    end do
    radians = 0.5_dp*(turn_0 + turn)
    resolved = 0.0_dp
    steps = 0.0_dp
    do n = 1, waves
      f = frequencies(n)*time
      radians = radians + WAVE_RADIAN*f
      if (f > FAST*turn) then
        ! The error of averaging, nearly as `average` bounds it.
        if (2.0_dp*(sizes(n)/f)*(2.0_dp*turn*(turn/f + sizes(n)) + sizes(n)) &
            <= WEAK*aim*turn_0) cycle
      end if
      resolved = resolved + 1.0_dp
      steps = max(steps, steps_for_wave(f, sizes(n), aim))
    end do
    cost = (WORTH*cost_of_series(radians, bits) - WAVE_START*waves)/(VARYING + A_WAVE*resolved)
    is_slower = steps > cost
    if (is_slower) return
    cost = max(0.0_dp, cost - LEAST_STEPS)
    ! The fourth powers of the planned steps and of the allowed cost; see FIRST_GUESS. The mean of
    ! x**5 from turn_0 to turn is (turn**6 - turn_0**6)/(6 (turn - turn_0)).
    both = turn_0*turn_0 + turn*turn
    is_slower = FIRST_GUESS*(turn_0 + turn)*(both - turn_0*turn)*(both + turn_0*turn) &
                > 6.0_dp*min(aim, COARSEST)*(cost*cost)**2

  contains

    subroutine add(wave, most)
      !! Add a wave to the waves of its frequency, and its reach to the turn.
      real(dp), intent(in) :: wave(4)
      real(dp), intent(in) :: most !! largest integral of its sine or cosine over an angle
      real(dp) :: largest, size_of_wave
      integer :: k

      largest = max(root(1)*abs(wave(1)), root(2)*abs(wave(2)), root(3)*abs(wave(3)))
      size_of_wave = time*time*largest/max(1.0_dp, abs(wave(4)*time))
      turn = turn + min(most*size_of_wave, time*time*largest)
      do k = 1, waves
        if (abs(frequencies(k) - abs(wave(4))) <= 0.0_dp) exit
      end do
      if (k > waves) then
        waves = k
        frequencies(k) = abs(wave(4))
        sizes(k) = 0.0_dp
      end if
      sizes(k) = sizes(k) + size_of_wave
    end subroutine add

  end function is_slower

end module scaled_runge_kutta

module space_torque
  !! Torque about the axes of space: a joint Taylor series of omega and the attitude q,
  !! omega' = (A w2 w3, ...) + (R(q)**T N(t))/I, q' = q (0, omega)/2. There are two integrations,
  !! the second with a smaller local tolerance. Their difference is the error of the first, and the
  !! rows of the second are the result. The omega of the first is perturbed by a rounding in each
  !! step, so that the difference contains the amplification of rounding errors as well.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: problem_t, request_t, solution_t
  use space_torque_plan, only: LEAST_LOCAL_TOLERANCE, order_for, plan
  use space_torque_series, only: evaluate, expand, fitting, LONGER, series_t, torque_terms
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, SENSITIVE
  use step_limit, only: check_steps, limit_of, step_limit_t
  use torque_noise, only: torque_noise_of, wave_rounding_of
  use two_words, only: two_sum
  implicit none(type, external)
  private

  integer, parameter :: MOST_TRIES = 60
  real(dp), parameter :: FINER = 1e-2_dp        ! next local tolerance over this one
  real(dp), parameter :: SAFETY = 0.1_dp        ! the same where it must be still smaller
  ! In tolerances. Two integrations with errors above the tolerance may agree to this by chance,
  ! which one in some thousand does; three do not.
  real(dp), parameter :: TRUSTED = 0.1_dp
  real(dp), parameter :: MARGIN = 1.5_dp        ! on a difference that is the error itself
  real(dp), parameter :: ONE_SAMPLE = 4.0_dp    ! another sample may be larger by this factor
  ! The perturbation of every other integration, over the largest omega, about each axis in turn.
  real(dp), parameter :: PERTURBATION(3) = 2.0_dp**(-52)*[1.0_dp, -0.8_dp, 0.6_dp]
  real(dp), parameter :: SHORTER = 0.5_dp
  real(dp), parameter :: MOST_STEPS = 8e6_dp    ! work limit without waves; some ten seconds
  real(dp), parameter :: A_WAVE = 0.2_dp        ! cost of a wave, in steps
  real(dp), parameter :: BETWEEN_LOOKS = 5e4_dp ! steps between polls for an interrupt
  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**17
  real(dp), parameter :: MARCHES = 2.3_dp       ! steps of all integrations over those of the first
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter :: NO_DIGIT = 1e100_dp    ! a relative error that leaves no digit

  ! One integration of a request.
  type :: attempt_t
    logical :: is_perturbed
    real(dp) :: local_tolerance ! largest last terms, relative to the scale
    integer :: order
    real(dp) :: guess           ! of the first step, s
    real(dp) :: most_steps
    integer(int64) :: stride    ! steps between polls for an interrupt
  end type attempt_t

  ! The outcome of an integration, beside its rows and status.
  type :: outcome_t
    integer(int64) :: steps
    real(dp) :: scale  ! largest |omega|, rad/s
    real(dp) :: ahead  ! estimated steps to the end, if the work limit is exceeded
  end type outcome_t

  public :: space_torque_solve

contains

  subroutine space_torque_solve(problem, ratios, request, solution)
    !! Compute the solution at the times, which have one sign and are ordered away from 0. The
    !! status is COMPLETE, OVERFLOW, GAVE_UP, INTERRUPTED or SENSITIVE, the amplification unknown.
    type(problem_t), intent(in) :: problem  !! torque over the largest moment, about axes of space
    real(dp), intent(in) :: ratios(3)       !! largest moment over each moment
    type(request_t), intent(in) :: request  !! tolerance of omega, relative, and of the angle, rad
    type(solution_t), intent(inout) :: solution
    real(dp), allocatable :: before(:, :), before_q(:, :)
    type(outcome_t) :: last, now ! the integration before, and this one
    type(attempt_t) :: attempt
    real(dp) :: local_tolerance_before, next
    real(dp) :: t_end         ! last of the times, s
    real(dp) :: cost, most, spent
    real(dp) :: error
    real(dp) :: blurred       ! rounding error of torques that cancel, relative
    integer :: count          ! number of integrations
    integer :: n_times, failed
    integer :: status_before, n_rows_before ! of the integration before

    solution%n_rows = 0
    solution%steps = 0
    solution%needed = 0.0_dp
    solution%error = 0.0_dp
    solution%growth = -1.0_dp
    solution%spent = 0.0_dp
    solution%status = COMPLETE
    solution%attitudes(:, 0) = solution%attitudes(:, 0)/norm2(solution%attitudes(:, 0))
    n_times = size(request%times)
    t_end = request%times(n_times)
    if (t_end == 0.0_dp) then
      solution%rows(:, 1) = request%omega
      solution%attitudes(:, 1) = solution%attitudes(:, 0)
      solution%n_rows = 1
      return
    end if
    solution%status = GAVE_UP
    allocate (before(3, n_times), stat=failed)
    if (failed == 0) allocate (before_q(4, n_times), stat=failed)
    if (failed /= 0) return
    call plan(problem, ratios, request%omega, request%tolerance, t_end, attempt%local_tolerance, &
              attempt%guess)
    cost = 1.0_dp + A_WAVE*real(problem%n_sines + problem%n_cosines, dp)
    most = request%effort*(MOST_STEPS/cost)
    attempt%stride = 1 + int(BETWEEN_LOOKS/cost, int64)
    spent = 0.0_dp
    error = NO_DIGIT
    count = 0
    do
      attempt%is_perturbed = mod(count, 2) == 0
      ! Integrations with the same local tolerance have different orders.
      attempt%order = order_for(attempt%local_tolerance) + 2*mod(count, 2)
      attempt%most_steps = most - spent
      call march(problem, ratios, request, attempt, solution, now)
      count = count + 1
      spent = spent + real(now%steps, dp)
      if (solution%status == GAVE_UP .or. solution%status == INTERRUPTED) exit
      if (count > 1) then
        error = NO_DIGIT
        if (n_rows_before == solution%n_rows) then
          associate (n => solution%n_rows)
            error = difference(solution%rows(:, :n), before(:, :n), now%scale, &
                               solution%attitudes(:, 1:n), before_q(:, :n))
          end associate
        end if
        if (error <= merge(1.0_dp, TRUSTED, count > 2)*request%tolerance &
            .and. status_before == solution%status) exit
        if (local_tolerance_before <= LEAST_LOCAL_TOLERANCE) exit
      end if
      next = FINER*attempt%local_tolerance
      if (count > 1) next = min(next, SAFETY*local_tolerance_before*(request%tolerance/error))
      last = now
      status_before = solution%status
      n_rows_before = solution%n_rows
      before(:, :) = solution%rows
      before_q(:, :) = solution%attitudes(:, 1:)
      local_tolerance_before = attempt%local_tolerance
      attempt%local_tolerance = max(LEAST_LOCAL_TOLERANCE, next)
    end do
    if (attempt%is_perturbed .and. count > 1 .and. solution%status /= GAVE_UP &
        .and. solution%status /= INTERRUPTED) then
      ! The result is the other integration. Its error is the difference, not a hundredth of it.
      error = MARGIN*error
      now = last
      solution%status = status_before
      solution%n_rows = n_rows_before
      solution%rows(:, :) = before
      solution%attitudes(:, 1:) = before_q
    end if
    solution%steps = now%steps
    blurred = 0.0_dp
    if (problem%n_sines + problem%n_cosines > 0) then
      ! Any axis of the body may become parallel to the torque.
      blurred = ROUNDING*torque_noise_of(problem, t_end, real(solution%steps, dp), &
                                         now%scale/maxval(ratios))
      ! A constant error of the torque changes omega in proportion to the time, and the attitude by
      ! the integral of that.
      blurred = blurred*max(1.0_dp, 0.5_dp*now%scale*abs(t_end))
    end if
    solution%error = error + (ROUNDING + blurred)
    solution%error = solution%error + ROUNDING*wave_rounding_of(problem, t_end, &
                                                                real(solution%steps, dp), &
                                                                now%scale/maxval(ratios))
    solution%spent = spent
    if (solution%status == COMPLETE .and. .not. error + blurred <= request%tolerance) then
      solution%status = SENSITIVE
      ! Amplified rounding errors have been sampled only once.
      solution%error = ONE_SAMPLE*solution%error
    end if
    if (solution%status == GAVE_UP) then
      if (count == 1) now%ahead = MARCHES*now%ahead
      solution%needed = (spent - real(now%steps, dp) + now%ahead)*cost/MOST_STEPS
      solution%steps = int(spent, int64)
    end if
  end subroutine space_torque_solve

  subroutine march(problem, ratios, request, attempt, solution, found)
    !! Integrate once from 0 to the last of the times: rows, attitudes, their number and the status.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: ratios(3)
    type(request_t), intent(in) :: request
    type(attempt_t), intent(in) :: attempt
    type(solution_t), intent(inout) :: solution
    type(outcome_t), intent(out) :: found
    type(series_t) :: s
    real(dp) :: y(7), y_low(7)  ! omega and q, and their rounding errors
    real(dp) :: change(7)       ! of y in a step
    real(dp) :: t(2)            ! time and its rounding error, s
    real(dp) :: t_end           ! last of the times, s
    real(dp) :: h, rest, factor, power
    logical :: at_end
    integer :: k, order, tries
    type(step_limit_t) :: limit

    order = attempt%order
    t_end = request%times(size(request%times))
    y = [request%omega, solution%attitudes(:, 0)]
    y_low = 0.0_dp
    if (attempt%is_perturbed) y_low(:3) = maxval(abs(request%omega))*PERTURBATION
    t = 0.0_dp
    rest = t_end
    solution%status = COMPLETE
    solution%n_rows = 0
    found = outcome_t(0_int64, maxval(abs(request%omega)), 0.0_dp)
    limit = limit_of(attempt%most_steps, attempt%stride)
    tries = 0
    h = attempt%guess
    do
      s%w(:, 0) = y(:3)
      s%q(:, 0) = y(4:)
      call torque_terms(problem, t(1), t(2), h, order, s)
      call expand(problem, ratios, h, order, s)
      ! The scale of a body at rest is the omega that it is about to reach.
      if (found%steps == 0) found%scale = maxval(abs(s%w(:, :4)))
      factor = fitting(s, order, attempt%local_tolerance, found%scale)
      if (.not. factor > 0.0_dp) then
        ! The terms are not finite.
        tries = tries + 1
        if (tries > MOST_TRIES) then
          solution%status = OVERFLOW
          return
        end if
        h = 0.0625_dp*h
        cycle
      end if
      at_end = factor*abs(h) >= abs(rest)
      if (found%steps == 0 .and. (factor < SHORTER .or. (factor >= LONGER .and. .not. at_end)) &
          .and. tries < MOST_TRIES) then
        ! The first step is a guess, and so is the omega that a body at rest is about to reach.
        tries = tries + 1
        h = factor*h
        cycle
      end if
      if (at_end) factor = rest/h
      h = factor*h
      power = 1.0_dp
      do k = 1, order
        power = power*factor
        s%w(:, k) = power*s%w(:, k)
        s%q(:, k) = power*s%q(:, k)
      end do
      call add_rows(s, order, t, h, at_end, y_low, request, solution)
      if (solution%status /= COMPLETE) return
      change = evaluate(s, order, 1.0_dp)
      found%steps = found%steps + 1
      if (attempt%is_perturbed) then
        k = 1 + int(mod(found%steps, 3_int64))
        change(k) = change(k) + (1 - 2*mod(found%steps, 2_int64))*(found%scale*PERTURBATION(k))
      end if
      call add_change(change, y, y_low)
      if (.not. maxval(abs(y)) <= huge(h)) then
        solution%status = OVERFLOW
        return
      end if
      found%scale = max(found%scale, maxval(abs(y(:3))))
      if (at_end) then
        solution%n_rows = size(request%times)
        solution%rows(:, solution%n_rows) = y(:3)
        solution%attitudes(:, solution%n_rows) = y(4:)/norm2(y(4:))
        return
      end if
      call two_sum((t(1)), h + t(2), t(1), t(2))
      rest = (t_end - t(1)) - t(2)
      call check_steps(found%steps, t(1), rest, .false., limit, found%ahead, solution%status)
      if (solution%status /= COMPLETE) return
    end do
  end subroutine march

  subroutine add_rows(s, order, t, h, at_end, y_low, request, solution)
    !! Compute the rows within the step, except the last row of all.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: t(2), h         !! time and its rounding error, step, s
    logical, intent(in) :: at_end
    real(dp), intent(in) :: y_low(7)
    type(request_t), intent(in) :: request
    type(solution_t), intent(inout) :: solution
    real(dp) :: change(7), q(4)
    integer :: n, last

    last = size(request%times)
    if (at_end) last = last - 1
    do n = solution%n_rows + 1, last
      if (abs(request%times(n) - t(1)) > abs(h)) return
      change = y_low + evaluate(s, order, ((request%times(n) - t(1)) - t(2))/h)
      solution%rows(:, n) = s%w(:, 0) + change(:3)
      if (.not. maxval(abs(solution%rows(:, n))) <= huge(h)) then
        solution%status = OVERFLOW
        return
      end if
      q = s%q(:, 0) + change(4:)
      solution%attitudes(:, n) = q/norm2(q)
      solution%n_rows = n
      if (mod(n, ROWS_BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) then
          solution%status = INTERRUPTED
          return
        end if
      end if
    end do
  end subroutine add_rows

  pure subroutine add_change(change, y, y_low)
    !! Advance y to the end of the step, with its rounding error.
    real(dp), intent(in) :: change(7)
    real(dp), intent(inout) :: y(7), y_low(7)
    integer :: i

    do i = 1, 7
      call two_sum((y(i)), change(i) + y_low(i), y(i), y_low(i))
    end do
  end subroutine add_change

  pure real(dp) function difference(rows, others, scale, attitudes, other_attitudes)
    !! Return the largest difference of two solutions: of omega over its largest, or of the angle,
    !! rad.
    real(dp), intent(in) :: rows(:, :), others(:, :)           !! rad/s
    real(dp), intent(in) :: scale                              !! rad/s
    real(dp), intent(in) :: attitudes(:, :), other_attitudes(:, :)
    real(dp) :: p(4), q(4)
    integer :: n

    difference = 0.0_dp
    do n = 1, size(rows, 2)
      difference = max(difference, maxval(abs(rows(:, n) - others(:, n)))/max(scale, tiny(scale)))
      p = attitudes(:, n)
      q = other_attitudes(:, n)
      difference = max(difference, 2.0_dp*norm2([p(1)*q(2) - q(1)*p(2) - p(3)*q(4) + p(4)*q(3), &
                                                 p(1)*q(3) - q(1)*p(3) - p(4)*q(2) + p(2)*q(4), &
                                                 p(1)*q(4) - q(1)*p(4) - p(2)*q(3) + p(3)*q(2)]))
    end do
  end function difference

end module space_torque

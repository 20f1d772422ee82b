module taylor_march
  !! One integration by Taylor series, from 0 to the last time: the order is fixed, the step is
  !! adapted, the error is estimated and subtracted.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: problem_t, request_t, solution_t
  use series, only: LEAST_LOCAL_TOLERANCE, SLACK
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW
  use taylor_attitude, only: begin_attitude, expand_both, turn_error, turn_on
  use taylor_error, only: begin, count_step, estimate_truncation, &
                          estimate_truncation_from_rest, growths_of, likely_remainder
  use step_nodes, only: nodes_of
  use taylor_plan, only: order_of_variations, plan
  use taylor_rows, only: add_last_row, add_nodes, add_rows, outcome_t, room_t, state_t
  use taylor_series, only: expand, fitting, predict_step, propagate_precisely, &
                           propagate_variations, rescale, size_of
  use torque_terms, only: longest_turn, steps_by_turns, torque_terms_at, turn_waves, wave_t
  use two_words, only: two_sum
  implicit none(type, external)
  private

  ! With this many waves every attempt at a step that fails polls for an interrupt.
  integer, parameter :: MANY_WAVES = 1000
  integer, parameter :: MOST_TRIES = 60
  ! If the first step forecasts more than this multiple of the steps allowed, the integration ends.
  real(dp), parameter :: HOPELESS = 10.0_dp
  ! If the steps increase with a larger power of time, this is not by chance.
  real(dp), parameter :: GROWING = 1.3_dp
  ! Radians about the body in a step. Perturbations rotate even where omega is steady.
  real(dp), parameter :: A_STEP = 60.0_dp
  real(dp), parameter, public :: A_PRECISE_STEP = 2.0_dp
  ! If the local tolerance is below FINE, truncation errors of one sign would add up over many steps
  ! to more than rounding errors do. Shorter steps have none.
  real(dp), parameter :: A_FINE_STEP = 1.25_dp
  real(dp), parameter :: FINE = 1e-17_dp
  ! Steps of a few lengths that recur would round the same factors with the same errors, and these
  ! errors would add up over many steps. Each step of a precise integration, such as any long one,
  ! is therefore shorter by a fraction of SPREAD that varies.
  real(dp), parameter :: SPREAD = 2.0_dp**(-12)
  real(dp), parameter :: GOLDEN = 0.6180339887498949_dp ! its multiples are spread evenly, modulo 1
  real(dp), parameter :: LARGEST = 2.0_dp**511 ! largest omega whose products are in range, rad/s
  ! Part of the largest error so far: a smaller estimate may be small by chance.
  real(dp), parameter :: BY_CHANCE = 0.1_dp
  integer, parameter :: FEW_STEPS = 2
  real(dp), parameter :: NO_DIGIT = 1e100_dp ! a relative error that leaves no digit
  ! A status that no caller sees: the motion is so long that a precise integration is needed.
  integer, parameter, public :: TOO_LONG = -1

  ! One integration of a request.
  type, public :: attempt_t
    real(dp) :: tolerance      ! of this integration
    logical :: precise         ! propagate variations with high accuracy
    real(dp) :: turn_limit     ! rotation of perturbations after which it ends unless precise, rad
    real(dp) :: most_steps     ! number of steps allowed
    integer(int64) :: stride   ! steps between polls for an interrupt
  end type attempt_t

  public :: coupling_of, march

contains

  subroutine march(problem, request, attempt, room, waves, solution, found)
    !! Integrate once from 0 to the last of the times: rows, their number and the status.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request
    type(attempt_t), intent(in) :: attempt
    type(room_t), intent(inout) :: room
    type(wave_t), intent(inout), contiguous :: waves(:)
    type(solution_t), intent(inout) :: solution
    type(outcome_t), intent(out) :: found
    real(dp) :: coefficients(4), steady(4, 2) ! of the problem, then 0
    real(dp) :: t_end         ! last of the times, s
    real(dp) :: left(4)       ! truncation error of the step, rad/s
    real(dp) :: error(3)      ! propagated so far, rad/s
    real(dp) :: h             ! step, s
    real(dp) :: rest          ! time to go, s
    real(dp) :: next          ! next step, s
    real(dp) :: local_tolerance  ! largest last terms over the scale
    real(dp) :: allowed       ! the same in rad/s
    real(dp) :: last          ! size of the last two terms, rad/s
    real(dp) :: longest       ! largest angle for the weights of a wave, rad
    real(dp) :: coupling
    ! coupling: largest rate of perturbations over omega
    real(dp) :: farthest      ! in a step, rad: the terms of a spin do not limit it
    logical :: at_end, with_attitude
    logical :: from_rest      ! the first step of a body at rest
    integer(int64) :: decay   ! logarithm of the ratio of last terms over two orders
    integer(int64) :: part    ! 65536 over the order
    integer :: order
    integer :: order_varied   ! of precise variations
    integer :: lasting        ! steps for which waves are advanced, not recomputed
    integer :: n_before       ! rows before this step
    real(dp) :: varied        ! multiple of GOLDEN modulo 1
    integer :: i, tries
    integer(int64) :: next_look  ! step of the next poll
    integer(int64) :: half_way   ! half of the steps allowed
    real(dp) :: t_half           ! the time after half_way steps, s

    found = outcome_t(0_int64, 0.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, .true., 1.0_dp)
    solution%status = COMPLETE
    solution%n_rows = 0
    solution%n_steps = 0
    with_attitude = associated(solution%attitudes)
    t_end = request%times(size(request%times))
    rest = t_end
    if (rest == 0.0_dp) then
      solution%rows(:, 1) = request%omega
      if (with_attitude) solution%attitudes(:, 1) = solution%attitudes(:, 0)
      solution%n_rows = 1
      return
    end if
    associate (s => room%s, blocks => room%blocks, now => room%now, attitude => room%attitude)
      now = state_t([request%omega, 0.0_dp], 0.0_dp, 0.0_dp, 0.0_dp, &
                    max(abs(request%omega(1)), abs(request%omega(2)), abs(request%omega(3))), &
                    0.0_dp, 0.0_dp, 0)
      call plan(problem, now%scale, attempt%tolerance, rest, with_attitude, order, &
                local_tolerance, h)
      if (associated(solution%nodes)) room%nodes = nodes_of(solution%nodes(2:), order)
      found%finest = local_tolerance <= LEAST_LOCAL_TOLERANCE
      part = 65536/order
      coupling = coupling_of(problem%coefficients)
      farthest = A_STEP
      if (attempt%precise) then
        farthest = merge(A_FINE_STEP, A_PRECISE_STEP, local_tolerance < FINE)
        order_varied = order_of_variations(order, attempt%tolerance, local_tolerance)
      end if
      lasting = steps_by_turns(local_tolerance)
      if (size(waves) > 0) longest = longest_turn(order, local_tolerance)
      s%torque = 0.0_dp
      coefficients = [problem%coefficients, 0.0_dp]
      steady(:, 1) = [problem%constant, 0.0_dp]
      steady(:, 2) = [problem%rate, 0.0_dp]
      call begin(attempt%precise, s%lanes, blocks)
      s%weight = 0.0_dp
      if (with_attitude) call begin_attitude(solution%attitudes(:, 0), attitude)
      next_look = 1
      half_way = max(1_int64, int(0.5_dp*attempt%most_steps, int64))
      t_half = 0.0_dp
      decay = 0
      varied = 0.0_dp
      tries = 0
      do
        now%scale = max(now%scale, abs(now%w(1)), abs(now%w(2)), abs(now%w(3)))
        call shorten_to(farthest, coupling*now%scale, h)
        if (attempt%precise) then
          varied = varied + GOLDEN
          if (varied >= 1.0_dp) varied = varied - 1.0_dp
          h = h - (SPREAD*varied)*h
        end if
        call fit_to_end(h, rest, at_end)
        allowed = local_tolerance*now%scale
        ! Four at once: numbers stored one by one could not be loaded together without a wait.
        do i = 1, 4
          s%terms(i, 0) = now%w(i)
          s%factors(i) = h*coefficients(i)
        end do
        call torque_terms_at(steady, [now%t, now%t_low], h, order, longest, now%since == 0, waves, &
                             s%torque)
        if (with_attitude) then
          do i = 1, 4
            s%turns(i, 0) = attitude%q(i)
            s%half(i) = 0.5_dp*h
          end do
          s%weight = now%scale
          call expand_both(order, s)
        else
          call expand(order, s)
        end if
        if (found%steps == 0) then
          call predict_step(h, s, order, part, allowed, decay, next)
          ! The scale of a body at rest is the omega that it is about to reach.
          now%scale = max(now%scale, min(huge(h), maxval(abs(s%terms(:3, 1:4)))))
          allowed = local_tolerance*now%scale
          if (with_attitude) s%weight = now%scale
        end if
        last = size_of(s, order)
        ! From rest, a torque that grows with time makes only every third term.
        if (found%steps == 0) last = last + size_of(s, order - 2)
        call predict_step(h, s, order, part, allowed, decay, next)
        if ((.not. last <= SLACK*allowed) .or. (found%steps == 0 .and. tries == 0)) then
          ! The first step is a guess, and a later one may be too long: the terms are only rescaled.
          tries = tries + 1
          if (.not. last <= huge(h)) then
            if (tries > MOST_TRIES) then
              solution%status = OVERFLOW
              exit
            end if
            h = h*0.0625_dp
            if (size(waves) > MANY_WAVES) then
              if (interrupt_raised() /= 0) then
                solution%status = INTERRUPTED
                exit
              end if
            end if
            cycle
          end if
          next = fitting(h, last, order, allowed)
          call shorten_to(farthest, coupling*now%scale, next)
          if (abs(next) > abs(rest)) next = rest
          at_end = abs(next) >= abs(rest)
          if (.not. at_end .and. abs(rest) < 4.0_dp*abs(next)) next = rest/ceiling(rest/next)
          call rescale(s, order, next/h, with_attitude)
          now%since = lasting
          h = next
        end if
        error = s%lanes(1, :)
        if (attempt%precise) then
          call propagate_precisely(order_varied, s)
        else
          call propagate_variations(s)
        end if
        call estimate_truncation(s, order, 1.0_dp/max(allowed, tiny(h)), left, found%unseen)
        if (found%steps < FEW_STEPS) then
          from_rest = found%steps == 0 .and. .not. maxval(abs(request%omega)) > 0.0_dp
          if (from_rest) then
            call estimate_truncation_from_rest(s, order, 1.0_dp/max(allowed, tiny(h)), left)
          end if
          found%least = max(found%least, likely_remainder(order, s%terms)/max(now%scale, tiny(h)))
        end if
        if (with_attitude) then
          found%least = max(found%least, 2.0_dp*likely_remainder(order, s%turns))
          call turn_error(s, order, from_rest, error, s%lanes(1, :) + left(:3), &
                          attitude)
        end if
        n_before = solution%n_rows
        call add_rows(room, order, h, at_end, error, left(:3), request, solution)
        if (solution%status /= COMPLETE) exit
        if (associated(solution%nodes)) then
          call add_nodes(room, order, h, error, left(:3), request%tolerance, solution)
        end if
        call count_step(attempt%precise, solution%n_rows > n_before, s%lanes, blocks)
        if (blocks%steps == 0) then
          ! Not at every step, to save time.
          now%peak = max(now%peak, maxval(abs(error)))
          if (with_attitude) attitude%peak = max(attitude%peak, sum(abs(attitude%error)))
        end if
        call add_change(s%change, now)
        if (with_attitude) call turn_on(s, attitude)
        found%steps = found%steps + 1
        ! Where products overflow, a step may be accepted that has no meaning.
        if (.not. now%scale > LARGEST) tries = 1
        if (.not. all(abs(now%w) <= huge(h))) then
          solution%status = OVERFLOW
          exit
        end if
        if (at_end) then
          call add_last_row(room, order, request, solution)
          exit
        end if
        now%since = merge(0, now%since + 1, now%since + 1 >= lasting)
        if (now%since > 0) call turn_waves(waves)
        call two_sum((now%t), h + now%t_low, now%t, now%t_low)
        rest = (t_end - now%t) - now%t_low
        h = next
        if (.not. attempt%precise .and. coupling*now%scale*abs(now%t) > attempt%turn_limit) then
          ! The rotation so far, extrapolated in proportion to the square of the time.
          found%ahead = (coupling*now%scale*abs(t_end))*abs(t_end/now%t)/A_FINE_STEP
          solution%status = TOO_LONG
          exit
        end if
        if (found%steps >= next_look) then
          if (real(found%steps, dp) >= attempt%most_steps) then
            ! Extrapolate the steps so far in proportion to the time, or faster if the motion
            ! becomes faster.
            found%ahead = 1.0_dp
            if (found%steps > half_way .and. abs(now%t) > abs(t_half)) then
              found%ahead = log(real(found%steps, dp)/real(half_way, dp))/log(now%t/t_half)
            end if
            found%ahead = merge(min(3.0_dp, found%ahead), 1.0_dp, found%ahead > GROWING)
            found%ahead = real(found%steps, dp)*exp(found%ahead*log(1.0_dp + abs(rest/now%t)))
            solution%status = GAVE_UP
          else if (found%steps == 1 .and. abs(rest) > (HOPELESS*attempt%most_steps)*abs(h)) then
            found%ahead = abs(rest)/max(abs(h), tiny(h))
            solution%status = GAVE_UP
          else if (found%steps > 1) then
            if (interrupt_raised() /= 0) solution%status = INTERRUPTED
          end if
          if (solution%status /= COMPLETE) exit
          next_look = min(found%steps + attempt%stride, &
                          max(found%steps + 1, int(attempt%most_steps, int64)))
          if (found%steps == half_way) t_half = now%t
          if (found%steps < half_way) next_look = min(next_look, half_way)
        end if
      end do
      call growths_of(attempt%precise, s%lanes, blocks, found%growth, found%largest)
      found%turned = coupling*now%scale*abs(t_end)
      found%scale = now%scale
      found%error = now%worst
      if (.not. maxval(abs(s%lanes(1, :))) <= found%error) found%error = maxval(abs(s%lanes(1, :)))
      if (now%scale > 0.0_dp) then
        found%error = found%error/now%scale
        found%unseen = sqrt(found%unseen)/now%scale
        found%least = max(found%least, BY_CHANCE*(now%peak/now%scale))
      end if
      if (with_attitude) then
        found%least = max(found%least, (2.0_dp*BY_CHANCE)*attitude%peak)
        found%way = 1.0_dp + 0.5_dp*now%scale*abs(t_end)
        if (.not. attitude%worst <= found%error) found%error = attitude%worst
      end if
      if (.not. found%error <= NO_DIGIT) found%error = NO_DIGIT
    end associate
  end subroutine march

  pure real(dp) function coupling_of(coefficients)
    !! Return the largest rate of perturbations over the largest omega.
    real(dp), intent(in) :: coefficients(3)
    real(dp) :: sizes(3)

    sizes = sqrt(abs(coefficients))
    coupling_of = max(sizes(1)*sizes(2), sizes(2)*sizes(3), sizes(3)*sizes(1))
  end function coupling_of

  pure subroutine shorten_to(farthest, rate, h)
    real(dp), intent(in) :: farthest !! rad
    real(dp), intent(in) :: rate     !! rad/s
    real(dp), intent(inout) :: h     !! s

    if (rate*abs(h) > farthest) h = sign(farthest/rate, h)
  end subroutine shorten_to

  pure subroutine fit_to_end(h, rest, at_end)
    !! Make the steps near the end equal: a short last step would cost as much as the others.
    real(dp), intent(inout) :: h   !! s
    real(dp), intent(in) :: rest   !! s
    logical, intent(out) :: at_end

    at_end = abs(h) >= abs(rest)
    if (at_end) then
      h = rest
    else if (abs(rest) < 4.0_dp*abs(h)) then
      h = rest/ceiling(rest/h)
    end if
  end subroutine fit_to_end

  pure subroutine add_change(change, now)
    !! Compute omega at the end of the step, with its rounding error.
    real(dp), intent(in) :: change(4)
    type(state_t), intent(inout) :: now
    integer :: i

    do i = 1, 4
      call two_sum((now%w(i)), change(i) + now%w_low(i), now%w(i), now%w_low(i))
    end do
  end subroutine add_change

end module taylor_march

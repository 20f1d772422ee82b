module tape_march
  !! One integration of a tape by Taylor series, from 0 to the last time. The order is fixed, the
  !! step is adapted, and the truncation error of the steps is propagated and subtracted.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use statuses, only: COMPLETE, OVERFLOW, SLIDING, STALLED
  use step_limit, only: check_steps, limit_of, step_limit_t
  use tape, only: next_break, tape_t
  use tape_crossings, only: CROSSES, IS_CHANGED, next_crossing, resolve_switches, SLIDES, STAYS
  use tape_error, only: add_noise, begin_block, begin_error, cross_error, error_t, &
                        estimate_truncation, fitting_lanes, keep_lanes, matrix_of, perturb, &
                        set_lanes, take_change, take_error
  use tape_growth, only: begin, close_block, count_step, find_growth, transitions_t
  use tape_live, only: keep_live, settle
  use tape_plan, only: converge, fitting, LEAST_LOCAL_TOLERANCE, local_tolerance_of, &
                       MOST_TRIES, order_for
  use tape_runge_kutta, only: guess_sizes, has_singular_points, is_near_singular, long_step_t, &
                              LONGER_THAN_SERIES, longest_without_terms, put_terms, &
                              step_over, stop_unknowns
  use tape_rows, only: add_nodes, add_row, add_rows, evaluate
  use tape_series, only: derivatives_at, expand, noise_of, PADDED, series_t, slot_gradient, &
                         sum_terms
  use tape_state, only: begin_state, bound_guess, keep_guesses, keep_sizes, LEAST_OWN, &
                        LEAST_SCALE, reach, set_first_terms, state_t, weigh
  use tape_steady, only: find_varying, near_zero, resolving
  use tape_switches, only: follow, jump_at, operand_error, switches_t
  use two_words, only: two_sum
  implicit none(type, external)
  private

  ! Least factor on the first step that was tried, from rest and otherwise.
  real(dp), parameter :: SHORTER = 0.5_dp, MUCH_SHORTER = 0.05_dp
  real(dp), parameter :: GUESSED = 0.85_dp
  ! Change of a local tolerance that changes the order, and of a step that changes the Jacobian.
  real(dp), parameter :: MUCH_LESS = 0.5_dp
  ! Largest difference of a derivative and that of its series at the end of a step, times the step,
  ! over the local tolerance, and over the rounding errors at the beginning of the step.
  real(dp), parameter :: MOST_DEFECT = 4.0_dp
  real(dp), parameter :: MOST_ROUNDING = 1e3_dp
  ! Largest sum of the terms of a step, relative, unless the tolerance allows more.
  real(dp), parameter :: MOST_CANCELLED = 1e3_dp
  integer, parameter :: CORRECTIONS = 4 ! of the step that ends at a switch
  ! Relative distance from a switch that an error may bridge; at least, of rounding errors.
  real(dp), parameter :: NEAR = 1e-13_dp, MOST_NEAR = 1e-5_dp
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53) ! unit of rounding errors
  integer, parameter :: MOST_GUESSES = 3    ! of the omega that a body at rest reaches, by series
  ! Error of a long step, whose sign is unknown, over the local tolerance, and at least.
  real(dp), parameter :: OF_LONG_STEP = 0.03_dp, MOST_LONG_ROUNDING = 2.0_dp**(-50)
  ! Part of the longest step so far below which a step near a singular point becomes a long one. It
  ! is small, because a long step may miss a pulse. And its least factor after a failure.
  real(dp), parameter :: SHRUNK = 1e-8_dp, LEAST_PART = 1e-4_dp
  real(dp), parameter :: LEAST_EXPECTED_PART = 1.0_dp/16.0_dp ! for most of the time
  ! Largest omega over the first, unless omega becomes infinite.
  real(dp), parameter :: UNBOUNDED = 1e6_dp
  real(dp), parameter :: LEAST_CHANGE = 1e-6_dp ! in a shortest step, of an unknown that stops
  real(dp), parameter :: LARGEST_JUMP = 1e100_dp ! whose square is finite

  ! One integration of a request.
  type, public :: attempt_t
    real(dp) :: tolerance      ! of this integration
    real(dp) :: most_steps
    integer(int64) :: stride   ! steps between polls for an interrupt
  end type attempt_t

  ! The outcome of an integration, beside its rows and status.
  type, public :: outcome_t
    integer(int64) :: steps = 0
    ! Largest of a row or node before it was subtracted; relative, or rad.
    real(dp) :: error = 0.0_dp
    real(dp) :: least = 0.0_dp  ! lower bound, for estimates that are too small
    real(dp) :: unseen = 0.0_dp ! sum of squares of what the estimates of truncation may lack
    real(dp) :: growth = 1.0_dp ! error amplification until any requested time
    real(dp) :: noise = 0.0_dp  ! rounding error of all steps, in units, relative
    real(dp) :: blur = 0.0_dp   ! the same, amplified until any requested time
    real(dp) :: ahead = 0.0_dp  ! estimated steps to the end, if the work limit is exceeded
    logical :: finest = .false. ! whether the local tolerance is the smallest
    integer :: switch = 0            ! that slides, or whose touch has the largest effect
    real(dp) :: switches_at = 0.0_dp ! s
    real(dp) :: touched = 0.0_dp     ! this effect, relative
  end type outcome_t

  public :: march

contains

  subroutine march(tape, request, attitude, attempt, s, switches, solution, found)
    !! Integrate once from 0 to the last of the times: rows, their number and the status.
    type(tape_t), intent(in) :: tape
    type(request_t), intent(in) :: request
    real(dp), intent(in) :: attitude(4)       !! at time 0
    type(attempt_t), intent(in) :: attempt
    type(series_t), intent(inout) :: s        !! working storage
    type(switches_t), intent(inout), target :: switches !! those of the tape
    type(solution_t), intent(inout) :: solution
    type(outcome_t), intent(out) :: found
    type(state_t) :: x
    type(error_t) :: e
    type(transitions_t) :: transitions
    type(tape_t) :: live                      ! with the operations that matter
    real(dp), target :: memory(tape%n_unknowns, 7) ! of the state and the error
    real(dp) :: noise(tape%n_unknowns)        ! of the rates
    real(dp) :: change(PADDED)                ! of the unknowns in the step
    real(dp) :: sizes(tape%n_unknowns)        ! of all unknowns
    real(dp) :: t_next(2)                     ! time and its rounding error, s
    real(dp) :: t_end, rest, factor, shortened, local_tolerance
    real(dp) :: break_time                    ! next breakpoint of a table, or t_end, s
    real(dp) :: to_stop                       ! time to it, s
    logical :: arrives, at_end, from_rest, is_full, has_guess
    logical :: is_bounded                     ! whether the guess of the scale was reduced
    logical :: has_stopped                    ! whether an unknown remains 0 from this step on
    logical :: is_rejected                    ! whether a longer step was rejected
    logical :: has_values                     ! whether terms 0 of all slots are known
    logical :: is_resolved                    ! whether the terms of the Jacobian were checked
    logical :: is_compared                    ! whether terms 0 are those of a touch
    logical :: is_low                         ! whether the order must be raised
    real(dp) :: rates(tape%n_unknowns)        ! at the end of the step
    real(dp) :: whole_step                    ! s: h without switches
    real(dp) :: nearly                        ! relative distance from a switch: a touch
    logical :: has_singular ! whether an operation has a point without a Taylor series
    logical :: is_long                        ! whether the step is not one of the series
    real(dp) :: unseen      ! what the estimate of truncation may lack, relative
    type(long_step_t) :: long_step
    real(dp) :: next_try    ! step of a series from which on a longer step is tried, s
    logical :: was_singular ! whether the last step began where no series converges
    real(dp) :: longest, least_expected       ! step so far, and step for most of the time, s
    real(dp) :: first_scale                   ! of the first step
    integer :: i, n_before, order, tries
    integer :: varying(tape%n_slots), n_varying ! slots of `find_varying`
    integer :: verdict                        ! of `next_crossing`
    type(step_limit_t) :: limit

    t_end = request%times(size(request%times))
    rest = t_end
    solution%status = COMPLETE
    solution%n_rows = 0
    solution%n_steps = 0
    if (switches%n > 0) then
      s%a = 0.0_dp
      switches%is_turned = .false.
      switches%on_level = 0
      switches%crosses = 0
    end if
    call begin_state(tape, request, attitude, solution, memory(:, :4), x)
    call begin_error(x%n, memory(:, 5:), e)
    call begin(x%n, transitions)
    call find_varying(tape, varying, n_varying)
    live = tape
    switches%part = 0.0_dp
    if (switches%n > 0) call settle(tape, x%t, x%y, t_end, switches, s, live, rates)
    verdict = STAYS
    nearly = min(MOST_NEAR, max(NEAR, attempt%tolerance))
    local_tolerance = max(LEAST_LOCAL_TOLERANCE, 0.125_dp*attempt%tolerance)
    ! The first step is a guess: a radian. From rest it is the whole time.
    s%h = sign(min(abs(t_end), 1.0_dp/max(x%scale, LEAST_SCALE)), t_end)
    s%order = order_for(share_of(t_end/s%h), s%powers, of_steps=.false.)
    limit = limit_of(attempt%most_steps, attempt%stride)
    tries = 0
    is_rejected = .false.
    has_values = .false.
    has_guess = .false.
    from_rest = .not. x%scale >= LEAST_SCALE
    has_singular = has_singular_points(tape)
    next_try = huge(next_try)
    was_singular = .false.
    long_step%is_stopped = .false.
    longest = 0.0_dp
    least_expected = 0.0_dp
    first_scale = huge(first_scale)
    integration: do
      call set_first_terms(x, s)
      if (switches%n > 0) then
        call keep_live(tape, switches, s, live)
        call find_varying(live, varying, n_varying)
      end if
      call expand(live, x%t(2), has_values, s)
      has_values = .false.
      break_time = next_break(tape, x%t(1), t_end)
      to_stop = (break_time - x%t(1)) - x%t(2)
      call reach(from_rest, to_stop, s, x)
      call weigh(t_end, to_stop, s, x, (ROUNDING/request%tolerance)*sqrt(e%noise))
      is_long = .false.
      find_step: block
        factor = longest_step()
        if (.not. factor > 0.0_dp) then
          if (has_singular .and. (tries > 0 .or. was_singular)) call step_from_singular()
          if (is_long) exit find_step
          call shorten()
          if (solution%status /= COMPLETE) exit integration
          cycle integration
        end if
        if ((found%steps == 0 .or. from_rest .or. x%diverges) .and. tries < MOST_TRIES) then
          ! The omega that a body at rest is about to reach is a guess too, and so is the size of an
          ! own state, whose series may diverge.
          if (factor < merge(GUESSED, merge(SHORTER, MUCH_SHORTER, from_rest), x%diverges)) then
            call guess_again()
            cycle integration
          end if
          if (.not. has_guess) then
            has_guess = .true.
            local_tolerance = share_of(t_end/(factor*s%h))
            found%finest = local_tolerance <= LEAST_LOCAL_TOLERANCE
            order = order_for(local_tolerance, s%powers, of_steps=.false.)
            is_low = order > s%order
            s%order = order
            if (is_low .or. from_rest) cycle integration
            factor = longest_step()
          end if
        end if
        if (is_rejected) factor = min(1.0_dp, factor)
        factor = to_end(factor)
        call set_lanes(x, e, s)
        call perturb(x, s, found%steps, rest, factor, e)
        ! Perturbations may change faster than the motion, as about a steady rotation.
        if (e%is_short) then
          shortened = fitting_lanes(x, s, e, factor)
          factor = factor*shortened
          if (is_resolved .and. shortened < MUCH_LESS) then
            ! The polynomials of the Jacobian are those of a much longer step.
            call perturb(x, s, found%steps, rest, factor, e)
            if (e%is_short) factor = factor*fitting_lanes(x, s, e, factor)
          end if
        end if
        call converge(live, s%order, smallest_size(), s%a, s%powers, factor)
        if (x%is_reaching .and. factor < GUESSED .and. factor > 0.0_dp &
            .and. tries < MOST_TRIES) then
          ! The guess of the scale is that of a longer step.
          call guess_again()
          cycle integration
        end if
        if (switches%n > 0) call resolve_switches(nearly, switches, s, factor)
        if (.not. factor > 0.0_dp) then
          call shorten()
          if (solution%status /= COMPLETE) exit integration
          cycle integration
        end if
        if (has_singular .and. abs(factor*s%h) <= min(next_try, SHRUNK*longest)) then
          if (is_near_singular(live, s%order, s%a, factor)) call step_beyond_singular()
          if (is_long) exit find_step
        end if
        arrives = abs(factor*s%h) >= abs(to_stop)*(1.0_dp - epsilon(s%h))
        call set_end()
        if (switches%n > 0) then
          whole_step = factor*s%h
          call next_crossing(nearly, switches, s, factor, verdict)
          if (verdict == SLIDES) then
            found%switches_at = x%t(1)
            found%switch = switches%sliding
            solution%status = SLIDING
            exit integration
          end if
          if (verdict == IS_CHANGED) then
            tries = tries + 1
            if (tries <= MOST_TRIES) cycle integration
            solution%status = STALLED
            exit integration
          end if
          if (verdict == CROSSES) call end_at_switch()
        end if
        call noise_of(s, noise)
        if (.not. is_continued_to_switch()) then
          is_rejected = .true.
          tries = tries + 1
          if (tries > MOST_TRIES) then
            solution%status = STALLED
            exit integration
          end if
          ! In a shorter step a guess would be smaller, and rounding errors relatively larger.
          if (x%is_guessed) call keep_guesses(x)
          s%h = 0.5_dp*factor*s%h
          cycle integration
        end if
        was_singular = .false.
        if (from_rest .and. tries < MOST_TRIES) then
          call bound_guess(factor*s%h, verdict == CROSSES, s, x, is_bounded)
          if (is_bounded) then
            tries = tries + 1
            s%h = factor*s%h
            cycle integration
          end if
        end if
      end block find_step
      tries = 0
      is_rejected = .false.
      if (found%steps == 0) first_scale = x%scale
      n_before = solution%n_rows
      call add_rows(x, s, e, factor, request, size(request%times) - merge(1, 0, at_end), solution, &
                    found%error)
      if (solution%status /= COMPLETE) exit integration
      if (associated(solution%nodes)) then
        call add_nodes(x, s, e, factor, t_next(1), request%tolerance, solution, found%error)
      end if
      if (is_long) then
        call add_noise((long_step%error(:x%n)/ROUNDING)**2, e)
      else
        call add_noise((noise*factor*s%h)**2, e)
      end if
      is_compared = .false.
      if (switches%n > 0 .and. .not. is_long) call check_touches()
      do i = 1, x%n
        call two_sum((x%y(i)), change(i) + x%y_low(i), x%y(i), x%y_low(i))
      end do
      if (is_long) then
        call take_change(long_step%derivatives, e)
        if (long_step%slides > 0) then
          found%switches_at = x%t(1)
          found%switch = long_step%slides
          solution%status = SLIDING
          exit integration
        end if
      else
        call take_error(x, s, factor, e)
        found%unseen = found%unseen + unseen**2
        if (switches%n > 0) call cross()
      end if
      found%steps = found%steps + 1
      if (.not. maxval(abs(x%y)) <= huge(s%h)) then
        solution%status = OVERFLOW
        exit integration
      end if
      x%scale = max(x%scale, maxval(abs(x%y(:3))))
      do i = x%first_own, x%n
        x%own_sizes(i) = max(x%own_sizes(i), abs(x%y(i)))
      end do
      if (at_end) then
        call add_row(x, request, x%y_low, e%lanes(1, :x%n, 1), solution, found%error)
        exit integration
      end if
      ! The steps shrink to nothing before a singularity.
      has_stopped = .false.
      if (abs(factor*s%h) <= spacing(x%t(1)) .and. .not. arrives .and. verdict /= CROSSES) then
        if (has_singular) call stop()
        if (.not. has_stopped) then
          solution%status = merge(STALLED, OVERFLOW, x%scale <= UNBOUNDED*first_scale)
          exit integration
        end if
      end if
      call count_step(solution%n_rows > n_before, transitions, is_full)
      if (is_full) then
        call close_block(matrix_of(e), e%noise_of_block, transitions)
        call begin_block(e)
      end if
      x%t = t_next
      has_values = size(tape%table_starts) == 1 .and. verdict == STAYS &
                   .and. .not. (is_compared .or. is_long .or. has_stopped)
      from_rest = .not. x%scale >= LEAST_SCALE
      rest = (t_end - x%t(1)) - x%t(2)
      s%h = factor*s%h
      longest = max(longest, abs(s%h))
      if (verdict == CROSSES) s%h = whole_step
      if (has_stopped) s%h = sign(longest, s%h)
      if (abs(s%h) > abs(rest)) s%h = rest
      if (has_guess) call share_tolerance()
      call check_steps(found%steps, x%t(1), rest, arrives .or. verdict == CROSSES .or. is_long, &
                       limit, found%ahead, solution%status)
      if (solution%status /= COMPLETE) exit integration
    end do integration
    call weigh(t_end, to_stop, s, x)
    where (x%weights > 0.0_dp)
      sizes = 1.0_dp/x%weights
    else where
      sizes = 0.0_dp
    end where
    call find_growth(matrix_of(e), e%noise_of_block, sizes, transitions, found%growth, found%blur)
    found%noise = norm2(x%weights*sqrt(e%noise))
    do i = 1, x%n
      found%error = max(found%error, x%weights(i)*abs(e%lanes(1, i, 1)))
    end do
    ! Relative to a smaller omega, errors are unknown.
    if (x%scale > 0.0_dp .and. x%scale < LEAST_SCALE) found%error = 1.0_dp

  contains

    real(dp) function longest_step()
      !! Return the factor on the step that the terms of the unknowns and of the Jacobian allow.
      logical :: near(tape%n_unknowns)

      longest_step = fitting(tape, s%order, local_tolerance, x%weights, s%a)
      is_resolved = .false.
      if (n_varying == 0 .or. .not. longest_step > 0.0_dp) return
      near = near_zero(x%n, longest_step, local_tolerance, x%weights, s)
      is_resolved = any(near)
      if (is_resolved) then
        longest_step = resolving(varying(:n_varying), near, x%weights, max(1.0_dp, abs(t_end)), &
                                 s, longest_step)
      end if
    end function longest_step

    real(dp) function share_of(steps)
      !! Return the part of the tolerance that a step may use.
      real(dp), intent(in) :: steps !! expected number

      share_of = local_tolerance_of(attempt%tolerance, steps, with_attitude=x%first_own > 4)
    end function share_of

    subroutine share_tolerance()
      !! Divide the tolerance anew, because the steps may become shorter or longer.
      real(dp) :: share

      ! Steps near a singular point are short for a while only.
      share = share_of(real(found%steps, dp) + abs(rest)/max(abs(s%h), least_expected))
      if (share < MUCH_LESS*local_tolerance .or. MUCH_LESS*share > local_tolerance) then
        s%order = order_for(share, s%powers, of_steps=.false.)
      end if
      local_tolerance = share
    end subroutine share_tolerance

    subroutine step_from_singular()
      !! Begin with a longer step than the series allows, where its terms are not finite.
      real(dp) :: first

      first = longest_without_terms(live, s%order, x%t(1), switches, s)
      if (abs(first) > abs(to_stop)) first = to_stop
      call take_long_step(first, 0.0_dp)
      was_singular = is_long
    end subroutine step_from_singular

    subroutine step_beyond_singular()
      !! Take a longer step than the series allows, whose steps become shorter.
      real(dp) :: h

      h = factor*s%h
      call take_long_step(sign(min(abs(to_stop), LONGER_THAN_SERIES*abs(h)), h), abs(h))
      if (is_long) then
        next_try = huge(next_try)
      else
        next_try = abs(h)*max(LEAST_PART, sqrt(min(1.0_dp, &
                                                   long_step%allowed/long_step%largest_error)))
      end if
    end subroutine step_beyond_singular

    subroutine take_long_step(first, least)
      !! Take a step that needs no series, if it is accurate enough.
      real(dp), intent(in) :: first !! s, the longest that is tried
      real(dp), intent(in) :: least !! length of the shortest, s

      least_expected = max(longest, abs(first))*LEAST_EXPECTED_PART
      call guess_unknown_sizes(first)
      if (.not. has_guess) then
        has_guess = .true.
        local_tolerance = share_of(abs(t_end)/least_expected)
        s%order = order_for(local_tolerance, s%powers, of_steps=.false.)
      end if
      long_step%first = first
      long_step%least = least
      long_step%allowed = max(OF_LONG_STEP*local_tolerance, MOST_LONG_ROUNDING)
      long_step%with_derivatives = .true.
      call step_over(tape, x%t, x%y + x%y_low, x%weights, switches, s, live, long_step)
      is_long = long_step%h /= 0.0_dp
      if (.not. is_long) return
      call put_terms(long_step, x%n, s)
      factor = 1.0_dp
      verdict = STAYS
      change(:x%n) = long_step%change(:x%n)
      call set_lanes(x, e, s)
      call keep_lanes(e)
      ! The length was rounded.
      arrives = abs(to_stop - s%h) <= 2.0_dp*spacing(break_time)
      call set_end()
    end subroutine take_long_step

    subroutine guess_unknown_sizes(first)
      !! Guess the sizes of unknowns that begin at 0.
      real(dp), intent(in) :: first !! s
      real(dp) :: reached(x%n)

      if (.not. from_rest .and. all(x%own_sizes(x%first_own:) > 0.0_dp)) return
      call guess_sizes(tape, x%t, x%y, first, switches, s, live, reached)
      call keep_sizes(reached, from_rest, x)
      from_rest = .not. x%scale >= LEAST_SCALE
      call weigh(t_end, to_stop, s, x)
    end subroutine guess_unknown_sizes

    subroutine guess_again()
      !! Try a shorter step, from whose series the sizes of unknowns that begin at 0 are guessed.
      !! From rest under a high power, the guesses would shrink with the steps: they need no series.
      real(dp) :: reached(x%n)

      tries = tries + 1
      s%h = factor*s%h
      if (tries /= MOST_GUESSES .or. .not. (from_rest .or. x%is_guessed)) return
      call guess_sizes(tape, x%t, x%y, to_stop, switches, s, live, reached)
      call keep_sizes(reached, from_rest, x)
      from_rest = .not. x%scale >= LEAST_SCALE
    end subroutine guess_again

    pure real(dp) function smallest_size()
      !! Return the size of the smallest unknown that matters to powers.
      smallest_size = x%scale
      if (x%scale >= LEAST_SCALE) return
      smallest_size = LEAST_SCALE
      if (any(x%weights > 0.0_dp)) smallest_size = max(LEAST_SCALE, 1.0_dp/maxval(x%weights))
    end function smallest_size

    subroutine set_end()
      !! Set the end of the step, and whether it is the last.
      at_end = arrives .and. .not. abs(break_time) < abs(t_end)
      if (arrives) then
        factor = to_stop/s%h
        t_next = [break_time, 0.0_dp]
      else
        call two_sum(x%t(1), factor*s%h + x%t(2), t_next(1), t_next(2))
      end if
    end subroutine set_end

    subroutine shorten()
      !! Try a shorter step, because the terms are not finite.
      tries = tries + 1
      if (tries > MOST_TRIES) solution%status = STALLED
      s%a(1:, :) = 0.0_dp
      s%h = 0.0625_dp*s%h
    end subroutine shorten

    real(dp) function to_end(factor)
      !! Return the factor with which the steps near the end, or before a breakpoint, are equal.
      real(dp), intent(in) :: factor

      to_end = factor
      if (factor*abs(s%h) >= abs(to_stop)) then
        to_end = to_stop/s%h
      else if (abs(to_stop) < 4.0_dp*factor*abs(s%h)) then
        to_end = (to_stop/s%h)/ceiling(to_stop/(factor*s%h))
      end if
    end function to_end

    logical function is_continued()
      !! Return whether the series continue beyond the end of the step: whether the derivatives
      !! there are those of the series. A pulse within the step may be too small to be seen at its
      !! beginning. The change of the unknowns is computed too.
      real(dp) :: derivatives(tape%n_unknowns), slope(PADDED)
      real(dp) :: left(tape%n_unknowns), defect(tape%n_unknowns), size_of_terms(PADDED)
      real(dp) :: rounded, allowed, reached, cancelled
      integer :: i

      call sum_terms(s%arrays, s%order, factor, change, slope, size_of_terms)
      ! Large terms that cancel are rounded, and a shorter step has smaller terms.
      reached = max(x%scale, maxval(abs(x%y(:3) + change(:3))), LEAST_SCALE)
      cancelled = max(maxval(size_of_terms(:3))/reached, &
                      2.0_dp*sum(size_of_terms(4:x%first_own - 1)))
      do i = x%first_own, x%n
        cancelled = max(cancelled, size_of_terms(i) &
                        /max(x%own_sizes(i), abs(x%y(i) + change(i)), LEAST_OWN))
      end do
      if (.not. cancelled <= max(MOST_CANCELLED, attempt%tolerance/epsilon(rounded))) then
        is_continued = .false.
        return
      end if
      rounded = max(1.0_dp, maxval(x%weights*(size_of_terms(:x%n) + noise*abs(factor*s%h))))
      call derivatives_at(live, t_next, x%y + (change(:x%n) + x%y_low), -s%h, s, derivatives)
      rates = derivatives
      allowed = MOST_DEFECT*local_tolerance + MOST_ROUNDING*epsilon(rounded)*rounded
      left = factor*s%h*derivatives - slope(:x%n)
      defect = x%weights*abs(left)
      ! NaN is not allowed.
      is_continued = all(defect <= allowed)
      if (is_continued) found%least = max(found%least, maxval(defect)/(s%order + 1))
      unseen = maxval(x%weights*abs(left/(s%order + 1) - e%left))
    end function is_continued

    subroutine end_at_switch()
      !! Let the step end where a switch changes, or with the breakpoint that is there.
      arrives = abs(factor*s%h) >= abs(to_stop)*(1.0_dp - 4.0_dp*epsilon(factor))
      call set_end()
    end subroutine end_at_switch

    logical function is_continued_to_switch()
      !! Return whether the series continue; correct the end of a step at a switch, because the
      !! series of an operand has one term less than those of the unknowns.
      real(dp) :: correction, before
      integer :: tries

      before = factor
      do tries = 0, CORRECTIONS
        call estimate_truncation(x, s, local_tolerance, factor, e, found%least)
        is_continued_to_switch = is_continued()
        ! The root of a touch can't be corrected.
        if (verdict /= CROSSES) return
        if (arrives .or. any(switches%touches >= 0.0_dp)) return
        if (.not. is_continued_to_switch) return
        correction = -operand_error(switches%first, switches, s)/switches%slope
        if (abs(correction*s%h) <= 2.0_dp*epsilon(factor)*abs(whole_step)) return
        ! The operand itself may be a rounding error, such as a component of omega that is 0.
        if (abs(correction*switches%slope) &
            <= ROUNDING*s%noise(switches%operands(switches%first))) then
          return
        end if
        ! Another switch at the same time, but for rounding.
        if (abs(before*s%h) <= spacing(x%t(1))) return
        if (.not. abs(correction) <= 0.01_dp*before) then
          is_continued_to_switch = .false.
          return
        end if
        factor = factor + correction
        call end_at_switch()
      end do
    end function is_continued_to_switch

    subroutine check_touches()
      !! Where operands nearly cross levels, errors decide whether the rates jump.
      integer :: i, level

      if (.not. any(switches%touches >= 0.0_dp)) return
      is_compared = .true.
      do i = 1, switches%n
        do level = 1, size(switches%touches, 1)
          if (switches%touches(level, i) >= 0.0_dp) call compare_touch(i, level)
        end do
      end do
      call derivatives_at(live, t_next, x%y + (change(:x%n) + x%y_low), -s%h, s, rates)
    end subroutine check_touches

    subroutine compare_touch(i, level)
      !! Add what the rates beyond a level would change.
      integer, intent(in) :: i, level
      real(dp) :: other(tape%n_unknowns), here(tape%n_unknowns), zero(tape%n_unknowns)
      real(dp) :: at(tape%n_unknowns), at_time(2), slots(size(switches%slots))
      integer :: on_level(size(switches%slots))
      logical :: is_changed

      slots = s%a(0, switches%slots)
      call evaluate(x, s, e, factor, switches%touches(level, i), at, zero)
      at = x%y + (at + x%y_low)
      call two_sum(x%t(1), switches%touches(level, i)*s%h + x%t(2), at_time(1), at_time(2))
      call derivatives_at(live, at_time, at, s%h, s, here)
      associate (value => s%a(0, switches%slots(i)))
        value = value + jump_at(level)
      end associate
      on_level = switches%on_level
      is_changed = .true.
      do while (is_changed)
        call keep_live(tape, switches, s, live)
        call derivatives_at(live, at_time, at, s%h, s, other)
        call follow(switches, s, is_changed)
      end do
      switches%on_level = on_level
      s%a(0, switches%slots) = slots
      call keep_live(tape, switches, s, live)
      ! As far as it is known, the operand may be beyond the level during this part of the step.
      other = min(LARGEST_JUMP, abs(other - here)*abs(factor*s%h)*sqrt(nearly))
      call add_noise(merge((other/ROUNDING)**2, 0.0_dp, other >= 0.0_dp), e)
      if (maxval(x%weights*other) > found%touched) then
        found%touched = maxval(x%weights*other)
        found%switch = i
        found%switches_at = at_time(1)
      end if
    end subroutine compare_touch

    subroutine stop()
      !! Let unknowns remain 0 that reach it in a finite time. There their perturbations and errors
      !! end.
      logical :: is_new(x%n)
      integer :: i

      is_new = x%weights > 0.0_dp .and. x%y /= 0.0_dp .and. x%weights*abs(x%y) <= ROUNDING &
               .and. abs(change(:x%n)) > LEAST_CHANGE*abs(x%y)
      call stop_unknowns(tape, t_next, switches, s, live, x%y, is_new)
      has_stopped = any(is_new)
      do i = 1, x%n
        if (.not. is_new(i)) cycle
        long_step%is_stopped(i) = .true.
        x%y_low(i) = 0.0_dp
        e%lanes(:, i, :) = 0.0_dp
        e%noise(i) = 0.0_dp
        e%noise_of_block(i) = 0.0_dp
      end do
    end subroutine stop

    subroutine cross()
      !! Change the switches at the end of the step.
      real(dp) :: gradient(tape%n_unknowns), after(tape%n_unknowns), jump(tape%n_unknowns)
      real(dp) :: slope, blur

      switches%on_level = 0
      if (verdict /= CROSSES) return
      call slot_gradient(s%arrays, switches%operands(switches%first), gradient)
      slope = switches%slope/s%h
      blur = s%noise(switches%operands(switches%first))/slope
      switches%part = whole_step/s%h ! in which the terms of an operand are not all small
      call settle(tape, t_next, x%y + x%y_low, s%h, switches, s, live, after)
      jump = after - rates
      call cross_error(gradient, slope, jump, e)
      call add_noise((jump*blur)**2, e)
    end subroutine cross

  end subroutine march

end module tape_march

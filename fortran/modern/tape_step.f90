module tape_step
  !! One step of any system of ordinary differential equations that is a tape, by Taylor series.
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
  use kinds, only: dp
  use problem, only: step_request_t, step_t
  use statuses, only: COMPLETE, OVERFLOW, SLIDING
  use tape, only: FIRST_UNKNOWN, next_break, tape_t, TIME_SLOT
  use tape_crossings, only: CROSSES, IS_CHANGED, next_crossing, resolve_switches, SLIDES, STAYS
  use tape_live, only: keep_live, settle
  use tape_plan, only: converge, fitting, LONGER, MOST_TRIES, order_for
  use tape_roots, only: size_of
  use tape_runge_kutta, only: has_singular_points, is_near_singular, long_step_t, &
                              LONGER_THAN_SERIES, longest_without_terms, put_terms, step_over
  use tape_series, only: allocate_series, derivatives_at, expand, noise_of, series_t
  use tape_switches, only: change, find_switches, operand_error, switches_t, update
  implicit none(type, external)
  private

  ! Largest of the last terms, in tolerances. The terms that a step leaves out are smaller.
  real(dp), parameter :: LOCAL_TOLERANCE = 0.1_dp
  ! Largest difference of a derivative and that of its series at the end of a step, times the step,
  ! in tolerances, and over the rounding errors.
  real(dp), parameter :: MOST_DEFECT = 1.0_dp
  real(dp), parameter :: MOST_ROUNDING = 1e3_dp
  real(dp), parameter :: SHRUNK = 1e-8_dp ! length near a singular point, over the time
  integer, parameter :: MOST_LONGER = 12 ! expansions of a step that is too short
  ! Change of a switch's operand beyond its level, in rounding errors, and the longest time that it
  ! takes, over the tolerance and the step that was tried.
  real(dp), parameter :: BEYOND = 8.0_dp, LONGEST_BEYOND = 0.01_dp
  ! Tolerance whose reciprocal is a number.
  real(dp), parameter :: LEAST_TOLERANCE = 2.0_dp**(-1000)

  public :: step_tape, take_step

contains

  subroutine step_tape(tape_at, request_at, step_at) bind(c, name="step_tape_level")
    !! Compute the terms of a step, as long as the tolerances allow, or until a switch changes, a
    !! break of a table, or the end. The status is COMPLETE, OVERFLOW if no step is short enough, or
    !! SLIDING.
    ! Addresses of a tape_t, a step_request_t and a step_t, passed through C.
    type(c_ptr), intent(in), value :: tape_at, request_at, step_at
    type(tape_t), pointer :: tape
    type(step_request_t), pointer :: request
    type(step_t), pointer :: step
    real(dp), allocatable, target :: memory(:)
    type(series_t) :: s
    logical :: fits

    call c_f_pointer(tape_at, tape)
    call c_f_pointer(request_at, request)
    call c_f_pointer(step_at, step)
    step%status = OVERFLOW
    step%expansions = 0
    call allocate_series(tape, 0, 0, memory, s, fits)
    if (fits) call take_step(tape, request, s, step)
  end subroutine step_tape

  subroutine take_step(tape, request, s, step)
    !! Compute the terms of a step as `step_tape` does, in the working storage of the caller.
    type(tape_t), intent(in) :: tape
    type(step_request_t), intent(in) :: request
    type(series_t), intent(inout) :: s
    type(step_t), intent(inout) :: step
    real(dp), allocatable :: tolerances(:)
    real(dp) :: factor, longest
    type(switches_t), target :: switches
    type(tape_t) :: live ! with the operations that matter
    integer :: failed, i, verdict
    logical :: is_rejected ! whether a longer step was rejected
    logical :: is_settled, is_moved ! results of the switches
    logical :: is_allowed  ! whether a step may be longer than that of a series
    type(long_step_t) :: long_step

    step%status = OVERFLOW
    step%expansions = 0
    allocate (tolerances(tape%n_unknowns), stat=failed)
    if (failed /= 0) return
    tolerances = max(LEAST_TOLERANCE, request%tolerances)
    s%order = order_for(LOCAL_TOLERANCE*request%relative, s%powers, of_steps=.true.)
    step%order = s%order
    step%stop = next_break(tape, request%t, request%t_end)
    longest = step%stop - request%t
    s%h = sign(min(request%trial, abs(longest)), longest)
    is_allowed = request%may_be_long .and. has_singular_points(tape)
    is_rejected = .false.
    is_settled = .false.
    verdict = STAYS
    call find_switches(tape, switches, failed)
    if (failed /= 0) return
    s%a = 0.0_dp
    live = tape
    if (switches%n > 0) then
      switches%part = 0.0_dp
      call settle(tape, [request%t, 0.0_dp], request%state, s%h, switches, s, live, step%state)
    end if
    do while (step%expansions < MOST_TRIES)
      ! The steps shrink to nothing before a singularity. The first trial may be short by chance.
      if (step%expansions > 0 .and. abs(s%h) <= spacing(request%t) &
          .and. abs(s%h) < abs(longest)) return
      ! Term 0 of a switch is its result.
      s%a(1:, :) = 0.0_dp
      s%a(0, TIME_SLOT) = request%t
      s%a(1, TIME_SLOT) = s%h
      s%a(0, FIRST_UNKNOWN:FIRST_UNKNOWN + tape%n_unknowns - 1) = request%state
      if (switches%n > 0) call keep_live(tape, switches, s, live)
      call expand(live, 0.0_dp, .false., s)
      step%expansions = step%expansions + 1
      factor = fitting(tape, s%order, LOCAL_TOLERANCE, 1.0_dp/tolerances, s%a)
      if (.not. factor > 0.0_dp) then
        ! The terms are not finite.
        if (is_allowed) then
          call take_long_step(longest_without_terms(live, s%order, request%t, switches, s), 0.0_dp)
          if (step%status /= OVERFLOW) return
        end if
        s%h = 0.0625_dp*s%h
        cycle
      end if
      if (is_rejected) factor = min(1.0_dp, factor)
      factor = min(factor, longest/s%h)
      call converge(live, s%order, minval(tolerances), s%a, s%powers, factor)
      if (is_allowed .and. factor > 0.0_dp .and. abs(factor*s%h) <= SHRUNK*abs(request%t)) then
        if (is_near_singular(live, s%order, s%a, factor)) then
          call take_long_step(LONGER_THAN_SERIES*factor*s%h, abs(factor*s%h))
          if (step%status /= OVERFLOW) return
        end if
      end if
      if (switches%n > 0) then
        if (.not. (is_rejected .or. factor < LONGER) .and. step%expansions < MOST_LONGER) then
          ! The last step may have ended at a switch. In so short a step a state that is on a level,
          ! but for rounding, would be far from it.
          s%h = factor*s%h
          cycle
        end if
        if (.not. is_settled) then
          ! At the beginning, where the last step ended at a switch, but for rounding.
          switches%part = factor
          call update(switches, s, is_moved)
          if (is_moved) cycle
          is_settled = .true.
        end if
        call resolve_switches(LOCAL_TOLERANCE*max(1e-12_dp, request%relative), switches, s, factor)
        if (.not. factor > 0.0_dp) then
          s%h = 0.0625_dp*s%h
          cycle
        end if
        call next_crossing(0.0_dp, switches, s, factor, verdict)
        if (verdict == SLIDES) then
          step%status = SLIDING
          return
        end if
        if (verdict == IS_CHANGED) cycle
      end if
      call end_after(factor*s%h)
      if (.not. abs(step%h) > 0.0_dp .and. verdict /= CROSSES) return
      if (verdict == CROSSES .and. (.not. abs(step%h) > 0.0_dp .or. is_at_once())) then
        ! A switch at the beginning of the step, but for rounding.
        do i = 1, switches%n
          if (switches%crosses(i) /= 0) call change(i, switches%crosses(i), switches, s)
        end do
        cycle
      end if
      step%is_switched = verdict == CROSSES
      if (step%is_switched .and. request%is_beyond) call end_after(step_beyond())
      call set_terms()
      if (is_continued()) then
        call complete_step()
        return
      end if
      s%h = 0.5_dp*step%h
      is_rejected = .true.
    end do

  contains

    subroutine complete_step()
      step%status = COMPLETE
      if (request%is_beyond .and. step%t == step%stop .and. step%stop /= request%t_end) then
        call end_beyond()
      end if
    end subroutine complete_step

    subroutine take_long_step(first, least)
      !! Take a step that needs no series, if it is accurate enough.
      real(dp), intent(in) :: first !! s, the longest that is tried
      real(dp), intent(in) :: least !! length of the shortest, s

      long_step%first = sign(min(abs(first), abs(longest)), longest)
      long_step%least = least
      long_step%allowed = LOCAL_TOLERANCE
      long_step%with_derivatives = .false.
      call step_over(tape, [request%t, 0.0_dp], request%state, 1.0_dp/tolerances, switches, s, &
                     live, long_step)
      if (.not. abs(long_step%h) > 0.0_dp) return
      step%status = SLIDING
      if (long_step%slides > 0) return
      call put_terms(long_step, tape%n_unknowns, s)
      step%is_switched = .false.
      call end_after(s%h)
      call set_terms()
      call complete_step()
    end subroutine take_long_step

    subroutine end_after(h)
      !! Set the length of the step and the time at its end, which is rounded; the state belongs to
      !! that time.
      real(dp), intent(in) :: h !! s

      step%t = request%t + h
      ! The factor on the step was rounded.
      if (abs(h) >= (1.0_dp - 4.0_dp*epsilon(h))*abs(longest)) step%t = step%stop
      step%h = step%t - request%t
    end subroutine end_after

    subroutine end_beyond()
      !! Let a step that ends at a break end beyond it.
      real(dp) :: beyond(2)

      beyond = [step%stop + sign(2.0_dp*spacing(step%stop), longest), request%t_end]
      step%t = merge(minval(beyond), maxval(beyond), longest > 0.0_dp)
      step%h = step%t - request%t
      call set_terms()
    end subroutine end_beyond

    subroutine set_terms()
      !! Compute the terms of the unknowns, and the state at the end of the step.
      integer :: i, k

      factor = step%h/s%h
      step%terms = 0.0_dp
      ! `is_continued` overwrites term 0 of the series.
      step%terms(0, :) = request%state
      do i = 1, tape%n_unknowns
        do k = 1, s%order
          step%terms(k, i) = s%a(k, FIRST_UNKNOWN - 1 + i)*factor**k
        end do
      end do
      step%state = 0.0_dp
      do k = s%order, 1, -1
        step%state = step%state + step%terms(k, :)
      end do
      step%state = request%state + step%state
    end subroutine set_terms

    real(dp) function step_beyond()
      !! Return a step to beyond the switch that crosses, in spite of rounding errors.
      real(dp) :: longer

      associate (i => switches%first)
        ! `is_at_once` has computed the noise.
        longer = BEYOND*epsilon(s%h)*s%noise(switches%operands(i))
        ! The operand returns to its value at the beginning, which is beside the level.
        if (switches%on_level(i) == switches%crosses(i)) then
          longer = longer + abs(operand_error(i, switches, s))
        end if
        longer = longer*abs(s%h/switches%slope)
      end associate
      longer = min(longer, LONGEST_BEYOND*request%relative*abs(s%h))
      longer = max(longer, 2.0_dp*spacing(request%t + step%h))
      step_beyond = step%h + sign(longer, s%h)
    end function step_beyond

    logical function is_at_once()
      !! Return whether the operands that cross a level change by rounding errors alone. One that
      !! also begins on the level has left it before: it would be turned back.
      real(dp) :: noise(tape%n_unknowns)
      integer :: i

      call noise_of(s, noise, abs(request%state))
      is_at_once = .true.
      do i = 1, switches%n
        if (switches%crosses(i) == 0) cycle
        if (switches%on_level(i) == switches%crosses(i)) is_at_once = .false.
        associate (terms => s%a(1:s%order - 1, switches%operands(i)))
          is_at_once = is_at_once .and. factor*size_of(terms, factor) &
                       <= epsilon(factor)*s%noise(switches%operands(i))
        end associate
      end do
    end function is_at_once

    logical function is_continued()
      !! Return whether the derivatives at the end of the step are those of the series.
      real(dp) :: slope(tape%n_unknowns), sizes(tape%n_unknowns)
      real(dp) :: derivatives(tape%n_unknowns), noise(tape%n_unknowns)
      real(dp) :: allowed(tape%n_unknowns)
      integer :: k

      slope = 0.0_dp
      sizes = 0.0_dp
      do k = s%order, 1, -1
        slope = slope + k*step%terms(k, :)
        sizes = sizes + k*abs(step%terms(k, :))
      end do
      call derivatives_at(live, [step%t, 0.0_dp], step%state, -s%h, s, derivatives)
      call noise_of(s, noise, abs(step%state))
      ! NaN is not allowed.
      is_continued = all(abs(step%h*derivatives - slope) <= MOST_DEFECT*tolerances &
                         + MOST_ROUNDING*epsilon(s%h)*(sizes + abs(step%h)*noise)) &
                     .and. all(abs(step%state) <= huge(s%h))
      ! Large terms that cancel are rounded, and a shorter step has smaller terms.
      allowed = MOST_ROUNDING*epsilon(s%h)*max(abs(request%state), abs(step%state))
      is_continued = is_continued &
                     .and. all(epsilon(s%h)*sizes <= max(tolerances, allowed))
    end function is_continued

  end subroutine take_step

end module tape_step

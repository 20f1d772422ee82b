module tape_march
  !! One integration of a tape by Taylor series, from 0 to the last time. The order is fixed, the
  !! step is adapted, and the truncation error of the steps is propagated and subtracted.
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW, SLIDING
  use step_nodes, only: AT_ONCE, powers_of, sum_at_nodes
  use step_limit, only: check_steps, limit_of, step_limit_t
  use tape, only: FIRST_UNKNOWN, next_break, tape_arrays_t, tape_t, TIME_SLOT
  use tape_growth, only: begin, close_block, count_step, find_growth, MOST_UNKNOWNS, transitions_t
  use tape_live, only: keep_live, settle
  use tape_plan, only: converge, fitting, LEAST_LOCAL_TOLERANCE, local_tolerance_of, &
                       MOST_TRIES, order_for
  use tape_series, only: derivatives_at, expand, LAST_TERM, MOST_BLOCKS, MOST_ORDER, noise_of, &
                         PADDED, perturb_tape, series_t, SIDE_BY_SIDE, slot_gradient, &
                         sum_perturbations, sum_terms, VARIATION_TOLERANCE
  use tape_steady, only: find_varying, near_zero, resolving
  use tape_switches, only: CROSSES, follow, IS_CHANGED, jump_at, next_crossing, &
                           operand_error, resolve_switches, SLIDES, STAYS, switches_t
  use two_words, only: two_sum
  implicit none(type, external)
  private

  integer, parameter :: FITTED = 4   ! last terms from which the truncation error is estimated
  integer, parameter :: FEW = 3      ! terms whose decay bounds the truncation error
  ! Least factor on the first step that was tried, from rest and otherwise.
  real(dp), parameter :: SHORTER = 0.5_dp, MUCH_SHORTER = 0.05_dp
  real(dp), parameter :: GUESSED = 0.85_dp
  ! Largest of the last terms of an own state, relative to its guessed size.
  real(dp), parameter :: CONVERGED = 0.01_dp
  integer, parameter :: PARTS = 4 ! of a step, at whose ends the size of an own state is guessed
  ! Change of a local tolerance that changes the order, and of a step that changes the Jacobian.
  real(dp), parameter :: MUCH_LESS = 0.5_dp
  real(dp), parameter :: FEW_STEPS = 32.0_dp ! for which perturbations may be inaccurate
  real(dp), parameter :: RIDGE = 1.001_dp  ! makes the fit work for one pole or none
  ! Largest error for which the linearised equations hold.
  real(dp), parameter :: LINEAR_RANGE = 0.1_dp
  ! Products of smaller omegas underflow, rad/s.
  real(dp), parameter :: LEAST_SCALE = 2.0_dp**(-500)
  ! Least size of an own state, which is part of a product with the local tolerance.
  real(dp), parameter :: LEAST_OWN = 2.0_dp**(-800)
  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**17
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
  real(dp), parameter :: DECAYED = 1e-100_dp ! largest perturbation beside which the error counts
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
    type(transitions_t) :: transitions
    type(tape_t) :: live                      ! with the operations that matter
    real(dp) :: y(tape%n_unknowns), y_low(tape%n_unknowns) ! unknowns and their rounding errors
    real(dp) :: left(tape%n_unknowns)         ! truncation error of the step
    real(dp) :: weights(tape%n_unknowns)      ! which make the unknowns comparable
    real(dp) :: noise(tape%n_unknowns)        ! of the rates
    real(dp) :: sum_of_noise(tape%n_unknowns) ! squares, of all steps
    real(dp) :: noise_of_block(tape%n_unknowns) ! of those since the last block was closed
    real(dp) :: change(PADDED)                ! of the unknowns in the step
    ! The error, and a perturbation of each unknown, in blocks.
    real(dp) :: lanes(SIDE_BY_SIDE, MOST_UNKNOWNS, MOST_BLOCKS)
    real(dp) :: own_sizes(tape%n_unknowns)    ! of own states: the largest so far
    real(dp) :: sizes(tape%n_unknowns)        ! of all unknowns
    real(dp) :: t(2), t_next(2)               ! time and its rounding error, s
    real(dp) :: t_end, rest, factor, shortened, local_tolerance, scale
    real(dp) :: varied                        ! largest term of a perturbation that is left out
    real(dp) :: break_time                    ! next breakpoint of a table, or t_end, s
    real(dp) :: to_stop                       ! time to it, s
    logical :: arrives, at_end, from_rest, is_full, has_guess
    logical :: is_rejected                    ! whether a longer step was rejected
    logical :: has_values                     ! whether terms 0 of all slots are known
    logical :: is_short                       ! whether the terms of perturbations do not suffice
    logical :: is_resolved                    ! whether the terms of the Jacobian were checked
    logical :: is_compared                    ! whether terms 0 are those of a touch
    logical :: is_low                         ! whether the order must be raised
    logical :: is_reaching                    ! whether the scale is guessed from all terms
    logical :: is_guessed                     ! whether the size of an own state is guessed
    logical :: diverges                       ! whether the known terms of a guess do
    real(dp) :: rates(tape%n_unknowns)        ! at the end of the step
    real(dp) :: whole_step                    ! s: h without switches
    real(dp) :: nearly                        ! relative distance from a switch: a touch
    integer :: i, n, n_before, order, tries
    integer :: last_terms(MOST_BLOCKS)        ! of the perturbations
    integer :: first_own, n_blocks
    integer :: varying(tape%n_slots), n_varying ! slots of `find_varying`
    integer :: verdict                        ! of `next_crossing`
    type(step_limit_t) :: limit

    n = tape%n_unknowns
    t_end = request%times(size(request%times))
    y(:3) = request%omega
    n_blocks = 1 + n/SIDE_BY_SIDE
    first_own = n + 1
    if (associated(solution%own)) first_own = n + 2 - size(solution%own, 1)
    y(4:first_own - 1) = attitude(:first_own - 4)
    call begin_own()
    y_low = 0.0_dp
    t = 0.0_dp
    rest = t_end
    solution%status = COMPLETE
    solution%n_rows = 0
    solution%n_steps = 0
    sum_of_noise = 0.0_dp
    noise_of_block = 0.0_dp
    if (switches%n > 0) s%a = 0.0_dp
    call begin(n, transitions)
    call begin_lanes()
    ! Slots of a branch that is not chosen may be singular.
    n_varying = 0
    if (switches%n == 0) call find_varying(tape, varying, n_varying)
    live = tape
    switches%part = 0.0_dp
    if (switches%n > 0) call settle(tape, t, y, t_end, switches, s, live, rates)
    verdict = STAYS
    nearly = min(MOST_NEAR, max(NEAR, attempt%tolerance))
    scale = maxval(abs(request%omega))
    local_tolerance = max(LEAST_LOCAL_TOLERANCE, 0.125_dp*attempt%tolerance)
    ! The first step is a guess: a radian. From rest it is the whole time.
    s%h = sign(min(abs(t_end), 1.0_dp/max(scale, LEAST_SCALE)), t_end)
    s%order = order_for(share_of(t_end/s%h), s%powers, of_steps=.false.)
    limit = limit_of(attempt%most_steps, attempt%stride)
    tries = 0
    is_rejected = .false.
    has_values = .false.
    has_guess = .false.
    from_rest = .not. scale >= LEAST_SCALE
    do
      call set_unknowns()
      if (switches%n > 0) call keep_live(tape, switches, s, live)
      call expand(live, t(2), has_values, s)
      has_values = .false.
      break_time = next_break(tape, t(1), t_end)
      to_stop = (break_time - t(1)) - t(2)
      ! The scale of a body at rest is the omega that it is about to reach.
      if (from_rest) scale = max(maxval(abs(y(:3))), largest_terms(1, 3, 1, 4))
      is_reaching = .not. scale >= LEAST_SCALE
      if (is_reaching) scale = max(scale, reached_size(1), reached_size(2), reached_size(3))
      call weigh()
      factor = longest_step()
      if (.not. factor > 0.0_dp) then
        call shorten()
        if (solution%status /= COMPLETE) exit
        cycle
      end if
      if ((found%steps == 0 .or. from_rest .or. diverges) .and. tries < MOST_TRIES) then
        ! The omega that a body at rest is about to reach is a guess too, and so is the size of an
        ! own state, whose series may diverge.
        if (factor < merge(GUESSED, merge(SHORTER, MUCH_SHORTER, from_rest), diverges)) then
          tries = tries + 1
          s%h = factor*s%h
          cycle
        end if
        if (.not. has_guess) then
          has_guess = .true.
          local_tolerance = share_of(t_end/(factor*s%h))
          found%finest = local_tolerance <= LEAST_LOCAL_TOLERANCE
          order = order_for(local_tolerance, s%powers, of_steps=.false.)
          is_low = order > s%order
          s%order = order
          if (is_low .or. from_rest) cycle
          factor = longest_step()
        end if
      end if
      if (is_rejected) factor = min(1.0_dp, factor)
      factor = to_end(factor)
      call set_lanes()
      call perturb()
      ! Perturbations may change faster than the motion, as about a steady rotation.
      if (is_short) then
        shortened = fitting_lanes()
        factor = factor*shortened
        if (is_resolved .and. shortened < MUCH_LESS) then
          ! The polynomials of the Jacobian are those of a much longer step.
          call perturb()
          if (is_short) factor = factor*fitting_lanes()
        end if
      end if
      call converge(live, s%order, max(scale, LEAST_SCALE), s%a, s%powers, factor)
      if (is_reaching .and. factor < GUESSED .and. factor > 0.0_dp .and. tries < MOST_TRIES) then
        ! The guess of the scale is that of a longer step.
        tries = tries + 1
        s%h = factor*s%h
        cycle
      end if
      if (switches%n > 0) call resolve_switches(nearly, switches, s, factor)
      if (.not. factor > 0.0_dp) then
        call shorten()
        if (solution%status /= COMPLETE) exit
        cycle
      end if
      arrives = abs(factor*s%h) >= abs(to_stop)*(1.0_dp - epsilon(s%h))
      if (arrives) factor = to_stop/s%h
      at_end = arrives .and. .not. abs(break_time) < abs(t_end)
      if (arrives) then
        t_next = [break_time, 0.0_dp]
      else
        call two_sum(t(1), factor*s%h + t(2), t_next(1), t_next(2))
      end if
      if (switches%n > 0) then
        whole_step = factor*s%h
        call next_crossing(nearly, switches, s, factor, verdict)
        if (verdict == SLIDES) then
          found%switches_at = t(1)
          found%switch = switches%sliding
          solution%status = SLIDING
          exit
        end if
        if (verdict == IS_CHANGED) then
          tries = tries + 1
          if (tries <= MOST_TRIES) cycle
          solution%status = OVERFLOW
          exit
        end if
        if (verdict == CROSSES) call end_at_switch()
      end if
      call noise_of(s, noise)
      if (.not. is_continued_to_switch()) then
        is_rejected = .true.
        tries = tries + 1
        if (tries > MOST_TRIES) then
          solution%status = OVERFLOW
          exit
        end if
        ! In a shorter step a guess would be smaller, and rounding errors relatively larger.
        if (is_guessed) call keep_guesses()
        s%h = 0.5_dp*factor*s%h
        cycle
      end if
      tries = 0
      is_rejected = .false.
      n_before = solution%n_rows
      call add_rows()
      if (solution%status /= COMPLETE) exit
      if (associated(solution%nodes)) call add_nodes()
      call add_noise((noise*factor*s%h)**2)
      is_compared = .false.
      if (switches%n > 0) call check_touches()
      call take_step()
      if (switches%n > 0) call cross()
      found%steps = found%steps + 1
      if (.not. maxval(abs(y)) <= huge(s%h)) then
        solution%status = OVERFLOW
        exit
      end if
      scale = max(scale, maxval(abs(y(:3))))
      do i = first_own, n
        own_sizes(i) = max(own_sizes(i), abs(y(i)))
      end do
      if (at_end) then
        call add_row(y, y_low, lanes(1, :n, 1), solution%n_rows + 1)
        exit
      end if
      ! The steps shrink to nothing before a singularity.
      if (abs(factor*s%h) <= spacing(t(1)) .and. .not. arrives .and. verdict /= CROSSES) then
        solution%status = OVERFLOW
        exit
      end if
      call count_step(solution%n_rows > n_before, transitions, is_full)
      if (is_full) then
        call close_block(transposed(n, lanes), noise_of_block, transitions)
        call begin_block()
      end if
      t = t_next
      has_values = size(tape%table_starts) == 1 .and. verdict == STAYS .and. .not. is_compared
      from_rest = .not. scale >= LEAST_SCALE
      rest = (t_end - t(1)) - t(2)
      s%h = factor*s%h
      if (verdict == CROSSES) s%h = whole_step
      if (abs(s%h) > abs(rest)) s%h = rest
      if (has_guess) call share_tolerance()
      call check_steps(found%steps, t(1), rest, arrives .or. verdict == CROSSES, limit, &
                       found%ahead, solution%status)
      if (solution%status /= COMPLETE) exit
    end do
    call weigh()
    where (weights > 0.0_dp)
      sizes = 1.0_dp/weights
    else where
      sizes = 0.0_dp
    end where
    call find_growth(transposed(n, lanes), noise_of_block, sizes, transitions, found%growth, &
                     found%blur)
    found%noise = norm2(weights*sqrt(sum_of_noise))
    do i = 1, n
      found%error = max(found%error, weights(i)*abs(lanes(1, i, 1)))
    end do
    ! Relative to a smaller omega, errors are unknown.
    if (scale > 0.0_dp .and. scale < LEAST_SCALE) found%error = 1.0_dp

  contains

    subroutine begin_lanes()
      !! Set the error to zero, and the perturbations to the unit vector of each unknown.
      lanes(1, :, 1) = 0.0_dp
      call begin_block()
    end subroutine begin_lanes

    subroutine begin_own()
      !! Set the states of the user's own at time 0, and their sizes.
      own_sizes = 0.0_dp
      if (first_own > n) return
      y(first_own:) = solution%own(:n - first_own + 1, 0)
      own_sizes(first_own:) = max(abs(y(first_own:)), solution%own_sizes(:n - first_own + 1))
    end subroutine begin_own

    subroutine begin_block()
      !! Set the perturbations to the unit vector of each unknown, and the rounding errors to zero.
      integer :: i

      noise_of_block = 0.0_dp
      lanes(2:, :n, 1) = 0.0_dp
      lanes(:, :n, 2:n_blocks) = 0.0_dp
      do i = 1, n
        lanes(1 + mod(i, SIDE_BY_SIDE), i, 1 + i/SIDE_BY_SIDE) = 1.0_dp
      end do
    end subroutine begin_block

    subroutine add_noise(squares)
      !! Add the squares of rounding errors, in units.
      real(dp), intent(in) :: squares(:)

      sum_of_noise = sum_of_noise + squares
      noise_of_block = noise_of_block + squares
    end subroutine add_noise

    real(dp) function longest_step()
      !! Return the factor on the step that the terms of the unknowns and of the Jacobian allow.
      logical :: near(tape%n_unknowns)

      longest_step = fitting(tape, s%order, local_tolerance, weights, s%a)
      is_resolved = .false.
      if (n_varying == 0 .or. .not. longest_step > 0.0_dp) return
      near = near_zero(n, local_tolerance, weights, s)
      is_resolved = any(near)
      if (is_resolved) then
        longest_step = resolving(varying(:n_varying), near, weights, max(1.0_dp, abs(t_end)), s, &
                                 longest_step)
      end if
    end function longest_step

    real(dp) function share_of(steps)
      !! Return the part of the tolerance that a step may use.
      real(dp), intent(in) :: steps !! expected number

      share_of = local_tolerance_of(attempt%tolerance, steps, with_attitude=first_own > 4)
    end function share_of

    subroutine share_tolerance()
      !! Divide the tolerance anew, because the steps may become shorter or longer.
      real(dp) :: share

      share = share_of(real(found%steps, dp) + rest/s%h)
      if (share < MUCH_LESS*local_tolerance .or. MUCH_LESS*share > local_tolerance) then
        s%order = order_for(share, s%powers, of_steps=.false.)
      end if
      local_tolerance = share
    end subroutine share_tolerance

    subroutine shorten()
      !! Try a shorter step, because the terms are not finite.
      tries = tries + 1
      if (tries > MOST_TRIES) solution%status = OVERFLOW
      s%a(1:, :) = 0.0_dp
      s%h = 0.0625_dp*s%h
    end subroutine shorten

    subroutine set_unknowns()
      !! Set the terms that the expansion begins with.
      integer :: i

      s%a(0, TIME_SLOT) = t(1)
      s%a(1, TIME_SLOT) = s%h
      do i = 1, n
        s%a(0, FIRST_UNKNOWN - 1 + i) = y(i)
      end do
    end subroutine set_unknowns

    subroutine set_lanes()
      !! Set term 0 of the perturbations.
      integer :: block, i

      do block = 1, n_blocks
        do i = 1, n
          s%blocks(1:SIDE_BY_SIDE, 0, FIRST_UNKNOWN - 1 + i, block) = lanes(:, i, block)
        end do
      end do
      if (.not. tape%has_attitude) return
      associate (v => s%blocks(:, 0, FIRST_UNKNOWN + 3:FIRST_UNKNOWN + 6, 1))
        call rotate(y(4), -y(5), -y(6), -y(7), v(:, 1), v(:, 2), v(:, 3), v(:, 4))
        v = v/dot_product(y(4:7), y(4:7))
      end associate
    end subroutine set_lanes

    subroutine perturb()
      !! Expand the perturbations.
      real(dp) :: steps
      integer :: block, is_long

      steps = found%steps + rest/(factor*s%h)
      ! Small errors of many steps would hide an amplification, or feign one.
      is_long = merge(1, 0, steps > FEW_STEPS)
      varied = VARIATION_TOLERANCE*min(1.0_dp, FEW_STEPS/steps)
      do block = 1, n_blocks
        last_terms(block) = perturb_tape(arrays_of_block(block), SIDE_BY_SIDE*(block - 1), s%h, &
                                         s%order, factor, weights, varied, is_long)
      end do
      is_short = any(last_terms(:n_blocks) < 0)
      last_terms(:n_blocks) = abs(last_terms(:n_blocks))
    end subroutine perturb

    type(tape_arrays_t) function arrays_of_block(block)
      !! Return what tape_terms.c reads of the tape, with a block of perturbations.
      integer, intent(in) :: block

      arrays_of_block = s%arrays
      arrays_of_block%v = c_loc(s%blocks(1, 0, 1, block))
    end function arrays_of_block

    real(dp) function fitting_lanes()
      !! Return the factor on the step with which the last terms of the perturbations are small.
      real(dp) :: first, size_of_last, unit
      integer :: i, block, lane, number

      first = 0.0_dp
      size_of_last = 0.0_dp
      ! The error, number 0, is last: it counts only where the others have decayed.
      do number = n, 0, -1
        block = 1 + number/SIDE_BY_SIDE
        lane = 1 + mod(number, SIDE_BY_SIDE)
        unit = 1.0_dp
        if (number > 0) unit = weights(number)
        if (.not. unit > 0.0_dp .or. (number == 0 .and. first >= DECAYED)) cycle
        do i = 1, n
          associate (v => s%blocks(lane, :, FIRST_UNKNOWN - 1 + i, block), &
                     relative => weights(i)/unit)
            first = max(first, relative*abs(v(1)))
            if (last_terms(block) < s%order) cycle
            size_of_last = max(size_of_last, relative*abs(v(1 + s%order)), &
                               relative*abs(v(s%order))/factor)
          end associate
        end do
      end do
      size_of_last = size_of_last*factor**s%order
      fitting_lanes = 0.25_dp
      if (size_of_last <= huge(s%h) .and. size_of_last > 0.0_dp .and. first > 0.0_dp) then
        fitting_lanes = min(1.0_dp, (varied*first/size_of_last)**(1.0_dp/s%order))
      end if
    end function fitting_lanes

    real(dp) function largest_terms(first, last, first_term, last_term)
      !! Return the largest of some terms of unknowns for a step that ends at the next breakpoint.
      integer, intent(in) :: first, last, first_term, last_term
      real(dp) :: part
      integer :: k

      part = min(1.0_dp, abs(to_stop/s%h))
      largest_terms = 0.0_dp
      do k = first_term, last_term
        largest_terms = max(largest_terms, part**k*maxval(abs(s%a(k, FIRST_UNKNOWN - 1 + first: &
                                                                  FIRST_UNKNOWN - 1 + last))))
      end do
      largest_terms = min(huge(s%h), largest_terms)
    end function largest_terms

    logical function has_large_terms(first, last, total)
      !! Return whether the last terms of unknowns are not much smaller than their guessed size.
      integer, intent(in) :: first, last
      real(dp), intent(in) :: total

      has_large_terms = largest_terms(first, last, 1, s%order - 2) > 0.0_dp &
                        .and. largest_terms(first, last, s%order - 1, s%order) > CONVERGED*total
    end function has_large_terms

    real(dp) function reached_size(number)
      !! Return the largest value of an unknown that begins at 0, in a step that ends at the next
      !! breakpoint. Its terms may be much larger, and cancel.
      integer, intent(in) :: number
      real(dp) :: part, total
      integer :: i, k

      reached_size = 0.0_dp
      do i = 1, PARTS
        part = i*min(1.0_dp, abs(to_stop/s%h))/PARTS
        total = 0.0_dp
        do k = s%order, 1, -1
          total = part*(total + s%a(k, FIRST_UNKNOWN - 1 + number))
        end do
        reached_size = max(reached_size, abs(total))
      end do
      reached_size = min(huge(s%h), reached_size)
    end function reached_size

    subroutine weigh()
      !! Make errors of omega relative to the scale, errors of the quaternion angles, and errors of
      !! own states relative to their sizes, or to the sizes that they are about to reach.
      real(dp) :: own_size
      integer :: i

      weights(:3) = 1.0_dp/max(scale, LEAST_SCALE)
      ! Of a body that stays at rest, an omega counts that turns it by a radian.
      if (.not. scale >= LEAST_SCALE) weights(:3) = abs(t_end)
      weights(4:first_own - 1) = 2.0_dp
      is_guessed = .false.
      diverges = is_reaching .and. has_large_terms(1, 3, scale)
      do i = first_own, n
        own_size = own_sizes(i)
        if (.not. own_size > 0.0_dp) then
          own_size = reached_size(i)
          is_guessed = is_guessed .or. own_size > 0.0_dp
          diverges = diverges .or. has_large_terms(i, i, own_size)
        end if
        weights(i) = 0.0_dp
        if (own_size > 0.0_dp) weights(i) = 1.0_dp/max(own_size, LEAST_OWN)
      end do
    end subroutine weigh

    subroutine keep_guesses()
      !! Set the unknown sizes of own states to their guesses.
      integer :: i

      do i = first_own, n
        if (weights(i) > 0.0_dp) own_sizes(i) = max(own_sizes(i), 1.0_dp/weights(i))
      end do
    end subroutine keep_guesses

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

    subroutine estimate_truncation()
      !! Estimate the sum of the terms that the step leaves out. One pair of poles is fitted to the
      !! last four terms by least squares: x(k + 1) = p x(k) - q x(k - 1).
      real(dp) :: uu, vv, uv, ux, vx, p, q, determinant, powers(2*FEW), x(FITTED)
      real(dp) :: near, far
      integer :: i, k

      powers(1) = factor**(s%order - 2*FEW + 1)
      do k = 2, 2*FEW
        powers(k) = powers(k - 1)*factor
      end do
      uu = 0.0_dp
      vv = 0.0_dp
      uv = 0.0_dp
      ux = 0.0_dp
      vx = 0.0_dp
      do i = 1, n
        x = weights(i)/local_tolerance &
            *powers(2*FEW - FITTED + 1:)*s%a(s%order - FITTED + 1:s%order, FIRST_UNKNOWN - 1 + i)
        uu = uu + (x(3)*x(3) + x(2)*x(2))
        vv = vv + (x(2)*x(2) + x(1)*x(1))
        uv = uv + (x(3)*x(2) + x(2)*x(1))
        ux = ux + (x(3)*x(4) + x(2)*x(3))
        vx = vx + (x(2)*x(4) + x(1)*x(3))
      end do
      determinant = (RIDGE*uu)*(RIDGE*vv) - uv*uv
      p = (RIDGE*vv)*ux - uv*vx
      q = uv*ux - (RIDGE*uu)*vx
      ! A series that converges has no poles within the step, or nearly within.
      determinant = max((determinant - p) + q, abs(p - q), abs(q), tiny(p))
      p = (p - q)/determinant
      q = q/determinant
      do i = 1, n
        associate (slot => FIRST_UNKNOWN - 1 + i)
          left(i) = p*(s%a(s%order, slot)*powers(2*FEW)) &
                    - q*(s%a(s%order - 1, slot)*powers(2*FEW - 1))
        end associate
      end do
      ! The fit may be small by chance.
      near = 0.0_dp
      far = 0.0_dp
      do i = 1, n
        associate (last => s%a(s%order - 2*FEW + 1:s%order, FIRST_UNKNOWN - 1 + i))
          far = far + weights(i)*sum(abs(last(:FEW))*powers(:FEW))
          near = near + weights(i)*sum(abs(last(FEW + 1:))*powers(FEW + 1:))
        end associate
      end do
      found%least = max(found%least, near*min(0.5_dp, near/max(far, tiny(far))))
    end subroutine estimate_truncation

    logical function is_continued()
      !! Return whether the series continue beyond the end of the step: whether the derivatives
      !! there are those of the series. A pulse within the step may be too small to be seen at its
      !! beginning. The change of the unknowns is computed too.
      real(dp) :: derivatives(tape%n_unknowns), slope(PADDED)
      real(dp) :: defect(tape%n_unknowns), size_of_terms(PADDED), rounded, allowed
      real(dp) :: reached, cancelled
      integer :: i

      call sum_terms(s%arrays, s%order, factor, change, slope, size_of_terms)
      ! Large terms that cancel are rounded, and a shorter step has smaller terms.
      reached = max(scale, maxval(abs(y(:3) + change(:3))), LEAST_SCALE)
      cancelled = max(maxval(size_of_terms(:3))/reached, 2.0_dp*sum(size_of_terms(4:first_own - 1)))
      do i = first_own, n
        cancelled = max(cancelled, size_of_terms(i) &
                        /max(own_sizes(i), abs(y(i) + change(i)), LEAST_OWN))
      end do
      if (.not. cancelled <= max(MOST_CANCELLED, attempt%tolerance/epsilon(rounded))) then
        is_continued = .false.
        return
      end if
      rounded = max(1.0_dp, maxval(weights*(size_of_terms(:n) + noise*abs(factor*s%h))))
      call derivatives_at(live, t_next, y + (change(:n) + y_low), -s%h, s, derivatives)
      rates = derivatives
      allowed = MOST_DEFECT*local_tolerance + MOST_ROUNDING*epsilon(rounded)*rounded
      defect = weights*abs(factor*s%h*derivatives - slope(:n))
      ! NaN is not allowed.
      is_continued = all(defect <= allowed)
      if (is_continued) found%least = max(found%least, maxval(defect)/(s%order + 1))
    end function is_continued

    subroutine end_at_switch()
      !! Let the step end where a switch changes, or with the breakpoint that is there.
      arrives = abs(factor*s%h) >= abs(to_stop)*(1.0_dp - 4.0_dp*epsilon(factor))
      at_end = arrives .and. .not. abs(break_time) < abs(t_end)
      if (arrives) then
        factor = to_stop/s%h
        t_next = [break_time, 0.0_dp]
      else
        call two_sum(t(1), factor*s%h + t(2), t_next(1), t_next(2))
      end if
    end subroutine end_at_switch

    logical function is_continued_to_switch()
      !! Return whether the series continue; correct the end of a step at a switch, because the
      !! series of an operand has one term less than those of the unknowns.
      real(dp) :: correction, before
      integer :: tries

      before = factor
      do tries = 0, CORRECTIONS
        call estimate_truncation()
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
        if (abs(before*s%h) <= spacing(t(1))) return
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
      call derivatives_at(live, t_next, y + (change(:n) + y_low), -s%h, s, rates)
    end subroutine check_touches

    subroutine compare_touch(i, level)
      !! Add what the rates beyond a level would change.
      integer, intent(in) :: i, level
      real(dp) :: other(tape%n_unknowns), here(tape%n_unknowns), zero(tape%n_unknowns)
      real(dp) :: at(tape%n_unknowns), at_time(2), slots(size(switches%slots))
      integer :: on_level(size(switches%slots))
      logical :: is_changed

      slots = s%a(0, switches%slots)
      call evaluate(switches%touches(level, i), at, zero)
      at = y + (at + y_low)
      call two_sum(t(1), switches%touches(level, i)*s%h + t(2), at_time(1), at_time(2))
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
      call add_noise(merge((other/ROUNDING)**2, 0.0_dp, other >= 0.0_dp))
      if (maxval(weights*other) > found%touched) then
        found%touched = maxval(weights*other)
        found%switch = i
        found%switches_at = at_time(1)
      end if
    end subroutine compare_touch

    subroutine cross()
      !! Change the switches at the end of the step. A perturbation changes the time at which the
      !! rates jump (Leine and Nijmeijer 2004).
      real(dp) :: gradient(tape%n_unknowns), after(tape%n_unknowns), jump(tape%n_unknowns)
      real(dp) :: slope, blur
      integer :: block, i

      switches%on_level = 0
      if (verdict /= CROSSES) return
      call slot_gradient(s%arrays, switches%operands(switches%first), gradient)
      slope = switches%slope/s%h
      blur = s%noise(switches%operands(switches%first))/slope
      switches%part = whole_step/s%h ! in which the terms of an operand are not all small
      call settle(tape, t_next, y + y_low, s%h, switches, s, live, after)
      jump = after - rates
      do block = 1, n_blocks
        do i = 1, SIDE_BY_SIDE
          associate (lane => lanes(i, :n, block))
            lane = lane + jump*(dot_product(gradient, lane)/slope)
          end associate
        end do
      end do
      call add_noise((jump*blur)**2)
    end subroutine cross

    subroutine take_step()
      !! Advance the unknowns, the error and the perturbations to the end of the step.
      integer :: block, i

      do block = 1, n_blocks
        call sum_perturbations(arrays_of_block(block), last_terms(block), factor, &
                               lanes(1, 1, block))
      end do
      do i = 1, n
        call two_sum((y(i)), change(i) + y_low(i), y(i), y_low(i))
      end do
      if (tape%has_attitude) then
        call rotate(y(4), y(5), y(6), y(7), lanes(:, 4, 1), lanes(:, 5, 1), lanes(:, 6, 1), &
                    lanes(:, 7, 1))
      end if
      lanes(1, :n, 1) = lanes(1, :n, 1) - left
    end subroutine take_step

    subroutine evaluate(part, change, error)
      !! Compute the change of the unknowns since the beginning of the step, and their error.
      real(dp), intent(in) :: part !! of the step that was expanded
      real(dp), intent(out) :: change(:), error(:)
      integer :: i, k

      do i = 1, n
        change(i) = 0.0_dp
        do k = s%order, 1, -1
          change(i) = part*(change(i) + s%a(k, FIRST_UNKNOWN - 1 + i))
        end do
        error(i) = s%blocks(1, last_terms(1), FIRST_UNKNOWN - 1 + i, 1)
        do k = last_terms(1) - 1, 0, -1
          error(i) = part*error(i) + s%blocks(1, k, FIRST_UNKNOWN - 1 + i, 1)
        end do
      end do
      if (tape%has_attitude) then
        call rotate(y(4) + change(4), y(5) + change(5), y(6) + change(6), y(7) + change(7), &
                    error(4), error(5), error(6), error(7))
      end if
      error = error - (part/factor)**(s%order + 1)*left
    end subroutine evaluate

    subroutine add_rows()
      !! Compute the rows within the step, except the last row of all.
      real(dp) :: part, change(tape%n_unknowns), error(tape%n_unknowns)
      integer :: last_row

      last_row = size(request%times)
      if (at_end) last_row = last_row - 1
      do while (solution%n_rows < last_row)
        part = ((request%times(solution%n_rows + 1) - t(1)) - t(2))/s%h
        if (abs(part) > factor) return
        call evaluate(part, change, error)
        call add_row(y, y_low + change, error, solution%n_rows + 1)
        if (solution%status /= COMPLETE) return
        if (mod(solution%n_rows, ROWS_BETWEEN_LOOKS) == 0) then
          if (interrupt_raised() /= 0) then
            solution%status = INTERRUPTED
            return
          end if
        end if
      end do
    end subroutine add_rows

    subroutine add_row(high, low, error, row)
      real(dp), intent(in) :: high(:), low(:), error(:)
      integer, intent(in) :: row
      real(dp) :: z(tape%n_unknowns)

      call correct(high, low, error, z)
      if (.not. maxval(abs(z)) <= huge(s%h)) then
        solution%status = OVERFLOW
        return
      end if
      solution%rows(:, row) = z(:3)
      if (associated(solution%attitudes)) then
        solution%attitudes(:, row) = z(4:7)/norm2(z(4:7))
        if (request%times(row) == 0.0_dp) solution%attitudes(:, row) = attitude
      end if
      if (first_own <= n) solution%own(:n - first_own + 1, row) = z(first_own:)
      solution%n_rows = row
    end subroutine add_row

    subroutine correct(high, low, error, z)
      !! Subtract the error if it is small enough to be known: a wrong estimate then costs no more
      !! than the tolerance.
      real(dp), intent(in) :: high(:), low(:), error(:)
      real(dp), intent(out) :: z(:)
      real(dp) :: size_of_error

      size_of_error = maxval(weights*abs(error))
      if (.not. size_of_error <= found%error) found%error = size_of_error
      z = high + low
      if (size_of_error <= min(LINEAR_RANGE, request%tolerance)) z = high + (low - error)
    end subroutine correct

    subroutine add_nodes()
      !! Compute the unknowns at the nodes of the step, as `evaluate` and `correct`, side by side.
      real(dp) :: parts(AT_ONCE), powers(AT_ONCE), errors(AT_ONCE, n)
      real(dp) :: changes(AT_ONCE, n), sizes(AT_ONCE), value(AT_ONCE)
      integer :: i, k

      solution%n_steps = solution%n_steps + 1
      if (solution%n_steps >= size(solution%ends)) return
      associate (at_nodes => solution%at_nodes(:, :, solution%n_steps))
        solution%ends(solution%n_steps + 1) = t_next(1)
        if (solution%n_steps > 1) then
          at_nodes(:, 1) = solution%at_nodes(:, 1 + AT_ONCE, solution%n_steps - 1)
        else
          at_nodes(:, 1) = y
        end if
        parts = factor*solution%nodes(2:)
        powers = powers_of(solution%nodes(2:), s%order + 1)
        sizes = 0.0_dp
        call sum_at_nodes(s%a(:, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n), n*(LAST_TERM + 1), 1, &
                          LAST_TERM + 1, n, s%order, parts, changes)
        call sum_at_nodes(s%blocks(:, :, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n, 1), &
                          n*(MOST_ORDER + 1)*SIDE_BY_SIDE, SIDE_BY_SIDE, &
                          (MOST_ORDER + 1)*SIDE_BY_SIDE, n, last_terms(1), parts, errors)
        do i = 1, n
          errors(:, i) = errors(:, i) + s%blocks(1, 0, FIRST_UNKNOWN - 1 + i, 1)
        end do
        if (tape%has_attitude) then
          call rotate(y(4) + changes(:, 4), y(5) + changes(:, 5), y(6) + changes(:, 6), &
                      y(7) + changes(:, 7), errors(:, 4), errors(:, 5), errors(:, 6), errors(:, 7))
        end if
        do i = 1, n
          errors(:, i) = errors(:, i) - powers*left(i)
          sizes = max(sizes, weights(i)*abs(errors(:, i)))
        end do
        do i = 1, n
          value = y_low(i) + changes(:, i)
          value = y(i) + merge(value - errors(:, i), value, &
                               sizes <= min(LINEAR_RANGE, request%tolerance))
          do k = 1, AT_ONCE
            at_nodes(i, 1 + k) = value(k)
          end do
        end do
      end associate
      do k = 1, AT_ONCE
        if (.not. sizes(k) <= found%error) found%error = sizes(k)
      end do
    end subroutine add_nodes

  end subroutine march

  elemental subroutine rotate(w, x, y, z, a, b, c, d)
    !! Multiply the quaternion (a, b, c, d) by (w, x, y, z), from the left.
    real(dp), intent(in) :: w, x, y, z
    real(dp), intent(inout) :: a, b, c, d
    real(dp) :: p, q, r

    p = a
    q = b
    r = c
    a = w*p - x*q - y*r - z*d
    b = w*q + x*p + y*d - z*r
    c = w*r - x*d + y*p + z*q
    d = w*d + x*r - y*q + z*p
  end subroutine rotate

  pure function transposed(n, lanes) result(matrix)
    !! Compute the matrix of the open block from the perturbations in the lanes.
    integer, intent(in) :: n !! number of unknowns
    real(dp), intent(in) :: lanes(SIDE_BY_SIDE, MOST_UNKNOWNS, MOST_BLOCKS)
    real(dp) :: matrix(MOST_UNKNOWNS, MOST_UNKNOWNS)
    integer :: i

    do i = 1, n
      matrix(:n, i) = lanes(1 + mod(i, SIDE_BY_SIDE), :n, 1 + i/SIDE_BY_SIDE)
    end do
  end function transposed

end module tape_march

module tape_runge_kutta
  !! Runge-Kutta steps of a tape over points where no Taylor series converges although the rates are
  !! finite, such as those where the argument of a root becomes 0. The rates change so little in a
  !! short step that its error, found by halving, is small enough.
  use kinds, only: dp
  use operations, only: LOGARITHM => LOG, QUOTIENT, SQUARE_ROOT => SQRT
  use tape, only: FIRST_UNKNOWN, tape_t
  use tape_crossings, only: before_crossings
  use tape_growth, only: MOST_UNKNOWNS
  use tape_live, only: keep_live, settle
  use tape_plan, only: converge
  use tape_series, only: derivatives_at, series_t, slot_gradient
  use tape_switches, only: switches_t
  use tape_values, only: LAST_TERM
  use two_words, only: two_sum
  implicit none(type, external)
  private

  real(dp), parameter :: NEAR_ZERO = 0.125_dp ! change of an operand in a series' step, relative
  real(dp), parameter, public :: LONGER_THAN_SERIES = 6.0_dp ! to beyond the singular point
  real(dp), parameter :: SHORTER = 0.25_dp    ! factor on a step whose error is too large
  integer, parameter :: MOST_TRIES = 60
  integer, parameter :: LAST_TABLE_TERM = 3 ! of a cubic polynomial
  real(dp), parameter :: SHORTEST = 4.0_dp    ! step, over the distance of neighbouring times
  ! Error of the halved step over the difference that halving makes, if rates grow as 1/sqrt(t).
  real(dp), parameter :: HALVED = 2.5_dp
  integer, parameter :: MOST_PIECES = 4       ! of the halved step
  ! Of the step in which the sizes of unknowns are guessed, which suffices if halving changes them
  ! by at most this part.
  integer, parameter :: MANY_PIECES = 64
  real(dp), parameter :: ROUGHLY = 0.5_dp
  ! Perturbations from which derivatives are computed, over the change in the step and over a size.
  real(dp), parameter :: OF_CHANGE = 1e-3_dp, OF_SIZE = 1e-9_dp

  ! Changes in a step of n pieces, an even number.
  type :: pieces_t
    real(dp) :: h                                     ! s
    integer :: n
    real(dp), dimension(MOST_UNKNOWNS) :: rates       ! at the beginning
    real(dp), dimension(MOST_UNKNOWNS) :: change, middle ! of the unknowns, and in half of the step
    real(dp), dimension(MOST_UNKNOWNS) :: largest     ! unknowns
  end type pieces_t

  type, public :: long_step_t
    ! What is required.
    real(dp) :: first, least            ! length that is tried first, and shortest length, s
    real(dp) :: allowed                 ! error
    logical :: with_derivatives
    logical :: is_stopped(MOST_UNKNOWNS) ! unknowns that a perturbation leaves for a moment alone
    ! What is computed.
    real(dp) :: h                       ! s; 0 if no step is accurate enough
    real(dp) :: largest_error           ! of the step, or of the last that was tried, relative
    integer :: slides                   ! the switch that jumps back behind the step, or 0
    real(dp) :: change(MOST_UNKNOWNS)
    real(dp) :: error(MOST_UNKNOWNS)    ! bound of its error
    real(dp) :: terms(4, MOST_UNKNOWNS) ! of the quartic with the change, rates and middle value
    ! Derivatives of the change by the unknowns at the beginning; element (i, j) is of change i.
    real(dp) :: derivatives(MOST_UNKNOWNS, MOST_UNKNOWNS)
  end type long_step_t

  ! Pointers, so that code that is rarely needed is not inlined.
  procedure(rates_at), pointer, public :: rates_by => rates_at
  procedure(integrate), pointer, public :: integrate_by => integrate

  public :: guess_sizes, has_singular_points, is_near_singular, longest_without_terms, put_terms, &
            step_over, stop_unknowns

contains

  pure logical function has_singular_points(tape)
    !! Return whether an operation has no Taylor series where its operand is 0.
    type(tape_t), intent(in) :: tape
    integer :: n

    has_singular_points = .false.
    do n = 1, tape%n_operations
      has_singular_points = has_singular_points .or. singular_operand(tape, n) > 0
    end do
  end function has_singular_points

  pure integer function singular_operand(tape, n)
    !! Return the operand at whose 0 an operation has no Taylor series, or 0.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n !! number of the operation

    select case (tape%operations(1, n))
    case (SQUARE_ROOT, LOGARITHM)
      singular_operand = tape%operations(2, n)
    case (QUOTIENT)
      singular_operand = tape%operations(3, n)
    case default
      singular_operand = 0
    end select
  end function singular_operand

  pure logical function is_near_singular(tape, order, a, factor)
    !! Return whether such an operand changes much in the step, as it does shortly before its zero.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    real(dp), intent(in) :: factor !! on the step of the series
    real(dp) :: change
    integer :: k, n, operand

    is_near_singular = .false.
    do n = 1, tape%n_operations
      operand = singular_operand(tape, n)
      ! Near a pole, a long step might miss a pulse.
      if (operand == 0 .or. tape%operations(1, n) == QUOTIENT) cycle
      change = 0.0_dp
      do k = order - 1, 1, -1
        change = factor*(change + abs(a(k, operand)))
      end do
      if (change > NEAR_ZERO*abs(a(0, operand))) then
        is_near_singular = .true.
        return
      end if
    end do
  end function is_near_singular

  subroutine step_over(tape, t, y, weights, switches, s, live, step)
    !! Take a step, the longest whose error is small enough. Terms 0 of all slots and the switches
    !! become those at its end; without such a step, they remain.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2)       !! time and its rounding error, s
    real(dp), intent(in) :: y(:)       !! unknowns
    real(dp), intent(in) :: weights(:) !! make the unknowns comparable
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    type(long_step_t), intent(inout) :: step
    real(dp), dimension(size(y)) :: rates, fine, end_rates
    type(pieces_t) :: pieces
    real(dp) :: coarse(size(y)), error
    real(dp), dimension(switches%n) :: results, operands ! of the switches at the beginning
    real(dp) :: terms(0:LAST_TABLE_TERM, tape%n_slots)
    integer :: on_level(switches%n)
    logical :: is_new(switches%n)
    real(dp) :: tried
    integer :: tries

    step%h = 0.0_dp
    step%largest_error = huge(error)
    call keep_slots(switches, s, terms, on_level, is_new)
    call rates_by(tape, t, y, step%first, switches, s, live, rates)
    if (.not. all(abs(rates) <= huge(error))) then
      call restore_slots(tape, terms, on_level, is_new, switches, s, live)
      return
    end if
    if (switches%n > 0) then
      results = s%a(0, switches%slots)
      operands = s%a(0, switches%operands)
    end if
    tried = step%first
    do tries = 1, MOST_TRIES
      ! Times are rounded.
      tried = (t(1) + tried) - t(1)
      if (.not. abs(tried) >= max(step%least, SHORTEST*spacing(t(1)))) exit
      pieces%h = tried
      pieces%rates(:size(y)) = rates
      pieces%n = MOST_PIECES/2
      call integrate_by(tape, t, y, switches, s, live, pieces)
      coarse = pieces%change(:size(y))
      pieces%n = MOST_PIECES
      call integrate_by(tape, t, y, switches, s, live, pieces)
      fine = pieces%change(:size(y))
      step%error(:size(y)) = HALVED*abs(fine - coarse)
      ! NaN must not be lost in the maximum.
      error = huge(error)
      if (all(abs(fine) <= huge(error))) error = maxval(weights*step%error(:size(y)))
      step%largest_error = error
      if (error <= step%allowed) then
        call end_step()
        if (step%h /= 0.0_dp) return
      end if
      tried = SHORTER*tried
    end do
    call restore_slots(tape, terms, on_level, is_new, switches, s, live)

  contains

    subroutine end_step()
      !! Set the switches at the end, and the derivatives of the change.
      real(dp) :: gradient(size(y)), slope, before ! in the step, and at its beginning
      integer :: i, j

      call set_end()
      if (.not. all(abs(end_rates) <= huge(error))) return
      step%h = tried
      step%slides = 0
      step%change(:size(y)) = fine
      call interpolate()
      do i = 1, switches%n
        if (switches%is_live(i) .and. s%a(0, switches%slots(i)) /= results(i)) exit
      end do
      if (i > switches%n .and. step%with_derivatives) then
        call differentiate()
        call set_end()
      end if
      if (i > switches%n) return
      ! A perturbation changes the time of the jump of the rates, if there is one.
      call slot_gradient(s%arrays, switches%operands(i), gradient)
      slope = (s%a(0, switches%operands(i)) - operands(i))/tried
      before = slope - dot_product(gradient, fine/tried - rates)
      if (dot_product(gradient, end_rates)*sign(1.0_dp, slope) < -NEAR_ZERO*abs(slope)) then
        step%slides = i
      end if
      do j = 1, size(y)
        associate (derivatives => step%derivatives(:size(y), j))
          derivatives = (end_rates - rates)*(gradient(j)/before)
          where (.not. abs(derivatives) <= huge(error)) derivatives = 0.0_dp
        end associate
      end do
    end subroutine end_step

    subroutine set_end()
      call rates_by(tape, [t(1) + tried, t(2)], y + fine, tried, switches, s, live, end_rates)
    end subroutine set_end

    subroutine interpolate()
      associate (terms => step%terms(:, :size(y)), p => tried*rates, q => tried*end_rates, &
                 middle => pieces%middle(:size(y)))
        terms(1, :) = p
        terms(2, :) = 16.0_dp*middle - 5.0_dp*fine - 4.0_dp*p + q
        terms(3, :) = 14.0_dp*fine - 32.0_dp*middle + 5.0_dp*p - 3.0_dp*q
        terms(4, :) = 16.0_dp*middle - 8.0_dp*fine - 2.0_dp*p + 2.0_dp*q
      end associate
    end subroutine interpolate

    subroutine differentiate()
      !! Compute the derivatives of the change.
      type(pieces_t) :: other
      real(dp) :: perturbed(size(y)), perturbation
      integer :: j

      other%h = tried
      other%n = MOST_PIECES
      do j = 1, size(y)
        step%derivatives(:size(y), j) = 0.0_dp
        if (.not. weights(j) > 0.0_dp .or. (step%is_stopped(j) .and. fine(j) == 0.0_dp)) cycle
        perturbation = max(OF_CHANGE*abs(fine(j)), OF_SIZE*abs(y(j)), &
                           min(OF_SIZE, step%allowed)/weights(j))
        perturbed = y
        perturbed(j) = perturbed(j) + perturbation
        call rates_by(tape, t, perturbed, tried, switches, s, live, other%rates(:size(y)))
        call integrate_by(tape, t, perturbed, switches, s, live, other)
        associate (change => other%change(:size(y)))
          if (all(abs(change) <= huge(error))) then
            step%derivatives(:size(y), j) = (change - fine)/(perturbed(j) - y(j))
          end if
        end associate
      end do
    end subroutine differentiate

  end subroutine step_over

  real(dp) function longest_without_terms(live, order, t, switches, s)
    !! Return the longest step (s) from a singular point that the terms of the other operations and
    !! the switches allow: it ends shortly before a switch changes, or shortly after.
    type(tape_t), intent(in) :: live
    integer, intent(in) :: order
    real(dp), intent(in) :: t
    type(switches_t), intent(in) :: switches
    type(series_t), intent(inout) :: s
    real(dp) :: factor, rounded

    factor = LONGER_THAN_SERIES
    call converge(live, order, 0.0_dp, s%a, s%powers, factor, is_singular=.true.)
    longest_without_terms = factor*s%h
    if (switches%n == 0) return
    rounded = 8.0_dp*SHORTEST*spacing(t)/abs(s%h)
    if (before_crossings(switches, s, factor)) then
      if (factor > 2.0_dp*rounded) rounded = -rounded
      longest_without_terms = (factor + rounded)*s%h
    end if
  end function longest_without_terms

  subroutine guess_sizes(tape, t, y, longest, switches, s, live, sizes)
    !! Guess the sizes that the unknowns reach in a step up to `longest`; 0 if no step is accurate.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2), longest !! s
    real(dp), intent(in) :: y(:)
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    real(dp), intent(out) :: sizes(:)
    type(pieces_t) :: pieces
    real(dp) :: terms(0:LAST_TABLE_TERM, tape%n_slots), coarse(size(y))
    integer :: on_level(switches%n), tries
    logical :: is_new(switches%n)

    call keep_slots(switches, s, terms, on_level, is_new)
    pieces%h = longest
    call rates_by(tape, t, y, longest, switches, s, live, pieces%rates(:size(y)))
    do tries = 1, MOST_TRIES
      pieces%n = MANY_PIECES/2
      call integrate_by(tape, t, y, switches, s, live, pieces)
      coarse = pieces%change(:size(y))
      pieces%n = MANY_PIECES
      call integrate_by(tape, t, y, switches, s, live, pieces)
      sizes = pieces%largest(:size(y))
      ! NaN is not allowed.
      if (all(abs(pieces%change(:size(y)) - coarse) <= ROUGHLY*sizes)) exit
      pieces%h = SHORTER*pieces%h
    end do
    if (tries > MOST_TRIES) sizes = 0.0_dp
    call restore_slots(tape, terms, on_level, is_new, switches, s, live)
  end subroutine guess_sizes

  pure subroutine put_terms(step, n, s)
    !! Let the terms of the n unknowns be those of the step, and the step its length.
    type(long_step_t), intent(in) :: step
    integer, intent(in) :: n
    type(series_t), intent(inout) :: s

    s%h = step%h
    s%a(1:, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n) = 0.0_dp
    s%a(1:4, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n) = step%terms(:, :n)
  end subroutine put_terms

  subroutine stop_unknowns(tape, t, switches, s, live, y, is_stopped)
    !! Set unknowns to 0 that reach it in a finite time, before which steps shrink to nothing, and
    !! remain: the rates there are 0, and lead back to 0 from both sides, as w' = -sign(w)
    !! sqrt(abs(w)). None is set if one of them does not remain.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2)       !! time and its rounding error, s
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    real(dp), intent(inout) :: y(:)
    logical, intent(inout) :: is_stopped(:) !! unknowns that may reach 0; those that were set
    real(dp), dimension(size(y)) :: rates, there
    integer :: i, side

    do i = 1, size(y)
      if (.not. is_stopped(i)) cycle
      do side = -1, 1, 2
        there = merge(0.0_dp, y, is_stopped)
        there(i) = sign(y(i), real(side, dp))
        call rates_by(tape, t, there, s%h, switches, s, live, rates)
        ! NaN, where the torque is not defined, leads nowhere.
        if (rates(i)*side*s%h > 0.0_dp) is_stopped = .false.
      end do
    end do
    there = merge(0.0_dp, y, is_stopped)
    call rates_by(tape, t, there, s%h, switches, s, live, rates)
    if (.not. all(abs(rates) <= huge(rates)) .or. any(is_stopped .and. rates /= 0.0_dp)) then
      is_stopped = .false.
    end if
    where (is_stopped) y = 0.0_dp
  end subroutine stop_unknowns

  subroutine keep_slots(switches, s, terms, on_level, is_new)
    !! Copy the terms of slots that `rates_at` overwrites, and the switches.
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s
    real(dp), intent(out) :: terms(0:, :)
    integer, intent(out) :: on_level(:)
    logical, intent(out) :: is_new(:)

    terms = s%a(:LAST_TABLE_TERM, :)
    if (switches%n == 0) return
    on_level = switches%on_level
    is_new = switches%is_new
  end subroutine keep_slots

  subroutine restore_slots(tape, terms, on_level, is_new, switches, s, live)
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: terms(0:, :)
    integer, intent(in) :: on_level(:)
    logical, intent(in) :: is_new(:)
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live

    s%a(:LAST_TABLE_TERM, :) = terms
    if (switches%n == 0) return
    call keep_live(tape, switches, s, live)
    switches%on_level = on_level
    switches%is_new = is_new
  end subroutine restore_slots

  subroutine integrate(tape, t, y, switches, s, live, pieces)
    !! Compute the changes in the pieces with the classical Runge-Kutta method.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2)     !! s
    real(dp), intent(in) :: y(:)
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    type(pieces_t), intent(inout) :: pieces !! length, number and rates are inputs
    real(dp), dimension(size(y)) :: k1, k2, k3, k4
    real(dp) :: h
    integer :: i

    h = pieces%h/pieces%n
    associate (change => pieces%change(:size(y)), largest => pieces%largest(:size(y)))
      change = 0.0_dp
      largest = abs(y)
      k1 = pieces%rates(:size(y))
      do i = 1, pieces%n
        if (i > 1) call rates_after((i - 1)*h, change, k1)
        call rates_after((i - 0.5_dp)*h, change + 0.5_dp*h*k1, k2)
        call rates_after((i - 0.5_dp)*h, change + 0.5_dp*h*k2, k3)
        call rates_after(i*h, change + h*k3, k4)
        change = change + h/6.0_dp*((k1 + k4) + 2.0_dp*(k2 + k3))
        largest = max(largest, abs(y + change))
        if (i == pieces%n/2) pieces%middle(:size(y)) = change
      end do
    end associate

  contains

    subroutine rates_after(time, change_there, rates_there)
      real(dp), intent(in) :: time
      real(dp), intent(in) :: change_there(:)
      real(dp), intent(out) :: rates_there(:)
      real(dp) :: there(2)

      call two_sum(t(1), time + t(2), there(1), there(2))
      call rates_by(tape, there, y + change_there, h, switches, s, live, rates_there)
    end subroutine rates_after

  end subroutine integrate

  subroutine rates_at(tape, t, y, h, switches, s, live, rates)
    !! Compute the rates with the results of switches that belong to the unknowns.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2), h  !! s
    real(dp), intent(in) :: y(:)
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    real(dp), intent(out) :: rates(:)

    if (switches%n == 0) then
      call derivatives_at(tape, t, y, h, s, rates)
      return
    end if
    switches%part = 0.0_dp
    switches%on_level = 0
    switches%crosses = 0
    call settle(tape, t, y, h, switches, s, live, rates)
  end subroutine rates_at

end module tape_runge_kutta

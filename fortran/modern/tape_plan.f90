module tape_plan
  !! The order, local tolerance and step of an integration of a tape.
  use kinds, only: dp
  use operations, only: EXPONENTIAL => EXP, QUOTIENT, SQUARE_ROOT => SQRT, TANGENT => TANH
  use tape, only: FIRST_UNKNOWN, tape_t
  use tape_powers, only: INVISIBLE, powers_t, resolve
  use tape_series, only: MOST_ORDER
  use tape_values, only: LARGE_ARGUMENT, LAST_TERM
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_TRIES = 80
  ! Of an integration and of single steps: least order, and its factor on the logarithm of the
  ! local tolerance. An integration has more work in a step that does not depend on the order.
  integer, parameter :: LEAST_ORDER = 16, LEAST_OF_STEPS = 8
  real(dp), parameter :: ORDERS = 1.1_dp, ORDERS_OF_STEPS = 0.7_dp
  integer, parameter :: CHECKED = 3  ! last terms checked: from rest a ramp makes only every third
  real(dp), parameter, public :: LONGER = 16.0_dp  ! largest factor on the step that was tried
  real(dp), parameter, public :: LEAST_LOCAL_TOLERANCE = 1e-18_dp ! below rounding
  real(dp), parameter :: WITHIN_CIRCLE = 0.9_dp ! part of the distance of a zero

  public :: converge, fitting, local_tolerance_of, order_for

contains

  pure real(dp) function fitting(tape, order, local_tolerance, weights, a)
    !! Return the factor on the step with which the last terms would be as large as allowed; 0 if
    !! they are not finite.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: local_tolerance
    real(dp), intent(in) :: weights(:)
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    real(dp) :: largest
    integer :: i, k

    fitting = LONGER
    do k = order - CHECKED + 1, order
      largest = 0.0_dp
      do i = 1, tape%n_unknowns
        ! NaN must not be lost in the maximum.
        if (.not. weights(i)*abs(a(k, FIRST_UNKNOWN - 1 + i)) <= largest) then
          largest = weights(i)*abs(a(k, FIRST_UNKNOWN - 1 + i))
        end if
        if (.not. largest <= huge(largest)) then
          fitting = 0.0_dp
          return
        end if
      end do
      if (largest > local_tolerance*fitting**(-k)) then
        fitting = exp((log(local_tolerance) - log(largest))/k)
      end if
    end do
  end function fitting

  subroutine converge(tape, order, smallest, a, powers, factor, is_singular)
    !! Reduce the factor on the step so that the series of every operation converges. The last terms
    !! of the unknowns alone do not show it: an exponential may be so small at the beginning of a
    !! step that it changes no digit, and large a little later. Its argument therefore changes by at
    !! most half the order, unless the exponential stays invisible; the terms of its series then
    !! decrease before the last. The derivative of a hyperbolic tangent may grow in the same way. A
    !! divisor, and the argument of a square root, must have no zero in the circle around the
    !! beginning of the step. `tape_powers` treats products of many factors.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: smallest !! unknown that matters
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    type(powers_t), intent(inout) :: powers
    real(dp), intent(inout) :: factor
    logical, intent(in), optional :: is_singular !! whether a zero is at the beginning of the step
    real(dp) :: most
    integer :: n

    if (.not. present(is_singular)) call resolve(tape, order, smallest, a, powers, factor)
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n))
        select case (tape%operations(1, n))
        case (EXPONENTIAL)
          most = max(0.5_dp*order, -a(0, first) - INVISIBLE)
          if (a(0, tape%operations(4, n) + 1) /= 0.0_dp) then
            ! It is constant while its argument is large.
            most = max(most, a(0, first) - LARGE_ARGUMENT)
          end if
          factor = limited(first, most, factor)
        case (TANGENT)
          ! The derivative decreases as exp(-2 abs(x)).
          factor = limited(first, max(0.25_dp*order, abs(a(0, first)) - 0.5_dp*INVISIBLE), factor)
        case (QUOTIENT)
          if (present(is_singular) .and. a(0, second) == 0.0_dp) cycle
          factor = limited(second, WITHIN_CIRCLE*abs(a(0, second)), factor)
        case (SQUARE_ROOT)
          if (present(is_singular) .and. a(0, first) == 0.0_dp) cycle
          factor = limited(first, WITHIN_CIRCLE*a(0, first), factor)
        case default
          cycle
        end select
      end associate
    end do

  contains

    pure real(dp) function limited(slot, most, whole)
      !! Return the factor, reduced until a slot changes by at most `most` in the step's circle.
      integer, intent(in) :: slot
      real(dp), intent(in) :: most
      real(dp), intent(in) :: whole
      real(dp) :: change
      integer :: k

      limited = whole
      do
        change = 0.0_dp
        do k = order - 1, 1, -1
          change = limited*(change + abs(a(k, slot)))
        end do
        if (.not. change > most) return
        ! The change is a convex function of the factor, so that the quotient is small enough.
        limited = limited*max(0.5_dp, most/change)
        if (most >= 0.5_dp*change .or. .not. limited > 0.0_dp) return
      end do
    end function limited

  end subroutine converge

  pure integer function order_for(local_tolerance, powers, of_steps)
    !! Return the order with the least work for the requested digits (Jorba and Zou 2005), or the
    !! larger order that resolves powers.
    real(dp), intent(in) :: local_tolerance
    type(powers_t), intent(in) :: powers
    logical, intent(in) :: of_steps !! whether of single steps
    real(dp) :: factor

    factor = merge(ORDERS_OF_STEPS, ORDERS, of_steps)
    order_for = max(merge(LEAST_OF_STEPS, LEAST_ORDER, of_steps), powers%order, &
                    1 + ceiling(-factor*log(local_tolerance)))
    order_for = min(MOST_ORDER, order_for)
  end function order_for

  pure real(dp) function local_tolerance_of(tolerance, steps, with_attitude)
    !! Return the largest last terms. An error of omega becomes an error of the attitude, and of the
    !! phase, which grows with time. The weights are those of taylor_plan.f90 for 0.4 radians in a
    !! step.
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: steps !! expected number
    logical, intent(in) :: with_attitude
    real(dp) :: way, weight

    way = 0.12_dp*abs(steps)
    weight = 8.0_dp + way + way*(way/14.0_dp)
    if (with_attitude) weight = weight*(1.0_dp + way)
    local_tolerance_of = max(LEAST_LOCAL_TOLERANCE, tolerance/weight)
  end function local_tolerance_of

end module tape_plan

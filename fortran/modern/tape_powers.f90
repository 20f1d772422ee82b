module tape_powers
  !! Products of three factors and more, such as powers, whose series may not show in a few terms.
  !! An example is x**100, which changes no digit where x = 0.1, and is large where x = 1. A step is
  !! therefore so short that the mean order of a product's terms is below that of the series, unless
  !! the product stays invisible. The mean order of a product is the sum of those of its factors.
  use kinds, only: dp
  use operations, only: LINEAR, PRODUCT, QUOTIENT, SELECT_OF => SELECT, SQUARE_ROOT => SQRT, TABLE
  use tape, only: tape_t
  implicit none(type, external)
  private

  integer, parameter :: MANY = 3                  ! factors
  integer, parameter :: MOST_FACTORS = 1000       ! that are counted
  real(dp), parameter :: PART_OF_ORDER = 0.6_dp  ! largest mean order, over that of the series
  real(dp), parameter :: LEAST_NUMBER = 1e-300_dp ! whose logarithm is computed

  integer, parameter :: NONE = 0, SEVERAL = huge(1) ! divisors
  integer, parameter :: TOGETHER = 4 ! slots whose terms are summed

  ! What is below exp(-INVISIBLE), relative to the unknowns or to a divisor, changes no digit of a
  ! result, unless its factor is huge.
  real(dp), parameter, public :: INVISIBLE = 100.0_dp

  type, public :: powers_t
    ! (slots): minus the number of factors of a product of many factors, or of a part of it; 1 for
    ! any other factor of such a product; else 0
    integer, allocatable :: factors(:)
    ! (slots): logarithm of the largest coefficient with which a product of many factors is added
    ! to others; -huge if it is a factor of other products alone
    real(dp), allocatable :: scales(:)
    ! (slots): the divisor, or the argument of a square root, that the slot is a part of
    integer, allocatable :: divisors(:)
    real(dp), allocatable :: least(:) !! (slots): logarithm of the least product that matters
    ! (2, slots): logarithm of the sum of the absolute terms, and their mean order
    real(dp), allocatable :: shown(:, :)
    integer, allocatable :: alone(:) !! (slots): first those whose number of factors is above 0
    integer :: n_alone = 0           !! their number
    ! that shows the products of few factors where a factor and its first derivative are 0
    integer :: order = 0
  end type powers_t

  public :: find_powers, resolve

contains

  pure subroutine find_powers(tape, powers, failed)
    !! Find the products of many factors, and their factors.
    type(tape_t), intent(in) :: tape
    type(powers_t), intent(inout) :: powers
    integer, intent(out) :: failed !! not 0 if there is not enough memory
    integer :: i, n

    allocate (powers%factors(tape%n_slots), stat=failed)
    if (failed /= 0) return
    powers%factors = 1
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                 factors => powers%factors(tape%operations(4, n)))
        if (tape%operations(1, n) == PRODUCT) then
          factors = min(MOST_FACTORS, powers%factors(first) + powers%factors(second))
        else if (tape%operations(1, n) == LINEAR) then
          do i = tape%starts(first), tape%starts(first + 1) - 1
            factors = max(factors, powers%factors(tape%slots(i)))
          end do
        else if (tape%operations(1, n) == SELECT_OF) then
          ! Of both combinations.
          do i = tape%starts(second), tape%starts(second + 2) - 1
            factors = max(factors, powers%factors(tape%slots(i)))
          end do
        end if
      end associate
    end do
    ! Most torques have no such product, and need nothing else.
    if (maxval(powers%factors) < MANY) return
    allocate (powers%scales(tape%n_slots), stat=failed)
    if (failed /= 0) return
    allocate (powers%divisors(tape%n_slots), stat=failed)
    if (failed /= 0) return
    allocate (powers%least(tape%n_slots), stat=failed)
    if (failed /= 0) return
    allocate (powers%shown(2, tape%n_slots), stat=failed)
    if (failed /= 0) return
    allocate (powers%alone(tape%n_slots), stat=failed)
    if (failed /= 0) return
    call find_scales(tape, powers%scales)
    call find_divisors(tape, powers%divisors)
    call keep_many(tape, powers)
  end subroutine find_powers

  pure subroutine find_scales(tape, scales)
    !! Find the logarithm of the largest coefficient with which each slot is added to others, or 0
    !! where it is the argument of a function; -huge if it is a factor of products alone.
    type(tape_t), intent(in) :: tape
    real(dp), intent(out) :: scales(:) !! (slots)
    integer :: i, n

    scales = -huge(scales)
    do i = 1, size(tape%slots)
      associate (scale => scales(tape%slots(i)))
        scale = max(scale, logarithm(abs(tape%coefficients(i))))
      end associate
    end do
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n))
        select case (tape%operations(1, n))
        case (PRODUCT, LINEAR, TABLE, SELECT_OF)
          cycle
        case (QUOTIENT)
          scales(first) = max(0.0_dp, scales(first))
          scales(second) = max(0.0_dp, scales(second))
        case default
          scales(first) = max(0.0_dp, scales(first))
        end select
      end associate
    end do
  end subroutine find_scales

  pure subroutine find_divisors(tape, divisors)
    !! Find the divisor of the quotient that each slot is a part of, as in x**20/(k + x**20), where
    !! x**20 may be as small as k. The argument of a square root has the same role.
    type(tape_t), intent(in) :: tape
    integer, intent(out) :: divisors(:) !! (slots)
    integer :: i, n

    divisors = NONE
    do n = tape%n_operations, 1, -1
      associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                 of_result => divisors(tape%operations(4, n)))
        select case (tape%operations(1, n))
        case (QUOTIENT)
          divisors(first) = merged(divisors(first), second)
          divisors(second) = merged(divisors(second), second)
        case (SQUARE_ROOT)
          divisors(first) = merged(divisors(first), first)
        case (PRODUCT)
          divisors(first) = merged(divisors(first), of_result)
          divisors(second) = merged(divisors(second), of_result)
        case (LINEAR)
          do i = tape%starts(first), tape%starts(first + 1) - 1
            divisors(tape%slots(i)) = merged(divisors(tape%slots(i)), of_result)
          end do
        case (SELECT_OF)
          do i = tape%starts(second), tape%starts(second + 2) - 1
            divisors(tape%slots(i)) = merged(divisors(tape%slots(i)), of_result)
          end do
        case default
          cycle
        end select
      end associate
    end do
  end subroutine find_divisors

  pure integer function merged(one, other)
    !! Return the divisor of a slot that is a part of two quotients.
    integer, intent(in) :: one, other

    merged = max(one, other)
    if (one /= NONE .and. other /= NONE .and. one /= other) merged = SEVERAL
  end function merged

  pure subroutine keep_many(tape, powers)
    !! Set the number of factors to 0, except of products of many factors and of their factors.
    type(tape_t), intent(in) :: tape
    type(powers_t), intent(inout) :: powers
    logical :: is_product, is_part(tape%n_slots)
    integer :: n

    is_part = .false.
    do n = tape%n_operations, 1, -1
      associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                 out => tape%operations(4, n))
        is_product = tape%operations(1, n) == PRODUCT
        if (.not. is_product .or. powers%factors(out) < MANY) powers%scales(out) = -huge(0.0_dp)
        if (.not. is_product) cycle
        if (powers%scales(out) > -huge(0.0_dp)) then
          is_part(out) = .true.
          powers%order = max(powers%order, ceiling(2*powers%factors(out)/PART_OF_ORDER))
        end if
        is_part(first) = is_part(first) .or. is_part(out)
        is_part(second) = is_part(second) .or. is_part(out)
      end associate
    end do
    where (.not. is_part) powers%factors = 0
    do n = 1, tape%n_operations
      associate (factors => powers%factors(tape%operations(4, n)))
        if (tape%operations(1, n) == PRODUCT) factors = -factors
      end associate
    end do
    do n = 1, tape%n_slots
      if (powers%factors(n) <= 0) cycle
      powers%n_alone = powers%n_alone + 1
      powers%alone(powers%n_alone) = n
    end do
  end subroutine keep_many

  subroutine resolve(tape, order, smallest, a, powers, factor)
    !! Reduce the factor on the step so that products of many factors are resolved.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: smallest !! unknown that matters
    real(dp), intent(in) :: a(0:, :) !! (terms, slots)
    type(powers_t), intent(inout) :: powers
    real(dp), intent(inout) :: factor
    real(dp) :: largest
    logical :: has_least
    integer :: n

    if (powers%order == 0) return
    has_least = .false.
    do while (factor > 0.0_dp)
      do n = 1, powers%n_alone, TOGETHER
        call show(a(:order - 1, :), factor, &
                  powers%alone(n:min(n + TOGETHER - 1, powers%n_alone)), powers%shown)
      end do
      if (.not. has_least) then
        ! Where all means are small enough, it does not matter which products are visible.
        powers%least = -huge(0.0_dp)
        call find_largest()
        if (largest <= 1.0_dp) return
        call find_least()
        has_least = .true.
      end if
      do n = 1, powers%n_alone
        associate (total => powers%shown(1, powers%alone(n)))
          total = logarithm(total)
        end associate
      end do
      call find_largest()
      if (largest <= 1.0_dp) return
      if (largest <= 2.0_dp) then
        factor = factor*min(0.9_dp, 1.0_dp/largest)
      else
        factor = 0.5_dp*factor
      end if
    end do

  contains

    subroutine find_largest()
      !! Find the largest ratio of the mean order of a product that matters to the allowed order.
      integer :: n

      largest = 0.0_dp
      do n = 1, tape%n_operations
        associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                   out => tape%operations(4, n), shown => powers%shown)
          if (tape%operations(1, n) /= PRODUCT .or. powers%factors(out) == 0) cycle
          shown(:, out) = shown(:, first) + shown(:, second)
          ! NaN must not be lost in the maximum.
          if (shown(1, out) > powers%least(out) .and. .not. shown(2, out) <= largest) then
            largest = shown(2, out)
          end if
        end associate
      end do
      largest = largest/(PART_OF_ORDER*order)
    end subroutine find_largest

    subroutine find_least()
      !! Find the logarithms of the least products that matter.
      real(dp) :: visible
      integer :: n

      visible = min(0.0_dp, logarithm(smallest)) - INVISIBLE
      do n = 1, tape%n_slots
        associate (divisor => powers%divisors(n), least => powers%least(n))
          least = visible
          if (divisor == SEVERAL) then
            least = log(LEAST_NUMBER)
          else if (divisor /= NONE) then
            least = min(visible, logarithm(abs(a(0, divisor))) - INVISIBLE)
          end if
          least = max(log(LEAST_NUMBER), least) - powers%scales(n)
        end associate
      end do
    end subroutine find_least

  end subroutine resolve

  pure subroutine show(terms, factor, slots, shown)
    !! Compute the sums of the absolute terms of some slots, and their mean orders. No addition
    !! waits for that of another slot.
    real(dp), intent(in) :: terms(0:, :)
    real(dp), intent(in) :: factor        !! on the step
    integer, intent(in) :: slots(:)       !! at most TOGETHER
    real(dp), intent(inout) :: shown(:, :)
    real(dp) :: total(TOGETHER), weighted(TOGETHER)
    integer :: each(TOGETHER), i, k

    do i = 1, TOGETHER
      each(i) = slots(min(i, size(slots)))
    end do
    total = 0.0_dp
    weighted = 0.0_dp
    do k = ubound(terms, 1), 0, -1
      do i = 1, TOGETHER
        weighted(i) = factor*weighted(i) + total(i)
        total(i) = factor*total(i) + abs(terms(k, each(i)))
      end do
    end do
    do i = 1, size(slots)
      shown(:, slots(i)) = [total(i), factor*weighted(i)/max(LEAST_NUMBER, total(i))]
    end do
  end subroutine show

  pure real(dp) function logarithm(x)
    real(dp), intent(in) :: x

    logarithm = log(max(LEAST_NUMBER, x))
  end function logarithm

end module tape_powers

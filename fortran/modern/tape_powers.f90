module tape_powers
  !! Products of three factors and more, such as powers, whose series may not show in a few terms.
  !! An example is x**100, which changes no digit where x = 0.1, and is large where x = 1. A step is
  !! therefore so short that the mean order of a product's terms is below that of the series, unless
  !! the product stays invisible. The mean order of a product is the sum of those of its factors.
  use kinds, only: dp
  use operations, only: LINEAR, PRODUCT, QUOTIENT, TABLE
  use tape, only: tape_t
  implicit none(type, external)
  private

  integer, parameter :: MANY = 3                  ! factors
  integer, parameter :: MOST_FACTORS = 1000       ! that are counted
  real(dp), parameter :: PART_OF_ORDER = 0.6_dp  ! largest mean order, over that of the series
  real(dp), parameter :: SMALLEST = 1e-300_dp     ! whose logarithm is computed

  ! What is below exp(-INVISIBLE) changes no digit of a result, unless its factor is huge.
  real(dp), parameter, public :: INVISIBLE = 100.0_dp

  type, public :: powers_t
    ! (slots): the factors of a product that is of many factors, or part of one; otherwise 0
    integer, allocatable :: factors(:)
    ! (slots): logarithm of the largest coefficient with which a product of many factors is added
    ! to others; -huge if it is a factor of other products alone
    real(dp), allocatable :: scales(:)
    integer :: order = 0 !! that shows the products where a factor or its first derivative is 0
  end type powers_t

  public :: find_powers, resolving

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
        end if
      end associate
    end do
    ! Most torques have no such product, and need nothing else.
    if (maxval(powers%factors) < MANY) return
    allocate (powers%scales(tape%n_slots), stat=failed)
    if (failed /= 0) return
    call find_scales(tape, powers%scales)
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
        case (PRODUCT, LINEAR, TABLE)
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

  pure subroutine keep_many(tape, powers)
    !! Set the number of factors of all others than products of many factors, and their factors, to
    !! 0.
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
  end subroutine keep_many

  pure real(dp) function resolving(tape, order, powers, a, factor)
    !! Return the factor on the step, reduced so that products of many factors are resolved.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    type(powers_t), intent(in) :: powers
    real(dp), intent(in) :: a(0:, :)   !! (terms, slots)
    real(dp), intent(in) :: factor
    ! (2, slots): logarithm of the sum of the absolute terms, and their mean order
    real(dp), allocatable :: shown(:, :)
    real(dp) :: largest
    integer :: failed, n

    resolving = factor
    if (powers%order == 0) return
    allocate (shown(2, tape%n_slots), stat=failed)
    if (failed /= 0) resolving = 0.0_dp
    do while (resolving > 0.0_dp)
      do n = 1, tape%n_slots
        if (powers%factors(n) == 0) cycle
        shown(:, n) = size_and_mean(a(:order - 1, n), resolving)
      end do
      largest = 0.0_dp
      do n = 1, tape%n_operations
        associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                   out => tape%operations(4, n))
          if (tape%operations(1, n) /= PRODUCT .or. powers%factors(out) == 0) cycle
          shown(:, out) = shown(:, first) + shown(:, second)
          if (shown(1, out) <= -INVISIBLE - powers%scales(out)) cycle
          ! NaN must not be lost in the maximum.
          if (.not. shown(2, out) <= largest) largest = shown(2, out)
        end associate
      end do
      largest = largest/(PART_OF_ORDER*order)
      if (largest <= 1.0_dp) return
      resolving = resolving*max(0.5_dp, min(0.9_dp, 1.0_dp/largest))
    end do
  end function resolving

  pure function size_and_mean(terms, factor)
    !! Return the logarithm of the sum of the absolute terms, and their mean order.
    real(dp), intent(in) :: terms(0:)
    real(dp), intent(in) :: factor !! on the step
    real(dp) :: size_and_mean(2)
    real(dp) :: total, weighted
    integer :: k

    total = 0.0_dp
    weighted = 0.0_dp
    do k = ubound(terms, 1), 0, -1
      weighted = factor*weighted + total
      total = factor*total + abs(terms(k))
    end do
    size_and_mean = [logarithm(total), factor*weighted/max(SMALLEST, total)]
  end function size_and_mean

  pure real(dp) function logarithm(x)
    real(dp), intent(in) :: x

    logarithm = log(max(SMALLEST, x))
  end function logarithm

end module tape_powers

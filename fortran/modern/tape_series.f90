module tape_series
  !! Taylor series of all slots of a tape (Jorba and Zou 2005, section 2), and of perturbations of
  !! the unknowns. A term includes its power of the step.
  use kinds, only: dp
  use operations, only: EXPONENTIAL => EXP, LINEAR, PRODUCT, QUOTIENT, SINE_COSINE, &
                        SQUARE_ROOT => SQRT, TABLE
  use tape, only: FIRST_UNKNOWN, piece_at, tape_t, TIME_SLOT
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_ORDER = 28
  ! A product sums four terms at once, and may read three terms beyond its last.
  integer, parameter, public :: LAST_TERM = MOST_ORDER + 3
  integer, parameter :: CUBIC_TERMS = 4
  real(dp), parameter :: EPSILON_OF_FUNCTION = 2.0_dp ! rounding error of a function, in units
  ! Largest terms of perturbations that a step leaves out, relative.
  real(dp), parameter, public :: VARIATION_TOLERANCE = 1e-3_dp

  ! Taylor series around the beginning of a step.
  type, public :: series_t
    real(dp) :: h                           !! s; a term includes its power of it
    integer :: order
    real(dp), allocatable :: a(:, :)        !! (0:LAST_TERM, slots): terms in ascending order
    real(dp), allocatable :: b(:, :)        !! b(MOST_ORDER - k, :) = a(k, :)
    ! (4, 0:MOST_ORDER, slots, 2): terms of perturbations, of which four are side by side
    real(dp), allocatable :: v(:, :, :, :)
    real(dp), allocatable :: noise(:)       !! (slots): rounding errors of terms 0, in units
  end type series_t

  public :: allocate_series, expand, noise_of, propagate

contains

  pure subroutine allocate_series(n_slots, s, fits)
    !! Allocate the terms of all slots.
    integer, intent(in) :: n_slots
    type(series_t), intent(inout) :: s
    logical, intent(out) :: fits !! whether there is enough memory
    integer :: failed

    fits = .false.
    allocate (s%a(0:LAST_TERM, n_slots), stat=failed)
    if (failed /= 0) return
    allocate (s%b(0:LAST_TERM, n_slots), stat=failed)
    if (failed /= 0) return
    allocate (s%v(4, 0:MOST_ORDER, n_slots, 2), stat=failed)
    if (failed /= 0) return
    allocate (s%noise(n_slots), stat=failed)
    if (failed /= 0) return
    fits = .true.
  end subroutine allocate_series

  pure subroutine expand(tape, t_low, s)
    !! Compute the terms of all slots, and those of the unknowns up to the order. Terms 0 of the
    !! time and of the unknowns are inputs, and so is term 1 of the time.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low  !! rounding error of the time, s
    type(series_t), intent(inout) :: s

    call expand_terms(tape, t_low, s%h, s%order, s%a, s%b)
  end subroutine expand

  pure subroutine expand_terms(tape, t_low, h, order, a, b)
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    integer, intent(in) :: order
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots) !! terms in ascending order
    real(dp), intent(inout) :: b(0:LAST_TERM, tape%n_slots) !! b(MOST_ORDER - k) = a(k)
    integer :: i, k, n, out
    real(dp) :: x, y

    do k = 0, order - 1
      do n = 1, tape%n_operations
        associate (first => tape%operations(2, n), second => tape%operations(3, n))
          out = tape%operations(4, n)
          select case (tape%operations(1, n))
          case (LINEAR)
            x = combined(tape, first, k, a)
          case (PRODUCT)
            x = convolved(k, a(:, first), b(:, second))
          case (QUOTIENT)
            b(MOST_ORDER - k, out) = 0.0_dp
            x = (a(k, first) - convolved(k, a(:, second), b(:, out)))/a(0, second)
          case (SQUARE_ROOT)
            if (k == 0) then
              x = sqrt(a(0, first))
            else
              a(k, out) = 0.0_dp
              b(MOST_ORDER - k, out) = 0.0_dp
              x = (a(k, first) - convolved(k, a(:, out), b(:, out)))/(2.0_dp*a(0, out))
            end if
          case (EXPONENTIAL)
            a(k, out + 1) = k*a(k, first)
            if (k == 0) then
              x = exp(a(0, first))
            else
              b(MOST_ORDER - k, out) = 0.0_dp
              x = convolved(k, a(:, out + 1), b(:, out))/k
            end if
          case (TABLE)
            if (k == 0) call set_table_terms(tape, first, a(0, TIME_SLOT), t_low, h, a(:, out))
            x = 0.0_dp
            if (k < CUBIC_TERMS) x = a(k, out)
          case default
            a(k, out + 2) = k*a(k, first)
            if (k == 0) then
              if (second > 0) then
                call sine_cosine_of(tape%coefficients(tape%starts(second)), a(0, TIME_SLOT), &
                                    t_low, x, y)
              else
                x = sin(a(0, first))
                y = cos(a(0, first))
              end if
            else
              b(MOST_ORDER - k, out) = 0.0_dp
              b(MOST_ORDER - k, out + 1) = 0.0_dp
              x = convolved(k, a(:, out + 2), b(:, out + 1))/k
              y = -convolved(k, a(:, out + 2), b(:, out))/k
            end if
            a(k, out + 1) = y
            b(MOST_ORDER - k, out + 1) = y
          end select
        end associate
        a(k, out) = x
        b(MOST_ORDER - k, out) = x
      end do
      do i = 1, tape%n_unknowns
        x = (h/(k + 1))*combined(tape, size(tape%constants) - tape%n_unknowns + i, k, a)
        out = FIRST_UNKNOWN - 1 + i
        a(k + 1, out) = x
        b(MOST_ORDER - k - 1, out) = x
      end do
    end do
  end subroutine expand_terms

  pure subroutine set_table_terms(tape, number, t, t_low, h, terms)
    !! Compute the terms of a table, which are those of a cubic polynomial.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: number         !! of the table
    real(dp), intent(in) :: t, t_low, h   !! s
    real(dp), intent(inout) :: terms(0:LAST_TERM)
    real(dp) :: u                         ! since the breakpoint, s
    integer :: n

    n = piece_at(tape, number, t, h > 0.0_dp)
    u = (t - tape%breaks(n)) + t_low
    associate (c => tape%pieces(:, n))
      terms(0) = c(1) + u*(c(2) + u*(c(3) + u*c(4)))
      terms(1) = h*(c(2) + u*(2.0_dp*c(3) + 3.0_dp*u*c(4)))
      terms(2) = h*h*(c(3) + 3.0_dp*u*c(4))
      terms(3) = h*h*h*c(4)
    end associate
  end subroutine set_table_terms

  pure real(dp) function convolved(k, a, b)
    !! Return term k of the product of two series. Four sums side by side fill a register.
    integer, intent(in) :: k
    real(dp), intent(in) :: a(0:LAST_TERM) !! in ascending order
    real(dp), intent(in) :: b(0:LAST_TERM) !! descending; beyond the first term 0
    real(dp) :: x1, x2, x3, x4
    integer :: j

    x1 = 0.0_dp
    x2 = 0.0_dp
    x3 = 0.0_dp
    x4 = 0.0_dp
    do j = 0, k, 4
      x1 = x1 + a(j)*b(MOST_ORDER - k + j)
      x2 = x2 + a(j + 1)*b(MOST_ORDER - k + j + 1)
      x3 = x3 + a(j + 2)*b(MOST_ORDER - k + j + 2)
      x4 = x4 + a(j + 3)*b(MOST_ORDER - k + j + 3)
    end do
    convolved = (x1 + x2) + (x3 + x4)
  end function convolved

  pure real(dp) function combined(tape, n, k, a)
    !! Return term k of linear combination n.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n, k
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    integer :: i

    combined = 0.0_dp
    if (k == 0) combined = tape%constants(n)
    do i = tape%starts(n), tape%starts(n + 1) - 1
      combined = combined + tape%coefficients(i)*a(k, tape%slots(i))
    end do
  end function combined

  pure subroutine propagate(tape, s, factor, weights, block, last, short)
    !! Expand the four perturbations of a block, whose values are in the terms 0 of the unknowns, to
    !! as many terms as they need.
    type(tape_t), intent(in) :: tape
    type(series_t), intent(inout) :: s
    real(dp), intent(in) :: factor     !! the step over h
    real(dp), intent(in) :: weights(:) !! of the unknowns, which make them comparable
    integer, intent(in) :: block       !! 1 or 2; the first perturbation of block 1 is the error
    integer, intent(out) :: last       !! the last term
    logical, intent(out) :: short      !! whether all terms do not suffice for the step
    real(dp) :: power, size_0, size_k, before
    integer :: k

    size_0 = size_of(0)
    before = size_0
    power = 1.0_dp
    do k = 0, s%order - 1
      call propagate_term(tape, k, s%h, s%a, s%b, s%v(:, :, :, block))
      last = k + 1
      power = power*factor
      size_k = power*size_of(last)
      ! Every other term may be zero.
      short = .not. max(size_k, before) <= VARIATION_TOLERANCE*size_0
      if (.not. short) return
      before = size_k
    end do

  contains

    pure real(dp) function size_of(k)
      integer, intent(in) :: k
      integer :: i, lane

      ! The error may be zero.
      size_of = 0.0_dp
      do i = 1, tape%n_unknowns
        do lane = merge(2, 1, block == 1), 4
          size_of = max(size_of, weights(i)*abs(s%v(lane, k, FIRST_UNKNOWN - 1 + i, block)))
        end do
      end do
    end function size_of

  end subroutine propagate

  pure subroutine propagate_term(tape, k, h, a, b, v)
    !! Compute terms k of four perturbations of all slots, and terms k + 1 of the unknowns.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: k
    real(dp), intent(in) :: h  !! s
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots), b(0:LAST_TERM, tape%n_slots)
    real(dp), intent(inout) :: v(4, 0:MOST_ORDER, tape%n_slots)
    real(dp) :: x(4), y(4)
    integer :: i, n, out

    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n))
        out = tape%operations(4, n)
        x = 0.0_dp
        select case (tape%operations(1, n))
        case (LINEAR)
          call combine(tape, first, k, v, x)
        case (PRODUCT)
          call convolve(k, v(:, :, first), b(:, second), x)
          call convolve(k, v(:, :, second), b(:, first), x)
        case (QUOTIENT)
          call convolve(k, v(:, :, second), b(:, out), x)
          call convolve_before(k, v(:, :, out), b(:, second), x)
          x = (v(:, k, first) - x)/a(0, second)
        case (SQUARE_ROOT)
          call convolve_before(k, v(:, :, out), b(:, out), x)
          x = (0.5_dp*v(:, k, first) - x)/a(0, out)
        case (EXPONENTIAL)
          call convolve(k, v(:, :, first), b(:, out), x)
        case (TABLE)
          continue
        case default
          y = 0.0_dp
          call convolve(k, v(:, :, first), b(:, out + 1), x)
          call convolve(k, v(:, :, first), b(:, out), y)
          v(:, k, out + 1) = -y
        end select
        v(:, k, out) = x
      end associate
    end do
    do i = 1, tape%n_unknowns
      x = 0.0_dp
      call combine(tape, size(tape%constants) - tape%n_unknowns + i, k, v, x)
      v(:, k + 1, FIRST_UNKNOWN - 1 + i) = (h/(k + 1))*x
    end do
  end subroutine propagate_term

  pure subroutine combine(tape, n, k, v, x)
    !! Add term k of the perturbations of linear combination n.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n, k
    real(dp), intent(in) :: v(4, 0:MOST_ORDER, tape%n_slots)
    real(dp), intent(inout) :: x(4)
    integer :: i

    do i = tape%starts(n), tape%starts(n + 1) - 1
      x = x + tape%coefficients(i)*v(:, k, tape%slots(i))
    end do
  end subroutine combine

  pure subroutine convolve(k, v, b, x)
    !! Add term k of the products of four series with one.
    integer, intent(in) :: k
    real(dp), intent(in) :: v(4, 0:MOST_ORDER)
    real(dp), intent(in) :: b(0:LAST_TERM) !! in descending order
    real(dp), intent(inout) :: x(4)

    call convolve_before(k, v, b, x)
    x = x + v(:, k)*b(MOST_ORDER)
  end subroutine convolve

  pure subroutine convolve_before(k, v, b, x)
    !! Add the same without the product of term k of the four with term 0 of the one.
    integer, intent(in) :: k
    real(dp), intent(in) :: v(4, 0:MOST_ORDER)
    real(dp), intent(in) :: b(0:LAST_TERM) !! in descending order
    real(dp), intent(inout) :: x(4)
    real(dp) :: x1, x2, x3, x4
    integer :: j

    x1 = x(1)
    x2 = x(2)
    x3 = x(3)
    x4 = x(4)
    do j = 0, k - 1
      x1 = x1 + v(1, j)*b(MOST_ORDER - k + j)
      x2 = x2 + v(2, j)*b(MOST_ORDER - k + j)
      x3 = x3 + v(3, j)*b(MOST_ORDER - k + j)
      x4 = x4 + v(4, j)*b(MOST_ORDER - k + j)
    end do
    x = [x1, x2, x3, x4]
  end subroutine convolve_before

  pure subroutine noise_of(tape, s, noise)
    !! Compute bounds of the rounding errors of the derivatives of the unknowns, in units of the
    !! rounding error of 1, by running error analysis of terms 0 (Higham 2002, section 3.3). The
    !! time and the unknowns are taken as exact.
    type(tape_t), intent(in) :: tape
    type(series_t), intent(inout) :: s
    real(dp), intent(out) :: noise(:)
    integer :: i, n, out

    s%noise = 0.0_dp
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n))
        out = tape%operations(4, n)
        select case (tape%operations(1, n))
        case (LINEAR)
          s%noise(out) = of_combination(first)
        case (PRODUCT)
          s%noise(out) = abs(s%a(0, out)) + abs(s%a(0, first))*s%noise(second) &
                         + abs(s%a(0, second))*s%noise(first)
        case (QUOTIENT)
          s%noise(out) = abs(s%a(0, out)) &
                         + (s%noise(first) + abs(s%a(0, out))*s%noise(second)) &
                         /abs(s%a(0, second))
        case (SQUARE_ROOT)
          s%noise(out) = abs(s%a(0, out)) + s%noise(first)/(2.0_dp*abs(s%a(0, out)))
        case (EXPONENTIAL)
          s%noise(out) = abs(s%a(0, out))*(EPSILON_OF_FUNCTION + s%noise(first))
        case (TABLE)
          s%noise(out) = EPSILON_OF_FUNCTION*abs(s%a(0, out))
        case default
          s%noise(out) = EPSILON_OF_FUNCTION
          s%noise(out + 1) = EPSILON_OF_FUNCTION
          ! An angle proportional to time has no rounding error.
          if (second == 0) then
            s%noise(out) = s%noise(out) + abs(s%a(0, out + 1))*s%noise(first)
            s%noise(out + 1) = s%noise(out + 1) + abs(s%a(0, out))*s%noise(first)
          end if
        end select
      end associate
    end do
    do i = 1, tape%n_unknowns
      noise(i) = of_combination(size(tape%constants) - tape%n_unknowns + i)
    end do

  contains

    pure real(dp) function of_combination(n)
      integer, intent(in) :: n
      integer :: i

      of_combination = 0.0_dp
      ! One term alone is rounded once, and the multiplication by 1 not at all.
      do i = tape%starts(n), tape%starts(n + 1) - 1
        of_combination = of_combination + abs(tape%coefficients(i)) &
                         *(abs(s%a(0, tape%slots(i))) + s%noise(tape%slots(i)))
      end do
      if (tape%starts(n + 1) > tape%starts(n)) then
        of_combination = of_combination + abs(tape%constants(n))
      end if
    end function of_combination

  end subroutine noise_of

end module tape_series

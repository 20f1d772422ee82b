module tape_values
  !! The values (terms 0) of all slots of a tape. Where the exponential of a large argument
  !! overflows but does not matter, a smaller number replaces it.
  use, intrinsic :: iso_c_binding, only: c_int
  use kinds, only: dp
  use operations, only: EXPONENTIAL => EXP, FLOOR_OF => FLOOR, LINEAR, LOGARITHM => LOG, PRODUCT, &
                        QUOTIENT, SELECT_OF => SELECT, SQUARE_ROOT => SQRT, SWITCH, TABLE, &
                        TANGENT => TANH
  use storage, only: SERIES_LENGTH
  use tape, only: FIRST_UNKNOWN, piece_at, tape_t, TIME_SLOT
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  integer, parameter, public :: LAST_TERM = SERIES_LENGTH - 1
  ! A value whose rounding error is a number too. Beyond it, exponentials of larger arguments than
  ! LARGE_ARGUMENT are saturated. They are all larger than the powers of 2 that replace them.
  real(dp), parameter :: LARGEST = 1e290_dp
  real(dp), parameter :: SMALL_ENOUGH = 1e20_dp ! for all powers of an exponential that are likely
  real(dp), parameter, public :: LARGE_ARGUMENT = 210.0_dp
  ! What replaces exponentials of large arguments: nothing, a power of 2, a larger one, moderate
  ! numbers, or powers of 2 that differ between operations (from ONE_WAY on).
  integer, parameter :: NONE = 0, EQUAL = 1, LARGE = 2, MODERATE = 3, ONE_WAY = 4, ANOTHER_WAY = 5
  integer, parameter :: LEAST_POWER = 167, MOST_POWER = 300, HUGE_POWER = 1000, APART = 600
  ! What replaces exponentials of small arguments, if these are LARGE and MODERATE.
  real(dp), parameter :: SMALL(LARGE:MODERATE) = 2.0_dp**[-303, -140]
  ! Relative change of time and unknowns, since a factor may be 0 by chance.
  real(dp), parameter :: MOVED = 2.0_dp**(-10)
  ! Largest part of a derivative that may depend on them.
  real(dp), parameter :: UNSEEN = 2.0_dp**(-150)

  interface
    pure real(dp) function function_of(kind, x, y, saturates) bind(c)
      !! Return the value of a function of C's library at x, where its derivative is y.
      import :: c_int, dp
      implicit none(type, external)
      integer(c_int), intent(in), value :: kind
      real(dp), intent(in), value :: x, y
      integer(c_int), intent(in), value :: saturates !! not 0: others may replace exponentials in y
    end function function_of
  end interface

  public :: chosen, find_values, value_of

contains

  pure subroutine find_values(tape, t_low, h, a, derivatives)
    !! Compute term 0 of all slots, all terms of the tables, and the derivatives of the unknowns.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots)
    real(dp), intent(out) :: derivatives(:)
    logical :: is_large
    integer :: i

    call set_values_with(tape, t_low, h, NONE, a, is_large)
    if (is_large) call saturate(tape, t_low, h, a)
    do i = 1, tape%n_unknowns
      derivatives(i) = value_of(tape, size(tape%constants) - tape%n_unknowns + i, a)
    end do
  end subroutine find_values

  pure subroutine saturate(tape, t_low, h, a)
    !! Replace large exponentials by smaller ones if a value overflows, unless a derivative shows a
    !! difference: a logistic function, or the reciprocal of a hyperbolic cosine, is finite where an
    !! exponential in it overflows.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots)
    real(dp) :: unknowns(tape%n_unknowns), time, most
    logical :: is_large, is_unseen
    integer :: i

    if (all(abs(a(0, :)) <= LARGEST)) return
    call compare_derivatives(tape, t_low, h, ONE_WAY, a, is_unseen)
    if (is_unseen) then
      time = a(0, TIME_SLOT)
      unknowns = [(a(0, FIRST_UNKNOWN - 1 + i), i=1, tape%n_unknowns)]
      most = maxval(abs(unknowns))
      if (most == 0.0_dp) most = 1.0_dp
      a(0, TIME_SLOT) = time + MOVED*h
      do i = 1, tape%n_unknowns
        a(0, FIRST_UNKNOWN - 1 + i) = unknowns(i) + MOVED*fraction_of(i)*most
      end do
      call compare_derivatives(tape, t_low, h, ANOTHER_WAY, a, is_unseen)
      a(0, TIME_SLOT) = time
      do i = 1, tape%n_unknowns
        a(0, FIRST_UNKNOWN - 1 + i) = unknowns(i)
      end do
    end if
    call set_values_with(tape, t_low, h, merge(EQUAL, NONE, is_unseen), a, is_large)
  end subroutine saturate

  pure subroutine compare_derivatives(tape, t_low, h, way, a, is_unseen)
    !! Compare the derivatives of the unknowns with different numbers in place of exponentials.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    integer, intent(in) :: way        !! ONE_WAY or ANOTHER_WAY
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots)
    logical, intent(out) :: is_unseen !! whether the exponentials do not matter
    real(dp), dimension(tape%n_unknowns) :: found, large_ones, scale

    call find_derivatives(tape, t_low, h, LARGE, a, large_ones)
    call find_derivatives(tape, t_low, h, MODERATE, a, scale)
    call find_derivatives(tape, t_low, h, way, a, found)
    ! NaN is not allowed, and a pole is no scale.
    where (.not. abs(scale) <= LARGEST) scale = 0.0_dp
    is_unseen = all(abs(found - large_ones) <= UNSEEN*max(abs(found), abs(scale)))
  end subroutine compare_derivatives

  pure real(dp) function replacement(powers, n)
    !! Return what replaces the exponential of a large argument that is operation n. Powers of 2 are
    !! rounded alike.
    integer, intent(in) :: powers, n

    select case (powers)
    case (EQUAL)
      replacement = 2.0_dp**MOST_POWER
    case (LARGE)
      replacement = 2.0_dp**HUGE_POWER
    case (MODERATE)
      replacement = 1.0_dp + fraction_of(n)
    case default
      replacement = 2.0_dp**(LEAST_POWER + int(APART*fraction_of(powers*n)))
    end select
  end function replacement

  pure real(dp) function fraction_of(n)
    !! Return a number from 0 to 1 that has no relation with those of other n.
    integer, intent(in) :: n

    fraction_of = modulo(1e4_dp*sin(real(n, dp)), 1.0_dp)
  end function fraction_of

  pure subroutine find_derivatives(tape, t_low, h, powers, a, derivatives)
    !! Compute the derivatives of the unknowns with powers of 2 in place of exponentials.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    integer, intent(in) :: powers
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots)
    real(dp), intent(out) :: derivatives(:)
    logical :: is_large
    integer :: i

    call set_values_with(tape, t_low, h, powers, a, is_large)
    do i = 1, size(derivatives)
      derivatives(i) = value_of(tape, size(tape%constants) - size(derivatives) + i, a)
    end do
  end subroutine find_derivatives

  pure subroutine set_values_with(tape, t_low, h, powers, a, is_large)
    !! Compute term 0 of all slots, and all terms of the tables.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    integer, intent(in) :: powers     !! in place of exponentials: NONE, EQUAL, LARGE, ...
    real(dp), intent(inout) :: a(0:LAST_TERM, tape%n_slots)
    logical, intent(out) :: is_large  !! whether an exponential or its powers may overflow
    integer :: n

    is_large = .false.
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                 out => tape%operations(4, n))
        select case (tape%operations(1, n))
        case (LINEAR)
          a(0, out) = value_of(tape, first, a)
        case (PRODUCT)
          a(0, out) = a(0, first)*a(0, second)
        case (QUOTIENT)
          a(0, out) = a(0, first)/a(0, second)
        case (SQUARE_ROOT)
          a(0, out) = sqrt(a(0, first))
        case (EXPONENTIAL)
          ! Term 0 of the second slot says that the exponential is constant.
          a(0, out + 1) = merge(1.0_dp, 0.0_dp, powers /= NONE .and. a(0, first) > LARGE_ARGUMENT)
          if (a(0, out + 1) /= 0.0_dp) then
            a(0, out) = replacement(powers, n)
          else if (any(powers == [LARGE, MODERATE]) .and. a(0, first) < -LARGE_ARGUMENT) then
            ! A product with a large one may be of any size.
            a(0, out) = SMALL(powers)
          else
            a(0, out) = exp(a(0, first))
          end if
          if (.not. a(0, out) <= SMALL_ENOUGH) is_large = .true.
        case (TANGENT)
          a(0, out) = tanh(a(0, first))
          ! The square of the tangent may be rounded to 1.
          a(0, out + 1) = (2.0_dp/(exp(abs(a(0, first))) + exp(-abs(a(0, first)))))**2
        case (TABLE)
          call set_table_terms(tape, first, a(0, TIME_SLOT), t_low, h, a(:, out))
        case (LOGARITHM:)
          a(0, out) = function_of(tape%operations(1, n), a(0, first), a(0, second), &
                                  merge(1, 0, powers /= NONE))
        case (SWITCH, FLOOR_OF)
          ! The caller sets the result.
          cycle
        case (SELECT_OF)
          a(0, out) = value_of(tape, chosen(tape, n, a), a)
        case default
          if (second > 0) then
            call sine_cosine_of(tape%coefficients(tape%starts(second)), a(0, TIME_SLOT), t_low, &
                                a(0, out), a(0, out + 1))
          else
            a(0, out) = sin(a(0, first))
            a(0, out + 1) = cos(a(0, first))
          end if
        end select
      end associate
    end do
  end subroutine set_values_with

  pure integer function chosen(tape, n, a)
    !! Return the combination that an operation SELECT chooses.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n !! number of the operation
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)

    chosen = tape%operations(3, n)
    if (a(0, tape%operations(2, n)) == 0.0_dp) chosen = chosen + 1
  end function chosen

  pure subroutine set_table_terms(tape, number, t, t_low, h, terms)
    !! Compute the terms of a table, which are those of a cubic polynomial.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: number         !! of the table
    real(dp), intent(in) :: t, t_low, h   !! s
    real(dp), intent(out) :: terms(0:LAST_TERM)
    real(dp) :: u                         ! since the breakpoint, s
    integer :: n

    n = piece_at(tape, number, t, h > 0.0_dp)
    u = (t - tape%breaks(n)) + t_low
    terms = 0.0_dp
    associate (c => tape%pieces(:, n))
      terms(0) = c(1) + u*(c(2) + u*(c(3) + u*c(4)))
      terms(1) = h*(c(2) + u*(2.0_dp*c(3) + 3.0_dp*u*c(4)))
      terms(2) = h*h*(c(3) + 3.0_dp*u*c(4))
      terms(3) = h*h*h*c(4)
    end associate
  end subroutine set_table_terms

  pure real(dp) function value_of(tape, n, a)
    !! Return term 0 of linear combination n.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    integer :: i

    value_of = tape%constants(n)
    do i = tape%starts(n), tape%starts(n + 1) - 1
      value_of = value_of + tape%coefficients(i)*a(0, tape%slots(i))
    end do
  end function value_of

end module tape_values

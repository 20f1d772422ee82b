module tape_series
  !! Taylor series of all slots of a tape (Jorba and Zou 2005, section 2), and of perturbations of
  !! the unknowns. A term includes its power of the step.
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_intptr_t
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use operations, only: ARCSINE => ASIN, ARCTANGENT => ATAN, EXPONENTIAL => EXP, &
                        FLOOR_OF => FLOOR, LINEAR, LOGARITHM => LOG, PRODUCT, QUOTIENT, &
                        SELECT_OF => SELECT, SINE_COSINE, SQUARE_ROOT => SQRT, SWITCH, TABLE, &
                        TANGENT => TANH
  use storage, only: PERTURBATION_LENGTH, SERIES_LENGTH
  use tape, only: arrays_of, FIRST_UNKNOWN, N_INPUTS, piece_at, tape_arrays_t, tape_t, TIME_SLOT
  use tape_growth, only: MOST_UNKNOWNS
  use tape_powers, only: find_powers, powers_t
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_ORDER = PERTURBATION_LENGTH - 1
  integer, parameter, public :: LAST_TERM = SERIES_LENGTH - 1
  integer, parameter, public :: SIDE_BY_SIDE = 8       ! perturbations in a register
  integer, parameter :: BYTES = 8                      ! of a number
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
  ! Largest terms of perturbations that a step leaves out, relative.
  real(dp), parameter, public :: VARIATION_TOLERANCE = 1e-3_dp

  integer, parameter, public :: PADDED = 4*((MOST_UNKNOWNS + 3)/4) !! unknowns, four side by side

  ! Blocks of perturbations: the error, and one for each unknown.
  integer, parameter, public :: MOST_BLOCKS = (MOST_UNKNOWNS + SIDE_BY_SIDE)/SIDE_BY_SIDE
  integer, parameter, public :: BLOCKS_OF_COLUMNS = (MOST_UNKNOWNS + SIDE_BY_SIDE - 1)/SIDE_BY_SIDE

  ! Taylor series around the beginning of a step.
  type, public :: series_t
    real(dp) :: h                           !! s; a term includes its power of it
    integer :: order
    ! (0:LAST_TERM, slots): terms in ascending order
    real(dp), pointer, contiguous :: a(:, :) => null()
    ! (SIDE_BY_SIDE, 0:MOST_ORDER, slots, blocks): perturbations
    real(dp), pointer, contiguous :: blocks(:, :, :, :) => null()
    real(dp), allocatable :: noise(:)       !! (slots): rounding errors of terms 0, in units
    type(powers_t) :: powers
    type(tape_arrays_t) :: arrays           !! what tape_terms.c reads of the tape
    !! Combinations that matter beside the rates; 0 for none.
    integer, pointer, contiguous :: forcings(:, :) => null()
  end type series_t

  ! Derivatives of the unknowns with respect to eight parameters, side by side.
  type, bind(c), public :: block_t
    type(tape_arrays_t) :: arrays  !! what tape_terms.c reads of the tape
    !! The combination that is the partial derivative of a rate; 0 for none.
    integer(c_int) :: forcings(SIDE_BY_SIDE, MOST_UNKNOWNS)
    integer(c_int) :: last_term    !! of the series in this step
    real(c_double) :: sizes(SIDE_BY_SIDE) !! largest derivatives so far, relative
  end type block_t

  interface
    pure integer(c_int64_t) function size_of_work(n_unknowns, n_operations, n_products, n_slots, &
                                                  n_terms) bind(c, name="size_of_work_level")
      !! Return the size of the working storage, in numbers.
      import :: c_int, c_int64_t
      implicit none(type, external)
      integer(c_int), intent(in), value :: n_unknowns, n_operations, n_products, n_slots
      integer(c_int), intent(in), value :: n_terms !! of all combinations
    end function size_of_work

    subroutine begin_work(tape, n_slots) bind(c, name="begin_work_level")
      !! Divide the working storage, and find the products of the tape.
      import :: c_int, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: n_slots
    end subroutine begin_work

    integer(c_int) function begin_values(tape, rates) bind(c, name="begin_values_level")
      !! Compute term 0 of all slots, and the derivatives of the unknowns, and return 1; or return
      !! 0, if it is not compiled.
      import :: c_int, dp, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      real(dp), intent(inout) :: rates(tape%n_unknowns)
    end function begin_values

    subroutine bound_noise(tape, n_slots, of_slots, noise, of_unknowns) &
      bind(c, name="bound_noise_level")
      !! Bound the rounding errors of the rates and, without leaves or with those of the unknowns,
      !! of all slots.
      import :: c_int, dp, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: n_slots
      real(dp), intent(inout) :: of_slots(n_slots)
      real(dp), intent(inout) :: noise(tape%n_unknowns)
      real(dp), intent(in), optional :: of_unknowns(tape%n_unknowns)
    end subroutine bound_noise

    subroutine expand_tape(tape, h, order) bind(c, name="expand_tape_level")
      !! Compute all terms of all slots from their terms 0, and from the time and the tables.
      import :: c_int, dp, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      real(dp), intent(in), value :: h
      integer(c_int), intent(in), value :: order
    end subroutine expand_tape

    subroutine sum_terms(tape, order, factor, changes, slopes, sizes) &
      bind(c, name="sum_terms_level")
      !! Sum the terms of the unknowns, the terms of their derivatives times h, and the absolute
      !! terms of the latter.
      import :: c_int, dp, PADDED, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: order
      real(dp), intent(in), value :: factor    !! the step over h
      real(dp), intent(inout) :: changes(PADDED), slopes(PADDED), sizes(PADDED)
    end subroutine sum_terms

    integer(c_int) function perturb_tape(tape, number, h, order, factor, weights, tolerance, &
                                         is_long) bind(c, name="perturb_tape_level")
      !! Expand the perturbations to as many terms as they need, and return the last one's number,
      !! negative if all terms do not suffice.
      import :: c_int, dp, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: number !! of the first perturbation; 0 is the error
      real(dp), intent(in), value :: h
      integer(c_int), intent(in), value :: order
      real(dp), intent(in), value :: factor    !! the step over h
      real(dp), intent(in) :: weights(tape%n_unknowns) !! make the unknowns comparable
      real(dp), intent(in), value :: tolerance !! of the terms that are left out, relative
      integer(c_int), intent(in), value :: is_long !! not 0: there are many steps
    end function perturb_tape

    subroutine jacobian_at(tape, h, parts, jacobian) bind(c, name="jacobian_at_level")
      !! Compute the Jacobian of the rates, times h, at four parts of the step: element
      !! (lane, i, block, part) is the derivative of rate i by the unknown of a lane.
      import :: dp, BLOCKS_OF_COLUMNS, MOST_UNKNOWNS, SIDE_BY_SIDE, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      real(dp), intent(in), value :: h
      real(dp), intent(in) :: parts(4)
      real(dp), intent(inout) :: jacobian(SIDE_BY_SIDE, MOST_UNKNOWNS, BLOCKS_OF_COLUMNS, 4)
    end subroutine jacobian_at

    subroutine slot_gradient(tape, slot, gradient) bind(c, name="slot_gradient_level")
      !! Compute the derivatives of term 0 of a slot by the unknowns.
      import :: c_int, dp, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: slot
      real(dp), intent(out) :: gradient(tape%n_unknowns)
    end subroutine slot_gradient

    real(dp) function vary_tape(block, h, order, factor, weights, tolerance) &
      bind(c, name="vary_tape_level")
      !! Compute the terms of derivatives with respect to parameters, as many as they need, and
      !! return the factor, reduced until all terms suffice; 0 if they are not finite.
      import :: block_t, c_int, dp, MOST_UNKNOWNS
      implicit none(type, external)
      type(block_t), intent(inout) :: block
      real(dp), intent(in), value :: h
      integer(c_int), intent(in), value :: order
      real(dp), intent(in), value :: factor    !! the step over h
      real(dp), intent(in) :: weights(MOST_UNKNOWNS) !! make the unknowns comparable
      real(dp), intent(in), value :: tolerance !! of the terms that are left out, relative
    end function vary_tape

    subroutine sum_perturbations(tape, last, factor, sums) bind(c, name="sum_perturbations_level")
      !! Sum the terms of the perturbations of the unknowns up to the last.
      import :: c_int, dp, SIDE_BY_SIDE, tape_arrays_t
      implicit none(type, external)
      type(tape_arrays_t), intent(in) :: tape
      integer(c_int), intent(in), value :: last
      real(dp), intent(in), value :: factor    !! the step over h
      real(dp), intent(inout) :: sums(SIDE_BY_SIDE, tape%n_unknowns)
    end subroutine sum_perturbations
  end interface

  public :: allocate_series, begin_work, chosen, derivatives_at, expand, jacobian_at, noise_of, &
            perturb_tape, slot_gradient, sum_perturbations, sum_terms, value_of, vary_tape

contains

  subroutine allocate_series(tape, n_blocks, n_perturbed, memory, s, fits)
    !! Allocate the terms of all slots, and of blocks of perturbations.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: n_blocks !! 0 for no perturbations
    integer, intent(in) :: n_perturbed !! slots with perturbations
    real(dp), allocatable, intent(inout), target :: memory(:) !! of the terms
    type(series_t), intent(inout) :: s
    logical, intent(out) :: fits !! whether there is enough memory
    type(c_ptr) :: perturbations, work
    integer(c_intptr_t) :: address ! in numbers
    integer(int64) :: at, n_terms, n_perturbations, n_work
    integer :: failed, n_given, n_products

    ! Results that nobody needs have a slot too.
    n_terms = (LAST_TERM + 1)*(1 + int(tape%n_slots, int64))
    n_perturbations = SIDE_BY_SIDE*(MOST_ORDER + 1)*int(n_perturbed, int64)*n_blocks
    n_products = count(tape%operations(1, :) == PRODUCT)
    n_work = size_of_work(tape%n_unknowns, tape%n_operations, n_products, tape%n_slots, &
                          size(tape%slots))
    fits = .false.
    allocate (memory(n_work + n_perturbations + n_terms + 2*SIDE_BY_SIDE), stat=failed)
    if (failed /= 0) return
    allocate (s%noise(tape%n_slots), stat=failed)
    if (failed /= 0) return
    call find_powers(tape, s%powers, failed)
    if (failed /= 0) return
    ! The working storage and the perturbations begin a line of the cache, and so does term 1 of
    ! each slot.
    address = transfer(c_loc(memory), address)/BYTES
    at = 1 + modulo(-address, int(SIDE_BY_SIDE, c_intptr_t))
    work = c_loc(memory(at))
    at = at + n_work
    perturbations = c_null_ptr
    if (n_blocks > 0) then
      s%blocks(1:SIDE_BY_SIDE, 0:MOST_ORDER, 1:n_perturbed, 1:n_blocks) => &
        memory(at:at + n_perturbations - 1)
      perturbations = c_loc(s%blocks)
    end if
    ! Of three unknowns, tape_terms.c leaves half of the lanes out; tiny numbers there cost time.
    if (tape%n_unknowns == 3) memory(at:at + n_perturbations - 1) = 0.0_dp
    at = at + n_perturbations + SIDE_BY_SIDE - 1
    n_given = (LAST_TERM + 1)*min(N_INPUTS, tape%n_slots)
    memory(at:at + n_given - 1) = 0.0_dp
    s%a(0:LAST_TERM, 1:tape%n_slots) => memory(at:at + n_terms - LAST_TERM - 2)
    s%arrays = arrays_of(tape, c_loc(s%a), perturbations, work)
    call begin_work(s%arrays, tape%n_slots)
    fits = .true.
  end subroutine allocate_series

  subroutine expand(tape, t_low, has_values, s)
    !! Compute the terms of all slots, and those of the unknowns up to the order. Terms 0 of the
    !! time and of the unknowns are inputs, and so is term 1 of the time.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low  !! rounding error of the time, s
    logical, intent(in) :: has_values !! whether terms 0 of all slots, and the tables, are inputs
    type(series_t), intent(inout) :: s
    real(dp) :: rates(tape%n_unknowns)

    if (.not. has_values) call set_values(tape, t_low, s%h, s, rates)
    call expand_tape(s%arrays, s%h, s%order)
  end subroutine expand

  subroutine derivatives_at(tape, t, y, h, s, derivatives)
    !! Compute the derivatives of the unknowns. Terms 0 of all slots, and the terms of the tables,
    !! are overwritten.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2)  !! time and its rounding error, s
    real(dp), intent(in) :: y(:)  !! unknowns
    real(dp), intent(in) :: h     !! points to the side of which the pieces of tables are taken
    type(series_t), intent(inout) :: s
    real(dp), intent(out) :: derivatives(:)

    s%a(0, TIME_SLOT) = t(1)
    s%a(0, FIRST_UNKNOWN:FIRST_UNKNOWN + size(y) - 1) = y
    call set_values(tape, t(2), h, s, derivatives)
  end subroutine derivatives_at

  subroutine set_values(tape, t_low, h, s, derivatives)
    !! Compute term 0 of all slots, all terms of the tables, and the derivatives of the unknowns.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t_low, h  !! s
    type(series_t), intent(inout) :: s
    real(dp), intent(out) :: derivatives(:)
    logical :: is_large
    integer :: i

    if (begin_values(s%arrays, derivatives) /= 0) return
    call set_values_with(tape, t_low, h, NONE, s%a, is_large)
    if (is_large) call saturate(tape, t_low, h, s%a)
    do i = 1, tape%n_unknowns
      derivatives(i) = value_of(tape, size(tape%constants) - tape%n_unknowns + i, s%a)
    end do
  end subroutine set_values

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
        case (LOGARITHM)
          a(0, out) = log(a(0, first))
        case (ARCTANGENT)
          a(0, out) = atan(a(0, first))
        case (ARCSINE)
          a(0, out) = asin(a(0, first))
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

  subroutine noise_of(s, noise, of_unknowns)
    !! Compute bounds of the rounding errors of the derivatives of the unknowns, in units of the
    !! rounding error of 1. Without `of_unknowns` the unknowns count as exact.
    type(series_t), intent(inout) :: s
    real(dp), intent(out) :: noise(:)
    real(dp), intent(in), optional :: of_unknowns(:) !! their rounding errors, in units

    call bound_noise(s%arrays, size(s%noise), s%noise, noise, of_unknowns)
  end subroutine noise_of

end module tape_series

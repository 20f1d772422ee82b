module tape_series
  !! Taylor series of all slots of a tape (Jorba and Zou 2005, section 2), and of perturbations of
  !! the unknowns. A term includes its power of the step.
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_intptr_t
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use operations, only: PRODUCT
  use storage, only: PERTURBATION_LENGTH
  use tape, only: arrays_of, FIRST_UNKNOWN, N_INPUTS, tape_arrays_t, tape_t, TIME_SLOT
  use tape_growth, only: MOST_UNKNOWNS
  use tape_powers, only: find_powers, powers_t
  use tape_values, only: find_values, LAST_TERM
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_ORDER = PERTURBATION_LENGTH - 1
  integer, parameter, public :: SIDE_BY_SIDE = 8       ! perturbations in a register
  integer, parameter :: BYTES = 8                      ! of a number
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
    type(tape_arrays_t) :: arrays           !! what the files in C read of the tape
    !! Combinations that matter beside the rates; 0 for none.
    integer, pointer, contiguous :: forcings(:, :) => null()
  end type series_t

  ! Derivatives of the unknowns with respect to eight parameters, side by side.
  type, bind(c), public :: block_t
    type(tape_arrays_t) :: arrays  !! what tape_variations.c reads of the tape
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

  public :: allocate_series, begin_work, derivatives_at, expand, jacobian_at, noise_of, &
            perturb_tape, slot_gradient, sum_perturbations, sum_terms, vary_tape

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
    ! Of three unknowns, tape_perturbations.c leaves out half of the lanes, where tiny numbers would
    ! cost time.
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

    if (begin_values(s%arrays, derivatives) /= 0) return
    call find_values(tape, t_low, h, s%a, derivatives)
  end subroutine set_values

  subroutine noise_of(s, noise, of_unknowns)
    !! Compute bounds of the rounding errors of the derivatives of the unknowns, in units of the
    !! rounding error of 1. Without `of_unknowns` the unknowns count as exact.
    type(series_t), intent(inout) :: s
    real(dp), intent(out) :: noise(:)
    real(dp), intent(in), optional :: of_unknowns(:) !! their rounding errors, in units

    call bound_noise(s%arrays, size(s%noise), s%noise, noise, of_unknowns)
  end subroutine noise_of

end module tape_series

module tape
  !! The equations of motion as a tape: a list of operations, each of which writes a slot. Slot 1 is
  !! the time, slots 2 to 4 are omega, and slots 5 to 8 are the attitude, a quaternion.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_loc, c_ptr
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: TIME_SLOT = 1
  integer, parameter, public :: FIRST_UNKNOWN = 2
  integer, parameter, public :: N_INPUTS = 8 !! time, omega and attitude
  ! A coarser tolerance saves no time, because integrations are repeated more often.
  real(dp), parameter, public :: COARSEST = 1e-3_dp

  type, public :: tape_t
    integer :: n_unknowns                            !! 3, or 7 with attitude; plus own states
    integer :: n_slots
    integer :: n_operations
    ! Kind, two operands and result. The operand of LINEAR is the number of its combination. Operand
    ! 2 of a sine and cosine is the number of the combination with the frequency if the angle is
    ! proportional to time, else 0.
    integer, pointer, contiguous :: operations(:, :)
    ! Linear combination number n has the terms starts(n) to starts(n + 1) - 1. The last
    ! n_unknowns combinations are the derivatives of the unknowns.
    integer, pointer, contiguous :: starts(:)
    integer, pointer, contiguous :: slots(:)         !! of the terms
    real(dp), pointer, contiguous :: coefficients(:) !! of the terms
    real(dp), pointer, contiguous :: constants(:)    !! of the combinations
    ! Table number n has the pieces table_starts(n) to table_starts(n + 1) - 1. Piece k is a cubic
    ! polynomial of t - breaks(k), which holds from breaks(k) to the next breakpoint. The first
    ! piece holds before its breakpoint too, and the last piece for all later times.
    integer, pointer, contiguous :: table_starts(:)
    real(dp), pointer, contiguous :: breaks(:)       !! s
    real(dp), pointer, contiguous :: pieces(:, :)    !! (4, :): coefficients in ascending order
    type(c_ptr) :: leaves                            !! compiled operations; null: interpreted
    logical :: has_attitude = .false. !! whether perturbations are those of omega and the attitude
  end type tape_t

  ! What C reads of a tape, and the terms that it computes.
  type, bind(c), public :: tape_arrays_t
    integer(c_int) :: n_unknowns, n_operations, n_combinations
    integer(c_int) :: has_attitude
    type(c_ptr) :: operations, starts, slots, coefficients, constants, a, v, work, leaves
  end type tape_arrays_t

  ! Many bodies under one torque, as tape_lanes.c reads them.
  type, bind(c), public :: tape_bodies_t
    type(tape_arrays_t) :: tape
    type(c_ptr) :: table_starts, breaks, pieces
    real(c_double) :: tolerance         !! relative, and of the angle of the attitude in rad
    integer(c_int) :: n_slots, n_tables
    integer(c_int) :: n                 !! number of bodies
    integer(c_int) :: n_times           !! sets of times: 1 or n
    integer(c_int) :: interrupted       !! out: not 0 if the user interrupted it
    type(c_ptr) :: omega0, attitude0    !! (3, n), rad/s; (4, n), unit quaternions
    type(c_ptr) :: times                !! (n_rows, n_times), s, ordered away from 0
    type(c_ptr) :: omega, attitude      !! (3, n_rows, n), (4, n_rows, n): results
    type(c_ptr) :: status               !! (n_rows, n), of one byte
    type(c_ptr) :: estimates            !! (2, n_rows, n): relative error, amplification; or null
    integer(c_int) :: n_parameters, n_sets !! sets of parameters: 0, 1 or n
    type(c_ptr) :: parameters           !! (n_parameters, n_sets): further inputs of the tape
    integer(c_int) :: n_rows            !! times of a body
    integer(c_int) :: n_own             !! own states
    type(c_ptr) :: own0, own_sizes      !! (n, n_own), (n_own)
    type(c_ptr) :: own                  !! (n_rows, n, n_own): results
  end type tape_bodies_t

  interface
    type(c_ptr) function leaves_at(number) bind(c, name="leaves_at")
      !! Return the compiled operations of a ready torque, or at an address; or null.
      import :: c_int64_t, c_ptr
      implicit none(type, external)
      integer(c_int64_t), intent(in), value :: number
    end function leaves_at
  end interface

  public :: arrays_of, next_break, piece_at, tape_of

contains

  function tape_of(numbers) result(tape)
    !! Return the tape that an array contains. Its first numbers are the counts of unknowns, slots,
    !! operations, combinations, terms, tables and pieces, and the number that `leaves_at` reads.
    !! The arrays of the tape follow: first the integers, two in the place of a number, then the
    !! other arrays.
    real(dp), intent(in), target :: numbers(0:)
    type(tape_t) :: tape
    integer, parameter :: COUNTS = 8
    integer, pointer, contiguous :: integers(:)
    integer :: n_combinations, n_terms, n_tables, n_pieces, at

    tape%n_unknowns = int(numbers(0))
    tape%n_slots = int(numbers(1))
    tape%n_operations = int(numbers(2))
    n_combinations = int(numbers(3))
    n_terms = int(numbers(4))
    n_tables = int(numbers(5))
    n_pieces = int(numbers(6))
    tape%leaves = leaves_at(transfer(numbers(7), 0_c_int64_t))
    at = COUNTS
    call take_integers(4*tape%n_operations)
    tape%operations(1:4, 1:tape%n_operations) => integers
    call take_integers(n_combinations + 1)
    tape%starts => integers
    call take_integers(n_terms)
    tape%slots => integers
    call take_integers(n_tables + 1)
    tape%table_starts => integers
    tape%coefficients => numbers(at:at + n_terms - 1)
    at = at + n_terms
    tape%constants => numbers(at:at + n_combinations - 1)
    at = at + n_combinations
    tape%breaks => numbers(at:at + n_pieces - 1)
    at = at + n_pieces
    tape%pieces(1:4, 1:n_pieces) => numbers(at:at + 4*n_pieces - 1)

  contains

    subroutine take_integers(n)
      integer, intent(in) :: n

      call c_f_pointer(c_loc(numbers(at)), integers, [n])
      at = at + (n + 1)/2
    end subroutine take_integers

  end function tape_of

  type(tape_arrays_t) function arrays_of(tape, a, v, work)
    !! Return what C reads of a tape.
    type(tape_t), intent(in) :: tape
    type(c_ptr), intent(in) :: a, v  !! the terms of the slots and of perturbations, as in series_t
    type(c_ptr), intent(in) :: work  !! storage, as begin_work of tape_terms.c divides it

    arrays_of = tape_arrays_t(tape%n_unknowns, tape%n_operations, size(tape%constants), &
                              merge(1, 0, tape%has_attitude), &
                              c_loc(tape%operations), c_loc(tape%starts), c_loc(tape%slots), &
                              c_loc(tape%coefficients), c_loc(tape%constants), a, v, work, &
                              tape%leaves)
  end function arrays_of

  pure integer function piece_at(tape, table, t, forward)
    !! Return the number of the piece that holds just after the time t, or just before it.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: table
    real(dp), intent(in) :: t        !! s
    logical, intent(in) :: forward   !! whether the step is towards later times
    integer :: low, high, middle

    low = tape%table_starts(table)
    high = tape%table_starts(table + 1)
    do while (high - low > 1)
      middle = (low + high)/2
      if (tape%breaks(middle) < t .or. (forward .and. tape%breaks(middle) <= t)) then
        low = middle
      else
        high = middle
      end if
    end do
    piece_at = low
  end function piece_at

  pure real(dp) function next_break(tape, t, t_end)
    !! Return the first breakpoint of any table between t and t_end; t_end if there is none.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t, t_end !! s
    logical :: forward
    integer :: n, place

    next_break = t_end
    forward = t_end > t
    do n = 1, size(tape%table_starts) - 1
      ! The breakpoint of the first piece is none, because this piece holds before it too.
      place = piece_at(tape, n, t, forward)
      if (forward .and. place < tape%table_starts(n + 1) - 1) then
        next_break = min(next_break, tape%breaks(place + 1))
      else if (.not. forward .and. place > tape%table_starts(n)) then
        next_break = max(next_break, tape%breaks(place))
      end if
    end do
  end function next_break

end module tape

module tape
  !! The equations of motion as a tape: a list of operations, each of which writes a slot. Slot 1 is
  !! the time, slots 2 to 4 are omega, and slots 5 to 8 are the attitude, a quaternion.
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: TIME_SLOT = 1
  integer, parameter, public :: FIRST_UNKNOWN = 2

  type, public :: tape_t
    integer :: n_unknowns                            !! 3, or 7 with attitude
    integer :: n_slots
    integer :: n_operations
    ! Kind, two operands and result. The operand of LINEAR is the number of its combination. Of a
    ! sine and cosine whose angle is proportional to time, operand 2 is the number of the
    ! combination that holds the frequency, else 0.
    integer, pointer, contiguous :: operations(:, :)
    ! Linear combination number n has the terms starts(n) to starts(n + 1) - 1. The last
    ! n_unknowns combinations are the derivatives of the unknowns.
    integer, pointer, contiguous :: starts(:)
    integer, pointer, contiguous :: slots(:)         !! of the terms
    real(dp), pointer, contiguous :: coefficients(:) !! of the terms
    real(dp), pointer, contiguous :: constants(:)    !! of the combinations
  end type tape_t

end module tape

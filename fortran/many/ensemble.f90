module ensemble
  !! Many bodies for one program of the appendix. Compiled once: C passes it on by its address.
  use kinds, only: dp
  use deck_binary64, only: deck_t
  use listing_flags, only: listing_t
  implicit none(type, external)
  private

  type, public :: ensemble_t
    integer :: program                        !! 1 two-term, 2 four-term, 3 runge-kutta
    type(listing_t) :: listing
    type(deck_t) :: scene                     !! what all have in common
    integer :: n
    integer :: n_at
    ! A column for each body, in the units of deck_t.
    real(dp), pointer :: body(:, :)
    real(dp), pointer :: omega(:, :)
    real(dp), pointer :: torque_constant(:, :)
    real(dp), pointer :: torque_first(:, :)
    real(dp), pointer :: step_size(:)
    real(dp), pointer :: lipschitz(:)
    integer, pointer :: at(:)                 !! steps whose rows are wanted, rising
    ! Results; where a row was not reached they stay as they were.
    real(dp), pointer :: omega_rows(:, :, :)  !! component, row, body
    real(dp), pointer :: velocity_rows(:, :, :) !! the same, or no body
    real(dp), pointer :: times(:, :)          !! TIME by row and body, or one column for all
    integer, pointer :: ier_rows(:, :)        !! by row and body, or no body
    integer, pointer :: n_rows(:)             !! rows that hold a result
    integer, pointer :: status(:)             !! COMPLETE, STOPPED or OVERFLOW
    integer, pointer :: stop_variable(:)      !! as in stop_t
    real(dp), pointer :: stop_quotient(:)     !! the same; as it was where no test ended the run
  end type ensemble_t

end module ensemble

module ensemble
  !! Many bodies for one program of the appendix. The type is compiled once; C passes its address
  !! on.
  use kinds, only: dp
  use deck_binary64, only: deck_t
  use listing_flags, only: listing_t
  implicit none(type, external)
  private

  type, public :: ensemble_t
    integer :: program                        !! 1 two-term, 2 four-term, 3 runge-kutta
    type(listing_t) :: listing
    type(deck_t) :: scene                     !! what all bodies have in common
    integer :: n
    integer :: n_at
    ! One column for each body, in the units of deck_t.
    real(dp), pointer :: body(:, :)
    real(dp), pointer :: omega(:, :)
    real(dp), pointer :: torque_constant(:, :)
    real(dp), pointer :: torque_first(:, :)
    real(dp), pointer :: step_size(:)
    real(dp), pointer :: lipschitz(:)
    integer, pointer :: at(:)                 !! requested steps, ascending
    ! Results. Rows that a body does not reach keep their old values.
    real(dp), pointer :: omega_rows(:, :, :)  !! component, row, body; rad/s
    real(dp), pointer :: velocity_rows(:, :, :) !! component, row, body; m/s; or no body
    real(dp), pointer :: times(:, :)          !! TIME by row and body, or one column for all, s
    integer, pointer :: ier_rows(:, :)        !! by row and body, or no body
    integer, pointer :: n_rows(:)             !! number of rows that hold a result
    integer, pointer :: status(:)             !! COMPLETE, STOPPED or OVERFLOW
    integer, pointer :: stop_variable(:)      !! as in stop_t
    real(dp), pointer :: stop_quotient(:)     !! as in stop_t; unchanged if no test ended the run
  end type ensemble_t

end module ensemble

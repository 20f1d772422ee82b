module programs
  !! The three programs of the appendix behind one door.
  use kinds, only: dp
  use deck, only: deck_t, stop_t
  use four_term_program, only: four_term
  use listing_flags, only: listing_t
  use runge_kutta_program, only: runge_kutta
  use two_term_program, only: two_term
  implicit none(type, external)
  private

  public :: run

contains

  subroutine run(program, scene, listing, rows, ier_rows, n_rows, status, evaluations, stop_at)
    !! Arguments as in api.f90.
    integer, intent(in) :: program
    type(deck_t), intent(in) :: scene
    type(listing_t), intent(in) :: listing
    real(dp), intent(out) :: rows(8, scene%n_steps)
    integer, intent(out) :: ier_rows(scene%n_steps)
    integer, intent(out) :: n_rows
    integer, intent(out) :: status
    integer, intent(out) :: evaluations
    type(stop_t), intent(out) :: stop_at

    stop_at = stop_t(0, 0.0_dp)
    select case (program)
    case (1)
      call two_term(scene, listing, rows, ier_rows, n_rows, status, evaluations)
    case (2)
      call four_term(scene, listing, rows, ier_rows, n_rows, status, evaluations)
    case default
      call runge_kutta(scene, listing, rows, n_rows, status, evaluations, stop_at)
      ier_rows(:n_rows) = 0
    end select
  end subroutine run

end module programs

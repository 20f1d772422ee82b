! The interface that f2py reads for the programs of the appendix; see api.f90.

subroutine run_program(program, flags, by_moments, body, omega, masses, forces, torque_constant, &
                       torque_rate, torque_first, torque_varies, n_sines, sines, n_cosines, &
                       cosines, step_size, n_steps, lipschitz, may_stop, with_velocity, rows, &
                       ier_rows, n_rows, status, evaluations, stop_variable, stop_quotient)
  ! Run one of the three programs of the appendix on one scene; units as in deck_t of deck.fypp.
  !f2py threadsafe
  use deck_binary64, only: deck_t, outcome_t
  use listing_flags, only: listing_from_bits
  use programs_binary64, only: run
  implicit none
  integer(4), intent(in) :: program        ! 1 two-term, 2 four-term, 3 runge-kutta
  integer(4), intent(in) :: flags          ! bit mask: active defects, readings, conjectures
  integer(4), intent(in) :: by_moments     ! 1: body is I1, I2, I3; 0: A, B, C
  real(8), intent(in) :: body(3)
  real(8), intent(in) :: omega(3)          ! rad/s at time 0
  real(8), intent(in) :: masses(3), forces(3)
  real(8), intent(in) :: torque_constant(3), torque_rate(3)
  real(8), intent(in) :: torque_first(3)   ! assumed torque over moment in the first step, rad/s2
  integer(4), intent(in) :: torque_varies  ! 0: only torque_constant acts
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)      ! amplitude (3), frequency in rad/s
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)  ! as sines
  real(8), intent(in) :: step_size
  integer(4), intent(in) :: n_steps
  real(8), intent(in) :: lipschitz
  integer(4), intent(in) :: may_stop
  integer(4), intent(in) :: with_velocity  ! 0: V1-V3 of the rows are not set
  ! With intent(cache) f2py does not fill these arrays with zeros, which takes seconds for many
  ! steps.
  !f2py intent(cache) rows, ier_rows
  real(8), intent(out) :: rows(8, n_steps)  ! n h, TIME, U1-U3, V1-V3; n_rows columns are set
  integer(4), intent(out) :: ier_rows(n_steps)    ! IER as printed, 0 for runge-kutta
  integer(4), intent(out) :: n_rows
  integer(4), intent(out) :: status               ! 0 complete, 1 stopped, 2 overflow, 5 interrupted
  integer(4), intent(out) :: evaluations          ! right-hand sides evaluated
  integer(4), intent(out) :: stop_variable        ! 0 none, 1-3 U, 4-6 V, 7 norm of U, 8 of U and V
  real(8), intent(out) :: stop_quotient           ! change of K over change of U, 1/s
  type(deck_t) :: scene
  type(outcome_t) :: found

  scene = deck_t(by_moments /= 0, body, omega, masses, forces, torque_constant, torque_rate, &
                 torque_first, torque_varies /= 0, sines, cosines, step_size, n_steps, lipschitz, &
                 may_stop /= 0, with_velocity /= 0)
  call run(program, scene, listing_from_bits(flags), rows, ier_rows, found)
  n_rows = found%n_rows
  status = found%status
  evaluations = found%evaluations
  stop_variable = found%stop_at%variable
  stop_quotient = found%stop_at%quotient
end subroutine run_program

subroutine solve_linear(n, m, a, b, factors, x, ier)
  ! Solve A X = B with the stand-in for LEQT1F alone, so that tests can check it separately.
  !f2py threadsafe
  use linear_solver_binary64, only: leqt1f
  implicit none
  integer(4), intent(in) :: n, m
  real(8), intent(in) :: a(n, n)
  real(8), intent(in) :: b(n, m)
  real(8), intent(out) :: factors(n, n)
  real(8), intent(out) :: x(n, m)
  integer(4), intent(out) :: ier

  factors = a
  x = b
  call leqt1f(factors, m, n, x, ier)
end subroutine solve_linear

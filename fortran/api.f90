! The interface that f2py reads for the modern methods, together with api_programs.f90, api_many.f90
! and api_words.f90. Its procedures have explicit shapes, known kinds and a status code, and contain
! no logic.

subroutine taylor_rows(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, &
                       omega0, n_times, times, tolerance, n_attitudes, attitudes, effort, &
                       n_nodes, nodes, n, most, ends, at_nodes, rows, n_rows, status, steps, &
                       n_steps)
  ! Integrate by Taylor series. Compute omega and, if n_attitudes > 0, the attitude at `times`,
  ! which have one sign and are ordered away from 0. If most > 0, also compute the unknowns at nodes
  ! of each step.
  !f2py threadsafe
  use levels, only: taylor_solve
  use problem, only: problem_t, request_nodes, request_t, solution_t
  implicit none
  real(8), intent(in) :: coefficients(3)        ! A, B, C
  real(8), intent(in) :: m_constant(3)          ! torque over moment, rad/s2
  real(8), intent(in) :: m_rate(3)              ! rad/s3
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)      ! amplitude (3), rad/s2; frequency, rad/s
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)  ! as sines
  real(8), intent(in) :: omega0(3)              ! rad/s
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times)         ! s
  real(8), intent(in) :: tolerance              ! allowed error over the largest |omega|
  !f2py real(8), optional, intent(inout) :: effort(5) = 1.0
  real(8), intent(inout) :: effort(5) ! (1) factor on the work limit; out: (2) factor required,
  ! (3) estimated error, (4) error amplification, (5) steps of all integrations
  !f2py integer(4), optional, intent(in) :: n_attitudes = 0
  integer(4), intent(in) :: n_attitudes         ! n_times, or 0 without attitude
  !f2py real(8), optional, intent(inout) :: attitudes = 0.0
  real(8), intent(inout), target :: attitudes(4, n_attitudes + 1) ! column 1: the attitude at time 0
  !f2py integer(4), optional, intent(in) :: n_nodes = 1
  integer(4), intent(in) :: n_nodes
  !f2py real(8), optional, intent(in) :: nodes = 0.0
  real(8), intent(in), target :: nodes(n_nodes) ! in parts of a step
  !f2py integer(4), optional, intent(in) :: n = 3
  integer(4), intent(in) :: n                   ! number of unknowns
  !f2py integer(4), optional, intent(in) :: most = 0
  integer(4), intent(in) :: most                ! number of steps with nodes
  !f2py real(8), optional, intent(inout) :: ends = 0.0
  real(8), intent(inout), target :: ends(most + 1) ! 0 and the ends of the steps, s
  !f2py real(8), optional, intent(inout) :: at_nodes = 0.0
  real(8), intent(inout), target :: at_nodes(n, n_nodes, most + 1)
  real(8), intent(out), target :: rows(3, n_times)      ! rad/s; n_rows columns are set
  integer(4), intent(out) :: n_rows
  integer(4), intent(out) :: status             ! 0 complete, 2 overflow, 4 work limit, 6 sensitive
  integer(8), intent(out) :: steps
  ! steps: number of steps of the last integration
  integer(4), intent(out) :: n_steps            ! of the last integration; may be above `most`
  type(solution_t) :: solution

  solution%rows => rows
  if (n_attitudes > 0) solution%attitudes(1:4, 0:n_attitudes) => attitudes
  if (most > 0) call request_nodes(solution, nodes, ends, at_nodes)
  call taylor_solve(problem_t(coefficients, m_constant, m_rate, n_sines, n_cosines, sines, &
                              cosines), &
                    request_t(omega0, tolerance, effort(1), times), solution)
  n_rows = solution%n_rows
  status = solution%status
  steps = solution%steps
  n_steps = solution%n_steps
  effort(2:) = [solution%needed, solution%error, solution%growth, solution%spent]
end subroutine taylor_rows

subroutine choose_instructions(highest, taken)
  ! Select the kernels of one instruction set, for tests: 0 plain, 1 AVX2, 2 AVX-512. If it is not
  ! compiled or the processor lacks it, `taken` is the best set below, or else the lowest compiled,
  ! or -1 if the processor lacks that too. -1 changes nothing.
  use levels, only: choose_level
  implicit none
  integer(4), intent(in) :: highest
  integer(4), intent(out) :: taken

  taken = choose_level(highest)
end subroutine choose_instructions

subroutine torque_free_solution(coefficients, coefficients_low, omega0, n_times, times, rows, &
                                n_rows, status)
  ! Evaluate the closed form of a torque-free body at `times`.
  !f2py threadsafe
  use torque_free, only: torque_free_rows
  implicit none
  real(8), intent(in) :: coefficients(3)  ! A, B, C
  !f2py real(8), optional, intent(in) :: coefficients_low(3) = 0.0
  real(8), intent(in) :: coefficients_low(3) ! low-order parts of A, B, C (double-double)
  real(8), intent(in) :: omega0(3)        ! rad/s at time 0
  integer(4), intent(in) :: n_times
  real(8), intent(in) :: times(n_times)   ! s
  real(8), intent(out) :: rows(3, n_times)
  integer(4), intent(out) :: n_rows       ! number of rows that hold a result
  integer(4), intent(out) :: status       ! 0 complete, 2 overflow, 3 refused, 4 phase has no digit

  call torque_free_rows(coefficients, coefficients_low, omega0, n_times, times, rows, n_rows, &
                        status)
end subroutine torque_free_solution

subroutine torque_free_period(coefficients, coefficients_low, omega0, period)
  ! Compute the period of the angular velocity of a torque-free body, s; 0 if it has none.
  use torque_free, only: torque_free_period_of
  implicit none
  real(8), intent(in) :: coefficients(3)  ! A, B, C
  real(8), intent(in) :: coefficients_low(3) ! low-order parts of A, B, C (double-double)
  real(8), intent(in) :: omega0(3)        ! rad/s at time 0
  real(8), intent(out) :: period

  period = torque_free_period_of(coefficients, coefficients_low, omega0)
end subroutine torque_free_period

subroutine torque_free_attitude_solution(moments, moments_low, omega0, attitude0, n_times, times, &
                                         rows, attitudes, n_rows, status)
  ! Evaluate the closed form of a torque-free body and its attitude, a quaternion from body to
  ! space.
  !f2py threadsafe
  use torque_free_attitude, only: torque_free_attitude_rows
  implicit none
  real(8), intent(in) :: moments(3)       ! kg m2
  !f2py real(8), optional, intent(in) :: moments_low(3) = 0.0
  real(8), intent(in) :: moments_low(3)   ! low-order parts of the moments (double-double)
  real(8), intent(in) :: omega0(3)        ! rad/s at time 0
  real(8), intent(in) :: attitude0(4)     ! quaternion at time 0, scalar first, any norm
  integer(4), intent(in) :: n_times
  real(8), intent(in) :: times(n_times)   ! s, in any order
  real(8), intent(out) :: rows(3, n_times)
  real(8), intent(out) :: attitudes(4, n_times)
  integer(4), intent(out) :: n_rows       ! number of rows that hold a result
  integer(4), intent(out) :: status       ! 0 complete, 2 overflow, 3 refused, 4 phase has no digit
  real(8) :: both(3, 2)

  both(:, 1) = moments
  both(:, 2) = moments_low
  call torque_free_attitude_rows(both, [omega0, attitude0], n_times, times, rows, attitudes, &
                                 n_rows, status)
end subroutine torque_free_attitude_solution

subroutine torque_free_growth(coefficients, omega0, t_end, growth, enough)
  ! Compute the error amplification of a torque-free motion: the largest norm of the
  ! state-transition matrix of omega to t_end, from the closed form.
  !f2py threadsafe
  use torque_free_differences, only: torque_free_growth_of
  implicit none
  real(8), intent(in) :: coefficients(3)  ! A, B, C
  real(8), intent(in) :: omega0(3)        ! rad/s at time 0
  real(8), intent(in) :: t_end            ! s
  real(8), intent(out) :: growth          ! at least 1; negative if there is no closed form
  real(8), intent(in) :: enough           ! if positive, only whether growth is larger matters
  !f2py real(8), optional, intent(in) :: enough = 0.0

  if (enough > 0) then
    growth = torque_free_growth_of(coefficients, omega0, t_end, enough)
  else
    growth = torque_free_growth_of(coefficients, omega0, t_end)
  end if
end subroutine torque_free_growth

subroutine sphere_solution(m_constant, m_rate, n_sines, sines, n_cosines, cosines, omega0, &
                           n_times, times, effort, rows, n_rows, status)
  ! Evaluate the closed form of a sphere under the torque law of a scene.
  !f2py threadsafe
  use problem, only: problem_t, request_t, solution_t
  use sphere, only: sphere_rows
  implicit none
  real(8), intent(in) :: m_constant(3)        ! torque over moment, rad/s2; its rate below, rad/s3
  real(8), intent(in) :: m_rate(3)
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)  ! amplitude (3), frequency in rad/s
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)
  real(8), intent(in) :: omega0(3)
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times)
  !f2py real(8), optional, intent(inout) :: effort(2) = 1.0
  real(8), intent(inout) :: effort(2)
  ! effort: (1) factor on the work limit; out: (2) factor required
  real(8), intent(out), target :: rows(3, n_times)
  integer(4), intent(out) :: n_rows, status
  type(solution_t) :: solution

  solution%rows => rows
  call sphere_rows(problem_t([0.0d0, 0.0d0, 0.0d0], m_constant, m_rate, n_sines, n_cosines, &
                             sines, cosines), &
                   request_t(omega0, 0.0d0, effort(1), times), solution)
  n_rows = solution%n_rows
  status = solution%status
  effort(2) = solution%needed
end subroutine sphere_solution

subroutine torque_noise_ratio(m_constant, m_rate, n_sines, sines, n_cosines, cosines, t_end, &
                              steps, scale, noise)
  ! Compute the ratio between the omega that the torque's terms add one by one and the largest
  ! omega. It is 0 unless these terms nearly cancel.
  !f2py threadsafe
  use problem, only: problem_t
  use torque_noise, only: torque_noise_of
  implicit none
  real(8), intent(in) :: m_constant(3), m_rate(3) ! torque over moment, rad/s2, and its rate, rad/s3
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)
  real(8), intent(in) :: t_end      ! s
  real(8), intent(in) :: steps      ! number of steps; the terms are rounded in each
  real(8), intent(in) :: scale      ! largest |omega|, rad/s; if unknown, minus the initial |omega|
  real(8), intent(out) :: noise

  noise = torque_noise_of(problem_t([0.0d0, 0.0d0, 0.0d0], m_constant, m_rate, n_sines, n_cosines, &
                                    sines, cosines), &
                          t_end, steps, scale)
end subroutine torque_noise_ratio

subroutine gauss_solution(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, &
                          omega0, n_times, times, stages, step, effort, rows, reached, n_rows, &
                          status, evaluations)
  ! Integrate by Gauss collocation, with equal steps from each output time to the next.
  !f2py threadsafe
  use gauss_collocation, only: gauss_rows
  use problem, only: problem_t, request_t, solution_t
  implicit none
  real(8), intent(in) :: coefficients(3), m_constant(3), m_rate(3)
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)
  real(8), intent(in) :: omega0(3)
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times)     ! s, ordered away from 0
  integer(4), intent(in) :: stages          ! 1 to 8
  real(8), intent(in) :: step               ! largest step, s, above 0
  !f2py real(8), optional, intent(in) :: effort = 1.0
  real(8), intent(in) :: effort
  real(8), intent(out), target :: rows(3, n_times)
  real(8), intent(out) :: reached(4)        ! time and omega after the last successful step
  integer(4), intent(out) :: n_rows, status
  integer(8), intent(out) :: evaluations
  type(solution_t) :: solution

  solution%rows => rows
  call gauss_rows(problem_t(coefficients, m_constant, m_rate, n_sines, n_cosines, sines, &
                            cosines), &
                  request_t(omega0, 0.0d0, effort, times), stages, step, solution, reached)
  n_rows = solution%n_rows
  status = solution%status
  evaluations = solution%evaluations
end subroutine gauss_solution

subroutine fixed_step_solution(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, &
                               cosines, omega0, n_times, times, method, step, effort, rows, &
                               n_rows, status, steps, evaluations)
  ! Integrate by improved Euler, three-term Taylor or Runge-Kutta with a fixed step; only the last
  ! step before an output time is shorter.
  !f2py threadsafe
  use fixed_step, only: fixed_step_rows
  use problem, only: problem_t, request_t, solution_t
  implicit none
  real(8), intent(in) :: coefficients(3), m_constant(3), m_rate(3)
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)
  real(8), intent(in) :: omega0(3)
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times)
  integer(4), intent(in) :: method          ! code of the module methods
  real(8), intent(in) :: step               ! s, above 0
  !f2py real(8), optional, intent(inout) :: effort(2) = 1.0
  real(8), intent(inout) :: effort(2)
  real(8), intent(out), target :: rows(3, n_times)
  integer(4), intent(out) :: n_rows, status
  integer(8), intent(out) :: steps, evaluations
  type(solution_t) :: solution

  solution%rows => rows
  call fixed_step_rows(problem_t(coefficients, m_constant, m_rate, n_sines, n_cosines, sines, &
                                 cosines), &
                       request_t(omega0, 0.0d0, effort(1), times), method, step, solution)
  n_rows = solution%n_rows
  status = solution%status
  steps = solution%steps
  evaluations = solution%evaluations
  effort(2) = solution%needed
end subroutine fixed_step_solution

subroutine solve_packed(packed, n_packed, omega0, t_end, omega, status, steps, found)
  ! Solve with a prepared solver; fortran/modern/prepared.f90 documents the packed array. solver.c
  ! calls this procedure by its address and repeats the list of its arguments.
  !f2py threadsafe
  use prepared, only: solve_prepared
  implicit none
  integer(4), intent(in) :: n_packed
  real(8), intent(in) :: packed(n_packed)
  real(8), intent(in) :: omega0(3)   ! rad/s
  real(8), intent(in) :: t_end       ! s
  real(8), intent(out) :: omega(3)   ! rad/s; NaN unless the status is 0 or 6
  integer(4), intent(out) :: status
  integer(8), intent(out) :: steps   ! or right-hand sides, of Gauss collocation;
  ! negative if the kernel chose quick instead of the series
  real(8), intent(out) :: found(3)   ! error, amplification, steps in all; below 0: unknown

  call solve_prepared(packed, n_packed, omega0, t_end, omega, status, steps, found)
end subroutine solve_packed

subroutine solve_packed_attitude(packed, n_packed, start, t_end, state, status, steps, found)
  ! Solve with a prepared solver for omega and attitude.
  !f2py threadsafe
  use prepared, only: solve_prepared_attitude
  implicit none
  integer(4), intent(in) :: n_packed
  real(8), intent(in) :: packed(n_packed)
  real(8), intent(in) :: start(7)    ! omega in rad/s, and a unit quaternion, scalar first
  real(8), intent(in) :: t_end       ! s
  real(8), intent(out) :: state(7)   ! NaN unless the status is 0 or 6
  integer(4), intent(out) :: status
  integer(8), intent(out) :: steps   ! 0 with a closed form
  real(8), intent(out) :: found(3)   ! as in solve_packed

  call solve_prepared_attitude(packed, n_packed, start, t_end, state, status, steps, found)
end subroutine solve_packed_attitude

subroutine states_at(n_pieces, edges, n_points, points, m, values, n, times, states)
  ! Evaluate polynomials through Chebyshev points, one between each two edges.
  !f2py threadsafe
  use levels, only: read_pieces
  implicit none
  integer(4), intent(in) :: n_pieces
  real(8), intent(in) :: edges(n_pieces + 1)  ! ascending, s
  integer(4), intent(in) :: n_points          ! AT_ONCE + 1
  real(8), intent(in) :: points(n_points)     ! ascending, from -1 to 1
  integer(4), intent(in) :: m                 ! components
  real(8), intent(in) :: values(m, n_points, n_pieces)
  integer(4), intent(in) :: n
  real(8), intent(in) :: times(n)             ! s
  real(8), intent(out) :: states(m, n)

  call read_pieces(n_pieces, edges, points, m, values, n, times, states)
end subroutine states_at

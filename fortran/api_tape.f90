! The interface that f2py reads for scenes whose equations of motion are a tape.

subroutine tape_rows(n_numbers, numbers, omega0, n_times, times, tolerance, n_attitudes, &
                     attitudes, n_own, own_sizes, n_own_times, own, effort, n_nodes, nodes, n, &
                     most, ends, at_nodes, rows, n_rows, status, steps, n_steps)
  ! Integrate a tape by Taylor series. Compute omega, the attitude if n_attitudes > 0, and n_own own
  ! states (unknowns that the user adds) at `times`, which have one sign and are ordered away from
  ! 0. If most > 0, also compute the unknowns at nodes of each step.
  !f2py threadsafe
  use levels, only: tape_solve
  use problem, only: request_nodes, request_t, solution_t
  use tape, only: tape_of
  implicit none
  integer(4), intent(in) :: n_numbers
  real(8), intent(in), target :: numbers(n_numbers) ! the tape, as tape.f90 describes it
  real(8), intent(in) :: omega0(3)              ! rad/s
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times) ! s
  real(8), intent(in) :: tolerance              ! allowed error: relative, and of the angle in rad
  integer(4), intent(in) :: n_attitudes         ! n_times, or 0 without attitude
  real(8), intent(inout), target :: attitudes(4, n_attitudes + 1) ! column 1: the attitude at time 0
  integer(4), intent(in) :: n_own               ! own states
  ! Least sizes to which their errors are relative; the last is unused, as f2py takes no size 0.
  real(8), intent(in), target :: own_sizes(n_own + 1)
  integer(4), intent(in) :: n_own_times         ! n_times, or 0 without own states
  real(8), intent(inout), target :: own(n_own + 1, n_own_times + 1) ! as attitudes; last row unused
  real(8), intent(inout) :: effort(6) ! (1) factor on the work limit; out: (2) factor required, or
  ! time (s) at which the switch (6) slides or is touched, (3) estimated error, (4) error
  ! amplification, (5) steps of all integrations
  integer(4), intent(in) :: n_nodes
  real(8), intent(in), target :: nodes(n_nodes) ! in parts of a step
  integer(4), intent(in) :: n                   ! number of unknowns
  integer(4), intent(in) :: most                ! number of steps with nodes
  real(8), intent(inout), target :: ends(most + 1) ! 0 and the ends of the steps, s
  real(8), intent(inout), target :: at_nodes(n, n_nodes, most + 1)
  real(8), intent(out), target :: rows(3, n_times)      ! rad/s; n_rows columns are set
  integer(4), intent(out) :: n_rows
  integer(4), intent(out) :: status             ! 0 complete, 2 overflow, 4 work limit, 6 sensitive
  integer(8), intent(out) :: steps
  integer(4), intent(out) :: n_steps            ! of the last integration; may be above `most`
  type(solution_t) :: solution

  solution%rows => rows
  if (n_attitudes > 0) solution%attitudes(1:4, 0:n_attitudes) => attitudes
  if (n_own > 0) then
    solution%own(1:n_own + 1, 0:n_own_times) => own
    solution%own_sizes => own_sizes
  end if
  if (most > 0) call request_nodes(solution, nodes, ends, at_nodes)
  call tape_solve(tape_of(numbers), request_t(omega0, tolerance, effort(1), times), solution)
  n_rows = solution%n_rows
  status = solution%status
  steps = solution%steps
  n_steps = solution%n_steps
  effort(2:) = [solution%needed, solution%error, solution%growth, solution%spent, &
                real(solution%switch, 8)]
end subroutine tape_rows

subroutine tape_step(n_numbers, numbers, n, t, state, tolerances, relative, trial, t_end, &
                     is_beyond, n_terms, h, t_next, terms, ends, order, expansions, is_switched, &
                     is_cut, status)
  ! Compute one step of a system of ordinary differential equations by Taylor series: the terms of
  ! the unknowns, whose sums are the state at its end. The unit of time is the user's.
  !f2py threadsafe
  use levels, only: step => tape_step
  use problem, only: step_request_t, step_t
  use tape, only: tape_of
  implicit none
  integer(4), intent(in) :: n_numbers
  real(8), intent(in), target :: numbers(n_numbers) ! the tape, as tape.f90 describes it
  integer(4), intent(in) :: n
  real(8), intent(in) :: t
  real(8), intent(in), target :: state(n)
  real(8), intent(in), target :: tolerances(n)  ! allowed errors of the unknowns in the step
  real(8), intent(in) :: relative               ! tolerance that decides the order
  real(8), intent(in) :: trial                  ! length that is tried
  real(8), intent(in) :: t_end                  ! latest end
  integer(4), intent(in) :: is_beyond           ! 1: steps end beyond switches and breaks, else 0
  integer(4), intent(in) :: n_terms             ! largest order plus 1
  real(8), intent(out) :: h, t_next             ! step, and time at its end
  real(8), intent(out), target :: terms(n_terms, n)
  real(8), intent(out), target :: ends(n)       ! state at the end
  integer(4), intent(out) :: order
  integer(4), intent(out) :: expansions         ! number of expansions that were tried
  integer(4), intent(out) :: is_switched        ! 1 if the step ended where a switch changes, else 0
  integer(4), intent(out) :: is_cut             ! 1 if it ended at a break or at t_end, else 0
  integer(4), intent(out) :: status             ! 0 complete, 2 no step is short enough
  type(step_t) :: taken

  taken%h = 0.0d0
  taken%t = t
  taken%stop = t_end
  taken%order = 0
  taken%terms(0:n_terms - 1, 1:n) => terms
  taken%state => ends
  call step(tape_of(numbers), step_request_t(t, t_end, trial, relative, state, tolerances, &
                                             is_beyond == 1), taken)
  h = taken%h
  t_next = taken%t
  order = taken%order
  expansions = taken%expansions
  is_switched = merge(1, 0, taken%is_switched)
  is_cut = merge(1, 0, abs(h) >= abs(taken%stop - t))
  status = taken%status
end subroutine tape_step

subroutine event_roots(n_numbers, numbers, n_pieces, edges, m, n_points, values, n_own, n_nodes, &
                       constants, n_constants, most, roots, n_roots)
  ! Find the roots of a recorded function of a solution, if they are simple and distinct.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use levels, only: search_events
  use problem, only: event_search_t
  use tape, only: arrays_of, tape_of, tape_t
  implicit none
  integer(4), intent(in) :: n_numbers
  real(8), intent(in), target :: numbers(n_numbers)  ! the tape, as tape.f90 describes it
  integer(4), intent(in) :: n_pieces
  real(8), intent(in), target :: edges(n_pieces + 1) ! ascending, s
  integer(4), intent(in) :: m                        ! unknowns
  integer(4), intent(in) :: n_points                 ! AT_ONCE + 1
  real(8), intent(in), target :: values(m, n_points, n_pieces) ! at Chebyshev points
  integer(4), intent(in) :: n_own                    ! own states
  integer(4), intent(in) :: n_nodes                  ! of the function's polynomials
  integer(4), intent(in) :: n_constants
  ! Points and nodes, four matrices, column by column, and the settings of event_search.c.
  real(8), intent(in), target :: constants(n_constants)
  integer(4), intent(in) :: most
  real(8), intent(out), target :: roots(4, most)     ! time (s), sign, slope and noise
  integer(4), intent(out) :: n_roots                 ! -1 if other roots are possible
  type(tape_t) :: recorded
  type(event_search_t) :: search
  integer :: at(5)

  recorded = tape_of(numbers)
  at = 1 + n_points + n_nodes + n_nodes*[0, n_points, n_points + n_nodes, n_points + 2*n_nodes, &
                                         n_points + 3*n_nodes]
  search = event_search_t(n_pieces, m, n_own, recorded%n_slots, most, 0, c_loc(edges), &
                          c_loc(values), c_loc(constants), c_loc(constants(at(1))), &
                          c_loc(constants(at(2))), c_loc(constants(at(3))), &
                          c_loc(constants(at(4))), c_loc(constants(at(5))), c_loc(roots))
  call search_events(arrays_of(recorded, c_null_ptr, c_null_ptr, c_null_ptr), search)
  n_roots = search%n_roots
end subroutine event_roots

subroutine tape_derivatives(n_numbers, numbers, n, state, n_columns, starts, forcings, n_times, &
                            times, tolerance, effort, rows, n_rows, status)
  ! Compute the derivatives of the solution of a tape with respect to parameters, the columns, at
  ! `times`, which have one sign and are ordered away from 0.
  !f2py threadsafe
  use levels, only: tape_variation
  use problem, only: variation_request_t, variation_t
  use tape, only: tape_of
  implicit none
  integer(4), intent(in) :: n_numbers
  real(8), intent(in), target :: numbers(n_numbers) ! the tape, as tape.f90 describes it
  integer(4), intent(in) :: n
  real(8), intent(in), target :: state(n)       ! at time 0
  integer(4), intent(in) :: n_columns
  real(8), intent(in), target :: starts(n, n_columns) ! derivatives at time 0
  integer(4), intent(in), target :: forcings(n, n_columns) ! combinations that are partial
  ! derivatives of the rates; 0 for none
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times) ! s
  real(8), intent(in) :: tolerance              ! relative
  real(8), intent(in) :: effort                 ! factor on the work limit
  real(8), intent(out), target :: rows(n, n_columns, n_times) ! n_rows times are set
  integer(4), intent(out) :: n_rows
  integer(4), intent(out) :: status             ! 0 complete, 2 overflow, 4 work limit
  type(variation_t) :: variation

  variation%rows => rows
  call tape_variation(tape_of(numbers), &
                      variation_request_t(tolerance, effort, state, starts, forcings, times), &
                      variation)
  n_rows = variation%n_rows
  status = variation%status
end subroutine tape_derivatives

subroutine tape_many(n_packed, packed, n_alone, alone, n, omega0, n_rows, n_times, times, &
                     n_attitudes, attitude0, n_parameters, n_sets, parameters, n_own, own0, &
                     n_sizes, own_sizes, given_up, omega, n_results, attitude, n_owned, own, &
                     status, n_estimates, estimates, n_left, raised)
  ! Solve many bodies under one torque: omega at n_rows times of each body; if n_attitudes > 0, also
  ! its attitude; and n_own own states.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use interruption, only: watch
  use many_tape, only: many_t, solve_tape_bodies
  implicit none
  integer(4), intent(in) :: n_packed
  real(8), intent(in), target :: packed(n_packed) ! the scene, as in prepared.f90
  integer(4), intent(in) :: n_alone
  real(8), intent(inout), target :: alone(n_alone) ! the same for one body, as in many_tape.f90
  integer(4), intent(in) :: n                   ! number of bodies
  real(8), intent(in), target :: omega0(3, n)   ! rad/s
  integer(4), intent(in) :: n_rows
  integer(4), intent(in) :: n_times             ! n, or 1
  real(8), intent(in), target :: times(n_rows, n_times) ! s, of one sign, ordered away from 0
  integer(4), intent(in) :: n_attitudes         ! n, or 0 without attitude
  real(8), intent(in), target :: attitude0(4, n_attitudes) ! unit quaternions
  integer(4), intent(in) :: n_parameters        ! further inputs of the tape
  integer(4), intent(in) :: n_sets              ! of parameters: 0, 1 or n
  real(8), intent(in), target :: parameters(n_parameters, n_sets)
  integer(4), intent(in) :: n_own               ! own states
  real(8), intent(in), target :: own0(n, n_own)
  integer(4), intent(in) :: n_sizes             ! n_own
  ! Least sizes to which their errors are relative; the last is unused, as f2py takes no size 0.
  real(8), intent(in), target :: own_sizes(n_sizes + 1)
  integer(4), intent(inout), target :: given_up(1) ! not 0: another thread ends this call
  real(8), intent(inout), target :: omega(3, n_rows, n)
  integer(4), intent(in) :: n_results           ! as n_attitudes
  real(8), intent(inout), target :: attitude(4, n_rows, n_results)
  integer(4), intent(in) :: n_owned             ! n_own
  real(8), intent(inout), target :: own(n_rows, n, n_owned)
  integer(1), intent(inout), target :: status(n_rows, n)
  integer(4), intent(in) :: n_estimates         ! n if the estimates are requested, else 0
  ! Relative error of a result, and error amplification; only of bodies with a result.
  real(8), intent(inout), target :: estimates(2, n_rows, n_estimates)
  integer(4), intent(out) :: n_left             ! number of bodies that are not solved side by side
  integer(4), intent(out) :: raised             ! 1: interrupted by the user
  type(many_t) :: many

  many%n = n
  many%n_rows = n_rows
  many%n_own = n_own
  many%omega0 => omega0
  many%attitude0 => attitude0
  many%own0 => own0
  many%own_sizes => own_sizes
  many%times => times
  many%parameters => parameters
  many%omega => omega
  many%attitude => attitude
  many%own => own
  many%status => status
  many%estimates => estimates
  call watch(c_loc(given_up))
  call solve_tape_bodies(packed, alone, many, n_left, raised)
  call watch(c_null_ptr)
end subroutine tape_many

subroutine ready_number(key, number)
  ! Return the number of the compiled operations of a tape, by the key of its structure; 0 if there
  ! are none.
  use levels, only: ready_leaves
  implicit none
  integer(8), intent(in) :: key
  integer(8), intent(out) :: number

  number = ready_leaves(key)
end subroutine ready_number

subroutine compiled_lanes(address, fits)
  ! Return whether the compiled operations at an address can be used for many bodies.
  use levels, only: fits_lanes
  implicit none
  integer(8), intent(in) :: address
  integer(4), intent(out) :: fits

  fits = fits_lanes(address)
end subroutine compiled_lanes

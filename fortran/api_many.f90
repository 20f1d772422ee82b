! The interface that f2py reads for many bodies; see api.f90. Another thread may end such a call: it
! sets given_up, which the kernels check whenever they poll for a user interrupt.

subroutine run_programs(program, flags, by_moments, n, body, omega, masses, forces, &
                        torque_constant, torque_rate, torque_first, torque_varies, n_sines, sines, &
                        n_cosines, cosines, step_size, n_steps, lipschitz, may_stop, &
                        with_velocity, given_up, n_at, at, omega_rows, n_velocities, &
                        velocity_rows, n_times, times, n_iers, ier_rows, n_rows, status, &
                        stop_variable, stop_quotient)
  ! Run one of the three programs on n bodies. Results that are not reached keep their old values.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use deck_binary64, only: deck_t
  use ensemble, only: ensemble_t
  use interruption, only: watch
  use levels, only: run_lanes
  use listing_flags, only: listing_from_bits
  implicit none
  integer(4), intent(in) :: program, flags, by_moments ! these and those below as in run_program
  integer(4), intent(in) :: n
  real(8), intent(in), target :: body(3, n)
  real(8), intent(in), target :: omega(3, n)
  real(8), intent(in) :: masses(3), forces(3)
  real(8), intent(in), target :: torque_constant(3, n)
  real(8), intent(in) :: torque_rate(3)
  real(8), intent(in), target :: torque_first(3, n)
  integer(4), intent(in) :: torque_varies
  integer(4), intent(in) :: n_sines
  real(8), intent(in), target :: sines(4, n_sines)
  integer(4), intent(in) :: n_cosines
  real(8), intent(in), target :: cosines(4, n_cosines)
  real(8), intent(in), target :: step_size(n)
  integer(4), intent(in) :: n_steps
  real(8), intent(in), target :: lipschitz(n)
  integer(4), intent(in) :: may_stop, with_velocity
  integer(4), intent(inout), target :: given_up(1) ! not 0: another thread ends this call
  integer(4), intent(in) :: n_at
  integer(4), intent(in), target :: at(n_at)               ! requested steps, ascending
  real(8), intent(inout), target :: omega_rows(3, n_at, n)
  integer(4), intent(in) :: n_velocities                   ! n, or 0
  real(8), intent(inout), target :: velocity_rows(3, n_at, n_velocities)
  integer(4), intent(in) :: n_times                        ! n, or 1 if all step sizes are equal
  real(8), intent(inout), target :: times(n_at, n_times)   ! TIME, s
  integer(4), intent(in) :: n_iers                         ! n, or 0
  integer(4), intent(inout), target :: ier_rows(n_at, n_iers)
  integer(4), intent(inout), target :: n_rows(n), status(n), stop_variable(n)
  real(8), intent(inout), target :: stop_quotient(n)
  real(8) :: of_each(3)
  type(deck_t) :: scene

  of_each = 1.0d0
  scene = deck_t(by_moments /= 0, of_each, of_each, masses, forces, of_each, torque_rate, of_each, &
                 torque_varies /= 0, sines, cosines, 1.0d0, n_steps, 1.0d0, may_stop /= 0, &
                 with_velocity /= 0)
  call watch(c_loc(given_up))
  call run_lanes(ensemble_t(program, listing_from_bits(flags), scene, n, n_at, body, omega, &
                            torque_constant, torque_first, step_size, lipschitz, at, &
                            omega_rows, velocity_rows, times, ier_rows, n_rows, status, &
                            stop_variable, stop_quotient))
  call watch(c_null_ptr)
end subroutine run_programs

subroutine solve_ensemble(code, tolerance, step, effort, by_moments, n_body, body, n_moments, &
                          moments, n_constant, constant, n_rate, rate, n_sines, n_sine_sets, &
                          sines, n_cosines, n_cosine_sets, cosines, n, omega0, n_times, times, &
                          n_attitudes, attitude0, given_up, omega, n_results, attitude, status, &
                          n_estimates, estimates, raised)
  ! Solve many bodies in one call: omega of each body at its time, and its attitude if attitude0 is
  ! specified. An array with one column applies to all bodies.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use bodies, only: bodies_t
  use interruption, only: watch
  use many_bodies, only: solve_bodies
  implicit none
  integer(4), intent(in) :: code                ! code of the module methods
  real(8), intent(in) :: tolerance              ! relative, of the methods that take one
  real(8), intent(in) :: step                   ! s, of the methods with a fixed step
  real(8), intent(in) :: effort                 ! factor on the work limit of each body
  integer(4), intent(in) :: by_moments          ! 1: body is I1, I2, I3; 0: A, B, C; + 2: omega0
  ! was rounded after a rotation to principal axes
  integer(4), intent(in) :: n_body
  real(8), intent(in), target :: body(3, n_body)
  integer(4), intent(in) :: n_moments
  real(8), intent(in), target :: moments(3, n_moments)   ! of bodies by A, B, C, over any number
  integer(4), intent(in) :: n_constant
  real(8), intent(in), target :: constant(3, n_constant) ! N m, or rad/s2
  integer(4), intent(in) :: n_rate
  real(8), intent(in), target :: rate(3, n_rate)         ! N m/s, or rad/s3
  integer(4), intent(in) :: n_sines, n_sine_sets
  real(8), intent(in), target :: sines(4, n_sines, n_sine_sets)       ! amplitude (3) as constant,
  ! frequency in rad/s
  integer(4), intent(in) :: n_cosines, n_cosine_sets
  real(8), intent(in), target :: cosines(4, n_cosines, n_cosine_sets) ! as sines
  integer(4), intent(in) :: n
  real(8), intent(in), target :: omega0(3, n)   ! rad/s
  integer(4), intent(in) :: n_times
  real(8), intent(in), target :: times(n_times) ! s
  integer(4), intent(in) :: n_attitudes
  real(8), intent(in), target :: attitude0(4, n_attitudes)
  integer(4), intent(inout), target :: given_up(1) ! not 0: another thread ends this call
  real(8), intent(inout) :: omega(3, n)         ! rad/s; NaN unless the status is 0 or 6
  integer(4), intent(in) :: n_results           ! n with attitude, else 0
  real(8), intent(inout), target :: attitude(4, n_results)
  integer(1), intent(inout) :: status(n)        ! of the module statuses
  integer(4), intent(in) :: n_estimates         ! n if the estimates are requested, else 0
  ! Relative error of a result, and error amplification; negative: unknown.
  real(8), intent(inout), target :: estimates(2, n_estimates)
  integer(4), intent(out) :: raised             ! 1: interrupted by the user
  type(bodies_t) :: bodies
  real(8) :: packed(0)

  bodies%by_moments = btest(by_moments, 0)
  bodies%is_rounded = btest(by_moments, 1)
  bodies%tolerance = tolerance
  bodies%step = step
  bodies%effort = effort
  bodies%n = n
  bodies%body => body
  bodies%moments => moments
  bodies%constant => constant
  bodies%rate => rate
  bodies%sines => sines
  bodies%cosines => cosines
  bodies%omega0 => omega0
  bodies%times => times
  bodies%attitude0 => attitude0
  bodies%attitude => attitude
  bodies%estimates => estimates
  call watch(c_loc(given_up))
  call solve_bodies(bodies, code, packed, omega, status, raised)
  call watch(c_null_ptr)
end subroutine solve_ensemble

subroutine solve_many_rows(code, tolerance, by_moments, n_body, body, n_moments, moments, &
                           n_constant, constant, n_rate, rate, n_sines, n_sine_sets, sines, &
                           n_cosines, n_cosine_sets, cosines, n, omega0, n_rows, times, places, &
                           n_attitudes, attitude0, given_up, n_places, omega, n_results, &
                           attitude, status, n_estimates, estimates, raised)
  ! Solve many bodies under torque laws, or none, for several times; see solve_ensemble. The status
  ! is 0, or -1 of a body that this leaves.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use bodies, only: bodies_t
  use interruption, only: watch
  use many_bodies, only: solve_rows
  implicit none
  integer(4), intent(in) :: code
  real(8), intent(in) :: tolerance
  integer(4), intent(in) :: by_moments
  integer(4), intent(in) :: n_body
  real(8), intent(in), target :: body(3, n_body)
  integer(4), intent(in) :: n_moments
  real(8), intent(in), target :: moments(3, n_moments)   ! of bodies by A, B, C, over any number
  integer(4), intent(in) :: n_constant
  real(8), intent(in), target :: constant(3, n_constant)
  integer(4), intent(in) :: n_rate
  real(8), intent(in), target :: rate(3, n_rate)
  integer(4), intent(in) :: n_sines, n_sine_sets
  real(8), intent(in), target :: sines(4, n_sines, n_sine_sets)
  integer(4), intent(in) :: n_cosines, n_cosine_sets
  real(8), intent(in), target :: cosines(4, n_cosines, n_cosine_sets)
  integer(4), intent(in) :: n
  real(8), intent(in), target :: omega0(3, n)
  integer(4), intent(in) :: n_rows
  real(8), intent(in), target :: times(n_rows) ! s, of one sign, ordered away from 0
  integer(4), intent(in), target :: places(n_rows) ! of these times in the results
  integer(4), intent(in) :: n_attitudes
  real(8), intent(in), target :: attitude0(4, n_attitudes)
  integer(4), intent(inout), target :: given_up(1)
  integer(4), intent(in) :: n_places
  real(8), intent(inout), target :: omega(3, n_places, n)
  integer(4), intent(in) :: n_results          ! n with attitude, else 0
  real(8), intent(inout), target :: attitude(4, n_places, n_results)
  integer(1), intent(inout) :: status(n)
  integer(4), intent(in) :: n_estimates        ! n if the estimates are requested, else 0
  real(8), intent(inout), target :: estimates(2, n_places, n_estimates)
  integer(4), intent(out) :: raised
  type(bodies_t) :: bodies
  real(8), target :: no_attitude(4, 0), no_estimates(2, 0)

  bodies%by_moments = btest(by_moments, 0)
  bodies%tolerance = tolerance
  bodies%step = 1.0d0
  bodies%effort = 1.0d0
  bodies%n = n
  bodies%body => body
  bodies%moments => moments
  bodies%constant => constant
  bodies%rate => rate
  bodies%sines => sines
  bodies%cosines => cosines
  bodies%omega0 => omega0
  bodies%times => times(n_rows:)
  bodies%row_times => times
  bodies%places => places
  bodies%omega_rows => omega
  bodies%attitude_rows => attitude
  bodies%estimate_rows => estimates
  bodies%attitude0 => attitude0
  bodies%attitude => no_attitude
  bodies%estimates => no_estimates
  call watch(c_loc(given_up))
  call solve_rows(bodies, code, status, raised)
  call watch(c_null_ptr)
end subroutine solve_many_rows

subroutine solve_packed_many(packed, n_packed, n, omega0, n_times, times, given_up, omega, &
                             status, raised)
  ! Solve many initial omegas with a prepared solver. As for solve_packed, C code calls this
  ! procedure by its address.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use interruption, only: watch
  use many_bodies, only: solve_packed_bodies
  implicit none
  integer(4), intent(in) :: n_packed
  real(8), intent(in) :: packed(n_packed)
  integer(4), intent(in) :: n
  real(8), intent(in) :: omega0(3, n)  ! rad/s
  integer(4), intent(in) :: n_times
  real(8), intent(in) :: times(n_times) ! s; n_times is 1 or n
  integer(4), intent(inout), target :: given_up(1) ! as in solve_ensemble
  real(8), intent(inout) :: omega(3, n)
  integer(1), intent(inout) :: status(n)
  integer(4), intent(out) :: raised

  call watch(c_loc(given_up))
  call solve_packed_bodies(packed, n_packed, n, omega0, times, omega, status, raised)
  call watch(c_null_ptr)
end subroutine solve_packed_many

subroutine inertia_frames(n, matrices, symmetric, m, vectors, numbers, axes, components, status)
  ! Compute the principal axes of n bodies, and torques over moments about these.
  !f2py threadsafe
  use levels, only: find_frames
  implicit none
  integer(4), intent(in) :: n
  real(8), intent(in) :: matrices(3, 3, n)      ! kg m2
  real(8), intent(in) :: symmetric              ! largest deviation from symmetry, relative
  integer(4), intent(in) :: m                   ! vectors of a body
  real(8), intent(in) :: vectors(3, m, n)       ! about the axes of the matrix
  real(8), intent(out) :: numbers(10, n)        ! A, B, C; moments over a power of two; quaternion
  real(8), intent(out) :: axes(3, 3, n)         ! in columns
  real(8), intent(out) :: components(3, m, n)
  ! 0 complete, 3 not symmetric, finite and positive definite, 4 too thin
  integer(4), intent(out) :: status(n)
  integer(4), parameter :: at_once = 64
  real(8) :: means(3, 3, at_once), opposite(3, 3), largest
  integer(4) :: first, i, there

  do first = 1, n, at_once
    there = min(at_once, n - first + 1)
    do i = 1, there
      opposite = transpose(matrices(:, :, first + i - 1))
      largest = maxval(abs(opposite))
      means(:, :, i) = 0.0d0
      if (largest <= huge(largest) .and. maxval(abs(matrices(:, :, first + i - 1) - opposite)) &
          <= symmetric*largest) then
        means(:, :, i) = 0.5d0*matrices(:, :, first + i - 1) + 0.5d0*opposite
      end if
    end do
    call find_frames(there, means, m, vectors(:, :, first:), numbers(:, first:), &
                     axes(:, :, first:), components(:, :, first:), status(first:))
  end do
end subroutine inertia_frames

subroutine turn_rows(m, n_axes, axes, turns, n, omega, n_attitudes, attitude)
  ! Transform m states of each body from a frame to the axes in which the frame is specified.
  !f2py threadsafe
  implicit none
  integer(4), intent(in) :: m
  integer(4), intent(in) :: n_axes              ! 1, or one for each body
  real(8), intent(in) :: axes(3, 3, n_axes)     ! in columns
  real(8), intent(in) :: turns(4, n_axes)       ! their quaternions
  integer(4), intent(in) :: n                   ! number of bodies, or 0 without omega
  real(8), intent(inout) :: omega(3, m, n)
  integer(4), intent(in) :: n_attitudes         ! the same of attitudes
  real(8), intent(inout) :: attitude(4, m, n_attitudes)
  real(8) :: a(3, 3), v(3), p(4), q(4)
  integer(4) :: i, k

  do i = 1, n
    a = axes(:, :, min(i, n_axes))
    do k = 1, m
      v = omega(:, k, i)
      omega(1, k, i) = (v(1)*a(1, 1) + v(2)*a(1, 2)) + v(3)*a(1, 3)
      omega(2, k, i) = (v(1)*a(2, 1) + v(2)*a(2, 2)) + v(3)*a(2, 3)
      omega(3, k, i) = (v(1)*a(3, 1) + v(2)*a(3, 2)) + v(3)*a(3, 3)
    end do
  end do
  do i = 1, n_attitudes
    q = turns(:, min(i, n_axes))
    do k = 1, m
      p = attitude(:, k, i)
      attitude(1, k, i) = p(1)*q(1) + p(2)*q(2) + p(3)*q(3) + p(4)*q(4)
      attitude(2, k, i) = p(2)*q(1) - p(1)*q(2) - p(3)*q(4) + p(4)*q(3)
      attitude(3, k, i) = p(2)*q(4) - p(1)*q(3) + p(3)*q(1) - p(4)*q(2)
      attitude(4, k, i) = -(p(1)*q(4)) - p(2)*q(3) + p(3)*q(2) + p(4)*q(1)
    end do
  end do
end subroutine turn_rows

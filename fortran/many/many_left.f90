module many_left
  !! Bodies that no multi-lane kernel solves: the single-body kernel solves them one after the
  !! other.
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: acts, bodies_t, coefficients_of, i1, NEEDS_FALLBACK, of_body, put_estimates
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use nearness, only: bring_near_one
  use many_kinds, only: is_sphere, single_code
  use methods, only: CLOSED_FORM, CLOSED_FORM_OR_TAYLOR, GAUSS, SPHERE, TAYLOR
  use places, only: COEFFICIENTS, COEFFICIENTS_LOW, CONSTANT, EFFORT, METHOD, MOMENTS, &
                    MOMENTS_LOW, N_COSINES, N_SINES, RATE, ROUNDED, STEP, TOLERANCE, WAVES
  use prepared, only: solve_prepared, solve_prepared_attitude, unpack
  use problem, only: problem_t
  use statuses, only: COMPLETE, INTERRUPTED, REFUSED, SENSITIVE
  use torque_free_differences, only: torque_free_growth_of
  use torque_noise, only: torque_noise_of
  use two_words, only: two_product, two_sum
  implicit none(type, external)
  private

  ! As in sensitivity.py, which decides what a prepared solver reports.
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter :: CLOSED_FORM_ERROR = 16.0_dp*ROUNDING ! relative
  real(dp), parameter :: NEGLIGIBLE_TO = 2.0_dp**44
  real(dp), parameter :: UNSURE = 0.3_dp ! rounding times amplification, in tolerances
  real(dp), parameter :: COARSE = 1e-3_dp, LITTLE_WORK = 5e-3_dp
  real(dp), parameter :: HARDLY_ANY = 1e300_dp ! steps: so many that their roundings average out

  integer, parameter :: BETWEEN_LOOKS = 64 ! bodies between polls for an interrupt

  public :: solve_left, solve_left_with_attitude

contains

  subroutine solve_left(bodies, code, packed, omega, status, raised)
    !! Solve the bodies that are left, one by one.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code
    real(dp), intent(in) :: packed(0:)
    real(dp), intent(inout) :: omega(3, bodies%n)
    integer(i1), intent(inout) :: status(bodies%n)
    integer, intent(out) :: raised
    real(dp) :: own(0:WAVES + 4*(size(bodies%sines, 2) + size(bodies%cosines, 2)) - 1)
    real(dp) :: found(3), time
    integer(int64) :: steps
    logical :: is_estimated
    integer :: alone, ended, i, n_own

    raised = 0
    alone = 0
    is_estimated = size(bodies%estimates, 2) > 0
    do i = 1, bodies%n
      if (status(i) /= NEEDS_FALLBACK) cycle
      alone = alone + 1
      if (mod(alone, BETWEEN_LOOKS) == 0) raised = interrupt_raised()
      if (raised /= 0) return
      time = bodies%times(of_body(size(bodies%times, 1), i))
      if (size(packed, 1) > 0) then
        call solve_prepared(packed, size(packed, 1), bodies%omega0(:, i), time, omega(:, i), &
                            ended, steps, found)
        call tell_sensitive(packed, size(packed, 1), bodies%omega0(:, i), time, steps, ended)
      else
        call pack(bodies, i, code, own, n_own)
        if (.not. is_body(bodies, i, own(:n_own - 1))) then
          status(i) = int(REFUSED, i1)
          omega(:, i) = transfer(huge(0_int64), 1.0_dp)
          call put_estimates(bodies, i, 1, -1.0_dp, -1.0_dp)
          cycle
        end if
        call solve_prepared(own, n_own, bodies%omega0(:, i), time, omega(:, i), ended, steps, found)
        call tell_sensitive(own, n_own, bodies%omega0(:, i), time, steps, ended)
        if (is_estimated) then
          call estimate(own, n_own, bodies%omega0(:, i), time, steps, ended, found)
          call put_estimates(bodies, i, 1, found(1), found(2))
        end if
      end if
      status(i) = int(ended, i1)
      if (ended == INTERRUPTED) raised = 1
    end do
  end subroutine solve_left

  subroutine solve_left_with_attitude(bodies, code, omega, status, raised)
    !! Solve the bodies that are left, with attitude, one by one.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code
    real(dp), intent(inout) :: omega(3, bodies%n)
    integer(i1), intent(inout) :: status(bodies%n)
    integer, intent(out) :: raised
    real(dp) :: own(0:WAVES + 4*(size(bodies%sines, 2) + size(bodies%cosines, 2)) - 1)
    real(dp) :: start(7), state(7), found(3), time
    integer(int64) :: steps
    logical :: is_estimated
    integer :: alone, ended, i, n_own, power

    raised = 0
    alone = 0
    is_estimated = size(bodies%estimates, 2) > 0
    do i = 1, bodies%n
      if (status(i) /= NEEDS_FALLBACK) cycle
      alone = alone + 1
      if (mod(alone, BETWEEN_LOOKS) == 0) raised = interrupt_raised()
      if (raised /= 0) return
      call pack(bodies, i, code, own, n_own)
      if (.not. is_body(bodies, i, own(:n_own - 1))) then
        status(i) = int(REFUSED, i1)
        omega(:, i) = transfer(huge(0_int64), 1.0_dp)
        bodies%attitude(:, i) = omega(1, i)
        call put_estimates(bodies, i, 1, -1.0_dp, -1.0_dp)
        cycle
      end if
      time = bodies%times(of_body(size(bodies%times, 1), i))
      start(:3) = bodies%omega0(:, i)
      start(4:) = bodies%attitude0(:, of_body(size(bodies%attitude0, 2), i))
      call bring_near_one(start(4:), power)
      start(4:) = start(4:)/sqrt(sum(start(4:)**2))
      call solve_prepared_attitude(own, n_own, start, time, state, ended, steps, found)
      call tell_sensitive(own, n_own, start, time, steps, ended)
      if (is_estimated) then
        call estimate(own, n_own, start, time, steps, ended, found)
        call put_estimates(bodies, i, 1, found(1), found(2))
      end if
      omega(:, i) = state(:3)
      bodies%attitude(:, i) = state(4:)
      status(i) = int(ended, i1)
      if (ended == INTERRUPTED) raised = 1
    end do
  end subroutine solve_left_with_attitude

  pure logical function is_body(bodies, i, packed)
    !! Return whether the moments of a body are above 0 and all its numbers are finite.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    real(dp), intent(in) :: packed(0:) !! the body as single-body kernels take it

    is_body = all(abs(packed) <= huge(1.0_dp))
    if (bodies%by_moments) then
      is_body = is_body .and. all(bodies%body(:, of_body(size(bodies%body, 2), i)) > 0.0_dp)
    end if
  end function is_body

  subroutine pack(bodies, i, code, packed, n_packed)
    !! Pack body i as prepared.f90 reads it.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i, code
    real(dp), intent(inout) :: packed(0:)
    integer, intent(out) :: n_packed   !! length, with the waves that act on the body
    real(dp) :: of(3)
    integer :: column, k

    of = 1.0_dp
    if (bodies%by_moments) of = bodies%body(:, of_body(size(bodies%body, 2), i))
    packed(METHOD) = real(single_code(bodies, i, code), dp)
    packed(TOLERANCE) = bodies%tolerance
    packed(STEP) = bodies%step
    packed(COEFFICIENTS:COEFFICIENTS + 2) = coefficients_of(bodies, i)
    packed(CONSTANT:CONSTANT + 2) = bodies%constant(:, of_body(size(bodies%constant, 2), i))/of
    packed(RATE:RATE + 2) = bodies%rate(:, of_body(size(bodies%rate, 2), i))/of
    packed(EFFORT) = bodies%effort
    packed(ROUNDED) = merge(1.0_dp, 0.0_dp, bodies%is_rounded)
    packed(COEFFICIENTS_LOW:COEFFICIENTS_LOW + 2) = 0.0_dp
    packed(MOMENTS:MOMENTS + 2) = of
    packed(MOMENTS_LOW:MOMENTS_LOW + 2) = 0.0_dp
    if (bodies%by_moments) then
      packed(COEFFICIENTS_LOW) = remainder_of(of(2), of(3), of(1))
      packed(COEFFICIENTS_LOW + 1) = remainder_of(of(3), of(1), of(2))
      packed(COEFFICIENTS_LOW + 2) = remainder_of(of(1), of(2), of(3))
    end if
    n_packed = WAVES
    column = of_body(size(bodies%sines, 3), i)
    do k = 1, size(bodies%sines, 2)
      if (.not. acts(bodies%sines(:, k, column))) cycle
      packed(n_packed:n_packed + 3) = bodies%sines(:, k, column)/[of, 1.0_dp]
      n_packed = n_packed + 4
    end do
    packed(N_SINES) = real((n_packed - WAVES)/4, dp)
    column = of_body(size(bodies%cosines, 3), i)
    do k = 1, size(bodies%cosines, 2)
      if (.not. acts(bodies%cosines(:, k, column))) cycle
      packed(n_packed:n_packed + 3) = bodies%cosines(:, k, column)/[of, 1.0_dp]
      n_packed = n_packed + 4
    end do
    packed(N_COSINES) = real((n_packed - WAVES)/4, dp) - packed(N_SINES)
  end subroutine pack

  subroutine tell_sensitive(packed, n_packed, omega0, time, steps, status)
    !! Report a result as sensitive where a prepared solver does. The closed forms and Gauss
    !! collocation do not measure the error amplification themselves.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)   !! rad/s
    real(dp), intent(in) :: time        !! s
    integer(int64), intent(in) :: steps !! 0 with a closed form
    integer, intent(inout) :: status
    real(dp) :: copy(0:n_packed - 1)
    real(dp) :: enough       ! amplification beyond which the result is sensitive
    real(dp) :: growth, omega(3), found(3)
    integer(int64) :: coarse_steps
    integer :: code, coarse_status

    code = int(packed(METHOD))
    if (status /= COMPLETE .or. steps /= 0 .and. code < GAUSS) return
    if (.not. (code > GAUSS .or. code == SPHERE .or. code == CLOSED_FORM &
               .or. code == CLOSED_FORM_OR_TAYLOR)) return
    enough = UNSURE*packed(TOLERANCE)/ROUNDING/roundings_of(packed, n_packed, omega0, time)
    growth = 1.0_dp
    if (abs(time) > 0.0_dp .and. .not. is_sphere(packed(COEFFICIENTS:COEFFICIENTS + 2))) then
      growth = -1.0_dp
      if (code < GAUSS .or. .not. (any(abs(packed(CONSTANT:RATE + 2)) > 0.0_dp) &
                                   .or. n_packed > WAVES)) then
        if (code < GAUSS .and. .not. packed(ROUNDED) > 0.0_dp) enough = max(enough, NEGLIGIBLE_TO)
        growth = torque_free_growth_of(packed(COEFFICIENTS:COEFFICIENTS + 2), omega0, time, enough)
      end if
      if (growth < 0.0_dp .and. code > GAUSS) then
        copy = packed
        copy(METHOD) = real(TAYLOR, dp)
        copy(TOLERANCE) = COARSE
        copy(EFFORT) = LITTLE_WORK
        call solve_prepared(copy, n_packed, omega0, time, omega, coarse_status, coarse_steps, found)
        growth = found(2)
        if (coarse_status /= COMPLETE .and. coarse_status /= SENSITIVE) growth = -1.0_dp
        if (coarse_status == INTERRUPTED) status = INTERRUPTED
      end if
    end if
    if (growth > enough .and. status == COMPLETE) status = SENSITIVE
  end subroutine tell_sensitive

  real(dp) function roundings_of(packed, n_packed, omega0, time)
    !! Return the rounding errors of omega and of the torque's terms, in roundings of omega. Terms
    !! that nearly cancel have larger rounding errors than their sum.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)   !! rad/s
    real(dp), intent(in) :: time        !! s
    real(dp) :: steps
    type(problem_t) :: torque

    roundings_of = 1.0_dp
    if (n_packed <= WAVES) return
    call unpack(packed, n_packed, torque)
    steps = HARDLY_ANY
    if (int(packed(METHOD)) > GAUSS) steps = min(HARDLY_ANY, abs(time)/packed(STEP))
    roundings_of = 1.0_dp + torque_noise_of(torque, time, steps, -maxval(abs(omega0)))
  end function roundings_of

  subroutine estimate(packed, n_packed, omega0, time, steps, status, found)
    !! Complete the estimates of a result where a prepared solver does; see closed_form_estimate of
    !! sensitivity.py.
    integer, intent(in) :: n_packed
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)   !! rad/s
    real(dp), intent(in) :: time        !! s
    integer(int64), intent(in) :: steps !! 0 with a closed form
    integer, intent(in) :: status
    real(dp), intent(inout) :: found(2) !! estimated relative error, amplification; negative: none
    real(dp) :: amplified               ! factor of rounding errors

    if (.not. (status == COMPLETE .or. status == SENSITIVE)) then
      found = -1.0_dp
    else if (steps == 0 .and. int(packed(METHOD)) < GAUSS .and. int(packed(METHOD)) /= TAYLOR) then
      found = [-1.0_dp, 1.0_dp]
      if (abs(time) > 0.0_dp .and. .not. is_sphere(packed(COEFFICIENTS:COEFFICIENTS + 2))) then
        found(2) = torque_free_growth_of(packed(COEFFICIENTS:COEFFICIENTS + 2), omega0, time)
      end if
      if (found(2) < 0.0_dp) return
      amplified = 1.0_dp
      if (found(2) >= NEGLIGIBLE_TO .or. packed(ROUNDED) > 0.0_dp) amplified = found(2)
      found(1) = ROUNDING*amplified*roundings_of(packed, n_packed, omega0, time) + CLOSED_FORM_ERROR
    end if
  end subroutine estimate

  pure real(dp) function remainder_of(x, y, z)
    !! Return the rounding error of (x - y)/z.
    real(dp), intent(in) :: x, y, z
    real(dp) :: difference, difference_low, product, product_low

    call two_sum(x, -y, difference, difference_low)
    call two_product(difference/z, z, product, product_low)
    remainder_of = ((difference - product) + (difference_low - product_low))/z
    if (.not. abs(remainder_of) <= huge(x)) remainder_of = 0.0_dp
  end function remainder_of

end module many_left

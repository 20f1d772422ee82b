module many_bodies
  !! Many bodies in one call: side by side where that will do, and each by itself what is left.
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: bodies_t, coefficients_of, has_torque, i1, LEFT, of_body
  use kinds, only: dp
  use levels, only: many_fixed, many_free, many_taylor
  use methods, only: CLOSED_FORM, CLOSED_FORM_OR_TAYLOR, IMPROVED_EULER, QUICK_OR_TAYLOR, RK4, &
                     TAYLOR
  use places, only: COEFFICIENTS, COEFFICIENTS_LOW, CONSTANT, EFFORT, METHOD, MOMENTS, &
                    MOMENTS_LOW, N_COSINES, N_SINES, RATE, STEP, TOLERANCE, WAVES
  use prepared, only: solve_prepared, solve_prepared_attitude
  use statuses, only: INTERRUPTED, REFUSED
  use two_words, only: two_product, two_sum
  implicit none(type, external)
  private

  public :: solve_bodies, solve_packed_bodies

contains

  subroutine solve_packed_bodies(packed, n_packed, n, omega0, n_times, times, omega, status, &
                                 raised)
    !! Many starts of one prepared scene.
    integer, intent(in) :: n_packed, n, n_times
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in), target :: omega0(3, n)
    real(dp), intent(in), target :: times(n_times)
    real(dp), intent(inout) :: omega(3, n)
    integer(i1), intent(inout) :: status(n)
    integer, intent(out) :: raised
    type(bodies_t) :: bodies
    real(dp) :: no_attitude(4, 0)
    integer :: code, middle

    code = int(packed(METHOD))
    if (code == QUICK_OR_TAYLOR) code = TAYLOR
    bodies%by_moments = .false.
    bodies%tolerance = packed(TOLERANCE)
    bodies%step = packed(STEP)
    bodies%n = n
    bodies%body(1:3, 1:1) => packed(COEFFICIENTS:COEFFICIENTS + 2)
    bodies%constant(1:3, 1:1) => packed(CONSTANT:CONSTANT + 2)
    bodies%rate(1:3, 1:1) => packed(RATE:RATE + 2)
    middle = WAVES + 4*int(packed(N_SINES))
    bodies%sines(1:4, 1:int(packed(N_SINES)), 1:1) => packed(WAVES:middle - 1)
    bodies%cosines(1:4, 1:int(packed(N_COSINES)), 1:1) => packed(middle:n_packed - 1)
    bodies%omega0 => omega0
    bodies%times => times
    call solve_bodies(bodies, code, packed(EFFORT), packed, no_attitude, omega, no_attitude, &
                      status, raised)
  end subroutine solve_packed_bodies

  subroutine solve_bodies(bodies, code, effort_, packed, attitude0, omega, attitude, status, raised)
    !! Angular velocity of each body at its time, and its attitude where that is given.
    type(bodies_t), intent(in), target :: bodies
    integer, intent(in) :: code                !! of the module methods
    real(dp), intent(in) :: effort_            !! factor on the limits, for each body
    real(dp), intent(in) :: packed(0:)         !! the scene of all, as in prepared.f90; or none
    real(dp), intent(in) :: attitude0(:, :)    !! (4, 0, 1 or n)
    real(dp), intent(inout) :: omega(3, bodies%n) !! rad/s; NaN unless the status is 0 or 6
    real(dp), intent(inout) :: attitude(:, :)  !! (4, n), or nothing
    integer(i1), intent(inout) :: status(bodies%n) !! of the module statuses
    integer, intent(out) :: raised             !! 1: interrupted by the user, all is void
    logical :: with_torque

    raised = 0
    if (bodies%n == 0) return
    with_torque = has_torque(bodies)
    ! A body alone takes less time by itself.
    if (size(attitude0) > 0 .or. bodies%n == 1) then
      status = LEFT
    else if (code == CLOSED_FORM .or. (code == CLOSED_FORM_OR_TAYLOR .and. .not. with_torque)) then
      call many_free(c_loc(bodies), bodies%n, omega, status)
    else if (code == TAYLOR .or. code == CLOSED_FORM_OR_TAYLOR) then
      call many_taylor(c_loc(bodies), bodies%n, omega, status, raised)
    else if (code >= IMPROVED_EULER .and. code <= RK4) then
      call many_fixed(c_loc(bodies), code, bodies%n, omega, status, raised)
    else
      status = LEFT
    end if
    if (raised /= 0 .or. .not. any(status == LEFT)) then
      continue
    else if (size(attitude0) > 0) then
      call solve_left_with_attitude(bodies, code, with_torque, effort_, attitude0, omega, &
                                    attitude, status, raised)
    else
      call solve_left(bodies, code, with_torque, effort_, packed, omega, status, raised)
    end if
  end subroutine solve_bodies

  subroutine solve_left(bodies, code, with_torque, effort_, packed, omega, status, raised)
    !! What is left, one by one.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code
    logical, intent(in) :: with_torque
    real(dp), intent(in) :: effort_
    real(dp), intent(in) :: packed(0:)
    real(dp), intent(inout) :: omega(3, bodies%n)
    integer(i1), intent(inout) :: status(bodies%n)
    integer, intent(out) :: raised
    real(dp) :: own(0:WAVES + 4*(size(bodies%sines, 2) + size(bodies%cosines, 2)) - 1)
    real(dp) :: found(2)
    integer(int64) :: steps
    integer :: ended, i

    raised = 0
    do i = 1, bodies%n
      if (status(i) /= LEFT) cycle
      if (size(packed) > 0) then
        call solve_prepared(packed, size(packed), bodies%omega0(:, i), &
                            bodies%times(of_body(size(bodies%times), i)), omega(:, i), ended, &
                            steps, found)
      else
        call pack(bodies, i, code, with_torque, effort_, own)
        if (.not. is_body(bodies, i, own)) then
          status(i) = int(REFUSED, i1)
          omega(:, i) = transfer(huge(0_int64), 1.0_dp)
          cycle
        end if
        call solve_prepared(own, size(own), bodies%omega0(:, i), &
                            bodies%times(of_body(size(bodies%times), i)), omega(:, i), ended, &
                            steps, found)
      end if
      status(i) = int(ended, i1)
      if (ended == INTERRUPTED) raised = 1
      if (raised /= 0) return
    end do
  end subroutine solve_left

  subroutine solve_left_with_attitude(bodies, code, with_torque, effort_, attitude0, omega, &
                                      attitude, status, raised)
    !! The same with attitude.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code
    logical, intent(in) :: with_torque
    real(dp), intent(in) :: effort_
    real(dp), intent(in) :: attitude0(:, :)
    real(dp), intent(inout) :: omega(3, bodies%n)
    real(dp), intent(inout) :: attitude(:, :)
    integer(i1), intent(inout) :: status(bodies%n)
    integer, intent(out) :: raised
    real(dp) :: own(0:WAVES + 4*(size(bodies%sines, 2) + size(bodies%cosines, 2)) - 1)
    real(dp) :: start(7), state(7), found(2)
    integer(int64) :: steps
    integer :: ended, i

    raised = 0
    do i = 1, bodies%n
      call pack(bodies, i, code, with_torque, effort_, own)
      if (.not. is_body(bodies, i, own)) then
        status(i) = int(REFUSED, i1)
        omega(:, i) = transfer(huge(0_int64), 1.0_dp)
        attitude(:, i) = omega(1, i)
        cycle
      end if
      start(:3) = bodies%omega0(:, i)
      start(4:) = attitude0(:, of_body(size(attitude0, 2), i))
      call solve_prepared_attitude(own, size(own), start, &
                                   bodies%times(of_body(size(bodies%times), i)), state, ended, &
                                   steps, found)
      omega(:, i) = state(:3)
      attitude(:, i) = state(4:)
      status(i) = int(ended, i1)
      if (ended == INTERRUPTED) raised = 1
      if (raised /= 0) return
    end do
  end subroutine solve_left_with_attitude

  pure logical function is_body(bodies, i, packed)
    !! Whether a body has moments above 0, and all its numbers are finite.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    real(dp), intent(in) :: packed(0:) !! the same as single kernels take it

    is_body = all(abs(packed) <= huge(1.0_dp))
    if (bodies%by_moments) then
      is_body = is_body .and. all(bodies%body(:, of_body(size(bodies%body, 2), i)) > 0.0_dp)
    end if
  end function is_body

  subroutine pack(bodies, i, code, with_torque, effort_, packed)
    !! Body i for prepared.f90.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i, code
    logical, intent(in) :: with_torque
    real(dp), intent(in) :: effort_
    real(dp), intent(inout) :: packed(0:)
    real(dp) :: of(3)
    integer :: k, of_sines, of_both

    of_sines = size(bodies%sines, 2)
    of_both = of_sines + size(bodies%cosines, 2)
    of = 1.0_dp
    if (bodies%by_moments) of = bodies%body(:, of_body(size(bodies%body, 2), i))
    packed(METHOD) = real(code, dp)
    ! Whoever asked for auto has the closed form only without torque.
    if (code == CLOSED_FORM_OR_TAYLOR .and. with_torque) packed(METHOD) = real(TAYLOR, dp)
    packed(TOLERANCE) = bodies%tolerance
    packed(STEP) = bodies%step
    packed(N_SINES) = real(of_sines, dp)
    packed(N_COSINES) = real(of_both - of_sines, dp)
    packed(COEFFICIENTS:COEFFICIENTS + 2) = coefficients_of(bodies, i)
    packed(CONSTANT:CONSTANT + 2) = bodies%constant(:, of_body(size(bodies%constant, 2), i))/of
    packed(RATE:RATE + 2) = bodies%rate(:, of_body(size(bodies%rate, 2), i))/of
    packed(EFFORT) = effort_
    packed(COEFFICIENTS_LOW:COEFFICIENTS_LOW + 2) = 0.0_dp
    packed(MOMENTS:MOMENTS + 2) = of
    packed(MOMENTS_LOW:MOMENTS_LOW + 2) = 0.0_dp
    if (bodies%by_moments) then
      packed(COEFFICIENTS_LOW) = remainder_of(of(2), of(3), of(1))
      packed(COEFFICIENTS_LOW + 1) = remainder_of(of(3), of(1), of(2))
      packed(COEFFICIENTS_LOW + 2) = remainder_of(of(1), of(2), of(3))
    end if
    do k = 1, of_sines
      packed(WAVES + 4*k - 4:WAVES + 4*k - 1) = &
        bodies%sines(:, k, of_body(size(bodies%sines, 3), i))/[of, 1.0_dp]
    end do
    do k = of_sines + 1, of_both
      packed(WAVES + 4*k - 4:WAVES + 4*k - 1) = &
        bodies%cosines(:, k - of_sines, of_body(size(bodies%cosines, 3), i))/[of, 1.0_dp]
    end do
  end subroutine pack

  pure real(dp) function remainder_of(x, y, z)
    !! What rounding takes off (x - y)/z.
    real(dp), intent(in) :: x, y, z
    real(dp) :: difference, difference_low, product, product_low

    call two_sum(x, -y, difference, difference_low)
    call two_product(difference/z, z, product, product_low)
    remainder_of = ((difference - product) + (difference_low - product_low))/z
    if (.not. abs(remainder_of) <= huge(x)) remainder_of = 0.0_dp
  end function remainder_of

end module many_bodies

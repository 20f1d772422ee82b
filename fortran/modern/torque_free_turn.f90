module torque_free_turn
  !! The state of a torque-free motion at a time, from its constants: angular velocity and attitude.
  use kinds, only: dp
  use statuses, only: COMPLETE, GAVE_UP, OVERFLOW
  use theta_functions, only: elliptic_functions, theta_t
  use two_words, only: scaled, sine_cosine, two_sum
  use word_pairs, only: pair_t
  implicit none(type, external)
  private

  real(dp), parameter :: LARGE_PHASE = 1e15_dp

  type, public :: orbit_t
    !! One torque-free motion, in axes of its own. Axis 2 has the middle moment, omega about axis 3
    !! does not change its sign, and axes 1, 2, 3 are right-handed.
    logical :: is_steady
    integer :: axes(3)          !! axis of the body for each axis of the orbit
    real(dp) :: signs(3)        !! a component of the orbit is this times that of the body
    integer :: omega_exponent   !! angular velocity is 2**this times the orbit's
    real(dp) :: omega(3)        !! at time 0, about the body's axes, as specified
    real(dp) :: attitude(4)     !! at time 0, about the body's axes
    real(dp) :: before(4)       !! q = before D, with the vector part in axes of the orbit
    type(pair_t) :: half_rate   !! of the rotation about axis 3, without the theta function's part
    type(pair_t) :: frequency   !! frequency of the phase
    type(pair_t) :: start       !! the phase at time 0
    type(theta_t) :: theta      !! its sizes contain the amplitudes of omega
    real(dp) :: direction(3)    !! times omega it is L/|L|; for a steady omega, omega/|omega|
    real(dp) :: sense           !! sign of the phase: that of I3 - I1
  end type orbit_t

  public :: evaluate, into_orbit, product_of_quaternions, turned

contains

  pure subroutine evaluate(orbit, time, omega, attitude, status)
    !! Compute the state at a time.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: time
    real(dp), intent(out) :: omega(3), attitude(4)
    integer, intent(out) :: status
    real(dp) :: t              ! time in the orbit's unit
    real(dp) :: w(3), turn(4)
    logical :: has_phase
    integer :: i

    status = COMPLETE
    t = time
    if (orbit%omega_exponent /= 0) t = scale(time, orbit%omega_exponent)
    if (.not. abs(t) > 0.0_dp) then
      omega = orbit%omega
      attitude = orbit%attitude
      return
    end if
    call turned(orbit, t, w, turn, has_phase)
    if (.not. has_phase) then
      status = GAVE_UP
      return
    end if
    turn = product_of_quaternions(orbit%before, turn)
    attitude(1) = turn(1)
    do i = 1, 3
      attitude(1 + orbit%axes(i)) = orbit%signs(i)*turn(1 + i)
    end do
    if (orbit%is_steady) then
      omega = orbit%omega
      return
    end if
    if (orbit%omega_exponent /= 0) w = scale(w, orbit%omega_exponent)
    if (.not. (abs(w(1)) <= huge(t) .and. abs(w(2)) <= huge(t) .and. abs(w(3)) <= huge(t))) then
      status = OVERFLOW
      return
    end if
    do i = 1, 3
      omega(orbit%axes(i)) = orbit%signs(i)*w(i)
    end do
  end subroutine evaluate

  pure subroutine turned(orbit, t, w, turn, has_phase)
    !! Compute angular velocity and the rotation D, in axes of the orbit.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: t
    real(dp), intent(out) :: w(3), turn(4)
    logical, intent(out) :: has_phase ! whether the phase has a digit left
    real(dp) :: angle, angle_low, rest, sine, cosine
    real(dp) :: c, s           ! theta function of the rotation: real and imaginary part
    real(dp) :: part           ! angle that the theta function adds
    real(dp) :: m(3)           ! direction of the angular momentum
    real(dp) :: along, across, inverse
    type(pair_t) :: phase

    has_phase = .false.
    w = 0.0_dp
    turn = 0.0_dp
    call scaled(orbit%half_rate%high, orbit%half_rate%low, t, angle, angle_low)
    if (.not. abs(angle) <= 0.5_dp*LARGE_PHASE) return
    if (orbit%is_steady) then
      call sine_cosine(angle, angle_low, sine, cosine)
      turn = [cosine, orbit%direction*sine]
      has_phase = .true.
      return
    end if
    call scaled(orbit%frequency%high, orbit%frequency%low, t, c, s)
    if (.not. abs(c) <= LARGE_PHASE) return
    has_phase = .true.
    call two_sum(orbit%start%high, c, phase%high, phase%low)
    phase%low = phase%low + (s + orbit%start%low)
    call elliptic_functions(orbit%theta, phase%high, phase%low, w, c, s, part)
    part = part*orbit%sense
    call two_sum(angle, part, angle, rest)
    call sine_cosine(angle, angle_low + rest, sine, cosine)
    m = w*orbit%direction
    s = s*orbit%sense
    inverse = 1.0_dp/sqrt((c*c + s*s)*(2.0_dp + 2.0_dp*m(3)))
    along = (cosine*c - sine*s)*inverse
    across = (sine*c + cosine*s)*inverse
    turn = [along*(1.0_dp + m(3)), along*m(2) + across*m(1), across*m(2) - along*m(1), &
            across*(1.0_dp + m(3))]
  end subroutine turned

  pure function into_orbit(orbit, attitude) result(found)
    !! Return a quaternion with its vector part in axes of the orbit.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: attitude(4)
    real(dp) :: found(4)

    found(1) = attitude(1)
    found(2:4) = orbit%signs*attitude(1 + orbit%axes)
  end function into_orbit

  pure function product_of_quaternions(p, q) result(found)
    real(dp), intent(in) :: p(4), q(4)
    real(dp) :: found(4)

    found = [p(1)*q(1) - p(2)*q(2) - (p(3)*q(3) + p(4)*q(4)), &
             p(1)*q(2) + p(2)*q(1) + (p(3)*q(4) - p(4)*q(3)), &
             p(1)*q(3) + p(3)*q(1) + (p(4)*q(2) - p(2)*q(4)), &
             p(1)*q(4) + p(4)*q(1) + (p(2)*q(3) - p(3)*q(2))]
  end function product_of_quaternions

end module torque_free_turn

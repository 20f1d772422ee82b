module torque_free
  !! The closed form of equations 13-15 without torque, by Jacobi's elliptic functions. Neither cost
  !! nor error depends on the time. A symmetric body under constant torque is left to the series:
  !! its closed form needs Fresnel integrals of arguments that overflow as M3 -> 0, and is slower
  !! than a Taylor step.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use nearness, only: bring_near_one, LARGE
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, REFUSED
  use two_words, only: scaled, sine_cosine, square_root, two_product, two_sum
  implicit none(type, external)
  private

  integer, parameter :: STEADY = 0           ! constant rates: omega is linear in time
  integer, parameter :: SEPARATRIX = 1       ! hyperbolic functions
  integer, parameter :: ELLIPTIC = 2
  integer, parameter :: BETWEEN_LOOKS = 2**17 ! times between polls for an interrupt
  integer, parameter :: MOST_LEVELS = 16     ! of the arithmetic-geometric mean; 1e-120 needs 13

  real(dp), parameter :: FLAT = 4e-9_dp       ! difference whose square is negligible
  real(dp), parameter :: FAINT = 1e-240_dp    ! squares of smaller perturbations would underflow
  ! Smaller numbers may have lost digits, after coefficients and omega were brought near 1.
  real(dp), parameter :: TINY_FACTOR = 1e-290_dp, TINY_SQUARE = 1e-250_dp
  real(dp), parameter :: LARGE_PHASE = 1e15_dp
  real(dp), parameter :: TWO_PI = 6.28318530717958648_dp

  type :: orbit_t
    !! One torque-free motion. Axis 2 of the orbit has the coefficient with the odd sign (the middle
    !! moment), and omega about axis 3 does not change its sign.
    integer :: kind, levels
    integer :: axes(3)               !! axis of the body for each axis of the orbit
    integer :: time_exponent         !! the orbit's time is 2**this times the time; mostly 0
    integer :: omega_exponent        !! angular velocity is 2**this times the orbit's
    real(dp) :: omega(3)             !! at time 0
    real(dp) :: rates(3)             !! A omega2 omega3 and so on, at time 0
    real(dp) :: frequency            !! phase over time, rad/s in the orbit's units
    real(dp) :: frequency_low        !! low-order part of the frequency (double-double)
    real(dp) :: amplitude(3)         !! |B C| omega1**2 and so on
    real(dp) :: modulus              !! of dn at time 0: amplitude(2) + amplitude(3)
    real(dp) :: half_gap             !! half of amplitude(1) + amplitude(2)
    real(dp) :: upper(MOST_LEVELS)   !! a(n) a(n-1) of the arithmetic-geometric mean
    real(dp) :: lower(MOST_LEVELS)   !! a(n) b(n-1)
  end type orbit_t

  public :: torque_free_period_of, torque_free_rows

contains

  pure real(dp) function torque_free_period_of(coefficients, coefficients_low, omega0)
    !! Return the period of the angular velocity of a torque-free body, s; 0 if it is constant, has
    !! no period, or is not bounded.
    real(dp), intent(in) :: coefficients(3), coefficients_low(3) !! as in torque_free_rows
    real(dp), intent(in) :: omega0(3)        !! at time 0, rad/s, finite
    type(orbit_t) :: orbit
    integer :: status

    call prepare(coefficients, coefficients_low, omega0, orbit, status)
    torque_free_period_of = 0.0_dp
    if (status == COMPLETE .and. orbit%kind == ELLIPTIC) then
      torque_free_period_of = scale(TWO_PI/(orbit%frequency + orbit%frequency_low), &
                                    -orbit%time_exponent)
    end if
  end function torque_free_period_of

  subroutine torque_free_rows(coefficients, coefficients_low, omega0, n_times, times, rows, &
                              n_rows, status)
    !! Compute the angular velocity of a torque-free body at each of `times`.
    real(dp), intent(in) :: coefficients(3)  !! A, B, C; not all of one sign, finite
    real(dp), intent(in) :: coefficients_low(3) !! low-order parts of A, B, C (double-double)
    real(dp), intent(in) :: omega0(3)        !! at time 0, rad/s, finite
    integer, intent(in) :: n_times
    real(dp), intent(in) :: times(n_times)   !! s, in any order, finite
    real(dp), intent(out) :: rows(3, n_times) !! rad/s
    integer, intent(out) :: n_rows           !! number of rows that hold a result
    integer, intent(out) :: status           !! any but STOPPED
    type(orbit_t) :: orbit
    integer :: i

    n_rows = 0
    call prepare(coefficients, coefficients_low, omega0, orbit, status)
    if (status /= COMPLETE) return
    do i = 1, n_times
      call evaluate(orbit, times(i), rows(:, i), status)
      if (status /= COMPLETE) return
      n_rows = i
      if (mod(i, BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) then
          status = INTERRUPTED
          return
        end if
      end if
    end do
  end subroutine torque_free_rows

  pure subroutine prepare(coefficients, coefficients_low, omega0, orbit, status)
    !! Compute everything about a motion that does not depend on the time.
    real(dp), intent(in) :: coefficients(3), coefficients_low(3), omega0(3)
    type(orbit_t), intent(out) :: orbit
    integer, intent(out) :: status           !! COMPLETE or REFUSED
    real(dp) :: a(3)         ! coefficients along the axes of the orbit
    real(dp) :: w(3)         ! angular velocity along them
    real(dp) :: s(3), s_low(3) ! |a| in double-double
    real(dp) :: y(3), y_low(3) ! squares of w in double-double
    real(dp) :: left, left_low, right, right_low ! parts of sums
    real(dp) :: gap, gap_low ! |a1| w3**2 - |a3| w1**2: its sign selects axis 3
    real(dp) :: modulus, modulus_low     ! square of the larger initial value of the mean
    real(dp) :: comodulus, comodulus_low ! square of the smaller initial value
    real(dp) :: largest
    integer :: i, j

    a = coefficients
    s_low = sign(1.0_dp, a)*coefficients_low
    w = omega0
    orbit%time_exponent = 0
    orbit%omega_exponent = 0
    ! The condition is repeated here, as a call would take a twentieth of the whole time.
    largest = max(abs(a(1)), abs(a(2)), abs(a(3)))
    if (.not. (largest <= LARGE .and. largest >= 1.0_dp/LARGE)) then
      call bring_near_one(a, orbit%time_exponent)
      s_low = scale(s_low, -orbit%time_exponent)
    end if
    largest = max(abs(w(1)), abs(w(2)), abs(w(3)))
    if (.not. (largest <= LARGE .and. largest >= 1.0_dp/LARGE)) then
      call bring_near_one(w, orbit%omega_exponent)
      orbit%time_exponent = orbit%time_exponent + orbit%omega_exponent
    end if

    ! Find the coefficient with the odd sign; a zero has either sign.
    status = COMPLETE
    if (a(1)*a(3) >= 0.0_dp .and. a(1)*a(2) <= 0.0_dp .and. a(2)*a(3) <= 0.0_dp) then
      orbit%axes = [1, 2, 3]
    else if (a(1)*a(2) >= 0.0_dp .and. a(1)*a(3) <= 0.0_dp .and. a(2)*a(3) <= 0.0_dp) then
      orbit%axes = [2, 3, 1]
    else if (a(2)*a(3) >= 0.0_dp .and. a(1)*a(2) <= 0.0_dp .and. a(1)*a(3) <= 0.0_dp) then
      orbit%axes = [3, 1, 2]
    else
      status = REFUSED
      return
    end if
    if (any(abs(a) < TINY_FACTOR .and. abs(coefficients) > 0.0_dp) &
        .and. count(abs(w) > 0.0_dp) > 1) then
      status = REFUSED
      return
    end if
    a = a(orbit%axes)
    w = w(orbit%axes)
    s = abs(a)
    s_low = s_low(orbit%axes)
    ! Growth without bound: two coefficients of one sign, none of the other sign.
    if (.not. s(2) > 0.0_dp .and. s(1)*s(3) > 0.0_dp) then
      status = REFUSED
      return
    end if

    do i = 1, 3
      call two_product(w(i), w(i), y(i), y_low(i))
    end do
    call scaled(y(3), y_low(3), s(1), left, left_low)
    call scaled(y(1), y_low(1), s(3), right, right_low)
    call two_sum(left, -right, gap, gap_low)
    left = gap
    left_low = gap_low + ((left_low + y(3)*s_low(1)) - (right_low + y(1)*s_low(3)))
    call two_sum(left, left_low, gap, gap_low)
    if (gap < 0.0_dp) then
      orbit%axes = [orbit%axes(3), orbit%axes(2), orbit%axes(1)]
      a = [a(3), a(2), a(1)]
      w = [w(3), w(2), w(1)]
      s = [s(3), s(2), s(1)]
      s_low = [s_low(3), s_low(2), s_low(1)]
      y = [y(3), y(2), y(1)]
      y_low = [y_low(3), y_low(2), y_low(1)]
      gap = -gap
      gap_low = -gap_low
    end if
    call scaled(gap, gap_low, s(2), comodulus, comodulus_low)
    comodulus_low = comodulus_low + gap*s_low(2)
    call scaled(y(2), y_low(2), s(3), left, left_low)
    call scaled(y(3), y_low(3), s(2), right, right_low)
    call two_sum(left, right, gap, gap_low)
    gap_low = gap_low + ((left_low + y(2)*s_low(3)) + (right_low + y(3)*s_low(2)))
    call scaled(gap, gap_low, s(1), modulus, modulus_low)
    modulus_low = modulus_low + gap*s_low(1)

    orbit%omega = w
    orbit%rates = [a(1)*w(2)*w(3), a(2)*w(3)*w(1), a(3)*w(1)*w(2)]
    orbit%amplitude = [s(2)*s(3)*y(1), s(1)*s(3)*y(2), s(1)*s(2)*y(3)]
    orbit%modulus = modulus
    orbit%half_gap = 0.5_dp*(orbit%amplitude(1) + orbit%amplitude(2))
    orbit%levels = 0
    orbit%frequency = 0.0_dp
    orbit%frequency_low = 0.0_dp
    if (.not. (s(1) > 0.0_dp .and. ((s(3) > 0.0_dp .and. abs(w(2)) > 0.0_dp) .or. &
                                    (s(2) > 0.0_dp .and. abs(w(3)) > 0.0_dp)))) then
      orbit%kind = STEADY
    else if (.not. modulus >= TINY_SQUARE) then
      orbit%kind = STEADY
      if (count(abs(w) > 0.0_dp) > 1) status = REFUSED
    else if (orbit%amplitude(3) <= FAINT*modulus) then
      ! About the middle axis, except for a negligible perturbation.
      orbit%kind = STEADY
      do j = 1, 3, 2
        if (abs(w(j)) > 0.0_dp) status = REFUSED
      end do
    else
      call square_root(modulus, modulus_low, left, left_low)
      if (comodulus > 0.0_dp) then
        orbit%kind = ELLIPTIC
        call square_root(comodulus, comodulus_low, right, right_low)
        call climb(left, left_low, right, right_low, orbit)
      else
        orbit%kind = SEPARATRIX
        orbit%frequency = left
        orbit%frequency_low = left_low
      end if
    end if
  end subroutine prepare

  pure subroutine climb(a0, a0_low, b0, b0_low, orbit)
    !! Compute the arithmetic-geometric mean of a0 >= b0 > 0 in double-double, and the products of
    !! each level that `evaluate` needs.
    real(dp), intent(in) :: a0, a0_low, b0, b0_low
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: a, a_low, b, b_low
    real(dp) :: half_difference, total, mean
    real(dp) :: product, product_low, square, square_low
    integer :: n

    a = a0
    a_low = a0_low
    b = b0
    b_low = b0_low
    do n = 1, MOST_LEVELS
      half_difference = 0.5_dp*(a - b)
      total = a + b
      mean = 0.5_dp*total
      orbit%levels = n
      orbit%upper(n) = mean*a
      orbit%lower(n) = mean*b
      if (half_difference <= FLAT*mean) exit
      call two_product(a, b, product, product_low)
      product_low = product_low + (a*b_low + b*a_low)
      a_low = 0.5_dp*((b - (total - a)) + (a_low + b_low))
      a = mean
      b = sqrt(product)
      call two_product(b, b, square, square_low)
      b_low = ((product - square) + (product_low - square_low))/(b + b)
    end do
    ! One more level would subtract the second term of frequency_low.
    orbit%frequency = mean
    ! The low parts count too: beyond 1e11 radians an error of 1e-25 in a square is visible.
    half_difference = half_difference + 0.5_dp*(a_low - b_low)
    orbit%frequency_low = 0.5_dp*((b - (total - a)) + (a_low + b_low)) &
                          - half_difference*half_difference/(4.0_dp*mean)
  end subroutine climb

  pure subroutine evaluate(orbit, time, omega, status)
    !! Compute the state at a time from the state at 0, by the addition theorems of sn, cn, dn. With
    !! sn : cn = modulus**(1/2) sine : cosine, every sum in them keeps its digits.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: time
    real(dp), intent(out) :: omega(3)
    integer, intent(out) :: status
    real(dp) :: t              ! time in the orbit's unit
    real(dp) :: phase, phase_low
    real(dp) :: sine, cosine
    real(dp) :: s2, c2         ! their squares
    real(dp) :: dn             ! dn of this level
    real(dp) :: dn_below       ! dn of the next level
    real(dp) :: inverse
    real(dp) :: fallen         ! 1 - dn
    real(dp) :: turn
    real(dp) :: w(3)
    integer :: n

    status = COMPLETE
    t = time
    if (orbit%time_exponent /= 0) t = scale(time, orbit%time_exponent)
    if (orbit%kind == STEADY .or. .not. abs(t) > 0.0_dp) then
      w = orbit%omega
      do n = 1, 3
        if (abs(orbit%rates(n)) > 0.0_dp) w(n) = w(n) + orbit%rates(n)*t
      end do
    else
      call two_product(orbit%frequency, t, phase, phase_low)
      phase_low = phase_low + orbit%frequency_low*t
      if (.not. abs(phase) <= LARGE_PHASE) then
        status = GAVE_UP
        return
      end if
      fallen = 1.0_dp
      if (orbit%kind == ELLIPTIC) then
        call sine_cosine(phase, phase_low, sine, cosine)
        s2 = sine*sine
        cosine = orbit%frequency*cosine
        dn = 1.0_dp
        dn_below = 1.0_dp
        inverse = 1.0_dp
        do n = orbit%levels, 1, -1
          c2 = cosine*cosine
          inverse = 1.0_dp/(c2 + orbit%upper(n)*s2)
          dn_below = (c2 + orbit%lower(n)*s2)*inverse
          cosine = cosine*dn
          dn = dn_below
        end do
        fallen = orbit%half_gap*s2*inverse
      else if (abs(phase) < 1.0_dp) then
        sine = (sinh(phase) + phase_low*cosh(phase))/orbit%frequency
        cosine = 1.0_dp
        dn = 1.0_dp/cosh(phase)
        s2 = sine*sine
      else
        turn = exp(-abs(phase))
        turn = turn - turn*sign(phase_low, phase*phase_low)
        cosine = 2.0_dp*turn
        sine = sign(1.0_dp - turn*turn, phase)/orbit%frequency
        dn = cosine/(1.0_dp + turn*turn)
        s2 = sine*sine
      end if
      c2 = cosine*cosine
      inverse = 1.0_dp/(c2 + s2*orbit%amplitude(3))
      turn = sqrt(c2 + s2*orbit%modulus)*inverse
      ! the addition theorems of sn, cn, dn
      w(1) = (cosine*orbit%omega(1) + (sine*dn)*orbit%rates(1))*turn
      w(2) = (cosine*dn*orbit%omega(2) + sine*orbit%rates(2))*turn
      w(3) = (s2*dn*orbit%amplitude(2)*orbit%omega(3) + sine*cosine*orbit%rates(3))*inverse
      if (fallen < 0.5_dp) then
        w(3) = orbit%omega(3) + (w(3) - fallen*orbit%omega(3))
      else
        w(3) = dn*orbit%omega(3) + w(3)
      end if
    end if
    if (orbit%omega_exponent /= 0) w = scale(w, orbit%omega_exponent)
    if (.not. (abs(w(1)) <= huge(t) .and. abs(w(2)) <= huge(t) .and. abs(w(3)) <= huge(t))) then
      status = OVERFLOW
      return
    end if
    omega(orbit%axes(1)) = w(1)
    omega(orbit%axes(2)) = w(2)
    omega(orbit%axes(3)) = w(3)
  end subroutine evaluate

end module torque_free

module torque_free_attitude
  !! The closed form of equations 13-15 without torque, from the moments, and of the attitude.
  !! Jacobi's elliptic functions give omega. A theta function of the same phase gives the rotation
  !! about the angular momentum. Neither cost nor error depends on the time.
  !! A unit quaternion q, scalar first, rotates body to space: v_space = q v_body q*, and
  !! q' = q (0, omega)/2. It is q0 D(0)* D(t), where D = (rotation about axis 3) (shortest rotation
  !! of the angular momentum to axis 3).
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use nearness, only: bring_near_one, LARGE
  use statuses, only: COMPLETE, INTERRUPTED, REFUSED
  use theta_functions, only: HYPERBOLIC, start_of_phase, theta_series
  use torque_free_turn, only: evaluate, into_orbit, orbit_t, product_of_quaternions, turned
  use word_pairs, only: difference_of, longer_product, operator(*), operator(+), operator(-), &
                        operator(/), pair_t, product_of, root
  implicit none(type, external)
  private

  integer, parameter :: BETWEEN_LOOKS = 2**17 ! times between polls for an interrupt
  integer, parameter :: MOST_LEVELS = 16     ! of the arithmetic-geometric mean; 1e-120 needs 13

  real(dp), parameter :: CANCELLED = 1e-4_dp  ! remainder for which double-double is too short
  real(dp), parameter :: FLAT = 1e-10_dp      ! difference whose square is negligible
  real(dp), parameter :: LAST = 1e-17_dp      ! last term; the means then differ by less
  real(dp), parameter :: FAINT = 1e-240_dp    ! squares of smaller perturbations would underflow

  ! Differences that determine an orbit, without sign.
  type :: gaps_t
    type(pair_t) :: d12, d13, d23  ! of the moments
    type(pair_t) :: e1, e2, e3     ! d13 omega1**2 I1 + d23 omega2**2 I2 and so on
  end type gaps_t

  public :: torque_free_attitude_rows

contains

  subroutine torque_free_attitude_rows(moments, start, n_times, times, rows, attitudes, n_rows, &
                                       status)
    !! Compute angular velocity and attitude of a torque-free body at each of `times`.
    real(dp), intent(in) :: moments(3, 2)    !! in any unit; column 2: low parts (double-double)
    real(dp), intent(in) :: start(7)         !! omega, rad/s, finite, and attitude of any norm
    integer, intent(in) :: n_times
    real(dp), intent(in) :: times(n_times)   !! s, in any order, finite
    real(dp), intent(out) :: rows(3, n_times) !! rad/s
    real(dp), intent(out) :: attitudes(4, n_times) !! unit quaternions
    integer, intent(out) :: n_rows           !! number of rows that hold a result
    integer, intent(out) :: status           !! any but STOPPED
    type(orbit_t) :: orbit
    integer :: i

    n_rows = 0
    call prepare(moments(:, 1), moments(:, 2), start(:3), start(4:), orbit, status)
    if (status /= COMPLETE) return
    do i = 1, n_times
      call evaluate(orbit, times(i), rows(:, i), attitudes(:, i), status)
      if (status /= COMPLETE) return
      n_rows = i
      if (mod(i, BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) then
          status = INTERRUPTED
          return
        end if
      end if
    end do
  end subroutine torque_free_attitude_rows

  pure subroutine prepare(moments, moments_low, omega0, attitude0, orbit, status)
    !! Compute everything about a motion that does not depend on the time.
    real(dp), intent(in) :: moments(3), moments_low(3), omega0(3), attitude0(4)
    type(orbit_t), intent(out) :: orbit
    integer, intent(out) :: status           !! COMPLETE or REFUSED
    real(dp) :: moment(3)   ! moments along the axes of the orbit, scaled to near 1
    real(dp) :: w(3)        ! angular velocity along them
    type(pair_t) :: exact(3) ! the moments in double-double
    type(pair_t) :: energies(3)    ! I omega**2
    type(gaps_t) :: gaps
    type(pair_t) :: d12
    integer :: i, power

    status = REFUSED
    moment = moments
    w = omega0
    orbit%omega = omega0
    orbit%omega_exponent = 0
    if (.not. (all(moment > 0.0_dp) .and. all(moment <= huge(w)))) return
    if (.not. all(abs(w) <= huge(w))) return
    if (.not. (any(abs(attitude0) > 0.0_dp) .and. all(abs(attitude0) <= huge(w)))) return
    orbit%attitude = attitude0
    call bring_near_one(orbit%attitude, power)
    orbit%attitude = orbit%attitude/sqrt(sum(orbit%attitude*orbit%attitude))
    call bring_near_one(moment, power)
    if (.not. all(moment >= 1.0_dp/LARGE)) return
    call bring_near_one(w, orbit%omega_exponent)

    call take_axes(moment, w, orbit)
    status = COMPLETE
    do i = 1, 3
      exact(i) = pair_t(moment(i), scale(moments_low(orbit%axes(i)), -power))
    end do
    gaps%d12 = unsigned(exact(1) - exact(2))
    gaps%d13 = unsigned(exact(1) - exact(3))
    gaps%d23 = unsigned(exact(2) - exact(3))
    energies = [product_of(w(1), w(1))*exact(1), product_of(w(2), w(2))*exact(2), &
                product_of(w(3), w(3))*exact(3)]
    gaps%e2 = energies(3)*gaps%d23 - energies(1)*gaps%d12
    if (abs(gaps%e2%high) <= CANCELLED*energies(3)%high*gaps%d23%high) then
      gaps%e2 = narrow_gap(exact, w, energies, gaps%d12, gaps%d23)
    end if
    if (gaps%e2%high < 0.0_dp) then
      ! Omega about the other extreme axis keeps its sign.
      orbit%axes = orbit%axes([3, 2, 1])
      exact = exact([3, 2, 1])
      w = w([3, 2, 1])
      energies = energies([3, 2, 1])
      d12 = gaps%d12
      gaps%d12 = gaps%d23
      gaps%d23 = d12
      gaps%e2 = pair_t(-gaps%e2%high, -gaps%e2%low)
    end if
    gaps%e1 = energies(1)*gaps%d13 + energies(2)*gaps%d23
    gaps%e3 = energies(3)*gaps%d13 + energies(2)*gaps%d12
    call take_signs(w, orbit)

    if (.not. gaps%d23%high*gaps%e3%high > 0.0_dp &
        .or. .not. max(abs(w(1)), abs(w(3))) > 0.0_dp) then
      call prepare_steady(w, orbit)
    else if (energies(3)%high*gaps%d13%high <= FAINT*gaps%e3%high) then
      ! About the middle axis, except for a negligible perturbation.
      status = REFUSED
    else
      call prepare_orbit(exact, w, energies, gaps, orbit)
    end if
  end subroutine prepare

  pure type(pair_t) function narrow_gap(exact, w, energies, d12, d23) result(gap)
    !! Compute I3 omega3**2 d23 - I1 omega1**2 d12 near the separatrix, where nearly all of it
    !! cancels, from products in triple-double.
    type(pair_t), intent(in) :: exact(3)
    real(dp), intent(in) :: w(3)
    type(pair_t), intent(in) :: energies(3), d12, d23
    real(dp) :: x(3), y(3)

    x = longer_product(longer_product(longer_product([w(3), 0.0_dp, 0.0_dp], w(3)), &
                                      exact(3)%high), d23%high)
    y = longer_product(longer_product(longer_product([w(1), 0.0_dp, 0.0_dp], w(1)), &
                                      exact(1)%high), d12%high)
    gap = difference_of(x(1), y(1)) + difference_of(x(2), y(2)) + difference_of(x(3), y(3)) &
          + (energies(3)*d23%low - energies(1)*d12%low)
    gap = gap + (product_of(w(3), w(3))*(exact(3)%low*d23%high) &
                 - product_of(w(1), w(1))*(exact(1)%low*d12%high))
  end function narrow_gap

  pure subroutine take_axes(moment, w, orbit)
    !! Order the axes by their moments.
    real(dp), intent(inout) :: moment(3), w(3)
    type(orbit_t), intent(inout) :: orbit
    integer :: low, high

    low = 1
    if (moment(2) < moment(low)) low = 2
    if (moment(3) < moment(low)) low = 3
    high = mod(low, 3) + 1
    if (moment(6 - low - high) >= moment(high)) high = 6 - low - high
    orbit%axes = [high, 6 - low - high, low]
    moment = moment(orbit%axes)
    w = w(orbit%axes)
  end subroutine take_axes

  pure subroutine take_signs(w, orbit)
    !! Point axes 3 and 1 along omega, and axis 2 so that they are right-handed.
    real(dp), intent(inout) :: w(3)
    type(orbit_t), intent(inout) :: orbit

    orbit%signs = sign(1.0_dp, w)
    orbit%signs(2) = orbit%signs(1)*orbit%signs(3)
    if (mod(orbit%axes(1), 3) + 1 /= orbit%axes(2)) orbit%signs(2) = -orbit%signs(2)
    w = w*orbit%signs
  end subroutine take_signs

  pure subroutine prepare_steady(w, orbit)
    !! Prepare a rotation about an axis that does not change.
    real(dp), intent(in) :: w(3)
    type(orbit_t), intent(inout) :: orbit
    type(pair_t) :: speed

    orbit%is_steady = .true.
    orbit%direction = 0.0_dp
    orbit%half_rate = pair_t(0.0_dp, 0.0_dp)
    orbit%before = into_orbit(orbit, orbit%attitude)
    speed = product_of(w(1), w(1)) + product_of(w(2), w(2)) + product_of(w(3), w(3))
    if (.not. speed%high > 0.0_dp) return
    speed = root(speed)
    orbit%half_rate = speed*0.5_dp
    orbit%direction = w/speed%high
  end subroutine prepare_steady

  pure subroutine prepare_orbit(exact, w, energies, gaps, orbit)
    !! Compute rates, phase and theta series of a motion that is not steady.
    type(pair_t), intent(in) :: exact(3) !! moments
    real(dp), intent(in) :: w(3)
    type(pair_t), intent(in) :: energies(3)
    type(gaps_t), intent(in) :: gaps
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: moment(3)   ! in double precision
    real(dp) :: largest(3)  ! largest omega during the motion
    real(dp) :: pole(2)     ! (I2 - I1) I3/((I3 - I2) I1) and I1 E1/(I3 E3), whose product is k**2
    real(dp) :: k, comodulus, slope
    type(pair_t) :: momentum         ! |L|
    type(pair_t) :: scales(2)        ! lambda, lambda k' times `inertia`; u' = lambda
    type(pair_t) :: inertia          ! square root of the product of the moments

    orbit%is_steady = .false.
    moment = exact%high
    momentum = root(energies(1)*exact(1) + energies(2)*exact(2) + energies(3)*exact(3))
    inertia = root(exact(1)*exact(2)*exact(3))
    pole = [gaps%d12%high*moment(3)/(gaps%d23%high*moment(1)), &
            gaps%e1%high*moment(1)/(gaps%e3%high*moment(3))]
    k = sqrt(pole(1)*pole(2))
    largest = sqrt([gaps%e1%high/(moment(1)*gaps%d13%high), &
                    gaps%e1%high/(moment(2)*gaps%d23%high), &
                    gaps%e3%high/(moment(3)*gaps%d13%high)])
    orbit%sense = sign(1.0_dp, moment(3) - moment(1))
    orbit%direction = moment/momentum%high
    scales(1) = root(gaps%d23*gaps%e3)
    if (gaps%e2%high > 0.0_dp) then
      scales(2) = root(gaps%d13*gaps%e2)
      comodulus = scales(2)%high/scales(1)%high
      call take_rates(exact, momentum, inertia, scales, gaps, pole, orbit)
    else
      comodulus = 0.0_dp
      orbit%frequency = scales(1)/inertia*0.5_dp
      orbit%half_rate = momentum/exact(2)*0.5_dp
    end if
    slope = orbit%frequency%high*inertia%high/scales(1)%high
    call theta_series(pole, k, comodulus, orbit%theta)
    if (orbit%theta%kind == HYPERBOLIC) then
      call take_ratio(scales(1), root(gaps%d12*gaps%e1), orbit%frequency*inertia, orbit%theta%ratio)
    end if
    orbit%start = pair_t(0.0_dp, 0.0_dp)
    if (gaps%e1%high > FAINT*gaps%e3%high) then
      call start_of_phase(orbit%theta, k, comodulus, slope, &
                          [w(1)/largest(1), orbit%sense*w(2)/largest(2), w(3)/largest(3)], &
                          orbit%start%high, orbit%start%low)
    else
      ! About axis 3, except for a negligible perturbation.
      largest(1:2) = 0.0_dp
    end if
    orbit%theta%size = orbit%theta%size*[largest(1), orbit%sense*largest(2), largest(3)]
    call take_before(orbit)
  end subroutine prepare_orbit

  pure subroutine take_rates(exact, momentum, inertia, scales, gaps, pole, orbit)
    !! Compute the mean rates. The rate of the phase comes from the arithmetic-geometric mean. The
    !! rate of the rotation about the angular momentum is an integral of the third kind, by the sum
    !! that accompanies the mean (Gauss).
    type(pair_t), intent(in) :: exact(3) !! moments
    real(dp), intent(in) :: pole(2)
    type(pair_t), intent(in) :: momentum, inertia, scales(2)
    type(gaps_t), intent(in) :: gaps
    type(orbit_t), intent(inout) :: orbit
    type(pair_t) :: a, g, p, total, share, part, mean
    logical :: by_moments ! use the first pole, else the second: the one nearer to 0
    real(dp) :: half
    integer :: n

    by_moments = pole(1) < pole(2)
    if (by_moments) then
      p = root(gaps%d13*gaps%e3*exact(2)/exact(1))
    else
      p = momentum*root(gaps%d13*gaps%d23/exact(3))
    end if
    a = scales(1)
    g = scales(2)
    share = pair_t(1.0_dp, 0.0_dp)
    total = share
    mean = a
    do n = 1, MOST_LEVELS
      mean = (a + g)*0.5_dp
      part = a*g
      a = part/p
      share = share*((p - a)/(p + a))*0.5_dp
      total = total + share
      if (abs(share%high) <= LAST) exit
      p = (p + a)*0.5_dp
      a = mean
      g = root(part)
    end do
    ! One more level would subtract the following term.
    half = (mean%high - g%high) + (mean%low - g%low)
    mean%low = mean%low - half*half/(4.0_dp*mean%high)
    orbit%frequency = mean/inertia
    if (by_moments) then
      part = exact(2)*2.0_dp - gaps%d12*total*orbit%sense
      orbit%half_rate = momentum*part/(exact(1)*exact(2)*4.0_dp) &
                        - orbit%frequency*(0.5_dp*orbit%sense)
    else
      part = momentum*momentum*2.0_dp + gaps%e1*total*orbit%sense
      orbit%half_rate = part/(momentum*(exact(3)*4.0_dp))
    end if
  end subroutine take_rates

  pure subroutine take_ratio(larger, smaller, other, ratio)
    !! Compute K/(2 K'): half the arithmetic-geometric mean of 1 and k, over `other`, the mean of 1
    !! and k'.
    type(pair_t), intent(in) :: larger, smaller, other
    real(dp), intent(out) :: ratio(2)
    type(pair_t) :: a, g, mean
    integer :: n

    a = larger
    g = smaller
    do n = 1, MOST_LEVELS
      mean = (a + g)*0.5_dp
      if (abs(a%high - g%high) <= FLAT*a%high) exit
      g = root(a*g)
      a = mean
    end do
    mean = mean*0.5_dp/other
    ratio = [mean%high, mean%low]
  end subroutine take_ratio

  pure subroutine take_before(orbit)
    !! Set `before` so that q at time 0 is the specified attitude.
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: omega(3), turn(4)
    logical :: has_phase

    call turned(orbit, 0.0_dp, omega, turn, has_phase)
    orbit%before = product_of_quaternions(into_orbit(orbit, orbit%attitude), &
                                          [turn(1), -turn(2), -turn(3), -turn(4)])
  end subroutine take_before

  pure type(pair_t) function unsigned(x)
    type(pair_t), intent(in) :: x

    unsigned = x
    if (x%high < 0.0_dp) unsigned = pair_t(-x%high, -x%low)
  end function unsigned

end module torque_free_attitude

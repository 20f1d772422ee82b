module torque_free_attitude
  !! Closed form of equations 13-15 without torque, from the moments, and of the attitude beside
  !! it: omega by Jacobi's elliptic functions, the turn about the angular momentum by a theta
  !! function of the same phase. Neither cost nor error depends on the time.
  !! A unit quaternion q, scalar first, turns body into space: v_space = q v_body q*, and
  !! q' = q (0, omega)/2. It is q0 D(0)* D(t), where D = (turn about axis 3) (turn of the angular
  !! momentum to axis 3, the short way).
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW, REFUSED
  use two_words, only: scaled, sine_cosine, two_product, two_sum
  use word_pairs, only: difference_of, operator(*), operator(+), operator(-), operator(/), &
                        pair_t, product_of, root
  implicit none(type, external)
  private

  integer, parameter :: STEADY = 0           ! omega does not change
  integer, parameter :: TRIGONOMETRIC = 1    ! theta series in sines and cosines
  integer, parameter :: HYPERBOLIC = 2       ! near the separatrix: in exponentials
  integer, parameter :: SEPARATRIX = 3       ! the same, without a period
  integer, parameter :: BETWEEN_LOOKS = 2**17 ! at the user; times
  integer, parameter :: MOST_LEVELS = 16     ! of the arithmetic-geometric mean; 1e-120 needs 13

  real(dp), parameter :: LARGE = 2.0_dp**100  ! beyond it, or below its inverse, numbers are scaled
  real(dp), parameter :: FLAT = 4e-9_dp       ! a difference whose square no longer counts
  real(dp), parameter :: FAINT = 1e-240_dp    ! smaller squares of a disturbance would underflow
  real(dp), parameter :: LARGE_PHASE = 1e15_dp
  real(dp), parameter :: BALANCED = 0.1085_dp ! the nome where K = 2**(1/2) K'
  real(dp), parameter :: PI = 3.141592653589793_dp
  real(dp), parameter :: PI_LOW = 1.2246467991473532e-16_dp
  real(dp), parameter :: FAR = 340.0_dp       ! a phase whose exponential is nothing

  type :: orbit_t
    !! One torque-free motion, in axes of its own: 2 has the middle moment, 3 is the one about
    !! which the motion does not change its direction, and 1, 2, 3 are right-handed.
    integer :: kind
    integer :: axes(3)          !! of the body, for each of the orbit
    real(dp) :: signs(3)        !! a component of the orbit is this times that of the body
    integer :: omega_exponent   !! angular velocity is 2**this times the orbit's
    real(dp) :: omega(3)        !! at time 0, body axes, as given
    real(dp) :: attitude(4)     !! at time 0, body axes
    real(dp) :: before(4)       !! q = before D, vector in axes of the orbit
    type(pair_t) :: half_rate   !! of the turn about axis 3 beside what the theta function adds
    type(pair_t) :: frequency   !! of the phase v; of x on the separatrix
    type(pair_t) :: start       !! the phase at time 0
    real(dp) :: size(3)         !! of omega beside its theta functions; of a steady one itself
    real(dp) :: direction(3)    !! omega times it is L/|L|; of a steady one omega/|omega|
    real(dp) :: sense           !! of the phase: the sign of I3 - I1
    real(dp) :: nome            !! q, or Q = exp(-pi K/(2 K'))
    real(dp) :: even(2), odd(2) !! of the theta functions of sn and cn
    real(dp) :: c(0:4), s(0:4)  !! weights of C and S, whose quotient is the tangent of a
    real(dp) :: ratio           !! x over v: K/(2 K')
    real(dp) :: drift           !! of a over v
  end type orbit_t

  public :: torque_free_attitude_rows

contains

  subroutine torque_free_attitude_rows(moments, omega0, attitude0, n_times, times, rows, &
                                       attitudes, n_rows, status)
    !! Angular velocity and attitude of a torque-free body at each of `times`.
    real(dp), intent(in) :: moments(3)       !! kg m2, or in any unit
    real(dp), intent(in) :: omega0(3)        !! at time 0, rad/s, finite
    real(dp), intent(in) :: attitude0(4)     !! at time 0, of any length
    integer, intent(in) :: n_times
    real(dp), intent(in) :: times(n_times)   !! s, in any order, finite
    real(dp), intent(out) :: rows(3, n_times) !! rad/s
    real(dp), intent(out) :: attitudes(4, n_times) !! unit quaternions
    integer, intent(out) :: n_rows           !! rows that hold a result
    integer, intent(out) :: status           !! any but STOPPED
    type(orbit_t) :: orbit
    integer :: i

    n_rows = 0
    call prepare(moments, omega0, attitude0, orbit, status)
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

  ! ---- What does not depend on the time ----------------------------------------------------------

  pure subroutine prepare(moments, omega0, attitude0, orbit, status)
    !! Everything about a motion that does not depend on the time.
    real(dp), intent(in) :: moments(3), omega0(3), attitude0(4)
    type(orbit_t), intent(out) :: orbit
    integer, intent(out) :: status           !! COMPLETE or REFUSED
    real(dp) :: moment(3)   ! along the axes of the orbit, brought near 1
    real(dp) :: w(3)        ! angular velocity along them
    real(dp) :: largest
    type(pair_t) :: d12, d13, d23  ! differences of the moments, without sign
    type(pair_t) :: energies(3)    ! I omega**2
    type(pair_t) :: e1, e2, e3     ! d13 omega1**2 I1 + d23 omega2**2 I2 and so on
    integer :: power

    status = REFUSED
    moment = moments
    w = omega0
    orbit%omega = omega0
    orbit%omega_exponent = 0
    if (.not. (all(moment > 0.0_dp) .and. all(moment <= huge(largest)))) return
    if (.not. all(abs(w) <= huge(largest))) return
    largest = max(abs(attitude0(1)), abs(attitude0(2)), abs(attitude0(3)), abs(attitude0(4)))
    if (.not. (largest > 0.0_dp .and. largest <= huge(largest))) return
    orbit%attitude = attitude0
    if (.not. (largest <= LARGE .and. largest >= 1.0_dp/LARGE)) then
      orbit%attitude = scale(attitude0, -exponent(largest))
    end if
    orbit%attitude = orbit%attitude/sqrt(sum(orbit%attitude*orbit%attitude))
    call bring_near_one(moment, power)
    if (.not. all(moment >= 1.0_dp/LARGE)) return
    call bring_near_one(w, orbit%omega_exponent)

    call take_axes(moment, w, orbit)
    status = COMPLETE
    d12 = unsigned(difference_of(moment(1), moment(2)))
    d13 = unsigned(difference_of(moment(1), moment(3)))
    d23 = unsigned(difference_of(moment(2), moment(3)))
    energies = [product_of(w(1), w(1))*moment(1), product_of(w(2), w(2))*moment(2), &
                product_of(w(3), w(3))*moment(3)]
    e2 = energies(3)*d23 - energies(1)*d12
    if (e2%high < 0.0_dp) then
      ! The other of the extreme axes keeps its direction.
      orbit%axes = orbit%axes([3, 2, 1])
      moment = moment([3, 2, 1])
      w = w([3, 2, 1])
      energies = energies([3, 2, 1])
      e1 = d12
      d12 = d23
      d23 = e1
      e2 = pair_t(-e2%high, -e2%low)
    end if
    e1 = energies(1)*d13 + energies(2)*d23
    e3 = energies(3)*d13 + energies(2)*d12
    call take_signs(w, orbit)

    if (.not. d23%high*e3%high > 0.0_dp .or. .not. max(abs(w(1)), abs(w(3))) > 0.0_dp) then
      call prepare_steady(w, orbit)
    else if (energies(3)%high*d13%high <= FAINT*e3%high) then
      ! About the middle axis, all but exactly.
      status = REFUSED
    else
      call prepare_orbit(moment, w, energies, d12, d13, d23, e1, e2, e3, orbit)
    end if
  end subroutine prepare

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
    !! Point axes 3 and 1 where omega does, and axis 2 so that they are right-handed.
    real(dp), intent(inout) :: w(3)
    type(orbit_t), intent(inout) :: orbit

    orbit%signs = sign(1.0_dp, w)
    orbit%signs(2) = orbit%signs(1)*orbit%signs(3)
    if (mod(orbit%axes(1), 3) + 1 /= orbit%axes(2)) orbit%signs(2) = -orbit%signs(2)
    w = w*orbit%signs
  end subroutine take_signs

  pure subroutine prepare_steady(w, orbit)
    !! A turn about an axis that does not change.
    real(dp), intent(in) :: w(3)
    type(orbit_t), intent(inout) :: orbit
    type(pair_t) :: speed

    orbit%kind = STEADY
    orbit%size = w
    orbit%direction = 0.0_dp
    orbit%half_rate = pair_t(0.0_dp, 0.0_dp)
    orbit%before = into_orbit(orbit, orbit%attitude)
    speed = product_of(w(1), w(1)) + product_of(w(2), w(2)) + product_of(w(3), w(3))
    if (.not. speed%high > 0.0_dp) return
    speed = root(speed)
    orbit%half_rate = speed*0.5_dp
    orbit%direction = w/speed%high
  end subroutine prepare_steady

  pure subroutine prepare_orbit(moment, w, energies, d12, d13, d23, e1, e2, e3, orbit)
    !! Rates, phase and theta series of a motion that is not steady.
    real(dp), intent(in) :: moment(3), w(3)
    type(pair_t), intent(in) :: energies(3), d12, d13, d23, e1, e2, e3
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: largest(3)  ! of omega on the way
    real(dp) :: pole(2)     ! -n of the integrals of the third kind: (I2 - I1) I3/((I3 - I2) I1) and
    ! I1 E1/(I3 E3); their product is k**2
    real(dp) :: k, comodulus
    real(dp) :: unit        ! sine, cosine and delta of the phase at time 0
    real(dp) :: sine, cosine, delta
    real(dp) :: found(3), c, s, part ! what the series give there
    type(pair_t) :: momentum         ! |L|
    type(pair_t) :: scales(2)        ! what the mean starts from: lambda, lambda k' times `inertia`
    type(pair_t) :: inertia          ! root of the product of the moments

    momentum = root(energies(1)*moment(1) + energies(2)*moment(2) + energies(3)*moment(3))
    inertia = root(product_of(moment(1), moment(2))*moment(3))
    pole = [d12%high*moment(3)/(d23%high*moment(1)), e1%high*moment(1)/(e3%high*moment(3))]
    largest = sqrt([e1%high/(moment(1)*d13%high), e1%high/(moment(2)*d23%high), &
                    e3%high/(moment(3)*d13%high)])
    orbit%sense = sign(1.0_dp, moment(3) - moment(1))
    orbit%direction = moment/momentum%high
    scales(1) = root(d23*e3)
    k = sqrt(pole(1)*pole(2))
    if (e2%high > 0.0_dp) then
      scales(2) = root(d13*e2)
      call take_rates(moment, momentum, inertia, scales, d12, d13, d23, e1, e3, pole, orbit)
      comodulus = scales(2)%high/scales(1)%high
      call take_series(pole, k, comodulus, orbit)
    else
      comodulus = 0.0_dp
      orbit%kind = SEPARATRIX
      orbit%frequency = scales(1)/inertia*0.5_dp
      orbit%half_rate = momentum/pair_t(moment(2), 0.0_dp)*0.5_dp
      orbit%ratio = 0.0_dp
      call take_exponentials(pole, k, 0.0_dp, orbit)
    end if
    orbit%size = orbit%size*largest
    orbit%size(2) = orbit%size(2)*orbit%sense

    ! The phase at time 0, and what rounding takes off it: beside the separatrix that counts.
    orbit%start = pair_t(0.0_dp, 0.0_dp)
    if (e1%high > FAINT*e3%high) then
      sine = orbit%sense*w(2)/largest(2)
      cosine = w(1)/largest(1)
      delta = w(3)/largest(3)
      c = cosine
      s = sine
      if (orbit%kind == SEPARATRIX) then
        orbit%start%high = sign(0.5_dp*log((1.0_dp + abs(s))/delta), s)
      else
        call descend(1.0_dp, comodulus, s, c, delta)
        orbit%start%high = atan2(s, c)
      end if
      delta = w(3)/largest(3)
      call functions(orbit, orbit%start, found, c, s, part)
      found = found/[largest(1), orbit%sense*largest(2), largest(3)]
      unit = (sine*found(1)*found(3) - found(2)*cosine*delta) &
             /(delta*delta + (k*sine*cosine)**2)
      if (orbit%kind == SEPARATRIX) then
        orbit%start%low = 0.5_dp*unit
      else
        orbit%start%low = unit*orbit%frequency%high*inertia%high/scales(1)%high
      end if
    else
      orbit%size(1:2) = 0.0_dp
    end if
    call take_before(orbit)
  end subroutine prepare_orbit

  pure subroutine take_rates(moment, momentum, inertia, scales, d12, d13, d23, e1, e3, pole, orbit)
    !! The mean rates: of the phase by the arithmetic-geometric mean, of the turn about the angular
    !! momentum by the sum that goes with it, of an integral of the third kind (Gauss).
    real(dp), intent(in) :: moment(3), pole(2)
    type(pair_t), intent(in) :: momentum, inertia, scales(2), d12, d13, d23, e1, e3
    type(orbit_t), intent(inout) :: orbit
    type(pair_t) :: a, g, p, total, share, part, mean
    logical :: by_moments ! the first of the poles, else the second: the one nearer to 0
    real(dp) :: half
    integer :: n

    by_moments = pole(1) < pole(2)
    if (by_moments) then
      p = root(d13*e3*moment(2)/pair_t(moment(1), 0.0_dp))
    else
      p = momentum*root(d13*d23/pair_t(moment(3), 0.0_dp))
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
      half = abs(mean%high - g%high)
      if (half <= FLAT*mean%high) exit
      p = (p + a)*0.5_dp
      a = mean
      g = root(part)
    end do
    ! What one more level would take off.
    half = (mean%high - g%high) + (mean%low - g%low)
    mean%low = mean%low - half*half/(4.0_dp*mean%high)
    orbit%frequency = mean/inertia
    if (by_moments) then
      part = pair_t(moment(2), 0.0_dp)*2.0_dp - d12*total*orbit%sense
      orbit%half_rate = momentum*part/(product_of(moment(1), moment(2))*4.0_dp) &
                        - orbit%frequency*(0.5_dp*orbit%sense)
    else
      part = momentum*momentum*2.0_dp + e1*total*orbit%sense
      orbit%half_rate = part/(momentum*(4.0_dp*moment(3)))
    end if
  end subroutine take_rates

  pure subroutine take_series(pole, k, comodulus, orbit)
    !! The theta series, in sines or in exponentials: whichever falls faster.
    real(dp), intent(in) :: pole(2), k, comodulus
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: next        ! comodulus after one step of Landen's
    real(dp) :: q, square   ! the nome, and its square
    real(dp) :: over_pole   ! the square over the first pole
    real(dp) :: s, c, delta ! of the imaginary phase of the pole, over the root of the pole
    real(dp) :: up, down    ! of what the cosine's weights are made
    real(dp) :: theta(2:4)

    next = 2.0_dp*sqrt(comodulus)/(1.0_dp + comodulus)
    over_pole = 0.5_dp*pole(1)*pole(2)**2/(1.0_dp + comodulus)**4 &
                /((1.0_dp + next)*(1.0_dp + sqrt(next))**2)
    square = over_pole*pole(1)
    if (square > 0.02_dp) then
      q = BALANCED
    else
      next = 1.0_dp + square**4*(2.0_dp + 15.0_dp*square**4)
      square = square*next
      over_pole = over_pole*next
      q = sqrt(square)
    end if
    if (q >= BALANCED) then
      orbit%kind = HYPERBOLIC
      next = 0.5_dp*comodulus**2/((1.0_dp + k)*(1.0_dp + sqrt(k))**2)
      next = next*(1.0_dp + next**4*(2.0_dp + 15.0_dp*next**4))
      orbit%ratio = -log(next)/(2.0_dp*PI)
      call take_exponentials(pole, k, next, orbit)
      return
    end if

    orbit%kind = TRIGONOMETRIC
    orbit%nome = q
    orbit%even = [1.0_dp - square*(1.0_dp - square**2*(1.0_dp - square**3)), &
                  2.0_dp*square**3*(1.0_dp - square**3)]
    orbit%odd = [2.0_dp*square*(1.0_dp - square**2*(1.0_dp - square**3)), 2.0_dp*square**6]
    theta(2) = 1.0_dp + square*(1.0_dp + square**2*(1.0_dp + square**3))
    up = 1.0_dp + 2.0_dp*square**2*(1.0_dp + square**6)
    down = 2.0_dp*q*(1.0_dp + square**4)
    theta(3) = up + down
    theta(4) = up - down
    orbit%size = [theta(4)/theta(2), theta(3)/theta(2), theta(4)/theta(3)]
    s = 1.0_dp
    c = sqrt(1.0_dp + pole(1))
    delta = sqrt(1.0_dp + pole(2))
    call descend(1.0_dp, comodulus, s, c, delta)
    c = (s + c)**2
    up = over_pole*c
    down = square*pole(1)/c
    orbit%c = [1.0_dp, -(up + down), square**2*(up**2 + down**2), &
               -square**6*(up**3 + down**3), 0.0_dp]
    orbit%s = [0.0_dp, -(up - down), square**2*(up**2 - down**2), &
               -square**6*(up**3 - down**3), 0.0_dp]
    orbit%drift = 0.0_dp
    orbit%ratio = 0.0_dp
  end subroutine take_series

  pure subroutine take_exponentials(pole, k, square, orbit)
    !! The theta series near the separatrix.
    real(dp), intent(in) :: pole(2), k
    real(dp), intent(in) :: square       !! of the nome Q
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: s, c, delta, e, theta(2:4), power
    integer :: n

    orbit%nome = sqrt(square)
    theta(2) = 1.0_dp + square**2*(1.0_dp + square**4)
    theta(3) = 1.0_dp + 2.0_dp*(square + square**4)
    theta(4) = 1.0_dp - 2.0_dp*(square - square**4)
    orbit%size = [2.0_dp*theta(2)/theta(4), theta(3)/theta(4), 2.0_dp*theta(2)/theta(3)]
    s = 1.0_dp
    c = sqrt(pole(1))
    delta = c*sqrt((1.0_dp + pole(2))/(1.0_dp + pole(1)))
    call descend(1.0_dp, k, s, c, delta)
    e = 0.5_dp*atan2(s, c)
    power = 1.0_dp
    do n = 0, 4
      orbit%c(n) = power*cos((2*n + 1)*e)
      orbit%s(n) = power*sin((2*n + 1)*e)
      power = power*orbit%nome**(2*n + 1)
    end do
    orbit%drift = 0.0_dp
    if (orbit%kind == HYPERBOLIC) orbit%drift = orbit%sense*2.0_dp*e/PI
  end subroutine take_exponentials

  pure subroutine take_before(orbit)
    !! So that q is the given one at time 0.
    type(orbit_t), intent(inout) :: orbit
    real(dp) :: omega(3), turn(4)
    logical :: has_phase

    call turned(orbit, 0.0_dp, omega, turn, has_phase)
    orbit%before = product_of_quaternions(into_orbit(orbit, orbit%attitude), &
                                          [turn(1), -turn(2), -turn(3), -turn(4)])
  end subroutine take_before

  pure subroutine descend(start, end, s, c, delta)
    !! From sn, cn, dn of a phase to the sine and cosine that they have after Landen's
    !! transformations, up to a common factor. Every sum is one of positive terms.
    real(dp), intent(in) :: start, end  !! what the arithmetic-geometric mean starts from
    real(dp), intent(inout) :: s, c     !! sn and cn, times any factor
    real(dp), intent(inout) :: delta
    real(dp) :: a, b, mean, double
    integer :: n

    a = start
    b = end
    do n = 1, MOST_LEVELS
      mean = 0.5_dp*(a + b)
      double = 2.0_dp/(1.0_dp + delta)
      delta = sqrt(0.5_dp*double*(b + a*delta)/mean)
      s = s*double*mean/a
      c = c*double/delta
      if (abs(a - b) <= FLAT*a) exit
      b = sqrt(a*b)
      a = mean
    end do
  end subroutine descend

  ! ---- At a time ---------------------------------------------------------------------------------

  pure subroutine evaluate(orbit, time, omega, attitude, status)
    !! The state at a time.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: time
    real(dp), intent(out) :: omega(3), attitude(4)
    integer, intent(out) :: status
    real(dp) :: t              ! in the orbit's unit
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
    if (orbit%kind == STEADY) then
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
    !! Angular velocity and the turn D, in axes of the orbit.
    type(orbit_t), intent(in) :: orbit
    real(dp), intent(in) :: t
    real(dp), intent(out) :: w(3), turn(4)
    logical, intent(out) :: has_phase ! whether the phase has a digit left
    real(dp) :: angle, angle_low, rest, sine, cosine
    real(dp) :: c, s           ! theta function of the turn: its real and its imaginary part
    real(dp) :: part           ! of the angle that the theta function adds
    real(dp) :: m(3)           ! direction of the angular momentum
    real(dp) :: along, across, inverse
    type(pair_t) :: phase

    has_phase = .false.
    w = 0.0_dp
    turn = 0.0_dp
    call scaled(orbit%half_rate%high, orbit%half_rate%low, t, angle, angle_low)
    if (.not. abs(angle) <= 0.5_dp*LARGE_PHASE) return
    if (orbit%kind == STEADY) then
      call sine_cosine(angle, angle_low, sine, cosine)
      w = orbit%size
      turn = [cosine, orbit%direction*sine]
      has_phase = .true.
      return
    end if
    call scaled(orbit%frequency%high, orbit%frequency%low, t, c, s)
    if (.not. abs(c) <= LARGE_PHASE) return
    has_phase = .true.
    call two_sum(orbit%start%high, c, phase%high, phase%low)
    phase%low = phase%low + (s + orbit%start%low)
    call functions(orbit, phase, w, c, s, part)
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

  pure subroutine functions(orbit, phase, w, c, s, part)
    !! Angular velocity at a phase, and what the turn has of it.
    type(orbit_t), intent(in) :: orbit
    type(pair_t), intent(in) :: phase
    real(dp), intent(out) :: w(3), c, s, part
    real(dp) :: sine, cosine
    real(dp) :: c2, c4, c6, c8, s2, s4   ! of twice, four times the phase and so on
    real(dp) :: even, odd
    real(dp) :: x, x_low, turns, product, rest
    real(dp) :: sense                    ! of sn and cn after so many half periods
    real(dp) :: g, h, q, gg, hh, qq
    real(dp) :: inverse

    part = 0.0_dp
    if (orbit%kind == TRIGONOMETRIC) then
      call sine_cosine(phase%high, phase%low, sine, cosine)
      s2 = 2.0_dp*sine*cosine
      c2 = 1.0_dp - 2.0_dp*sine*sine
      s4 = 2.0_dp*s2*c2
      c4 = 1.0_dp - 2.0_dp*s2*s2
      c6 = c2*(2.0_dp*c4 - 1.0_dp)
      c8 = 1.0_dp - 2.0_dp*s4*s4
      q = orbit%nome
      qq = q**4
      even = 1.0_dp + 2.0_dp*qq*(c4 + qq**3*c8)
      odd = 2.0_dp*q*(c2 + qq**2*c6)
      inverse = 1.0_dp/(even - odd)
      w(3) = orbit%size(3)*(even + odd)*inverse
      even = orbit%even(1) + orbit%even(2)*c4
      odd = orbit%odd(1)*c2 + orbit%odd(2)*c6
      w(1) = orbit%size(1)*(cosine*(even + odd))*inverse
      w(2) = orbit%size(2)*(sine*(even - odd))*inverse
      c = 1.0_dp + (orbit%c(1)*c2 + (orbit%c(2)*c4 + orbit%c(3)*c6))
      s = orbit%s(1)*s2 + (orbit%s(2)*s4 + orbit%s(3)*(s2*(1.0_dp + 2.0_dp*c4)))
      return
    end if

    sense = 1.0_dp
    x = phase%high
    x_low = phase%low
    if (orbit%kind == HYPERBOLIC) then
      turns = anint(x/PI)
      call two_product(turns, PI, product, rest)
      x = x - product
      x_low = x_low - rest - turns*PI_LOW
      if (modulo(turns, 2.0_dp) > 0.5_dp) sense = -1.0_dp
      part = (x + x_low)*orbit%drift
      x = (x + x_low)*orbit%ratio
      x_low = 0.0_dp
    end if
    q = orbit%nome
    qq = q*q
    g = exp(-2.0_dp*min(abs(x), FAR))
    g = g - 2.0_dp*g*sign(x_low, x*x_low)
    h = 0.0_dp
    if (q > 0.0_dp) h = q/g
    gg = g*g
    hh = h*h
    even = (1.0_dp + gg) + qq*(hh + qq*(gg*gg) + qq**3*(hh*hh + qq*qq*gg**3))
    inverse = 1.0_dp/even
    even = 1.0_dp + qq*qq*(hh*hh + (qq*gg)**2)
    odd = (hh + qq*gg) + qq**6*hh**3
    w(1) = sense*orbit%size(1)*(g*(even - odd))*inverse
    w(3) = orbit%size(3)*(g*(even + odd))*inverse
    even = (1.0_dp - gg) - qq*(hh - qq*(gg*gg) - qq**3*(hh*hh - qq*qq*gg**3))
    w(2) = sense*orbit%size(2)*(even*inverse)
    c = orbit%c(0)*(1.0_dp + g) + (orbit%c(1)*(h + q*gg) + (orbit%c(2)*(hh + qq*g*gg) &
                                   + (orbit%c(3)*(h*hh + q*qq*(gg*gg)) + orbit%c(4)*(hh*hh))))
    s = orbit%s(0)*(1.0_dp - g) + (orbit%s(1)*(h - q*gg) + (orbit%s(2)*(hh - qq*g*gg) &
                                   + (orbit%s(3)*(h*hh - q*qq*(gg*gg)) + orbit%s(4)*(hh*hh))))
    ! So far those of |x|, and of S what has to be taken off.
    if (x < 0.0_dp) then
      w(2) = -w(2)
    else
      s = -s
    end if
  end subroutine functions

  pure function into_orbit(orbit, attitude) result(found)
    !! A quaternion with its vector in axes of the orbit.
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

  pure type(pair_t) function unsigned(x)
    !! |x|.
    type(pair_t), intent(in) :: x

    unsigned = x
    if (x%high < 0.0_dp) unsigned = pair_t(-x%high, -x%low)
  end function unsigned

  pure subroutine bring_near_one(x, power)
    !! Where the largest of x is far from 1, divide by a power of two that brings it there.
    real(dp), intent(inout) :: x(3)
    integer, intent(out) :: power
    real(dp) :: largest

    largest = max(abs(x(1)), abs(x(2)), abs(x(3)))
    power = 0
    if (largest <= LARGE .and. largest >= 1.0_dp/LARGE .or. .not. largest > 0.0_dp) return
    power = exponent(largest)
    x = scale(x, -power)
  end subroutine bring_near_one

end module torque_free_attitude

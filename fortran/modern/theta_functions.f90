module theta_functions
  !! Jacobi's cn, sn, dn of a phase, and an integral of the third kind, by theta series. Far from
  !! the separatrix they are series in sines of v = pi u/(2 K), near it in exponentials of
  !! x = pi u/(4 K').
  use kinds, only: dp
  use two_words, only: scaled, sine_cosine, two_product, two_sum
  implicit none(type, external)
  private

  integer, parameter :: TRIGONOMETRIC = 1
  integer, parameter, public :: HYPERBOLIC = 2
  integer, parameter :: ENDLESS = 3          ! the separatrix: infinite period; the phase is x
  integer, parameter :: MOST_LEVELS = 16     ! of the arithmetic-geometric mean; 1e-120 needs 13

  real(dp), parameter :: FLAT = 4e-9_dp      ! difference whose square is negligible
  real(dp), parameter :: BALANCED = 0.1085_dp ! nome at which K = 2**(1/2) K'
  real(dp), parameter :: NEAR_BALANCED = 0.015_dp ! slightly above the square of BALANCED
  real(dp), parameter :: PI = 3.141592653589793_dp
  real(dp), parameter :: PI_LOW = 1.2246467991473532e-16_dp
  real(dp), parameter :: FAR = 340.0_dp      ! larger arguments make exponentials negligible

  type, public :: theta_t
    !! The constants of the series. The integral is a = arg(C + i S) + drift v, with C > 0.
    integer :: kind
    real(dp) :: size(3)         !! factors of the series of cn, sn, dn
    real(dp) :: nome            !! nome q, or Q = exp(-pi K/(2 K'))
    real(dp) :: powers(4)       !! of q or Q
    real(dp) :: even(2), odd(2) !! weights of sn and cn
    real(dp) :: c(0:4), s(0:4)  !! weights of C and S
    real(dp) :: ratio(2)        !! x over v in double-double, if HYPERBOLIC; set by the caller
    real(dp) :: drift
  end type theta_t

  public :: elliptic_functions, start_of_phase, theta_series

contains

  pure subroutine theta_series(pole, k, comodulus, theta)
    !! Compute the weights of the series that converges faster, for k**2 = pole(1) pole(2) and k'.
    real(dp), intent(in) :: pole(2)     !! the integral has 1 + pole(1) sn**2 in its denominator
    real(dp), intent(in) :: k, comodulus
    type(theta_t), intent(out) :: theta
    real(dp) :: next        ! comodulus after one of Landen's transformations
    real(dp) :: square      ! of the nome
    real(dp) :: over_pole   ! square over pole(1), which may be 0

    theta%ratio = 0.0_dp
    theta%drift = 0.0_dp
    if (.not. comodulus > 0.0_dp) then
      theta%kind = ENDLESS
      call take_exponentials(pole, 1.0_dp, 0.0_dp, theta)
      return
    end if
    next = 2.0_dp*sqrt(comodulus)/(1.0_dp + comodulus)
    over_pole = 0.5_dp*pole(1)*pole(2)**2/(1.0_dp + comodulus)**4 &
                /((1.0_dp + next)*(1.0_dp + sqrt(next))**2)
    square = over_pole*pole(1)
    if (square < NEAR_BALANCED) then
      next = 1.0_dp + square**4*(2.0_dp + 15.0_dp*square**4)
      square = square*next
      over_pole = over_pole*next
    end if
    if (square < BALANCED*BALANCED) then
      theta%kind = TRIGONOMETRIC
      call take_sines(pole, comodulus, square, over_pole, theta)
    else
      theta%kind = HYPERBOLIC
      square = 0.5_dp*comodulus**2/((1.0_dp + k)*(1.0_dp + sqrt(k))**2)
      square = square*(1.0_dp + square**4*(2.0_dp + 15.0_dp*square**4))
      call take_exponentials(pole, k, square, theta)
    end if
  end subroutine theta_series

  pure subroutine take_sines(pole, comodulus, square, over_pole, theta)
    !! Compute the weights of sines and cosines.
    real(dp), intent(in) :: pole(2), comodulus
    real(dp), intent(in) :: square      !! square of the nome q
    real(dp), intent(in) :: over_pole   !! square over pole(1)
    type(theta_t), intent(inout) :: theta
    real(dp) :: q
    real(dp) :: s, c, delta ! at the pole, whose phase is imaginary; s and c times a root
    real(dp) :: up, down    ! square exp(2 eta), square exp(-2 eta), if the pole's phase is i eta
    real(dp) :: theta2, theta3, theta4 ! theta functions at 0

    q = sqrt(square)
    theta%nome = q
    theta%powers = [2.0_dp*q, 2.0_dp*square**2, 2.0_dp*q*square**4, 2.0_dp*square**8]
    theta%even = [1.0_dp - square*(1.0_dp - square**2*(1.0_dp - square**3)), &
                  2.0_dp*square**3*(1.0_dp - square**3)]
    theta%odd = [2.0_dp*square*(1.0_dp - square**2*(1.0_dp - square**3)), 2.0_dp*square**6]
    theta2 = 1.0_dp + square*(1.0_dp + square**2*(1.0_dp + square**3))
    up = 1.0_dp + (theta%powers(2) + theta%powers(4))
    down = theta%powers(1) + theta%powers(3)
    theta3 = up + down
    theta4 = up - down
    theta%size = [theta4/theta2, theta3/theta2, theta4/theta3]
    s = 1.0_dp
    c = sqrt(1.0_dp + pole(1))
    delta = sqrt(1.0_dp + pole(2))
    call descend(comodulus, s, c, delta)
    c = (s + c)**2
    up = over_pole*c
    down = square*pole(1)/c
    theta%c = [1.0_dp, -(up + down), square**2*(up**2 + down**2), &
               -square**6*(up**3 + down**3), 0.0_dp]
    theta%s = [0.0_dp, -(up - down), square**2*(up**2 - down**2), &
               -square**6*(up**3 - down**3), 0.0_dp]
  end subroutine take_sines

  pure subroutine take_exponentials(pole, k, square, theta)
    !! Compute the weights of exponentials.
    real(dp), intent(in) :: pole(2), k
    real(dp), intent(in) :: square      !! square of the nome Q
    type(theta_t), intent(inout) :: theta
    real(dp) :: s, c, delta, e, power, step
    real(dp) :: theta2, theta3, theta4
    integer :: n

    theta%nome = sqrt(square)
    theta%powers = [square, square**2, square**4, square**6]
    theta2 = 1.0_dp + square**2*(1.0_dp + square**4)
    theta3 = 1.0_dp + 2.0_dp*(square + square**4)
    theta4 = 1.0_dp - 2.0_dp*(square - square**4)
    theta%size = [2.0_dp*theta2/theta4, theta3/theta4, 2.0_dp*theta2/theta3]
    theta%even = 0.0_dp
    theta%odd = 0.0_dp
    s = 1.0_dp
    c = sqrt(pole(1))
    delta = c*sqrt((1.0_dp + pole(2))/(1.0_dp + pole(1)))
    call descend(k, s, c, delta)
    e = 0.5_dp*atan2(s, c)
    power = 1.0_dp
    step = theta%nome
    do n = 0, 4
      theta%c(n) = power*cos((2*n + 1)*e)
      theta%s(n) = power*sin((2*n + 1)*e)
      power = power*step
      step = step*square
    end do
    if (theta%kind == HYPERBOLIC) theta%drift = 2.0_dp*e/PI
  end subroutine take_exponentials

  pure subroutine start_of_phase(theta, k, comodulus, slope, values, phase, phase_low)
    !! Compute the phase that has these functions, by Landen's transformation, and its rounding
    !! error, by the difference that the series then show; near the separatrix it counts.
    type(theta_t), intent(in) :: theta
    real(dp), intent(in) :: k, comodulus
    real(dp), intent(in) :: slope       !! v over u; x over u on the separatrix
    real(dp), intent(in) :: values(3)   !! cn, sn, dn; cn and dn are not negative
    real(dp), intent(out) :: phase, phase_low
    real(dp) :: cn, sn, dn, s, c, delta, part, found(3)

    cn = values(1)
    sn = values(2)
    dn = values(3)
    if (theta%kind == ENDLESS) then
      phase = sign(0.5_dp*log((1.0_dp + abs(sn))/dn), sn)
    else
      s = sn
      c = cn
      delta = dn
      call descend(comodulus, s, c, delta)
      phase = atan2(s, c)
    end if
    call elliptic_functions(theta, phase, 0.0_dp, found, c, s, part)
    phase_low = slope*(sn*found(1)*found(3) - found(2)*cn*dn)/(dn*dn + (k*sn*cn)**2)
  end subroutine start_of_phase

  pure subroutine descend(comodulus, s, c, delta)
    !! Reduce sn, cn, dn of a phase to the sine and cosine that remain when Landen's transformations
    !! have reduced the modulus to 0. Every sum has only positive terms.
    real(dp), intent(in) :: comodulus
    real(dp), intent(inout) :: s, c     !! sn and cn, times any common factor
    real(dp), intent(inout) :: delta    !! dn
    real(dp) :: a, b, mean, double
    integer :: n

    a = 1.0_dp
    b = comodulus
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

  pure subroutine elliptic_functions(theta, phase, phase_low, f, c, s, part)
    !! Evaluate cn, sn, dn, times the factors in theta%size, and the parts of the integral:
    !! a = arg(c + i s) + part.
    type(theta_t), intent(in) :: theta
    real(dp), intent(in) :: phase, phase_low
    real(dp), intent(out) :: f(3), c, s, part

    if (theta%kind == TRIGONOMETRIC) then
      part = 0.0_dp
      call sum_sines(theta, phase, phase_low, f, c, s)
    else
      call sum_exponentials(theta, phase, phase_low, f, c, s, part)
    end if
  end subroutine elliptic_functions

  pure subroutine sum_sines(theta, phase, phase_low, f, c, s)
    !! Sum the series in sines and cosines of v.
    type(theta_t), intent(in) :: theta
    real(dp), intent(in) :: phase, phase_low
    real(dp), intent(out) :: f(3), c, s
    real(dp) :: sine, cosine
    real(dp) :: c2, c4, c6, c8, s2, s4, s6   ! of 2 v, 4 v and so on
    real(dp) :: even, odd                    ! partial sums: multiples of 4 v, and the others
    real(dp) :: inverse

    call sine_cosine(phase, phase_low, sine, cosine)
    s2 = 2.0_dp*sine*cosine
    c2 = 1.0_dp - 2.0_dp*sine*sine
    s4 = 2.0_dp*s2*c2
    c4 = 1.0_dp - 2.0_dp*s2*s2
    s6 = s2*(1.0_dp + 2.0_dp*c4)
    c6 = c2*(2.0_dp*c4 - 1.0_dp)
    c8 = 1.0_dp - 2.0_dp*s4*s4
    even = 1.0_dp + (theta%powers(2)*c4 + theta%powers(4)*c8)
    odd = theta%powers(1)*c2 + theta%powers(3)*c6
    inverse = 1.0_dp/(even - odd)
    f(3) = theta%size(3)*((even + odd)*inverse)
    even = theta%even(1) + theta%even(2)*c4
    odd = theta%odd(1)*c2 + theta%odd(2)*c6
    f(1) = theta%size(1)*(cosine*(even + odd)*inverse)
    f(2) = theta%size(2)*(sine*(even - odd)*inverse)
    c = 1.0_dp + (theta%c(1)*c2 + (theta%c(2)*c4 + theta%c(3)*c6))
    s = theta%s(1)*s2 + (theta%s(2)*s4 + theta%s(3)*s6)
  end subroutine sum_sines

  pure subroutine sum_exponentials(theta, phase, phase_low, f, c, s, part)
    !! Sum the series in exponentials of x. Every term that grows with |x| has a factor, a power of
    !! the nome, that keeps it below 1.
    type(theta_t), intent(in) :: theta
    real(dp), intent(in) :: phase, phase_low
    real(dp), intent(out) :: f(3), c, s, part
    real(dp) :: x, x_low, turns, product, rest, v, v_low
    real(dp) :: sense                    ! sign of sn and cn after this number of half periods
    real(dp) :: g, g2, g4                ! exp(-2 |x|), its square and so on
    real(dp) :: h, h2, h4                ! Q exp(2 |x|), which is 1 at the most
    real(dp) :: q, q2                    ! Q and its square
    real(dp) :: even, odd, inverse

    x = phase
    x_low = phase_low
    sense = 1.0_dp
    part = 0.0_dp
    if (theta%kind == HYPERBOLIC) then
      turns = anint(x/PI)
      call two_product(turns, PI, product, rest)
      call two_sum(x - product, x_low - rest - turns*PI_LOW, v, v_low)
      if (modulo(turns, 2.0_dp) > 0.5_dp) sense = -1.0_dp
      part = v*theta%drift
      ! Near the separatrix x is a large part of K, so that it must be double-double.
      call scaled(theta%ratio(1), theta%ratio(2), v, x, x_low)
      x_low = x_low + theta%ratio(1)*v_low
    end if
    q = theta%nome
    q2 = theta%powers(1)
    g = exp(-2.0_dp*min(abs(x), FAR))
    g = g - 2.0_dp*g*sign(x_low, x*x_low)
    h = 0.0_dp
    if (q > 0.0_dp) h = q/g
    g2 = g*g
    g4 = g2*g2
    h2 = h*h
    h4 = h2*h2
    inverse = 1.0_dp/((1.0_dp + g2) + q2*(h2 + q2*g4) &
                      + theta%powers(3)*(h4 + theta%powers(2)*(g2*g4)))
    even = 1.0_dp + theta%powers(2)*(h4 + theta%powers(2)*g4)
    odd = (h2 + q2*g2) + theta%powers(4)*(h2*h4)
    f(1) = sense*theta%size(1)*(g*(even - odd)*inverse)
    f(3) = theta%size(3)*(g*(even + odd)*inverse)
    f(2) = (1.0_dp - g2) - q2*(h2 - q2*g4) + theta%powers(3)*(h4 - theta%powers(2)*(g2*g4))
    f(2) = sense*theta%size(2)*(f(2)*inverse)
    g4 = q2*q*g4
    c = theta%c(3)*(h*h2 + g4) + theta%c(4)*h4
    s = theta%s(3)*(h*h2 - g4) + theta%s(4)*h4
    g4 = q2*g*g2
    g2 = q*g2
    c = theta%c(0)*(1.0_dp + g) + (theta%c(1)*(h + g2) + (theta%c(2)*(h2 + g4) + c))
    s = theta%s(0)*(1.0_dp - g) + (theta%s(1)*(h - g2) + (theta%s(2)*(h2 - g4) + s))
    ! So far everything is for |x|, and s has the opposite sign.
    if (x < 0.0_dp) then
      f(2) = -f(2)
    else
      s = -s
    end if
  end subroutine sum_exponentials

end module theta_functions

module many_turns
  !! Attitudes of many torque-free bodies side by side, in double precision and without branches. As
  !! in torque_free_attitude.f90, an attitude is q0 D(0)* D(t) with D = (rotation about axis 3)
  !! (shortest rotation of the angular momentum to axis 3). A theta function gives the angle from
  !! phase 0 on, and its addition theorem the angle from the phase at time 0 on.
  use bodies, only: bodies_t, LANES, put_attitude
  use kinds, only: dp
  use many_circular, only: sine_cosine_lanes
  use many_columns, only: block_t
  use many_orbits, only: LEVELS, orbits_t
  implicit none(type, external)
  private

  real(dp), parameter :: FAR = 1e100_dp ! squares of momenta from 1/FAR to FAR are accurate
  ! Bound of the relative rounding error of the rate about the angular momentum, as for the phase in
  ! many_free.f90.
  real(dp), parameter :: ERROR = 8.0_dp*2.0_dp**(-53)
  real(dp), parameter :: NEVER = huge(1.0_dp) ! error that leaves the body to the single-body kernel
  ! A nome is x + 2 x**5 + 15 x**9 + 150 x**13 + 1707 x**17.
  real(dp), parameter :: NOME(4) = [2.0_dp, 15.0_dp, 150.0_dp, 1707.0_dp]

  type, public :: turns_t
    real(dp), dimension(LANES) :: sine, cosine !! of the phase; the caller sets them
    real(dp) :: scalar(LANES), vector(LANES, 3) !! D(0)* D(t), about the axes of the caller
    ! The following are about the axes of the orbit.
    real(dp), dimension(LANES) :: first, second, third !! moments
    real(dp), dimension(LANES) :: s1, s2, s3 !! absolute values of the coefficients
    real(dp), dimension(LANES) :: size1, size3 !! s2 times the squares of the largest omega1, omega3
    real(dp), dimension(LANES) :: inverse3, root2 !! size3 and the largest omega3, inverted
    real(dp), dimension(LANES) :: quotient   !! I1/I3
    real(dp), dimension(LANES) :: momentum   !! |L|
    real(dp), dimension(LANES) :: reach      !! mean a and root of a**2 + p**2, added, at level 0
    real(dp), dimension(LANES) :: pole       !! p over `reach`; p = sqrt(s1*size1)*quotient
    real(dp), dimension(LANES) :: x, y       !! half difference of the means times sc of the pole,
    !! and nome times sinh of its phase, level by level
    real(dp), dimension(LANES) :: up, down   !! squares of nome times exponential of the pole
    real(dp), dimension(LANES) :: fourth     !! power of the nome
    real(dp), dimension(LANES) :: c, s       !! real and imaginary part of the rotation
    real(dp), dimension(LANES) :: angle      !! half of the mean rotation about axis 3, rad
    real(dp), dimension(LANES) :: turned_sine, turned_cosine !! of this angle
  end type turns_t

  public :: begin_turns, put_attitudes, turn_bodies

contains

  pure subroutine begin_turns(m, moments, a, o, r)
    !! Compute everything that does not depend on the time.
    integer, intent(in) :: m
    real(dp), intent(in) :: moments(LANES, 3)
    real(dp), intent(in) :: a(LANES, 3) !! A, B, C
    type(orbits_t), intent(inout) :: o
    type(turns_t), intent(inout) :: r

    call take_orbit(m, moments, a, o, r)
    call find_pole(m, o, r)
  end subroutine begin_turns

  pure subroutine turn_bodies(m, w, t, o, r)
    !! Compute the rotation from time 0 to the end, and add its error to that of the orbit.
    integer, intent(in) :: m
    real(dp), intent(in) :: w(LANES, 3) !! rad/s, at the end
    real(dp), intent(in) :: t(LANES) !! s
    type(orbits_t), intent(inout) :: o
    type(turns_t), intent(inout) :: r

    call sum_series(m, t, o, r)
    call sine_cosine_lanes(m, r%angle, r%turned_sine, r%turned_cosine)
    call add_phases(m, w, o, r)
    call rotate(m, w, o, r)
  end subroutine turn_bodies

  pure subroutine take_orbit(m, moments, a, o, r)
    !! Take moments and coefficients about the axes of the orbit.
    integer, intent(in) :: m
    real(dp), intent(in) :: moments(LANES, 3), a(LANES, 3)
    type(orbits_t), intent(inout) :: o
    type(turns_t), intent(inout) :: r
    real(dp) :: s1, s3, first, third, x, y, z
    integer :: i

    do i = 1, m
      s1 = abs(a(i, 1))
      s3 = abs(a(i, 3))
      first = moments(i, 1)
      third = moments(i, 3)
      if (o%gap(i) < 0.0_dp) then
        s1 = abs(a(i, 3))
        s3 = abs(a(i, 1))
        first = moments(i, 3)
        third = moments(i, 1)
      end if
      r%s1(i) = s1
      r%s2(i) = abs(a(i, 2))
      r%s3(i) = s3
      r%first(i) = first
      r%second(i) = moments(i, 2)
      r%third(i) = third
      r%quotient(i) = first/third
      x = first*o%omega1(i)
      y = moments(i, 2)*o%omega2(i)
      z = third*o%omega3(i)
      x = (x*x + y*y) + z*z
      if (.not. (x <= FAR .and. x >= 1.0_dp/FAR)) o%own_error(i) = NEVER
      r%momentum(i) = sqrt(x)
      x = o%omega1(i)*o%omega1(i)
      y = o%omega2(i)*o%omega2(i)
      z = o%omega3(i)*o%omega3(i)
      r%size1(i) = r%s2(i)*x + s1*y
      r%size3(i) = s3*y + r%s2(i)*z
      r%inverse3(i) = 1.0_dp/r%size3(i)
      r%root2(i) = sqrt(r%s2(i)*r%inverse3(i))
    end do
  end subroutine take_orbit

  pure subroutine find_pole(m, o, r)
    !! Compute the nome and the imaginary phase at which dn is L over I3 times the largest omega3.
    integer, intent(in) :: m
    type(orbits_t), intent(in) :: o
    type(turns_t), intent(inout) :: r
    real(dp) :: x, y, z, p, inverse
    integer :: i, n

    do i = 1, m
      ! Half of a - b at level 2 over 2 (a + b) at level 3, without cancellation.
      z = (2.0_dp*o%half_gap(i))/(o%a(i, 1)*o%a(i, 1))
      y = (o%a(i, 1)*o%a(i, 1))/(o%a(i, 2)*o%a(i, 2)*(o%a(i, 3)*(o%a(i, 3) + o%b(i, 3))))
      z = (z*z)*(z*z)*((1.0_dp/32768.0_dp)*(o%a(i, 1)*o%a(i, 1))*y)
      x = (z*z)*(z*z)
      r%fourth(i) = z + z*(x*(NOME(1) + x*(NOME(2) + x*(NOME(3) + x*NOME(4)))))
      x = sqrt(r%s1(i)*r%size1(i))*r%quotient(i)
      r%reach(i) = o%a(i, 0) + sqrt(o%a(i, 0)*o%a(i, 0) + x*x)
      r%pole(i) = x/r%reach(i)
      r%x(i) = 0.5_dp*sqrt(2.0_dp*o%half_gap(i))*r%pole(i)
      r%y(i) = r%x(i)
    end do
    do n = 1, LEVELS - 1
      do i = 1, m
        inverse = 1.0_dp/(o%a(i, n) + sqrt(o%a(i, n)*o%a(i, n) + r%x(i)*r%x(i)))
        r%y(i) = r%y(i)*((2.0_dp*o%a(i, n + 1))*inverse)
        r%x(i) = 0.25_dp*(o%a(i, n - 1) - o%b(i, n - 1))*(r%x(i)*inverse)
      end do
    end do
    do i = 1, m
      z = r%fourth(i)
      p = 1.0_dp + z*(1.0_dp + (z*z)*(1.0_dp + (z*z)*z))
      p = p*p
      inverse = 1.0_dp/(o%a(i, LEVELS)*p)
      x = r%x(i)*(inverse*p)
      y = r%y(i)*(0.25_dp*inverse)*(1.0_dp - 0.25_dp*x*x)
      p = sqrt(sqrt(z) + y*y)
      r%up(i) = (p + y)*(p + y)
      r%down(i) = (p - y)*(p - y)
    end do
  end subroutine find_pole

  pure subroutine sum_series(m, t, o, r)
    !! Sum the theta function at the phase, and its slope at phase 0, from which the mean rate of
    !! the rotation follows.
    integer, intent(in) :: m
    real(dp), intent(in) :: t(LANES) !! s
    type(orbits_t), intent(inout) :: o
    type(turns_t), intent(inout) :: r
    real(dp) :: sense, parts, slope, zero, rate
    real(dp) :: up, up2, up3, up4, up5, down, down2, down3, down4, down5, power, square
    real(dp) :: c2, x, y, z
    integer :: i

    do i = 1, m
      ! Terms of both exponentials, then their sums and differences.
      power = r%fourth(i)
      square = power*power
      up = -r%up(i)
      down = -r%down(i)
      up2 = up*up*power
      down2 = down*down*power
      up3 = up2*up*square
      down3 = down2*down*square
      x = square*power
      up4 = up3*up*x
      down4 = down3*down*x
      x = square*square
      up5 = up4*up*x
      down5 = down4*down*x
      zero = 1.0_dp + ((up + down) + ((up2 + down2) + ((up3 + down3) &
                                                       + ((up4 + down4) + (up5 + down5)))))
      slope = 4.0_dp*(up4 - down4) + 5.0_dp*(up5 - down5)
      slope = 2.0_dp*((up - down) + (2.0_dp*(up2 - down2) + (3.0_dp*(up3 - down3) + slope)))
      ! Clenshaw's sums.
      c2 = 2.0_dp - 4.0_dp*r%sine(i)*r%sine(i)
      x = (up4 + down4) + c2*(up5 + down5)
      y = (up3 + down3) + (c2*x - (up5 + down5))
      z = (up2 + down2) + (c2*y - x)
      x = (up + down) + (c2*z - y)
      r%c(i) = 1.0_dp + (0.5_dp*c2*x - z)
      x = (up4 - down4) + c2*(up5 - down5)
      y = (up3 - down3) + (c2*x - (up5 - down5))
      z = (up2 - down2) + (c2*y - x)
      x = (up - down) + (c2*z - y)
      r%s(i) = 2.0_dp*r%sine(i)*r%cosine(i)*x
      ! At phase 0 omega3 is largest.
      sense = sign(1.0_dp, r%third(i) - r%first(i))
      x = r%momentum(i)*r%root2(i) + r%third(i)
      y = r%quotient(i)*(r%second(i)*r%size1(i))*r%root2(i)
      parts = (y*zero - 2.0_dp*o%mean(i)*slope*x)/(x*zero)
      rate = r%momentum(i)/r%third(i)
      r%angle(i) = 0.5_dp*(rate + sense*parts)*t(i)
      r%s(i) = sense*r%s(i)
      ! The relative error of the phase is that of the orbit without the 1 that was added to it.
      x = o%error(i)/(1.0_dp + abs(o%phase(i)))
      o%error(i) = max(o%error(i), x + max(x, ERROR)*(0.5_dp*(rate + abs(parts))*abs(t(i))))
    end do
  end subroutine sum_series

  pure subroutine add_phases(m, w, o, r)
    !! Apply the addition theorem of the theta function, and rotate by the mean rate.
    integer, intent(in) :: m
    real(dp), intent(in) :: w(LANES, 3) !! rad/s, at the end
    type(orbits_t), intent(in) :: o
    type(turns_t), intent(inout) :: r
    real(dp) :: e1, e3, sense, root, dn0, dn1, inverse, sn, v0, v1, w1, x, y
    integer :: i

    do i = 1, m
      e1 = w(i, 1)
      e3 = w(i, 3)
      if (o%gap(i) < 0.0_dp) then
        e1 = w(i, 3)
        e3 = w(i, 1)
      end if
      ! sn, and cn times dn, of the initial and the final phase, after one of Landen's
      ! transformations, times factors that depend on the pole.
      dn0 = 1.0_dp + abs(o%omega3(i))*r%root2(i)
      dn1 = 1.0_dp + abs(e3)*r%root2(i)
      inverse = 1.0_dp/(dn0*dn1)
      root = sqrt(r%s3(i)*r%inverse3(i))
      v0 = r%pole(i)*root*o%omega2(i)*(dn1*inverse)
      v1 = r%pole(i)*root*w(i, 2)*(dn0*inverse)
      x = 1.0_dp/o%a(i, 1)
      w1 = (root*r%root2(i)*r%size3(i))*(r%pole(i)*x)*e1*(dn0*inverse)
      ! sn of the phase in between.
      sn = sqrt(o%cosine(i)*o%cosine(i) + o%modulus(i)*(o%sine(i)*o%sine(i)))
      sn = 2.0_dp*o%a(i, 1)*o%sine(i)*o%denominator(i) &
           /(sn*(o%denominator(i) + o%numerator(i)))
      y = r%reach(i)*x
      y = 1.0_dp + 0.25_dp*(r%s3(i)*(y*y))/(r%s1(i)*(r%quotient(i)*r%quotient(i)))
      x = r%pole(i)*x
      root = sqrt(y*(1.0_dp + 0.5_dp*o%half_gap(i)*(x*x)))
      ! A growing phase gives omega2 this sign.
      sense = sign(1.0_dp, r%third(i) - r%first(i))
      x = 1.0_dp + v1*v1 - sign(sense, o%omega3(i)*o%gap(i)*sense)*sn*v0*w1
      y = sense*root*sn*(v0*v1)
      root = r%c(i)*x - r%s(i)*y
      y = r%c(i)*y + r%s(i)*x
      r%c(i) = root*r%turned_cosine(i) - y*r%turned_sine(i)
      r%s(i) = root*r%turned_sine(i) + y*r%turned_cosine(i)
    end do
  end subroutine add_phases

  pure subroutine rotate(m, w, o, r)
    !! Compute D(0)* D(t). Axis 3 points along omega3; if axes 1 and 3 are exchanged, axis 2 is
    !! reversed.
    integer, intent(in) :: m
    real(dp), intent(in) :: w(LANES, 3) !! rad/s, at the end
    type(orbits_t), intent(inout) :: o
    type(turns_t), intent(inout) :: r
    real(dp) :: e1, e3, s2, s3, a0, b0, c0, a1, b1, c1, d0, d1, d2, d3, q0, q1, q2, q3, x
    integer :: i

    do i = 1, m
      e1 = w(i, 1)
      e3 = w(i, 3)
      if (o%gap(i) < 0.0_dp) then
        e1 = w(i, 3)
        e3 = w(i, 1)
      end if
      s3 = sign(1.0_dp, o%omega3(i))
      s2 = sign(s3, s3*o%gap(i))
      ! Twice the shortest rotation of L to axis 3, times a factor, at either end.
      a0 = r%momentum(i) + r%third(i)*abs(o%omega3(i))
      b0 = s2*(r%second(i)*o%omega2(i))
      c0 = -r%first(i)*o%omega1(i)
      a1 = r%momentum(i) + r%third(i)*abs(e3)
      b1 = s2*(r%second(i)*w(i, 2))
      c1 = -r%first(i)*e1
      d0 = r%c(i)*a1
      d1 = r%c(i)*b1 - r%s(i)*c1
      d2 = r%c(i)*c1 + r%s(i)*b1
      d3 = r%s(i)*a1
      q0 = a0*d0 + b0*d1 + c0*d2
      q1 = a0*d1 - b0*d0 - c0*d3
      q2 = s2*(a0*d2 - c0*d0 + b0*d3)
      q3 = s3*(a0*d3 - b0*d2 + c0*d1)
      x = (q0*q0 + q1*q1) + (q2*q2 + q3*q3)
      if (.not. (x <= NEVER .and. x > 0.0_dp)) o%error(i) = NEVER
      x = 1.0_dp/sqrt(x)
      r%scalar(i) = q0*x
      r%vector(i, 2) = q2*x
      e1 = q1*x
      e3 = q3*x
      r%vector(i, 1) = e1
      r%vector(i, 3) = e3
      if (o%gap(i) < 0.0_dp) then
        r%vector(i, 1) = e3
        r%vector(i, 3) = e1
      end if
    end do
  end subroutine rotate

  subroutine put_attitudes(m, bodies, block, row, r, error)
    !! Apply the rotation of each body of a block to its attitude at time 0.
    integer, intent(in) :: m                !! number of lanes
    type(bodies_t), intent(in) :: bodies
    type(block_t), intent(in) :: block
    integer, intent(in) :: row              !! of the results, if there are several of a body
    type(turns_t), intent(in) :: r
    real(dp), intent(inout) :: error(LANES) !! NEVER if an attitude is far from unit norm
    real(dp) :: p(4, LANES), q(4, LANES), x
    integer :: i, first

    if (size(bodies%attitude0, 2) == 1) then
      do i = 1, m
        p(:, i) = bodies%attitude0(:, 1)
      end do
    else if (block%in_row .and. m == block%there) then
      first = block%at(1) - 1
      p(:, :m) = bodies%attitude0(:, first + 1:first + m)
    else
      do i = 1, m
        p(:, i) = bodies%attitude0(:, block%at(i))
      end do
    end if
    do i = 1, m
      x = (p(1, i)*p(1, i) + p(2, i)*p(2, i)) + (p(3, i)*p(3, i) + p(4, i)*p(4, i))
      if (.not. (x <= FAR .and. x >= 1.0_dp/FAR)) error(i) = NEVER
      x = 1.0_dp/sqrt(x)
      q(1, i) = x*(p(1, i)*r%scalar(i) - p(2, i)*r%vector(i, 1) &
                   - (p(3, i)*r%vector(i, 2) + p(4, i)*r%vector(i, 3)))
      q(2, i) = x*(p(1, i)*r%vector(i, 1) + p(2, i)*r%scalar(i) &
                   + (p(3, i)*r%vector(i, 3) - p(4, i)*r%vector(i, 2)))
      q(3, i) = x*(p(1, i)*r%vector(i, 2) + p(3, i)*r%scalar(i) &
                   + (p(4, i)*r%vector(i, 1) - p(2, i)*r%vector(i, 3)))
      q(4, i) = x*(p(1, i)*r%vector(i, 3) + p(4, i)*r%scalar(i) &
                   + (p(2, i)*r%vector(i, 2) - p(3, i)*r%vector(i, 1)))
    end do
    do i = 1, block%there
      call put_attitude(bodies, block%at(i), row, q(:, i))
    end do
  end subroutine put_attitudes

end module many_turns

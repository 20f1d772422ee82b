module many_growth
  !! Bounds of the error amplification of many torque-free bodies side by side.
  use bodies, only: LANES
  use kinds, only: dp
  use many_orbits, only: LEVELS, orbits_t
  implicit none(type, external)
  private

  ! A result whose rounding error may be amplified beyond UNSURE tolerances is left to the
  ! single-body kernel, which measures the amplification. Before, three bounds are tried, each
  ! tighter and slower than the last. The second takes no division and no root; it allots the part
  ! OF_AMPLITUDES of the largest allowed amplification to the amplitudes, and the rest to the phase.
  real(dp), parameter, public :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter, public :: UNSURE = 0.3_dp
  real(dp), parameter :: ABOVE_ESTIMATE = 1.5_dp ! margin, as in torque_free_differences.f90
  real(dp), parameter :: OF_AMPLITUDES = 0.2_dp
  real(dp), parameter :: LEAST = tiny(1.0_dp)

  public :: ask_again, bound_phase

contains

  pure subroutine bound_phase(m, tolerance, a, t, o)
    !! Bound torque_free_growth_bound from above, squared and without a division, for the bodies
    !! for which the exponential bound does not suffice.
    integer, intent(in) :: m
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: a(LANES, 3)
    real(dp), intent(in) :: t(LANES) !! s
    type(orbits_t), intent(inout) :: o
    real(dp) :: most, turning, allowed, c1, c3, s1, s2, s3, s12, y1, y2, gap
    integer :: i

    most = UNSURE*tolerance/(ABOVE_ESTIMATE*ROUNDING)
    do i = 1, m
      s1 = abs(a(i, 1))
      s2 = abs(a(i, 2))
      s3 = abs(a(i, 3))
      if (o%gap(i) < 0.0_dp) then
        s1 = abs(a(i, 3))
        s3 = abs(a(i, 1))
      end if
      gap = abs(o%gap(i))
      y2 = o%omega2(i)*o%omega2(i)
      c1 = s2*(o%omega1(i)*o%omega1(i)) + s1*y2
      c3 = s3*y2 + s2*(o%omega3(i)*o%omega3(i))
      s12 = s1*s2
      turning = 4.0_dp*c1*max(s1*s1*c3, s12*c3, s3*s3*c1) &
                *((s3*s3*c1 + s12*c3)*(s2*(gap*gap)) + (s1*s1*c3 + s3*s3*c1)*(s1*(c3*c3)))
      allowed = (((1.0_dp - OF_AMPLITUDES)*most)*(s12*(c3*gap)))**2
      y1 = max(s12, s1*s1, s2*s2, s1*s3)*(s1*c3)**2
      y2 = (OF_AMPLITUDES*most)**2*s12*(s2*gap)**2
      ! With a condition of several comparisons, the loop would not be vector code.
      if (.not. y1 <= y2) allowed = -1.0_dp
      if (.not. y2 <= huge(allowed)) allowed = -1.0_dp
      if (.not. y2 >= LEAST) allowed = -1.0_dp
      if (.not. allowed <= huge(allowed)) allowed = -1.0_dp
      if (.not. allowed >= LEAST) allowed = -1.0_dp
      if (turning*(t(i)*t(i)) <= allowed) o%unsure(i) = 0.0_dp
    end do
  end subroutine bound_phase

  pure subroutine ask_again(m, tolerance, a, w, t, o)
    !! Evaluate torque_free_growth_bound for the bodies whose first bound does not suffice.
    integer, intent(in) :: m
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: a(LANES, 3), w(LANES, 3) !! rad/s, at the end
    real(dp), intent(in) :: t(LANES) !! s
    type(orbits_t), intent(inout) :: o
    real(dp) :: enough, s1, s2, s3, y1, y2, y3, gap, c1, c3, speed, relative, amplified
    real(dp) :: larger, smaller, mean, share, total
    integer :: i, level

    enough = UNSURE*tolerance/(ABOVE_ESTIMATE*ROUNDING)
    do i = 1, m
      s1 = abs(a(i, 1))
      s2 = abs(a(i, 2))
      s3 = abs(a(i, 3))
      speed = max(s1*abs(w(i, 2)*w(i, 3)), s2*abs(w(i, 3)*w(i, 1)), s3*abs(w(i, 1)*w(i, 2)))
      if (o%gap(i) < 0.0_dp) then
        s1 = abs(a(i, 3))
        s3 = abs(a(i, 1))
      end if
      y1 = o%omega1(i)*o%omega1(i)
      y2 = o%omega2(i)*o%omega2(i)
      y3 = o%omega3(i)*o%omega3(i)
      gap = abs(o%gap(i))
      c1 = s2*y1 + s1*y2
      c3 = s3*y2 + s2*y3
      larger = sqrt(s1*c3)
      smaller = sqrt(s2*gap)
      total = 0.0_dp
      !GCC$ unroll 5
      do level = 1, LEVELS
        mean = 0.5_dp*(larger + smaller)
        total = total + 2.0_dp**(level - 3)*(larger - smaller)**2
        smaller = sqrt(larger*smaller)
        larger = mean
      end do
      share = 0.5_dp
      if (s1*c3 > s2*gap) share = max(0.0_dp, 0.5_dp - total/(s1*c3 - s2*gap))
      relative = (1.0_dp - share)*sqrt((s2 + s3)/c3) &
                 + share*(s1*sqrt(c3/s2) + s3*sqrt(c1/s2))/gap
      amplified = sqrt(max(1.0_dp, s1/s2, s2/s1, s3/s2))*(s1/s2)*(c3/gap)
      amplified = amplified + abs(t(i))*speed*relative
      if (amplified <= enough) o%unsure(i) = 0.0_dp
      o%growth(i) = max(1.0_dp, ABOVE_ESTIMATE*amplified)
    end do
  end subroutine ask_again

end module many_growth

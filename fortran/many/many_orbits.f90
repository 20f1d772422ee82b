module many_orbits
  !! Motions of torque-free bodies side by side.
  use bodies, only: LANES
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: LEVELS = 5 !! levels of the arithmetic-geometric mean

  type, public :: orbits_t
    !! The members of orbit_t of torque_free.f90, lane by lane; the axes are in the same order.
    real(dp), dimension(LANES) :: omega1, omega2, omega3
    real(dp), dimension(LANES) :: rate1, rate2, rate3
    real(dp), dimension(LANES) :: modulus, amplitude2, amplitude3, half_gap
    real(dp), dimension(LANES) :: odd       !! body's axis that is axis 2 here; 0: none
    real(dp), dimension(LANES) :: gap       !! negative: axes 1 and 3 are exchanged
    real(dp), dimension(LANES) :: own_error !! relative error of the frequency
    real(dp), dimension(LANES) :: error     !! estimate of the relative error
    real(dp), dimension(LANES) :: rate      !! square of exponent over largest exponent, 1/s2
    real(dp), dimension(LANES) :: unsure    !! 1 if no bound of the amplification suffices so far
    real(dp), dimension(LANES) :: growth    !! last bound of the amplification, if it was computed
    real(dp), dimension(LANES, 0:LEVELS) :: a, b !! the two means, level by level
    real(dp), dimension(LANES) :: mean      !! the mean in the limit
    real(dp), dimension(LANES) :: half_square !! of the modulus left by the means
    real(dp), dimension(LANES) :: ratio     !! of tangents at the last level
    real(dp), dimension(LANES) :: phase     !! at the end, rad
    real(dp), dimension(LANES) :: sine, cosine !! in the ratio of sn and cn
    real(dp), dimension(LANES) :: numerator, denominator !! dn is their quotient
    real(dp), dimension(LANES) :: square    !! of the sine, at the last level but one
  end type orbits_t

end module many_orbits

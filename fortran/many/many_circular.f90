module many_circular
  !! Sines and cosines of many angles side by side.
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: LANES
  use kinds, only: dp
  implicit none(type, external)
  private

  real(dp), parameter :: ROUNDS = 1.5_dp*2.0_dp**52     ! added and subtracted: rounds to an integer
  real(dp), parameter :: QUARTERS = 0.63661977236758134308_dp ! 2/pi
  ! pi/2 in double-double. The first number has 33 bits: its product with a number below 2**20 is
  ! exact.
  real(dp), parameter :: HALF_PI = 1.5707963267341256142_dp
  real(dp), parameter :: HALF_PI_LOW = 6.0771005065061922e-11_dp
  ! Minimax polynomials on angles up to pi/4 (fdlibm, Sun Microsystems 1993).
  real(dp), parameter :: S(6) = [-1.66666666666666324348e-01_dp, 8.33333333332248946124e-03_dp, &
                                 -1.98412698298579493134e-04_dp, 2.75573137070700676789e-06_dp, &
                                 -2.50507602534068634195e-08_dp, 1.58969099521155010221e-10_dp]
  real(dp), parameter :: C(6) = [4.16666666666666019037e-02_dp, -1.38888888888741095749e-03_dp, &
                                 2.48015872894767294178e-05_dp, -2.75573143513906633035e-07_dp, &
                                 2.08757232129817482790e-09_dp, -1.13596475577881948265e-11_dp]

  public :: sine_cosine_lanes

contains

  pure subroutine sine_cosine_lanes(m, angle, sine, cosine)
    !! Compute sine and cosine to 2e-16 for angles up to 1e6 rad; for larger angles the results are
    !! meaningless.
    integer, intent(in) :: m
    real(dp), intent(in) :: angle(LANES)
    real(dp), intent(inout) :: sine(LANES), cosine(LANES)
    real(dp) :: turns, x, x2, s_, c_
    integer(int64) :: quarter
    integer :: i

    do i = 1, m
      turns = angle(i)*QUARTERS + ROUNDS
      quarter = transfer(turns, quarter)
      turns = turns - ROUNDS
      x = (angle(i) - turns*HALF_PI) - turns*HALF_PI_LOW
      x2 = x*x
      ! The polynomials of fdlibm.
      s_ = x + x*x2*(S(1) + x2*(S(2) + x2*(S(3) + x2*(S(4) + x2*(S(5) + x2*S(6))))))
      c_ = (1.0_dp - 0.5_dp*x2) &
           + x2*x2*(C(1) + x2*(C(2) + x2*(C(3) + x2*(C(4) + x2*(C(5) + x2*C(6))))))
      x = merge(c_, s_, iand(quarter, 1_int64) /= 0_int64)
      x2 = merge(s_, c_, iand(quarter, 1_int64) /= 0_int64)
      sine(i) = transfer(ieor(transfer(x, quarter), &
                              ishft(iand(quarter, 2_int64), 62)), x)
      cosine(i) = transfer(ieor(transfer(x2, quarter), &
                                ishft(iand(quarter + 1_int64, 2_int64), 62)), x)
    end do
  end subroutine sine_cosine_lanes

end module many_circular

module torque_law
  !! Torque over moment: constant + rate t + sines + cosines.
  use kinds, only: dp
  use two_words, only: sine_cosine, two_product
  implicit none(type, external)
  private

  public :: torque_at, torque_rate_at

contains

  pure subroutine torque_at(m_constant, m_rate, n_sines, sines, n_cosines, cosines, time, &
                            time_low, m)
    !! Torque at time + time_low.
    real(dp), intent(in) :: m_constant(3)          !! 1/s2
    real(dp), intent(in) :: m_rate(3)              !! 1/s3
    integer, intent(in) :: n_sines
    real(dp), intent(in) :: sines(4, n_sines)      !! amplitude (3), 1/s2; frequency, rad/s
    integer, intent(in) :: n_cosines
    real(dp), intent(in) :: cosines(4, n_cosines)  !! the same
    real(dp), intent(in) :: time                   !! s
    real(dp), intent(in) :: time_low               !! what its rounding left out, s
    real(dp), intent(out) :: m(3)                  !! 1/s2
    real(dp) :: sine
    real(dp) :: cosine
    integer :: k

    m = m_constant + m_rate*time
    do k = 1, n_sines
      call wave_at(sines(4, k), time, time_low, sine, cosine)
      m = m + sines(1:3, k)*sine
    end do
    do k = 1, n_cosines
      call wave_at(cosines(4, k), time, time_low, sine, cosine)
      m = m + cosines(1:3, k)*cosine
    end do
  end subroutine torque_at

  pure subroutine wave_at(frequency, time, time_low, sine, cosine)
    !! With what the rounding of the angle leaves out: after 1e5 radians that is worth 1e-11.
    real(dp), intent(in) :: frequency              !! rad/s
    real(dp), intent(in) :: time                   !! s
    real(dp), intent(in) :: time_low               !! s
    real(dp), intent(out) :: sine
    real(dp), intent(out) :: cosine
    real(dp) :: angle
    real(dp) :: angle_low

    call two_product(frequency, time, angle, angle_low)
    call sine_cosine(angle, angle_low + frequency*time_low, sine, cosine)
  end subroutine wave_at

  pure subroutine torque_rate_at(m_rate, n_sines, sines, n_cosines, cosines, time, rate)
    !! Derivative of the torque by time.
    real(dp), intent(in) :: m_rate(3)
    integer, intent(in) :: n_sines
    real(dp), intent(in) :: sines(4, n_sines)
    integer, intent(in) :: n_cosines
    real(dp), intent(in) :: cosines(4, n_cosines)
    real(dp), intent(in) :: time
    real(dp), intent(out) :: rate(3)               !! 1/s3
    integer :: k

    rate = m_rate
    do k = 1, n_sines
      rate = rate + sines(1:3, k)*(sines(4, k)*cos(sines(4, k)*time))
    end do
    do k = 1, n_cosines
      rate = rate - cosines(1:3, k)*(cosines(4, k)*sin(cosines(4, k)*time))
    end do
  end subroutine torque_rate_at

end module torque_law

module torque_law
  !! Torque over moment: constant + rate t + sines + cosines.
  use kinds, only: dp
  implicit none(type, external)
  private

  public :: torque_at, torque_rate_at

contains

  pure subroutine torque_at(m_constant, m_rate, n_sines, sines, n_cosines, cosines, time, m)
    real(dp), intent(in) :: m_constant(3)          !! 1/s2
    real(dp), intent(in) :: m_rate(3)              !! 1/s3
    integer, intent(in) :: n_sines
    real(dp), intent(in) :: sines(4, n_sines)      !! amplitude (3), 1/s2; frequency, rad/s
    integer, intent(in) :: n_cosines
    real(dp), intent(in) :: cosines(4, n_cosines)  !! the same
    real(dp), intent(in) :: time                   !! s
    real(dp), intent(out) :: m(3)                  !! 1/s2
    integer :: k

    m = m_constant + m_rate*time
    do k = 1, n_sines
      m = m + sines(1:3, k)*sin(sines(4, k)*time)
    end do
    do k = 1, n_cosines
      m = m + cosines(1:3, k)*cos(cosines(4, k)*time)
    end do
  end subroutine torque_at

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

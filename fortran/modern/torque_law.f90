module torque_law
  !! Torque over moment: constant + rate t + sines + cosines.
  use kinds, only: dp
  use problem, only: problem_t
  use two_words, only: sine_cosine, two_product
  implicit none(type, external)
  private

  public :: torque_at, torque_rate_at

contains

  pure subroutine torque_at(problem, time, time_low, m)
    !! Torque at time + time_low.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: time      !! s
    real(dp), intent(in) :: time_low  !! what its rounding left out, s
    real(dp), intent(out) :: m(3)     !! 1/s2
    real(dp) :: sine, cosine
    integer :: k

    m = problem%constant + problem%rate*time
    do k = 1, size(problem%sines, 2)
      call wave_at(problem%sines(4, k), time, time_low, sine, cosine)
      m = m + problem%sines(1:3, k)*sine
    end do
    do k = 1, size(problem%cosines, 2)
      call wave_at(problem%cosines(4, k), time, time_low, sine, cosine)
      m = m + problem%cosines(1:3, k)*cosine
    end do
  end subroutine torque_at

  pure subroutine wave_at(frequency, time, time_low, sine, cosine)
    !! With what the rounding of the angle leaves out: after 1e5 radians that is worth 1e-11.
    real(dp), intent(in) :: frequency              !! rad/s
    real(dp), intent(in) :: time                   !! s
    real(dp), intent(in) :: time_low               !! s
    real(dp), intent(out) :: sine
    real(dp), intent(out) :: cosine
    real(dp) :: angle, angle_low

    call two_product(frequency, time, angle, angle_low)
    call sine_cosine(angle, angle_low + frequency*time_low, sine, cosine)
  end subroutine wave_at

  pure subroutine torque_rate_at(problem, time, rate)
    !! Derivative of the torque by time.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: time      !! s
    real(dp), intent(out) :: rate(3)  !! 1/s3
    real(dp) :: wave(4)
    integer :: k

    rate = problem%rate
    do k = 1, size(problem%sines, 2)
      wave = problem%sines(:, k)
      rate = rate + wave(1:3)*(wave(4)*cos(wave(4)*time))
    end do
    do k = 1, size(problem%cosines, 2)
      wave = problem%cosines(:, k)
      rate = rate - wave(1:3)*(wave(4)*sin(wave(4)*time))
    end do
  end subroutine torque_rate_at

end module torque_law

module torque_law
  !! Torque over moment: constant + rate t + sines + cosines.
  use kinds, only: dp
  use problem, only: problem_t
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  public :: torque_at, torque_rate_at

contains

  pure subroutine torque_at(problem, time, time_low, m)
    !! Compute the torque over moment at time + time_low.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: time      !! s
    real(dp), intent(in) :: time_low  !! rounding error of time, s
    real(dp), intent(out) :: m(3)     !! rad/s2

    m = problem%constant + problem%rate*time
    if (problem%n_sines + problem%n_cosines > 0) then
      call add_waves(problem%n_sines, problem%sines, .true., time, time_low, m)
      call add_waves(problem%n_cosines, problem%cosines, .false., time, time_low, m)
    end if
  end subroutine torque_at

  pure subroutine add_waves(n, waves, are_sines, time, time_low, m)
    !! Add the sines or the cosines.
    integer, intent(in) :: n
    real(dp), intent(in) :: waves(4, n) !! amplitude (3), rad/s2; frequency, rad/s
    logical, intent(in) :: are_sines
    real(dp), intent(in) :: time        !! s
    real(dp), intent(in) :: time_low    !! s
    real(dp), intent(inout) :: m(3)     !! rad/s2
    real(dp) :: sine, cosine
    integer :: k

    do k = 1, n
      call sine_cosine_of(waves(4, k), time, time_low, sine, cosine)
      m = m + waves(1:3, k)*merge(sine, cosine, are_sines)
    end do
  end subroutine add_waves

  pure subroutine torque_rate_at(problem, time, rate)
    !! Compute the derivative of the torque over moment by time.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: time      !! s
    real(dp), intent(out) :: rate(3)  !! rad/s3
    real(dp) :: wave(4)
    integer :: k

    rate = problem%rate
    do k = 1, problem%n_sines
      wave = problem%sines(:, k)
      rate = rate + wave(1:3)*(wave(4)*cos(wave(4)*time))
    end do
    do k = 1, problem%n_cosines
      wave = problem%cosines(:, k)
      rate = rate - wave(1:3)*(wave(4)*sin(wave(4)*time))
    end do
  end subroutine torque_rate_at

end module torque_law

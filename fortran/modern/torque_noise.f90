module torque_noise
  !! Rounding error of a torque whose terms nearly cancel. Each term, divided by a moment, is
  !! rounded separately, with an error of some 2**-53 of its own size. If the sum of the terms is
  !! much smaller than each, this is a large part of the sum, and no method can determine the
  !! solution more accurately.
  use kinds, only: dp
  use problem, only: problem_t
  implicit none(type, external)
  private

  integer, parameter :: SAMPLES = 8          ! times at which the omega from the sum is evaluated
  real(dp), parameter :: LOOSE = 4.0_dp      ! terms up to this multiple of their sum do not cancel
  real(dp), parameter :: QUIET = 2.0_dp      ! terms up to this multiple of omega do not matter
  real(dp), parameter :: SMALL = 1e-4_dp     ! rad; the square of a smaller angle hardly counts

  public :: torque_noise_of, wave_rounding_of

contains

  pure real(dp) function torque_noise_of(problem, t, steps, scale) result(noise)
    !! Return the angular velocity that the terms of the torque add one by one until `t`, over the
    !! largest angular velocity. Times the unit roundoff this is a relative error. The result is 0
    !! if the terms do not cancel.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: t      !! s
    real(dp), intent(in) :: steps  !! number of steps; terms are rounded in each; huge: not rounded
    real(dp), intent(in) :: scale  !! largest |omega|, rad/s; if not above 0, minus the initial
    !! |omega|, to which the sum of the terms may add
    real(dp) :: alone(3)     ! angular velocity that the terms add one by one, rad/s
    real(dp) :: walked(3)    ! the same for the rounding errors in all steps
    real(dp) :: together(3)  ! the largest that their sum adds
    real(dp) :: push(3)      ! amplitude of a wave times the whole time, rad/s
    real(dp) :: angle        ! angle of a wave at the end, rad
    real(dp) :: most, part
    integer :: n

    noise = 0.0_dp
    alone = abs(problem%constant*t) + 0.5_dp*abs(problem%rate*t)*abs(t)
    walked = alone
    do n = 1, problem%n_sines
      push = abs(problem%sines(1:3, n)*t)
      angle = abs(problem%sines(4, n)*t)
      alone = alone + push*share_of_sine(angle)
      walked = walked + push*min(1.0_dp, angle)
    end do
    do n = 1, problem%n_cosines
      push = abs(problem%cosines(1:3, n)*t)
      alone = alone + push/max(1.0_dp, abs(problem%cosines(4, n)*t))
      walked = walked + push
    end do
    most = max(alone(1), alone(2), alone(3))
    if (.not. (most > QUIET*abs(scale) .and. most <= huge(most))) return
    together = 0.0_dp
    do n = 1, SAMPLES
      part = t*(real(n, dp)/real(SAMPLES, dp))
      together = max(together, abs(sum_until(problem, part)))
    end do
    most = maxval(alone - LOOSE*together)
    if (.not. most > 0.0_dp) return
    part = scale
    if (.not. scale > 0.0_dp) part = max(-scale, together(1), together(2), together(3))
    noise = maxval(merge(alone + walked/sqrt(max(1.0_dp, steps)), [0.0_dp, 0.0_dp, 0.0_dp], &
                         alone > LOOSE*together))
    noise = min(huge(part)**0.25_dp, noise/max(part, tiny(part)))
  end function torque_noise_of

  pure real(dp) function wave_rounding_of(problem, t, steps, scale) result(noise)
    !! Return the sum of the rounding errors of the waves in every step until `t`, as a random walk,
    !! over the largest angular velocity. Times the unit roundoff this is a relative error.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: t      !! s
    real(dp), intent(in) :: steps
    real(dp), intent(in) :: scale  !! largest |omega|, rad/s
    real(dp) :: walked(3)          ! rad/s
    integer :: n

    walked = 0.0_dp
    do n = 1, problem%n_sines
      walked = walked + abs(problem%sines(1:3, n)*t)*min(1.0_dp, abs(problem%sines(4, n)*t))
    end do
    do n = 1, problem%n_cosines
      walked = walked + abs(problem%cosines(1:3, n)*t)
    end do
    noise = max(walked(1), walked(2), walked(3))/sqrt(max(1.0_dp, steps))
    noise = min(huge(noise)**0.25_dp, noise/max(scale, tiny(scale)))
  end function wave_rounding_of

  pure real(dp) function share_of_sine(angle)
    !! Return the largest integral of a sine up to an angle, over that angle.
    real(dp), intent(in) :: angle !! at least 0, rad

    share_of_sine = min(0.5_dp*angle, 1.0_dp)
    if (angle > 2.0_dp) share_of_sine = 2.0_dp/angle
  end function share_of_sine

  pure function sum_until(problem, t)
    !! Compute the angular velocity that the torque alone adds until `t`, rad/s.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: t
    real(dp) :: sum_until(3)
    real(dp) :: half
    integer :: n

    sum_until = problem%constant*t + (0.5_dp*t)*(problem%rate*t)
    do n = 1, problem%n_sines
      half = 0.5_dp*problem%sines(4, n)*t
      sum_until = sum_until + problem%sines(1:3, n)*(t*quotient(half)*sin(half))
    end do
    do n = 1, problem%n_cosines
      half = 0.5_dp*problem%cosines(4, n)*t
      sum_until = sum_until + problem%cosines(1:3, n)*(t*quotient(half)*cos(half))
    end do
  end function sum_until

  pure real(dp) function quotient(angle)
    !! Return the sine over the angle.
    real(dp), intent(in) :: angle

    quotient = 1.0_dp
    if (abs(angle) > SMALL) quotient = sin(angle)/angle
  end function quotient

end module torque_noise

module sphere
  !! Closed form of the sphere under the torque law of a scene: the integral of the torque.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: problem_t, request_t, solution_t
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW
  use two_words, only: sine_cosine, two_product, two_sum
  implicit none(type, external)
  private

  real(dp), parameter :: MOST_TERMS = 2e8_dp ! work limit: terms at all times, some ten seconds
  integer, parameter :: BETWEEN_LOOKS = 300000 ! terms between polls for an interrupt

  real(dp), parameter :: SMALL = 1e-280_dp

  public :: sphere_rows

contains

  subroutine sphere_rows(problem, request, solution)
    !! Compute the angular velocity of a sphere, or of any body with A = B = C = 0: the initial
    !! omega plus the integral of the torque over the moment. The status is COMPLETE, OVERFLOW,
    !! GAVE_UP or INTERRUPTED.
    type(problem_t), intent(in) :: problem         !! its coefficients are not used
    type(request_t), intent(in) :: request         !! times in any order; no tolerance
    type(solution_t), intent(inout) :: solution    !! without estimates
    real(dp) :: total(3)
    real(dp) :: rest(3)    ! rounding error of the total
    real(dp) :: t
    real(dp) :: unseen     ! terms since the last poll
    integer :: i

    solution%n_rows = 0
    solution%status = GAVE_UP
    solution%needed = size(request%times)*(1.0_dp + real(problem%n_sines + problem%n_cosines, dp)) &
                      /MOST_TERMS
    if (solution%needed > request%effort) return
    solution%status = COMPLETE
    unseen = 0.0_dp
    do i = 1, size(request%times)
      unseen = unseen + (1.0_dp + real(problem%n_sines + problem%n_cosines, dp))
      if (unseen > BETWEEN_LOOKS) then
        unseen = 0.0_dp
        if (interrupt_raised() /= 0) then
          solution%status = INTERRUPTED
          return
        end if
      end if
      t = request%times(i)
      total = request%omega
      rest = 0.0_dp
      call add(total, rest, problem%constant, t)
      call add(total, rest, problem%rate, 0.5_dp*t*t)
      if (problem%n_sines + problem%n_cosines > 0) then
        call add_waves(total, rest, problem%n_sines, problem%sines, .true., t)
        call add_waves(total, rest, problem%n_cosines, problem%cosines, .false., t)
      end if
      total = total + rest
      if (.not. all(abs(total) <= huge(t))) then
        solution%status = OVERFLOW
        return
      end if
      solution%rows(:, i) = total
      solution%n_rows = i
    end do
  end subroutine sphere_rows

  pure subroutine add_waves(total, rest, n, waves, are_sines, t)
    !! Add the integral of each wave: amplitude times t times a factor.
    real(dp), intent(inout) :: total(3), rest(3)
    integer, intent(in) :: n
    real(dp), intent(in) :: waves(4, n)
    logical, intent(in) :: are_sines
    real(dp), intent(in) :: t
    real(dp) :: sine, cosine   ! of half the angle
    real(dp) :: quotient       ! sine over half the angle
    real(dp) :: part
    integer :: k

    do k = 1, n
      call half_angle(waves(4, k), t, sine, cosine, quotient)
      part = merge(sine, cosine, are_sines)*quotient
      ! A small factor is not multiplied by t first, as the product might underflow.
      if (abs(t*part) >= SMALL) then
        call add(total, rest, waves(1:3, k), t*part)
      else
        call add(total, rest, waves(1:3, k)*t, part)
      end if
    end do
  end subroutine add_waves

  pure subroutine add(total, rest, amplitude, factor)
    !! Add amplitude times factor to total + rest.
    real(dp), intent(inout) :: total(3), rest(3)
    real(dp), intent(in) :: amplitude(3)
    real(dp), intent(in) :: factor
    real(dp) :: term, term_low, sum_high, sum_low
    integer :: axis

    do axis = 1, 3
      if (.not. abs(amplitude(axis)) > 0.0_dp) cycle
      call two_product(amplitude(axis), factor, term, term_low)
      call two_sum(total(axis), term, sum_high, sum_low)
      total(axis) = sum_high
      if (abs(sum_high) <= huge(factor)) rest(axis) = rest(axis) + (sum_low + term_low)
    end do
  end subroutine add

  pure subroutine half_angle(frequency, t, sine, cosine, quotient)
    !! Compute sine and cosine of frequency t/2, and that sine over its angle.
    real(dp), intent(in) :: frequency, t
    real(dp), intent(out) :: sine, cosine, quotient
    real(dp) :: angle, angle_low

    call two_product(frequency, 0.5_dp*t, angle, angle_low)
    call sine_cosine(angle, angle_low, sine, cosine)
    quotient = 1.0_dp
    if (abs(angle) > 0.0_dp) quotient = sine/angle
  end subroutine half_angle

end module sphere

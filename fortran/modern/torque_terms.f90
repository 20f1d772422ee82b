module torque_terms
  !! The part of omega's Taylor terms that the torque adds, by the law of torque over moment:
  !! constant + rate t + sines + cosines.
  use kinds, only: dp
  use problem, only: problem_t
  use series, only: MOST_ORDER
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  ! Weights in groups of four, for eight orders more than the series: sine and cosine of the angle
  ! need them.
  integer, parameter :: MOST_FOURS = MOST_ORDER/4 + 2
  integer :: order_
  real(dp), parameter :: FACTORIALS(4*MOST_FOURS + 1) = &
                         [(gamma(real(order_ + 1, dp)), order_=1, 4*MOST_FOURS + 1)]
  integer, parameter :: SIGNS(0:3) = [1, 1, -1, -1]
  real(dp), parameter :: WEIGHTS(4, MOST_FOURS) = &
                         reshape([(SIGNS(mod(order_ - 1, 4))/gamma(real(order_ + 1, dp)), &
                                   order_=1, 4*MOST_FOURS)], [4, MOST_FOURS])
  ! Each column selects a lane. Powers are put together without a store, for which a load would
  ! wait.
  real(dp), parameter :: LANES(4, 0:3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                                                  0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, &
                                                  0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, &
                                                  0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [4, 4])
  real(dp), parameter :: SMALL_TURN = 1e-8_dp ! rad; the square of a smaller angle is negligible
  real(dp), parameter :: PHASE = 0.01_dp      ! part of a step's error that an angle may cause

  ! All that a step needs of a wave, side by side.
  type, public :: wave_t
    real(dp) :: amplitude(4)  !! rad/s2, the fourth 0
    real(dp) :: frequency     !! rad/s
    real(dp) :: value         !! of the sine or cosine at the step's beginning
    real(dp) :: slope         !! its derivative by the angle
    real(dp) :: sine          !! sine of the angle of the step
    real(dp) :: versine       !! 1 - cosine of that angle
    real(dp) :: even(4)       !! amplitude times value and step, rad/s
    real(dp) :: odd(4)        !! amplitude times slope and step, rad/s
    real(dp) :: parts(4, MOST_FOURS) !! weights of `even` and `odd`, in turn, in the terms
    logical :: is_sine
  end type wave_t

  integer, parameter :: AFRESH = 16         ! steps until sine and cosine are recomputed
  ! Below this local tolerance they are recomputed in each step, as equal steps have equal errors.
  real(dp), parameter :: FINE = 1e-16_dp

  public :: longest_turn, steps_by_turns, torque_terms_at, turn_waves, waves_of

contains

  pure subroutine waves_of(problem, waves)
    !! Copy the waves of a problem, sines before cosines.
    type(problem_t), intent(in) :: problem
    type(wave_t), intent(inout) :: waves(problem%n_sines + problem%n_cosines)
    integer :: n

    do n = 1, problem%n_sines
      waves(n)%amplitude = [problem%sines(:3, n), 0.0_dp]
      waves(n)%frequency = problem%sines(4, n)
      waves(n)%is_sine = .true.
    end do
    do n = problem%n_sines + 1, problem%n_sines + problem%n_cosines
      waves(n)%amplitude = [problem%cosines(:3, n - problem%n_sines), 0.0_dp]
      waves(n)%frequency = problem%cosines(4, n - problem%n_sines)
      waves(n)%is_sine = .false.
    end do
  end subroutine waves_of

  pure real(dp) function longest_turn(order, local_tolerance)
    !! Return the largest angle, rad, for which the weights of a wave give its sine and cosine.
    integer, intent(in) :: order    !! of the series
    real(dp), intent(in) :: local_tolerance !! largest relative error of a step
    integer :: n

    n = 4*fours_of(order)
    longest_turn = (PHASE*local_tolerance*FACTORIALS(n + 1))**(1.0_dp/real(n, dp))
  end function longest_turn

  pure integer function steps_by_turns(local_tolerance)
    !! Return the number of steps after which the sines and cosines of waves are recomputed.
    real(dp), intent(in) :: local_tolerance !! largest relative error of a step

    steps_by_turns = merge(1, AFRESH, local_tolerance < FINE)
  end function steps_by_turns

  pure integer function fours_of(order)
    integer, intent(in) :: order

    fours_of = (order + 11)/4
  end function fours_of

  pure subroutine torque_terms_at(steady, t, h, order, longest, fresh, waves, torque)
    !! Compute the terms of omega around t that the torque adds, rad/s.
    real(dp), intent(in) :: steady(4, 2) !! constant torque, rad/s2, and rate, rad/s3; the fourth 0
    real(dp), intent(in) :: t(2)       !! time and its rounding error, s
    real(dp), intent(in) :: h          !! step, s
    integer, intent(in) :: order
    real(dp), intent(in) :: longest    !! largest angle that needs no call of sine and cosine, rad
    logical, intent(in) :: fresh       !! recompute sine and cosine at t instead of advancing them
    type(wave_t), intent(inout) :: waves(:)
    real(dp), intent(inout) :: torque(4, MOST_ORDER) !! 0 from order 3 on if there are no waves
    real(dp), dimension(4) :: p, q, r, u
    integer :: i, j, n

    do n = 1, size(waves)
      call weigh(t(1), t(2), h, order, longest, fresh, waves(n))
    end do
    ! The constant and the linear torque start two of the sums.
    do i = 1, 4
      p(i) = h*(steady(i, 1) + steady(i, 2)*t(1) + steady(i, 2)*t(2))
      q(i) = (0.5_dp*h)*(h*steady(i, 2))
    end do
    do j = 1, merge((order + 3)/4, 1, size(waves) > 0)
      r = 0.0_dp
      u = 0.0_dp
      do n = 1, size(waves)
        do i = 1, 4
          p(i) = p(i) + waves(n)%parts(1, j)*waves(n)%even(i)
          q(i) = q(i) + waves(n)%parts(2, j)*waves(n)%odd(i)
          r(i) = r(i) + waves(n)%parts(3, j)*waves(n)%even(i)
          u(i) = u(i) + waves(n)%parts(4, j)*waves(n)%odd(i)
        end do
      end do
      do i = 1, 4
        torque(i, 4*j - 3) = p(i)
        torque(i, 4*j - 2) = q(i)
        torque(i, 4*j - 1) = r(i)
        torque(i, 4*j) = u(i)
      end do
      p = 0.0_dp
      q = 0.0_dp
    end do
  end subroutine torque_terms_at

  pure subroutine weigh(t, t_low, h, order, longest, fresh, wave)
    !! Compute the weights of a wave. Its derivatives are value, slope, -value and -slope in turn,
    !! and term k contains turn**(k - 1)/k! of them. The weights do not depend on the phase, and
    !! their sums are the sine and the versine of the angle of the step.
    real(dp), intent(in) :: t, t_low, h, longest
    integer, intent(in) :: order
    logical, intent(in) :: fresh
    type(wave_t), intent(inout) :: wave
    real(dp) :: powers(4), totals(4)
    real(dp) :: turn                   ! angle of the step, rad
    real(dp) :: square, fourth         ! powers of that angle
    real(dp) :: sine, cosine
    integer :: i, j

    if (fresh) then
      call sine_cosine_of(wave%frequency, t, t_low, sine, cosine)
      wave%value = merge(sine, cosine, wave%is_sine)
      wave%slope = merge(cosine, -sine, wave%is_sine)
    end if
    turn = wave%frequency*h
    square = turn*turn
    fourth = square*square
    ! Smaller numbers take the processor longer, and are negligible.
    if (abs(turn) < SMALL_TURN) fourth = 0.0_dp
    do i = 1, 4
      powers(i) = (LANES(i, 0) + turn*LANES(i, 1)) + square*(LANES(i, 2) + turn*LANES(i, 3))
      totals(i) = 0.0_dp
    end do
    do j = 1, fours_of(order)
      do i = 1, 4
        wave%parts(i, j) = powers(i)*WEIGHTS(i, j)
        totals(i) = totals(i) + powers(i)*WEIGHTS(i, j)
        powers(i) = powers(i)*fourth
      end do
    end do
    if (abs(turn) <= longest) then
      wave%sine = turn*(totals(1) + totals(3))
      wave%versine = turn*(totals(2) + totals(4))
    else
      wave%sine = sin(turn)
      sine = sin(0.5_dp*turn)
      wave%versine = 2.0_dp*sine*sine
    end if
    do i = 1, 4
      wave%even(i) = (h*wave%value)*wave%amplitude(i)
      wave%odd(i) = (h*wave%slope)*wave%amplitude(i)
    end do
  end subroutine weigh

  pure subroutine turn_waves(waves)
    !! Advance the waves to the end of the step.
    type(wave_t), intent(inout) :: waves(:)
    real(dp) :: value
    integer :: n

    do n = 1, size(waves)
      value = waves(n)%value
      waves(n)%value = value + (waves(n)%slope*waves(n)%sine - value*waves(n)%versine)
      waves(n)%slope = waves(n)%slope - (value*waves(n)%sine + waves(n)%slope*waves(n)%versine)
    end do
  end subroutine turn_waves

end module torque_terms

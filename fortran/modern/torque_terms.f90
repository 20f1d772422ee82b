module torque_terms
  !! Torque over moment, constant + rate t + sines + cosines, in the Taylor terms of omega.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t
  implicit none(type, external)
  private

  integer, parameter, public :: LEAST_ORDER = 12, MOST_ORDER = 24 ! of the series
  ! Vectors of weights: eight orders more than the series has, for sine and cosine of the turn.
  integer, parameter :: MOST_FOURS = (MOST_ORDER + 8)/4 - 1
  integer :: order_
  real(dp), parameter :: FACTORIALS(4*MOST_FOURS + 4) = &
                         [(1.0_dp/gamma(real(order_ + 1, dp)), order_=1, 4*MOST_FOURS + 4)]
  real(dp), parameter :: SIGNS(4) = [1.0_dp, 1.0_dp, -1.0_dp, -1.0_dp]
  integer, parameter, public :: AFRESH = 16   ! steps until sine and cosine are made anew
  real(dp), parameter :: SMALL_TURN = 1e-8_dp ! rad; its square no longer counts
  real(dp), parameter :: PHASE = 0.01_dp      ! of the share that a turn may err

  ! A column of `wave_t` is what a step needs of a wave, side by side.
  type, public :: wave_t
    real(dp) :: amplitude(4)  !! 1/s2, the fourth 0
    real(dp) :: frequency     !! rad/s
    real(dp) :: value         !! of the wave, a sine or a cosine, at the step's beginning
    real(dp) :: slope         !! its derivative by the angle
    real(dp) :: sine          !! of the turn in the step
    real(dp) :: versine       !! 1 - cosine
    logical :: is_sine
  end type wave_t

  public :: longest_turn, sine_cosine, torque_terms_at, turn_waves, waves_of

contains

  pure subroutine waves_of(problem, waves)
    !! Sines, then cosines.
    type(problem_t), intent(in) :: problem
    type(wave_t), intent(out) :: waves(problem%n_sines + problem%n_cosines)
    integer :: n

    do n = 1, problem%n_sines
      waves(n) = wave_t([problem%sines(:3, n), 0.0_dp], problem%sines(4, n), &
                        0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, .true.)
    end do
    do n = 1, problem%n_cosines
      waves(problem%n_sines + n) = wave_t([problem%cosines(:3, n), 0.0_dp], problem%cosines(4, n), &
                                          0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, .false.)
    end do
  end subroutine waves_of

  pure real(dp) function longest_turn(order, share)
    !! Turn of a wave up to which its weights give its sine and cosine, rad.
    integer, intent(in) :: order    !! of the series
    real(dp), intent(in) :: share   !! that a step may err
    integer :: weights

    weights = 4*(fours_of(order) + 1)
    longest_turn = (PHASE*share*gamma(real(weights + 2, dp)))**(1.0_dp/real(weights, dp))
  end function longest_turn

  pure integer function fours_of(order)
    integer, intent(in) :: order

    fours_of = min(MOST_FOURS, (order + 7)/4)
  end function fours_of

  pure subroutine torque_terms_at(constant, rate, t, t_low, h, order, longest, fresh, waves, torque)
    !! What the torque adds to the terms of omega around t, rad/s.
    real(dp), intent(in) :: constant(4) !! 1/s2, the fourth 0
    real(dp), intent(in) :: rate(4)    !! 1/s3
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! rounding of t, s
    real(dp), intent(in) :: h          !! step, s
    integer, intent(in) :: order
    real(dp), intent(in) :: longest    !! turn that needs no sine and cosine, rad
    logical, intent(in) :: fresh       !! sine and cosine of t, not by the turns so far
    type(wave_t), intent(inout) :: waves(:)
    real(dp), intent(inout) :: torque(4, MOST_ORDER) !! from the third order 0 without waves
    integer :: i, n

    do i = 1, 4
      torque(i, 1) = h*(constant(i) + rate(i)*t + rate(i)*t_low)
      torque(i, 2) = (0.5_dp*h)*(h*rate(i))
    end do
    if (size(waves) > 0) torque(:, 3:4*((order + 3)/4)) = 0.0_dp
    do n = 1, size(waves)
      call add_wave(t, t_low, h, order, longest, fresh, waves(n), torque)
    end do
  end subroutine torque_terms_at

  pure subroutine add_wave(t, t_low, h, order, longest, fresh, wave, torque)
    !! The derivatives of a wave run value, slope, -value, -slope; term k has turn**(k - 1)/k! of
    !! them. Those weights know no phase: their sums are the sine and the versine of the turn.
    real(dp), intent(in) :: t, t_low, h, longest
    integer, intent(in) :: order
    logical, intent(in) :: fresh
    type(wave_t), intent(inout) :: wave
    real(dp), intent(inout) :: torque(4, MOST_ORDER)
    real(dp) :: weights(4, 0:MOST_FOURS)
    real(dp) :: powers(4), totals(4), even(4), odd(4)
    real(dp) :: turn                   ! rad
    real(dp) :: fourth                 ! power of the turn
    real(dp) :: sine, cosine
    integer :: i, j, k

    if (fresh) then
      call sine_cosine(wave%frequency, t, t_low, sine, cosine)
      wave%value = merge(sine, cosine, wave%is_sine)
      wave%slope = merge(cosine, -sine, wave%is_sine)
    end if
    turn = wave%frequency*h
    powers = [1.0_dp, turn, turn*turn, turn*turn*turn]
    fourth = powers(3)*powers(3)
    ! Smaller numbers than that cost the processor time, and count for nothing.
    if (abs(turn) < SMALL_TURN) fourth = 0.0_dp
    totals = 0.0_dp
    do j = 0, fours_of(order)
      do i = 1, 4
        weights(i, j) = powers(i)*(SIGNS(i)*FACTORIALS(4*j + i))
        totals(i) = totals(i) + weights(i, j)
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
      even(i) = (h*wave%value)*wave%amplitude(i)
      odd(i) = (h*wave%slope)*wave%amplitude(i)
    end do
    do k = 0, (order - 1)/4
      do i = 1, 4
        torque(i, 4*k + 1) = torque(i, 4*k + 1) + weights(1, k)*even(i)
        torque(i, 4*k + 2) = torque(i, 4*k + 2) + weights(2, k)*odd(i)
        torque(i, 4*k + 3) = torque(i, 4*k + 3) + weights(3, k)*even(i)
        torque(i, 4*k + 4) = torque(i, 4*k + 4) + weights(4, k)*odd(i)
      end do
    end do
  end subroutine add_wave

  pure subroutine turn_waves(waves)
    !! To the end of the step.
    type(wave_t), intent(inout) :: waves(:)
    real(dp) :: value
    integer :: n

    do n = 1, size(waves)
      value = waves(n)%value
      waves(n)%value = value + (waves(n)%slope*waves(n)%sine - value*waves(n)%versine)
      waves(n)%slope = waves(n)%slope - (value*waves(n)%sine + waves(n)%slope*waves(n)%versine)
    end do
  end subroutine turn_waves

  pure subroutine sine_cosine(frequency, t, t_low, sine, cosine)
    !! Sine and cosine of frequency (t + t_low), the second part as a small turn, and with it what
    !! the rounding of the product left out: after 1e5 radians that is worth 1e-11.
    !! As in two_words.f90, which is compiled once and can't be called from every instruction set.
    real(dp), intent(in) :: frequency  !! rad/s
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! s
    real(dp), intent(out) :: sine, cosine
    real(dp) :: angle                  ! rad
    real(dp) :: turn                   ! rad
    real(dp) :: unturned
    real(dp) :: f                      ! the frequency's upper half
    real(dp) :: s                      ! the time's

    f = upper_half(frequency)
    s = upper_half(t)
    angle = frequency*t
    ! Dekker's order: exact, however large the angle.
    turn = frequency*t_low + ((((f*s - angle) + f*(t - s)) + (frequency - f)*s) &
                              + (frequency - f)*(t - s))
    unturned = sin(angle)
    cosine = cos(angle)
    if (abs(turn) <= SMALL_TURN) then
      sine = unturned + turn*cosine
      cosine = cosine - turn*unturned
    else
      sine = unturned*cos(turn) + cosine*sin(turn)
      cosine = cosine*cos(turn) - unturned*sin(turn)
    end if
  end subroutine sine_cosine

  pure real(dp) function upper_half(x)
    !! x in 26 bits, so that products of two such numbers are exact.
    real(dp), intent(in) :: x

    upper_half = transfer(iand(transfer(x, 0_int64), not(ishft(1_int64, 27) - 1_int64)), x)
  end function upper_half

end module torque_terms

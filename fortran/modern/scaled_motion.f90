module scaled_motion
  !! Scaled unknowns in which every product has the coefficient 1 or -1, and the integral of the
  !! torque in these unknowns. Waves that are fast and weak are averaged, to second order.
  use, intrinsic :: iso_fortran_env, only: int64
  use two_words, only: sine_cosine_of
  use kinds, only: dp
  use problem, only: problem_t
  use statuses, only: COMPLETE, REFUSED
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_WAVES = 8
  real(dp), parameter, public :: FAST = 8.0_dp ! frequency of a fast wave over rate of the motion
  ! Steps for a radian of a wave that is resolved.
  real(dp), parameter :: RESOLVED_STEPS = 0.7_dp
  real(dp), parameter :: SLOW = 1e-8_dp      ! rad; a wave of a smaller angle is linear to rounding
  real(dp), parameter :: WAVE_ERROR = 1.0_dp/2880.0_dp ! error of Simpson's rule over radians**4

  ! A larger exponent of an amplification would have no further meaning.
  real(dp), parameter :: MOST_EXPONENT = 300.0_dp
  real(dp), parameter :: LOG2_E = 1.4426951_dp

  type, public :: motion_t
    real(dp) :: scale(3)     ! angular velocity (rad/s) is scale times unknown (1/s)
    real(dp) :: slope(3)     ! constant torque in the unknowns, rad/s2
    real(dp) :: climb(3)     ! rate of the torque in the unknowns, rad/s3
    integer :: waves         ! number of waves
    integer :: resolved      ! number of resolved waves, which precede the averaged waves
    real(dp) :: frequency(MOST_WAVES)    ! rad/s
    real(dp) :: on_sine(3, MOST_WAVES)   ! the integral of the wave is this times sine
    real(dp) :: on_versine(3, MOST_WAVES) ! plus this times 1 - cosine
    real(dp) :: mean(3)      ! mean of the averaged waves' integral, 1/s
    real(dp) :: push(3)      ! mean of the products of these integrals, rad/s2
    real(dp) :: sign_2       ! sign of the second product: -1 for a body
    integer :: axes(3)       ! axis of the body for each unknown
  end type motion_t

  public :: amplification, average, integral, reach_of, scaled, steps_for_wave, steps_for_waves, &
            turned, versine

contains

  pure subroutine scaled(problem, t_end, motion, status)
    !! Compute the unknowns in which all products have the coefficient 1, or -1 for the second one.
    type(problem_t), intent(in) :: problem !! with at most MOST_WAVES waves
    real(dp), intent(in) :: t_end    !! s
    type(motion_t), intent(out) :: motion
    integer, intent(out) :: status
    real(dp) :: c(3), root(3)
    real(dp) :: turned       ! -1: the third axis is reversed, which changes all signs
    integer :: i

    status = REFUSED
    ! The axis with the odd sign becomes the second.
    motion%axes = [3, 1, 2]
    c = problem%coefficients
    if (c(1)*c(2) > 0.0_dp) motion%axes = [2, 3, 1]
    if (c(1)*c(3) > 0.0_dp) motion%axes = [1, 2, 3]
    c = c(motion%axes)
    motion%sign_2 = merge(-1.0_dp, 1.0_dp, c(1)*c(2) < 0.0_dp)
    turned = 1.0_dp
    if (c(1) < 0.0_dp) turned = -1.0_dp
    root = sqrt(abs(c))
    if (.not. minval(root) > 0.0_dp) return
    motion%scale(1) = 1.0_dp/(root(2)*root(3))
    motion%scale(2) = 1.0_dp/(root(1)*root(3))
    motion%scale(3) = turned/(root(1)*root(2))
    if (.not. maxval(abs(motion%scale)) <= 1e100_dp) return
    motion%slope = problem%constant(motion%axes)/motion%scale
    motion%climb = problem%rate(motion%axes)/motion%scale
    motion%waves = 0
    motion%resolved = 0
    do i = 1, problem%n_sines
      call add_wave(problem%sines(:, i), .false., t_end, motion)
    end do
    do i = 1, problem%n_cosines
      call add_wave(problem%cosines(:, i), .true., t_end, motion)
    end do
    status = COMPLETE
  end subroutine scaled

  pure subroutine add_wave(wave, is_cosine, t_end, motion)
    !! Add the integral of one more wave. Waves of one frequency share their sine and versine.
    real(dp), intent(in) :: wave(4)       !! amplitude (3), rad/s2; frequency, rad/s
    logical, intent(in) :: is_cosine
    real(dp), intent(in) :: t_end         !! s
    type(motion_t), intent(inout) :: motion
    real(dp) :: part(3)
    real(dp) :: frequency
    integer :: n

    part = wave(motion%axes)/motion%scale
    frequency = wave(4)
    if (abs(frequency*t_end) < SLOW) then
      if (is_cosine) then
        motion%slope = motion%slope + part
      else
        motion%climb = motion%climb + part*frequency
      end if
      return
    end if
    do n = 1, motion%waves
      if (abs(motion%frequency(n) - frequency) <= 0.0_dp) exit
    end do
    if (n > motion%waves) then
      motion%waves = n
      motion%frequency(n) = frequency
      motion%on_sine(:, n) = 0.0_dp
      motion%on_versine(:, n) = 0.0_dp
    end if
    if (is_cosine) then
      motion%on_sine(:, n) = motion%on_sine(:, n) + part/frequency
    else
      motion%on_versine(:, n) = motion%on_versine(:, n) + part/frequency
    end if
  end subroutine add_wave

  pure subroutine average(motion, rate, t_end, faint, left_out)
    !! Take waves that are fast and weak out of the products, except for their means and for the
    !! oscillation that they cause (`turned`). The error that remains is of second order.
    type(motion_t), intent(inout) :: motion
    real(dp), intent(in) :: rate         !! largest rate of the motion, 1/s
    real(dp), intent(in) :: t_end        !! s
    real(dp), intent(in) :: faint        !! allowed error, rad/s
    real(dp), intent(out) :: left_out    !! error of averaging, in the unknowns
    real(dp) :: largest                  ! largest scale
    real(dp) :: change                   ! rate of change of the unknowns, rad/s2
    real(dp) :: f                        ! frequency, rad/s
    real(dp) :: size(MOST_WAVES)         ! of the integral of each wave, 1/s
    real(dp) :: error
    logical :: is_weak
    integer :: n, k

    do n = 1, motion%waves
      size(n) = size_of(motion, n)
    end do
    largest = maxval(abs(motion%scale))
    change = 2.0_dp*rate*rate + maxval(abs(motion%slope)) + abs(t_end)*maxval(abs(motion%climb))
    motion%resolved = 0
    motion%mean = 0.0_dp
    motion%push = 0.0_dp
    left_out = 0.0_dp
    do n = 1, motion%waves
      f = abs(motion%frequency(n))
      is_weak = f > FAST*rate
      if (is_weak) then
        error = left_out + 2.0_dp*(size(n)/f)*(change/f + size(n) &
                                               + 2.0_dp*rate*abs(t_end)*size(n))
        do k = 1, motion%waves
          ! Two waves together contain their difference frequency, which may be slow.
          if (k /= n) error = error + 4.0_dp*size(n)*size(k) &
                              *min(abs(t_end), 1.0_dp/abs(f - abs(motion%frequency(k))))
        end do
        is_weak = error*largest <= faint
      end if
      if (is_weak) then
        motion%mean = motion%mean + motion%on_versine(:, n)
        motion%push = motion%push + 0.5_dp*(slopes(motion%on_sine(:, n), motion%sign_2) &
                                            + slopes(motion%on_versine(:, n), motion%sign_2))
        left_out = error
      else
        motion%resolved = motion%resolved + 1
        if (n /= motion%resolved) then
          call swap(motion, n, motion%resolved)
          size([n, motion%resolved]) = size([motion%resolved, n])
        end if
      end if
    end do
  end subroutine average

  pure subroutine swap(motion, n, k)
    type(motion_t), intent(inout) :: motion
    integer, intent(in) :: n, k

    motion%frequency([n, k]) = motion%frequency([k, n])
    motion%on_sine(:, [n, k]) = motion%on_sine(:, [k, n])
    motion%on_versine(:, [n, k]) = motion%on_versine(:, [k, n])
  end subroutine swap

  pure function turned(motion, y, t) result(change)
    !! Compute the oscillation of the unknowns that the averaged waves cause through their integral.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: y(3)         !! unknowns
    real(dp), intent(in) :: t            !! s
    real(dp) :: change(3)
    real(dp) :: o(3)
    real(dp) :: sine, vers
    integer :: n

    o = 0.0_dp
    do n = motion%resolved + 1, motion%waves
      call wave_at(motion%frequency(n), t, sine, vers)
      o = o - ((1.0_dp - vers)*motion%on_sine(:, n) + sine*motion%on_versine(:, n)) &
          /motion%frequency(n)
    end do
    change(1) = y(2)*o(3) + y(3)*o(2)
    change(2) = motion%sign_2*(y(1)*o(3) + y(3)*o(1))
    change(3) = y(1)*o(2) + y(2)*o(1)
  end function turned

  pure real(dp) function steps_for_waves(motion, t_end, aim)
    !! Return the number of steps that resolve the waves that are not averaged.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t_end        !! s
    real(dp), intent(in) :: aim          !! target error, relative
    integer :: n

    steps_for_waves = 0.0_dp
    do n = 1, motion%resolved
      steps_for_waves = max(steps_for_waves, &
                            steps_for_wave(abs(motion%frequency(n)*t_end), &
                                           size_of(motion, n)*abs(t_end), aim))
    end do
  end function steps_for_waves

  pure real(dp) function steps_for_wave(angle, size, aim)
    !! Return the number of steps that resolve a wave.
    real(dp), intent(in) :: angle        !! over the whole time, rad
    real(dp), intent(in) :: size         !! of its integral in the unknowns, times the time
    real(dp), intent(in) :: aim          !! target error, relative

    steps_for_wave = angle*max(RESOLVED_STEPS, sqrt(sqrt(WAVE_ERROR*size/aim)))
  end function steps_for_wave

  pure real(dp) function size_of(motion, n)
    !! Return the size of the integral of wave n, 1/s.
    type(motion_t), intent(in) :: motion
    integer, intent(in) :: n

    size_of = maxval(abs(motion%on_sine(:, n))) + maxval(abs(motion%on_versine(:, n)))
  end function size_of

  pure real(dp) function reach_of(motion, n, t_end)
    !! Return the largest value that the integral of wave n can reach until t_end, 1/s.
    type(motion_t), intent(in) :: motion
    integer, intent(in) :: n
    real(dp), intent(in) :: t_end        !! s
    real(dp) :: angle                    ! rad

    angle = abs(motion%frequency(n)*t_end)
    reach_of = maxval(abs(motion%on_sine(:, n)))*min(2.0_dp, angle) &
               + maxval(abs(motion%on_versine(:, n)))*min(2.0_dp, 0.5_dp*angle*angle)
  end function reach_of

  pure subroutine amplification(motion, t_end, spread, top, exponent, bound)
    !! Compute a bound of the norm of the state-transition matrix of omega from any time to any
    !! later one. In these unknowns of a body the Jacobian [0 z y; -z 0 -x; y x 0] has the symmetric
    !! part [0 0 y; 0 0 0; y 0 0]. Its logarithmic norm (Dahlquist 1958) is therefore |y|, and the
    !! norm of the matrix is at most the exponential of the integral of |y| over time.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t_end        !! s
    real(dp), intent(in) :: spread       !! integral of the second unknown's size over time
    real(dp), intent(in) :: top(3)       !! largest size of each unknown, 1/s
    real(dp), intent(out) :: exponent    !! integral of the logarithmic norm over time
    real(dp), intent(out) :: bound       !! bound of the norm, for omega in rad/s
    real(dp) :: size(3)                  ! sizes of the scales
    integer :: n

    exponent = spread
    ! If all three signs are alike the matrix is symmetric, and its largest row sum is a bound.
    if (motion%sign_2 > 0.0_dp) exponent = abs(t_end)*(sum(top) - minval(top))
    do n = motion%resolved + 1, motion%waves
      exponent = exponent + 2.0_dp*abs(t_end)*size_of(motion, n)
    end do
    exponent = min(MOST_EXPONENT, exponent)
    size = abs(motion%scale)
    ! A power of two no less than the exponential, formed from its bits, costs no call.
    bound = transfer(ishft(1024_int64 + int(LOG2_E*exponent, int64), 52), bound) &
            *(max(size(1), size(2), size(3))/min(size(1), size(2), size(3)))
  end subroutine amplification

  pure elemental real(dp) function versine(angle)
    !! Return 1 - cosine by a formula that keeps its digits for a small angle.
    real(dp), intent(in) :: angle        !! rad
    real(dp) :: sine                     ! sine of half the angle

    sine = sin(0.5_dp*angle)
    versine = 2.0_dp*sine*sine
  end function versine

  pure subroutine wave_at(frequency, t, sine, vers)
    !! Compute sine and versine of frequency times t, with the rounding error of the product: the
    !! angle of a fast wave that is averaged may be any number of radians.
    real(dp), intent(in) :: frequency    !! rad/s
    real(dp), intent(in) :: t            !! s
    real(dp), intent(out) :: sine, vers
    real(dp) :: s                        ! sine of half the angle
    real(dp) :: c

    call sine_cosine_of(frequency, 0.5_dp*t, 0.0_dp, s, c)
    sine = 2.0_dp*s*c
    vers = 2.0_dp*s*s
  end subroutine wave_at

  pure function integral(motion, t) result(s)
    !! Compute the integral of the whole torque from 0 to t, in the unknowns.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t
    real(dp) :: s(3)
    real(dp) :: sine, vers
    integer :: n

    s = t*(motion%slope + (0.5_dp*t)*motion%climb)
    do n = 1, motion%waves
      call wave_at(motion%frequency(n), t, sine, vers)
      s = s + motion%on_sine(:, n)*sine + motion%on_versine(:, n)*vers
    end do
  end function integral

  pure function slopes(x, sign_2) result(f)
    !! Compute the products of the unknowns.
    real(dp), intent(in) :: x(3)
    real(dp), intent(in) :: sign_2
    real(dp) :: f(3)

    f(1) = x(2)*x(3)
    f(2) = sign_2*(x(1)*x(3))
    f(3) = x(1)*x(2)
  end function slopes

end module scaled_motion

module prepared_scale
  !! The scale of omega in the data of a prepared solver. Products of very large or small omegas are
  !! out of range although the solution is not; such a problem is solved in other units.
  use kinds, only: dp
  use methods, only: GAUSS
  use places, only: CONSTANT, METHOD, N_COSINES, N_SINES, RATE, STEP, WAVES
  use statuses, only: COMPLETE, OVERFLOW, SENSITIVE
  implicit none(type, external)
  private

  ! Above it, or below its inverse, products of omegas may overflow or underflow although the
  ! solution is in range.
  real(dp), parameter :: LARGE = 2.0_dp**300
  integer, parameter :: MOST_POWER = 1000
  ! Change of omega in the new units that a torque may cause whose numbers underflow.
  real(dp), parameter :: NEGLIGIBLE = 2.0_dp**(-60)

  public :: bring_near_one, is_result, LARGE, scale_back

contains

  pure subroutine bring_near_one(packed, n_packed, omega0, t_end, copy, start, time, power)
    !! Convert a problem to units that bring omega near 1. The scale is a power of two, so no digit
    !! changes. If no other units are needed, or if they don't serve, the power is 0.
    integer, intent(in) :: n_packed
    real(dp), intent(in) :: packed(0:n_packed - 1)
    real(dp), intent(in) :: omega0(3)  !! rad/s
    real(dp), intent(in) :: t_end      !! s
    real(dp), intent(out) :: copy(0:n_packed - 1), start(3), time !! in the new units
    integer, intent(out) :: power      !! omega is 2**power times its value in the new units
    real(dp) :: reach      ! bound of omega0 and of what the torque adds, rad/s
    real(dp) :: lost       ! bound of what torques add whose numbers underflow, rad/s
    integer :: code, i

    reach = max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3)))
    do i = 0, 2
      reach = max(reach, abs(packed(CONSTANT + i)*t_end), abs(packed(RATE + i)*t_end*t_end))
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 4, 4
      reach = max(reach, by_wave(i))
    end do
    power = 0
    if (reach > 0.0_dp .and. reach <= huge(reach)) then
      if (.not. (reach <= LARGE .and. reach*LARGE >= 1.0_dp)) power = exponent(reach)
    end if
    power = max(-MOST_POWER, min(MOST_POWER, power))
    time = scale(t_end, power)
    copy = packed
    ! A step that the method does not use may be out of range in the new units.
    code = int(packed(METHOD))
    if (code > GAUSS) copy(STEP) = scale(packed(STEP), power)
    do i = 0, 2
      copy(CONSTANT + i) = scale(scale(packed(CONSTANT + i), -power), -power)
      copy(RATE + i) = scale(scale(scale(packed(RATE + i), -power), -power), -power)
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 1
      copy(i) = scale(packed(i), -power)
      if (mod(i - WAVES, 4) /= 3) copy(i) = scale(copy(i), -power)
    end do
    lost = 0.0_dp
    do i = 0, 2
      if (is_rounded(CONSTANT + i, 2)) lost = max(lost, abs(packed(CONSTANT + i)*t_end))
      if (is_rounded(RATE + i, 3)) lost = max(lost, abs(packed(RATE + i)*t_end*t_end))
    end do
    do i = WAVES, WAVES + 4*int(packed(N_SINES) + packed(N_COSINES)) - 4, 4
      if (is_rounded(i, 2) .or. is_rounded(i + 1, 2) .or. is_rounded(i + 2, 2) &
          .or. is_rounded(i + 3, 1)) lost = max(lost, by_wave(i))
    end do
    ! If the time or a torque is out of range then, the time is so short that products do not
    ! matter, or so long that there is no result.
    if (.not. (scale(lost, -power) <= NEGLIGIBLE &
               .and. all(abs(copy) <= huge(time)) .and. abs(time) <= huge(time) &
               .and. (abs(time) >= tiny(time) .or. .not. abs(t_end) > 0.0_dp))) power = 0
    do i = 1, 3
      start(i) = scale(omega0(i), -power)
    end do

  contains

    pure real(dp) function by_wave(i)
      !! Return a bound of the omega (rad/s) that a wave adds.
      integer, intent(in) :: i

      by_wave = maxval(abs(packed(i:i + 2)*t_end))
      ! A slow sine does not reach its amplitude.
      if (i < WAVES + 4*int(packed(N_SINES))) then
        by_wave = maxval(abs(packed(i:i + 2)*t_end*min(1.0_dp, abs(packed(i + 3)*t_end))))
      end if
    end function by_wave

    pure logical function is_rounded(i, n)
      !! Return whether a number, scaled n times, has lost digits.
      integer, intent(in) :: i, n
      real(dp) :: x
      integer :: k

      x = copy(i)
      do k = 1, n
        x = scale(x, power)
      end do
      is_rounded = abs(x - packed(i)) > 0.0_dp
    end function is_rounded
  end subroutine bring_near_one

  pure subroutine scale_back(power, omega, status)
    !! Convert omega back from the units of `bring_near_one`.
    integer, intent(in) :: power
    real(dp), intent(inout) :: omega(3)
    integer, intent(inout) :: status
    integer :: i

    ! Without a result omega has no meaning and may be NaN.
    if (.not. is_result(status)) return
    do i = 1, 3
      omega(i) = scale(omega(i), power)
    end do
    if (.not. all(abs(omega) <= huge(omega))) status = OVERFLOW
  end subroutine scale_back

  pure logical function is_result(status)
    !! Return whether there is an omega, even if rounding errors have cost all of its digits.
    integer, intent(in) :: status

    is_result = status == COMPLETE .or. status == SENSITIVE
  end function is_result

end module prepared_scale

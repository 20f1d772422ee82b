module torque_free_differences
  !! Error amplification in a torque-free motion, by finite differences of its closed form.
  use kinds, only: dp
  use statuses, only: COMPLETE
  use torque_free, only: torque_free_rows
  implicit none(type, external)
  private

  ! Relative size of a perturbation. A perturbation that does not grow keeps some bits. A growing
  ! perturbation remains small to the end as long as any digit of the result is left.
  real(dp), parameter :: SMALL = 2.0_dp**(-48)
  integer, parameter :: INSTANTS = 64
  ! If only a comparison with a limit is needed, every APART-th instant suffices when the
  ! amplification is below the limit by a factor CLEARLY. It does not if the motion passes so close
  ! to the middle axis that one instant dominates.
  integer, parameter :: APART = 16
  real(dp), parameter :: CLEARLY = 10.0_dp
  real(dp), parameter :: PLAIN = 32.0_dp
  real(dp), parameter :: EXACTLY(3) = 0.0_dp ! rounding of the coefficients has no effect here
  real(dp), parameter :: GOLDEN = 0.6180339887498949_dp ! spacing; no period hides between instants

  ! Largest ratio of the amplification to its estimate, for random bodies and times, with a margin.
  real(dp), parameter :: ABOVE_ESTIMATE = 1.5_dp

  integer, parameter :: LEVELS = 8 ! of the arithmetic-geometric mean

  public :: torque_free_growth_of

contains

  subroutine torque_free_growth_bound(coefficients, omega0, t_end, bound, amplified)
    !! Compute an upper bound of the amplification, by a formula with a measured margin; `bound` is
    !! huge if there is none. A perturbation changes the amplitudes and the frequency of a motion.
    !! The change of frequency becomes a shift of time that grows in proportion to the time.
    real(dp), intent(in) :: coefficients(3)  !! A, B, C
    real(dp), intent(in) :: omega0(3)        !! rad/s
    real(dp), intent(in) :: t_end            !! s
    real(dp), intent(out) :: bound
    real(dp), intent(out) :: amplified       !! the part that does not grow with the time
    real(dp) :: s(3), y(3)       ! |coefficients| and squares of omega0; axis 2 has the odd sign
    real(dp) :: near, far        ! s(1) y(3) and s(3) y(1), with the axes as found
    real(dp) :: gap, first, third ! integrals of the motion
    real(dp) :: most(3)          ! largest |omega| along axes 1 and 3, rad/s
    real(dp) :: row(3, 1)        ! omega at t_end
    real(dp) :: speed            ! largest component of the rate of omega at t_end
    real(dp) :: relative         ! derivative of the logarithm of the frequency
    real(dp) :: share            ! contribution of `gap` to the frequency
    integer :: odd, axes(3), n, status

    bound = huge(bound)
    amplified = bound
    do odd = 1, 3
      axes = [1 + modulo(odd - 2, 3), odd, 1 + modulo(odd, 3)]
      s = coefficients(axes)
      if (s(1)*s(3) >= 0.0_dp .and. s(1)*s(2) <= 0.0_dp .and. s(2)*s(3) <= 0.0_dp) exit
    end do
    if (odd > 3) return
    call torque_free_rows(coefficients, EXACTLY, omega0, 1, [t_end], row, n, status)
    if (n < 1) return
    speed = maxval(abs(coefficients*row([2, 3, 1], 1)*row([3, 1, 2], 1)))
    s = abs(s)
    y = omega0(axes)**2
    near = s(1)*y(3)
    far = s(3)*y(1)
    if (near < far) then
      s = s([3, 2, 1])
      y = y([3, 2, 1])
    end if
    gap = abs(near - far)
    if (.not. min(s(1), s(2), gap) > 0.0_dp) return
    first = s(2)*y(1) + s(1)*y(2)
    third = s(3)*y(2) + s(2)*y(3)
    most = sqrt([first/s(2), first/s(1), third/s(2)])
    share = share_of_smaller(s(1)*third, s(2)*gap)
    relative = (1.0_dp - share)*sqrt((s(2) + s(3))/third) &
               + share*(s(1)*most(3) + s(3)*most(1))/gap
    amplified = sqrt(max(1.0_dp, s(1)/s(2), s(2)/s(1), s(3)/s(2)))*(s(1)/s(2))*(third/gap)
    bound = ABOVE_ESTIMATE*(amplified + abs(t_end)*speed*relative)
    if (.not. bound <= huge(bound)) bound = huge(bound)
  end subroutine torque_free_growth_bound

  pure function share_of_smaller(larger, smaller) result(share)
    !! Return the derivative of the logarithm of the arithmetic-geometric mean of two roots by the
    !! logarithm of the smaller root. With the derivative by that of the larger root it adds up to
    !! 1.
    real(dp), intent(in) :: larger, smaller !! squares of the roots
    real(dp) :: share
    real(dp) :: a, b, mean, total, weight
    integer :: level

    share = 0.5_dp
    if (.not. larger > smaller) return
    a = sqrt(larger)
    b = sqrt(smaller)
    total = 0.0_dp
    weight = 1.0_dp
    do level = 1, LEVELS
      mean = 0.5_dp*(a + b)
      total = total + weight*(0.5_dp*(a - b))**2
      weight = 2.0_dp*weight
      b = sqrt(a*b)
      a = mean
    end do
    share = max(0.0_dp, share - total/(larger - smaller))
  end function share_of_smaller

  function torque_free_growth_of(coefficients, omega0, t_end, enough) result(growth)
    !! Return the largest norm of the state-transition matrix of omega to `t_end` from any of 64
    !! earlier instants, which include 0. The norm is that of the largest component. The result is
    !! at least 1, or negative if there is no closed form.
    real(dp), intent(in) :: coefficients(3)  !! A, B, C
    real(dp), intent(in) :: omega0(3)        !! at time 0, rad/s
    real(dp), intent(in) :: t_end            !! s, where the closed form has a result
    real(dp), intent(in), optional :: enough !! only whether the result is larger matters
    real(dp) :: growth
    real(dp) :: start(3)      ! omega0 in units that bring it near 1
    real(dp) :: time          ! t_end in these units
    real(dp) :: instants_at(INSTANTS)
    real(dp) :: rows(3, INSTANTS)
    real(dp) :: bound, amplified
    integer :: power, n, status, i

    growth = 1.0_dp
    ! A body at rest stays at rest, and to first order a perturbed one keeps its omega.
    if (.not. any(abs(omega0) > 0.0_dp)) return
    power = exponent(max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3))))
    start = scale(omega0, -power)
    time = scale(t_end, power)
    do i = 1, INSTANTS
      instants_at(i) = time*((real(i - 1, dp) + modulo((i - 1)*GOLDEN, 1.0_dp))/INSTANTS)
    end do
    if (present(enough)) then
      call torque_free_growth_bound(coefficients, start, time, bound, amplified)
      growth = bound
      if (bound <= enough) return
      growth = 1.0_dp
      do i = 1, INSTANTS, APART
        call torque_free_rows(coefficients, EXACTLY, start, 1, instants_at(i:i), rows(:, i), n, &
                              status)
        if (n < 1) exit
        growth = max(growth, growth_from(coefficients, rows(:, i), time - instants_at(i)))
        if (growth > enough) return
      end do
      if (n == 1 .and. amplified <= PLAIN .and. CLEARLY*growth <= enough) return
    end if
    call torque_free_rows(coefficients, EXACTLY, start, INSTANTS, instants_at, rows, n, status)
    growth = -1.0_dp
    if (n < INSTANTS) return
    growth = 1.0_dp
    do i = 1, INSTANTS
      growth = max(growth, growth_from(coefficients, rows(:, i), time - instants_at(i)))
    end do
  end function torque_free_growth_of

  function growth_from(coefficients, omega, time) result(growth)
    !! Return the norm of the derivative of omega after a time by omega; 0 if it is unknown.
    real(dp), intent(in) :: coefficients(3), omega(3)
    real(dp), intent(in) :: time
    real(dp) :: growth
    real(dp) :: beside(3)     ! a perturbed omega
    real(dp) :: ends(3, 0:3)  ! omega after the time, unperturbed and perturbed along each axis
    real(dp) :: step          ! size of the perturbation
    real(dp) :: total(3)      ! row sums of the derivative
    integer :: n_rows, status, axis

    growth = 0.0_dp
    total = 0.0_dp
    do axis = 0, 3
      beside = omega
      if (axis > 0) then
        beside(axis) = beside(axis) + SMALL*maxval(abs(omega))
        step = beside(axis) - omega(axis)
      end if
      call torque_free_rows(coefficients, EXACTLY, beside, 1, [time], ends(:, axis), n_rows, status)
      ! Near the middle axis the closed form may refuse a perturbed state.
      if (status /= COMPLETE) return
      if (axis > 0) total = total + abs(ends(:, axis) - ends(:, 0))/step
    end do
    growth = maxval(total)
  end function growth_from

end module torque_free_differences

module torque_free_differences
  !! How much a torque-free motion makes of a small difference, by differences of its closed form.
  use kinds, only: dp
  use statuses, only: COMPLETE
  use torque_free, only: torque_free_rows
  implicit none(type, external)
  private

  ! Half of the digits of a difference are then its own, where it does not grow; and one that grows
  ! is small to the end as long as any digit is left.
  real(dp), parameter :: SMALL = 2.0_dp**(-48)
  integer, parameter :: INSTANTS = 64
  real(dp), parameter :: EXACTLY(3) = 0.0_dp ! rounding of the coefficients makes no difference
  real(dp), parameter :: GOLDEN = 0.6180339887498949_dp ! so that no period hides between instants

  public :: torque_free_growth_of

contains

  function torque_free_growth_of(coefficients, omega0, t_end) result(growth)
    !! The largest derivative of omega at `t_end` by omega at any of 64 instants before, 0 among
    !! them: in the norm of the largest component, and at least 1; below 0 where there is no
    !! closed form.
    real(dp), intent(in) :: coefficients(3)  !! A, B, C
    real(dp), intent(in) :: omega0(3)        !! at time 0, rad/s
    real(dp), intent(in) :: t_end            !! s, where the closed form has a result
    real(dp) :: growth
    real(dp) :: start(3)      ! omega0 in units that bring it near 1
    real(dp) :: time          ! t_end in the same
    real(dp) :: instants_at(INSTANTS)
    real(dp) :: rows(3, INSTANTS)
    real(dp) :: beside(3)     ! a state beside one of the rows
    real(dp) :: ends(3, 0:3)  ! of the row itself, and of one beside it along each axis
    real(dp) :: step          ! from the row to the state beside it
    real(dp) :: total(3)      ! sums of the derivative's rows
    integer :: power, n_rows, n, status, i, axis

    growth = 1.0_dp
    ! At rest it stays, and so does what is beside it, to first order.
    if (.not. any(abs(omega0) > 0.0_dp)) return
    power = exponent(max(abs(omega0(1)), abs(omega0(2)), abs(omega0(3))))
    start = scale(omega0, -power)
    time = scale(t_end, power)
    do i = 1, INSTANTS
      instants_at(i) = time*((real(i - 1, dp) + modulo((i - 1)*GOLDEN, 1.0_dp))/INSTANTS)
    end do
    call torque_free_rows(coefficients, EXACTLY, start, INSTANTS, instants_at, rows, n, status)
    growth = -1.0_dp
    if (n < INSTANTS) return
    growth = 1.0_dp
    do i = 1, INSTANTS
      total = 0.0_dp
      do axis = 0, 3
        beside = rows(:, i)
        if (axis > 0) then
          beside(axis) = beside(axis) + SMALL*maxval(abs(rows(:, i)))
          step = beside(axis) - rows(axis, i)
        end if
        call torque_free_rows(coefficients, EXACTLY, beside, 1, [time - instants_at(i)], &
                              ends(:, axis), n_rows, status)
        if (status /= COMPLETE) exit
        if (axis > 0) total = total + abs(ends(:, axis) - ends(:, 0))/step
      end do
      ! Beside the middle axis a state may be one that the closed form refuses.
      if (status == COMPLETE) growth = max(growth, maxval(total))
    end do
  end function torque_free_growth_of

end module torque_free_differences

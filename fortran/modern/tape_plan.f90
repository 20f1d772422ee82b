module tape_plan
  !! The order, local tolerance and step of an integration of a tape.
  use kinds, only: dp
  use operations, only: SQUARE_ROOT => SQRT
  use tape, only: FIRST_UNKNOWN, tape_t
  use tape_series, only: LAST_TERM, MOST_ORDER
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_TRIES = 80
  integer, parameter :: LEAST_ORDER = 8
  integer, parameter :: CHECKED = 3  ! last terms checked: from rest a ramp makes only every third
  real(dp), parameter :: LONGER = 16.0_dp  ! largest factor on the step that was tried
  real(dp), parameter, public :: LEAST_LOCAL_TOLERANCE = 1e-18_dp ! below rounding
  real(dp), parameter :: ROOT_TOLERANCE = 0.1_dp ! relative deviation of a squared root

  public :: before_zero_of_root, fitting, local_tolerance_of, order_for

contains

  pure real(dp) function fitting(tape, order, local_tolerance, weights, a)
    !! Return the factor on the step with which the last terms would be as large as allowed; 0 if
    !! they are not finite.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: local_tolerance
    real(dp), intent(in) :: weights(:)
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    real(dp) :: largest
    integer :: i, k

    fitting = LONGER
    do k = order - CHECKED + 1, order
      largest = 0.0_dp
      do i = 1, tape%n_unknowns
        ! NaN must not be lost in the maximum.
        if (.not. weights(i)*abs(a(k, FIRST_UNKNOWN - 1 + i)) <= largest) then
          largest = weights(i)*abs(a(k, FIRST_UNKNOWN - 1 + i))
        end if
        if (.not. largest <= huge(largest)) then
          fitting = 0.0_dp
          return
        end if
      end do
      if (largest > local_tolerance*fitting**(-k)) then
        fitting = exp((log(local_tolerance) - log(largest))/k)
      end if
    end do
  end function fitting

  pure real(dp) function before_zero_of_root(tape, order, a, factor)
    !! Return the factor on the step, reduced until each series of a square root is the root of the
    !! series of its argument at the end of the step. The series of a root continues with the wrong
    !! sign where its argument touches zero.
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order
    real(dp), intent(in) :: a(0:LAST_TERM, tape%n_slots)
    real(dp), intent(in) :: factor
    real(dp) :: argument, root
    integer :: k, n, tries

    before_zero_of_root = factor
    do n = 1, tape%n_operations
      if (tape%operations(1, n) /= SQUARE_ROOT) cycle
      do tries = 1, MOST_TRIES
        argument = 0.0_dp
        root = 0.0_dp
        do k = order - 1, 0, -1
          argument = before_zero_of_root*argument + a(k, tape%operations(2, n))
          root = before_zero_of_root*root + a(k, tape%operations(4, n))
        end do
        if (root >= 0.0_dp .and. abs(root*root - argument) <= ROOT_TOLERANCE*argument) exit
        before_zero_of_root = 0.5_dp*before_zero_of_root
      end do
    end do
  end function before_zero_of_root

  pure integer function order_for(local_tolerance)
    !! Return the order with the least work for the requested digits (Jorba and Zou 2005).
    real(dp), intent(in) :: local_tolerance

    order_for = max(LEAST_ORDER, min(MOST_ORDER, 1 + ceiling(-0.7_dp*log(local_tolerance))))
  end function order_for

  pure real(dp) function local_tolerance_of(tolerance, steps)
    !! Return the largest last terms. An error of omega becomes an error of phase, which grows with
    !! time; the weights are those of the special kernel for 0.4 radians in a step.
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: steps !! expected number
    real(dp) :: way

    way = 0.12_dp*abs(steps)
    local_tolerance_of = max(LEAST_LOCAL_TOLERANCE, &
                             tolerance/(8.0_dp + way + way*(way/14.0_dp)))
  end function local_tolerance_of

end module tape_plan

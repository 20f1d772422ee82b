module nearness
  !! Numbers near 1, so that their products neither overflow nor underflow.
  use kinds, only: dp
  implicit none(type, external)
  private

  real(dp), parameter, public :: LARGE = 2.0_dp**100 ! beyond it, or below its inverse: far from 1

  public :: bring_near_one

contains

  pure subroutine bring_near_one(x, power)
    !! Where the largest of x is far from 1, divide by the power of two that brings it into
    !! [1/2, 1).
    real(dp), intent(inout) :: x(:)
    integer, intent(out) :: power
    real(dp) :: largest

    largest = maxval(abs(x))
    power = 0
    if (largest <= LARGE .and. largest >= 1.0_dp/LARGE) return
    if (.not. (largest > 0.0_dp .and. largest <= huge(largest))) return
    power = exponent(largest)
    x = scale(x, -power)
  end subroutine bring_near_one

end module nearness

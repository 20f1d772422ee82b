module nearness
  !! Scaling of numbers to near 1, so that their products neither overflow nor underflow.
  use kinds, only: dp
  implicit none(type, external)
  private

  real(dp), parameter, public :: LARGE = 2.0_dp**100 ! above it, or below 1/LARGE: scaled

  public :: bring_near_one

contains

  pure subroutine bring_near_one(x, power)
    !! Divide x by the power of two that brings its largest element into [1/2, 1), if that element
    !! is far from 1.
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

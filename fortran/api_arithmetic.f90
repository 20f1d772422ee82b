! Whether the compiler leaves the operations of the sources as they are. The build runs this first;
! f2py reads it for `pyharness doctor`.

subroutine arithmetic_faults(numbers, is_changed, is_flushed)
  ! Test what options such as -ffast-math change, on numbers that the compiler does not know.
  use, intrinsic :: iso_fortran_env, only: dp => real64
  implicit none
  real(8), intent(in) :: numbers(4)     ! 5, 0, NaN, the smallest normal number
  integer(4), intent(out) :: is_changed ! 1 if operations are removed or reordered, else 0
  integer(4), intent(out) :: is_flushed ! 1 if subnormal numbers become 0, else 0
  real(8) :: product, zero

  product = numbers(1)*0.1_dp
  product = product*3.0_dp
  zero = -numbers(2)
  zero = zero + 0.0_dp
  is_changed = 0
  if (product /= 1.5_dp) is_changed = 1                  ! by -fassociative-math
  if (numbers(1)/3.0_dp /= 5.0_dp/3.0_dp) is_changed = 1  ! by -freciprocal-math
  if (sign(1.0_dp, zero) < 0.0_dp) is_changed = 1         ! by -fno-signed-zeros
  if (numbers(3) == numbers(3)) is_changed = 1          ! by -ffinite-math-only
  is_flushed = 0
  if (.not. 0.5_dp*numbers(4) > 0.0_dp) is_flushed = 1
end subroutine arithmetic_faults

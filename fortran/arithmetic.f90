integer(c_int) function arithmetic_as_written(numbers) bind(c, name="arithmetic_faults")
  !! The result is 0 if numbers have the declared kinds and api_arithmetic.f90 finds no fault.
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use, intrinsic :: iso_fortran_env, only: int32, real32, real64
  implicit none(type, external)
  real(c_double), intent(in) :: numbers(4) ! as for arithmetic_faults
  integer(int32) :: faults(2)
  complex(real64) :: z

  arithmetic_as_written = 1
  if (storage_size(1) /= 32 .or. storage_size(1_int32) /= 32) return
  if (storage_size(1.0) /= 32 .or. storage_size(1.0_real32) /= 32) return
  if (storage_size(1.0d0) /= 64 .or. storage_size(1.0_real64) /= 64) return
  call arithmetic_faults(numbers, faults(1), faults(2))
  z = (0.25_real64/numbers(4))*(1.0_real64, 1.0_real64)
  z = z/z ! not 1 by -fcx-limited-range
  if (all(faults == 0) .and. real(z) == 1.0_real64) arithmetic_as_written = 0
contains
  include "api_arithmetic.f90"
end function arithmetic_as_written

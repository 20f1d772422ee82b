program arithmetic
  !! The exit status is 77 if the compiler changes an operation of api_arithmetic.f90, else 0.
  use, intrinsic :: iso_fortran_env, only: int32, real64
  implicit none(type, external)
  character(*), parameter :: TEXT = "5 0 nan 2.2250738585072014e-308"
  character(len(TEXT)) :: line
  real(real64) :: numbers(4)
  integer(int32) :: faults(2)

  line = TEXT ! read, so that the compiler does not know the numbers
  read (line, *) numbers
  call arithmetic_faults(numbers, faults(1), faults(2))
  if (any(faults /= 0)) error stop 77
contains
  include "api_arithmetic.f90"
end program arithmetic

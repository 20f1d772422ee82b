! Stands for fortran/interruption.c where a test compiles kernels by themselves.
integer(c_int) function interrupt_raised() bind(c, name="interrupt_raised")
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none(type, external)

  interrupt_raised = 0
end function interrupt_raised

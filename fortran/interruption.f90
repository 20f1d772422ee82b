module interruption
  !! User interrupts (Ctrl-C). A kernel that may run long polls interrupt_raised after a fixed
  !! amount of work. If the result is not 0, the kernel returns with the status INTERRUPTED.
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr
  implicit none(type, external)
  private

  public :: interrupt_raised, watch

  interface
    integer(c_int) function interrupt_raised() bind(c, name="interrupt_raised")
      !! Return a value other than 0 if a signal handler has raised an exception, or if the number
      !! that this thread watches is not 0; see interruption.c.
      import :: c_int
      implicit none(type, external)
    end function interrupt_raised

    subroutine watch(number) bind(c, name="watch")
      !! Make interrupt_raised also check a number that another thread sets; c_null_ptr: check none.
      import :: c_ptr
      implicit none(type, external)
      type(c_ptr), intent(in), value :: number
    end subroutine watch
  end interface

end module interruption

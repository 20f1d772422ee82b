module interruption
  !! Ctrl-C: a kernel that may run long asks now and then, by the work that it has done, and
  !! returns INTERRUPTED where the answer is yes.
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr
  implicit none(type, external)
  private

  public :: interrupt_raised, watch

  interface
    integer(c_int) function interrupt_raised() bind(c, name="interrupt_raised")
      !! Not 0 where a signal's handler has raised an exception; see interruption.c.
      import :: c_int
      implicit none(type, external)
    end function interrupt_raised

    subroutine watch(number) bind(c, name="watch")
      !! Let interrupt_raised look at a number too, which another thread sets; or at none.
      import :: c_ptr
      implicit none(type, external)
      type(c_ptr), intent(in), value :: number
    end subroutine watch
  end interface

end module interruption

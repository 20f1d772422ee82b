module levels
  !! The interfaces of levels.c, which calls the kernels of the chosen instruction set. It passes on
  !! the address of an argument of a derived type, such as problem_t, and does not read it.
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_ptr
  use bodies, only: i1
  use storage, only: AT_ONCE
  implicit none(type, external)
  private

  public :: choose_level, find_frames, fits_lanes, many_fixed, many_free, many_taylor, &
            quick_solve, read_pieces, ready_leaves, run_lanes, search_events, tape_bodies, &
            tape_solve, tape_step, tape_variation, taylor_solve

  interface
    integer(c_int) function choose_level(highest) bind(c, name="choose_level")
      !! Choose a level (0 plain, 1 AVX2, 2 AVX-512) or the best below it, and return it, or -1 if
      !! the processor lacks it; -1 changes nothing.
      import :: c_int
      implicit none(type, external)
      integer(c_int), intent(in), value :: highest
    end function choose_level

    subroutine taylor_solve(problem, request, solution) bind(c, name="taylor_solve")
      implicit none(type, external)
      type(*), intent(in) :: problem, request
      type(*), intent(inout) :: solution
    end subroutine taylor_solve

    subroutine tape_solve(tape, request, solution) bind(c, name="tape_solve")
      implicit none(type, external)
      type(*), intent(in) :: tape, request
      type(*), intent(inout) :: solution
    end subroutine tape_solve

    subroutine search_events(tape, search) bind(c, name="search_events")
      implicit none(type, external)
      type(*), intent(in) :: tape
      type(*), intent(inout) :: search
    end subroutine search_events

    subroutine tape_bodies(bodies) bind(c, name="tape_bodies")
      implicit none(type, external)
      type(*), intent(inout) :: bodies
    end subroutine tape_bodies

    subroutine tape_step(tape, request, step) bind(c, name="tape_step")
      implicit none(type, external)
      type(*), intent(in) :: tape, request
      type(*), intent(inout) :: step
    end subroutine tape_step

    subroutine tape_variation(tape, request, variation) bind(c, name="tape_variation")
      implicit none(type, external)
      type(*), intent(in) :: tape, request
      type(*), intent(inout) :: variation
    end subroutine tape_variation

    integer(c_int64_t) function ready_leaves(key) bind(c, name="ready_leaves")
      !! Return the number of the compiled operations of a ready torque, or 0.
      import :: c_int64_t
      implicit none(type, external)
      integer(c_int64_t), intent(in), value :: key
    end function ready_leaves

    integer(c_int) function fits_lanes(address) bind(c, name="fits_lanes")
      !! Return whether (1, not 0) compiled operations are for bodies in this level's registers.
      import :: c_int, c_int64_t
      implicit none(type, external)
      integer(c_int64_t), intent(in), value :: address
    end function fits_lanes

    subroutine quick_solve(problem, request, contest, solution) bind(c, name="quick_solve")
      import :: c_int
      implicit none(type, external)
      type(*), intent(in) :: problem, request
      integer(c_int), intent(in), value :: contest
      type(*), intent(inout) :: solution
    end subroutine quick_solve

    subroutine find_frames(n, matrices, m, vectors, numbers, axes, components, status) &
      bind(c, name="find_frames")
      import :: c_double, c_int
      implicit none(type, external)
      integer(c_int), intent(in), value :: n, m
      real(c_double), intent(in) :: matrices(3, 3, n), vectors(3, m, n)
      real(c_double), intent(out) :: numbers(10, n), axes(3, 3, n), components(3, m, n)
      integer(c_int), intent(out) :: status(n)
    end subroutine find_frames

    subroutine many_free(bodies, n, omega, status) bind(c, name="many_free")
      import :: c_double, c_int, c_ptr, i1
      implicit none(type, external)
      type(c_ptr), intent(in), value :: bodies
      integer(c_int), intent(in), value :: n
      real(c_double), intent(inout) :: omega(3, n)
      integer(i1), intent(inout) :: status(n)
    end subroutine many_free

    subroutine many_taylor(bodies, n, omega, status, interrupted) bind(c, name="many_taylor")
      import :: c_double, c_int, c_ptr, i1
      implicit none(type, external)
      type(c_ptr), intent(in), value :: bodies
      integer(c_int), intent(in), value :: n
      real(c_double), intent(inout) :: omega(3, n)
      integer(i1), intent(inout) :: status(n)
      integer(c_int), intent(out) :: interrupted
    end subroutine many_taylor

    subroutine many_fixed(bodies, method, n, omega, status, interrupted) bind(c, name="many_fixed")
      import :: c_double, c_int, c_ptr, i1
      implicit none(type, external)
      type(c_ptr), intent(in), value :: bodies
      integer(c_int), intent(in), value :: method, n
      real(c_double), intent(inout) :: omega(3, n)
      integer(i1), intent(inout) :: status(n)
      integer(c_int), intent(out) :: interrupted
    end subroutine many_fixed

    subroutine run_lanes(ensemble) bind(c, name="run_lanes")
      implicit none(type, external)
      type(*), intent(in) :: ensemble
    end subroutine run_lanes

    subroutine read_pieces(pieces, edges, points, m, values, n, times, states) &
      bind(c, name="read_pieces")
      import :: AT_ONCE, c_double, c_int
      implicit none(type, external)
      integer(c_int), intent(in), value :: pieces, m, n
      real(c_double), intent(in) :: edges(pieces + 1), points(AT_ONCE + 1), times(n)
      real(c_double), intent(in) :: values(m, AT_ONCE + 1, pieces)
      real(c_double), intent(out) :: states(m, n)
    end subroutine read_pieces
  end interface

end module levels

module levels
  !! The doors of levels.c: the kernels of the instruction set that was chosen.
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  implicit none(type, external)
  private

  public :: choose_level, quick_solve, taylor_solve

  interface
    integer(c_int) function choose_level(highest) bind(c, name="choose_level")
      !! Take a level (0 plain, 1 AVX2, 2 AVX-512) or the best below it; which one it is.
      import :: c_int
      implicit none(type, external)
      integer(c_int), intent(in), value :: highest
    end function choose_level

    subroutine taylor_solve(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, &
                            cosines, omega, tolerance, effort, n_times, times, rows, n_rows, &
                            status, steps, needed) bind(c, name="taylor_solve")
      !! As in taylor.f90.
      import :: c_double, c_int, c_int64_t
      implicit none(type, external)
      real(c_double), intent(in) :: coefficients(3)
      real(c_double), intent(in) :: m_constant(3)
      real(c_double), intent(in) :: m_rate(3)
      integer(c_int), intent(in), value :: n_sines
      real(c_double), intent(in) :: sines(4, n_sines)
      integer(c_int), intent(in), value :: n_cosines
      real(c_double), intent(in) :: cosines(4, n_cosines)
      real(c_double), intent(in) :: omega(3)
      real(c_double), intent(in) :: tolerance
      real(c_double), intent(in) :: effort
      integer(c_int), intent(in), value :: n_times
      real(c_double), intent(in) :: times(n_times)
      real(c_double), intent(inout) :: rows(3, n_times)
      integer(c_int), intent(out) :: n_rows
      integer(c_int), intent(out) :: status
      integer(c_int64_t), intent(out) :: steps
      real(c_double), intent(out) :: needed
    end subroutine taylor_solve

    subroutine quick_solve(coefficients, m_constant, m_rate, n_sines, sines, n_cosines, cosines, &
                           omega, tolerance, effort, t_end, contest, result, status, steps) &
      bind(c, name="quick_solve")
      !! As in scaled_runge_kutta.f90.
      import :: c_double, c_int
      implicit none(type, external)
      real(c_double), intent(in) :: coefficients(3)
      real(c_double), intent(in) :: m_constant(3)
      real(c_double), intent(in) :: m_rate(3)
      integer(c_int), intent(in), value :: n_sines
      real(c_double), intent(in) :: sines(4, n_sines)
      integer(c_int), intent(in), value :: n_cosines
      real(c_double), intent(in) :: cosines(4, n_cosines)
      real(c_double), intent(in) :: omega(3)
      real(c_double), intent(in) :: tolerance
      real(c_double), intent(in) :: effort
      real(c_double), intent(in) :: t_end
      integer(c_int), intent(in), value :: contest
      real(c_double), intent(out) :: result(3)
      integer(c_int), intent(out) :: status
      integer(c_int), intent(out) :: steps
    end subroutine quick_solve
  end interface

end module levels

! The series by its loops as they are written, for ctypes.
subroutine taylor_as_written(coefficients, constant, rate, n_sines, sines, n_cosines, cosines, &
                             omega, tolerance, n_times, times, rows, n_rows, status, steps, &
                             found) bind(c)
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_loc
  use problem, only: problem_t
  use taylor, only: taylor_solve
  implicit none(type, external)
  integer(c_int), intent(in), value :: n_sines, n_cosines, n_times
  real(c_double), intent(in) :: coefficients(3), constant(3), rate(3), omega(3), tolerance
  real(c_double), intent(in) :: times(n_times)
  real(c_double), intent(in), target :: sines(4, n_sines), cosines(4, n_cosines)
  real(c_double), intent(inout) :: rows(3, n_times)
  integer(c_int), intent(out) :: n_rows, status
  integer(c_int64_t), intent(out) :: steps
  real(c_double), intent(out) :: found(3)
  type(problem_t), target :: given
  real(c_double) :: needed, none(4, 1)

  given = problem_t(coefficients, constant, rate, n_sines, n_cosines, sines, cosines)
  call taylor_solve(c_loc(given), omega, tolerance, 1.0_c_double, n_times, times, rows, 0, none, &
                    n_rows, status, steps, needed, found)
end subroutine taylor_as_written

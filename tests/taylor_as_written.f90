! The series by its loops as they are written, for ctypes.
subroutine taylor_as_written(coefficients, constant, rate, n_sines, sines, n_cosines, cosines, &
                             omega, tolerance, t_end, found, status, steps) bind(c)
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_loc
  use problem, only: problem_t
  use taylor, only: taylor_solve
  implicit none(type, external)
  integer(c_int), intent(in), value :: n_sines, n_cosines
  real(c_double), intent(in) :: coefficients(3), constant(3), rate(3), omega(3), tolerance, t_end
  real(c_double), intent(in), target :: sines(4, n_sines), cosines(4, n_cosines)
  real(c_double), intent(inout) :: found(3)
  integer(c_int), intent(out) :: status
  integer(c_int64_t), intent(out) :: steps
  type(problem_t), target :: given
  integer(c_int) :: n_rows
  real(c_double) :: needed, accuracy(3)

  given = problem_t(coefficients, constant, rate, n_sines, n_cosines, sines, cosines)
  call taylor_solve(c_loc(given), omega, tolerance, 1.0_c_double, 1, [t_end], found, n_rows, &
                    status, steps, needed, accuracy)
end subroutine taylor_as_written

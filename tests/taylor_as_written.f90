! The series by its loops as they are written, for ctypes.
subroutine taylor_as_written(coefficients, constant, rate, n_sines, sines, n_cosines, cosines, &
                             omega, tolerance, n_times, times, rows, n_rows, status, steps, &
                             found) bind(c)
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_loc
  use problem, only: problem_t, request_t, solution_t
  use taylor, only: taylor_solve
  implicit none(type, external)
  integer(c_int), intent(in), value :: n_sines, n_cosines, n_times
  real(c_double), intent(in) :: coefficients(3), constant(3), rate(3), omega(3), tolerance
  real(c_double), intent(in), target :: times(n_times)
  real(c_double), intent(in), target :: sines(4, n_sines), cosines(4, n_cosines)
  real(c_double), intent(inout), target :: rows(3, n_times)
  integer(c_int), intent(out) :: n_rows, status
  integer(c_int64_t), intent(out) :: steps
  real(c_double), intent(out) :: found(3)
  type(problem_t), target :: given
  type(request_t), target :: request
  type(solution_t), target :: solution

  given = problem_t(coefficients, constant, rate, n_sines, n_cosines, sines, cosines)
  request = request_t(omega, tolerance, 1.0_c_double, times)
  solution%rows => rows
  call taylor_solve(c_loc(given), c_loc(request), c_loc(solution))
  n_rows = solution%n_rows
  status = solution%status
  steps = solution%steps
  found = [solution%error, solution%growth, solution%spent]
end subroutine taylor_as_written

! In place of step_nodes.c.
subroutine sum_at_nodes_as_written(terms, size, to_next_term, to_next, n, order, parts, sums) &
  bind(c, name="sum_at_nodes_level")
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use step_nodes, only: AT_ONCE
  implicit none(type, external)
  integer(c_int), intent(in), value :: size, to_next_term, to_next, n, order
  real(c_double), intent(in) :: terms(size), parts(AT_ONCE)
  real(c_double), intent(out) :: sums(AT_ONCE, n)
  integer :: i, k

  sums = 0.0_c_double
  do i = 1, n
    do k = order, 1, -1
      sums(:, i) = sums(:, i)*parts + terms(1 + k*to_next_term + (i - 1)*to_next)
    end do
    sums(:, i) = sums(:, i)*parts
  end do
end subroutine sum_at_nodes_as_written

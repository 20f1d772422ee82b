! Many bodies by the loops as they are written, for ctypes: method 0 is the series.
subroutine many_as_written(method, n, n_waves, tolerance, step, body, constant, rate, sines, omega0, &
                           times, n_times, n_attitudes, attitude0, omega, attitude, &
                           status) bind(c)
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int8_t, c_loc
  use bodies, only: bodies_t, RAMPED
  use many_fixed, only: many_fixed_solve
  use many_taylor, only: many_taylor_solve
  implicit none(type, external)
  integer(c_int), intent(in), value :: method, n, n_waves, n_times, n_attitudes
  real(c_double), intent(in), value :: tolerance, step
  real(c_double), intent(in), target :: body(3, n), constant(3, n), rate(3, n), omega0(3, n)
  real(c_double), intent(in), target :: sines(4, n_waves, n), times(n_times)
  real(c_double), intent(in), target :: attitude0(4, n_attitudes)
  real(c_double), intent(inout) :: omega(3, n)
  real(c_double), intent(inout), target :: attitude(4, n_attitudes)
  integer(c_int8_t), intent(inout) :: status(n)
  real(c_double), target :: none(4, 0, 1), no_estimates(2, 0)
  type(bodies_t), target :: given
  integer(c_int) :: interrupted

  given%by_moments = .true.
  given%tolerance = tolerance
  given%step = step
  given%n = n
  given%body => body
  given%constant => constant
  given%rate => rate
  given%sines => sines
  given%cosines => none
  given%omega0 => omega0
  given%times => times
  given%attitude0 => attitude0
  given%attitude => attitude
  given%estimates => no_estimates
  given%mark = RAMPED
  given%n_waves = n_waves
  status = RAMPED
  if (method == 0) then
    call many_taylor_solve(c_loc(given), n, omega, status, interrupted)
  else
    call many_fixed_solve(c_loc(given), method, n, omega, status, interrupted)
  end if
end subroutine many_as_written

! The interface that f2py reads for the other floating-point formats (words); see api.f90. f2py does
! not know these formats, so their numbers cross the interface as bytes.

subroutine run_program_in_word(program, flags, by_moments, n_bytes, triples, limits, &
                               torque_varies, n_sines, sines, n_cosines, cosines, n_steps, &
                               may_stop, with_velocity, rows, ier_rows, n_rows, status, &
                               evaluations, stop_variable, stop_quotient)
  ! Run one of the three programs in the format whose numbers have n_bytes bytes.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc
  use listing_flags, only: listing_from_bits
  use words, only: packed_t, run_in_word
  implicit none
  integer(4), intent(in) :: program, flags, by_moments ! these and those below as in run_program
  integer(4), intent(in) :: n_bytes  ! 4, 8 or, if the compiler has binary128, 16
  integer(1), intent(in), target :: triples(n_bytes, 3, 7) ! columns: members body to torque_first
  integer(1), intent(in), target :: limits(n_bytes, 2)     ! step_size, lipschitz
  integer(4), intent(in) :: torque_varies
  integer(4), intent(in) :: n_sines
  integer(1), intent(in), target :: sines(n_bytes, 4, n_sines)
  integer(4), intent(in) :: n_cosines
  integer(1), intent(in), target :: cosines(n_bytes, 4, n_cosines)
  integer(4), intent(in) :: n_steps, may_stop, with_velocity
  !f2py intent(cache) rows, ier_rows
  integer(1), intent(out), target :: rows(n_bytes, 8, n_steps)
  integer(4), intent(out) :: ier_rows(n_steps)
  integer(4), intent(out) :: n_rows
  integer(4), intent(out) :: status                        ! or 3: no format of n_bytes bytes
  integer(4), intent(out) :: evaluations, stop_variable
  integer(1), intent(out), target :: stop_quotient(n_bytes)

  call run_in_word(n_bytes, &
                   packed_t(program, listing_from_bits(flags), by_moments /= 0, &
                            torque_varies /= 0, n_sines, n_cosines, n_steps, may_stop /= 0, &
                            with_velocity /= 0, c_loc(triples), c_loc(limits), c_loc(sines), &
                            c_loc(cosines), c_loc(rows), c_loc(stop_quotient)), &
                   ier_rows, n_rows, status, evaluations, stop_variable)
end subroutine run_program_in_word

subroutine functions_of_word(n_bytes, n, given, values, status)
  ! Compute square root, sine and cosine alone, so that tests can check them separately.
  !f2py threadsafe
  use, intrinsic :: iso_c_binding, only: c_loc
  use words, only: functions_in_word
  implicit none
  integer(4), intent(in) :: n_bytes, n
  integer(1), intent(in), target :: given(n_bytes, n)
  integer(1), intent(out), target :: values(n_bytes, 3, n)
  integer(4), intent(out) :: status  ! 0, or 3: no format of n_bytes bytes

  call functions_in_word(n_bytes, n, c_loc(given), c_loc(values), status)
end subroutine functions_of_word

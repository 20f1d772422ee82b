module many_tape
  !! Many bodies under one torque that depends on the state, side by side.
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr
  use bodies, only: bodies_t, i1, NEEDS_FALLBACK
  use kinds, only: dp
  use levels, only: tape_bodies
  use places, only: TOLERANCE, WAVES
  use tape, only: arrays_of, COARSEST, tape_bodies_t, tape_of, tape_t
  implicit none(type, external)
  private

  public :: solve_tape_bodies

contains

  subroutine solve_tape_bodies(packed, many, omega, status, raised)
    !! Compute omega of each body at its time, and its attitude. The status is COMPLETE, or
    !! NEEDS_FALLBACK of a body that is left to the single-body kernel.
    real(dp), intent(in), target, contiguous :: packed(0:)      !! the scene, as in prepared.f90
    type(bodies_t), intent(in) :: many !! all but the body and its torque; attitude0 has unit
    !! quaternions, and both its attitudes have n columns, or none if the tape has no attitude
    real(dp), intent(inout), target, contiguous :: omega(:, :)  !! (3, n), rad/s
    integer(i1), intent(inout), target, contiguous :: status(:) !! (n)
    integer, intent(out) :: raised     !! not 0: interrupted by the user
    type(tape_t) :: equations
    type(tape_bodies_t) :: bodies

    raised = 0
    status = NEEDS_FALLBACK
    equations = tape_of(packed(WAVES:))
    if (size(many%attitude0, 2) == 0 .neqv. equations%n_unknowns == 3) return
    bodies%tape = arrays_of(equations, c_null_ptr, c_null_ptr, c_null_ptr)
    bodies%table_starts = c_loc(equations%table_starts)
    bodies%breaks = c_loc(equations%breaks)
    bodies%pieces = c_loc(equations%pieces)
    bodies%tolerance = min(packed(TOLERANCE), COARSEST)
    bodies%n_slots = equations%n_slots
    bodies%n_tables = size(equations%table_starts, 1) - 1
    bodies%n = many%n
    bodies%n_times = size(many%times, 1)
    bodies%omega0 = c_loc(many%omega0)
    bodies%attitude0 = c_loc(many%attitude0)
    bodies%times = c_loc(many%times)
    bodies%omega = c_loc(omega)
    bodies%attitude = c_loc(many%attitude)
    bodies%status = c_loc(status)
    bodies%estimates = c_null_ptr
    if (size(many%estimates, 2) > 0) bodies%estimates = c_loc(many%estimates)
    bodies%n_parameters = 0
    bodies%n_sets = 0
    bodies%parameters = c_null_ptr
    if (associated(many%parameters)) then
      bodies%n_parameters = size(many%parameters, 1)
      if (bodies%n_parameters > 0) bodies%n_sets = size(many%parameters, 2)
      bodies%parameters = c_loc(many%parameters)
    end if
    call tape_bodies(bodies)
    raised = bodies%interrupted
  end subroutine solve_tape_bodies

end module many_tape

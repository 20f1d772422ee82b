module many_bodies
  !! Many bodies in one call. Multi-lane kernels solve them side by side where they are accurate
  !! enough; the single-body kernel solves the others one by one.
  use, intrinsic :: iso_c_binding, only: c_loc
  use bodies, only: bodies_t, FREE, i1, NEEDS_FALLBACK, RAMPED, STEPPED, WAVED, with_attitude
  use kinds, only: dp
  use levels, only: many_fixed, many_free, many_taylor
  use many_kinds, only: mark_bodies
  use many_left, only: solve_left, solve_left_with_attitude
  use many_tape, only: many_t, solve_tape_bodies
  use methods, only: QUICK_OR_TAYLOR, TAPE, TAYLOR
  use places, only: COEFFICIENTS, CONSTANT, EFFORT, METHOD, N_COSINES, N_SINES, RATE, STEP, &
                    TOLERANCE, WAVES
  implicit none(type, external)
  private

  public :: solve_bodies, solve_packed_bodies, solve_rows

contains

  subroutine solve_packed_bodies(packed, n_packed, n, omega0, times, omega, status, raised)
    !! Solve many initial omegas of one prepared scene.
    integer, intent(in) :: n_packed, n
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in), target :: omega0(3, n)
    real(dp), intent(in), target, contiguous :: times(:)
    real(dp), intent(inout), target :: omega(3, n)
    integer(i1), intent(inout), target :: status(n)
    integer, intent(out) :: raised
    type(bodies_t) :: bodies
    real(dp), target :: no_attitude(4, 0), no_estimates(2, 0), no_moments(3, 0)
    real(dp) :: own(0:n_packed - 1)
    integer :: code, middle

    code = int(packed(METHOD))
    if (code == TAPE) then
      call solve_packed_tape(packed, n_packed, n, omega0, times, omega, status, raised)
      return
    end if
    ! The multi-lane kernels have the series but not quick. The bodies that they leave are solved by
    ! the series as well, whose checks are the same.
    if (code == QUICK_OR_TAYLOR) code = TAYLOR
    own = packed
    own(METHOD) = real(code, dp)
    bodies%by_moments = .false.
    bodies%tolerance = packed(TOLERANCE)
    bodies%step = packed(STEP)
    bodies%effort = packed(EFFORT)
    bodies%n = n
    bodies%body(1:3, 1:1) => packed(COEFFICIENTS:COEFFICIENTS + 2)
    bodies%moments => no_moments
    bodies%constant(1:3, 1:1) => packed(CONSTANT:CONSTANT + 2)
    bodies%rate(1:3, 1:1) => packed(RATE:RATE + 2)
    middle = WAVES + 4*int(packed(N_SINES))
    bodies%sines(1:4, 1:int(packed(N_SINES)), 1:1) => packed(WAVES:middle - 1)
    bodies%cosines(1:4, 1:int(packed(N_COSINES)), 1:1) => packed(middle:n_packed - 1)
    bodies%omega0 => omega0
    bodies%times => times
    bodies%attitude0 => no_attitude
    bodies%attitude => no_attitude
    bodies%estimates => no_estimates
    call solve_bodies(bodies, code, own, omega, status, raised)
  end subroutine solve_packed_bodies

  subroutine solve_packed_tape(packed, n_packed, n, omega0, times, omega, status, raised)
    !! Solve many initial omegas of one recorded scene.
    integer, intent(in) :: n_packed, n
    real(dp), intent(in), target :: packed(0:n_packed - 1)
    real(dp), intent(in), target :: omega0(3, n)
    real(dp), intent(in), target, contiguous :: times(:)
    real(dp), intent(inout), target :: omega(3, n)
    integer(i1), intent(inout), target :: status(n)
    integer, intent(out) :: raised
    type(many_t) :: many
    integer :: n_left
    real(dp), target :: alone(0:n_packed - 1), of_attitudes(4, 1, 0), of_estimates(2, 1, 0)
    real(dp), target :: attitudes(4, 0), states(n, 0), sizes(0), own(1, n, 0), parameters(0, 0)

    alone = packed
    many%n = n
    many%n_rows = 1
    many%n_own = 0
    many%omega0 => omega0
    many%times(1:1, 1:size(times)) => times
    many%omega(1:3, 1:1, 1:n) => omega
    many%status(1:1, 1:n) => status
    many%attitude0 => attitudes
    many%own0 => states
    many%own_sizes => sizes
    many%parameters => parameters
    many%attitude => of_attitudes
    many%own => own
    many%estimates => of_estimates
    call solve_tape_bodies(packed, alone, many, n_left, raised)
  end subroutine solve_packed_tape

  subroutine solve_bodies(bodies, code, packed, omega, status, raised)
    !! Compute omega of each body at its time, and its attitude if attitude0 is specified.
    type(bodies_t), intent(in), target :: bodies
    integer, intent(in) :: code                !! code of the module methods
    real(dp), intent(in) :: packed(0:)         !! scene of all bodies, as in prepared.f90; or none
    real(dp), intent(inout) :: omega(3, bodies%n) !! rad/s; NaN unless the status is 0 or 6
    integer(i1), intent(inout) :: status(bodies%n) !! of the module statuses
    integer, intent(out) :: raised             !! 1: interrupted by the user, no result is valid
    integer :: n_waves

    raised = 0
    if (bodies%n == 0) return
    call mark_bodies(bodies, code, status, n_waves)
    call solve_marked(bodies, FREE, 0, code, omega, status, raised)
    ! Marks are below all other statuses.
    if (minval(status) < NEEDS_FALLBACK) then
      if (raised == 0) call solve_marked(bodies, STEPPED, 0, code, omega, status, raised)
      if (raised == 0) call solve_marked(bodies, RAMPED, 0, code, omega, status, raised)
      if (raised == 0) call solve_marked(bodies, WAVED, n_waves, code, omega, status, raised)
    end if
    if (raised /= 0 .or. minval(status) /= NEEDS_FALLBACK) then
      continue
    else if (with_attitude(bodies)) then
      call solve_left_with_attitude(bodies, code, omega, status, raised)
    else
      call solve_left(bodies, code, packed, omega, status, raised)
    end if
  end subroutine solve_bodies

  subroutine solve_rows(bodies, code, status, raised)
    !! Compute omega, and the attitude if attitude0 is specified, at the times of all bodies, side
    !! by side. Bodies that need another kernel get the status NEEDS_FALLBACK.
    type(bodies_t), intent(in), target :: bodies
    integer, intent(in) :: code                    !! code of the module methods
    integer(i1), intent(inout) :: status(bodies%n) !! of the module statuses
    integer, intent(out) :: raised                 !! 1: interrupted by the user
    real(dp), allocatable :: omega(:, :)
    integer :: n_waves, failed

    raised = 0
    status = NEEDS_FALLBACK
    allocate (omega(3, bodies%n), stat=failed)
    if (failed /= 0 .or. bodies%n == 0) return
    call mark_bodies(bodies, code, status, n_waves)
    call solve_marked(bodies, FREE, 0, code, omega, status, raised)
    call solve_marked(bodies, RAMPED, 0, code, omega, status, raised)
    if (raised == 0) call solve_marked(bodies, WAVED, n_waves, code, omega, status, raised)
    where (status < NEEDS_FALLBACK) status = NEEDS_FALLBACK
  end subroutine solve_rows

  subroutine solve_marked(bodies, mark, n_waves, code, omega, status, raised)
    !! Solve the bodies with one mark side by side. Some of them may be left to the single-body
    !! kernel.
    type(bodies_t), intent(in) :: bodies
    integer(i1), intent(in) :: mark
    integer, intent(in) :: n_waves, code
    real(dp), intent(inout) :: omega(3, bodies%n)
    integer(i1), intent(inout) :: status(bodies%n)
    integer, intent(out) :: raised
    type(bodies_t), target :: marked

    raised = 0
    if (.not. any(status == mark)) return
    marked = bodies
    marked%mark = mark
    marked%n_waves = n_waves
    if (mark == FREE) then
      call many_free(c_loc(marked), bodies%n, omega, status)
    else if (mark == STEPPED) then
      call many_fixed(c_loc(marked), code, bodies%n, omega, status, raised)
    else
      call many_taylor(c_loc(marked), bodies%n, omega, status, raised)
    end if
  end subroutine solve_marked

end module many_bodies

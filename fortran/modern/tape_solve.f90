module tape_solve
  !! The solution of a scene whose equations of motion are a tape: integrations from 0 to the last
  !! time, until the error is small enough or cannot be reduced.
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use statuses, only: COMPLETE, GAVE_UP, SENSITIVE, SLIDING, STALLED
  use tape, only: COARSEST, FIRST_UNKNOWN, tape_t
  use tape_march, only: attempt_t, march, outcome_t
  use tape_series, only: allocate_series, series_t, SIDE_BY_SIDE
  use tape_switches, only: find_switches, switches_t
  implicit none(type, external)
  private

  real(dp), parameter :: MOST_STEPS = 4e6_dp    ! work limit with ten slots; some ten seconds
  real(dp), parameter :: CHEAP_SLOTS = 10.0_dp
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 5e4_dp ! between polls for an interrupt
  real(dp), parameter :: ANOTHER = 2.2_dp ! cost of two integrations, relative to the first
  ! One integration suffices if its error is at most TRUSTED tolerances and its amplification at
  ! most PLANNED_GROWTH. Otherwise another one follows, with an error smaller by SAFETY.
  real(dp), parameter :: TRUSTED = 0.25_dp
  real(dp), parameter :: DOUBTED = 256.0_dp ! amplification that halves the trust in an estimate
  real(dp), parameter :: PLANNED_GROWTH = 2e3_dp
  real(dp), parameter :: SAFETY = 10.0_dp
  real(dp), parameter :: FINER = 1e-3_dp  ! factor on the tolerance where no step was short enough
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  ! The pair of poles that is fitted to the last terms may be that of a part of the motion.
  real(dp), parameter :: FITTED = 2.5_dp
  real(dp), parameter :: UNSURE = 0.3_dp ! rounding times amplification, in tolerances
  real(dp), parameter :: FINEST = 1e-14_dp ! errors below it are not told from rounding errors
  real(dp), parameter :: NO_DIGIT = 1e100_dp ! a relative error that leaves no digit

  public :: solve_tape

contains

  subroutine solve_tape(tape_at, request_at, solution_at) bind(c, name="solve_tape_level")
    !! Compute the solution at the requested times, which have one sign and are ordered away from 0.
    !! The status is COMPLETE, OVERFLOW, STALLED, GAVE_UP, INTERRUPTED, SENSITIVE or SLIDING.
    ! Addresses of a tape_t, a request_t and a solution_t, passed through C.
    type(c_ptr), intent(in), value :: tape_at, request_at, solution_at
    type(tape_t), pointer :: given
    type(tape_t), target :: tape
    type(request_t), pointer :: request
    type(solution_t), pointer :: solution
    real(dp), allocatable, target :: memory(:)
    type(series_t) :: s
    type(switches_t), target :: switches
    integer :: failed
    type(attempt_t) :: attempt
    type(outcome_t) :: outcome
    real(dp) :: attitude(4)
    real(dp) :: most, spent, cost, error, blurred, planned
    real(dp) :: at_end ! amplification that is expected there
    logical :: again, fits

    call c_f_pointer(tape_at, given)
    call c_f_pointer(request_at, request)
    call c_f_pointer(solution_at, solution)
    solution%status = GAVE_UP
    solution%n_rows = 0
    solution%steps = 0
    solution%needed = 0.0_dp
    solution%error = 0.0_dp
    solution%growth = -1.0_dp
    solution%spent = 0.0_dp
    attitude = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
    if (associated(solution%attitudes)) attitude = solution%attitudes(:, 0)
    if (request%times(size(request%times)) == 0.0_dp) then
      solution%rows(:, 1) = request%omega
      if (associated(solution%attitudes)) solution%attitudes(:, 1) = attitude
      if (associated(solution%own)) solution%own(:, 1) = solution%own(:, 0)
      solution%n_rows = 1
      solution%status = COMPLETE
      solution%growth = 1.0_dp
      return
    end if
    tape = given
    tape%has_attitude = tape%n_unknowns == 7 .and. .not. associated(solution%own)
    call allocate_series(tape, 1 + tape%n_unknowns/SIDE_BY_SIDE, &
                         FIRST_UNKNOWN - 1 + tape%n_unknowns, memory, s, fits)
    if (.not. fits) return
    call find_switches(tape, switches, failed)
    if (failed /= 0) return
    cost = max(1.0_dp, tape%n_slots/CHEAP_SLOTS)
    most = min(4e18_dp, request%effort*(MOST_STEPS/cost))
    attempt%stride = 1 + int(STEPS_BETWEEN_LOOKS/cost, int64)
    attempt%tolerance = min(request%tolerance, COARSEST)
    spent = 0.0_dp
    planned = PLANNED_GROWTH
    do
      attempt%most_steps = most - spent
      call march(tape, request, attitude, attempt, s, switches, solution, outcome)
      spent = spent + real(outcome%steps, dp)
      if (.not. outcome%error <= NO_DIGIT) outcome%error = NO_DIGIT
      if (solution%status == STALLED .and. attempt%tolerance > FINER*request%tolerance) then
        ! With a finer local tolerance the step may end before it becomes too long.
        attempt%tolerance = FINER*attempt%tolerance
        cycle
      end if
      if (solution%status /= COMPLETE .or. outcome%finest) exit
      again = outcome%growth > planned
      ! Where perturbations grow, a few steps cause most of the error; their estimates may be wrong
      ! by chance.
      error = max(outcome%error, outcome%least) &
              *(1.0_dp + min(outcome%growth, PLANNED_GROWTH)/DOUBTED)
      if (.not. again .and. error <= TRUSTED*request%tolerance) exit
      attempt%tolerance = attempt%tolerance &
                          *min(1.0_dp, &
                               TRUSTED*request%tolerance/(SAFETY*max(error, ROUNDING**2)), &
                               PLANNED_GROWTH/outcome%growth)
      planned = max(planned, 2.0_dp*outcome%growth)
    end do
    blurred = ROUNDING*(outcome%growth + outcome%blur)
    solution%steps = outcome%steps
    ! The propagated error may be small by chance at the end, although perturbations grew before.
    error = max(outcome%least*sqrt(outcome%growth), sqrt(outcome%unseen)*outcome%growth)
    if (blurred <= UNSURE*request%tolerance) error = max(error, FITTED*outcome%error)
    solution%error = max(outcome%error, min(error, UNSURE*request%tolerance)) + blurred
    solution%error = solution%error + solution%between
    solution%growth = outcome%growth
    solution%spent = spent
    if (solution%status == COMPLETE &
        .and. (blurred > UNSURE*request%tolerance &
               .or. outcome%error > max(request%tolerance, FINEST))) then
      solution%status = SENSITIVE
    end if
    if (solution%status == SLIDING .or. solution%status == SENSITIVE &
        .and. outcome%touched > 0.5_dp*ROUNDING*outcome%noise) then
      solution%switch = outcome%switch
      solution%needed = outcome%switches_at
    end if
    if (solution%status == GAVE_UP) then
      ! If the error or the amplification will be too large, another integration will be needed.
      at_end = outcome%growth*(1.0_dp + outcome%ahead/real(max(1_int64, outcome%steps), dp))
      if (outcome%error > request%tolerance .or. at_end > planned) then
        outcome%ahead = ANOTHER*outcome%ahead
      end if
      solution%needed = (spent - real(solution%steps, dp) + outcome%ahead)*cost/MOST_STEPS
      solution%steps = int(spent, int64)
    end if
  end subroutine solve_tape

end module tape_solve

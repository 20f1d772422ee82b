module taylor
  !! Taylor series: integrations from 0 to the last time, until the error is small enough or cannot
  !! be reduced.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_intptr_t, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t, request_t, solution_t
  use series, only: LONG
  use statuses, only: COMPLETE, GAVE_UP, SENSITIVE
  use taylor_march, only: A_PRECISE_STEP, attempt_t, coupling_of, march, TOO_LONG
  use taylor_rows, only: outcome_t, room_t
  use torque_noise, only: torque_noise_of, wave_rounding_of
  use torque_terms, only: wave_t, waves_of
  implicit none(type, external)
  private

  ! Work limit without waves: some ten seconds. A wave costs A_WAVE of a step without waves.
  real(dp), parameter :: MOST_STEPS = 1e7_dp
  real(dp), parameter :: A_WAVE = 0.5_dp
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 1e5_dp ! between polls for an interrupt
  real(dp), parameter :: FARTHEST_COUNT = 4e18_dp
  real(dp), parameter :: ANOTHER = 2.2_dp ! cost of two integrations, relative to the first
  ! One integration suffices if its error is at most TRUSTED tolerances and its amplification at
  ! most PLANNED_GROWTH. Otherwise errors may cancel in the propagated error, and another
  ! integration is planned with an error smaller by the factor SAFETY.
  real(dp), parameter :: TRUSTED = 0.25_dp
  real(dp), parameter :: DOUBTED = 256.0_dp ! amplification that halves the trust in an estimate
  real(dp), parameter :: PLANNED_GROWTH = 2e3_dp
  real(dp), parameter :: SAFETY = 10.0_dp
  real(dp), parameter :: CHOOSING = 1e15_dp ! amplification that makes rounding errors large
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  ! Number of steps whose rounding errors may add up to one rounding error at the worst time
  ! (measured). In some scenes they do not cancel as in a random walk.
  real(dp), parameter :: WALK = 5e3_dp
  real(dp), parameter :: UNSURE = 0.3_dp ! rounding times amplification, in tolerances
  integer, parameter :: FEW_WAVES = 16    ! waves that need no allocated array
  integer(c_intptr_t), parameter :: ALIGNED = 64 ! bytes: no column crosses a cache line

  public :: taylor_solve

contains

  subroutine taylor_solve(problem_at, request_at, solution_at) bind(c, name="taylor_solve_level")
    !! Compute the solution at the requested times, which have one sign and are ordered away from 0.
    !! The status is COMPLETE, OVERFLOW, GAVE_UP, INTERRUPTED or SENSITIVE.
    ! Addresses of a problem_t, a request_t and a solution_t, passed through C.
    type(c_ptr), intent(in), value :: problem_at, request_at, solution_at
    type(problem_t), pointer :: problem
    type(request_t), pointer :: request
    type(solution_t), pointer :: solution
    type(room_t), pointer :: room
    real(c_double), target :: place(storage_size(room)/64 + ALIGNED/8)
    type(wave_t) :: few(FEW_WAVES)
    type(wave_t), allocatable :: many(:)
    integer :: n_waves, failed
    integer(c_intptr_t) :: address

    call c_f_pointer(problem_at, problem)
    call c_f_pointer(request_at, request)
    call c_f_pointer(solution_at, solution)
    address = transfer(c_loc(place), address)
    call c_f_pointer(c_loc(place(1 + modulo(-address, ALIGNED)/8)), room)
    n_waves = problem%n_sines + problem%n_cosines
    if (n_waves <= FEW_WAVES) then
      call solve(problem, request, room, few(:n_waves), solution)
    else
      allocate (many(n_waves), stat=failed)
      solution%status = GAVE_UP
      solution%n_rows = 0
      solution%steps = 0
      solution%needed = 0.0_dp
      if (failed == 0) call solve(problem, request, room, many, solution)
    end if
  end subroutine taylor_solve

  subroutine solve(problem, request, room, waves, solution)
    !! Compute the solution with working storage.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request
    type(room_t), intent(inout) :: room
    type(wave_t), intent(inout), contiguous :: waves(:)
    type(solution_t), intent(inout) :: solution
    type(outcome_t) :: outcome
    type(attempt_t) :: attempt ! this integration
    real(dp) :: planned ! amplification that it allows for
    real(dp) :: t_end   ! last of the times, s
    real(dp) :: farthest ! rotation of perturbations without torque, rad
    real(dp) :: cost    ! cost of a step, in steps without waves
    real(dp) :: most    ! steps allowed for all integrations
    real(dp) :: spent   ! steps of all integrations so far
    real(dp) :: growth
    real(dp) :: error    ! error of this integration, as far as it is known, relative
    real(dp) :: least    ! lower bound of the error
    real(dp) :: blurred  ! by rounding at the end, relative
    logical :: too_coarse ! whether the motion is too long for variations that are not precise
    logical :: again    ! whether the amplification is known too coarsely
    logical :: blurs    ! whether rounding errors may exceed the tolerance

    t_end = request%times(size(request%times))
    planned = PLANNED_GROWTH
    cost = 1.0_dp + A_WAVE*size(waves)
    most = min(FARTHEST_COUNT, request%effort*(MOST_STEPS/cost))
    spent = 0.0_dp
    attempt%tolerance = request%tolerance
    ! Where a precise integration is likely to exceed the work limit, another one is tried first.
    farthest = coupling_of(problem%coefficients)*maxval(abs(request%omega))*abs(t_end)
    attempt%precise = farthest > LONG .and. farthest < 0.25_dp*most
    attempt%turn_limit = LONG
    attempt%stride = 1 + int(STEPS_BETWEEN_LOOKS/cost, int64)
    solution%needed = 0.0_dp
    call waves_of(problem, waves)
    do
      attempt%most_steps = most - spent
      call march(problem, request, attempt, room, waves, solution, outcome)
      spent = spent + real(outcome%steps, dp)
      if (solution%status == TOO_LONG) then
        ! If that is likely to exceed the work limit, an integration that is not precise follows.
        attempt%precise = outcome%ahead < most - spent
        attempt%turn_limit = huge(spent)
        cycle
      end if
      ! If a perturbation grew so much, rounding chose the trajectory, which ends in another motion.
      growth = outcome%growth
      if (outcome%largest > CHOOSING) growth = outcome%largest
      too_coarse = .not. attempt%precise .and. outcome%turned > LONG
      if (solution%status /= COMPLETE) exit
      if (outcome%finest .and. .not. too_coarse .and. (attempt%precise .or. growth <= planned)) exit
      again = growth > planned .or. too_coarse
      ! Where perturbations grow, a few steps cause most of the error; their estimates may be wrong
      ! by chance.
      error = max(outcome%error, outcome%least)*(1.0_dp + min(growth, PLANNED_GROWTH)/DOUBTED)
      blurs = again .and. ROUNDING*growth > UNSURE*request%tolerance
      ! The error may be as small already as another integration would make it.
      if (attempt%precise .and. .not. blurs .and. &
          error*max(SAFETY, SAFETY*growth/PLANNED_GROWTH) <= TRUSTED*request%tolerance) exit
      attempt%precise = attempt%precise .or. again
      ! Exit as well if a precise integration would take too many steps.
      if (attempt%precise .and. outcome%turned > A_PRECISE_STEP*(most - spent)) exit
      if (blurs) then
        ! Before the result is called sensitive: long steps may overestimate the amplification near
        ! the separatrix.
        attempt%tolerance = 0.0_dp
      else if (again .or. error > TRUSTED*request%tolerance) then
        attempt%tolerance = attempt%tolerance &
                            *min(1.0_dp, &
                                 TRUSTED*request%tolerance/(SAFETY*max(error, ROUNDING**2)), &
                                 PLANNED_GROWTH/growth)
        planned = max(planned, 2.0_dp*growth)
      else
        exit
      end if
    end do
    solution%steps = outcome%steps
    ! Errors grow in proportion to the rotation even where nothing amplifies them.
    if (too_coarse) growth = max(growth, outcome%turned)
    ! The factor for the attitude is known, and requires no precise integration.
    growth = growth*outcome%way
    blurred = ROUNDING*growth*(1.0_dp + real(solution%steps, dp)/WALK)
    if (problem%n_sines + problem%n_cosines > 0) then
      blurred = blurred + blurred*torque_noise_of(problem, t_end, real(solution%steps, dp), &
                                                  outcome%scale)
      error = ROUNDING*growth*wave_rounding_of(problem, t_end, real(solution%steps, dp), &
                                               outcome%scale)
    else
      error = 0.0_dp
    end if
    least = outcome%least
    if (outcome%unseen > 0.0_dp) least = max(least, outcome%unseen*growth)
    error = error + (max(outcome%error, min(least, UNSURE*request%tolerance)) + blurred)
    solution%error = error
    solution%growth = growth
    solution%spent = spent
    if (solution%status == COMPLETE .and. blurred > UNSURE*request%tolerance) then
      solution%status = SENSITIVE
    end if
    if (solution%status == GAVE_UP) then
      ! If the error is too large already, another integration with shorter steps will be needed.
      if (outcome%error > request%tolerance) outcome%ahead = ANOTHER*outcome%ahead
      solution%needed = (spent - real(solution%steps, dp) + outcome%ahead)*cost/MOST_STEPS
      solution%steps = int(spent, int64)
    end if
  end subroutine solve

end module taylor

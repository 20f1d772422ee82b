module taylor
  !! Taylor series: integrations from 0 to the last time, until the error of one is small enough or
  !! cannot be reduced.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int
  use, intrinsic :: iso_c_binding, only: c_int64_t, c_intptr_t, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t
  use statuses, only: COMPLETE, GAVE_UP, SENSITIVE
  use taylor_march, only: march, room_t
  use taylor_rows, only: outcome_t
  use torque_noise, only: torque_noise_of, wave_rounding_of
  use torque_terms, only: wave_t, waves_of
  implicit none(type, external)
  private

  ! Work limit without waves: some ten seconds. A wave costs A_WAVE of a step without waves.
  real(dp), parameter :: MOST_STEPS = 1e7_dp
  real(dp), parameter :: A_WAVE = 0.5_dp
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 1e5_dp ! between polls for an interrupt
  real(dp), parameter :: FARTHEST_COUNT = 4e18_dp
  real(dp), parameter :: ANOTHER = 2.2_dp ! cost of this and another integration over this one
  ! One integration suffices if its error is at most TRUSTED tolerances and its amplification at
  ! most PLANNED_GROWTH. Otherwise errors may cancel in the one that is propagated, and another
  ! integration is planned with an error smaller by SAFETY.
  real(dp), parameter :: TRUSTED = 0.25_dp
  real(dp), parameter :: DOUBTED = 256.0_dp ! amplification that halves the trust in an estimate
  real(dp), parameter :: PLANNED_GROWTH = 2e3_dp
  real(dp), parameter :: SAFETY = 10.0_dp
  real(dp), parameter :: CHOOSING = 1e15_dp ! amplification that makes rounding errors large
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)
  real(dp), parameter :: UNSURE = 0.3_dp ! rounding times amplification, in tolerances
  integer, parameter :: FEW_WAVES = 16    ! waves that need no allocated array
  integer(c_intptr_t), parameter :: ALIGNED = 64 ! bytes: no column crosses a cache line

  public :: taylor_solve

contains

  subroutine taylor_solve(problem_at, omega, tolerance, effort, n_times, times, rows, &
                          n_attitudes, attitudes, n_rows, status, steps, needed, found) &
    bind(c, name="taylor_solve_level")
    !! Compute the solution at `times`, which have one sign and are ordered away from 0.
    type(c_ptr), intent(in), value :: problem_at        !! address of a problem_t, passed through C
    real(c_double), intent(in) :: omega(3)              !! at time 0, rad/s
    real(c_double), intent(in) :: tolerance             !! of the error at `times`, relative
    real(c_double), intent(in) :: effort                !! factor on the work limit
    integer(c_int), intent(in), value :: n_times
    real(c_double), intent(in) :: times(n_times)        !! s
    real(c_double), intent(inout) :: rows(3, n_times)   !! omega for n_rows times, rad/s
    integer(c_int), intent(in), value :: n_attitudes    !! n_times, or 0
    real(c_double), intent(inout) :: attitudes(4, 0:n_attitudes) !! column 0: at time 0
    integer(c_int), intent(out) :: n_rows
    integer(c_int), intent(out) :: status !! COMPLETE, OVERFLOW, GAVE_UP, INTERRUPTED or SENSITIVE
    integer(c_int64_t), intent(out) :: steps            !! of the last integration
    real(c_double), intent(out) :: needed               !! estimated effort, if above the work limit
    real(c_double), intent(out) :: found(3) !! relative error; amplification; steps in total
    type(problem_t), pointer :: problem
    type(room_t), pointer :: room
    real(c_double), target :: place(storage_size(room)/64 + ALIGNED/8)
    type(wave_t) :: few(FEW_WAVES)
    type(wave_t), allocatable :: many(:)
    integer :: n_waves, failed
    integer(c_intptr_t) :: address

    call c_f_pointer(problem_at, problem)
    address = transfer(c_loc(place), address)
    call c_f_pointer(c_loc(place(1 + modulo(-address, ALIGNED)/8)), room)
    n_waves = problem%n_sines + problem%n_cosines
    if (n_waves <= FEW_WAVES) then
      call solve(problem, omega, tolerance, effort, n_times, times, n_waves, room, few, rows, &
                 n_attitudes, attitudes, n_rows, status, steps, needed, found)
    else
      allocate (many(n_waves), stat=failed)
      status = GAVE_UP
      n_rows = 0
      steps = 0
      needed = 0.0_dp
      if (failed == 0) then
        call solve(problem, omega, tolerance, effort, n_times, times, n_waves, room, many, rows, &
                   n_attitudes, attitudes, n_rows, status, steps, needed, found)
      end if
    end if
  end subroutine taylor_solve

  subroutine solve(problem, omega, tolerance, effort, n_times, times, n_waves, room, waves, rows, &
                   n_attitudes, attitudes, n_rows, status, steps, needed, found)
    !! Compute the solution with working storage.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: omega(3), tolerance, effort
    integer, intent(in) :: n_times
    real(dp), intent(in) :: times(n_times)
    integer, intent(in) :: n_waves
    type(room_t), intent(inout) :: room
    type(wave_t), intent(inout) :: waves(n_waves)
    real(dp), intent(inout) :: rows(3, n_times)
    integer, intent(in) :: n_attitudes
    real(dp), intent(inout) :: attitudes(4, 0:n_attitudes)
    integer, intent(out) :: n_rows, status
    integer(int64), intent(out) :: steps
    real(dp), intent(out) :: needed, found(3)
    type(outcome_t) :: outcome
    real(dp) :: asked   ! tolerance of this integration
    real(dp) :: planned ! amplification that it allows for
    real(dp) :: cost    ! cost of a step, in steps without waves
    real(dp) :: most    ! steps allowed for all integrations
    real(dp) :: spent   ! steps of all integrations so far
    real(dp) :: growth
    real(dp) :: error    ! error of this integration, as far as it is known, relative
    real(dp) :: blurred  ! by rounding at the end, relative
    logical :: again    ! whether the amplification is known too coarsely
    logical :: precise  ! whether this integration determines it well

    asked = tolerance
    planned = PLANNED_GROWTH
    cost = 1.0_dp + A_WAVE*n_waves
    most = min(FARTHEST_COUNT, effort*(MOST_STEPS/cost))
    spent = 0.0_dp
    precise = .false.
    needed = 0.0_dp
    call waves_of(problem, waves)
    do
      call march(problem, omega, asked, tolerance, precise, most - spent, &
                 1 + int(STEPS_BETWEEN_LOOKS/cost, int64), n_times, times, room%s, room%blocks, &
                 room%now, room%attitude, waves, rows, n_attitudes, attitudes, &
                 outcome)
      spent = spent + real(outcome%steps, dp)
      ! If a perturbation grew so much, rounding chose the trajectory, which ends in another motion.
      growth = outcome%growth
      if (outcome%largest > CHOOSING) growth = outcome%largest
      if (outcome%status /= COMPLETE) exit
      if (outcome%finest .and. (precise .or. growth <= planned)) exit
      again = growth > planned
      precise = precise .or. again
      ! Where perturbations grow, a few steps cause most of the error; their estimates may be wrong
      ! by chance.
      error = max(outcome%error, outcome%least)*(1.0_dp + min(growth, PLANNED_GROWTH)/DOUBTED)
      ! Exit as well if a precise integration would take too many steps.
      if (precise .and. outcome%precise_steps > most - spent) exit
      if (again .and. ROUNDING*growth > UNSURE*tolerance) then
        ! Before the result is called sensitive: long steps may overestimate the amplification near
        ! the separatrix.
        asked = 0.0_dp
      else if (again .or. error > TRUSTED*tolerance) then
        asked = asked*min(1.0_dp, TRUSTED*tolerance/(SAFETY*max(error, ROUNDING**2)), &
                          PLANNED_GROWTH/growth)
        planned = max(planned, 2.0_dp*growth)
      else
        exit
      end if
    end do
    n_rows = outcome%n_rows
    status = outcome%status
    steps = outcome%steps
    ! The factor for the attitude is known, and requires no precise integration.
    growth = growth*outcome%way
    blurred = ROUNDING*growth
    if (problem%n_sines + problem%n_cosines > 0) then
      blurred = blurred + blurred*torque_noise_of(problem, times(n_times), real(steps, dp), &
                                                  outcome%scale)
      error = ROUNDING*growth*wave_rounding_of(problem, times(n_times), real(steps, dp), &
                                               outcome%scale)
    else
      error = 0.0_dp
    end if
    error = error + (max(outcome%error, min(outcome%least, UNSURE*tolerance)) + blurred)
    found = [error, growth, spent]
    if (status == COMPLETE .and. blurred > UNSURE*tolerance) status = SENSITIVE
    if (status == GAVE_UP) then
      ! If the error is too large already, another integration with shorter steps will be needed.
      if (outcome%error > tolerance) outcome%ahead = ANOTHER*outcome%ahead
      needed = (spent - real(steps, dp) + outcome%ahead)*cost/MOST_STEPS
      steps = int(spent, int64)
    end if
  end subroutine solve

end module taylor

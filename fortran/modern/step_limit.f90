module step_limit
  !! The limit of the number of steps of an integration, a forecast of this number, and the polls
  !! for an interrupt.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use statuses, only: GAVE_UP, INTERRUPTED
  implicit none(type, external)
  private

  ! If the first step forecasts more than this multiple of the steps allowed, the integration ends.
  real(dp), parameter :: HOPELESS = 10.0_dp
  ! If the steps increase with a larger power of time, this is not by chance.
  real(dp), parameter :: GROWING = 1.3_dp
  real(dp), parameter :: COUNTABLE = 4e18_dp

  type, public :: step_limit_t
    real(dp) :: most_steps
    integer(int64) :: stride    !! steps between polls for an interrupt
    integer(int64) :: next_look !! the step after which the limit is checked again
    integer(int64) :: half_way  !! half of the steps allowed
    real(dp) :: t_half          !! the time after half_way steps, s
  end type step_limit_t

  public :: check_steps, limit_of

contains

  pure function limit_of(most_steps, stride) result(limit)
    !! Return the limit before the first step.
    real(dp), intent(in) :: most_steps
    integer(int64), intent(in) :: stride
    type(step_limit_t) :: limit

    limit = step_limit_t(most_steps, stride, 1_int64, &
                         max(1_int64, int(0.5_dp*min(COUNTABLE, most_steps), int64)), 0.0_dp)
  end function limit_of

  subroutine check_steps(steps, t, rest, is_cut, limit, ahead, status)
    !! Check the limit after a step, if it is time to. The status becomes GAVE_UP if the limit is
    !! exceeded, now or by forecast, and INTERRUPTED after Ctrl-C.
    integer(int64), intent(in) :: steps        !! so far
    real(dp), intent(in) :: t, rest            !! time reached, time to go, s
    logical, intent(in) :: is_cut              !! whether a breakpoint cut the last step
    type(step_limit_t), intent(inout) :: limit
    real(dp), intent(inout) :: ahead           !! forecast of all steps
    integer, intent(inout) :: status
    real(dp) :: power

    if (steps < limit%next_look) return
    limit%next_look = max(steps + 1, int(min(COUNTABLE, limit%most_steps), int64))
    limit%next_look = min(steps + limit%stride, limit%next_look)
    if (steps == limit%half_way) limit%t_half = t
    if (steps < limit%half_way) limit%next_look = min(limit%next_look, limit%half_way)
    ! Extrapolate the steps so far in proportion to the time, or faster if the motion becomes
    ! faster.
    power = 1.0_dp
    if (steps > limit%half_way) then
      power = log(real(steps, dp)/real(limit%half_way, dp))/log(t/limit%t_half)
    end if
    power = merge(min(3.0_dp, power), 1.0_dp, power > GROWING)
    ahead = real(steps, dp)*(1.0_dp + abs(rest/t))**power
    if (real(steps, dp) >= limit%most_steps &
        .or. (steps == 1 .and. .not. is_cut .and. ahead > HOPELESS*limit%most_steps)) then
      status = GAVE_UP
    else if (steps > 1) then
      ! A poll takes as long as a step or two.
      if (interrupt_raised() /= 0) status = INTERRUPTED
    end if
  end subroutine check_steps

end module step_limit

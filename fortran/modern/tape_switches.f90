module tape_switches
  !! Switches of a tape: operations whose results are constant in a step, because it ends where the
  !! operand crosses one of its levels (Hairer, Norsett and Wanner 1993, section II.6). Term 0 of a
  !! switch is its result: 0 or 1 of SWITCH, a whole number of FLOOR.
  use kinds, only: dp
  use operations, only: FLOOR_OF => FLOOR, LINEAR, PRODUCT, SELECT_OF => SELECT, SWITCH
  use tape, only: tape_t
  use tape_roots, only: size_of
  use tape_series, only: series_t
  use tape_values, only: LAST_TERM
  implicit none(type, external)
  private

  integer, parameter, public :: LOWER = 1, UPPER = 2 ! levels on which an operand may be
  real(dp), parameter, public :: ZERO_TERM = 1e-13_dp   ! part of the terms that is a rounding error
  real(dp), parameter :: ROUNDED = 1e-14_dp     ! rounding error of an operand, over its terms
  real(dp), parameter, public :: FAR = 1e-8_dp  ! part of the terms that is no rounding error

  type, public :: switches_t
    integer :: n = 0
    integer, allocatable :: slots(:), operands(:) !! of each switch
    logical, allocatable :: is_floor(:)
    integer, allocatable :: on_level(:)  !! LOWER or UPPER where the step begins there, else 0
    integer, allocatable :: crosses(:)   !! the level that the operand crosses at the step's end
    logical, allocatable :: is_turned(:) !! changed since the last step, by turn_back
    logical, allocatable :: is_live(:)   !! whether it matters in this step
    logical, allocatable :: is_new(:)    !! whether it matters again, but its result is outdated
    ! All operations that matter in this step, and whether each operation of the tape does.
    integer, allocatable :: operations(:, :)
    logical, allocatable :: matters(:)
    logical, allocatable :: is_discrete(:) !! operations that depend on results of switches alone
    ! Of the first switch that crosses: its number, and the operand's derivative, 1 over the step.
    integer :: first
    real(dp) :: slope
    real(dp) :: part      !! factor on the step that ended; 0 at the beginning, where omega is exact
    ! Part of the step at which each operand nearly crosses each level; or -1.
    real(dp), allocatable :: touches(:, :)
    integer :: sliding    !! the switch along which the solution slides
    logical, allocatable :: follows(:) !! whether the operand depends on other switches alone
  end type switches_t

  public :: begin_switches, change, find_switches, follow, jump_at, nearness, operand_error, &
            terms_from, update

contains

  pure subroutine find_switches(tape, switches, failed)
    !! Find the switches of a tape.
    type(tape_t), intent(in) :: tape
    type(switches_t), intent(inout) :: switches
    integer, intent(out) :: failed !! not 0 if there is not enough memory
    integer :: i, n

    failed = 0
    switches%n = count(tape%operations(1, :) == SWITCH .or. tape%operations(1, :) == FLOOR_OF)
    if (switches%n == 0) return
    allocate (switches%slots(switches%n), stat=failed)
    if (failed == 0) allocate (switches%operands(switches%n), stat=failed)
    if (failed == 0) allocate (switches%is_floor(switches%n), stat=failed)
    if (failed == 0) allocate (switches%is_turned(switches%n), stat=failed)
    if (failed == 0) allocate (switches%on_level(switches%n), stat=failed)
    if (failed == 0) allocate (switches%crosses(switches%n), stat=failed)
    if (failed == 0) allocate (switches%touches(2, switches%n), stat=failed)
    if (failed == 0) allocate (switches%is_live(switches%n), stat=failed)
    if (failed == 0) allocate (switches%is_new(switches%n), stat=failed)
    if (failed == 0) allocate (switches%operations(4, tape%n_operations), stat=failed)
    if (failed == 0) allocate (switches%matters(tape%n_operations), stat=failed)
    if (failed == 0) allocate (switches%is_discrete(tape%n_operations), stat=failed)
    if (failed == 0) allocate (switches%follows(switches%n), stat=failed)
    if (failed /= 0) return
    switches%is_turned = .false.
    switches%is_live = .false.
    switches%is_new = .false.
    switches%matters = .false.
    i = 0
    do n = 1, tape%n_operations
      if (tape%operations(1, n) /= SWITCH .and. tape%operations(1, n) /= FLOOR_OF) cycle
      i = i + 1
      switches%is_floor(i) = tape%operations(1, n) == FLOOR_OF
      switches%operands(i) = tape%operations(2, n)
      switches%slots(i) = tape%operations(4, n)
    end do
    switches%on_level = 0
    switches%crosses = 0
    call find_discrete(tape, switches)
  end subroutine find_switches

  pure subroutine find_discrete(tape, switches)
    !! Find the operations that depend on the results of switches alone.
    type(tape_t), intent(in) :: tape
    type(switches_t), intent(inout) :: switches
    logical :: of_slot(tape%n_slots)
    integer :: n

    of_slot = .false.
    do n = 1, tape%n_operations
      associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                 starts => tape%starts, slots => tape%slots, &
                 is_discrete => switches%is_discrete)
        select case (tape%operations(1, n))
        case (SWITCH, FLOOR_OF)
          is_discrete(n) = .true.
        case (LINEAR)
          is_discrete(n) = all(of_slot(slots(starts(first):starts(first + 1) - 1)))
        case (PRODUCT)
          is_discrete(n) = of_slot(first) .and. of_slot(second)
        case (SELECT_OF)
          is_discrete(n) = of_slot(first) &
                           .and. all(of_slot(slots(starts(second):starts(second + 2) - 1)))
        case default
          is_discrete(n) = .false.
        end select
        of_slot(tape%operations(4, n)) = is_discrete(n)
      end associate
    end do
    switches%follows = of_slot(switches%operands)
  end subroutine find_discrete

  pure subroutine begin_switches(i, near, switches, s)
    !! Set the result of a switch by the value of its operand. On a level, or as near to one as
    !! `near`, it is that of NumPy, until the derivative of the operand shows the side.
    integer, intent(in) :: i
    real(dp), intent(in) :: near
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s
    real(dp) :: level

    associate (operand => s%a(0, switches%operands(i)), value => s%a(0, switches%slots(i)))
      switches%is_new(i) = .false.
      switches%on_level(i) = 0
      level = 0.0_dp
      if (switches%is_floor(i)) level = anint(operand)
      if (.not. abs(operand) <= huge(operand)) then
        value = 0.0_dp ! the derivatives are not finite
      else if (abs(operand - level) <= near) then
        value = level
        switches%on_level(i) = merge(LOWER, UPPER, switches%is_floor(i))
      else if (switches%is_floor(i)) then
        value = merge(level, level - 1.0_dp, level < operand)
      else
        value = merge(1.0_dp, 0.0_dp, operand > 0.0_dp)
      end if
    end associate
  end subroutine begin_switches

  pure real(dp) function nearness(i, factor, switches, s)
    !! Return the rounding error of an operand at the end of a step.
    integer, intent(in) :: i
    real(dp), intent(in) :: factor !! on the step
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s

    nearness = ROUNDED*size_of(s%a(:s%order - 1, switches%operands(i)), factor)
  end function nearness

  pure subroutine update(switches, s, is_changed)
    !! Change the first switch whose result does not fit term 0 of its operand at the end of a step.
    !! A switch that crosses is changed, unless the change of another switch moved its operand away.
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s
    logical, intent(out) :: is_changed
    real(dp) :: before, near
    integer :: i, level

    is_changed = .true.
    do i = 1, switches%n
      if (.not. switches%is_live(i)) cycle
      near = 0.0_dp
      if (switches%part > 0.0_dp) near = nearness(i, switches%part, switches, s)
      level = switches%crosses(i)
      if (level /= 0) then
        switches%crosses(i) = 0
        if (abs(s%a(0, switches%operands(i)) - level_of(i, level, switches, s)) &
            <= FAR/ROUNDED*near) then
          call change(i, level, switches, s)
        else
          call begin_switches(i, near, switches, s)
        end if
        return
      end if
      if (switches%on_level(i) /= 0) cycle
      before = s%a(0, switches%slots(i))
      call begin_switches(i, near, switches, s)
      if (s%a(0, switches%slots(i)) /= before) return
    end do
    is_changed = .false.
  end subroutine update

  pure subroutine follow(switches, s, is_changed)
    !! Set the results of switches whose operands depend on other switches alone.
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s
    logical, intent(out) :: is_changed
    real(dp) :: before
    integer :: i

    is_changed = .false.
    do i = 1, switches%n
      if (.not. (switches%is_live(i) .and. switches%follows(i))) cycle
      before = s%a(0, switches%slots(i))
      call begin_switches(i, ZERO_TERM*abs(s%a(0, switches%operands(i))), switches, s)
      is_changed = is_changed .or. s%a(0, switches%slots(i)) /= before
    end do
  end subroutine follow

  pure subroutine change(i, level, switches, s)
    !! Change the result of a switch whose operand crosses a level.
    integer, intent(in) :: i, level
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s

    associate (value => s%a(0, switches%slots(i)))
      value = value + jump_at(level)
      switches%on_level(i) = merge(UPPER, LOWER, level == LOWER)
    end associate
  end subroutine change

  pure real(dp) function jump_at(level)
    !! Return what crossing a level adds to the result of a switch.
    integer, intent(in) :: level

    jump_at = merge(-1.0_dp, 1.0_dp, level == LOWER)
  end function jump_at

  pure real(dp) function operand_error(i, switches, s)
    !! Return the distance of an operand's term 0 from the level that it crosses.
    integer, intent(in) :: i
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s

    operand_error = s%a(0, switches%operands(i)) - level_of(i, switches%crosses(i), switches, s)
  end function operand_error

  pure real(dp) function level_of(i, level, switches, s)
    integer, intent(in) :: i, level
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s

    level_of = 0.0_dp
    if (switches%is_floor(i)) then
      level_of = s%a(0, switches%slots(i)) + merge(0.0_dp, 1.0_dp, level == LOWER)
    end if
  end function level_of

  pure function terms_from(i, level, switches, s) result(terms)
    !! Return the terms of an operand, less a level.
    integer, intent(in) :: i, level
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s
    real(dp) :: terms(0:LAST_TERM)

    terms = s%a(:, switches%operands(i))
    terms(0) = terms(0) - level_of(i, level, switches, s)
  end function terms_from

end module tape_switches

module tape_switches
  !! Switches of a tape: operations whose results are constant in a step, because it ends where the
  !! operand crosses one of its levels (Hairer, Norsett and Wanner 1993, section II.6). Term 0 of a
  !! switch is its result: 0 or 1 of SWITCH, a whole number of FLOOR.
  use kinds, only: dp
  use operations, only: FLOOR_OF => FLOOR, LINEAR, PRODUCT, SELECT_OF => SELECT, SWITCH
  use tape, only: tape_t
  use tape_roots, only: first_root, size_of
  use tape_series, only: LAST_TERM, series_t
  implicit none(type, external)
  private

  integer, parameter :: LOWER = 1, UPPER = 2 ! levels on which an operand may be
  integer, parameter, public :: STAYS = 0, CROSSES = 1, SLIDES = 2, IS_CHANGED = 3
  real(dp), parameter :: ZERO_TERM = 1e-13_dp   ! part of the terms that is a rounding error
  real(dp), parameter :: ROUNDED = 1e-14_dp     ! rounding error of an operand, over its terms
  real(dp), parameter :: FAR = 1e-8_dp          ! part of the terms that is no rounding error
  real(dp), parameter :: TOGETHER = 2.0_dp**(-50) ! relative difference of roots that count as one
  integer, parameter :: MOST_CUTS = 100

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

  public :: begin_switches, change, find_switches, follow, jump_at, next_crossing, &
            operand_error, resolve_switches, update

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

  pure subroutine resolve_switches(relative, switches, s, factor)
    !! Reduce the factor on the step until the last terms of all operands are small, or to 0 if they
    !! are not finite.
    real(dp), intent(in) :: relative !! largest of the last two terms, over the sum of all
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s
    real(dp), intent(inout) :: factor
    real(dp) :: total, power, last
    integer :: i, k, tries

    do i = 1, switches%n
      if (.not. switches%is_live(i)) cycle
      do tries = 1, MOST_CUTS
        total = 0.0_dp
        last = 0.0_dp
        power = 1.0_dp
        do k = 0, s%order - 1
          total = total + power*abs(s%a(k, switches%operands(i)))
          if (k >= s%order - 2) last = max(last, power*abs(s%a(k, switches%operands(i))))
          power = factor*power
        end do
        if (.not. total <= huge(total)) then
          factor = 0.0_dp
          return
        end if
        if (.not. last > relative*total) exit
        factor = 0.75_dp*factor
      end do
    end do
  end subroutine resolve_switches

  pure subroutine next_crossing(nearly, switches, s, factor, verdict)
    !! Find the first level that an operand crosses in a step, and shorten the step to it.
    real(dp), intent(in) :: nearly  !! relative distance from a level that counts as a touch
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s
    real(dp), intent(inout) :: factor
    integer, intent(out) :: verdict
    real(dp) :: roots(2, switches%n), terms(0:LAST_TERM), root, touch, before
    integer :: degree, i, level, sign_of_level

    verdict = STAYS
    switches%first = 0
    switches%touches = -1.0_dp
    switches%crosses = 0
    do i = 1, switches%n
      if (.not. (switches%is_live(i) .and. switches%is_new(i))) cycle
      before = s%a(0, switches%slots(i))
      call begin_switches(i, nearness(i, factor, switches, s), switches, s)
      if (s%a(0, switches%slots(i)) /= before) then
        verdict = IS_CHANGED
        return
      end if
    end do
    roots = 2.0_dp*factor
    do i = 1, switches%n
      if (.not. switches%is_live(i)) cycle
      ! The operand may depend on another switch, and no more be on its level.
      if (switches%on_level(i) /= 0) then
        terms = terms_from(i, switches%on_level(i), switches, s)
        if (is_far(i, terms)) then
          call begin_switches(i, nearness(i, factor, switches, s), switches, s)
          verdict = IS_CHANGED
          return
        end if
      end if
      ! The operand may have crossed a level together with another operand.
      do level = LOWER, UPPER
        if (switches%on_level(i) /= 0 .or. .not. has_level(i, level)) cycle
        terms = terms_from(i, level, switches, s)
        if (terms(0) == 0.0_dp) then
          ! The change of another switch moved the operand to the level.
          before = s%a(0, switches%slots(i))
          call begin_switches(i, 0.0_dp, switches, s)
          if (s%a(0, switches%slots(i)) == before) exit
          verdict = IS_CHANGED
          return
        end if
        if ((terms(0) > 0.0_dp) .eqv. (level == LOWER)) cycle
        if (is_far(i, terms)) then
          ! The operand depends on another switch.
          call begin_switches(i, nearness(i, factor, switches, s), switches, s)
          verdict = IS_CHANGED
          return
        end if
        switches%on_level(i) = level
      end do
    end do
    ! All results fit the others now, so that the derivatives of operands are known.
    do i = 1, switches%n
      if (.not. switches%is_live(i)) cycle
      if (switches%on_level(i) /= 0) then
        if (.not. leaves(i)) then
          call turn_back(i, switches, s, verdict)
          if (verdict /= STAYS) return
        end if
      end if
      do level = LOWER, UPPER
        if (.not. has_level(i, level)) cycle
        sign_of_level = merge(1, -1, level == LOWER)
        terms = sign_of_level*terms_from(i, level, switches, s)
        ! The root at the beginning is known, but for rounding.
        degree = s%order - 1
        if (switches%on_level(i) == level) then
          terms(0:degree - 1) = terms(1:degree)
          degree = degree - 1
        end if
        call first_root(terms, degree, factor, nearly, root, touch)
        roots(level, i) = root
        if (root > factor) switches%touches(level, i) = touch
      end do
    end do
    switches%is_turned = .false.
    root = minval(roots)
    if (root > factor) return
    verdict = CROSSES
    do i = 1, switches%n
      do level = LOWER, UPPER
        if (roots(level, i) <= root*(1.0_dp + TOGETHER)) then
          if (switches%first == 0) switches%first = i
          switches%crosses(i) = level
        end if
      end do
    end do
    where (switches%touches > root) switches%touches = -1.0_dp
    factor = root
    switches%slope = slope_at(switches%first, factor)
    ! Two roots that nearly coincide are a touch.
    if (abs(switches%slope)*factor <= sqrt(nearly) &
        *size_of(s%a(:s%order - 1, switches%operands(switches%first)), factor)) then
      switches%touches(switches%crosses(switches%first), switches%first) = factor
    end if

  contains

    pure logical function has_level(i, level)
      integer, intent(in) :: i, level

      has_level = switches%is_floor(i)
      if (.not. has_level) then
        has_level = (s%a(0, switches%slots(i)) > 0.5_dp) .eqv. (level == LOWER)
      end if
    end function has_level

    pure logical function is_far(i, terms)
      !! Return whether an operand less a level is farther from it than rounding explains.
      integer, intent(in) :: i
      real(dp), intent(in) :: terms(0:)

      is_far = abs(terms(0)) > max(FAR*size_of(terms(:s%order - 1), factor), &
                                   nearness(i, factor, switches, s))
    end function is_far

    pure logical function leaves(i)
      !! Return whether an operand on a level moves to the side of its result, or remains where the
      !! result is that of NumPy.
      integer, intent(in) :: i
      real(dp) :: terms(0:LAST_TERM), total, power
      integer :: k

      leaves = switches%on_level(i) == merge(LOWER, UPPER, switches%is_floor(i))
      terms = terms_from(i, switches%on_level(i), switches, s)
      total = 0.0_dp
      power = 1.0_dp
      do k = 1, s%order - 1
        power = power*factor
        terms(k) = power*terms(k)
        total = total + abs(terms(k))
      end do
      do k = 1, s%order - 1
        if (abs(terms(k)) > ZERO_TERM*total) then
          leaves = (terms(k) > 0.0_dp) .eqv. (switches%on_level(i) == LOWER)
          return
        end if
      end do
    end function leaves

    pure real(dp) function slope_at(i, part)
      !! Return the derivative of an operand by the part of the step.
      integer, intent(in) :: i
      real(dp), intent(in) :: part
      integer :: k

      slope_at = 0.0_dp
      do k = s%order - 1, 1, -1
        slope_at = part*slope_at + k*s%a(k, switches%operands(i))
      end do
    end function slope_at

  end subroutine next_crossing

  pure subroutine turn_back(i, switches, s, verdict)
    !! Change the result of a switch whose operand does not move to its side. If it has been changed
    !! before, both sides push towards the level: the solution slides along it.
    integer, intent(in) :: i
    type(switches_t), intent(inout) :: switches
    type(series_t), intent(inout) :: s
    integer, intent(out) :: verdict

    if (switches%is_turned(i)) then
      verdict = SLIDES
      switches%sliding = i
      return
    end if
    verdict = IS_CHANGED
    call change(i, switches%on_level(i), switches, s)
    switches%is_turned(i) = .true.
  end subroutine turn_back

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

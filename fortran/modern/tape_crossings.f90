module tape_crossings
  !! Where operands of switches cross their levels in a step.
  use kinds, only: dp
  use tape_roots, only: first_root, size_of
  use tape_series, only: series_t
  use tape_switches, only: begin_switches, change, FAR, LOWER, nearness, switches_t, terms_from, &
                           UPPER, ZERO_TERM
  use tape_values, only: LAST_TERM
  implicit none(type, external)
  private

  integer, parameter, public :: STAYS = 0, CROSSES = 1, SLIDES = 2, IS_CHANGED = 3
  real(dp), parameter :: TOGETHER = 2.0_dp**(-50) ! relative difference of roots that count as one
  integer, parameter :: MOST_CUTS = 100

  public :: before_crossings, next_crossing, resolve_switches

contains

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

  logical function before_crossings(switches, s, factor)
    !! Return whether an operand whose terms are finite crosses a level after the beginning of a
    !! step, and shorten the step to the first crossing.
    type(switches_t), intent(in) :: switches
    type(series_t), intent(in) :: s
    real(dp), intent(inout) :: factor
    real(dp) :: terms(0:LAST_TERM), root, touch
    integer :: i, level

    before_crossings = .false.
    do i = 1, switches%n
      if (.not. switches%is_live(i)) cycle
      do level = LOWER, UPPER
        terms = terms_from(i, level, switches, s)
        if (terms(0) == 0.0_dp .or. .not. switches%is_floor(i) .and. level == UPPER) cycle
        call first_root(sign(1.0_dp, terms(0))*terms, s%order - 1, factor, 0.0_dp, root, touch)
        if (.not. root < factor) cycle
        factor = root
        before_crossings = .true.
      end do
    end do
  end function before_crossings

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

end module tape_crossings

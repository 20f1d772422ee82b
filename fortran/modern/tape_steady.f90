module tape_steady
  !! Steps of nearly steady motions. A time function that multiplies an unknown near 0 changes
  !! perturbations but not the motion, whose terms do not show whether its series converges.
  use kinds, only: dp
  use operations, only: FLOOR_OF => FLOOR, LINEAR, LOGARITHM => LOG, PRODUCT, QUOTIENT, &
                        SELECT_OF => SELECT, SWITCH, TABLE
  use tape, only: FIRST_UNKNOWN, tape_t, TIME_SLOT
  use tape_growth, only: MOST_UNKNOWNS
  use tape_series, only: BLOCKS_OF_COLUMNS, jacobian_at, series_t, SIDE_BY_SIDE
  implicit none(type, external)
  private

  integer, parameter :: FIRST_LAST = 12, LAST = 15 ! last terms from which the Jacobian is computed
  integer, parameter :: MOST_TRIES = 80
  ! Parts of the step, near those at which the Jacobian is computed.
  real(dp), parameter :: NODES(4) = [0.07_dp, 0.33_dp, 0.67_dp, 0.93_dp]
  ! Largest change of the Jacobian by the last terms, times the step.
  real(dp), parameter :: MOST_CHANGE = 1e-3_dp
  real(dp), parameter :: MOST_VARIATION = 0.2_dp ! the same, from node to node
  ! An unknown is near 0 if its first terms are smaller than this multiple of the local tolerance.
  real(dp), parameter :: MULTIPLE = 1e3_dp
  real(dp), parameter :: LONGER = 1.5_dp ! step, over the last

  public :: find_varying, near_zero, resolving

contains

  subroutine find_varying(tape, slots, n_found)
    !! Find the slots of functions of the time; none if the Jacobian does not depend on the time.
    type(tape_t), intent(in) :: tape
    integer, intent(out) :: slots(:)
    integer, intent(out) :: n_found
    logical :: moves(1 + tape%n_slots)   ! whether a slot depends on the time
    logical :: depends(1 + tape%n_slots) ! whether it depends on an unknown
    logical :: is_varying                ! whether the Jacobian depends on the time
    integer :: i, last_slot, n

    moves = .false.
    depends = .false.
    is_varying = .false.
    n_found = 0
    moves(TIME_SLOT) = .true.
    depends(FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + tape%n_unknowns) = .true.
    do n = 1, tape%n_operations
      associate (kind => tape%operations(1, n), first => tape%operations(2, n), &
                 second => tape%operations(3, n), out => tape%operations(4, n))
        ! An operation may have several slots.
        last_slot = tape%n_slots
        if (n < tape%n_operations) last_slot = tape%operations(4, n + 1) - 1
        select case (kind)
        case (LINEAR)
          call add_combination(out, first)
          cycle
        case (SELECT_OF)
          ! One of the two is chosen; the other has no slots that matter.
          call add_combination(out, second)
          call add_combination(out, second + 1)
          cycle
        case (SWITCH, FLOOR_OF)
          cycle
        case (PRODUCT, QUOTIENT, LOGARITHM:)
          moves(out:last_slot) = moves(first) .or. moves(second)
          depends(out:last_slot) = depends(first) .or. depends(second)
        case (TABLE)
          moves(out) = .true.
        case default
          moves(out:last_slot) = moves(first)
          depends(out:last_slot) = depends(first)
        end select
        is_varying = is_varying .or. (moves(out) .and. depends(out))
        if (kind == PRODUCT .or. kind == QUOTIENT .or. .not. moves(out)) cycle
        do i = out, last_slot
          n_found = n_found + 1
          slots(n_found) = i
        end do
      end associate
    end do
    if (.not. is_varying) n_found = 0

  contains

    subroutine add_combination(out, number)
      integer, intent(in) :: out, number
      integer :: k

      do k = tape%starts(number), tape%starts(number + 1) - 1
        moves(out) = moves(out) .or. moves(tape%slots(k))
        depends(out) = depends(out) .or. depends(tape%slots(k))
      end do
    end subroutine add_combination

  end subroutine find_varying

  pure function near_zero(n, factor, local_tolerance, weights, s) result(near)
    !! Return which unknowns are near 0, relative to their sizes, and do not leave it at once. Where
    !! the step becomes longer, that is near any value, as near 1 in a(t) (1 - x).
    integer, intent(in) :: n       !! number of unknowns
    real(dp), intent(in) :: factor !! on the step
    real(dp), intent(in) :: local_tolerance
    real(dp), intent(in) :: weights(n)
    type(series_t), intent(in) :: s
    logical :: near(n)
    real(dp) :: largest ! of the first terms
    integer :: first, i

    first = merge(1, 0, factor > LONGER)
    do i = 1, n
      largest = maxval(abs(s%a(first:3, FIRST_UNKNOWN - 1 + i)))
      near(i) = weights(i)*largest < MULTIPLE*local_tolerance
    end do
  end function near_zero

  real(dp) function resolving(slots, near, weights, most, s, factor)
    !! Return the factor on the step, reduced until its nodes resolve the Jacobian by unknowns near
    !! 0: until the last terms of some slots change it little, and it changes not much from node to
    !! node.
    integer, intent(in) :: slots(:)
    logical, intent(in) :: near(:) !! unknowns
    real(dp), intent(in) :: weights(:)
    real(dp), intent(in) :: most   !! largest ratio of weights that counts
    type(series_t), intent(inout) :: s
    real(dp), intent(in) :: factor
    real(dp) :: all_terms(SIDE_BY_SIDE, MOST_UNKNOWNS, BLOCKS_OF_COLUMNS, 4)
    real(dp) :: first_terms(SIDE_BY_SIDE, MOST_UNKNOWNS, BLOCKS_OF_COLUMNS, 4)
    real(dp) :: last_terms(FIRST_LAST:LAST, size(slots))
    integer :: i, tries

    do i = 1, size(slots)
      last_terms(:, i) = s%a(FIRST_LAST:LAST, slots(i))
    end do
    resolving = factor
    do tries = 1, MOST_TRIES
      call jacobian_at(s%arrays, s%h, resolving*NODES, all_terms)
      do i = 1, size(slots)
        s%a(FIRST_LAST:LAST, slots(i)) = 0.0_dp
      end do
      call jacobian_at(s%arrays, s%h, resolving*NODES, first_terms)
      do i = 1, size(slots)
        s%a(FIRST_LAST:LAST, slots(i)) = last_terms(:, i)
      end do
      if (difference(all_terms, first_terms) <= MOST_CHANGE &
          .and. difference(all_terms(:, :, :, 2:), all_terms(:, :, :, :3)) <= MOST_VARIATION) return
      resolving = 0.5_dp*resolving
    end do

  contains

    pure real(dp) function difference(one, other)
      !! Return the largest difference of two Jacobians at some nodes, times the step.
      real(dp), intent(in) :: one(:, :, :, :), other(:, :, :, :)
      real(dp) :: ratio, x
      integer :: block, i, j, lane, node

      difference = 0.0_dp
      do j = 1, size(near)
        if (.not. near(j)) cycle
        lane = 1 + mod(j - 1, SIDE_BY_SIDE)
        block = 1 + (j - 1)/SIDE_BY_SIDE
        do i = 1, size(near)
          ! A state of weight 0 may change others.
          ratio = 1.0_dp
          if (min(weights(i), weights(j)) > 0.0_dp) ratio = min(most, weights(i)/weights(j))
          do node = 1, size(one, 4)
            x = resolving*ratio*abs(one(lane, i, block, node) - other(lane, i, block, node))
            ! NaN must not be lost in the maximum.
            if (.not. x <= huge(x)) x = huge(x)
            difference = max(difference, x)
          end do
        end do
      end do
    end function difference

  end function resolving

end module tape_steady

module tape_live
  !! The operations of a tape that matter. An operation in a branch that no SELECT chooses does not
  !! matter, and may be singular: for example 1/t, if it is chosen only for t > 1.
  use, intrinsic :: iso_c_binding, only: c_loc
  use kinds, only: dp
  use operations, only: LINEAR, LOGARITHM => LOG, PRODUCT, QUOTIENT, SELECT_OF => SELECT, TABLE
  use tape, only: arrays_of, tape_t
  use tape_series, only: begin_work, derivatives_at, series_t
  use tape_switches, only: switches_t, update
  use tape_values, only: chosen, value_of
  implicit none(type, external)
  private

  public :: keep_live, settle

contains

  subroutine keep_live(tape, switches, s, live)
    !! Set the tape whose operations are those that matter with the present results of switches.
    type(tape_t), intent(in) :: tape       !! with all operations
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    logical :: is_used(tape%n_slots), matters(tape%n_operations), before
    integer :: i, last, n

    call set_conditions()
    is_used = .false.
    do n = size(tape%constants) - tape%n_unknowns + 1, size(tape%constants)
      call use_combination(n)
    end do
    if (associated(s%forcings)) then
      do i = 1, size(s%forcings, 2)
        do n = 1, size(s%forcings, 1)
          if (s%forcings(n, i) > 0) call use_combination(s%forcings(n, i))
        end do
      end do
    end if
    last = tape%n_slots
    i = switches%n
    do n = tape%n_operations, 1, -1
      associate (kind => tape%operations(1, n), first => tape%operations(2, n), &
                 second => tape%operations(3, n), out => tape%operations(4, n))
        ! An operation may have several slots.
        matters(n) = any(is_used(out:last))
        last = out - 1
        if (i > 0) then
          if (switches%slots(i) == out) then
            before = switches%is_live(i)
            switches%is_live(i) = matters(n)
            switches%is_new(i) = switches%is_new(i) .or. (matters(n) .and. .not. before)
            i = i - 1
          end if
        end if
        if (.not. matters(n)) cycle
        select case (kind)
        case (LINEAR)
          call use_combination(first)
        case (TABLE)
          cycle
        case (SELECT_OF)
          is_used(first) = .true.
          call use_combination(chosen(tape, n, s%a))
        case (PRODUCT, QUOTIENT, LOGARITHM:)
          is_used(first) = .true.
          is_used(second) = .true.
        case default
          is_used(first) = .true.
        end select
      end associate
    end do
    if (all(matters .eqv. switches%matters)) return
    switches%matters = matters
    i = 0
    do n = 1, tape%n_operations
      if (.not. matters(n)) cycle
      i = i + 1
      switches%operations(:, i) = tape%operations(:, n)
    end do
    live = tape
    live%n_operations = i
    live%operations => switches%operations(:, :i)
    call use_operations(live, s)

  contains

    subroutine set_conditions()
      !! Compute what depends on the results of switches alone, such as the condition of a SELECT.
      integer :: n

      do n = 1, tape%n_operations
        if (.not. switches%is_discrete(n)) cycle
        associate (first => tape%operations(2, n), second => tape%operations(3, n), &
                   out => s%a(0, tape%operations(4, n)))
          select case (tape%operations(1, n))
          case (LINEAR)
            out = value_of(tape, first, s%a)
          case (PRODUCT)
            out = s%a(0, first)*s%a(0, second)
          case (SELECT_OF)
            out = value_of(tape, chosen(tape, n, s%a), s%a)
          case default
            cycle
          end select
        end associate
      end do
    end subroutine set_conditions

    subroutine use_combination(number)
      integer, intent(in) :: number
      integer :: k

      do k = tape%starts(number), tape%starts(number + 1) - 1
        is_used(tape%slots(k)) = .true.
      end do
    end subroutine use_combination

  end subroutine keep_live

  subroutine use_operations(live, s)
    !! Compute the terms of the operations of a tape alone.
    type(tape_t), intent(in) :: live
    type(series_t), intent(inout) :: s

    s%arrays = arrays_of(live, c_loc(s%a), s%arrays%v, s%arrays%work)
    call begin_work(s%arrays, live%n_slots)
  end subroutine use_operations

  subroutine settle(tape, t, y, h, switches, s, live, rates)
    !! Change switches until each result is that of its operand, and compute the rates.
    type(tape_t), intent(in) :: tape
    real(dp), intent(in) :: t(2)   !! time and its rounding error, s
    real(dp), intent(in) :: y(:)   !! unknowns
    real(dp), intent(in) :: h      !! points to the side of which the pieces of tables are taken
    type(switches_t), intent(inout), target :: switches
    type(series_t), intent(inout) :: s
    type(tape_t), intent(inout) :: live
    real(dp), intent(out) :: rates(:)
    logical :: is_changed

    if (switches%part == 0.0_dp) then
      live = tape
      switches%matters = .true.
      switches%is_live = .false.
      call use_operations(live, s)
    end if
    is_changed = .true.
    do while (is_changed)
      call keep_live(tape, switches, s, live)
      call derivatives_at(live, t, y, h, s, rates)
      call update(switches, s, is_changed)
    end do
  end subroutine settle

end module tape_live

module taylor_rows
  !! The output of an integration by Taylor series: omega and attitude at the requested times, with
  !! their error subtracted.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use statuses, only: INTERRUPTED, OVERFLOW
  use step_nodes, only: AT_ONCE, nodes_t, sum_at_nodes
  use taylor_attitude, only: add_attitude_row, add_attitudes, attitude_t
  use taylor_error, only: blocks_t, rise
  use taylor_series, only: evaluate, series_t
  implicit none(type, external)
  private

  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**19 ! between polls for an interrupt
  ! Largest relative error for which the linearised equations hold.
  real(dp), parameter :: LINEAR = 0.1_dp

  ! The state of an integration.
  type, public :: state_t
    real(dp) :: w(4)      ! omega, rad/s, and 0
    real(dp) :: w_low(4)  ! rounding error of w
    real(dp) :: t         ! s
    real(dp) :: t_low     ! rounding error of t
    real(dp) :: scale     ! largest |omega| so far, rad/s
    real(dp) :: worst     ! largest error of a row so far, rad/s
    real(dp) :: peak      ! largest error so far, of a row or not, rad/s
    integer :: since      ! steps since the sines of waves were computed; 0: compute them
  end type state_t

  ! Working storage of an integration. A type aligns columns of four to the loads of a register,
  ! which Fortran cannot request of a variable.
  type, public :: room_t
    type(series_t) :: s
    type(blocks_t) :: blocks
    type(state_t) :: now
    type(attitude_t) :: attitude
    type(nodes_t) :: nodes !! where the solution is requested in each step
  end type room_t

  ! The outcome of an integration, beside its rows and status.
  type, public :: outcome_t
    integer(int64) :: steps
    real(dp) :: error    ! largest of a row, relative, before it was subtracted
    real(dp) :: least    ! lower bound, for estimates that are too small, relative
    real(dp) :: growth   ! error amplification until any requested time
    real(dp) :: largest  ! error amplification until any time
    real(dp) :: ahead    ! estimated steps to the end, if the work limit is exceeded
    real(dp) :: turned   ! largest rotation of perturbations, rad
    logical :: finest    ! whether the local tolerance is the smallest
    real(dp) :: way      ! further factor for the attitude, which an error of omega keeps rotating
    real(dp) :: scale = 0.0_dp ! largest |omega|, rad/s
    real(dp) :: unseen = 0.0_dp ! what all estimates of truncation may lack, relative
  end type outcome_t

  public :: add_last_row, add_nodes, add_rows

contains

  subroutine add_rows(room, order, h, at_end, before, left, request, solution)
    !! Compute the rows within the step, except the last of all, from its terms.
    type(room_t), intent(inout) :: room     !! its state and attitude note the largest error
    integer, intent(in) :: order
    real(dp), intent(in) :: h               !! s
    logical, intent(in) :: at_end
    real(dp), intent(in) :: before(3)       !! error at the step's beginning, rad/s
    real(dp), intent(in) :: left(3)         !! truncation error of the step, rad/s
    type(request_t), intent(in) :: request
    type(solution_t), intent(inout) :: solution
    real(dp) :: ends(3, 4)
    real(dp) :: part
    integer :: last

    associate (s => room%s, now => room%now, times => request%times, n_rows => solution%n_rows)
      last = size(times)
      if (at_end) last = last - 1
      if (n_rows >= last) return
      if (abs(times(n_rows + 1) - now%t) > abs(h)) return
      ends = errors_at_ends(s, now, before, left)
      do while (n_rows < last)
        if (abs(times(n_rows + 1) - now%t) > abs(h)) exit
        n_rows = n_rows + 1
        part = ((times(n_rows) - now%t) - now%t_low)/h
        call add_row_within(now, order, part, evaluate(order, s%terms, part), ends, left, &
                            request%tolerance, solution%rows(:, n_rows))
        if (.not. all(abs(solution%rows(:, n_rows)) <= huge(h))) then
          n_rows = n_rows - 1
          solution%status = OVERFLOW
          return
        end if
        if (associated(solution%attitudes)) then
          call add_attitude_row(room%attitude%q_low + evaluate(order, s%turns, part), order, &
                                part, min(LINEAR, request%tolerance), room%attitude, &
                                solution%attitudes(:, n_rows))
        end if
        if (mod(n_rows, ROWS_BETWEEN_LOOKS) == 0) then
          if (interrupt_raised() /= 0) then
            solution%status = INTERRUPTED
            return
          end if
        end if
      end do
    end associate
  end subroutine add_rows

  subroutine add_nodes(room, order, h, before, left, tolerance, solution)
    !! Compute omega and attitude at the nodes of the step. It needs no division by `divide_step`:
    !! the terms of a law that a polynomial leaves out are below 1e-3 tolerances (measured).
    type(room_t), intent(inout) :: room     !! its state and attitude note the largest error
    integer, intent(in) :: order
    real(dp), intent(in) :: h               !! s
    real(dp), intent(in) :: before(3)       !! error at the step's beginning, rad/s
    real(dp), intent(in) :: left(3)         !! truncation error of the step, rad/s
    real(dp), intent(in) :: tolerance
    type(solution_t), intent(inout) :: solution
    real(dp) :: ends(3, 4)
    real(dp) :: changes(AT_ONCE, 4)
    integer :: i

    solution%n_steps = solution%n_steps + 1
    if (solution%n_steps >= size(solution%ends)) return
    associate (s => room%s, now => room%now, n => solution%n_steps, parts => room%nodes%parts, &
               at_nodes => solution%at_nodes)
      solution%ends(n + 1) = now%t + (now%t_low + h)
      if (n > 1) then
        at_nodes(:, 1, n) = at_nodes(:, 1 + AT_ONCE, n - 1)
      else
        at_nodes(:3, 1, 1) = now%w(:3)
        if (associated(solution%attitudes)) at_nodes(4:, 1, 1) = solution%attitudes(:, 0)
      end if
      ends = errors_at_ends(s, now, before, left)
      call sum_at_nodes(s%terms, 4*(order + 1), 4, 1, 3, order, parts, changes(:, :3))
      call add_states(now, room%nodes, changes(:, :3), ends, left, tolerance, at_nodes(:3, 2:, n))
      if (.not. associated(solution%attitudes)) return
      call sum_at_nodes(s%turns, 4*(order + 1), 4, 1, 4, order, parts, changes)
      do i = 1, 4
        changes(:, i) = room%attitude%q_low(i) + changes(:, i)
      end do
      call add_attitudes(changes, room%nodes, min(LINEAR, tolerance), room%attitude, &
                         at_nodes(4:7, 2:, n))
    end associate
  end subroutine add_nodes

  pure subroutine add_states(now, nodes, changes, ends, left, tolerance, rows)
    !! Compute omega within the step, as `add_row_within`, side by side.
    type(state_t), intent(inout) :: now
    type(nodes_t), intent(in) :: nodes
    real(dp), intent(in) :: changes(AT_ONCE, 3) !! from its beginning, rad/s
    real(dp), intent(in) :: ends(3, 4)          !! of errors_at_ends
    real(dp), intent(in) :: left(3)
    real(dp), intent(in) :: tolerance
    real(dp), intent(out) :: rows(:, :)         !! rad/s
    real(dp) :: sizes(AT_ONCE), errors(AT_ONCE, 3), omega(AT_ONCE)
    integer :: i, k

    sizes = 0.0_dp
    do i = 1, 3
      errors(:, i) = (nodes%values(:, 1)*ends(i, 1) + nodes%values(:, 2)*ends(i, 2)) &
                     + (nodes%values(:, 3)*ends(i, 3) + nodes%values(:, 4)*ends(i, 4)) &
                     - nodes%powers*left(i)
      sizes = max(sizes, abs(errors(:, i)))
    end do
    do i = 1, 3
      omega = now%w_low(i) + changes(:, i)
      omega = now%w(i) + merge(omega - errors(:, i), omega, &
                               sizes <= min(LINEAR, tolerance)*now%scale)
      do k = 1, AT_ONCE
        rows(i, k) = omega(k)
      end do
    end do
    do k = 1, AT_ONCE
      if (.not. sizes(k) <= now%worst) now%worst = sizes(k)
    end do
  end subroutine add_states

  pure function errors_at_ends(s, now, before, left) result(ends)
    !! Return the errors of omega at the ends of the step, rad/s, and their rates times the step.
    type(series_t), intent(in) :: s
    type(state_t), intent(in) :: now
    real(dp), intent(in) :: before(3), left(3)
    real(dp) :: ends(3, 4)

    ends(:, 1) = before
    ends(:, 2) = rise(s%factors(:3), now%w(:3), before)
    ends(:, 3) = s%lanes(1, :) + left ! propagated error, without truncation
    ends(:, 4) = rise(s%factors(:3), now%w(:3) + s%change(:3), ends(:, 3))
  end function errors_at_ends

  pure subroutine add_row_within(now, order, part, change, ends, left, tolerance, row)
    !! Compute omega within the step. The error between its ends follows Hermite's cubic.
    type(state_t), intent(inout) :: now
    integer, intent(in) :: order
    real(dp), intent(in) :: part       !! of the step
    real(dp), intent(in) :: change(4)  !! from its beginning, rad/s
    real(dp), intent(in) :: ends(3, 4) !! of errors_at_ends
    real(dp), intent(in) :: left(3)
    real(dp), intent(in) :: tolerance
    real(dp), intent(out) :: row(3)    !! rad/s
    real(dp) :: to_go

    to_go = 1.0_dp - part
    call add_row(now%w(:3), now%w_low(:3) + change(:3), &
                 (to_go*to_go)*((1.0_dp + 2.0_dp*part)*ends(:, 1) + part*ends(:, 2)) &
                 + (part*part)*((1.0_dp + 2.0_dp*to_go)*ends(:, 3) - to_go*ends(:, 4)) &
                 - part**(order + 1)*left, tolerance, now, row)
  end subroutine add_row_within

  pure subroutine add_last_row(room, order, request, solution)
    !! Compute the row at the end of the last step, after omega and attitude have been advanced.
    type(room_t), intent(inout) :: room     !! its state and attitude note the largest error
    integer, intent(in) :: order
    type(request_t), intent(in) :: request
    type(solution_t), intent(inout) :: solution

    solution%n_rows = size(solution%rows, 2)
    associate (now => room%now, n => solution%n_rows)
      call add_row(now%w(:3), now%w_low(:3), room%s%lanes(1, :), request%tolerance, now, &
                   solution%rows(:, n))
      if (associated(solution%attitudes)) then
        call add_attitude_row(room%attitude%q_low, order, 1.0_dp, min(LINEAR, request%tolerance), &
                              room%attitude, solution%attitudes(:, n))
      end if
    end associate
  end subroutine add_last_row

  pure subroutine add_row(w, small, error, tolerance, now, row)
    !! Compute a row. Its error is subtracted if it is small enough to be known: a wrong estimate
    !! then costs no more than the tolerance.
    real(dp), intent(in) :: w(3), small(3) !! their sum is omega, rad/s
    real(dp), intent(in) :: error(3)       !! rad/s
    real(dp), intent(in) :: tolerance
    type(state_t), intent(inout) :: now
    real(dp), intent(out) :: row(3)        !! rad/s
    real(dp) :: size

    size = max(abs(error(1)), abs(error(2)), abs(error(3)))
    if (.not. size <= now%worst) now%worst = size
    if (size <= min(LINEAR, tolerance)*now%scale) then
      row = w + (small - error)
    else
      row = w + small
    end if
  end subroutine add_row

end module taylor_rows

module taylor_rows
  !! What a march of the Taylor series hands over: omega and attitude at the times asked for, their
  !! error taken off.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use statuses, only: INTERRUPTED, OVERFLOW
  use taylor_attitude, only: add_attitude_row, attitude_t
  use taylor_error, only: rise
  use taylor_series, only: evaluate, series_t
  implicit none(type, external)
  private

  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**19 ! at the user
  ! Error, relative, beyond which its linear motion says little.
  real(dp), parameter :: LINEAR = 0.1_dp

  ! Where a run stands.
  type, public :: state_t
    real(dp) :: w(4)      ! omega, rad/s, and 0
    real(dp) :: w_low(4)  ! what its rounding left out
    real(dp) :: t         ! s
    real(dp) :: t_low     ! what its rounding left out
    real(dp) :: scale     ! largest |omega| so far, rad/s
    real(dp) :: worst     ! largest error of a row so far, rad/s
    real(dp) :: peak      ! largest error so far, of a row or not, rad/s
    integer :: since      ! steps since the waves' sines were made; 0: to be made
  end type state_t

  ! What a march came to.
  type, public :: outcome_t
    integer :: status
    integer :: n_rows
    integer(int64) :: steps
    real(dp) :: error    ! largest of a row, relative, before it was taken off
    real(dp) :: least    ! what the error may be where it is estimated to be less, relative
    real(dp) :: growth   ! of a perturbation until any time requested
    real(dp) :: largest  ! of a perturbation until any time
    real(dp) :: ahead    ! steps to the end, as far as known; where it gave up
    real(dp) :: precise_steps ! to the end, at the least, of a march that is precise
    logical :: finest    ! no step could err less
    real(dp) :: way      ! how much more the attitude grows: an error of omega turns it all the way
    real(dp) :: scale = 0.0_dp ! largest |omega|, rad/s
  end type outcome_t

  public :: add_last_row, add_rows

contains

  subroutine add_rows(s, order, h, at_end, before, left, times, tolerance, now, attitude, rows, &
                      n_attitudes, attitudes, found)
    !! Rows within the step, but for the last of all, from its terms; the error by Hermite's cubic.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: h               !! s
    logical, intent(in) :: at_end
    real(dp), intent(in) :: before(3)       !! the error at the step's beginning, rad/s
    real(dp), intent(in) :: left(3)         !! what the step left out, rad/s
    real(dp), intent(in) :: times(:)        !! s
    real(dp), intent(in) :: tolerance
    type(state_t), intent(inout) :: now
    type(attitude_t), intent(inout) :: attitude
    real(dp), intent(inout) :: rows(:, :)
    integer, intent(in) :: n_attitudes
    real(dp), intent(inout) :: attitudes(4, 0:n_attitudes)
    type(outcome_t), intent(inout) :: found !! its rows and its status
    real(dp) :: rises(3, 2)  ! of the error at either end, times the step
    real(dp) :: carried(3)   ! the error at the end, but for what the step left out
    real(dp) :: change(4)    ! of omega, rad/s
    real(dp) :: part, to_go
    integer :: last

    last = size(times)
    if (at_end) last = last - 1
    if (found%n_rows >= last) return
    if (abs(times(found%n_rows + 1) - now%t) > abs(h)) return
    rises(:, 1) = rise(s%factors(:3), now%w(:3), before)
    carried = s%lanes(1, :) + left
    rises(:, 2) = rise(s%factors(:3), now%w(:3) + s%change(:3), carried)
    do while (found%n_rows < last)
      if (abs(times(found%n_rows + 1) - now%t) > abs(h)) exit
      part = ((times(found%n_rows + 1) - now%t) - now%t_low)/h
      to_go = 1.0_dp - part
      change = evaluate(order, s%terms, part)
      call add_row(now%w(:3), now%w_low(:3) + change(:3), &
                   (to_go*to_go)*((1.0_dp + 2.0_dp*part)*before + part*rises(:, 1)) &
                   + (part*part)*((1.0_dp + 2.0_dp*to_go)*carried - to_go*rises(:, 2)) &
                   - part**(order + 1)*left, tolerance, now, rows(:, found%n_rows + 1))
      if (.not. all(abs(rows(:, found%n_rows + 1)) <= huge(h))) then
        found%status = OVERFLOW
        return
      end if
      if (n_attitudes > 0) then
        call add_attitude_row(attitude%q_low + evaluate(order, s%turns, part), order, part, &
                              min(LINEAR, tolerance), attitude, &
                              attitudes(:, found%n_rows + 1))
      end if
      found%n_rows = found%n_rows + 1
      if (mod(found%n_rows, ROWS_BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) then
          found%status = INTERRUPTED
          return
        end if
      end if
    end do
  end subroutine add_rows

  pure subroutine add_last_row(error, order, tolerance, now, attitude, rows, n_attitudes, &
                               attitudes, found)
    !! The row at the end of the last step, once omega and attitude are there.
    real(dp), intent(in) :: error(3)        !! rad/s
    integer, intent(in) :: order
    real(dp), intent(in) :: tolerance
    type(state_t), intent(inout) :: now
    type(attitude_t), intent(inout) :: attitude
    real(dp), intent(inout) :: rows(:, :)
    integer, intent(in) :: n_attitudes
    real(dp), intent(inout) :: attitudes(4, 0:n_attitudes)
    type(outcome_t), intent(inout) :: found !! its rows

    found%n_rows = size(rows, 2)
    call add_row(now%w(:3), now%w_low(:3), error, tolerance, now, rows(:, found%n_rows))
    if (n_attitudes > 0) then
      call add_attitude_row(attitude%q_low, order, 1.0_dp, min(LINEAR, tolerance), attitude, &
                            attitudes(:, found%n_rows))
    end if
  end subroutine add_last_row

  pure subroutine add_row(w, small, error, tolerance, now, row)
    !! A row, its error taken off where it is small enough to be known: an estimate that is wrong
    !! costs no more than the tolerance.
    real(dp), intent(in) :: w(3), small(3) !! whose sum is omega, rad/s
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

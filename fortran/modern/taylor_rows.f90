module taylor_rows
  !! The output of an integration by Taylor series: omega and attitude at the requested times, with
  !! their error subtracted.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use statuses, only: INTERRUPTED, OVERFLOW
  use taylor_attitude, only: add_attitude_row, attitude_t
  use taylor_error, only: rise
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

  ! The outcome of an integration.
  type, public :: outcome_t
    integer :: status
    integer :: n_rows
    integer(int64) :: steps
    real(dp) :: error    ! largest of a row, relative, before it was subtracted
    real(dp) :: least    ! lower bound, for estimates that are too small, relative
    real(dp) :: growth   ! error amplification until any requested time
    real(dp) :: largest  ! error amplification until any time
    real(dp) :: ahead    ! estimated steps to the end, if the work limit is exceeded
    real(dp) :: precise_steps ! fewest steps to the end of a precise integration
    logical :: finest    ! whether the local tolerance is the smallest
    real(dp) :: way      ! further factor for the attitude, which an error of omega keeps rotating
    real(dp) :: scale = 0.0_dp ! largest |omega|, rad/s
  end type outcome_t

  public :: add_last_row, add_rows

contains

  subroutine add_rows(s, order, h, at_end, before, left, times, tolerance, now, attitude, rows, &
                      n_attitudes, attitudes, found)
    !! Compute the rows within the step, except the last of all, from its terms. The error between
    !! the ends of the step follows Hermite's cubic.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: h               !! s
    logical, intent(in) :: at_end
    real(dp), intent(in) :: before(3)       !! error at the step's beginning, rad/s
    real(dp), intent(in) :: left(3)         !! truncation error of the step, rad/s
    real(dp), intent(in) :: times(:)        !! s
    real(dp), intent(in) :: tolerance
    type(state_t), intent(inout) :: now
    type(attitude_t), intent(inout) :: attitude
    real(dp), intent(inout) :: rows(:, :)
    integer, intent(in) :: n_attitudes
    real(dp), intent(inout) :: attitudes(4, 0:n_attitudes)
    type(outcome_t), intent(inout) :: found !! n_rows and status change
    real(dp) :: rises(3, 2)  ! rate of the error at either end, times the step
    real(dp) :: carried(3)   ! propagated error at the end, without truncation, rad/s
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
    !! Compute the row at the end of the last step, after omega and attitude have been advanced.
    real(dp), intent(in) :: error(3)        !! rad/s
    integer, intent(in) :: order
    real(dp), intent(in) :: tolerance
    type(state_t), intent(inout) :: now
    type(attitude_t), intent(inout) :: attitude
    real(dp), intent(inout) :: rows(:, :)
    integer, intent(in) :: n_attitudes
    real(dp), intent(inout) :: attitudes(4, 0:n_attitudes)
    type(outcome_t), intent(inout) :: found !! n_rows changes

    found%n_rows = size(rows, 2)
    call add_row(now%w(:3), now%w_low(:3), error, tolerance, now, rows(:, found%n_rows))
    if (n_attitudes > 0) then
      call add_attitude_row(attitude%q_low, order, 1.0_dp, min(LINEAR, tolerance), attitude, &
                            attitudes(:, found%n_rows))
    end if
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

module taylor_attitude
  !! Attitude beside omega: q' = q (0, omega)/2, q scalar first, from body to space. Its terms by a
  !! recurrence like that of omega, its error as a small turn in space, taken off the rows.
  use, intrinsic :: iso_c_binding, only: c_int
  use kinds, only: dp
  use series, only: MOST_ORDER
  use taylor_error, only: rise, take_thirds
  use taylor_series, only: expand, MORE_TURNS, series_t
  use two_words, only: two_sum
  implicit none(type, external)
  private

  ! Where an attitude stands.
  type, public :: attitude_t
    real(dp) :: q(4)
    real(dp) :: q_low(4)  !! what its rounding left out
    real(dp) :: error(3)  !! half the turn, about axes of space, by which it errs
    real(dp) :: before(3) !! the same where the step began
    real(dp) :: ends(4, 2)  !! the attitude where the step began, and where it ended
    ! What omega's error turns, and how that changes, were it all along as it is at either end: half
    ! a turn a step, about the axes of the body.
    real(dp) :: rates(3, 2)
    real(dp) :: slopes(3, 2)
    real(dp) :: left(4)   !! terms that the step leaves out
    real(dp) :: worst     !! largest error of a row so far, rad
    real(dp) :: peak      !! half the largest error so far, of a row or not, rad
  end type attitude_t

  public :: add_attitude_row, begin_attitude, expand_both, turn_error, turn_on

contains

  ! unroll: expand_both
  subroutine expand_both(order, s)
    !! The terms of omega as by `expand`, those of the attitude and two more, and the sum without.
    integer(c_int), intent(in), value :: order
    type(series_t), intent(inout) :: s   !! turns(:, 0) and half are given too
    real(dp) :: parts(4, 3, 0:MOST_ORDER + MORE_TURNS) ! of each term, times the units of the axes
    real(dp) :: sums(4)
    integer :: i, j, k

    call expand(order, s)
    s%turn = 0.0_dp
    do k = 1, order + MORE_TURNS
      call times_units(s%turns(:, k - 1), s%half(1), parts(:, :, k - 1))
      sums = 0.0_dp
      do j = max(0, k - 1 - order), k - 1
        do i = 1, 4
          sums(i) = sums(i) + ((parts(i, 1, j)*s%terms(1, k - 1 - j) &
                                + parts(i, 2, j)*s%terms(2, k - 1 - j)) &
                               + parts(i, 3, j)*s%terms(3, k - 1 - j))
        end do
      end do
      s%turns(:, k) = sums*(1.0_dp/real(k, dp))
    end do
    do k = order, 1, -1
      s%turn = s%turn + s%turns(:, k)
    end do
  end subroutine expand_both
  ! end unroll

  pure subroutine times_units(q, factor, parts)
    !! q times the unit of each axis, times a factor.
    real(dp), intent(in) :: q(4), factor
    real(dp), intent(out) :: parts(4, 3)

    parts(:, 1) = factor*[-q(2), q(1), q(4), -q(3)]
    parts(:, 2) = factor*[-q(3), -q(4), q(1), q(2)]
    parts(:, 3) = factor*[-q(4), q(3), -q(2), q(1)]
  end subroutine times_units

  pure subroutine begin_attitude(q, now)
    real(dp), intent(in) :: q(4)
    type(attitude_t), intent(out) :: now

    now = attitude_t(q, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                     0.0_dp, 0.0_dp)
  end subroutine begin_attitude

  pure subroutine turn_error(s, order, from_rest, before, carried, now)
    !! The error at the end of the step: what that of omega turns, by Hermite's cubic, and what the
    !! step leaves out of the attitude itself: where omega is steady that is all there is.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    logical, intent(in) :: from_rest   !! the first step of a body at rest
    real(dp), intent(in) :: before(3)  !! error of omega where the step begins, rad/s
    real(dp), intent(in) :: carried(3) !! and where it ends, but for what it leaves out, rad/s
    type(attitude_t), intent(inout) :: now
    real(dp) :: q(4)

    now%before = now%error
    q = now%q + s%turn
    ! The next two terms are most of what is left out. A pair of poles could not tell those of a
    ! turn that begins at no speed: its every second term is at right angles to the one before.
    now%left = s%turns(:, order + 1) + s%turns(:, order + 2)
    if (from_rest) call take_thirds(order + MORE_TURNS, s%turns, 1.0_dp, now%left)
    now%ends(:, 1) = now%q
    now%ends(:, 2) = q
    call rate_of_turn(s, s%terms(:3, 0), before, now%rates(:, 1), now%slopes(:, 1))
    call rate_of_turn(s, s%terms(:3, 0) + s%change(:3), carried, now%rates(:, 2), now%slopes(:, 2))
    now%error = error_within(now, order, 1.0_dp, q)
  end subroutine turn_error

  pure subroutine rate_of_turn(s, w, error, rate, slope)
    !! How fast an error of omega turns the attitude, and how that changes about axes of space.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: w(3)      !! omega, rad/s
    real(dp), intent(in) :: error(3)  !! of omega, rad/s
    real(dp), intent(out) :: rate(3), slope(3) !! about the axes of the body
    real(dp) :: change(3) ! of the error, over the step

    change = rise(s%factors(:3), w, error)
    change(1) = change(1) + 2.0_dp*s%half(1)*(w(2)*error(3) - w(3)*error(2))
    change(2) = change(2) + 2.0_dp*s%half(1)*(w(3)*error(1) - w(1)*error(3))
    change(3) = change(3) + 2.0_dp*s%half(1)*(w(1)*error(2) - w(2)*error(1))
    rate = s%half(1)*error
    slope = s%half(1)*change
  end subroutine rate_of_turn

  pure function error_within(now, order, part, q) result(error)
    !! Half the turn by which an attitude q within the step errs, about axes of space.
    type(attitude_t), intent(in) :: now
    integer, intent(in) :: order
    real(dp), intent(in) :: part !! of the step
    real(dp), intent(in) :: q(4)
    real(dp) :: error(3)
    real(dp) :: square, cube, fourth ! powers of the part

    square = part*part
    cube = square*part
    fourth = part*cube
    error = now%before &
            + in_space(now%ends(:, 1), (part - cube + 0.5_dp*fourth)*now%rates(:, 1) &
                       + (0.5_dp*square - 2.0_dp/3.0_dp*cube + 0.25_dp*fourth)*now%slopes(:, 1)) &
            + in_space(now%ends(:, 2), (cube - 0.5_dp*fourth)*now%rates(:, 2) &
                       + (0.25_dp*fourth - cube/3.0_dp)*now%slopes(:, 2)) &
            - part**(order + 1)*left_turn(now%left, q)
  end function error_within

  pure subroutine turn_on(s, now)
    !! To the end of the step.
    type(series_t), intent(in) :: s
    type(attitude_t), intent(inout) :: now
    integer :: i

    do i = 1, 4
      call two_sum((now%q(i)), s%turn(i) + now%q_low(i), now%q(i), now%q_low(i))
    end do
  end subroutine turn_on

  pure subroutine add_attitude_row(small, order, part, known, now, row)
    !! A row, its error taken off where it is small enough to be known; of length 1.
    real(dp), intent(in) :: small(4) !! what is added to the attitude
    integer, intent(in) :: order
    real(dp), intent(in) :: part     !! of the step
    real(dp), intent(in) :: known    !! error that may be taken off, rad
    type(attitude_t), intent(inout) :: now
    real(dp), intent(out) :: row(4)
    real(dp) :: error(3), size

    row = now%q + small
    error = error_within(now, order, part, row)
    size = 2.0_dp*sqrt(dot_product(error, error))
    if (.not. size <= now%worst) now%worst = size
    if (size <= known) row = now%q + (small - from_left(error, row))
    row = row/sqrt(dot_product(row, row))
  end subroutine add_attitude_row

  pure function from_left(v, q) result(r)
    !! (0, v) q
    real(dp), intent(in) :: v(3), q(4)
    real(dp) :: r(4)

    r(1) = -(v(1)*q(2) + v(2)*q(3) + v(3)*q(4))
    r(2) = v(1)*q(1) + v(2)*q(4) - v(3)*q(3)
    r(3) = v(2)*q(1) + v(3)*q(2) - v(1)*q(4)
    r(4) = v(3)*q(1) + v(1)*q(3) - v(2)*q(2)
  end function from_left

  pure function left_turn(p, q) result(v)
    !! The vector of p times the conjugate of q.
    real(dp), intent(in) :: p(4), q(4)
    real(dp) :: v(3)

    v(1) = p(2)*q(1) - p(1)*q(2) + p(4)*q(3) - p(3)*q(4)
    v(2) = p(3)*q(1) - p(1)*q(3) + p(2)*q(4) - p(4)*q(2)
    v(3) = p(4)*q(1) - p(1)*q(4) + p(3)*q(2) - p(2)*q(3)
  end function left_turn

  pure function in_space(q, v) result(u)
    !! A vector of the body about the axes of space: q (0, v) times the conjugate of q.
    real(dp), intent(in) :: q(4), v(3)
    real(dp) :: u(3)
    real(dp) :: x, y, z ! twice the vector of q across v

    x = 2.0_dp*(q(3)*v(3) - q(4)*v(2))
    y = 2.0_dp*(q(4)*v(1) - q(2)*v(3))
    z = 2.0_dp*(q(2)*v(2) - q(3)*v(1))
    u(1) = v(1) + q(1)*x + (q(3)*z - q(4)*y)
    u(2) = v(2) + q(1)*y + (q(4)*x - q(2)*z)
    u(3) = v(3) + q(1)*z + (q(2)*y - q(3)*x)
  end function in_space

end module taylor_attitude

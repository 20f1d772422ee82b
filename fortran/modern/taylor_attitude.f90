module taylor_attitude
  !! Attitude beside omega: q' = q (0, omega)/2, with q scalar first, from body to space. Its terms
  !! come from a recurrence like that of omega. Its error is a small rotation in space, which is
  !! subtracted from the rows.
  use, intrinsic :: iso_c_binding, only: c_int
  use kinds, only: dp
  use series, only: MOST_ORDER
  use step_nodes, only: AT_ONCE, nodes_t
  use taylor_error, only: rise, take_thirds
  use taylor_series, only: expand, MORE_TURNS, series_t
  use two_words, only: two_sum
  implicit none(type, external)
  private

  ! The state of the attitude during an integration.
  type, public :: attitude_t
    real(dp) :: q(4)
    ! q: the attitude where the step begins, scalar first
    real(dp) :: q_low(4)  !! rounding error of q
    real(dp) :: error(3)  !! half the rotation, about axes of space, by which q is wrong
    real(dp) :: before(3) !! the same where the step began
    real(dp) :: ends(4, 2)  !! the attitude where the step began, and where it ended
    ! Rotation rate that the error of omega causes, and its change, for the error at either end of
    ! the step: half the rotation per step, about the axes of the body.
    real(dp) :: rates(3, 2)
    real(dp) :: slopes(3, 2)
    real(dp) :: left(4)   !! truncation error of the step
    real(dp) :: worst     !! largest error of a row so far, rad
    real(dp) :: peak      !! half the largest error so far, of a row or not, rad
  end type attitude_t

  public :: add_attitude_row, add_attitudes, begin_attitude, expand_both, turn_error, turn_on

contains

  ! unroll: expand_both
  subroutine expand_both(order, s)
    !! Compute the terms of omega as `expand` does, those of the attitude and two more, and the sum
    !! without these two.
    integer(c_int), intent(in), value :: order
    type(series_t), intent(inout) :: s   !! turns(:, 0) and half are inputs too
    real(dp) :: parts(4, 3, 0:MOST_ORDER + MORE_TURNS) ! each term times the units of the axes
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
      s%turns(:, k) = sums/real(k, dp)
    end do
    do k = order, 1, -1
      s%turn = s%turn + s%turns(:, k)
    end do
  end subroutine expand_both
  ! end unroll

  pure subroutine times_units(q, factor, parts)
    !! Compute q times the unit quaternion of each axis, times a factor.
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
    !! Compute the error at the end of the step. It is the rotation that the error of omega causes,
    !! by Hermite's cubic, plus the truncation error of the attitude itself. If omega is steady,
    !! only the latter exists.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    logical, intent(in) :: from_rest   !! the first step of a body at rest
    real(dp), intent(in) :: before(3)  !! error of omega where the step begins, rad/s
    real(dp), intent(in) :: carried(3) !! the same where it ends, without truncation, rad/s
    type(attitude_t), intent(inout) :: now
    real(dp) :: q(4)

    now%before = now%error
    q = now%q + s%turn
    ! The next two terms are most of the truncation error. A fit of a pair of poles would fail for a
    ! rotation that starts from rest: every second term is at right angles to the one before.
    now%left = s%turns(:, order + 1) + s%turns(:, order + 2)
    if (from_rest) call take_thirds(order + MORE_TURNS, s%turns, 1.0_dp, now%left)
    now%ends(:, 1) = now%q
    now%ends(:, 2) = q
    call rate_of_turn(s, s%terms(:3, 0), before, now%rates(:, 1), now%slopes(:, 1))
    call rate_of_turn(s, s%terms(:3, 0) + s%change(:3), carried, now%rates(:, 2), now%slopes(:, 2))
    now%error = error_within(now, order, 1.0_dp, q)
  end subroutine turn_error

  pure subroutine rate_of_turn(s, w, error, rate, slope)
    !! Compute the rate at which an error of omega rotates the attitude, and the change of that rate
    !! about axes of space.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: w(3)      !! omega, rad/s
    real(dp), intent(in) :: error(3)  !! of omega, rad/s
    real(dp), intent(out) :: rate(3), slope(3) !! about the axes of the body
    real(dp) :: change(3) ! change of the error over the step

    change = rise(s%factors(:3), w, error)
    change(1) = change(1) + 2.0_dp*s%half(1)*(w(2)*error(3) - w(3)*error(2))
    change(2) = change(2) + 2.0_dp*s%half(1)*(w(3)*error(1) - w(1)*error(3))
    change(3) = change(3) + 2.0_dp*s%half(1)*(w(1)*error(2) - w(2)*error(1))
    rate = s%half(1)*error
    slope = s%half(1)*change
  end subroutine rate_of_turn

  pure function error_within(now, order, part, q) result(error)
    !! Compute half the rotation, about axes of space, by which an attitude q within the step is
    !! wrong.
    type(attitude_t), intent(in) :: now
    integer, intent(in) :: order
    real(dp), intent(in) :: part !! fraction of the step
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
    !! Advance the attitude to the end of the step.
    type(series_t), intent(in) :: s
    type(attitude_t), intent(inout) :: now
    integer :: i

    do i = 1, 4
      call two_sum((now%q(i)), s%turn(i) + now%q_low(i), now%q(i), now%q_low(i))
    end do
  end subroutine turn_on

  pure subroutine add_attitude_row(small, order, part, known, now, row)
    !! Compute a row, of unit norm. Its error is subtracted if it is small enough to be known.
    real(dp), intent(in) :: small(4) !! added to the attitude
    integer, intent(in) :: order
    real(dp), intent(in) :: part     !! fraction of the step
    real(dp), intent(in) :: known    !! largest error that may be subtracted, rad
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

  pure subroutine add_attitudes(small, nodes, known, now, rows)
    !! Compute attitudes within the step, as `add_attitude_row`, side by side.
    real(dp), intent(in) :: small(AT_ONCE, 4) !! added to the attitude
    type(nodes_t), intent(in) :: nodes
    real(dp), intent(in) :: known             !! largest error that may be subtracted, rad
    type(attitude_t), intent(inout) :: now
    real(dp), intent(out) :: rows(:, :)
    real(dp) :: turns(3, 4), v(AT_ONCE, 3), q(AT_ONCE, 4), r(AT_ONCE, 4)
    real(dp) :: sizes(AT_ONCE), norms(AT_ONCE)
    integer :: i, k

    turns(:, 1) = in_space(now%ends(:, 1), now%rates(:, 1))
    turns(:, 2) = in_space(now%ends(:, 1), now%slopes(:, 1))
    turns(:, 3) = in_space(now%ends(:, 2), now%rates(:, 2))
    turns(:, 4) = in_space(now%ends(:, 2), now%slopes(:, 2))
    do i = 1, 4
      q(:, i) = now%q(i) + small(:, i)
    end do
    associate (p => now%left)
      v(:, 1) = p(2)*q(:, 1) - p(1)*q(:, 2) + p(4)*q(:, 3) - p(3)*q(:, 4)
      v(:, 2) = p(3)*q(:, 1) - p(1)*q(:, 3) + p(2)*q(:, 4) - p(4)*q(:, 2)
      v(:, 3) = p(4)*q(:, 1) - p(1)*q(:, 4) + p(3)*q(:, 2) - p(2)*q(:, 3)
    end associate
    do i = 1, 3
      v(:, i) = now%before(i) &
                + (nodes%integrals(:, 1)*turns(i, 1) + nodes%integrals(:, 2)*turns(i, 2)) &
                + (nodes%integrals(:, 3)*turns(i, 3) + nodes%integrals(:, 4)*turns(i, 4)) &
                - nodes%powers*v(:, i)
    end do
    sizes = 2.0_dp*sqrt(v(:, 1)*v(:, 1) + v(:, 2)*v(:, 2) + v(:, 3)*v(:, 3))
    r(:, 1) = -(v(:, 1)*q(:, 2) + v(:, 2)*q(:, 3) + v(:, 3)*q(:, 4))
    r(:, 2) = v(:, 1)*q(:, 1) + v(:, 2)*q(:, 4) - v(:, 3)*q(:, 3)
    r(:, 3) = v(:, 2)*q(:, 1) + v(:, 3)*q(:, 2) - v(:, 1)*q(:, 4)
    r(:, 4) = v(:, 3)*q(:, 1) + v(:, 1)*q(:, 3) - v(:, 2)*q(:, 2)
    do i = 1, 4
      q(:, i) = merge(now%q(i) + (small(:, i) - r(:, i)), q(:, i), sizes <= known)
    end do
    norms = 1.0_dp/sqrt(q(:, 1)*q(:, 1) + q(:, 2)*q(:, 2) + q(:, 3)*q(:, 3) + q(:, 4)*q(:, 4))
    do i = 1, 4
      q(:, i) = q(:, i)*norms
      do k = 1, AT_ONCE
        rows(i, k) = q(k, i)
      end do
    end do
    do k = 1, AT_ONCE
      if (.not. sizes(k) <= now%worst) now%worst = sizes(k)
    end do
  end subroutine add_attitudes

  pure function from_left(v, q) result(r)
    !! Compute (0, v) q.
    real(dp), intent(in) :: v(3), q(4)
    real(dp) :: r(4)

    r(1) = -(v(1)*q(2) + v(2)*q(3) + v(3)*q(4))
    r(2) = v(1)*q(1) + v(2)*q(4) - v(3)*q(3)
    r(3) = v(2)*q(1) + v(3)*q(2) - v(1)*q(4)
    r(4) = v(3)*q(1) + v(1)*q(3) - v(2)*q(2)
  end function from_left

  pure function left_turn(p, q) result(v)
    !! Compute the vector part of p times the conjugate of q.
    real(dp), intent(in) :: p(4), q(4)
    real(dp) :: v(3)

    v(1) = p(2)*q(1) - p(1)*q(2) + p(4)*q(3) - p(3)*q(4)
    v(2) = p(3)*q(1) - p(1)*q(3) + p(2)*q(4) - p(4)*q(2)
    v(3) = p(4)*q(1) - p(1)*q(4) + p(3)*q(2) - p(2)*q(3)
  end function left_turn

  pure function in_space(q, v) result(u)
    !! Compute a vector of the body about the axes of space: q (0, v) times the conjugate of q.
    real(dp), intent(in) :: q(4), v(3)
    real(dp) :: u(3)
    real(dp) :: x, y, z ! twice the cross product of the vector part of q and v

    x = 2.0_dp*(q(3)*v(3) - q(4)*v(2))
    y = 2.0_dp*(q(4)*v(1) - q(2)*v(3))
    z = 2.0_dp*(q(2)*v(2) - q(3)*v(1))
    u(1) = v(1) + q(1)*x + (q(3)*z - q(4)*y)
    u(2) = v(2) + q(1)*y + (q(4)*x - q(2)*z)
    u(3) = v(3) + q(1)*z + (q(2)*y - q(3)*x)
  end function in_space

end module taylor_attitude

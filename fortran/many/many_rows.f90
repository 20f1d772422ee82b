module many_rows
  !! Results of bodies under torque at times within their steps, beside many_taylor.f90: of omega by
  !! the series of the latest step, and of the attitude, which many_attitudes.f90 advances later, in
  !! the step before.
  use bodies, only: bodies_t, last_row, put_attitude
  use kinds, only: dp
  use many_attitudes, only: attitudes_t, less_rotated, product_of, rotated
  use many_slots, only: LEAST, SLOTS, slots_t
  implicit none(type, external)
  private

  real(dp), parameter, public :: ROUNDING = 2.0_dp**(-53)
  ! Factors that make the stated error larger than the true one in all but a few of 10,000 bodies:
  ! on the subtracted errors of omega and attitude, and on the last terms.
  real(dp), parameter :: WRONG = 2.0_dp, UNSEEN = 0.1_dp
  real(dp), parameter, public :: WRONG_ANGLE = 4.0_dp
  real(dp), parameter :: ROUNDINGS = 4.0_dp  ! of omega that add up before they are amplified

  type, public :: rows_t
    !! The beginnings of steps, and the number of the next row of each slot.
    real(dp), dimension(SLOTS, 3) :: w, low, error !! of the latest step
    real(dp), dimension(SLOTS) :: t, h             !! its time, and the step before it, s
    integer :: next(SLOTS)
    ! The same of attitudes.
    real(dp) :: q(SLOTS, 4)         !! where the step before the latest begins
    real(dp) :: stretch(SLOTS)      !! of this step: see attitudes_t
    real(dp) :: turned(SLOTS, 3)    !! what is wrong in now%q before the step, rad
    integer :: next_turned(SLOTS)
  end type rows_t

  type :: span_t
    !! A part of a step in which one series of the attitude is summed.
    real(dp) :: q(4)          !! attitude where the series begins
    real(dp) :: begin, unit   !! time there, and that in which the distance is 1, s
    real(dp) :: until         !! last time, s
    real(dp) :: from, length  !! of the step, s
    real(dp), dimension(3) :: before, after !! rotations by which q is wrong at its ends, rad
    real(dp) :: error         !! estimate of the error, rad
  end type span_t

  public :: begin_rows, error_of, put_last_rows, put_rows, put_turned_rows, remember_rows

contains

  pure subroutine begin_rows(i, r)
    !! Put a body into slot i.
    integer, intent(in) :: i
    type(rows_t), intent(inout) :: r

    r%next(i) = 1
    r%next_turned(i) = 1
    r%turned(i, :) = 0.0_dp
  end subroutine begin_rows

  pure subroutine remember_rows(s, now, is_turned, r)
    !! Keep what the next step will replace.
    type(slots_t), intent(in) :: s
    type(attitudes_t), intent(in) :: now
    logical, intent(in) :: is_turned
    type(rows_t), intent(inout) :: r

    r%w = s%w
    r%low = s%low
    r%error = s%error
    r%t = s%t
    r%h = s%h
    if (.not. is_turned) return
    r%q = now%q
    r%stretch = now%stretch
  end subroutine remember_rows

  subroutine put_rows(bodies, order, n_slots, body, s, r)
    !! Compute omega of each slot's body at the requested times within its latest step.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: order, n_slots, body(SLOTS)
    type(slots_t), intent(in) :: s
    type(rows_t), intent(inout) :: r
    real(dp) :: part, share, per_unit, per_step, x, y, z, error
    integer :: i, k, row, place
    logical :: is_estimated

    is_estimated = size(bodies%estimate_rows, 3) > 0
    do i = 1, n_slots
      if (body(i) == 0) cycle
      row = r%next(i)
      if (.not. is_due(bodies, row, s%t(i))) cycle
      per_unit = 1.0_dp/r%h(i)
      per_step = 1.0_dp/(s%t(i) - r%t(i))
      if (is_estimated) error = error_of(s, i)
      do while (is_due(bodies, row, s%t(i)))
        part = (bodies%row_times(row) - r%t(i))*per_unit
        share = (bodies%row_times(row) - r%t(i))*per_step
        x = s%torque(i, 1, order)
        y = s%torque(i, 2, order)
        z = s%torque(i, 3, order)
        do k = order - 1, 1, -1
          x = s%torque(i, 1, k) + part*x
          y = s%torque(i, 2, k) + part*y
          z = s%torque(i, 3, k) + part*z
        end do
        place = bodies%places(row)
        bodies%omega_rows(1, place, body(i)) = omega_of(1, part*x)
        bodies%omega_rows(2, place, body(i)) = omega_of(2, part*y)
        bodies%omega_rows(3, place, body(i)) = omega_of(3, part*z)
        if (is_estimated) bodies%estimate_rows(:, place, body(i)) = [error, s%growth(i)]
        row = row + 1
      end do
      r%next(i) = row
    end do

  contains

    pure real(dp) function omega_of(axis, change)
      integer, intent(in) :: axis
      real(dp), intent(in) :: change !! rad/s

      omega_of = r%w(i, axis) + (change + (r%low(i, axis) - r%error(i, axis) &
                                           - share*(s%error(i, axis) - r%error(i, axis))))
    end function omega_of

  end subroutine put_rows

  subroutine put_turned_rows(bodies, n_slots, body, s, now, r)
    !! Compute the attitude of each slot's body at the requested times within the step before the
    !! latest: by the series from either end up to the point between them.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: n_slots, body(SLOTS)
    type(slots_t), intent(in) :: s
    type(attitudes_t), intent(in) :: now
    type(rows_t), intent(inout) :: r
    type(span_t) :: span
    integer :: i

    do i = 1, n_slots
      if (body(i) == 0) cycle
      span%length = now%h(i)
      span%from = r%t(i) - span%length
      span%before = r%turned(i, :)
      span%after = now%error(i, :) - rotated(now%q(i, :), (0.5_dp*s%h(i))*now%w_error(i, :))
      span%error = turned_error_of(s, i, now)
      if (abs(r%t(i)) > 0.0_dp) then
        span%q = r%q(i, :)
        span%begin = span%from
        span%unit = span%length/r%stretch(i)
        span%until = span%from + now%divided(i)*span%length
        call put_span(bodies, body(i), now, [i, 3 - now%latest], span, r%next_turned(i))
      end if
      span%q = now%q(i, :)
      span%begin = r%t(i)
      span%unit = span%length
      span%until = r%t(i)
      call put_span(bodies, body(i), now, [i, now%latest], span, r%next_turned(i))
      r%turned(i, :) = span%after
    end do
  end subroutine put_turned_rows

  subroutine put_last_rows(bodies, body, i, s, now, r)
    !! Compute the attitude of a slot's body at the requested times within its last step.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: body, i
    type(slots_t), intent(in) :: s
    type(attitudes_t), intent(in) :: now
    type(rows_t), intent(inout) :: r
    type(span_t) :: span
    real(dp) :: q(4)

    q = bodies%attitude_rows(:, bodies%places(last_row(bodies)), body)
    span%q = now%q(i, :)
    span%begin = r%t(i)
    span%unit = now%h(i)
    span%until = s%t(i)
    span%from = r%t(i)
    span%length = s%h(i)
    span%before = r%turned(i, :)
    span%after = now%error(i, :) + rotated(q, (0.5_dp*s%h(i))*s%error(i, :))
    span%error = turned_error_of(s, i, now)
    call put_span(bodies, body, now, [i, now%latest], span, r%next_turned(i))
  end subroutine put_last_rows

  subroutine put_span(bodies, body, now, at, span, next)
    !! Compute the attitude of a body at the requested times within a span, and add its error to
    !! that of omega.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: body
    type(attitudes_t), intent(in) :: now
    integer, intent(in) :: at(2)      !! slot, and series
    type(span_t), intent(in) :: span
    integer, intent(inout) :: next    !! row of the body
    real(dp) :: time, part, share, u(4), a, b, c, d, per_unit, per_step
    integer :: i, k, series, place

    if (.not. is_due(bodies, next, span%until)) return
    i = at(1)
    series = at(2)
    per_unit = 1.0_dp/span%unit
    per_step = 1.0_dp/span%length
    do while (is_due(bodies, next, span%until))
      time = bodies%row_times(next)
      part = (time - span%begin)*per_unit
      a = 0.0_dp
      b = 0.0_dp
      c = 0.0_dp
      d = 0.0_dp
      do k = now%order, 1, -1
        a = now%u(i, 1, k, series) + part*a
        b = now%u(i, 2, k, series) + part*b
        c = now%u(i, 3, k, series) + part*c
        d = now%u(i, 4, k, series) + part*d
      end do
      u = [1.0_dp + part*a, part*b, part*c, part*d]
      share = (time - span%from)*per_step
      call put_attitude(bodies, body, next, &
                        less_rotated(product_of(span%q, u), &
                                     span%before + share*(span%after - span%before)))
      if (size(bodies%estimate_rows, 3) > 0) then
        place = bodies%places(next)
        bodies%estimate_rows(1, place, body) = bodies%estimate_rows(1, place, body) &
                                               + WRONG_ANGLE*span%error
      end if
      next = next + 1
    end do
  end subroutine put_span

  pure logical function is_due(bodies, row, time)
    !! Return whether a row, but for the last one, is at most at a time.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: row
    real(dp), intent(in) :: time !! s

    is_due = row < size(bodies%row_times)
    if (is_due) is_due = abs(bodies%row_times(row)) <= abs(time)
  end function is_due

  pure real(dp) function error_of(s, i)
    !! Return an estimate of the relative error of a slot's body, from the truncation error that was
    !! subtracted, from the last terms of a step, and from the rounding errors.
    type(slots_t), intent(in) :: s
    integer, intent(in) :: i

    error_of = WRONG*s%worst(i)/max(s%scale(i), LEAST) &
               + s%growth(i)*(UNSEEN*s%local_tolerance(i) + ROUNDINGS*ROUNDING)
  end function error_of

  pure real(dp) function turned_error_of(s, i, now)
    !! Return an estimate of the error of a slot's attitude so far, as in take_attitude, rad.
    type(slots_t), intent(in) :: s
    integer, intent(in) :: i
    type(attitudes_t), intent(in) :: now

    turned_error_of = now%worst(i) + (now%left(i) + ROUNDING*s%growth(i) &
                                      *(1.0_dp + 0.5_dp*s%scale(i)*abs(s%t(i))))
  end function turned_error_of

end module many_rows

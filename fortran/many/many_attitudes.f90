module many_attitudes
  !! Attitudes of bodies under torque side by side, beside many_taylor.f90. The attitude goes along
  !! each step from both ends: by the series about the beginning of the step up to a point within
  !! it, and from there by the series about the beginning of the next step. At such a distance the
  !! series of the attitude needs fewer terms than that of omega.
  use bodies, only: bodies_t, i1, last_row, NEEDS_FALLBACK, of_body, put_attitude
  use kinds, only: dp
  use many_slots, only: BLURRED, ratio, SLOTS, slots_t
  implicit none(type, external)
  private

  integer, parameter :: MOST_TERMS = 17
  real(dp), parameter :: FAR = 1e100_dp ! squared norms from 1/FAR to FAR are accurate
  ! Largest last term in half a step of a steady rotation, in tolerances.
  real(dp), parameter :: A_TERM = 0.002_dp
  ! Last term that is planned, in local tolerances of omega.
  real(dp), parameter :: PLANNED = 0.05_dp
  ! Largest step over the distance at which the last term is as planned: at most the distances from
  ! both ends, of which only one is known.
  real(dp), parameter :: BOTH_ENDS = 1.7_dp
  real(dp), parameter :: A_GUESS = 1.2_dp ! largest first step over its guess
  ! Largest sum of last terms, in tolerances. What follows them is less than a quarter of them.
  real(dp), parameter :: TRUSTED_TERMS = 1.0_dp
  real(dp), parameter :: ROUNDING = 2.0_dp**(-53)

  type, public :: attitudes_t
    integer :: order                     !! number of terms
    integer :: latest                    !! the terms of the latest step: 1 or 2
    real(dp) :: widest                   !! largest angle of a step about an axis, rad
    real(dp), dimension(SLOTS, 4) :: q   !! where the latest step begins
    real(dp), dimension(SLOTS, 3) :: error !! rotation about axes of space by which q is wrong, rad
    real(dp), dimension(SLOTS) :: worst  !! its largest size so far, rad
    real(dp), dimension(SLOTS) :: left   !! sum of the last terms of all steps
    real(dp), dimension(SLOTS) :: is_first !! above 0 before the first step of a body
    real(dp), dimension(SLOTS, 3) :: w, w_error !! omega where the step begins, and its error, rad/s
    real(dp), dimension(SLOTS) :: h      !! previous step, s
    real(dp), dimension(SLOTS) :: stretch !! previous step over the one before
    real(dp), dimension(SLOTS) :: divided !! part of it by the series from its beginning
    real(dp), dimension(SLOTS, 2) :: reach !! distance at which the last term is as planned, s
    real(dp) :: u(SLOTS, 4, MOST_TERMS, 2) !! terms of the attitude from the identity
  end type attitudes_t

  type :: sums_t
    !! The series of the previous and of the latest step at the point between them.
    real(dp), dimension(SLOTS) :: ahead, back !! this point in units of either series
    real(dp), dimension(SLOTS, 4) :: from, to !! the sums
    real(dp), dimension(SLOTS) :: old, new    !! power of the distance in either last term
  end type sums_t

  public :: begin_attitude, less_rotated, plan_attitudes, product_of, remember, rotated, &
            take_attitude, turn

contains

  pure subroutine plan_attitudes(tolerance, s, now)
    !! Choose the number of terms, and how the steps near the end are divided: the last one is at
    !! most half a step, as no other step follows it.
    real(dp), intent(in) :: tolerance
    type(slots_t), intent(inout) :: s
    type(attitudes_t), intent(inout) :: now

    if (tolerance >= 1e-4_dp) then
      now%order = 8
    else if (tolerance >= 3e-8_dp) then
      now%order = 12
    else if (tolerance >= 1e-10_dp) then
      now%order = 15
    else
      now%order = 17
    end if
    now%widest = (4.0_dp/sqrt(3.0_dp)) &
                 *exp((log(A_TERM*tolerance) + log_gamma(now%order + 1.0_dp))/now%order)
    now%latest = 1
    now%q = 0.0_dp
    now%error = 0.0_dp
    now%worst = 0.0_dp
    now%left = 0.0_dp
    now%is_first = 1.0_dp
    now%stretch = 1.0_dp
    now%reach = 1.0_dp
    now%u = 0.0_dp
    s%one = 0.5_dp
    s%two = 1.5_dp
    s%part = 2.0_dp/3.0_dp
    s%torque = 0.0_dp
  end subroutine plan_attitudes

  pure subroutine begin_attitude(bodies, body, i, a_step, s, now)
    !! Put the attitude of a body into slot i.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: body, i
    real(dp), intent(in) :: a_step !! largest step times s%spin
    type(slots_t), intent(inout) :: s
    type(attitudes_t), intent(inout) :: now
    real(dp) :: q(4), square

    q = bodies%attitude0(:, of_body(size(bodies%attitude0, 2), body))
    square = sum(q*q)
    ! The single-body kernel takes any other norm.
    now%left(i) = 0.0_dp
    if (.not. (square <= FAR .and. square >= 1.0_dp/FAR)) now%left(i) = huge(square)
    now%q(i, :) = q/sqrt(square)
    now%error(i, :) = 0.0_dp
    now%worst(i) = 0.0_dp
    now%is_first(i) = 1.0_dp
    s%spin(i) = max(s%spin(i), s%scale(i)*(a_step/now%widest), (a_step/A_GUESS)/abs(s%h(i)))
  end subroutine begin_attitude

  pure subroutine remember(s, now)
    !! Keep what the next step of omega will replace.
    type(slots_t), intent(in) :: s
    type(attitudes_t), intent(inout) :: now

    now%w = s%w
    now%w_error = s%error
    now%h = s%h
    now%latest = 3 - now%latest
  end subroutine remember

  pure subroutine turn(m, a_step, s, now)
    !! Advance the attitudes to where the latest step begins. The terms of omega are in s%torque.
    integer, intent(in) :: m
    real(dp), intent(in) :: a_step !! largest step times s%spin
    type(slots_t), intent(inout) :: s
    type(attitudes_t), intent(inout) :: now
    type(sums_t) :: r
    real(dp) :: last_old, last_new, part, f(4), g(4), p(4), d(4), q(4), x, y, z, e1, e2, e3, size
    integer :: i, latest, previous, order

    latest = now%latest
    previous = 3 - latest
    order = now%order
    call expand_attitude(order, m, s, now%w, now%h, now%u(:, :, :, latest))
    do i = 1, m
      last_new = (abs(now%u(i, 1, order, latest)) + abs(now%u(i, 2, order, latest))) &
                 + (abs(now%u(i, 3, order, latest)) + abs(now%u(i, 4, order, latest)))
      now%reach(i, latest) = abs(now%h(i))*ratio(order, PLANNED*s%local_tolerance(i), last_new)
      part = now%reach(i, previous)/(now%reach(i, previous) + now%reach(i, latest))
      now%divided(i) = part
      r%ahead(i) = part*now%stretch(i)
      r%back(i) = part - 1.0_dp
    end do
    call sum_attitude(order, m, now, r)
    do i = 1, m
      ! `from` times the conjugate of `to`
      f(1) = r%from(i, 1)
      f(2) = r%from(i, 2)
      f(3) = r%from(i, 3)
      f(4) = r%from(i, 4)
      g(1) = r%to(i, 1)
      g(2) = r%to(i, 2)
      g(3) = r%to(i, 3)
      g(4) = r%to(i, 4)
      d(1) = f(1)*g(1) + f(2)*g(2) + (f(3)*g(3) + f(4)*g(4))
      d(2) = f(2)*g(1) - f(1)*g(2) - (f(3)*g(4) - f(4)*g(3))
      d(3) = f(3)*g(1) - f(1)*g(3) - (f(4)*g(2) - f(2)*g(4))
      d(4) = f(4)*g(1) - f(1)*g(4) - (f(2)*g(3) - f(3)*g(2))
      p(1) = now%q(i, 1)
      p(2) = now%q(i, 2)
      p(3) = now%q(i, 3)
      p(4) = now%q(i, 4)
      q(1) = p(1)*d(1) - p(2)*d(2) - (p(3)*d(3) + p(4)*d(4))
      q(2) = p(1)*d(2) + p(2)*d(1) + (p(3)*d(4) - p(4)*d(3))
      q(3) = p(1)*d(3) + p(3)*d(1) + (p(4)*d(2) - p(2)*d(4))
      q(4) = p(1)*d(4) + p(4)*d(1) + (p(2)*d(3) - p(3)*d(2))
      last_old = (abs(now%u(i, 1, order, previous)) + abs(now%u(i, 2, order, previous))) &
                 + (abs(now%u(i, 3, order, previous)) + abs(now%u(i, 4, order, previous)))
      last_new = (abs(now%u(i, 1, order, latest)) + abs(now%u(i, 2, order, latest))) &
                 + (abs(now%u(i, 3, order, latest)) + abs(now%u(i, 4, order, latest)))
      size = now%left(i) + (last_old*r%old(i) + last_new*r%new(i))
      part = now%h(i)
      if (now%is_first(i) > 0.0_dp) then
        q(1) = p(1)
        q(2) = p(2)
        q(3) = p(3)
        q(4) = p(4)
        size = now%left(i)
        part = 0.0_dp
      end if
      now%left(i) = size
      now%q(i, 1) = q(1)
      now%q(i, 2) = q(2)
      now%q(i, 3) = q(3)
      now%q(i, 4) = q(4)
      ! The error of omega rotates the attitude during half of the step at either side.
      part = 0.5_dp*(part + s%h(i))
      e1 = part*now%w_error(i, 1)
      e2 = part*now%w_error(i, 2)
      e3 = part*now%w_error(i, 3)
      x = 2.0_dp*(q(3)*e3 - q(4)*e2)
      y = 2.0_dp*(q(4)*e1 - q(2)*e3)
      z = 2.0_dp*(q(2)*e2 - q(3)*e1)
      e1 = now%error(i, 1) + (e1 + q(1)*x + (q(3)*z - q(4)*y))
      e2 = now%error(i, 2) + (e2 + q(1)*y + (q(4)*x - q(2)*z))
      e3 = now%error(i, 3) + (e3 + q(1)*z + (q(2)*y - q(3)*x))
      now%error(i, 1) = e1
      now%error(i, 2) = e2
      now%error(i, 3) = e3
      size = abs(e1) + abs(e2) + abs(e3)
      ! A sum, because a maximum may lose a NaN.
      now%worst(i) = max(now%worst(i), size) + 0.0_dp*size
      now%is_first(i) = 0.0_dp
      now%stretch(i) = s%h(i)/now%h(i)
      s%spin(i) = max(s%spin(i), s%scale(i)*(a_step/now%widest), &
                      (a_step/BOTH_ENDS)/now%reach(i, latest))
    end do
  end subroutine turn

  ! unroll: many_attitude
  pure subroutine expand_attitude(order, m, s, w0, h, u)
    !! Compute the terms of the attitude, from the identity, for a step as long as the previous one.
    integer, intent(in) :: order, m
    type(slots_t), intent(in) :: s
    real(dp), intent(in) :: w0(SLOTS, 3), h(SLOTS) !! rad/s, s
    real(dp), intent(inout) :: u(SLOTS, 4, MOST_TERMS)
    real(dp) :: w(3), sums(4)
    integer :: i, j, k

    do i = 1, m
      u(i, :, 1) = (0.5_dp*h(i))*[0.0_dp, w0(i, 1), w0(i, 2), w0(i, 3)]
      do k = 2, order
        sums = [0.0_dp, s%torque(i, 1, k - 1), s%torque(i, 2, k - 1), s%torque(i, 3, k - 1)]
        do j = 1, k - 1
          w = w0(i, :)
          if (k - 1 - j > 0) w = s%torque(i, :, k - 1 - j)
          sums(1) = sums(1) - u(i, 2, j)*w(1) - u(i, 3, j)*w(2) - u(i, 4, j)*w(3)
          sums(2) = sums(2) + u(i, 1, j)*w(1) + u(i, 3, j)*w(3) - u(i, 4, j)*w(2)
          sums(3) = sums(3) + u(i, 1, j)*w(2) + u(i, 4, j)*w(1) - u(i, 2, j)*w(3)
          sums(4) = sums(4) + u(i, 1, j)*w(3) + u(i, 2, j)*w(2) - u(i, 3, j)*w(1)
        end do
        u(i, :, k) = ((0.5_dp*h(i))*(1.0_dp/real(k, dp)))*sums
      end do
    end do
  end subroutine expand_attitude

  pure subroutine sum_attitude(order, m, now, r)
    !! Sum two series at one point each, and compute the power of the distance in the last term.
    integer, intent(in) :: order, m
    type(attitudes_t), intent(in) :: now
    type(sums_t), intent(inout) :: r
    integer :: i, k, latest, previous

    latest = now%latest
    previous = 3 - latest
    do i = 1, m
      r%from(i, :) = now%u(i, :, order, previous)*r%ahead(i)
      r%to(i, :) = now%u(i, :, order, latest)*r%back(i)
      do k = order - 1, 1, -1
        r%from(i, :) = (r%from(i, :) + now%u(i, :, k, previous))*r%ahead(i)
        r%to(i, :) = (r%to(i, :) + now%u(i, :, k, latest))*r%back(i)
      end do
      r%from(i, 1) = 1.0_dp + r%from(i, 1)
      r%to(i, 1) = 1.0_dp + r%to(i, 1)
      r%old(i) = abs(r%ahead(i))
      r%new(i) = abs(r%back(i))
      do k = 2, order
        r%old(i) = r%old(i)*abs(r%ahead(i))
        r%new(i) = r%new(i)*abs(r%back(i))
      end do
    end do
  end subroutine sum_attitude
  ! end unroll

  subroutine take_attitude(bodies, body, i, trusted, s, now, status, error)
    !! Take the attitude of a slot's body along its last step, or leave the body to the single-body
    !! kernel.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: body, i
    real(dp), intent(in) :: trusted !! largest error that is subtracted, in tolerances
    type(slots_t), intent(in) :: s
    type(attitudes_t), intent(in) :: now
    integer(i1), intent(inout) :: status
    real(dp), intent(out) :: error  !! estimate of what is subtracted and of what is left, rad
    real(dp) :: u(4), q(4), e(3), left, way
    integer :: k

    u = 0.0_dp
    do k = now%order, 1, -1
      u = (u + now%u(i, :, k, now%latest))*now%stretch(i)
    end do
    left = now%left(i) + sum(abs(now%u(i, :, now%order, now%latest)))*abs(now%stretch(i))**now%order
    u(1) = 1.0_dp + u(1)
    q = product_of(now%q(i, :), u)
    e = now%error(i, :) + rotated(q, (0.5_dp*s%h(i))*s%error(i, :))
    way = 1.0_dp + 0.5_dp*s%scale(i)*abs(s%t(i))
    error = max(now%worst(i), sum(abs(e))) + 0.0_dp*sum(e)
    if (.not. (error <= trusted*bodies%tolerance &
               .and. left <= TRUSTED_TERMS*bodies%tolerance &
               .and. s%growth(i)*way <= BLURRED*bodies%tolerance/ROUNDING)) status = NEEDS_FALLBACK
    call put_attitude(bodies, body, last_row(bodies), less_rotated(q, e))
    error = error + (left + ROUNDING*s%growth(i)*way)
  end subroutine take_attitude

  pure function product_of(p, u) result(q)
    !! Return a product of quaternions.
    real(dp), intent(in) :: p(4), u(4)
    real(dp) :: q(4)

    q(1) = p(1)*u(1) - p(2)*u(2) - (p(3)*u(3) + p(4)*u(4))
    q(2) = p(1)*u(2) + p(2)*u(1) + (p(3)*u(4) - p(4)*u(3))
    q(3) = p(1)*u(3) + p(3)*u(1) + (p(4)*u(2) - p(2)*u(4))
    q(4) = p(1)*u(4) + p(4)*u(1) + (p(2)*u(3) - p(3)*u(2))
  end function product_of

  pure function rotated(q, vector) result(e)
    !! Return a vector about axes of space.
    real(dp), intent(in) :: q(4), vector(3)
    real(dp) :: e(3), cross(3)

    e = vector
    cross = 2.0_dp*[q(3)*e(3) - q(4)*e(2), q(4)*e(1) - q(2)*e(3), q(2)*e(2) - q(3)*e(1)]
    e = e + q(1)*cross + [q(3)*cross(3) - q(4)*cross(2), q(4)*cross(1) - q(2)*cross(3), &
                          q(2)*cross(2) - q(3)*cross(1)]
  end function rotated

  pure function less_rotated(q, rotation) result(p)
    !! Return an attitude without a small rotation about axes of space: less half of the product of
    !! the quaternions (0, rotation) and q.
    real(dp), intent(in) :: q(4)
    real(dp), intent(in) :: rotation(3) !! rad
    real(dp) :: p(4), e(3)

    e = 0.5_dp*rotation
    p(1) = q(1) + (e(1)*q(2) + e(2)*q(3) + e(3)*q(4))
    p(2) = q(2) - (e(1)*q(1) + (e(2)*q(4) - e(3)*q(3)))
    p(3) = q(3) - (e(2)*q(1) + (e(3)*q(2) - e(1)*q(4)))
    p(4) = q(4) - (e(3)*q(1) + (e(1)*q(3) - e(2)*q(2)))
    p = p/sqrt(sum(p*p))
  end function less_rotated

end module many_attitudes

module principal_frames
  !! Principal axes of many inertia matrices, by Jacobi's method in double-double: in double
  !! precision the differences of nearly equal moments, and a small moment, would have few digits.
  use, intrinsic :: iso_c_binding, only: c_int
  use kinds, only: dp
  use principal_lanes, only: find_lanes, lanes_t, scale_matrix, SIDE_BY_SIDE
  use statuses, only: COMPLETE, GAVE_UP, REFUSED
  use word_pairs, only: operator(*), operator(+), operator(-), operator(/), pair_t, product_of, root
  implicit none(type, external)
  private

  integer, parameter :: MOST_ROTATIONS = 60 ! some ten suffice
  ! A smaller element off the diagonal changes no digit that is returned.
  real(dp), parameter :: NOTHING = 2.0_dp**(-100)
  real(dp), parameter :: ROUGH = 2.0_dp**(-56), SMALL = 2.0_dp**(-28)
  ! Least over largest moment that double-double resolves.
  real(dp), parameter :: THIN = 2.0_dp**(-40)
  ! Largest rotation of first order, rad, whose square is negligible.
  real(dp), parameter :: MOST_TURNED = 2.0_dp**(-36)
  type(pair_t), parameter :: ZERO = pair_t(0.0_dp, 0.0_dp), ONE = pair_t(1.0_dp, 0.0_dp)

  public :: find_frames

contains

  subroutine find_frames(n, matrices, m, vectors, numbers, axes, components, status) &
    bind(c, name="find_frames_level")
    !! Compute the frames of n bodies, each with m vectors.
    integer(c_int), intent(in), value :: n, m
    real(dp), intent(in) :: matrices(3, 3, n)
    real(dp), intent(in) :: vectors(3, m, n)
    real(dp), intent(out) :: numbers(10, n)
    real(dp), intent(out) :: axes(3, 3, n)
    real(dp), intent(out) :: components(3, m, n)
    integer(c_int), intent(out) :: status(n)
    type(lanes_t) :: lanes
    type(pair_t) :: moments(3), v(3, 3)
    real(dp) :: matrix(3, 3)
    integer :: first, i, j, scaling

    do first = 1, n, SIDE_BY_SIDE
      call find_lanes(matrices(:, :, first:min(n, first + SIDE_BY_SIDE - 1)), lanes)
      do j = first, min(n, first + SIDE_BY_SIDE - 1)
        i = 1 + j - first
        if (lanes%turned(i) <= MOST_TURNED) then
          moments%high = lanes%d(i, :)
          moments%low = lanes%d_low(i, :)
          v%high = lanes%v(i, :, :)
          v%low = lanes%v_low(i, :, :)
        else
          call scale_matrix(matrices(:, :, j), matrix, scaling)
          call find_one(matrix, moments, v)
        end if
        call finish_frame(moments, v, lanes%scaling(i), vectors(:, :, j), numbers(:, j), &
                          axes(:, :, j), components(:, :, j), status(j))
      end do
    end do
  end subroutine find_frames

  pure subroutine find_one(matrix, moments, v)
    !! Find principal moments and axes of a body, also if moments are nearly equal.
    real(dp), intent(in) :: matrix(3, 3) !! symmetric, elements at most 1
    type(pair_t), intent(out) :: moments(3), v(3, 3)
    type(pair_t) :: a(3, 3)
    integer :: i

    call begin(matrix, a, v)
    call diagonalise(a, v)
    do i = 1, 3
      moments(i) = a(i, i)
    end do
  end subroutine find_one

  pure subroutine finish_frame(found, found_axes, scaling, vectors, numbers, axes, components, &
                               status)
    !! Compute A, B, C, the moments over a power of two, the quaternion from the frame to the body,
    !! the axes as columns, and the components of vectors about them, over the moments; each but the
    !! quaternion is rounded once. Each axis is near the body's own axis of the same number, and
    !! the frame is right-handed. The status is COMPLETE, REFUSED if the matrix is not positive
    !! definite, or GAVE_UP if the body is too thin; the numbers are then 0.
    type(pair_t), intent(in) :: found(3), found_axes(3, 3)
    integer, intent(in) :: scaling              !! of the moments, an exponent of two
    real(dp), intent(in) :: vectors(:, :)       !! torques
    real(dp), intent(out) :: numbers(10)
    real(dp), intent(out) :: axes(3, 3)
    real(dp), intent(out) :: components(:, :)
    integer, intent(out) :: status
    type(pair_t) :: v(3, 3), moments(3), part
    real(dp) :: least
    integer :: order(3)
    integer :: i, j, k

    numbers = 0.0_dp
    axes = 0.0_dp
    components = 0.0_dp
    least = min(found(1)%high, found(2)%high, found(3)%high)
    status = REFUSED
    if (.not. least > 0.0_dp) return
    status = GAVE_UP
    if (least < THIN) return
    status = COMPLETE
    v = found_axes
    axes = v%high
    order = nearest_axes(axes)
    v = v(:, order)
    do i = 1, 3
      moments(i) = found(order(i))
      if (v(i, i)%high < 0.0_dp) call reverse(v(:, i))
    end do
    axes = v%high
    if (determinant(axes) < 0.0_dp) then
      i = minloc([(abs(axes(k, k)), k=1, 3)], 1)
      call reverse(v(:, i))
    end if
    axes = v%high + v%low
    numbers(7:) = quaternion_of(axes)
    do i = 1, 3
      j = 1 + mod(i, 3)
      k = 1 + mod(j, 3)
      part = (moments(j) - moments(k))/moments(i)
      numbers(i) = part%high + part%low
      numbers(3 + i) = moments(i)%high
      do j = 1, size(vectors, 2)
        part = (v(1, i)*vectors(1, j) + v(2, i)*vectors(2, j) + v(3, i)*vectors(3, j))/moments(i)
        components(i, j) = scale(part%high + part%low, -scaling)
      end do
    end do
  end subroutine finish_frame

  pure subroutine begin(matrix, a, v)
    !! Set `v` to axes that are right to double precision, and orthogonal to double-double, and `a`
    !! to the matrix about them. Few rotations are then left, by small angles.
    real(dp), intent(in) :: matrix(3, 3)
    type(pair_t), intent(out) :: a(3, 3), v(3, 3)
    type(pair_t) :: sum, b(3, 3)
    real(dp) :: turned(3, 3), axes(3, 3), off(3, 3), change
    integer :: i, j, k

    turned = matrix
    call diagonalise_roughly(turned, axes)
    ! One step of Newton's method for the polar factor.
    do j = 1, 3
      do i = 1, j
        sum = product_of(axes(1, i), axes(1, j)) + product_of(axes(2, i), axes(2, j)) &
              + product_of(axes(3, i), axes(3, j))
        off(i, j) = 0.5_dp*((merge(1.0_dp, 0.0_dp, i == j) - sum%high) - sum%low)
        off(j, i) = off(i, j)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        change = axes(i, 1)*off(1, j) + axes(i, 2)*off(2, j) + axes(i, 3)*off(3, j)
        v(i, j) = pair_t(axes(i, j), 0.0_dp) + pair_t(change, 0.0_dp)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        b(i, j) = v(1, j)*matrix(i, 1) + v(2, j)*matrix(i, 2) + v(3, j)*matrix(i, 3)
      end do
      do k = 1, j
        a(k, j) = v(1, k)*b(1, j) + v(2, k)*b(2, j) + v(3, k)*b(3, j)
        a(j, k) = a(k, j)
      end do
    end do
  end subroutine begin

  pure subroutine diagonalise_roughly(a, v)
    !! Make `a` diagonal, and compute its axes, the columns of `v`.
    real(dp), intent(inout) :: a(3, 3)
    real(dp), intent(out) :: v(3, 3)
    real(dp) :: ratio, t, c, s, first(3), second(3)
    integer :: p, q, r, rotation, k

    v = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
    do rotation = 1, MOST_ROTATIONS
      r = maxloc([abs(a(2, 3)), abs(a(1, 3)), abs(a(1, 2))], 1)
      p = merge(2, 1, r == 1)
      q = merge(2, 3, r == 3)
      if (abs(a(p, q)) <= ROUGH) exit
      ratio = (a(q, q) - a(p, p))/(2.0_dp*a(p, q))
      t = sign(1.0_dp/(abs(ratio) + sqrt(1.0_dp + ratio*ratio)), ratio)
      c = 1.0_dp/sqrt(1.0_dp + t*t)
      s = c*t
      first = c*a(:, p) - s*a(:, q)
      second = s*a(:, p) + c*a(:, q)
      a(:, p) = first
      a(:, q) = second
      first = c*a(p, :) - s*a(q, :)
      second = s*a(p, :) + c*a(q, :)
      a(p, :) = first
      a(q, :) = second
      a(p, q) = 0.0_dp
      a(q, p) = 0.0_dp
      do k = 1, 3
        first(1) = v(k, p)
        v(k, p) = c*first(1) - s*v(k, q)
        v(k, q) = s*first(1) + c*v(k, q)
      end do
    end do
  end subroutine diagonalise_roughly

  pure subroutine diagonalise(a, v)
    !! Make `a` diagonal by rotations, which also turn the columns of `v`.
    type(pair_t), intent(inout) :: a(3, 3), v(3, 3)
    type(pair_t) :: c, s, first, second
    real(dp) :: ratio, tangent
    integer :: p, q, r, rotation, k

    do rotation = 1, MOST_ROTATIONS
      r = maxloc([abs(a(2, 3)%high), abs(a(1, 3)%high), abs(a(1, 2)%high)], 1)
      p = merge(2, 1, r == 1)
      q = merge(2, 3, r == 3)
      if (abs(a(p, q)%high) <= NOTHING) exit
      ratio = (a(q, q)%high - a(p, p)%high)/(2.0_dp*a(p, q)%high)
      tangent = sign(1.0_dp/(abs(ratio) + sqrt(1.0_dp + ratio*ratio)), ratio)
      ! The tangent is rounded; sine and cosine belong to this tangent to all digits.
      if (abs(tangent) < SMALL) then
        c = pair_t(1.0_dp, -0.5_dp*tangent*tangent)
      else
        c = ONE/root(pair_t(tangent, 0.0_dp)*tangent + ONE)
      end if
      s = c*tangent
      do k = 1, 3
        first = a(k, p)
        second = a(k, q)
        a(k, p) = c*first - s*second
        a(k, q) = s*first + c*second
        first = v(k, p)
        second = v(k, q)
        v(k, p) = c*first - s*second
        v(k, q) = s*first + c*second
      end do
      do k = 1, 3
        first = a(p, k)
        second = a(q, k)
        a(p, k) = c*first - s*second
        a(q, k) = s*first + c*second
      end do
      a(q, p) = a(p, q)
    end do
  end subroutine diagonalise

  pure function nearest_axes(v) result(order)
    !! Return for each axis of the body the nearest of the remaining columns.
    real(dp), intent(in) :: v(3, 3)
    integer :: order(3)
    logical :: is_left(3)
    real(dp) :: sizes(3)
    integer :: i

    is_left = .true.
    do i = 1, 3
      sizes = abs(v(i, :))
      order(i) = maxloc(sizes, 1, is_left)
      is_left(order(i)) = .false.
    end do
  end function nearest_axes

  pure function quaternion_of(v) result(q)
    !! Return the quaternion of a right-handed frame, by the largest of its numbers.
    real(dp), intent(in) :: v(3, 3)
    real(dp) :: q(4)
    integer :: i, j, k

    i = maxloc([v(1, 1) + v(2, 2) + v(3, 3), v(1, 1), v(2, 2), v(3, 3)], 1) - 1
    if (i == 0) then
      q = [1.0_dp + v(1, 1) + v(2, 2) + v(3, 3), v(3, 2) - v(2, 3), v(1, 3) - v(3, 1), &
           v(2, 1) - v(1, 2)]
    else
      j = 1 + mod(i, 3)
      k = 1 + mod(j, 3)
      q(1) = v(k, j) - v(j, k)
      q(1 + i) = 1.0_dp + v(i, i) - v(j, j) - v(k, k)
      q(1 + j) = v(j, i) + v(i, j)
      q(1 + k) = v(k, i) + v(i, k)
    end if
    q = q/sqrt(q(1)*q(1) + q(2)*q(2) + q(3)*q(3) + q(4)*q(4))
  end function quaternion_of

  pure subroutine reverse(axis)
    type(pair_t), intent(inout) :: axis(3)

    axis%high = -axis%high
    axis%low = -axis%low
  end subroutine reverse

  pure real(dp) function determinant(m)
    real(dp), intent(in) :: m(3, 3)

    determinant = m(1, 1)*(m(2, 2)*m(3, 3) - m(2, 3)*m(3, 2)) &
                  - m(1, 2)*(m(2, 1)*m(3, 3) - m(2, 3)*m(3, 1)) &
                  + m(1, 3)*(m(2, 1)*m(3, 2) - m(2, 2)*m(3, 1))
  end function determinant

end module principal_frames

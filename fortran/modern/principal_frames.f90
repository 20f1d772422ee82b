module principal_frames
  !! Principal axes of many inertia matrices, by Jacobi's method in double-double: in double
  !! precision the differences of nearly equal moments, and a small moment, would have few digits.
  use kinds, only: dp
  use statuses, only: COMPLETE, GAVE_UP, REFUSED
  use word_pairs, only: operator(*), operator(+), operator(-), operator(/), pair_t, root
  implicit none(type, external)
  private

  integer, parameter :: MOST_ROTATIONS = 60 ! some ten suffice
  ! A smaller element off the diagonal changes no digit that is returned.
  real(dp), parameter :: NOTHING = 2.0_dp**(-100)
  ! Least over largest moment that double-double resolves.
  real(dp), parameter :: THIN = 2.0_dp**(-40)
  type(pair_t), parameter :: ZERO = pair_t(0.0_dp, 0.0_dp), ONE = pair_t(1.0_dp, 0.0_dp)

  public :: find_frame

contains

  pure subroutine find_frame(matrix, vectors, coefficients, axes, components, status)
    !! Compute A, B, C, the axes as columns, and the components of vectors about them, over the
    !! moments; each is rounded once. Each axis is near the body's own axis of the same number, and
    !! the frame is right-handed. The status is COMPLETE, REFUSED if the matrix is not positive
    !! definite, or GAVE_UP if the body is too thin; the numbers are then 0.
    real(dp), intent(in) :: matrix(3, 3)        !! symmetric, finite
    real(dp), intent(in) :: vectors(:, :)       !! (3, m), torques
    real(dp), intent(out) :: coefficients(3)
    real(dp), intent(out) :: axes(3, 3)
    real(dp), intent(out) :: components(:, :)   !! (3, m)
    integer, intent(out) :: status
    type(pair_t) :: a(3, 3), v(3, 3), moments(3), part
    integer :: order(3)
    integer :: i, j, k, scaling

    coefficients = 0.0_dp
    axes = 0.0_dp
    components = 0.0_dp
    ! The elements are at most 1, so that no product overflows.
    scaling = exponent(maxval(abs(matrix)))
    a = ZERO
    a%high = scale(matrix, -scaling)
    v = ZERO
    do i = 1, 3
      v(i, i) = ONE
    end do
    call diagonalise(a, v)
    status = REFUSED
    if (.not. min(a(1, 1)%high, a(2, 2)%high, a(3, 3)%high) > 0.0_dp) return
    status = GAVE_UP
    if (min(a(1, 1)%high, a(2, 2)%high, a(3, 3)%high) < THIN) return
    status = COMPLETE
    order = nearest_axes(v%high)
    v = v(:, order)
    do i = 1, 3
      moments(i) = a(order(i), order(i))
      if (v(i, i)%high < 0.0_dp) call reverse(v(:, i))
    end do
    axes = v%high
    if (determinant(axes) < 0.0_dp) then
      i = minloc([(abs(axes(k, k)), k=1, 3)], 1)
      call reverse(v(:, i))
    end if
    axes = v%high + v%low
    do i = 1, 3
      j = 1 + mod(i, 3)
      k = 1 + mod(j, 3)
      part = (moments(j) - moments(k))/moments(i)
      coefficients(i) = part%high + part%low
      do j = 1, size(vectors, 2)
        part = (v(1, i)*vectors(1, j) + v(2, i)*vectors(2, j) + v(3, i)*vectors(3, j))/moments(i)
        components(i, j) = scale(part%high + part%low, -scaling)
      end do
    end do
  end subroutine find_frame

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
      c = pair_t(tangent, 0.0_dp)*tangent + ONE
      c = ONE/root(c)
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
    integer :: i

    is_left = .true.
    do i = 1, 3
      order(i) = maxloc(abs(v(i, :)), 1, is_left)
      is_left(order(i)) = .false.
    end do
  end function nearest_axes

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

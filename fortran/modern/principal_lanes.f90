module principal_lanes
  !! Principal axes of inertia matrices side by side, in double-double, if no moments are nearly
  !! equal.
  use kinds, only: dp
  use two_words, only: two_product, two_sum
  implicit none(type, external)
  private

  integer, parameter, public :: SIDE_BY_SIDE = 16
  integer, parameter :: SWEEPS = 4 ! of Jacobi's method

  type, public :: lanes_t
    !! Moments over a power of two, and axes (columns) of bodies side by side.
    integer :: scaling(SIDE_BY_SIDE)   !! its exponent
    real(dp), dimension(SIDE_BY_SIDE, 3) :: d, d_low
    real(dp), dimension(SIDE_BY_SIDE, 3, 3) :: v, v_low
    real(dp) :: turned(SIDE_BY_SIDE)   !! largest angle by which they were corrected, rad
  end type lanes_t

  public :: find_lanes, scale_matrix

contains

  pure subroutine scale_matrix(matrix, scaled, scaling)
    !! Divide by a power of two, so that no product overflows: the elements are at most 1.
    real(dp), intent(in) :: matrix(3, 3)
    real(dp), intent(out) :: scaled(3, 3)
    integer, intent(out) :: scaling
    integer :: i

    scaling = exponent(maxval(abs(matrix)))
    do i = 1, 3
      scaled(:, i) = scale(matrix(:, i), -scaling)
    end do
  end subroutine scale_matrix

  pure subroutine find_lanes(matrices, r)
    !! Find principal moments and axes of bodies side by side: in double precision, then with one
    !! correction of first order in double-double.
    real(dp), intent(in) :: matrices(:, :, :)
    type(lanes_t), intent(out) :: r
    real(dp), dimension(SIDE_BY_SIDE, 3, 3) :: m, v, g, b, b_low
    real(dp) :: f(SIDE_BY_SIDE, 3)  ! off the diagonal: each opposite to its axis
    real(dp) :: scaled(3, 3), x, high, low
    integer :: i, j, k, p, q, sweep

    do i = 1, SIDE_BY_SIDE
      call scale_matrix(matrices(:, :, min(i, size(matrices, 3))), scaled, r%scaling(i))
      m(i, :, :) = scaled
    end do
    do j = 1, 3
      p = 1 + mod(j, 3)
      q = 1 + mod(p, 3)
      r%d(:, j) = m(:, j, j)
      f(:, j) = m(:, p, q)
      v(:, :, j) = 0.0_dp
      v(:, j, j) = 1.0_dp
    end do
    do sweep = 1, SWEEPS
      call rotate(r%d(:, 2), r%d(:, 3), f(:, 1), f(:, 3), f(:, 2), v(:, :, 2), v(:, :, 3))
      call rotate(r%d(:, 3), r%d(:, 1), f(:, 2), f(:, 1), f(:, 3), v(:, :, 3), v(:, :, 1))
      call rotate(r%d(:, 1), r%d(:, 2), f(:, 3), f(:, 2), f(:, 1), v(:, :, 1), v(:, :, 2))
    end do
    ! One step of Newton's method for the polar factor.
    do j = 1, 3
      do k = 1, j
        do i = 1, SIDE_BY_SIDE
          high = merge(-1.0_dp, 0.0_dp, k == j)
          low = 0.0_dp
          !GCC$ unroll 3
          do p = 1, 3
            call add_product(v(i, p, k), 0.0_dp, v(i, p, j), 0.0_dp, high, low)
          end do
          g(i, k, j) = -0.5_dp*(high + low)
        end do
        g(:, j, k) = g(:, k, j)
      end do
    end do
    do j = 1, 3
      do k = 1, 3
        do i = 1, SIDE_BY_SIDE
          x = v(i, k, 1)*g(i, 1, j) + v(i, k, 2)*g(i, 2, j) + v(i, k, 3)*g(i, 3, j)
          call two_sum(v(i, k, j), x, r%v(i, k, j), r%v_low(i, k, j))
        end do
      end do
    end do
    do j = 1, 3
      do k = 1, 3
        do i = 1, SIDE_BY_SIDE
          high = 0.0_dp
          low = 0.0_dp
          !GCC$ unroll 3
          do p = 1, 3
            call add_product(r%v(i, p, j), r%v_low(i, p, j), m(i, k, p), 0.0_dp, high, low)
          end do
          b(i, k, j) = high
          b_low(i, k, j) = low
        end do
      end do
    end do
    do j = 1, 3
      do k = 1, j
        do i = 1, SIDE_BY_SIDE
          high = 0.0_dp
          low = 0.0_dp
          !GCC$ unroll 3
          do p = 1, 3
            call add_product(r%v(i, p, k), r%v_low(i, p, k), b(i, p, j), b_low(i, p, j), high, low)
          end do
          if (k == j) then
            r%d(i, j) = high
            r%d_low(i, j) = low
          else
            f(i, 6 - j - k) = high + low
          end if
        end do
      end do
    end do
    r%turned = 0.0_dp
    v = r%v
    call correct(r%d(:, 2), r%d(:, 3), f(:, 1), r%d_low(:, 2), r%d_low(:, 3), r%turned, g(:, :, 1))
    call correct(r%d(:, 3), r%d(:, 1), f(:, 2), r%d_low(:, 3), r%d_low(:, 1), r%turned, g(:, :, 2))
    call correct(r%d(:, 1), r%d(:, 2), f(:, 3), r%d_low(:, 1), r%d_low(:, 2), r%turned, g(:, :, 3))
    do k = 1, 3
      do i = 1, SIDE_BY_SIDE
        r%v_low(i, k, 1) = r%v_low(i, k, 1) + (g(i, 1, 2)*v(i, k, 3) - g(i, 1, 3)*v(i, k, 2))
        r%v_low(i, k, 2) = r%v_low(i, k, 2) + (g(i, 1, 3)*v(i, k, 1) - g(i, 1, 1)*v(i, k, 3))
        r%v_low(i, k, 3) = r%v_low(i, k, 3) + (g(i, 1, 1)*v(i, k, 2) - g(i, 1, 2)*v(i, k, 1))
      end do
    end do
    do i = 1, SIDE_BY_SIDE
      r%d_low(i, 1) = r%d_low(i, 1) + (g(i, 2, 2) - g(i, 2, 3))
      r%d_low(i, 2) = r%d_low(i, 2) + (g(i, 2, 3) - g(i, 2, 1))
      r%d_low(i, 3) = r%d_low(i, 3) + (g(i, 2, 1) - g(i, 2, 2))
    end do
  end subroutine find_lanes

  pure subroutine rotate(first, second, off, by_first, by_second, u, v)
    !! Rotate two axes, u and v, so that the element `off` the diagonal becomes 0.
    real(dp), dimension(SIDE_BY_SIDE), intent(inout) :: first, second !! on the diagonal
    real(dp), dimension(SIDE_BY_SIDE), intent(inout) :: off, by_first, by_second
    real(dp), dimension(SIDE_BY_SIDE, 3), intent(inout) :: u, v
    real(dp), dimension(SIDE_BY_SIDE) :: c, s
    real(dp) :: t, x, y
    integer :: i, k

    do i = 1, SIDE_BY_SIDE
      x = second(i) - first(i)
      y = 2.0_dp*off(i)
      t = abs(x) + sqrt(x*x + y*y)
      t = merge(-y, y, x < 0.0_dp)/max(t, tiny(t))
      c(i) = 1.0_dp/sqrt(1.0_dp + t*t)
      s(i) = c(i)*t
      first(i) = first(i) - t*off(i)
      second(i) = second(i) + t*off(i)
      off(i) = 0.0_dp
      x = by_first(i)
      y = by_second(i)
      by_first(i) = c(i)*x - s(i)*y
      by_second(i) = s(i)*x + c(i)*y
    end do
    do k = 1, 3
      do i = 1, SIDE_BY_SIDE
        x = u(i, k)
        y = v(i, k)
        u(i, k) = c(i)*x - s(i)*y
        v(i, k) = s(i)*x + c(i)*y
      end do
    end do
  end subroutine rotate

  pure subroutine correct(first, second, off, first_low, second_low, turned, angle)
    !! Compute the small angle by which two axes are to be rotated, and the change of the moments.
    real(dp), dimension(SIDE_BY_SIDE), intent(in) :: first, second, off, first_low, second_low
    real(dp), intent(inout) :: turned(SIDE_BY_SIDE)
    real(dp), intent(inout) :: angle(SIDE_BY_SIDE, 3)
    real(dp) :: gap, t
    integer :: i

    do i = 1, SIDE_BY_SIDE
      gap = (second(i) - first(i)) + (second_low(i) - first_low(i))
      ! An angle of 1 is too large.
      t = off(i)/sign(max(abs(gap), abs(off(i)), tiny(gap)), gap)
      turned(i) = max(turned(i), abs(t))
      angle(i, 1) = t
      angle(i, 2) = t*off(i)
    end do
  end subroutine correct

  pure subroutine add_product(x, x_low, y, y_low, high, low)
    !! Add a product to a sum, in double-double.
    real(dp), intent(in) :: x, x_low, y, y_low
    real(dp), intent(inout) :: high, low
    real(dp) :: product, rest, total, part

    call two_product(x, y, product, rest)
    rest = rest + (x*y_low + x_low*y)
    call two_sum(high, product, total, part)
    part = part + (low + rest)
    high = total + part
    low = part - (high - total)
  end subroutine add_product

end module principal_lanes

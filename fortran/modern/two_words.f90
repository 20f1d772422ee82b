module two_words
  !! Double-double arithmetic: a second number holds the rounding error of the first.
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter :: i8 = selected_int_kind(18)
  integer(i8), parameter :: UPPER_BITS = -134217728_i8 ! all but the last 27 bits
  real(dp), parameter :: SMALL_PHASE = 1e6_dp ! rad; up to it one term corrects sine and cosine

  public :: scaled, sine_cosine, sine_cosine_of, square_root, two_product, two_sum

contains

  pure subroutine sine_cosine(angle, angle_low, sine, cosine)
    !! Compute sine and cosine of angle + angle_low.
    real(dp), intent(in) :: angle, angle_low
    real(dp), intent(out) :: sine, cosine
    real(dp) :: s, c

    s = sin(angle)
    c = cos(angle)
    if (abs(angle) <= SMALL_PHASE) then
      sine = s + c*angle_low
      cosine = c - s*angle_low
    else
      sine = s*cos(angle_low) + c*sin(angle_low)
      cosine = c*cos(angle_low) - s*sin(angle_low)
    end if
  end subroutine sine_cosine

  pure subroutine sine_cosine_of(frequency, t, t_low, sine, cosine)
    !! Compute sine and cosine of frequency (t + t_low), with the rounding error of the product,
    !! which is 1e-11 after 1e5 radians.
    real(dp), intent(in) :: frequency      !! rad/s
    real(dp), intent(in) :: t, t_low       !! s
    real(dp), intent(out) :: sine, cosine
    real(dp) :: angle, angle_low           ! rad

    call scaled(t, t_low, frequency, angle, angle_low)
    call sine_cosine(angle, angle_low, sine, cosine)
  end subroutine sine_cosine_of

  pure subroutine square_root(x, x_low, root, root_low)
    !! Compute the square root of x + x_low in double-double.
    real(dp), intent(in) :: x, x_low
    real(dp), intent(out) :: root, root_low
    real(dp) :: square, square_low

    root = sqrt(x)
    call two_product(root, root, square, square_low)
    root_low = ((x - square) + (x_low - square_low))/(root + root)
  end subroutine square_root

  pure subroutine scaled(x, x_low, factor, y, y_low)
    !! Compute (x + x_low) factor in double-double.
    real(dp), intent(in) :: x, x_low, factor
    real(dp), intent(out) :: y, y_low

    call two_product(x, factor, y, y_low)
    y_low = y_low + x_low*factor
  end subroutine scaled

  pure subroutine two_sum(x, y, total, rest)
    !! Compute total and rest with x + y = total + rest, exactly (Knuth).
    real(dp), intent(in) :: x, y
    real(dp), intent(out) :: total, rest
    real(dp) :: s, part

    s = x + y
    part = s - x
    rest = (x - (s - part)) + (y - part)
    total = s
  end subroutine two_sum

  pure subroutine two_product(x, y, product, rest)
    !! Compute product and rest with x y = product + rest to 2**-104 of it (Dekker, with truncated
    !! halves, of which the lower ones have 27 bits).
    real(dp), intent(in) :: x, y
    real(dp), intent(out) :: product, rest
    real(dp) :: xh, xl, yh, yl, p

    xh = transfer(iand(transfer(x, UPPER_BITS), UPPER_BITS), x)
    yh = transfer(iand(transfer(y, UPPER_BITS), UPPER_BITS), y)
    xl = x - xh
    yl = y - yh
    p = x*y
    rest = (((xh*yh - p) + xh*yl) + xl*yh) + xl*yl
    product = p
  end subroutine two_product

end module two_words

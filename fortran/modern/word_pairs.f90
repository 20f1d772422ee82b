module word_pairs
  !! The operators of double-double arithmetic: a second number holds the rounding error of the
  !! first. Errors are at most 2.4e-31 of the result, or of |x| + |y| in sums of opposite signs.
  use kinds, only: dp
  use two_words, only: scaled, square_root, two_product, two_sum
  implicit none(type, external)
  private

  real(dp), parameter :: SPLITTER = 134217729.0_dp ! 2**27 + 1

  type, public :: pair_t
    real(dp) :: high, low
  end type pair_t

  interface operator(+)
    module procedure sum_of_pairs
  end interface operator(+)

  interface operator(-)
    module procedure difference_of_pairs
  end interface operator(-)

  interface operator(*)
    module procedure product_of_pairs, multiple_of_pair
  end interface operator(*)

  interface operator(/)
    module procedure quotient_of_pairs
  end interface operator(/)

  public :: difference_of, longer_product, product_of, root
  public :: operator(*), operator(+), operator(-), operator(/)

contains

  pure type(pair_t) function product_of(x, y) result(found)
    !! Compute x y with an error of at most 2**-104 of it.
    real(dp), intent(in) :: x, y

    call two_product(x, y, found%high, found%low)
  end function product_of

  pure type(pair_t) function difference_of(x, y) result(found)
    !! Compute x - y, exactly.
    real(dp), intent(in) :: x, y

    call two_sum(x, -y, found%high, found%low)
  end function difference_of

  pure function longer_product(x, y) result(found)
    !! Compute (x(1) + x(2) + x(3)) y in triple-double: each number is the rounding error of the one
    !! before.
    real(dp), intent(in) :: x(3), y
    real(dp) :: found(3)
    real(dp) :: first, middle, rest, left

    call exact_product(x(1), y, found(1), first)
    call exact_product(x(2), y, middle, rest)
    call two_sum(first, middle, found(2), left)
    found(3) = left + (rest + x(3)*y)
  end function longer_product

  pure subroutine exact_product(x, y, product, rest)
    !! Compute product and rest with x y = product + rest, exactly if nothing underflows (Dekker,
    !! with halves rounded to nearest).
    real(dp), intent(in) :: x, y
    real(dp), intent(out) :: product, rest
    real(dp) :: xh, xl, yh, yl, part

    part = SPLITTER*x
    xh = part - (part - x)
    xl = x - xh
    part = SPLITTER*y
    yh = part - (part - y)
    yl = y - yh
    product = x*y
    rest = (((xh*yh - product) + xh*yl) + xl*yh) + xl*yl
  end subroutine exact_product

  pure type(pair_t) function sum_of_pairs(x, y) result(found)
    type(pair_t), intent(in) :: x, y
    real(dp) :: total, rest

    call two_sum(x%high, y%high, total, rest)
    rest = rest + (x%low + y%low)
    ! The high parts may have cancelled.
    found%high = total + rest
    found%low = rest - (found%high - total)
  end function sum_of_pairs

  pure type(pair_t) function difference_of_pairs(x, y) result(found)
    type(pair_t), intent(in) :: x, y

    found = sum_of_pairs(x, pair_t(-y%high, -y%low))
  end function difference_of_pairs

  pure type(pair_t) function product_of_pairs(x, y) result(found)
    type(pair_t), intent(in) :: x, y

    call two_product(x%high, y%high, found%high, found%low)
    found%low = found%low + (x%high*y%low + x%low*y%high)
  end function product_of_pairs

  pure type(pair_t) function multiple_of_pair(x, y) result(found)
    type(pair_t), intent(in) :: x
    real(dp), intent(in) :: y

    call scaled(x%high, x%low, y, found%high, found%low)
  end function multiple_of_pair

  pure type(pair_t) function quotient_of_pairs(x, y) result(found)
    type(pair_t), intent(in) :: x
    type(pair_t), intent(in) :: y !! not 0
    real(dp) :: product, rest

    found%high = x%high/y%high
    call two_product(found%high, y%high, product, rest)
    found%low = ((x%high - product) + ((x%low - rest) - found%high*y%low))/y%high
  end function quotient_of_pairs

  pure type(pair_t) function root(x) result(found)
    !! Compute the square root.
    type(pair_t), intent(in) :: x !! above 0

    call square_root(x%high, x%low, found%high, found%low)
  end function root

end module word_pairs

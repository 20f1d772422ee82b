module wide_functions
  !! Square root, sine and cosine in binary128, computed with + - * / alone, because the compiler's
  !! own functions need its library at run time. The root is correctly rounded. Sine and cosine are
  !! computed with twice the bits and then rounded, so that they are the nearest number if the next
  !! 53 bits decide the rounding (80 bits below 2**33 rad). The Python twin computes them with
  !! mpmath, by the same definition.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: binary64, wp => binary128
  use waves, only: ANGLE_BITS
  implicit none(type, external)
  private

  type :: pair_t
    real(wp) :: high
    real(wp) :: low  !! at most half a unit in the last place of high
  end type pair_t

  integer :: i_power
  real(wp), parameter :: POWERS(0:13) = [(2.0_wp**(2**i_power), i_power=0, 13)]
  real(wp), parameter :: UNIT = epsilon(1.0_wp)              ! last place of a root from 1 to 2
  real(wp), parameter :: SPLITTER = 2.0_wp**57 + 1.0_wp
  real(wp), parameter :: QUARTERS = 0.6366197723675813430755350534900574739022_wp  ! 2/pi
  ! pi/2 is the sum of these three numbers.
  real(wp), parameter :: HALF_PI(3) = [1.57079632679489661923132169163975139873953405_wp, &
                                       4.33590506506189051239852201302167612705270725e-35_wp, &
                                       -1.42671545571947929048415935735977663232251099e-69_wp]
  integer, parameter :: N_TERMS = 25  ! up to pi/4 the next term is below 2**-240
  real(wp), parameter :: LEAST = 2.0_wp**(-60) ! rad; a smaller angle is its own sine
  real(wp), parameter :: MOST = 2.0_wp**ANGLE_BITS ! rad; quarters of smaller angles can be counted

  interface sqrt
    module procedure square_root
  end interface sqrt

  interface sin
    module procedure sine
  end interface sin

  interface cos
    module procedure cosine
  end interface cos

  public :: sqrt, sin, cos

contains

  elemental function square_root(x) result(root)
    real(wp), intent(in) :: x
    real(wp) :: root
    real(wp) :: y         ! x divided by a power of 4, from 1 to 4
    real(wp) :: scale     ! square root of that power of 4
    real(wp) :: rest      ! y minus the square of the root, exact
    type(pair_t) :: square
    integer :: i
    intrinsic :: sqrt

    if (.not. x > 0.0_wp .or. x > huge(x)) then
      root = x
      if (x < 0.0_wp) root = (x - x)/(x - x)
      return
    end if

    y = x
    scale = 1.0_wp
    do while (y < 1.0_wp)
      y = y*POWERS(13)
      scale = scale/POWERS(12)
    end do
    do i = 13, 1, -1
      if (y >= POWERS(i)) then
        y = y/POWERS(i)
        scale = scale*POWERS(i - 1)
      end if
    end do

    root = real(sqrt(real(y, binary64)), wp)
    do i = 1, 2
      square = product_of(root, root)
      root = root + ((y - square%high) - square%low)/(2.0_wp*root)
    end do
    ! The root is now less than a unit in the last place away. As multiples of UNIT**2, `rest` and
    ! `root*UNIT` are integers. The error of the root exceeds half a unit if rest > root*UNIT.
    square = product_of(root, root)
    rest = (y - square%high) - square%low
    if (rest > root*UNIT) then
      root = root + UNIT
    else if (rest <= -root*UNIT) then
      root = root - UNIT
    end if
    root = root*scale
  end function square_root

  elemental function sine(angle)
    real(wp), intent(in) :: angle !! rad; the sine is NaN unless |angle| < MOST
    real(wp) :: sine

    if (abs(angle) < LEAST) then
      sine = angle
    else
      sine = sine_later(angle, 0)
    end if
  end function sine

  elemental function cosine(angle)
    real(wp), intent(in) :: angle !! rad; the cosine is NaN unless |angle| < MOST
    real(wp) :: cosine

    cosine = sine_later(angle, 1)
  end function cosine

  elemental function sine_later(angle, quarters_later) result(wave)
    !! Return the sine of the angle plus `quarters_later` right angles, by the Taylor series about
    !! the multiple of a right angle that is nearest to the angle.
    real(wp), intent(in) :: angle
    integer, intent(in) :: quarters_later
    real(wp) :: wave
    type(pair_t) :: rest    ! angle minus the nearest multiple of a right angle
    type(pair_t) :: square
    type(pair_t) :: series
    integer(int64) :: quarter
    integer :: odd          ! 1: the sine of the rest, 0: its cosine
    integer :: k

    if (.not. abs(angle) < MOST) then
      wave = (angle - angle)/(angle - angle)
      return
    end if
    quarter = int(angle*QUARTERS + merge(0.5_wp, -0.5_wp, angle > 0.0_wp), int64)
    rest = less_quarters(angle, real(quarter, wp))
    quarter = modulo(quarter + quarters_later, 4_int64)

    odd = merge(1, 0, mod(quarter, 2_int64) == 0)
    square = product_of_pairs(rest, rest)
    series = pair_t(1.0_wp, 0.0_wp)
    do k = N_TERMS, 1, -1
      series = quotient_of(product_of_pairs(square, series), real((2*k - 1 + odd)*(2*k + odd), wp))
      series = sum_of_pairs(pair_t(1.0_wp, 0.0_wp), pair_t(-series%high, -series%low))
    end do
    if (odd == 1) series = product_of_pairs(rest, series)
    wave = series%high
    if (quarter > 1) wave = -wave
  end function sine_later

  elemental function less_quarters(angle, quarters) result(rest)
    !! Return the angle minus `quarters` right angles; the digits of pi/2 are in three numbers.
    real(wp), intent(in) :: angle
    real(wp), intent(in) :: quarters
    type(pair_t) :: rest
    type(pair_t) :: part
    integer :: i

    rest = pair_t(angle, 0.0_wp)
    do i = 1, 3
      part = product_of(quarters, HALF_PI(i))
      rest = sum_of_pairs(rest, pair_t(-part%high, -part%low))
    end do
  end function less_quarters

  elemental function sum_of(a, b) result(pair)
    !! Return the sum and its rounding error (Knuth, as two_sum of two_words.f90).
    real(wp), intent(in) :: a
    real(wp), intent(in) :: b
    type(pair_t) :: pair
    real(wp) :: share

    pair%high = a + b
    share = pair%high - a
    pair%low = (a - (pair%high - share)) + (b - share)
  end function sum_of

  elemental function product_of(a, b) result(pair)
    !! Return the product and its rounding error. The factors are split, as there is no FMA (Dekker,
    !! as exact_product of word_pairs.f90).
    real(wp), intent(in) :: a
    real(wp), intent(in) :: b
    type(pair_t) :: pair
    real(wp) :: a_high
    real(wp) :: a_low
    real(wp) :: b_high
    real(wp) :: b_low

    a_high = SPLITTER*a - (SPLITTER*a - a)
    a_low = a - a_high
    b_high = SPLITTER*b - (SPLITTER*b - b)
    b_low = b - b_high
    pair%high = a*b
    pair%low = ((a_high*b_high - pair%high) + a_high*b_low + a_low*b_high) + a_low*b_low
  end function product_of

  elemental function sum_of_pairs(a, b) result(pair)
    type(pair_t), intent(in) :: a
    type(pair_t), intent(in) :: b
    type(pair_t) :: pair
    type(pair_t) :: lows

    pair = sum_of(a%high, b%high)
    lows = sum_of(a%low, b%low)
    pair = sum_of(pair%high, pair%low + lows%high)
    pair = sum_of(pair%high, pair%low + lows%low)
  end function sum_of_pairs

  elemental function product_of_pairs(a, b) result(pair)
    type(pair_t), intent(in) :: a
    type(pair_t), intent(in) :: b
    type(pair_t) :: pair

    pair = product_of(a%high, b%high)
    pair = sum_of(pair%high, pair%low + (a%high*b%low + a%low*b%high))
  end function product_of_pairs

  elemental function quotient_of(a, divisor) result(pair)
    type(pair_t), intent(in) :: a
    real(wp), intent(in) :: divisor
    type(pair_t) :: pair
    type(pair_t) :: back

    pair%high = a%high/divisor
    back = product_of(pair%high, divisor)
    pair = sum_of(pair%high, (((a%high - back%high) - back%low) + a%low)/divisor)
  end function quotient_of

end module wide_functions

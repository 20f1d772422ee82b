module tape_roots
  !! The first root of a Taylor polynomial in a step.
  use kinds, only: dp
  use tape_values, only: LAST_TERM
  implicit none(type, external)
  private

  real(dp), parameter :: NARROWEST = 2.0_dp**(-40) ! interval without a decision, over the step
  real(dp), parameter :: NEGLIGIBLE = 2.0_dp**(-60) ! part of the terms that shows no sign
  integer, parameter :: MOST_CUTS = 100

  public :: first_root, size_of

contains

  pure subroutine first_root(c, degree, most, nearly, root, touch)
    !! Find the first place in a step where a polynomial becomes negative. Intervals are halved
    !! until bounds of the Taylor polynomial around their middle show that there is no root, or that
    !! the polynomial is monotonic.
    real(dp), intent(in) :: c(0:LAST_TERM)
    integer, intent(in) :: degree
    real(dp), intent(in) :: most, nearly
    real(dp), intent(out) :: root       !! above `most` if there is none
    real(dp), intent(out) :: touch      !! where the polynomial is nearly zero, else -1
    real(dp) :: d(0:LAST_TERM), low, high, width, r, total, spread, bend, power
    integer :: k

    root = 2.0_dp*most
    touch = -1.0_dp
    total = size_of(c(:degree), most)
    if (c(0) > total - c(0) .or. total == 0.0_dp .or. .not. total <= NEGLIGIBLE*huge(total)) return
    low = 0.0_dp
    width = most
    do while (low < most)
      high = min(most, low + width)
      r = 0.5_dp*(high - low)
      d(:degree) = shifted(c(:degree), low + r)
      spread = 0.0_dp
      bend = 0.0_dp
      power = r
      do k = 1, degree
        spread = spread + power*abs(d(k))
        if (k > 1) bend = bend + k*(power/r)*abs(d(k))
        power = power*r
      end do
      if (d(0) > spread) then
        if (abs(d(1)) <= bend .and. d(0) <= nearly*total) touch = low + r
        low = high
        width = 2.0_dp*width
      else if (degree > 0 .and. abs(d(1)) > bend .or. r <= NARROWEST*most &
               .or. abs(d(0)) + spread <= NEGLIGIBLE*total) then
        if (r <= NARROWEST*most) touch = low + r
        if (value_of(c(:degree), high) < 0.0_dp) then
          root = bisected(c(:degree), low, high)
          return
        end if
        low = high
        width = 2.0_dp*width
      else
        width = r
      end if
    end do
  end subroutine first_root

  pure real(dp) function size_of(c, part)
    !! Return the sum of the absolute terms of a polynomial.
    real(dp), intent(in) :: c(0:), part
    integer :: k

    size_of = 0.0_dp
    do k = ubound(c, 1), 0, -1
      size_of = part*size_of + abs(c(k))
    end do
  end function size_of

  pure real(dp) function value_of(c, x)
    real(dp), intent(in) :: c(0:), x
    integer :: k

    value_of = 0.0_dp
    do k = ubound(c, 1), 0, -1
      value_of = x*value_of + c(k)
    end do
  end function value_of

  pure function shifted(c, x) result(d)
    !! Return the coefficients of a polynomial around x (Horner's scheme).
    real(dp), intent(in) :: c(0:), x
    real(dp) :: d(0:ubound(c, 1))
    integer :: j, k

    d = c
    do k = 0, ubound(c, 1) - 1
      do j = ubound(c, 1) - 1, k, -1
        d(j) = d(j) + x*d(j + 1)
      end do
    end do
  end function shifted

  pure real(dp) function bisected(c, below, above)
    !! Return the root between a place where a polynomial is not negative and one where it is.
    real(dp), intent(in) :: c(0:), below, above
    real(dp) :: low, high
    integer :: tries

    low = below
    high = above
    do tries = 1, MOST_CUTS
      bisected = low + 0.5_dp*(high - low)
      if (bisected <= low .or. bisected >= high) exit
      if (value_of(c, bisected) < 0.0_dp) then
        high = bisected
      else
        low = bisected
      end if
    end do
    bisected = high
  end function bisected

end module tape_roots

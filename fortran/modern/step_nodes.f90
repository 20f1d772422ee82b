module step_nodes
  !! Polynomials at the nodes of a step, side by side.
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use kinds, only: dp
  use storage, only: AT_ONCE
  implicit none(type, external)
  private

  interface
    pure subroutine sum_at_nodes(terms, size, to_next_term, to_next, n, order, parts, sums) &
      bind(c, name="sum_at_nodes_level")
      !! Compute the sums of terms of n unknowns from the first power on.
      import :: AT_ONCE, c_double, c_int
      implicit none(type, external)
      integer(c_int), intent(in), value :: size, n, order
      real(c_double), intent(in) :: terms(size) !! from term 0
      integer(c_int), intent(in), value :: to_next_term, to_next !! distances of terms and unknowns
      real(c_double), intent(in) :: parts(AT_ONCE)
      real(c_double), intent(out) :: sums(AT_ONCE, n)
    end subroutine sum_at_nodes
  end interface

  public :: AT_ONCE, parts_from, powers_of, sum_at_nodes

contains

  pure function parts_from(first, nodes) result(parts)
    !! Return the nodes from number `first` on; the last is repeated.
    integer, intent(in) :: first
    real(dp), intent(in) :: nodes(:)
    real(dp) :: parts(AT_ONCE)
    integer :: i

    do i = 1, AT_ONCE
      parts(i) = nodes(min(first + i - 1, size(nodes)))
    end do
  end function parts_from

  pure function powers_of(x, exponent) result(powers)
    !! Return whole powers, each by the same products as if computed alone.
    real(dp), intent(in) :: x(AT_ONCE)
    integer, intent(in) :: exponent !! above 0
    real(dp) :: powers(AT_ONCE), square(AT_ONCE)
    integer :: left

    powers = 1.0_dp
    square = x
    left = exponent
    do
      if (mod(left, 2) == 1) powers = powers*square
      left = left/2
      if (left == 0) exit
      square = square*square
    end do
  end function powers_of

end module step_nodes

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

  ! What is computed once for the nodes of all steps, without the first node, where the step begins.
  type, public :: nodes_t
    real(dp) :: parts(AT_ONCE)  !! of the step
    real(dp) :: powers(AT_ONCE) !! of the parts: the truncation error's share there
    !! Weights of the errors and their rates at the ends, for Hermite's cubic, and of the rates of
    !! an angle and their changes, for its integral.
    real(dp) :: values(AT_ONCE, 4), integrals(AT_ONCE, 4)
  end type nodes_t

  ! Largest error of a polynomial through the nodes, in tolerances; and most parts of a step.
  real(dp), parameter :: LARGEST_ERROR = 0.01_dp, MOST_PARTS = 16.0_dp

  public :: AT_ONCE, divide_step, nodes_of, powers_of, sum_at_nodes

contains

  pure subroutine divide_step(sizes, tolerance, parts, error)
    !! Compute into how many parts a step is divided, so that a polynomial through the nodes of each
    !! has an error within the tolerance, and bound this error.
    !!
    !! With n nodes, the error for f is at most max|w| max|f^(n)|/n!, where w is the product of the
    !! distances from the nodes (Suli and Mayers 2003, An Introduction to Numerical Analysis,
    !! theorem 6.2). In the parts of a step of length 1, max|w| <= 4 (1/(4 parts))^n for Chebyshev
    !! points of the second kind, and f = x^k has max|f^(n)|/n! = binomial(k, n).
    real(dp), intent(in) :: sizes(:)  !! relative sizes of the step's terms from x^n on
    real(dp), intent(in) :: tolerance !! relative
    integer, intent(out) :: parts
    real(dp), intent(out) :: error
    integer, parameter :: N = AT_ONCE + 1
    real(dp) :: binomial, ratio
    integer :: k

    error = 0.0_dp
    binomial = 1.0_dp
    do k = 1, size(sizes)
      error = error + binomial*sizes(k)
      binomial = binomial*real(N + k, dp)/real(k, dp)
    end do
    error = error*4.0_dp*0.25_dp**N
    ratio = error/max(LARGEST_ERROR*tolerance, epsilon(error))
    parts = 1
    if (ratio > 1.0_dp) parts = ceiling(min(MOST_PARTS, ratio**(1.0_dp/N)))
    error = error/real(parts, dp)**N
  end subroutine divide_step

  pure function nodes_of(parts, order) result(found)
    !! Compute the weights for nodes of steps whose series have the order.
    real(dp), intent(in) :: parts(AT_ONCE)
    integer, intent(in) :: order
    type(nodes_t) :: found
    real(dp) :: to_go(AT_ONCE), cube(AT_ONCE), fourth(AT_ONCE)

    to_go = 1.0_dp - parts
    cube = parts*parts*parts
    fourth = parts*cube
    found%parts = parts
    found%powers = powers_of(parts, order + 1)
    found%values(:, 1) = (to_go*to_go)*(1.0_dp + 2.0_dp*parts)
    found%values(:, 2) = (to_go*to_go)*parts
    found%values(:, 3) = (parts*parts)*(1.0_dp + 2.0_dp*to_go)
    found%values(:, 4) = -(parts*parts)*to_go
    found%integrals(:, 1) = parts - cube + 0.5_dp*fourth
    found%integrals(:, 2) = 0.5_dp*parts*parts - 2.0_dp/3.0_dp*cube + 0.25_dp*fourth
    found%integrals(:, 3) = cube - 0.5_dp*fourth
    found%integrals(:, 4) = 0.25_dp*fourth - cube/3.0_dp
  end function nodes_of

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

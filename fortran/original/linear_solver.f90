module linear_solver
  !! Stands for LEQT1F of the IMSL library: A X = B for several right-hand sides.
  !! Crout's order, implicit row scaling, partial pivoting; what is known of it and what
  !! is assumed stands in docs/reconstruction.md.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter :: LARGE = 500 ! order from which a column takes long enough for a look
  integer, parameter, public :: SINGULAR = 129 !! IER: the matrix is algorithmically singular

  public :: factor, leqt1f

contains

  subroutine leqt1f(a, m, n, b, ier)
    !! Solve A X = B. A is overwritten by its factors. If A is algorithmically singular,
    !! IER is 129 and B stays as it was; otherwise IER is 0 and B holds X.
    integer, intent(in) :: m            !! number of right-hand sides
    integer, intent(in) :: n            !! order of A
    real(dp), intent(inout) :: a(n, n)  !! matrix, then its factors
    real(dp), intent(inout) :: b(n, m)  !! right-hand sides, then solutions
    integer, intent(out) :: ier         !! 0 or 129
    integer :: pivot(n)

    call factor(a, n, pivot, ier)
    if (ier == 0) call substitute(a, m, n, pivot, b)
  end subroutine leqt1f

  subroutine factor(a, n, pivot, ier)
    !! A = L U by Crout's order; the first of equal scaled maxima is the pivot.
    integer, intent(in) :: n
    real(dp), intent(inout) :: a(n, n)
    integer, intent(out) :: pivot(n)  !! row exchanged with row j at column j
    integer, intent(out) :: ier
    real(dp) :: scale(n)              !! 1 / largest magnitude of the row
    real(dp) :: biggest
    real(dp) :: scaled
    real(dp) :: total
    real(dp) :: held
    integer :: i
    integer :: j
    integer :: k

    ier = SINGULAR
    pivot = 0
    do i = 1, n
      biggest = 0.0_dp
      do j = 1, n
        if (abs(a(i, j)) > biggest) biggest = abs(a(i, j))
      end do
      if (biggest == 0.0_dp) return
      scale(i) = 1.0_dp/biggest
    end do

    do j = 1, n
      if (n > LARGE) then
        if (interrupt_raised() /= 0) return
      end if
      do i = 1, j - 1
        total = a(i, j)
        do k = 1, i - 1
          total = total - a(i, k)*a(k, j)
        end do
        a(i, j) = total
      end do

      biggest = 0.0_dp
      pivot(j) = j
      do i = j, n
        total = a(i, j)
        do k = 1, j - 1
          total = total - a(i, k)*a(k, j)
        end do
        a(i, j) = total
        scaled = scale(i)*abs(total)
        if (scaled > biggest) then
          biggest = scaled
          pivot(j) = i
        end if
      end do
      if (real(n, dp) + biggest == real(n, dp)) return

      if (pivot(j) /= j) then
        do k = 1, n
          held = a(pivot(j), k)
          a(pivot(j), k) = a(j, k)
          a(j, k) = held
        end do
        scale(pivot(j)) = scale(j)
      end if
      do i = j + 1, n
        a(i, j) = a(i, j)/a(j, j)
      end do
    end do
    ier = 0
  end subroutine factor

  pure subroutine substitute(a, m, n, pivot, b)
    !! X from the factors, each column of B in turn.
    integer, intent(in) :: m
    integer, intent(in) :: n
    real(dp), intent(in) :: a(n, n)
    integer, intent(in) :: pivot(n)
    real(dp), intent(inout) :: b(n, m)
    real(dp) :: total
    integer :: i
    integer :: k
    integer :: l

    do l = 1, m
      do i = 1, n
        total = b(pivot(i), l)
        b(pivot(i), l) = b(i, l)
        do k = 1, i - 1
          total = total - a(i, k)*b(k, l)
        end do
        b(i, l) = total
      end do
      do i = n, 1, -1
        total = b(i, l)
        do k = i + 1, n
          total = total - a(i, k)*b(k, l)
        end do
        b(i, l) = total/a(i, i)
      end do
    end do
  end subroutine substitute

end module linear_solver

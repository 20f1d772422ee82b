module tape_growth
  !! The error amplification of an integration of a tape: the largest norm of the state-transition
  !! matrices from earlier to requested times. The matrices are formed in blocks of steps.
  use kinds, only: dp
  use storage, only: MOST_UNKNOWNS
  implicit none(type, external)
  private

  integer, parameter :: SIDE = 8 ! rows of a matrix that are computed side by side
  integer, parameter :: ROWS = SIDE*((MOST_UNKNOWNS + SIDE - 1)/SIDE) ! the last are 0
  integer, parameter :: STEPS_IN_BLOCK = 4
  integer, parameter :: MOST_BLOCKS = 64 ! even
  integer, parameter :: MOST_STEPS_IN_BLOCK = 2**28 ! within the range of the counter
  real(dp), parameter :: LARGEST = 1e75_dp ! a larger norm would have no further meaning
  ! Of an element, whose unit may be large; a product of two such is in range.
  real(dp), parameter :: LARGEST_ELEMENT = 1e150_dp

  ! Matrices of blocks of steps; element (i, j) is the derivative of unknown i at a block's end by
  ! unknown j at its beginning. Blocks are merged in pairs when the array is full.
  type, public :: transitions_t
    real(dp) :: matrices(ROWS, MOST_UNKNOWNS, MOST_BLOCKS)
    real(dp) :: noise(MOST_UNKNOWNS, MOST_BLOCKS) !! squares of the rounding errors in a block
    logical :: has_row(MOST_BLOCKS) !! whether it has a row of the output before the last
    integer :: n                    !! number of unknowns
    integer :: steps                !! steps in the open block
    integer :: closed
    integer :: steps_a_block
  end type transitions_t

  public :: begin, close_block, count_step, find_growth, MOST_UNKNOWNS

contains

  pure subroutine begin(n, transitions)
    !! Start with no block.
    integer, intent(in) :: n
    type(transitions_t), intent(inout) :: transitions

    transitions%n = n
    transitions%steps = 0
    transitions%closed = 0
    transitions%steps_a_block = STEPS_IN_BLOCK
    transitions%has_row(1) = .false.
  end subroutine begin

  pure subroutine count_step(with_row, transitions, is_full)
    !! Count one more step.
    logical, intent(in) :: with_row        !! whether the step has a row before the last
    type(transitions_t), intent(inout) :: transitions
    logical, intent(out) :: is_full        !! whether the caller must close the block

    associate (t => transitions)
      t%steps = t%steps + 1
      t%has_row(t%closed + 1) = t%has_row(t%closed + 1) .or. with_row
      ! Perturbations may be larger at a row than at later times.
      is_full = t%steps >= t%steps_a_block .or. with_row
    end associate
  end subroutine count_step

  pure subroutine close_block(matrix, noise, transitions)
    !! Store the matrix of the open block; the caller starts a new matrix.
    real(dp), intent(in) :: matrix(:, :)
    real(dp), intent(in) :: noise(:)       !! squares of the rounding errors in it
    type(transitions_t), intent(inout) :: transitions
    integer :: m, n

    associate (t => transitions)
      n = t%n
      t%steps = 0
      t%closed = t%closed + 1
      t%matrices(:, :n, t%closed) = padded(n, matrix)
      t%noise(:n, t%closed) = noise(:n)
      if (t%closed == MOST_BLOCKS) then
        do m = 1, MOST_BLOCKS/2
          t%matrices(:, :n, m) = bounded(composed(n, t%matrices(:, :, 2*m), &
                                                  t%matrices(:, :, 2*m - 1)))
          t%noise(:n, m) = t%noise(:n, 2*m - 1) + t%noise(:n, 2*m)
          t%has_row(m) = t%has_row(2*m - 1) .or. t%has_row(2*m)
        end do
        t%closed = MOST_BLOCKS/2
        t%steps_a_block = min(MOST_STEPS_IN_BLOCK, 2*t%steps_a_block)
      end if
      t%has_row(t%closed + 1) = .false.
    end associate
  end subroutine close_block

  subroutine find_growth(matrix, noise, sizes, transitions, growth, blur)
    !! Find the largest norm from the beginning of any block to any requested time, and the largest
    !! rounding error at a requested time.
    real(dp), intent(in) :: matrix(:, :) !! of the open block
    real(dp), intent(in) :: noise(:)     !! squares of the rounding errors in it
    !! Of the unknowns, to which perturbations are relative; 0 if an unknown does not count.
    real(dp), intent(in) :: sizes(:)
    type(transitions_t), intent(in) :: transitions
    real(dp), intent(out) :: growth, blur !! relative
    real(dp) :: unit(ROWS, MOST_UNKNOWNS), open_block(ROWS, MOST_UNKNOWNS), weights(ROWS)
    integer :: i, m

    associate (n => transitions%n)
      unit(:, :n) = 0.0_dp
      do i = 1, n
        unit(i, i) = 1.0_dp
      end do
      open_block(:, :n) = padded(n, matrix)
      weights = 0.0_dp
      where (sizes(:n) > 0.0_dp) weights(:n) = 1.0_dp/sizes(:n)
      growth = 1.0_dp
      blur = 0.0_dp
      call grow(transitions%closed, open_block, sum_of_squares(n, unit, sqrt(noise), weights) &
                + sum_of_squares(n, open_block, sqrt(noise), weights))
    end associate
    do m = 1, transitions%closed
      if (transitions%has_row(m)) call grow(m, unit, 0.0_dp)
    end do

  contains

    subroutine grow(last, behind, noise_behind)
      !! Update both for the end of block `last`, or for a later time.
      integer, intent(in) :: last
      real(dp), intent(in) :: behind(ROWS, MOST_UNKNOWNS) !! from this end to the time
      real(dp), intent(in) :: noise_behind
      real(dp) :: product(ROWS, MOST_UNKNOWNS), noise_of_block(MOST_UNKNOWNS), squares
      integer :: m

      associate (t => transitions, n => transitions%n)
        product = behind
        squares = noise_behind
        growth = max(growth, norm(n, product, sizes, weights))
        do m = last, 1, -1
          if (growth >= LARGEST) exit
          ! The errors of a block are at its beginning or its end.
          noise_of_block(:n) = sqrt(t%noise(:n, m))
          squares = squares + sum_of_squares(n, product, noise_of_block, weights)
          product(:, :n) = bounded(composed(n, product, t%matrices(:, :, m)))
          squares = squares + sum_of_squares(n, product, noise_of_block, weights)
          growth = max(growth, norm(n, product, sizes, weights))
        end do
        blur = max(blur, min(LARGEST, sqrt(squares)))
      end associate
    end subroutine grow

  end subroutine find_growth

  pure real(dp) function norm(n, a, sizes, weights)
    !! Return nearly the largest singular value of a matrix of relative perturbations; 1 for a
    !! rotation, and for damped motions.
    integer, intent(in) :: n
    real(dp), intent(in) :: a(ROWS, MOST_UNKNOWNS)
    real(dp), intent(in) :: sizes(:), weights(ROWS)

    norm = real(1 - count(sizes(:n) > 0.0_dp), dp) + sum_of_squares(n, a, sizes, weights)
    norm = min(LARGEST, sqrt(max(1.0_dp, norm)))
  end function norm

  pure real(dp) function sum_of_squares(n, a, perturbations, weights)
    !! Return the square of the relative perturbation to which a matrix changes independent ones.
    integer, intent(in) :: n
    real(dp), intent(in) :: a(ROWS, MOST_UNKNOWNS)
    real(dp), intent(in) :: perturbations(:)
    real(dp), intent(in) :: weights(ROWS) !! of the rows, which make the unknowns comparable
    real(dp) :: squares(SIDE)
    integer :: first, j

    squares = 0.0_dp
    do j = 1, n
      do first = 0, n - 1, SIDE
        squares = squares + (a(first + 1:first + SIDE, j) &
                             *(perturbations(j)*weights(first + 1:first + SIDE)))**2
      end do
    end do
    sum_of_squares = sum(squares)
  end function sum_of_squares

  elemental real(dp) function bounded(x)
    !! Limit an element of a derivative to LARGEST_ELEMENT, which also replaces NaN.
    real(dp), intent(in) :: x

    bounded = LARGEST_ELEMENT
    if (abs(x) <= LARGEST_ELEMENT) bounded = x
  end function bounded

  pure function padded(n, matrix) result(rows_too)
    !! Return a bounded matrix with rows of zeros.
    integer, intent(in) :: n
    real(dp), intent(in) :: matrix(:, :)
    real(dp) :: rows_too(ROWS, n)

    rows_too = 0.0_dp
    rows_too(:n, :) = bounded(matrix(:n, :n))
  end function padded

  pure function composed(n, a, b) result(c)
    !! Compute the product of two matrices: the motion of b, then that of a.
    integer, intent(in) :: n
    real(dp), intent(in) :: a(ROWS, MOST_UNKNOWNS), b(ROWS, MOST_UNKNOWNS)
    real(dp) :: c(ROWS, n), column(SIDE)
    integer :: first, j, k

    c = 0.0_dp
    do j = 1, n
      do first = 0, n - 1, SIDE
        column = 0.0_dp
        do k = 1, n
          column = column + a(first + 1:first + SIDE, k)*b(k, j)
        end do
        c(first + 1:first + SIDE, j) = column
      end do
    end do
  end function composed

end module tape_growth

module taylor_error
  !! The truncation error of the steps of a series, and its propagation by the linearised equations.
  !! The state-transition matrix of omega from earlier times to the end is formed in blocks of
  !! steps. The largest norm of that matrix is the error amplification.
  use kinds, only: dp
  use taylor_series, only: series_t
  implicit none(type, external)
  private

  integer, parameter :: STEPS_IN_BLOCK = 8
  integer, parameter :: STEPS_IN_FINE_BLOCK = 2
  integer, parameter :: MOST_BLOCKS = 256 ! even
  ! In a precise integration the amplification is computed at the first rows, and then at most once
  ! in so many steps, to save time.
  integer, parameter :: FIRST_LOOKS = 16, STEPS_BETWEEN_LOOKS = 128
  real(dp), parameter :: RIDGE = 1.001_dp   ! makes the fit work for one pole or none
  real(dp), parameter :: LEAST = tiny(1.0_dp)
  real(dp), parameter :: LEAST_SUM = 0.01_dp ! of the geometric series of a fit
  real(dp), parameter :: MOST_RATIO = 0.7_dp ! of a term to the one before it, in an error
  real(dp), parameter :: FIRST(4) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp] ! selects the first lane
  real(dp), parameter :: WORTH_A_LOOK = 1e6_dp ! amplification from which all blocks are checked
  ! A larger norm or error would have no further meaning. The square of a product of two such
  ! numbers is in range.
  real(dp), parameter :: LARGEST = 1e75_dp
  real(dp), parameter :: UNIT(3, 3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, &
                                               0.0_dp, 0.0_dp, 1.0_dp], [3, 3])

  ! State-transition matrices over blocks of steps. Blocks are merged in pairs when the array is
  ! full.
  type, public :: blocks_t
    real(dp) :: derivatives(3, 3, MOST_BLOCKS) !! of omega at a block's end by omega at its start
    !! The derivative at a block's end by omega at a start within it: of all blocks merged into it,
    !! the start whose derivative has the largest norm. Near the separatrix, a motion amplifies much
    !! only from few starts.
    real(dp) :: largest(3, 3, MOST_BLOCKS)
    logical :: has_row(MOST_BLOCKS) !! whether it has a row of the output before the last
    integer :: steps        !! steps in the open block
    integer :: closed
    integer :: steps_a_block
    logical :: is_merged    !! whether blocks were merged
    integer :: looks        !! rows at which the amplification was computed
    real(dp) :: at_rows     !! the largest amplification at these rows
  end type blocks_t

  public :: begin, count_step, estimate_truncation, estimate_truncation_from_rest, growths_of, &
            likely_remainder, rise, take_thirds

contains

  pure subroutine begin(precise, lanes, blocks)
    !! Set the lanes to no error and to the unit vector of each axis.
    logical, intent(in) :: precise
    real(dp), intent(out) :: lanes(4, 3)
    type(blocks_t), intent(inout) :: blocks

    lanes(1, :) = 0.0_dp
    lanes(2:, :) = UNIT
    blocks%steps = 0
    blocks%closed = 0
    blocks%has_row(1) = .false.
    blocks%is_merged = .false.
    blocks%looks = 0
    blocks%at_rows = 0.0_dp
    blocks%steps_a_block = merge(STEPS_IN_FINE_BLOCK, STEPS_IN_BLOCK, precise)
  end subroutine begin

  pure subroutine estimate_truncation(s, order, unit, left, unseen)
    !! Estimate the sum of the terms of omega that a step leaves out. One pair of poles is fitted to
    !! its last four terms by least squares: v(k + 1) = a v(k) - b v(k - 1). The estimate is
    !! subtracted from the error in lane 1, which is propagated from here on.
    type(series_t), intent(inout) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: unit       !! brings the terms near 1, s/rad
    real(dp), intent(out) :: left(4)   !! truncation error, rad/s
    real(dp), intent(inout) :: unseen  !! sum of squares of what the estimates may lack, rad2/s2
    real(dp), dimension(4) :: uu, vv, uv, ux, vx ! products of the terms
    real(dp) :: x, u, v, w, apart(4)
    real(dp) :: a, b, p, q, ratio
    integer :: i

    do i = 1, 4
      x = unit*s%terms(i, order)
      u = unit*s%terms(i, order - 1)
      v = unit*s%terms(i, order - 2)
      w = unit*s%terms(i, order - 3)
      uu(i) = u*u + v*v
      vv(i) = v*v + w*w
      uv(i) = u*v + v*w
      ux(i) = u*x + v*u
      vx(i) = v*x + w*u
    end do
    call fit_poles((uu(1) + uu(2)) + uu(3), (vv(1) + vv(2)) + vv(3), (uv(1) + uv(2)) + uv(3), &
                   (ux(1) + ux(2)) + ux(3), (vx(1) + vx(2)) + vx(3), a, b)
    do i = 1, 4
      left(i) = a*s%terms(i, order) - b*s%terms(i, order - 1)
    end do
    ! Further terms differ from the fit as the last one does.
    p = (a + b)/max(LEAST_SUM, 1.0_dp + a)
    q = b/max(LEAST_SUM, 1.0_dp + a)
    do i = 1, 4
      apart(i) = (s%terms(i, order) - p*s%terms(i, order - 1) + q*s%terms(i, order - 2))**2
    end do
    ratio = min(MOST_RATIO, sqrt(p*p + abs(q)))
    unseen = unseen + ((apart(1) + apart(2)) + apart(3))*(ratio/(1.0_dp - ratio))**2
    do i = 1, 4
      s%lanes(i, 1) = s%lanes(i, 1) - FIRST(i)*left(1)
      s%lanes(i, 2) = s%lanes(i, 2) - FIRST(i)*left(2)
      s%lanes(i, 3) = s%lanes(i, 3) - FIRST(i)*left(3)
    end do
  end subroutine estimate_truncation

  pure subroutine estimate_truncation_from_rest(s, order, unit, left)
    !! Estimate the truncation error for a body that starts from rest.
    type(series_t), intent(inout) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: unit       !! s/rad
    real(dp), intent(inout) :: left(4) !! the previous estimate, rad/s

    s%lanes(1, :) = s%lanes(1, :) + left(:3)
    call take_thirds(order, s%terms, unit, left)
    s%lanes(1, :) = s%lanes(1, :) - left(:3)
  end subroutine estimate_truncation_from_rest

  pure subroutine fit_poles(uu, vv, uv, ux, vx, a, b)
    !! Fit the pair of poles of v(k + 1) = a v(k) - b v(k - 1). With x, the last term, and u, the
    !! one before, the sum of all further terms is a x - b u.
    real(dp), intent(in) :: uu, vv, uv, ux, vx !! products of the terms
    real(dp), intent(out) :: a, b
    real(dp) :: determinant

    determinant = (RIDGE*uu)*(RIDGE*vv) - uv*uv
    a = (RIDGE*vv)*ux - uv*vx
    b = uv*ux - (RIDGE*uu)*vx
    ! A series that converges has no poles within the step, or nearly within.
    determinant = max((determinant - a) + b, abs(a - b), abs(b), LEAST)
    a = (a - b)/determinant
    b = b/determinant
  end subroutine fit_poles

  pure subroutine take_thirds(order, terms, unit, left)
    !! Estimate the sum of all further terms from groups of three terms, and use it if it is larger.
    !! From rest, a torque that grows with time makes only every third term, and four terms in a row
    !! show nothing.
    integer, intent(in) :: order
    real(dp), intent(in) :: terms(4, 0:order)
    real(dp), intent(in) :: unit       !! brings the terms near 1
    real(dp), intent(inout) :: left(4)
    real(dp), dimension(4, 3) :: x, u, v, w
    real(dp) :: thirds(4)
    real(dp) :: a, b

    x = unit*terms(:, order - 2:order)
    u = unit*terms(:, order - 5:order - 3)
    v = unit*terms(:, order - 8:order - 6)
    w = unit*terms(:, order - 11:order - 9)
    call fit_poles(sum(u*u) + sum(v*v), sum(v*v) + sum(w*w), sum(u*v) + sum(v*w), &
                   sum(u*x) + sum(v*u), sum(v*x) + sum(w*u), a, b)
    thirds = (a*sum(x, dim=2) - b*sum(u, dim=2))/unit
    if (sum(abs(thirds)) > sum(abs(left))) left = thirds
  end subroutine take_thirds

  pure real(dp) function likely_remainder(order, terms)
    !! Return the size of the terms beyond the last if they decay as the last six do. The fit of a
    !! pair of poles may be small by chance, and where there are few steps no other one compensates.
    integer, intent(in) :: order
    real(dp), intent(in) :: terms(4, 0:order)
    real(dp) :: last, before

    last = sum(abs(terms(:, order - 2:order)))
    before = sum(abs(terms(:, order - 5:order - 3)))
    likely_remainder = last*min(0.5_dp, last/max(before, LEAST))
  end function likely_remainder

  pure function rise(factors, w, error)
    !! Compute the rate of change of a perturbation times the step, rad/s.
    real(dp), intent(in) :: factors(3), w(3), error(3)
    real(dp) :: rise(3)

    rise(1) = factors(1)*(w(2)*error(3) + w(3)*error(2))
    rise(2) = factors(2)*(w(1)*error(3) + w(3)*error(1))
    rise(3) = factors(3)*(w(1)*error(2) + w(2)*error(1))
  end function rise

  pure subroutine count_step(precise, with_row, lanes, blocks)
    !! Count one more step. When its block is full, store the derivative and start a new one. A
    !! precise integration continues along axes that rotate with the derivative, so that rounding
    !! errors of large elements are not taken for amplification.
    logical, intent(in) :: precise
    logical, intent(in) :: with_row !! whether the step has a row of the output before the last
    real(dp), intent(inout) :: lanes(4, 3)
    type(blocks_t), intent(inout) :: blocks
    real(dp) :: largest(3, 3)
    integer :: n

    blocks%steps = blocks%steps + 1
    blocks%has_row(blocks%closed + 1) = blocks%has_row(blocks%closed + 1) .or. with_row
    ! Near the separatrix, the amplification may be much larger at a row than where its block ends.
    ! The largest before and after the row counts.
    if (precise .and. with_row) then
      n = (blocks%closed*blocks%steps_a_block + blocks%steps)/STEPS_BETWEEN_LOOKS
      if (blocks%looks < FIRST_LOOKS + n) then
        blocks%looks = blocks%looks + 1
        largest = bounded(lanes(2:, :))
        blocks%at_rows = max(blocks%at_rows, growth_until(blocks%closed, largest, blocks), &
                             growth_until(blocks%closed, UNIT, blocks))
      end if
    end if
    if (blocks%steps < blocks%steps_a_block) return
    blocks%steps = 0
    blocks%closed = blocks%closed + 1
    blocks%derivatives(:, :, blocks%closed) = bounded(lanes(2:, :))
    lanes(1, :) = bounded(lanes(1, :))
    if (precise) then
      call turn_axes(blocks%derivatives(:, :, blocks%closed), lanes)
    else
      lanes(2:, :) = UNIT
    end if
    blocks%largest(:, :, blocks%closed) = blocks%derivatives(:, :, blocks%closed)
    if (blocks%closed < MOST_BLOCKS) then
      blocks%has_row(blocks%closed + 1) = .false.
      return
    end if
    do n = 1, MOST_BLOCKS/2
      associate (second => blocks%derivatives(:, :, 2*n))
        largest = bounded(composed(second, blocks%largest(:, :, 2*n - 1)))
        if (norm(largest) < norm(blocks%largest(:, :, 2*n))) largest = blocks%largest(:, :, 2*n)
        blocks%largest(:, :, n) = largest
        blocks%derivatives(:, :, n) = bounded(composed(second, blocks%derivatives(:, :, 2*n - 1)))
      end associate
      blocks%has_row(n) = blocks%has_row(2*n - 1) .or. blocks%has_row(2*n)
    end do
    blocks%closed = MOST_BLOCKS/2
    blocks%has_row(blocks%closed + 1) = .false.
    blocks%steps_a_block = 2*blocks%steps_a_block
    blocks%is_merged = .true.
  end subroutine count_step

  pure subroutine turn_axes(derivative, lanes)
    !! Orthonormalise the axes in the lanes by Gram and Schmidt; `derivative` has the old axes along
    !! the new axes.
    real(dp), intent(inout) :: derivative(3, 3)
    real(dp), intent(inout) :: lanes(4, 3)
    real(dp) :: length
    integer :: i, j

    derivative = 0.0_dp
    do i = 1, 3
      do j = 1, i - 1
        derivative(i, j) = sum(lanes(i + 1, :)*lanes(j + 1, :))
        lanes(i + 1, :) = lanes(i + 1, :) - derivative(i, j)*lanes(j + 1, :)
      end do
      length = sqrt(sum(lanes(i + 1, :)*lanes(i + 1, :)))
      derivative(i, i) = length
      if (length > 0.0_dp) lanes(i + 1, :) = lanes(i + 1, :)/length
    end do
  end subroutine turn_axes

  pure subroutine growths_of(precise, lanes, blocks, growth, largest)
    !! Compute the largest norms of derivatives by omega at the beginning of any block: `growth` for
    !! omega at the requested times, `largest` for omega at the end of any block.
    logical, intent(in) :: precise
    real(dp), intent(in) :: lanes(4, 3)
    type(blocks_t), intent(in) :: blocks
    real(dp), intent(out) :: growth, largest
    real(dp) :: open_block(3, 3)
    integer :: n

    open_block = bounded(lanes(2:, :))
    growth = growth_until(blocks%closed, open_block, blocks)
    do n = 1, blocks%closed
      if (blocks%has_row(n)) growth = max(growth, growth_until(n, UNIT, blocks))
    end do
    growth = max(growth, blocks%at_rows)
    largest = growth
    if (.not. precise .or. growth < WORTH_A_LOOK) return
    do n = 1, blocks%closed
      largest = max(largest, growth_until(n, UNIT, blocks))
    end do
  end subroutine growths_of

  pure real(dp) function growth_until(last, behind, blocks)
    !! Return the largest norm of the derivative by omega at the beginning of any block up to
    !! `last`.
    integer, intent(in) :: last
    real(dp), intent(in) :: behind(3, 3) !! derivative by omega at the end of the last block
    type(blocks_t), intent(in) :: blocks
    real(dp) :: derivative(3, 3)
    integer :: n

    derivative = behind
    growth_until = norm(derivative)
    do n = last, 1, -1
      if (growth_until >= LARGEST) exit
      if (blocks%is_merged) then
        growth_until = max(growth_until, norm(composed(derivative, blocks%largest(:, :, n))))
      end if
      derivative = composed(derivative, blocks%derivatives(:, :, n))
      growth_until = max(growth_until, norm(derivative))
    end do
  end function growth_until

  pure real(dp) function norm(a)
    !! Return the norm of a matrix of determinant 1: nearly its largest singular value; 1 for a
    !! rotation.
    real(dp), intent(in) :: a(3, 3)
    integer :: i, j

    norm = -2.0_dp
    do j = 1, 3
      do i = 1, 3
        norm = norm + a(i, j)*a(i, j)
      end do
    end do
    norm = min(LARGEST, sqrt(max(1.0_dp, norm)))
  end function norm

  elemental real(dp) function bounded(x)
    !! Limit an element of a derivative, or an error, to LARGEST, which also replaces NaN.
    real(dp), intent(in) :: x

    bounded = sign(LARGEST, x)
    if (abs(x) <= LARGEST) bounded = x
  end function bounded

  pure function composed(a, b)
    !! Compute the product of two derivatives: the motion of b, then that of a. Row i of a
    !! derivative is the image of axis i.
    real(dp), intent(in) :: a(3, 3), b(3, 3)
    real(dp) :: composed(3, 3)
    integer :: j

    do j = 1, 3
      composed(:, j) = b(:, 1)*a(1, j) + b(:, 2)*a(2, j) + b(:, 3)*a(3, j)
    end do
  end function composed

end module taylor_error

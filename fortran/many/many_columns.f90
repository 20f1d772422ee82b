module many_columns
  !! Bodies as the kernels for ensembles read them: each body in a lane, its three components in
  !! columns.
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: bodies_t, i1, LANES
  use kinds, only: dp
  implicit none(type, external)
  private

  type, public :: block_t
    !! The bodies that are in the lanes.
    integer :: there            !! number of bodies
    integer :: last             !! last body that was examined: put into a block or skipped
    integer :: at(LANES)        !! the bodies, ascending; unused lanes repeat the last
    logical :: in_row           !! whether the bodies are consecutive
  end type block_t

  integer, parameter, public :: IN_ORDER(3) = [1, 2, 3]

  public :: any_above_zero, columns_of, equations_of, next_block, odd_axes, put_back, &
            put_rows_back, times_of, turn_axes, turn_back, turned_order

contains

  pure subroutine next_block(n, status, mark, block)
    !! Find the next bodies with this status, as many as there are lanes.
    integer, intent(in) :: n
    integer(i1), intent(in) :: status(n), mark
    type(block_t), intent(inout) :: block  !! block%last is the body to continue after
    integer(i1) :: others
    integer :: first, i, there

    first = block%last
    there = min(LANES, n - first)
    others = 0_i1
    do i = 1, there
      others = ior(others, ieor(status(first + i), mark))
    end do
    block%in_row = others == 0_i1
    if (block%in_row) then
      do i = 1, LANES
        block%at(i) = first + min(i, there)
      end do
      block%last = first + there
    else
      there = 0
      do i = first + 1, n
        block%last = i
        if (status(i) /= mark) cycle
        there = there + 1
        block%at(there) = i
        if (there == LANES) exit
      end do
      if (there > 0) block%at(there + 1:) = block%at(there)
    end if
    block%there = there
  end subroutine next_block

  pure subroutine columns_of(source, block, m, columns, order)
    !! Copy three numbers of each body of a block into its lane. Lanes without a body repeat the
    !! last body.
    real(dp), intent(in), contiguous :: source(:, :)
    type(block_t), intent(in) :: block
    integer, intent(in) :: m         !! number of lanes to fill
    real(dp), intent(inout) :: columns(LANES, 3)
    integer, intent(in) :: order(3)  !! column of each number
    integer :: i, j, there

    there = min(m, block%there)
    if (size(source, 2) == 1) then
      do j = 1, 3
        do i = 1, m
          columns(i, order(j)) = source(j, 1)
        end do
      end do
      return
    else if (block%in_row) then
      call separate(there, source(:, block%at(1):), columns(:, order(1)), columns(:, order(2)), &
                    columns(:, order(3)))
    else
      do j = 1, 3
        do i = 1, there
          columns(i, order(j)) = source(j, block%at(i))
        end do
      end do
    end if
    do j = 1, 3
      do i = there + 1, m
        columns(i, j) = columns(there, j)
      end do
    end do
  end subroutine columns_of

  pure subroutine separate(n, source, first, second, third)
    !! Copy the numbers of consecutive bodies. As the shape is known, this becomes vector code.
    integer, intent(in) :: n
    real(dp), intent(in) :: source(3, n)
    real(dp), dimension(n), intent(inout) :: first, second, third
    integer :: i

    do i = 1, n
      first(i) = source(1, i)
      second(i) = source(2, i)
      third(i) = source(3, i)
    end do
  end subroutine separate

  pure function any_above_zero(n, x) result(found)
    !! Return whether one of n numbers is above 0; unlike that of maxval, the loop is vector code.
    integer, intent(in) :: n
    real(dp), intent(in) :: x(n)
    logical :: found
    integer(int64) :: one
    integer :: i

    one = 0
    do i = 1, n
      one = ior(one, merge(1_int64, 0_int64, x(i) > 0.0_dp))
    end do
    found = one /= 0
  end function any_above_zero

  pure subroutine times_of(times, block, m, t)
    !! Copy the time of each body of a block into its lane.
    real(dp), intent(in), contiguous :: times(:) !! s
    type(block_t), intent(in) :: block
    integer, intent(in) :: m                     !! number of lanes to fill
    real(dp), intent(inout) :: t(LANES)

    if (size(times) == 1) then
      t(:m) = times(1)
    else if (block%in_row) then
      t(:block%there) = times(block%at(1):block%at(block%there))
      t(block%there + 1:m) = t(block%there)
    else
      t(:m) = times(block%at(:m))
    end if
  end subroutine times_of

  pure subroutine put_back(block, columns, results, order)
    !! Copy three numbers of each body from its lane to its column of the results.
    type(block_t), intent(in) :: block
    real(dp), intent(in) :: columns(LANES, 3)
    real(dp), intent(inout), contiguous :: results(:, :)
    integer, intent(in) :: order(3) !! column of each number
    integer :: i, j

    if (block%in_row) then
      call join(block%there, columns(:, order(1)), columns(:, order(2)), columns(:, order(3)), &
                results(:, block%at(1):))
    else
      do j = 1, 3
        do i = 1, block%there
          results(j, block%at(i)) = columns(i, order(j))
        end do
      end do
    end if
  end subroutine put_back

  subroutine put_rows_back(bodies, block, row, columns, order)
    !! Copy three numbers of each body from its lane to a row of its results.
    type(bodies_t), intent(in) :: bodies
    type(block_t), intent(in) :: block
    integer, intent(in) :: row
    real(dp), intent(in) :: columns(LANES, 3)
    integer, intent(in) :: order(3) !! column of each number
    integer :: i, j, place

    place = bodies%places(row)
    do i = 1, block%there
      do j = 1, 3
        bodies%omega_rows(j, place, block%at(i)) = columns(i, order(j))
      end do
    end do
  end subroutine put_rows_back

  pure subroutine join(n, first, second, third, results)
    !! Undo `separate`.
    integer, intent(in) :: n
    real(dp), dimension(n), intent(in) :: first, second, third
    real(dp), intent(inout) :: results(3, n)
    integer :: i

    do i = 1, n
      results(1, i) = first(i)
      results(2, i) = second(i)
      results(3, i) = third(i)
    end do
  end subroutine join

  pure subroutine equations_of(bodies, block, m, a, moments)
    !! Compute A, B, C of equations 13-15, and the divisors of a torque: the moments, or 1 if the
    !! bodies are specified by A, B, C.
    type(bodies_t), intent(in) :: bodies
    type(block_t), intent(in) :: block
    integer, intent(in) :: m
    real(dp), intent(inout) :: a(LANES, 3), moments(LANES, 3)
    real(dp) :: least
    integer :: i

    if (.not. bodies%by_moments) then
      call columns_of(bodies%body, block, m, a, IN_ORDER)
      moments(:m, :) = 1.0_dp
      return
    end if
    call columns_of(bodies%body, block, m, moments, IN_ORDER)
    do i = 1, m
      ! Moments that are not all above 0 give NaN, which every later check of a body finds.
      least = min(moments(i, 1), moments(i, 2), moments(i, 3))
      if (.not. least > 0.0_dp) least = 0.0_dp
      least = least/least
      a(i, 1) = least*((moments(i, 2) - moments(i, 3))/moments(i, 1))
      a(i, 2) = (moments(i, 3) - moments(i, 1))/moments(i, 2)
      a(i, 3) = (moments(i, 1) - moments(i, 2))/moments(i, 3)
    end do
  end subroutine equations_of

  pure subroutine odd_axes(m, a, odd)
    !! Find the axis whose coefficient has another sign than the other two; 0 if all have one sign.
    integer, intent(in) :: m
    real(dp), intent(in) :: a(LANES, 3)
    real(dp), intent(inout) :: odd(LANES) !! 0, 1, 2 or 3
    real(dp) :: with1, with2, with3 ! above 0 if that axis has the sign of another one
    integer :: i

    do i = 1, m
      with2 = max(a(i, 1)*a(i, 2), a(i, 2)*a(i, 3), -a(i, 1)*a(i, 3))
      with3 = max(a(i, 1)*a(i, 3), a(i, 2)*a(i, 3), -a(i, 1)*a(i, 2))
      with1 = max(a(i, 1)*a(i, 2), a(i, 1)*a(i, 3), -a(i, 2)*a(i, 3))
      odd(i) = 1.0_dp
      if (with3 <= 0.0_dp) odd(i) = 3.0_dp
      if (with2 <= 0.0_dp) odd(i) = 2.0_dp
      if (min(with1, with2, with3) > 0.0_dp) odd(i) = 0.0_dp
    end do
  end subroutine odd_axes

  pure function turned_order(odd) result(order)
    !! Return the column to which turn_axes moves each axis.
    real(dp), intent(in) :: odd
    integer :: order(3)

    order = [2, 3, 1]
    if (odd > 1.0_dp) order = IN_ORDER
    if (odd > 2.0_dp) order = [3, 1, 2]
  end function turned_order

  pure subroutine turn_axes(m, odd, v)
    !! Permute the axes cyclically, so that the odd axis becomes the second column.
    integer, intent(in) :: m
    real(dp), intent(in) :: odd(LANES)
    real(dp), intent(inout) :: v(LANES, 3)
    real(dp) :: v1, v2, v3, x, y, z
    integer :: i

    do i = 1, m
      x = v(i, 1)
      y = v(i, 2)
      z = v(i, 3)
      v1 = z
      v2 = x
      v3 = y
      if (odd(i) > 2.0_dp) then
        v1 = y
        v2 = z
        v3 = x
      else if (odd(i) > 1.0_dp) then
        v1 = x
        v2 = y
        v3 = z
      end if
      v(i, 1) = v1
      v(i, 2) = v2
      v(i, 3) = v3
    end do
  end subroutine turn_axes

  pure subroutine turn_back(m, odd, v)
    !! Undo turn_axes. The permutation that moves axis 3 to the middle is undone by the one that
    !! moves axis 1 there.
    integer, intent(in) :: m
    real(dp), intent(in) :: odd(LANES)
    real(dp), intent(inout) :: v(LANES, 3)
    real(dp) :: opposite(LANES)

    opposite(:m) = 4.0_dp - odd(:m)
    call turn_axes(m, opposite, v)
  end subroutine turn_back

end module many_columns

module many_columns
  !! Bodies as the kernels of ensembles read them: a number of each in a lane, three in columns.
  use bodies, only: bodies_t, LANES
  use kinds, only: dp
  implicit none(type, external)
  private

  public :: columns_of, equations_of, odd_axes, turn_axes, turn_back

contains

  pure subroutine columns_of(source, first, m, columns)
    !! Three numbers of bodies first + 1 ..., each in a row of lanes; the last body again where
    !! there are no more.
    real(dp), intent(in), contiguous :: source(:, :)
    integer, intent(in) :: first
    integer, intent(in) :: m         !! lanes to fill
    real(dp), intent(inout) :: columns(LANES, 3)
    integer :: i, j, there

    there = size(source, 2)
    if (there == 1) then
      do j = 1, 3
        do i = 1, m
          columns(i, j) = source(j, 1)
        end do
      end do
      return
    end if
    there = min(m, there - first)
    do i = 1, there
      columns(i, 1) = source(1, first + i)
      columns(i, 2) = source(2, first + i)
      columns(i, 3) = source(3, first + i)
    end do
    do j = 1, 3
      do i = there + 1, m
        columns(i, j) = columns(there, j)
      end do
    end do
  end subroutine columns_of

  pure subroutine equations_of(bodies, first, m, a, moments)
    !! A, B, C of equations 13-15, and by what a torque is divided.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: first, m
    real(dp), intent(inout) :: a(LANES, 3), moments(LANES, 3)
    real(dp) :: least
    integer :: i

    if (.not. bodies%by_moments) then
      call columns_of(bodies%body, first, m, a)
      moments(:m, :) = 1.0_dp
      return
    end if
    call columns_of(bodies%body, first, m, moments)
    do i = 1, m
      ! No body: NaN, which every look at a body finds.
      least = min(moments(i, 1), moments(i, 2), moments(i, 3))
      if (.not. least > 0.0_dp) least = 0.0_dp
      least = least/least
      a(i, 1) = least*((moments(i, 2) - moments(i, 3))/moments(i, 1))
      a(i, 2) = (moments(i, 3) - moments(i, 1))/moments(i, 2)
      a(i, 3) = (moments(i, 1) - moments(i, 2))/moments(i, 3)
    end do
  end subroutine equations_of

  pure subroutine odd_axes(m, a, odd)
    !! The axis whose coefficient has not the sign of the other two; 0: all three have one sign.
    integer, intent(in) :: m
    real(dp), intent(in) :: a(LANES, 3)
    real(dp), intent(inout) :: odd(LANES) !! 0, 1, 2 or 3
    real(dp) :: with1, with2, with3 ! above 0 where that axis is like another
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

  pure subroutine turn_axes(m, odd, v)
    !! The odd axis into the second column, the next into the third.
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
    !! Columns in the order of the body's axes again: what took 3 to the middle takes 1 back there.
    integer, intent(in) :: m
    real(dp), intent(in) :: odd(LANES)
    real(dp), intent(inout) :: v(LANES, 3)
    real(dp) :: opposite(LANES)

    opposite(:m) = 4.0_dp - odd(:m)
    call turn_axes(m, opposite, v)
  end subroutine turn_back

end module many_columns

module taylor_series
  !! The terms of one step by recurrence, and what they say of the next; unroll.py writes out the
  !! marked loops. A term holds the power of the step in it, so that a step ends with a plain sum.
  use, intrinsic :: iso_fortran_env, only: int64
  use euler_equations, only: INVERSE, MOST_ORDER
  use kinds, only: dp
  implicit none(type, external)
  private

  type, public :: series_t
    ! Term k is the coefficient times step**k, rad/s. The products of a column of `left` and one of
    ! `right` are those of equations 13-15, three at once: w2 w3, w1 w3, w1 w2; the fourth is idle.
    real(dp) :: left(4, 0:MOST_ORDER)  !! omega2, omega1, omega1, 0
    real(dp) :: right(4, 0:MOST_ORDER) !! omega3, omega3, omega2, 0
    real(dp) :: sums(4)              !! of products, (rad/s)**2
    real(dp) :: k1(MOST_ORDER)       !! A step over order; with a varying torque the first only
    real(dp) :: k2(MOST_ORDER)       !! B
    real(dp) :: k3(MOST_ORDER)       !! C
    real(dp) :: m(3, MOST_ORDER)     !! what the torque adds to the terms, rad/s
    real(dp) :: tail(3)              !! sum of the terms from 4, rad/s
    real(dp) :: last                 !! size of the last two terms, rad/s
    integer :: order                 !! of the last term
  end type series_t

  public :: expand_constant, expand_varying, fitting, following, scale_of, shorten, size_of

contains

  pure subroutine expand_constant(s, least, most, allowed)
    !! Terms up to the first even order from `least` whose last two are small; constant torque.
    type(series_t), intent(inout) :: s
    integer, intent(in) :: least     !! order
    integer, intent(in) :: most      !! order
    real(dp), intent(in) :: allowed  !! rad/s
    ! unroll: m 1
    s%m(:, 2:) = 0.0_dp
    call expand_varying(s, least, most, allowed)
    ! end unroll
  end subroutine expand_constant

  pure subroutine expand_varying(s, least, most, allowed)
    !! The same with a torque in every term.
    type(series_t), intent(inout) :: s
    integer, intent(in) :: least     !! order
    integer, intent(in) :: most      !! order
    real(dp), intent(in) :: allowed  !! rad/s
    ! unroll: m 28
    real(dp) :: x, y, z
    integer :: i, k

    s%tail = 0.0_dp
    do k = 1, most
      do i = 1, 3
        s%sums(i) = dot_product(s%left(i, 0:k - 1), s%right(i, k - 1:0:-1))
      end do
      x = s%k1(1)*INVERSE(k)*s%sums(1) + s%m(1, k)
      y = s%k2(1)*INVERSE(k)*s%sums(2) + s%m(2, k)
      z = s%k3(1)*INVERSE(k)*s%sums(3) + s%m(3, k)
      s%left(:3, k) = [y, x, x]
      s%right(:3, k) = [z, z, y]
      if (k > 3) s%tail = s%tail + [x, y, z]
      if (k < max(6, least) .or. mod(k, 2) == 1) cycle
      s%order = k
      s%last = size_of(s, k)
      if (s%last <= allowed) exit
    end do
    ! end unroll
  end subroutine expand_varying

  pure subroutine following(h, s, best, share, allowed, decay, next)
    !! The step with which order `best` would just do, from the terms before the last two and the
    !! decay seen in the step before, so that the processor need not wait for the last terms.
    !! The bits of a positive number, read as an integer, are its logarithm: 6 % suffice here.
    real(dp), intent(in) :: h                !! s
    type(series_t), intent(in) :: s
    integer, intent(in) :: best              !! order
    integer(int64), intent(in) :: share      !! 65536 over best
    real(dp), intent(in) :: allowed          !! rad/s
    integer(int64), intent(inout) :: decay   !! logarithm, over two orders
    real(dp), intent(out) :: next            !! s
    integer(int64) :: before                 ! logarithm
    integer(int64) :: change                 ! logarithm
    integer :: k

    k = s%order
    before = transfer(size_of(s, k - 2), before)
    change = transfer(allowed, change) - before - ((best - k + 2)/2)*decay
    change = max(-ishft(2_int64, 52), min(ishft(2_int64, 52), shifta(change, 16)*share))
    next = transfer(transfer(h, change) + change, h)
    decay = transfer(s%last, before) - before
  end subroutine following

  pure real(dp) function size_of(s, k)
    !! Size of the terms k - 1 and k, rad/s.
    type(series_t), intent(in) :: s
    integer, intent(in) :: k

    size_of = (abs(s%left(2, k)) + abs(s%left(2, k - 1))) &
              + (abs(s%left(1, k)) + abs(s%left(1, k - 1))) &
              + (abs(s%right(1, k)) + abs(s%right(1, k - 1)))
  end function size_of

  pure real(dp) function scale_of(s)
    !! Size of the first terms, rad/s: what a body at rest is about to reach.
    type(series_t), intent(in) :: s
    integer :: k

    scale_of = 0.0_dp
    do k = 1, 4
      scale_of = max(scale_of, abs(s%left(2, k)), abs(s%left(1, k)), abs(s%right(1, k)))
    end do
    scale_of = min(scale_of, huge(scale_of))
  end function scale_of

  pure real(dp) function fitting(h, s, allowed)
    !! The step with which the terms at hand would just do.
    real(dp), intent(in) :: h        !! s
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: allowed  !! rad/s
    integer(int64) :: change         ! of the logarithm

    change = (transfer(allowed, change) - transfer(s%last, change))/s%order
    change = max(-ishft(40_int64, 52), min(ishft(40_int64, 52), change))
    fitting = transfer(transfer(h, change) + change, h)
  end function fitting

  pure subroutine shorten(s, ratio)
    !! The terms of a step that is `ratio` times as long.
    type(series_t), intent(inout) :: s
    real(dp), intent(in) :: ratio
    real(dp) :: power
    integer :: k

    power = 1.0_dp
    s%tail = 0.0_dp
    do k = 1, s%order
      power = power*ratio
      s%left(2, k) = s%left(2, k)*power
      s%left(1, k) = s%left(1, k)*power
      s%right(1, k) = s%right(1, k)*power
      if (k > 3) s%tail = s%tail + [s%left(2, k), s%left(1, k), s%right(1, k)]
    end do
  end subroutine shorten

end module taylor_series

module many_fixed
  !! Many bodies under constant torque with a fixed step, side by side: the methods of III.2. The
  !! unknowns are scaled so that a right-hand side is one product and one sum. Each body takes as
  !! many steps as its own time requires. Bodies with a coefficient of 0, or with three coefficients
  !! of one sign, are left to the single-body kernel.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: A_GROUP, bodies_t, i1, LANES, NEEDS_FALLBACK
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use many_columns, only: block_t, columns_of, equations_of, IN_ORDER, next_block, odd_axes, &
                          put_back, times_of, turn_axes, turn_back
  use methods, only: IMPROVED_EULER, RK4, TAYLOR_3
  use statuses, only: COMPLETE
  implicit none(type, external)
  private

  integer, parameter :: PAIR = 2*A_GROUP
  real(dp), parameter :: EXCESS = 1e-6_dp   ! the last step may be longer by this part of a step
  real(dp), parameter :: MOST_STEPS = 1e8_dp
  integer(int64), parameter :: BETWEEN_LOOKS = 100000_int64 ! block steps between interrupt polls
  real(dp), parameter :: FAR = 1e60_dp      ! products of scales from 1/FAR to FAR are finite
  real(dp), parameter :: THIRD = 1.0_dp/3.0_dp

  public :: many_fixed_solve

  type :: scaled_t
    real(dp), dimension(LANES) :: x, y, z          !! scaled omega; x' = y z, y' = -x z, z' = x y
    real(dp), dimension(LANES) :: mx, my, mz       !! torque times half a step
    real(dp), dimension(LANES) :: scale1, scale2, scale3
    real(dp), dimension(LANES) :: odd              !! body's axis that is y; 0: the body is left
  end type scaled_t

contains

  subroutine many_fixed_solve(bodies_at, method, n, omega, status, interrupted) &
    bind(c, name="solve_many_fixed_level")
    !! Compute omega of each marked body at its time. Its status becomes COMPLETE, or NEEDS_FALLBACK
    !! if it is left to the single-body kernel.
    type(c_ptr), intent(in), value :: bodies_at           !! address of a bodies_t, passed through C
    integer(c_int), intent(in), value :: method           !! IMPROVED_EULER, TAYLOR_3 or RK4
    integer(c_int), intent(in), value :: n                !! number of bodies
    real(c_double), intent(inout) :: omega(3, n)          !! rad/s
    integer(i1), intent(inout) :: status(n)
    integer(c_int), intent(out) :: interrupted            !! 1: interrupted by the user
    type(bodies_t), pointer :: bodies
    type(scaled_t) :: s
    type(block_t) :: block
    real(dp), dimension(LANES, 3) :: a, w, constant, moments
    real(dp), dimension(LANES) :: t, h, last
    integer(int64) :: n_steps(LANES)
    integer :: i, m

    call c_f_pointer(bodies_at, bodies)
    interrupted = 0
    if (.not. any(method == [IMPROVED_EULER, TAYLOR_3, RK4])) then
      ! The single-body kernel refuses an unknown method.
      where (status == bodies%mark) status = NEEDS_FALLBACK
      return
    end if
    block%last = 0
    do
      call next_block(n, status, bodies%mark, block)
      if (block%there == 0) exit
      m = PAIR*((block%there + PAIR - 1)/PAIR)
      call equations_of(bodies, block, m, a, moments)
      call columns_of(bodies%constant, block, m, constant, IN_ORDER)
      constant(:m, :) = constant(:m, :)/moments(:m, :)
      call columns_of(bodies%omega0, block, m, w, IN_ORDER)
      call times_of(bodies%times, block, m, t)
      call odd_axes(m, a, s%odd)
      call turn_axes(m, s%odd, a)
      call turn_axes(m, s%odd, constant)
      call turn_axes(m, s%odd, w)
      call count_steps(m, bodies%step, t, n_steps, h, last, s%odd)
      call scale_to(m, h, a, constant, w, s)
      call advance_each(method, m, n_steps, s, interrupted)
      if (interrupted /= 0) return
      call lengthen(m, last, s)
      call advance(method, m, 1_int64, s)
      call scale_back(m, last, s, w)
      call put_back(block, w, omega, IN_ORDER)
      do i = 1, block%there
        status(block%at(i)) = merge(int(COMPLETE, i1), NEEDS_FALLBACK, &
                                    abs(w(i, 1)) + abs(w(i, 2)) + abs(w(i, 3)) <= huge(h))
      end do
    end do
  end subroutine many_fixed_solve

  pure subroutine count_steps(m, step, t, n_steps, h, last, odd)
    !! Count the steps of each body; all but the last have one size.
    integer, intent(in) :: m
    real(dp), intent(in) :: step                  !! s
    real(dp), intent(in) :: t(LANES)              !! s
    integer(int64), intent(inout) :: n_steps(LANES)
    real(dp), intent(inout) :: h(LANES)           !! s
    real(dp), intent(inout) :: last(LANES)        !! last step over the other steps
    real(dp), intent(inout) :: odd(LANES)         !! 0 if left to the single-body kernel
    real(dp) :: count
    integer :: i

    do i = 1, m
      count = max(1.0_dp, aint(abs(t(i))/step + (1.0_dp - EXCESS)))
      if (.not. count <= MOST_STEPS) then
        count = 1.0_dp
        odd(i) = 0.0_dp
      end if
      if (.not. abs(t(i)) <= huge(step)) odd(i) = 0.0_dp
      n_steps(i) = int(count, int64)
      h(i) = sign(step, t(i))
      last(i) = (t(i) - h(i)*(count - 1.0_dp))/h(i)
    end do
  end subroutine count_steps

  subroutine advance_each(method, m, n_steps, s, interrupted)
    !! Take all steps of each body but the last one. A lane that has finished continues as long as
    !! the others need it, and is then reset to its result.
    integer, intent(in) :: method, m
    integer(int64), intent(in) :: n_steps(LANES)
    type(scaled_t), intent(inout) :: s
    integer(c_int), intent(out) :: interrupted
    real(dp), dimension(LANES) :: x, y, z
    integer(int64) :: done, next, piece, unseen
    integer :: i

    interrupted = 0
    done = 0
    unseen = 0
    do
      next = huge(done)
      do i = 1, m
        if (n_steps(i) - 1 == done) then
          x(i) = s%x(i)
          y(i) = s%y(i)
          z(i) = s%z(i)
        else if (n_steps(i) - 1 > done) then
          next = min(next, n_steps(i) - 1)
        end if
      end do
      if (next == huge(done)) exit
      do while (done < next)
        piece = min(next - done, BETWEEN_LOOKS - unseen)
        call advance(method, m, piece, s)
        done = done + piece
        unseen = unseen + piece
        if (unseen == BETWEEN_LOOKS) then
          unseen = 0
          interrupted = merge(1, 0, interrupt_raised() /= 0)
          if (interrupted /= 0) return
        end if
      end do
    end do
    s%x(:m) = x(:m)
    s%y(:m) = y(:m)
    s%z(:m) = z(:m)
  end subroutine advance_each

  pure subroutine scale_to(m, h, a, constant, w, s)
    !! Scale the unknowns; the unit of time is half a step.
    integer, intent(in) :: m
    real(dp), intent(in) :: h(LANES)           !! s
    real(dp), intent(in) :: a(LANES, 3), constant(LANES, 3), w(LANES, 3)
    type(scaled_t), intent(inout) :: s
    real(dp) :: direction, half, odd
    real(dp) :: a1, a2, a3, w1, w2, w3, scale1, scale2, scale3
    integer :: i

    do i = 1, m
      half = 0.5_dp*h(i)
      a1 = a(i, 1)
      a2 = a(i, 2)
      a3 = a(i, 3)
      w1 = w(i, 1)
      w2 = w(i, 2)
      w3 = w(i, 3)
      odd = s%odd(i)
      ! The reversal of all three axes changes the sign of all products.
      direction = sign(half, a1*half)
      scale1 = direction*(sqrt(abs(a2))*sqrt(abs(a3)))
      scale2 = direction*(sqrt(abs(a1))*sqrt(abs(a3)))
      scale3 = direction*(sqrt(abs(a1))*sqrt(abs(a2)))
      ! Products that underflow to 0 do not show the signs of the coefficients.
      if (.not. min(abs(a1*a2), abs(a2*a3), abs(a3*a1)) > 0.0_dp) odd = 0.0_dp
      if (.not. min(abs(scale1), abs(scale2), abs(scale3)) >= 1.0_dp/FAR) odd = 0.0_dp
      if (.not. max(abs(scale1), abs(scale2), abs(scale3)) <= FAR) odd = 0.0_dp
      if (.not. max(abs(w1), abs(w2), abs(w3)) <= FAR) odd = 0.0_dp
      s%odd(i) = odd
      s%scale1(i) = scale1
      s%scale2(i) = scale2
      s%scale3(i) = scale3
      s%x(i) = scale1*w1
      s%y(i) = scale2*w2
      s%z(i) = scale3*w3
      s%mx(i) = half*(scale1*constant(i, 1))
      s%my(i) = half*(scale2*constant(i, 2))
      s%mz(i) = half*(scale3*constant(i, 3))
    end do
  end subroutine scale_to

  pure subroutine lengthen(m, factor, s)
    !! Rescale the unknowns to a step that is `factor` times as long.
    integer, intent(in) :: m
    real(dp), intent(in) :: factor(LANES)
    type(scaled_t), intent(inout) :: s
    integer :: i

    do i = 1, m
      s%x(i) = factor(i)*s%x(i)
      s%y(i) = factor(i)*s%y(i)
      s%z(i) = factor(i)*s%z(i)
      s%mx(i) = (factor(i)*factor(i))*s%mx(i)
      s%my(i) = (factor(i)*factor(i))*s%my(i)
      s%mz(i) = (factor(i)*factor(i))*s%mz(i)
    end do
  end subroutine lengthen

  pure subroutine scale_back(m, factor, s, w)
    !! Compute omega about the body's axes; NaN for a body that is left to the single-body kernel.
    integer, intent(in) :: m
    real(dp), intent(in) :: factor(LANES) !! last step over the other steps
    type(scaled_t), intent(in) :: s
    real(dp), intent(inout) :: w(LANES, 3)
    integer :: i

    do i = 1, m
      w(i, 1) = s%x(i)/(factor(i)*s%scale1(i))
      w(i, 2) = s%y(i)/(factor(i)*s%scale2(i))
      w(i, 3) = s%z(i)/(factor(i)*s%scale3(i))
      if (.not. s%odd(i) > 0.0_dp) w(i, 2) = transfer(huge(0_int64), w(i, 2))
    end do
    call turn_back(m, s%odd, w)
  end subroutine scale_back

  pure subroutine advance(method, m, n_steps, s)
    integer, intent(in) :: method, m
    integer(int64), intent(in) :: n_steps
    type(scaled_t), intent(inout) :: s

    select case (method)
    case (IMPROVED_EULER)
      call improved_euler_steps(m, n_steps, s)
    case (TAYLOR_3)
      call taylor_steps(m, n_steps, s)
    case (RK4)
      call runge_kutta_steps(m, n_steps, s)
    case default
      return ! unknown methods are refused before
    end select
  end subroutine advance

  ! unroll: paired
  pure subroutine runge_kutta_steps(m, n_steps, s)
    !! Eq. 31, with as many sums as products, so that neither kind waits for the other; two halves
    !! of the lanes alternate. The increment of a step is not computed from the stages: their
    !! rounding errors are the same from step to step and would dominate after many steps.
    integer, intent(in) :: m
    integer(int64), intent(in) :: n_steps
    type(scaled_t), intent(inout) :: s
    real(dp) :: x, y, z, u, v, w, p1, q1, r1, p2, q2, r2, p3, q3, r3
    integer(int64) :: n
    integer :: i

    do n = 1, n_steps
      do i = 1, m
        x = s%x(i)
        y = s%y(i)
        z = s%z(i)
        p1 = s%mx(i) + y*z
        q1 = s%my(i) - x*z
        r1 = s%mz(i) + x*y
        u = x + p1
        v = y + q1
        w = z + r1
        p2 = s%mx(i) + v*w
        q2 = s%my(i) - u*w
        r2 = s%mz(i) + u*v
        u = x + p2
        v = y + q2
        w = z + r2
        p3 = s%mx(i) + v*w
        q3 = s%my(i) - u*w
        r3 = s%mz(i) + u*v
        p2 = p2 + p3
        q2 = q2 + q3
        r2 = r2 + r3
        u = (x + p3) + p3
        v = (y + q3) + q3
        w = (z + r3) + r3
        p1 = p1 + (s%mx(i) + v*w)
        q1 = q1 + (s%my(i) - u*w)
        r1 = r1 + (s%mz(i) + u*v)
        s%x(i) = x + THIRD*(p1 + 2.0_dp*p2)
        s%y(i) = y + THIRD*(q1 + 2.0_dp*q2)
        s%z(i) = z + THIRD*(r1 + 2.0_dp*r2)
      end do
    end do
  end subroutine runge_kutta_steps
  ! end unroll

  pure subroutine improved_euler_steps(m, n_steps, s)
    !! Eq. 29: improved Euler.
    integer, intent(in) :: m
    integer(int64), intent(in) :: n_steps
    type(scaled_t), intent(inout) :: s
    real(dp) :: x, y, z, u, v, w, p, q, r
    integer(int64) :: n
    integer :: i

    do n = 1, n_steps
      do i = 1, m
        x = s%x(i)
        y = s%y(i)
        z = s%z(i)
        p = s%mx(i) + y*z
        q = s%my(i) - x*z
        r = s%mz(i) + x*y
        u = x + (p + p)
        v = y + (q + q)
        w = z + (r + r)
        s%x(i) = x + (p + (s%mx(i) + v*w))
        s%y(i) = y + (q + (s%my(i) - u*w))
        s%z(i) = z + (r + (s%mz(i) + u*v))
      end do
    end do
  end subroutine improved_euler_steps

  pure subroutine taylor_steps(m, n_steps, s)
    !! Eq. 30: three terms of the Taylor series.
    integer, intent(in) :: m
    integer(int64), intent(in) :: n_steps
    type(scaled_t), intent(inout) :: s
    real(dp) :: x, y, z, p, q, r
    integer(int64) :: n
    integer :: i

    do n = 1, n_steps
      do i = 1, m
        x = s%x(i)
        y = s%y(i)
        z = s%z(i)
        p = s%mx(i) + y*z
        q = s%my(i) - x*z
        r = s%mz(i) + x*y
        s%x(i) = x + 2.0_dp*(p + (q*z + y*r))
        s%y(i) = y + 2.0_dp*(q - (p*z + x*r))
        s%z(i) = z + 2.0_dp*(r + (p*y + x*q))
      end do
    end do
  end subroutine taylor_steps

end module many_fixed

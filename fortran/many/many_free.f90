module many_free
  !! Many torque-free bodies side by side: the closed form of torque_free.f90 in double precision
  !! and without branches. Bodies for which this is not accurate enough, or whose numbers are near
  !! the limits of the range, are left to the single-body kernel.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use bodies, only: A_GROUP, bodies_t, i1, LANES, last_row, NEEDS_FALLBACK, of_body, put_attitude, &
                    put_estimates, RAMPED, with_attitude
  use kinds, only: dp
  use many_circular, only: sine_cosine_lanes
  use many_columns, only: any_above_zero, block_t, columns_of, equations_of, IN_ORDER, next_block, &
                          odd_axes, put_back, put_rows_back, times_of, turn_axes, turn_back, &
                          turned_order
  use many_growth, only: ask_again, bound_phase, ROUNDING, UNSURE
  use many_orbits, only: LEVELS, orbits_t
  use many_turns, only: begin_turns, put_attitudes, turns_t, turn_bodies
  use statuses, only: COMPLETE
  implicit none(type, external)
  private

  real(dp), parameter :: NEARLY_CIRCULAR = 2e-4_dp ! modulus left by them: 4th power is negligible
  ! Bound of the relative rounding error of the frequency; measured errors are at most a quarter of
  ! it.
  real(dp), parameter :: ERROR = 8.0_dp*2.0_dp**(-53)
  real(dp), parameter :: FAR = 1e100_dp ! products of numbers from 1/FAR to FAR are finite
  real(dp), parameter :: UNLIKE = 100.0_dp ! largest ratio of coefficients for the exponential bound
  real(dp), parameter :: NEVER = huge(1.0_dp) ! error that leaves the body to the single-body kernel
  real(dp), parameter :: AT_START = 17.0_dp*ROUNDING ! error at time 0, as in many_left.f90

contains

  subroutine many_free_solve(bodies_at, n, omega, status) bind(c, name="solve_many_free_level")
    !! Compute omega of each marked body at its time, and its attitude if it is specified at time 0.
    !! Its status becomes COMPLETE, or NEEDS_FALLBACK if it is left to the single-body kernel, or
    !! RAMPED if only the series has its attitude there.
    type(c_ptr), intent(in), value :: bodies_at           !! address of a bodies_t, passed through C
    integer(c_int), intent(in), value :: n                !! number of bodies
    real(c_double), intent(inout) :: omega(3, n)          !! rad/s
    integer(i1), intent(inout) :: status(n)
    type(bodies_t), pointer :: bodies
    type(orbits_t) :: o
    type(turns_t) :: turns
    real(dp), dimension(LANES, 3) :: a, w, moments
    real(dp) :: t(LANES), is_left(LANES)
    type(block_t) :: block
    logical :: is_first, is_turned, is_estimated, has_moments, has_rows, each_own
    integer(i1) :: otherwise ! status of a body without a result
    integer :: order(3) ! column of each component; with one body's moments, axes need no turn
    integer :: i, m, row

    call c_f_pointer(bodies_at, bodies)
    block%last = 0
    is_first = .true.
    each_own = size(bodies%body, 2) > 1
    order = IN_ORDER
    is_turned = with_attitude(bodies)
    has_moments = size(bodies%moments, 2) > 0
    otherwise = merge(RAMPED, NEEDS_FALLBACK, has_moments .and. is_turned)
    has_rows = associated(bodies%row_times)
    is_estimated = size(bodies%estimates, 2) > 0
    if (has_rows) is_estimated = size(bodies%estimate_rows, 3) > 0
    do
      call next_block(n, status, bodies%mark, block)
      if (block%there == 0) exit
      m = A_GROUP*((block%there + A_GROUP - 1)/A_GROUP)
      if (is_first .or. each_own) then
        call equations_of(bodies, block, m, a, moments)
        if (has_moments) call columns_of(bodies%moments, block, m, moments, IN_ORDER)
        call odd_axes(m, a, o%odd)
        if (.not. each_own) order = turned_order(o%odd(1))
        call turn_axes(m, o%odd, a)
        if (is_turned) call turn_axes(m, o%odd, moments)
      end if
      call columns_of(bodies%omega0, block, m, w, order)
      if (each_own) call turn_axes(m, o%odd, w)
      if (is_first .or. size(bodies%times, 1) > 1) call times_of(bodies%times, block, m, t)
      is_first = .false.
      call begin(m, bodies%tolerance, a, w, o)
      call find_means(m, o)
      if (is_turned) call begin_turns(m, moments, a, o, turns)
      is_left(:m) = 0.0_dp
      do row = 1, last_row(bodies)
        if (has_rows) t(:m) = bodies%row_times(row)
        if (has_rows .and. .not. abs(t(1)) > 0.0_dp) then
          call put_start(bodies, block, row, o)
        else
          call turn(m, t, o)
          if (any_above_zero(m, o%unsure)) call bound_phase(m, bodies%tolerance, a, t, o)
          if (is_turned) then
            turns%sine(:m) = o%sine(:m)
            turns%cosine(:m) = o%cosine(:m)
          end if
          call descend(m, o)
          call finish(m, o, w)
          if (is_estimated .or. any_above_zero(m, o%unsure)) then
            call ask_again(m, bodies%tolerance, a, w, t, o)
          end if
          if (is_turned) then
            call turn_bodies(m, w, t, o, turns)
            call turn_back(m, o%odd, turns%vector)
            call put_attitudes(m, bodies, block, row, turns, o%error)
          end if
          if (each_own) call turn_back(m, o%odd, w)
          if (has_rows) then
            call put_rows_back(bodies, block, row, w, order)
          else
            call put_back(block, w, omega, order)
          end if
          do i = 1, merge(block%there, 0, is_estimated)
            call put_estimates(bodies, block%at(i), row, o%error(i) + ROUNDING*o%growth(i), &
                               o%growth(i))
          end do
        end if
        do i = 1, m
          if (.not. o%error(i) <= bodies%tolerance) o%unsure(i) = 1.0_dp
          is_left(i) = max(is_left(i), o%unsure(i))
        end do
      end do
      if (block%in_row .and. .not. any_above_zero(block%there, is_left)) then
        status(block%at(1):block%at(block%there)) = COMPLETE
      else
        do i = 1, block%there
          status(block%at(i)) = merge(otherwise, int(COMPLETE, i1), is_left(i) > 0.0_dp)
        end do
      end if
    end do
  end subroutine many_free_solve

  subroutine put_start(bodies, block, row, o)
    !! Store the states at time 0 of the bodies of a block, as the single-body kernel returns them.
    type(bodies_t), intent(in) :: bodies
    type(block_t), intent(in) :: block
    integer, intent(in) :: row
    type(orbits_t), intent(inout) :: o
    real(dp) :: q(4), square, error
    integer :: i, body

    error = AT_START
    if (with_attitude(bodies) .and. size(bodies%moments, 2) > 0) error = ROUNDING ! of the series
    do i = 1, block%there
      body = block%at(i)
      bodies%omega_rows(:, bodies%places(row), body) = bodies%omega0(:, body)
      call put_estimates(bodies, body, row, error, 1.0_dp)
      o%unsure(i) = 0.0_dp
      o%error(i) = o%own_error(i)
      if (.not. with_attitude(bodies)) cycle
      q = bodies%attitude0(:, of_body(size(bodies%attitude0, 2), body))
      square = sum(q**2)
      if (.not. (square <= FAR .and. square >= 1.0_dp/FAR)) o%unsure(i) = 1.0_dp
      call put_attitude(bodies, body, row, q/sqrt(square))
    end do
  end subroutine put_start

  pure subroutine begin(m, tolerance, a, w, o)
    !! Compute everything that does not depend on the time. Axis 2 of an orbit has the coefficient
    !! with the odd sign; omega about axis 3 does not change its sign.
    integer, intent(in) :: m
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: a(LANES, 3), w(LANES, 3)
    type(orbits_t), intent(inout) :: o
    real(dp) :: early, most_unlike
    real(dp) :: a1, a2, a3, w1, w2, w3, s1, s2, s3, first, third, y1, y2, y3, left, right, gap
    integer :: i

    early = log(max(1.0_dp, UNSURE*tolerance/(ROUNDING*sqrt(3.0_dp*UNLIKE))))**2
    most_unlike = merge(UNLIKE, -1.0_dp, early > 0.0_dp)
    do i = 1, m
      a1 = a(i, 1)
      a2 = a(i, 2)
      a3 = a(i, 3)
      w1 = w(i, 1)
      w2 = w(i, 2)
      w3 = w(i, 3)
      left = abs(a1)*(w3*w3)
      right = abs(a3)*(w1*w1)
      gap = left - right
      o%gap(i) = gap
      first = a1
      third = a3
      y1 = w1
      y3 = w3
      if (gap < 0.0_dp) then
        first = a3
        third = a1
        y1 = w3
        y3 = w1
      end if
      o%omega1(i) = y1
      o%omega2(i) = w2
      o%omega3(i) = y3
      o%rate1(i) = first*w2*y3
      o%rate2(i) = a2*y3*y1
      o%rate3(i) = third*y1*w2
      y1 = y1*y1
      y2 = w2*w2
      y3 = y3*y3
      s1 = abs(first)
      s2 = abs(a2)
      s3 = abs(third)
      o%modulus(i) = s1*(s3*y2 + s2*y3)
      o%amplitude2(i) = s1*s3*y2
      o%amplitude3(i) = s1*s2*y3
      o%half_gap(i) = 0.5_dp*(s2*s3*y1 + s1*s3*y2)
      gap = abs(gap)
      o%a(i, 0) = sqrt(o%modulus(i))
      o%b(i, 0) = sqrt(s2*gap)
      o%own_error(i) = ERROR*(left + right)
      if (.not. o%odd(i) > 0.0_dp) o%own_error(i) = NEVER
      ! In units of the square roots of the coefficients, the symmetric part of the Jacobian matrix
      ! has the norm (s1 s3)**(1/2) omega2. The amplification is at most the exponential of its
      ! integral: the first bound, for short times.
      o%rate(i) = NEVER
      if (max(s1, s2, s3) <= most_unlike*min(s1, s2, s3)) o%rate(i) = s3*(s2*y1 + s1*y2)/early
      if (.not. s2 > 0.0_dp) o%own_error(i) = NEVER
      if (.not. o%modulus(i) <= FAR) o%own_error(i) = NEVER
      if (.not. o%modulus(i) >= 1.0_dp/FAR) o%own_error(i) = NEVER
      if (.not. gap <= FAR) o%own_error(i) = NEVER
    end do
  end subroutine begin

  pure subroutine find_means(m, o)
    !! Compute the arithmetic-geometric mean, with the same number of levels for all lanes, and the
    !! effect of the modulus that remains: sn : cn is tan (1 + k**2/4), dn is 1 - k**2/2 sin**2.
    integer, intent(in) :: m
    type(orbits_t), intent(inout) :: o
    real(dp) :: gap, mean, inverse, q, part, last, square, error
    integer :: i, n

    do i = 1, m
      !GCC$ unroll 4
      do n = 1, LEVELS - 1
        o%a(i, n) = 0.5_dp*(o%a(i, n - 1) + o%b(i, n - 1))
        if (n < LEVELS - 1) o%b(i, n) = sqrt(o%a(i, n - 1)*o%b(i, n - 1))
      end do
      ! Square roots and divisions take most of the time: one division serves both the gap and the
      ! mean, and the last geometric mean is the series of mean (1 - q)**(1/2).
      gap = abs(o%gap(i))
      mean = o%a(i, LEVELS - 1)
      inverse = 1.0_dp/(gap*mean)
      ! Where cancellation makes the gap small, the frequency has the relative rounding error of the
      ! gap.
      error = o%own_error(i)*(inverse*mean)
      if (.not. o%own_error(i) < NEVER) error = NEVER
      inverse = inverse*gap
      q = 0.5_dp*(o%a(i, LEVELS - 2) - o%b(i, LEVELS - 2))*inverse
      q = q*q
      part = q*(0.25_dp + q*(0.0625_dp + q*(0.03125_dp + q*0.01953125_dp)))
      inverse = inverse*(1.0_dp + part*(1.0_dp + part*(1.0_dp + part*(1.0_dp + part))))
      last = mean - part*mean
      o%b(i, LEVELS - 1) = last - part*mean
      o%a(i, LEVELS) = last
      square = (part*mean*inverse)*(part*mean*inverse)
      if (.not. part*mean <= NEARLY_CIRCULAR*last) error = NEVER
      o%own_error(i) = error
      o%half_square(i) = 0.5_dp*square
      o%ratio(i) = inverse*(1.0_dp + 0.25_dp*square)
      ! One more level of the mean would subtract this term.
      o%mean(i) = last - 0.25_dp*square*last
    end do
  end subroutine find_means

  pure subroutine turn(m, t, o)
    !! Compute sine and cosine of the phase.
    integer, intent(in) :: m
    real(dp), intent(in) :: t(LANES) !! s
    type(orbits_t), intent(inout) :: o
    real(dp) :: error
    integer :: i

    do i = 1, m
      error = o%own_error(i)
      o%phase(i) = o%mean(i)*t(i)
      o%unsure(i) = 1.0_dp
      if (o%rate(i)*(t(i)*t(i)) <= 1.0_dp) o%unsure(i) = 0.0_dp
      if (.not. abs(t(i)) > 0.0_dp) error = NEVER ! the single-body kernel returns omega0
      o%error(i) = error + error*abs(o%phase(i))
    end do
    call sine_cosine_lanes(m, o%phase, o%sine, o%cosine)
  end subroutine turn

  pure subroutine descend(m, o)
    !! Return to the modulus of the orbit, level by level. Sine and cosine may have a common factor
    !! at each level, so that no level needs a division.
    integer, intent(in) :: m
    type(orbits_t), intent(inout) :: o
    real(dp) :: sine, cosine, numerator, denominator, s2, c2
    integer :: i, n

    do i = 1, m
      sine = o%sine(i)*o%ratio(i)
      cosine = o%cosine(i)
      numerator = 1.0_dp - o%half_square(i)*(o%sine(i)*o%sine(i))
      denominator = 1.0_dp
      !GCC$ unroll 5
      do n = LEVELS, 1, -1
        c2 = cosine*cosine
        s2 = sine*sine
        cosine = cosine*numerator
        sine = sine*denominator
        numerator = c2 + (o%a(i, n)*o%b(i, n - 1))*s2
        denominator = c2 + (o%a(i, n)*o%a(i, n - 1))*s2
      end do
      o%sine(i) = sine
      o%cosine(i) = cosine
      o%numerator(i) = numerator
      o%denominator(i) = denominator
      o%square(i) = s2
    end do
  end subroutine descend

  pure subroutine finish(m, o, w)
    !! Apply the addition theorems of sn, cn, dn, as in torque_free.f90.
    integer, intent(in) :: m
    type(orbits_t), intent(in) :: o
    real(dp), intent(inout) :: w(LANES, 3)
    real(dp) :: s2, c2, both, inverse, dn, fallen, turn
    real(dp) :: u1, u2, u3, near, first, third
    integer :: i

    do i = 1, m
      c2 = o%cosine(i)*o%cosine(i)
      s2 = o%sine(i)*o%sine(i)
      ! One division serves both dn and the common factor.
      both = c2 + s2*o%amplitude3(i)
      inverse = 1.0_dp/(both*o%denominator(i))
      dn = o%numerator(i)*(both*inverse)
      fallen = o%half_gap(i)*o%square(i)*(both*inverse)
      inverse = o%denominator(i)*inverse
      turn = sqrt(c2 + s2*o%modulus(i))*inverse
      u1 = (o%cosine(i)*o%omega1(i) + (o%sine(i)*dn)*o%rate1(i))*turn
      u2 = (o%cosine(i)*dn*o%omega2(i) + o%sine(i)*o%rate2(i))*turn
      u3 = (s2*dn*o%amplitude2(i)*o%omega3(i) + o%sine(i)*o%cosine(i)*o%rate3(i))*inverse
      near = o%omega3(i) + (u3 - fallen*o%omega3(i))
      u3 = merge(near, dn*o%omega3(i) + u3, fallen < 0.5_dp)
      first = u1
      third = u3
      if (o%gap(i) < 0.0_dp) then
        first = u3
        third = u1
      end if
      w(i, 1) = first
      w(i, 2) = u2
      w(i, 3) = third
    end do
  end subroutine finish

end module many_free

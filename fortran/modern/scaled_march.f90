module scaled_march
  !! Runge-Kutta (eq. 31) with three fixed steps at once, in the unknowns of scaled_motion.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use scaled_motion, only: MOST_WAVES, motion_t, turned, versine
  implicit none(type, external)
  private

  integer, parameter :: EXACT_AGAIN = 64     ! groups of four steps between recomputed sines
  real(dp), parameter :: THIRD_PART = 1.0_dp/3.0_dp
  integer, parameter :: BETWEEN_LOOKS = 2**17 - 1 ! passes of the loops between interrupt polls
  ! Steps of twice the length have 16 times the error. The gap between both results is therefore 15
  ! times the error of the shorter steps.
  real(dp), parameter, public :: GAIN = 15.0_dp

  type, public :: marched_t
    !! The result of an integration by steps of h, 2 h and 4 h side by side.
    real(dp) :: x(3)        !! the unknowns at the end, 1/s, without the torque's integral
    real(dp) :: gaps(3, 2)  !! step h minus step 2 h, and step 2 h minus step 4 h
    real(dp) :: top(3)      !! largest size of each unknown, with the integral of the torque
    real(dp) :: spread      !! integral of the second unknown's size over time
    logical :: ended        !! whether the user interrupted
  end type marched_t

  public :: march_constant, march_varying

contains

  subroutine march_constant(motion, start, h, fours, found)
    !! Take groups of four equal steps under constant torque. Steps of twice and of four times the
    !! length are taken alongside, in time that the processor would spend waiting.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: start(3)
    ! start: the unknowns at time 0, 1/s
    real(dp), intent(in) :: h           !! s
    integer, intent(in) :: fours
    ! fours: number of groups of four steps
    type(marched_t), intent(out) :: found
    real(dp) :: x1, x2, x3, a1, a2, a3, b1, b2, b3, c1, c2, c3, d1, d2, d3, p1, p2, p3, m1, m2, m3
    real(dp) :: y(3, 2)                 ! results of the longer steps
    real(dp) :: whole, half, third, sixth          ! parts of a step, s
    real(dp) :: whole_2, half_2, third_2, sixth_2  ! the same for the second unknown, with its sign
    real(dp) :: wholes(2, 2), halves(2, 2), thirds(2, 2), sixths(2, 2) ! both, for the longer steps
    integer :: i, k, n

    whole = h
    half = 0.5_dp*h
    third = THIRD_PART*h
    sixth = 0.5_dp*third
    whole_2 = motion%sign_2*whole
    half_2 = motion%sign_2*half
    third_2 = motion%sign_2*third
    sixth_2 = motion%sign_2*sixth
    wholes(1, :) = [2.0_dp*h, 4.0_dp*h]
    wholes(2, :) = motion%sign_2*wholes(1, :)
    halves = 0.5_dp*wholes
    thirds = THIRD_PART*wholes
    sixths = 0.5_dp*thirds
    m1 = motion%slope(1)
    m2 = motion%sign_2*motion%slope(2)
    m3 = motion%slope(3)
    x1 = start(1)
    x2 = start(2)
    x3 = start(3)
    y(:, 1) = start
    y(:, 2) = start
    found%top = abs(start)
    ! The trapezoidal rule on every second step; its last node gets the weight 1/2 after the loop.
    found%spread = 0.5_dp*found%top(2)
    found%ended = .false.
    do i = 1, 2*fours
      ! eq. 31 with the longer steps
      do k = 1, 1 + mod(i, 2)
        a1 = m1 + y(2, k)*y(3, k)
        a2 = m2 + y(1, k)*y(3, k)
        a3 = m3 + y(1, k)*y(2, k)
        p1 = y(1, k) + halves(1, k)*a1
        p2 = y(2, k) + halves(2, k)*a2
        p3 = y(3, k) + halves(1, k)*a3
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = y(1, k) + halves(1, k)*b1
        p2 = y(2, k) + halves(2, k)*b2
        p3 = y(3, k) + halves(1, k)*b3
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = y(1, k) + wholes(1, k)*c1
        p2 = y(2, k) + wholes(2, k)*c2
        p3 = y(3, k) + wholes(1, k)*c3
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        y(1, k) = ((y(1, k) + sixths(1, k)*a1) + thirds(1, k)*(b1 + c1)) + sixths(1, k)*d1
        y(2, k) = ((y(2, k) + sixths(2, k)*a2) + thirds(2, k)*(b2 + c2)) + sixths(2, k)*d2
        y(3, k) = ((y(3, k) + sixths(1, k)*a3) + thirds(1, k)*(b3 + c3)) + sixths(1, k)*d3
      end do
      ! eq. 31 with the step h
      do n = 1, 2
        a1 = m1 + x2*x3
        a2 = m2 + x1*x3
        a3 = m3 + x1*x2
        p1 = x1 + half*a1
        p2 = x2 + half_2*a2
        p3 = x3 + half*a3
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = x1 + half*b1
        p2 = x2 + half_2*b2
        p3 = x3 + half*b3
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = x1 + whole*c1
        p2 = x2 + whole_2*c2
        p3 = x3 + whole*c3
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        x1 = ((x1 + sixth*a1) + third*(b1 + c1)) + sixth*d1
        x2 = ((x2 + sixth_2*a2) + third_2*(b2 + c2)) + sixth_2*d2
        x3 = ((x3 + sixth*a3) + third*(b3 + c3)) + sixth*d3
      end do
      found%top(1) = max(found%top(1), abs(x1))
      found%top(2) = max(found%top(2), abs(x2))
      found%spread = found%spread + abs(x2)
      found%top(3) = max(found%top(3), abs(x3))
      if (iand(i, BETWEEN_LOOKS) == 0) then
        found%ended = interrupt_raised() /= 0
        if (found%ended) exit
      end if
    end do
    found%spread = 2.0_dp*abs(h)*(found%spread - 0.5_dp*abs(x2))
    found%x = [x1, x2, x3]
    found%gaps(:, 1) = found%x - y(:, 1)
    found%gaps(:, 2) = y(:, 1) - y(:, 2)
  end subroutine march_constant

  subroutine march_varying(motion, start, aside, t_end, fours, found)
    !! Take the steps of march_constant under a torque that varies. The integral of the torque is
    !! exact; the rest is smooth.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: start(3)
    real(dp), intent(in) :: aside(3)     !! offset of the start of the longer steps
    real(dp), intent(in) :: t_end        !! s
    integer, intent(in) :: fours
    type(marched_t), intent(out) :: found
    real(dp) :: x(3)
    real(dp) :: x1, x2, x3, a1, a2, a3, b1, b2, b3, c1, c2, c3, d1, d2, d3, p1, p2, p3, m1, m2, m3
    real(dp) :: y(3, 2)                  ! results of the longer steps
    real(dp) :: whole, half, third, sixth          ! parts of a step, s
    real(dp) :: whole_2, half_2, third_2, sixth_2  ! the same for the second unknown, with its sign
    real(dp) :: wholes(2, 2), halves(2, 2), thirds(2, 2), sixths(2, 2) ! both, for the longer steps
    real(dp) :: s(3, 0:8)    ! integral of the torque at multiples of half a step
    real(dp) :: sines(MOST_WAVES)        ! sines of the waves now
    real(dp) :: versines(MOST_WAVES)
    real(dp) :: turn_sines(MOST_WAVES)   ! sines of half a step
    real(dp) :: turn_versines(MOST_WAVES)
    real(dp) :: h
    logical :: afresh
    integer :: begin, middle, end_, i, k, n

    h = (0.25_dp*t_end)/fours
    whole = h
    half = 0.5_dp*h
    third = THIRD_PART*h
    sixth = 0.5_dp*third
    whole_2 = motion%sign_2*whole
    half_2 = motion%sign_2*half
    third_2 = motion%sign_2*third
    sixth_2 = motion%sign_2*sixth
    wholes(1, :) = [2.0_dp*h, 4.0_dp*h]
    wholes(2, :) = motion%sign_2*wholes(1, :)
    halves = 0.5_dp*wholes
    thirds = THIRD_PART*wholes
    sixths = 0.5_dp*thirds
    do n = 1, motion%resolved
      turn_sines(n) = sin(0.5_dp*h*motion%frequency(n))
      turn_versines(n) = versine(0.5_dp*h*motion%frequency(n))
      sines(n) = 0.0_dp
      versines(n) = 0.0_dp
    end do
    m1 = motion%push(1)
    m2 = motion%sign_2*motion%push(2)
    m3 = motion%push(3)
    x = start
    if (motion%resolved < motion%waves) x = x - turned(motion, x + motion%mean, 0.0_dp)
    x1 = x(1)
    x2 = x(2)
    x3 = x(3)
    y(:, 1) = x + aside
    y(:, 2) = x - GAIN*aside
    found%top = abs(start)
    ! The trapezoidal rule on every second step; its last node gets the weight 1/2 after the loop.
    found%spread = 0.5_dp*found%top(2)
    s(:, 8) = motion%mean
    found%ended = .false.
    do i = 1, 2*fours
      if (mod(i, 2) == 1) then
        afresh = mod(i, 2*EXACT_AGAIN) == 1
        s(:, 0) = s(:, 8)
        do n = 1, 8
          call turn(motion, (2*(i - 1) + 0.5_dp*n)*h, afresh, turn_sines, turn_versines, sines, &
                    versines, s(:, n))
        end do
      end if
      ! eq. 31 with the longer steps
      do k = 1, 1 + mod(i, 2)
        begin = merge(0, 4, mod(i, 2) == 1)
        middle = begin + 2*k
        end_ = begin + 4*k
        p1 = y(1, k) + s(1, begin)
        p2 = y(2, k) + s(2, begin)
        p3 = y(3, k) + s(3, begin)
        a1 = m1 + p2*p3
        a2 = m2 + p1*p3
        a3 = m3 + p1*p2
        p1 = (y(1, k) + halves(1, k)*a1) + s(1, middle)
        p2 = (y(2, k) + halves(2, k)*a2) + s(2, middle)
        p3 = (y(3, k) + halves(1, k)*a3) + s(3, middle)
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = (y(1, k) + halves(1, k)*b1) + s(1, middle)
        p2 = (y(2, k) + halves(2, k)*b2) + s(2, middle)
        p3 = (y(3, k) + halves(1, k)*b3) + s(3, middle)
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = (y(1, k) + wholes(1, k)*c1) + s(1, end_)
        p2 = (y(2, k) + wholes(2, k)*c2) + s(2, end_)
        p3 = (y(3, k) + wholes(1, k)*c3) + s(3, end_)
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        y(1, k) = ((y(1, k) + sixths(1, k)*a1) + thirds(1, k)*(b1 + c1)) + sixths(1, k)*d1
        y(2, k) = ((y(2, k) + sixths(2, k)*a2) + thirds(2, k)*(b2 + c2)) + sixths(2, k)*d2
        y(3, k) = ((y(3, k) + sixths(1, k)*a3) + thirds(1, k)*(b3 + c3)) + sixths(1, k)*d3
      end do
      ! eq. 31 with the step h
      do n = 0, 2, 2
        begin = merge(0, 4, mod(i, 2) == 1) + n
        middle = begin + 1
        end_ = begin + 2
        p1 = x1 + s(1, begin)
        p2 = x2 + s(2, begin)
        p3 = x3 + s(3, begin)
        a1 = m1 + p2*p3
        a2 = m2 + p1*p3
        a3 = m3 + p1*p2
        p1 = (x1 + half*a1) + s(1, middle)
        p2 = (x2 + half_2*a2) + s(2, middle)
        p3 = (x3 + half*a3) + s(3, middle)
        b1 = m1 + p2*p3
        b2 = m2 + p1*p3
        b3 = m3 + p1*p2
        p1 = (x1 + half*b1) + s(1, middle)
        p2 = (x2 + half_2*b2) + s(2, middle)
        p3 = (x3 + half*b3) + s(3, middle)
        c1 = m1 + p2*p3
        c2 = m2 + p1*p3
        c3 = m3 + p1*p2
        p1 = (x1 + whole*c1) + s(1, end_)
        p2 = (x2 + whole_2*c2) + s(2, end_)
        p3 = (x3 + whole*c3) + s(3, end_)
        d1 = m1 + p2*p3
        d2 = m2 + p1*p3
        d3 = m3 + p1*p2
        x1 = ((x1 + sixth*a1) + third*(b1 + c1)) + sixth*d1
        x2 = ((x2 + sixth_2*a2) + third_2*(b2 + c2)) + sixth_2*d2
        x3 = ((x3 + sixth*a3) + third*(b3 + c3)) + sixth*d3
      end do
      found%top(1) = max(found%top(1), abs(x1 + s(1, end_)))
      found%top(2) = max(found%top(2), abs(x2 + s(2, end_)))
      found%spread = found%spread + abs(x2 + s(2, end_))
      found%top(3) = max(found%top(3), abs(x3 + s(3, end_)))
      if (iand(i, BETWEEN_LOOKS) == 0) then
        found%ended = interrupt_raised() /= 0
        if (found%ended) exit
      end if
    end do
    found%spread = 2.0_dp*abs(h)*(found%spread - 0.5_dp*abs(x2 + s(2, 8)))
    x = [x1, x2, x3]
    found%gaps(:, 1) = x - y(:, 1)
    found%gaps(:, 2) = y(:, 1) - y(:, 2)
    if (motion%resolved < motion%waves) x = x + turned(motion, x + s(:, 8), t_end)
    found%x = x
  end subroutine march_varying

  pure subroutine turn(motion, t, afresh, turn_sines, turn_versines, sines, versines, s)
    !! Advance the waves by half a step, and compute the integral of the torque there.
    type(motion_t), intent(in) :: motion
    real(dp), intent(in) :: t                          !! s
    logical, intent(in) :: afresh                      !! compute at t, not from half a step before
    real(dp), intent(in) :: turn_sines(MOST_WAVES)     !! sines of half a step
    real(dp), intent(in) :: turn_versines(MOST_WAVES)
    real(dp), intent(inout) :: sines(MOST_WAVES), versines(MOST_WAVES)
    real(dp), intent(out) :: s(3)
    real(dp) :: turn_cosine, held
    integer :: n

    s = motion%mean + t*(motion%slope + (0.5_dp*t)*motion%climb)
    do n = 1, motion%resolved
      if (afresh) then
        sines(n) = sin(motion%frequency(n)*t)
        versines(n) = versine(motion%frequency(n)*t)
      else
        turn_cosine = 1.0_dp - turn_versines(n)
        held = sines(n)*turn_cosine + (turn_sines(n) - versines(n)*turn_sines(n))
        versines(n) = versines(n)*turn_cosine + (sines(n)*turn_sines(n) + turn_versines(n))
        sines(n) = held
      end if
      s = s + (motion%on_sine(:, n)*sines(n) + motion%on_versine(:, n)*versines(n))
    end do
  end subroutine turn

end module scaled_march

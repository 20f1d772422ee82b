module euler_equations
  !! Euler's equations divided by the moments: omega' = M(t) + (A w2 w3, B w1 w3, C w1 w2).
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_ORDER = 28
  integer :: order_
  real(dp), parameter, public :: INVERSE(MOST_ORDER) = &
                                 [(1.0_dp/real(order_, dp), order_=1, MOST_ORDER)]

  real(dp), parameter :: SMALL_TURN = 1e-8_dp ! rad; its square no longer counts

  public :: sine_cosine, torque_terms

contains

  pure subroutine torque_terms(problem, t, t_low, h, most, m)
    !! What the torque adds to the Taylor terms 1 ... most of omega around t, rad/s.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! rounding of t, s
    real(dp), intent(in) :: h          !! step, s
    integer, intent(in) :: most
    real(dp), intent(out) :: m(3, MOST_ORDER)
    real(dp) :: even(3)                ! derivative 0 of the wave times h, rad/s
    real(dp) :: odd(3)                 ! derivative 1, over the frequency
    real(dp) :: sine, cosine
    integer :: n, k
    integer :: shared                  ! pairs of waves that begin with one frequency
    integer :: waves                   ! added so far

    shared = 0
    waves = 0
    do n = 1, min(problem%n_sines, problem%n_cosines)
      if (problem%sines(4, n) /= problem%cosines(4, n)) exit
      call sine_cosine(problem%sines(4, n), t, t_low, sine, cosine)
      do k = 1, 3
        even(k) = h*(sine*problem%sines(k, n) + cosine*problem%cosines(k, n))
        odd(k) = h*(cosine*problem%sines(k, n) - sine*problem%cosines(k, n))
      end do
      call add_wave(problem%sines(4, n)*h, even, odd, most, waves, m)
      shared = n
    end do
    do n = shared + 1, problem%n_sines
      call sine_cosine(problem%sines(4, n), t, t_low, sine, cosine)
      do k = 1, 3
        even(k) = (h*sine)*problem%sines(k, n)
        odd(k) = (h*cosine)*problem%sines(k, n)
      end do
      call add_wave(problem%sines(4, n)*h, even, odd, most, waves, m)
    end do
    do n = shared + 1, problem%n_cosines
      call sine_cosine(problem%cosines(4, n), t, t_low, sine, cosine)
      do k = 1, 3
        even(k) = (h*cosine)*problem%cosines(k, n)
        odd(k) = (-h*sine)*problem%cosines(k, n)
      end do
      call add_wave(problem%cosines(4, n)*h, even, odd, most, waves, m)
    end do
    if (waves == 0) then
      do k = 1, most
        m(1:3, k) = 0.0_dp
      end do
    end if
    do k = 1, 3
      m(k, 1) = m(k, 1) + h*(problem%constant(k) + problem%rate(k)*t + problem%rate(k)*t_low)
      m(k, 2) = m(k, 2) + (0.5_dp*h)*(h*problem%rate(k))
    end do
  end subroutine torque_terms

  pure subroutine sine_cosine(frequency, t, t_low, sine, cosine)
    !! Sine and cosine of frequency (t + t_low), the second part as a small turn, and with it what
    !! the rounding of the product left out: after 1e5 radians that is worth 1e-11.
    !! As in two_words.f90, which is compiled once and can't be called from every instruction set.
    real(dp), intent(in) :: frequency  !! rad/s
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! s
    real(dp), intent(out) :: sine, cosine
    real(dp) :: angle                  ! rad
    real(dp) :: turn                   ! rad
    real(dp) :: unturned
    real(dp) :: f                      ! the frequency's upper half
    real(dp) :: s                      ! the time's

    f = upper_half(frequency)
    s = upper_half(t)
    angle = frequency*t
    ! Dekker's order: exact, however large the angle.
    turn = frequency*t_low + ((((f*s - angle) + f*(t - s)) + (frequency - f)*s) &
                              + (frequency - f)*(t - s))
    unturned = sin(angle)
    cosine = cos(angle)
    if (abs(turn) <= SMALL_TURN) then
      sine = unturned + turn*cosine
      cosine = cosine - turn*unturned
    else
      sine = unturned*cos(turn) + cosine*sin(turn)
      cosine = cosine*cos(turn) - unturned*sin(turn)
    end if
  end subroutine sine_cosine

  pure real(dp) function upper_half(x)
    !! x in 26 bits, so that products of two such numbers are exact.
    real(dp), intent(in) :: x

    upper_half = transfer(iand(transfer(x, 0_int64), not(ishft(1_int64, 27) - 1_int64)), x)
  end function upper_half

  pure subroutine add_wave(turn, even, odd, most, waves, m)
    !! Derivatives of a wave run even, odd, -even, -odd; sin and cos follow one recurrence.
    real(dp), intent(in) :: turn       !! frequency times step, rad
    real(dp), intent(in) :: even(3)    !! rad/s
    real(dp), intent(in) :: odd(3)     !! rad/s
    integer, intent(in) :: most        !! order, even
    integer, intent(inout) :: waves    !! the first one finds nothing to add to
    real(dp), intent(inout) :: m(3, MOST_ORDER)
    real(dp) :: weight                 ! turn**(k - 1) / k!, its sign included
    integer :: k

    weight = 1.0_dp
    do k = 1, most, 2
      if (waves > 0) then
        m(1:3, k) = m(1:3, k) + weight*even
        weight = weight*(turn*INVERSE(k + 1))
        m(1:3, k + 1) = m(1:3, k + 1) + weight*odd
      else
        m(1:3, k) = weight*even
        weight = weight*(turn*INVERSE(k + 1))
        m(1:3, k + 1) = weight*odd
      end if
      weight = -weight*(turn*INVERSE(min(k + 2, MOST_ORDER)))
    end do
    waves = waves + 1
  end subroutine add_wave

end module euler_equations

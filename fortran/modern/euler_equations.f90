module euler_equations
  !! Euler's equations divided by the moments: omega' = M(t) + (A w2 w3, B w1 w3, C w1 w2).
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: COMPLETE = 0 !! every time was reached
  integer, parameter, public :: OVERFLOW = 2 !! an angular velocity was not finite
  integer, parameter, public :: GAVE_UP = 4  !! more steps would be needed than are allowed
  integer, parameter, public :: MOST_ORDER = 28

  type, public :: torque_t
    real(dp) :: constant(3)            !! 1/s2
    real(dp) :: rate(3)                !! 1/s3
    real(dp), pointer :: sines(:, :)   !! columns: amplitude (3) in 1/s2, frequency in rad/s
    real(dp), pointer :: cosines(:, :) !! the same
  end type torque_t

  public :: torque_terms

contains

  pure subroutine torque_terms(torque, t, t_low, h, most, m)
    !! What the torque adds to the Taylor terms 1 ... most of omega around t, rad/s.
    type(torque_t), intent(in) :: torque
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! rounding of t, s
    real(dp), intent(in) :: h          !! step, s
    integer, intent(in) :: most
    real(dp), intent(out) :: m(MOST_ORDER, 3)
    real(dp) :: even(3)                ! derivative 0 of the wave times h, rad/s
    real(dp) :: odd(3)                 ! derivative 1, over the frequency
    real(dp) :: sine
    real(dp) :: cosine
    integer :: n
    integer :: shared                  ! pairs of waves that begin with one frequency

    m(1, :) = h*(torque%constant + torque%rate*t + torque%rate*t_low)
    m(2, :) = (0.5_dp*h*h)*torque%rate
    m(3:most, :) = 0.0_dp
    shared = 0
    do n = 1, min(size(torque%sines, 2), size(torque%cosines, 2))
      if (torque%sines(4, n) /= torque%cosines(4, n)) exit
      call sine_cosine(torque%sines(4, n), t, t_low, sine, cosine)
      even = h*(sine*torque%sines(:3, n) + cosine*torque%cosines(:3, n))
      odd = h*(cosine*torque%sines(:3, n) - sine*torque%cosines(:3, n))
      call add_wave(torque%sines(4, n)*h, even, odd, most, m)
      shared = n
    end do
    do n = shared + 1, size(torque%sines, 2)
      call sine_cosine(torque%sines(4, n), t, t_low, sine, cosine)
      even = (h*sine)*torque%sines(:3, n)
      odd = (h*cosine)*torque%sines(:3, n)
      call add_wave(torque%sines(4, n)*h, even, odd, most, m)
    end do
    do n = shared + 1, size(torque%cosines, 2)
      call sine_cosine(torque%cosines(4, n), t, t_low, sine, cosine)
      even = (h*cosine)*torque%cosines(:3, n)
      odd = (-h*sine)*torque%cosines(:3, n)
      call add_wave(torque%cosines(4, n)*h, even, odd, most, m)
    end do
  end subroutine torque_terms

  pure subroutine sine_cosine(frequency, t, t_low, sine, cosine)
    !! Sine and cosine of frequency (t + t_low), the second part as a small turn.
    real(dp), intent(in) :: frequency  !! rad/s
    real(dp), intent(in) :: t          !! s
    real(dp), intent(in) :: t_low      !! s
    real(dp), intent(out) :: sine
    real(dp), intent(out) :: cosine
    real(dp) :: turn                   ! rad
    real(dp) :: unturned

    unturned = sin(frequency*t)
    cosine = cos(frequency*t)
    turn = frequency*t_low
    sine = unturned + turn*cosine
    cosine = cosine - turn*unturned
  end subroutine sine_cosine

  pure subroutine add_wave(turn, even, odd, most, m)
    !! Derivatives of a wave run even, odd, -even, -odd; sin and cos follow one recurrence.
    real(dp), intent(in) :: turn       !! frequency times step, rad
    real(dp), intent(in) :: even(3)    !! rad/s
    real(dp), intent(in) :: odd(3)     !! rad/s
    integer, intent(in) :: most
    real(dp), intent(inout) :: m(MOST_ORDER, 3)
    real(dp) :: weight                 ! turn**(k - 1) / k!, its sign included
    integer :: k

    weight = 1.0_dp
    do k = 1, most - 1, 2
      m(k, :) = m(k, :) + weight*even
      weight = weight*(turn/real(k + 1, dp))
      m(k + 1, :) = m(k + 1, :) + weight*odd
      weight = -weight*(turn/real(k + 2, dp))
    end do
  end subroutine add_wave

end module euler_equations

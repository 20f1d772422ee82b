module bodies
  !! Many bodies, each with its start: what the kernels of ensembles are given. An array of one
  !! column is shared by all.
  use, intrinsic :: iso_c_binding, only: c_int8_t
  use kinds, only: dp
  implicit none(type, external)
  private

  integer, parameter, public :: i1 = c_int8_t
  integer, parameter, public :: LANES = 64   !! bodies side by side
  integer, parameter, public :: A_GROUP = 8  !! in the widest register: blocks are filled up to it
  integer(i1), parameter, public :: NEEDS_FALLBACK = -1_i1 !! status: for the single kernel
  ! Status before the kernels of lanes: which of them solves the body. A body's own numbers alone
  ! decide it, so that no result depends on the other bodies of a call.
  integer(i1), parameter, public :: FREE = -2_i1    !! without torque: the closed form
  integer(i1), parameter, public :: STEPPED = -3_i1 !! a constant torque: steps of one size
  integer(i1), parameter, public :: RAMPED = -4_i1  !! a torque without waves: the series
  integer(i1), parameter, public :: WAVED = -5_i1   !! a torque with waves: the series
  integer, parameter, public :: MOST_WAVES = 16 !! in lanes; the single kernel takes any number

  type, public :: bodies_t
    logical :: by_moments       !! I1, I2, I3 and N m; else A, B, C and 1/s2
    real(dp) :: tolerance       !! relative
    real(dp) :: step            !! s, of the methods with a fixed step
    integer :: n                !! starts
    real(dp), pointer, contiguous :: body(:, :)         !! (3, 1 or n)
    real(dp), pointer, contiguous :: constant(:, :)     !! (3, 1 or n)
    real(dp), pointer, contiguous :: rate(:, :)         !! (3, 1 or n)
    real(dp), pointer, contiguous :: sines(:, :, :)     !! (4, waves, 1 or n), as in problem_t
    real(dp), pointer, contiguous :: cosines(:, :, :)   !! (4, waves, 1 or n)
    real(dp), pointer, contiguous :: omega0(:, :)       !! (3, n), rad/s
    real(dp), pointer, contiguous :: times(:)           !! (1 or n), s
    integer(i1) :: mark         !! status of the bodies that a kernel of lanes is called for
    integer :: n_waves          !! the most waves that act on one of them
  end type bodies_t

  public :: acts, coefficients_of, has_torque, of_body

contains

  pure integer function of_body(count, i)
    !! The column of body i in an array of so many.
    integer, intent(in) :: count, i

    of_body = merge(1, i, count == 1)
  end function of_body

  pure function coefficients_of(bodies, i) result(a)
    !! A, B, C of equations 13-15.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    real(dp) :: a(3)

    a = bodies%body(:, of_body(size(bodies%body, 2), i))
    if (bodies%by_moments) a = [(a(2) - a(3))/a(1), (a(3) - a(1))/a(2), (a(1) - a(2))/a(3)]
  end function coefficients_of

  pure logical function acts(wave)
    !! Whether a wave has an amplitude. One that is not finite acts: its body has no result.
    real(dp), intent(in) :: wave(4)  !! as in problem_t

    acts = .not. (abs(wave(1)) <= 0.0_dp .and. abs(wave(2)) <= 0.0_dp .and. abs(wave(3)) <= 0.0_dp &
                  .and. abs(wave(4)) <= huge(wave))
  end function acts

  pure logical function has_torque(vector)
    !! Whether a constant torque or its rate is anything but zero; NaN is.
    real(dp), intent(in) :: vector(3)

    has_torque = .not. (abs(vector(1)) <= 0.0_dp .and. abs(vector(2)) <= 0.0_dp &
                        .and. abs(vector(3)) <= 0.0_dp)
  end function has_torque

end module bodies

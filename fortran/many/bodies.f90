module bodies
  !! Many bodies, each with its start: what the kernels of ensembles are given. An array of one
  !! column is shared by all.
  use, intrinsic :: iso_c_binding, only: c_int8_t
  use kinds, only: dp
  use problem, only: problem_t
  implicit none(type, external)
  private

  integer, parameter, public :: i1 = c_int8_t
  integer, parameter, public :: LANES = 64   !! bodies side by side
  integer, parameter, public :: A_GROUP = 8  !! in the widest register: blocks are filled up to it
  integer(i1), parameter, public :: LEFT = -1_i1 !! status: left to the single kernel

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
    integer, pointer :: given_up => null() !! not 0: by the thread that waits for this one
  end type bodies_t

  public :: coefficients_of, columns_of, has_torque, of_body, single_of

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

  pure logical function has_torque(bodies)
    !! Whether any body has any.
    type(bodies_t), intent(in) :: bodies

    has_torque = size(bodies%sines, 2) + size(bodies%cosines, 2) > 0
    if (.not. has_torque) has_torque = any(abs(bodies%constant) > 0.0_dp)
    if (.not. has_torque) has_torque = any(abs(bodies%rate) > 0.0_dp)
  end function has_torque

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

  pure subroutine single_of(bodies, i, problem, waves)
    !! Body i as a single kernel is given it; its waves are put into `waves`, sines first.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    type(problem_t), intent(inout) :: problem !! its pointers to waves are the caller's
    real(dp), intent(inout) :: waves(:, :)    !! (4, sines and cosines)
    real(dp) :: moments(3)
    integer :: k, n

    moments = 1.0_dp
    if (bodies%by_moments) moments = bodies%body(:, of_body(size(bodies%body, 2), i))
    problem%coefficients = coefficients_of(bodies, i)
    problem%constant = bodies%constant(:, of_body(size(bodies%constant, 2), i))/moments
    problem%rate = bodies%rate(:, of_body(size(bodies%rate, 2), i))/moments
    n = size(bodies%sines, 2)
    problem%n_sines = n
    problem%n_cosines = size(bodies%cosines, 2)
    do k = 1, n
      waves(:, k) = bodies%sines(:, k, of_body(size(bodies%sines, 3), i))
    end do
    do k = 1, problem%n_cosines
      waves(:, n + k) = bodies%cosines(:, k, of_body(size(bodies%cosines, 3), i))
    end do
    do k = 1, n + problem%n_cosines
      waves(:3, k) = waves(:3, k)/moments
    end do
  end subroutine single_of

end module bodies

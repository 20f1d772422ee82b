module space_torque_series
  !! Terms of a Taylor series of omega and the attitude q under a torque about the axes of space. A
  !! term includes its power of the step.
  use kinds, only: dp
  use problem, only: problem_t
  use two_words, only: sine_cosine_of
  implicit none(type, external)
  private

  integer, parameter, public :: MOST_ORDER = 30
  integer, parameter :: LOOKED_AT = 3 ! last terms checked: from rest a ramp makes only every third
  real(dp), parameter, public :: LONGER = 16.0_dp ! largest factor on the step that was tried

  type, public :: series_t
    real(dp) :: w(3, 0:MOST_ORDER)      ! rad/s
    real(dp) :: q(4, 0:MOST_ORDER)
    real(dp) :: torque(3, 0:MOST_ORDER) ! about the axes of space, over the largest moment, 1/s2
    real(dp) :: turned(4, 0:MOST_ORDER) ! (0, torque) q, 1/s2
  end type series_t

  public :: evaluate, expand, fitting, torque_terms

contains

  pure subroutine torque_terms(problem, t, t_low, h, order, s)
    !! Compute the terms of the torque around t. A term of a sine is the previous term of its cosine
    !! times the angle of the step, and vice versa.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: t, t_low, h    !! s
    integer, intent(in) :: order
    type(series_t), intent(inout) :: s
    integer :: n

    s%torque = 0.0_dp
    s%torque(:, 0) = problem%constant + problem%rate*t + problem%rate*t_low
    s%torque(:, 1) = problem%rate*h
    do n = 1, problem%n_sines
      call add_wave_terms(problem%sines(:, n), .true., t, t_low, h, order, s)
    end do
    do n = 1, problem%n_cosines
      call add_wave_terms(problem%cosines(:, n), .false., t, t_low, h, order, s)
    end do
  end subroutine torque_terms

  pure subroutine add_wave_terms(wave, is_sine, t, t_low, h, order, s)
    real(dp), intent(in) :: wave(4)        !! amplitude (3) in 1/s2, frequency in rad/s
    logical, intent(in) :: is_sine
    real(dp), intent(in) :: t, t_low, h    !! s
    integer, intent(in) :: order
    type(series_t), intent(inout) :: s
    real(dp) :: value, slope, turn, kept
    integer :: k

    call sine_cosine_of(wave(4), t, t_low, value, slope)
    if (.not. is_sine) then
      kept = value
      value = slope
      slope = -kept
    end if
    turn = wave(4)*h
    s%torque(:, 0) = s%torque(:, 0) + wave(:3)*value
    do k = 1, order - 1
      kept = value
      value = slope*(turn/k)
      slope = -kept*(turn/k)
      s%torque(:, k) = s%torque(:, k) + wave(:3)*value
    end do
  end subroutine add_wave_terms

  pure subroutine expand(problem, ratios, h, order, s)
    !! Compute terms 1 to `order` of omega and q, by products of series; terms 0 are inputs.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: ratios(3)
    real(dp), intent(in) :: h              !! s
    integer, intent(in) :: order
    type(series_t), intent(inout) :: s
    real(dp) :: products(3)                ! of equations 13-15, (rad/s)**2
    real(dp) :: push(3)                    ! torque about the axes of the body, 1/s2
    real(dp) :: rates(4)                   ! twice the rate of q, 1/s
    integer :: j, k, last

    ! A torque without waves has only terms 0 and 1.
    last = merge(order, 1, problem%n_sines + problem%n_cosines > 0)
    do k = 0, order - 1
      s%turned(:, k) = 0.0_dp
      do j = 0, min(k, last)
        call add_product(s%torque(:, j), s%q(:, k - j), s%turned(:, k))
      end do
      products = 0.0_dp
      push = 0.0_dp
      rates = 0.0_dp
      do j = 0, k
        associate (q => s%q(:, j), w => s%w(:, k - j), x => s%turned(:, k - j), v => s%w(:, j))
          products(1) = products(1) + v(2)*w(3)
          products(2) = products(2) + v(3)*w(1)
          products(3) = products(3) + v(1)*w(2)
          push(1) = push(1) + (q(1)*x(2) - x(1)*q(2)) - (q(3)*x(4) - q(4)*x(3))
          push(2) = push(2) + (q(1)*x(3) - x(1)*q(3)) - (q(4)*x(2) - q(2)*x(4))
          push(3) = push(3) + (q(1)*x(4) - x(1)*q(4)) - (q(2)*x(3) - q(3)*x(2))
          rates(1) = rates(1) - (q(2)*w(1) + q(3)*w(2) + q(4)*w(3))
          rates(2) = rates(2) + (q(1)*w(1) + q(3)*w(3) - q(4)*w(2))
          rates(3) = rates(3) + (q(1)*w(2) + q(4)*w(1) - q(2)*w(3))
          rates(4) = rates(4) + (q(1)*w(3) + q(2)*w(2) - q(3)*w(1))
        end associate
      end do
      s%w(:, k + 1) = (h/(k + 1))*(problem%coefficients*products + ratios*push)
      s%q(:, k + 1) = (0.5_dp*h/(k + 1))*rates
    end do
  end subroutine expand

  pure subroutine add_product(n, q, total)
    !! Add Hamilton's product (0, n) q.
    real(dp), intent(in) :: n(3), q(4)
    real(dp), intent(inout) :: total(4)

    total(1) = total(1) - (n(1)*q(2) + n(2)*q(3) + n(3)*q(4))
    total(2) = total(2) + (n(1)*q(1) + n(2)*q(4) - n(3)*q(3))
    total(3) = total(3) + (n(2)*q(1) + n(3)*q(2) - n(1)*q(4))
    total(4) = total(4) + (n(3)*q(1) + n(1)*q(3) - n(2)*q(2))
  end subroutine add_product

  pure real(dp) function fitting(s, order, local_tolerance, scale)
    !! Return the factor on the step with which the last terms would be as large as allowed; 0 if
    !! they are not finite.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: local_tolerance
    real(dp), intent(in) :: scale   !! largest |omega|, rad/s
    real(dp) :: size
    integer :: k

    fitting = LONGER
    do k = order - LOOKED_AT + 1, order
      size = max(maxval(abs(s%w(:, k)))/max(scale, tiny(scale)), maxval(abs(s%q(:, k))))
      if (.not. size <= huge(size)) then
        fitting = 0.0_dp
        return
      end if
      if (size > 0.0_dp) fitting = min(fitting, exp((log(local_tolerance) - log(size))/k))
    end do
  end function fitting

  pure function evaluate(s, order, part) result(change)
    !! Compute the change of omega and q from the beginning of the step to the fraction `part` of
    !! it.
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: part
    real(dp) :: change(7)
    integer :: k

    change = 0.0_dp
    do k = order, 1, -1
      change(:3) = part*(change(:3) + s%w(:, k))
      change(4:) = part*(change(4:) + s%q(:, k))
    end do
  end function evaluate

end module space_torque_series

module runge_kutta_853
  !! The Runge-Kutta method of order 8 by Dormand and Prince (Hairer, Norsett and Wanner 1993,
  !! section II.5), for a torque that a compiled function of the user computes. Steps, error
  !! estimate and dense output are those of SciPy's DOP853, whose coefficients the caller passes.
  !! Unlike there, the state keeps its rounding errors in a second number.
  use, intrinsic :: iso_c_binding, only: c_double, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW
  use two_words, only: two_sum
  implicit none(type, external)
  private

  integer, parameter :: STAGES = 12
  integer, parameter, public :: MOST_STAGES = 16 !! with those of dense output
  integer, parameter :: END_STAGE = STAGES + 1   ! the rates at the end of the step
  integer, parameter :: INTERPOLATED = 7         ! terms of dense output
  integer, parameter, public :: WIDTH = 7        !! omega and attitude
  integer, parameter :: STEPS_BETWEEN_LOOKS = 100
  real(dp), parameter :: SAFETY = 0.9_dp, LEAST_FACTOR = 0.2_dp, MOST_FACTOR = 10.0_dp
  real(dp), parameter :: EXPONENT = -1.0_dp/8.0_dp
  real(dp), parameter :: SHARE_OF_THIRD = 0.01_dp ! of the error of order 3 in the estimate
  real(dp), parameter :: SHORTEST = 10.0_dp       ! step, in units in the last place of the time
  ! For the choice of the first step.
  real(dp), parameter :: SMALL_RATE = 1e-5_dp, SMALL_PART = 1e-6_dp, FIRST_PART = 0.01_dp
  real(dp), parameter :: NO_RATE = 1e-15_dp, MORE = 100.0_dp, LESS = 1e-3_dp

  type, public :: tableau_t
    !! The rows 1 to 12 of the matrix are the stages, row 13 has the weights, and rows 14 to 16 are
    !! the further stages of dense output.
    real(dp) :: matrix(MOST_STAGES, MOST_STAGES) !! (of a rate, of the stage)
    real(dp) :: nodes(MOST_STAGES)
    real(dp) :: errors(MOST_STAGES, 2)           !! of orders 5 and 3
    real(dp) :: dense(MOST_STAGES, INTERPOLATED - 3)
  end type tableau_t

  abstract interface
    subroutine torque_i(t, omega, attitude, torque, data) bind(c)
      !! Compute the torque about the axes of the body.
      import :: c_double, c_ptr
      implicit none(type, external)
      real(c_double), intent(in), value :: t          !! s
      real(c_double), intent(in) :: omega(3)          !! rad/s
      real(c_double), intent(in) :: attitude(4)
      real(c_double), intent(inout) :: torque(3)
      type(c_ptr), intent(in), value :: data          !! of the user
    end subroutine torque_i
  end interface

  type, public :: driven_body_t
    real(dp) :: coefficients(3)                       !! A, B, C
    real(dp) :: moments(3)                            !! or 1
    procedure(torque_i), pointer, nopass :: torque    !! N m, or 1/s2
    type(c_ptr) :: data
  end type driven_body_t

  type, public :: march_t
    !! What is to be computed, and what was.
    integer :: n                                      !! unknowns: 3, or 7 with the attitude
    real(dp) :: start(WIDTH)                          !! NaN for an attitude that is not computed
    real(dp) :: relative                              !! local tolerance
    real(dp) :: absolute(WIDTH)                       !! local tolerance
    real(dp) :: longest                               !! step, s
    real(dp) :: phase                                 !! at which the integration ends, rad
    integer(int64) :: most                            !! evaluations of the torque
    real(dp), pointer, contiguous :: times(:)         !! ordered away from 0, s
    real(dp), pointer, contiguous :: rows(:, :)       !! (WIDTH, times)
    integer :: n_rows, status
    integer(int64) :: evaluations
    real(dp) :: reached                               !! time, s
    real(dp) :: largest                               !! |omega| so far, rad/s
  end type march_t

  public :: march_853

contains

  subroutine march_853(body, tableau, march)
    !! Compute the states at the times. The status is COMPLETE, GAVE_UP, INTERRUPTED, or OVERFLOW
    !! if the steps become too short or the phase too large.
    type(driven_body_t), intent(in) :: body
    type(tableau_t), intent(in) :: tableau
    type(march_t), intent(inout) :: march
    real(dp) :: k(WIDTH, MOST_STAGES)  ! rates
    real(dp) :: f(WIDTH, INTERPOLATED) ! terms of dense output
    real(dp) :: y(WIDTH), y_low(WIDTH), y_new(WIDTH), y_new_low(WIDTH)
    real(dp) :: t, t_new, t_end, h, length, rate
    integer :: steps
    logical :: was_rejected

    march%n_rows = 0
    march%evaluations = 0
    march%largest = 0.0_dp
    march%status = COMPLETE
    y = march%start
    y_low = 0.0_dp
    y_new = y
    f = 0.0_dp
    t = 0.0_dp
    t_end = march%times(size(march%times))
    rate = maxval(abs(body%coefficients))
    call note(0.0_dp, y)
    call add_rows()
    if (march%n_rows == size(march%times)) return
    k = 0.0_dp
    k(:, 1) = rates(t, y)
    length = first_step()
    steps = 0
    was_rejected = .false.
    do
      length = max(min(length, march%longest), SHORTEST*spacing(t))
      t_new = t + sign(length, t_end)
      if (.not. abs(t_new) < abs(t_end)) t_new = t_end
      h = t_new - t
      call take_step()
      length = abs(h)*factor_of(error_of_step(), was_rejected)
      if (was_rejected) then
        if (length < SHORTEST*spacing(t)) march%status = OVERFLOW
      else
        call note(t_new, y_new)
        call add_rows()
        if (march%n_rows == size(march%times)) return
        t = t_new
        y = y_new
        y_low = y_new_low
        k(:, 1) = k(:, END_STAGE)
        if (rate*abs(t)*maxval(abs(y(:3))) > march%phase) march%status = OVERFLOW
      end if
      steps = steps + 1
      if (march%evaluations > march%most) march%status = GAVE_UP
      if (modulo(steps, STEPS_BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) march%status = INTERRUPTED
      end if
      if (march%status /= COMPLETE) return
    end do

  contains

    subroutine note(time, state)
      real(dp), intent(in) :: time, state(WIDTH)

      march%reached = time
      march%largest = max(march%largest, maxval(abs(state(:3))))
    end subroutine note

    function rates(time, state) result(rate_of)
      !! Return Euler's equations, and the rates of the attitude.
      real(dp), intent(in) :: time, state(WIDTH)
      real(dp) :: rate_of(WIDTH), torque(3)

      torque = 0.0_dp
      call body%torque(time, state(:3), state(4:), torque, body%data)
      march%evaluations = march%evaluations + 1
      associate (w => state(:3), q => state(4:), c => body%coefficients)
        rate_of(:3) = torque/body%moments &
                      + [c(1)*w(2)*w(3), c(2)*w(1)*w(3), c(3)*w(1)*w(2)]
        rate_of(4:) = 0.0_dp
        if (march%n > 3) then
          rate_of(4:) = 0.5_dp*[-w(1)*q(2) - w(2)*q(3) - w(3)*q(4), &
                                w(1)*q(1) + w(3)*q(3) - w(2)*q(4), &
                                w(2)*q(1) - w(3)*q(2) + w(1)*q(4), &
                                w(3)*q(1) + w(2)*q(2) - w(1)*q(3)]
        end if
      end associate
    end function rates

    pure real(dp) function size_of(x, state)
      !! Return the root of the mean square of x over the local tolerances.
      real(dp), intent(in) :: x(WIDTH), state(WIDTH)

      associate (n => march%n)
        size_of = sqrt(sum((x(:n)/(march%absolute(:n) + march%relative*abs(state(:n))))**2)/n)
      end associate
    end function size_of

    real(dp) function first_step()
      !! Return a length for which an Euler step has an error of one hundredth of the tolerance
      !! (Hairer, Norsett and Wanner 1993, section II.4).
      real(dp) :: span, of_state, of_rate, of_change, trial

      span = abs(t_end)
      of_state = size_of(y, y)
      of_rate = size_of(k(:, 1), y)
      trial = SMALL_PART*span
      if (of_state >= SMALL_RATE .and. of_rate >= SMALL_RATE) trial = FIRST_PART*of_state/of_rate
      trial = min(trial, span)
      h = sign(trial, t_end)
      of_change = size_of(rates(h, y + h*k(:, 1)) - k(:, 1), y)/trial
      if (max(of_rate, of_change) <= NO_RATE) then
        first_step = max(SMALL_PART*span, LESS*trial)
      else
        first_step = (FIRST_PART/max(of_rate, of_change))**(-EXPONENT)
      end if
      first_step = min(first_step, MORE*trial, span)
    end function first_step

    subroutine take_step()
      !! Compute the rates of the stages and the state at the end of the step.
      integer :: stage, i

      do stage = 2, STAGES
        k(:, stage) = rates(t + tableau%nodes(stage)*h, y + change(stage))
      end do
      y_new_low = y_low + change(END_STAGE)
      do i = 1, WIDTH
        call two_sum(y(i), y_new_low(i), y_new(i), y_new_low(i))
      end do
      k(:, END_STAGE) = rates(t_new, y_new)
    end subroutine take_step

    pure function change(stage)
      !! Return the change of the state until a stage.
      integer, intent(in) :: stage
      real(dp) :: change(WIDTH)

      change = h*weighted(tableau%matrix(:, stage), stage - 1)
    end function change

    pure function weighted(weights, n) result(total)
      !! Return a sum of the first n rates.
      real(dp), intent(in) :: weights(MOST_STAGES)
      integer, intent(in) :: n
      real(dp) :: total(WIDTH)
      integer :: i

      total = 0.0_dp
      do i = 1, n
        total = total + weights(i)*k(:, i)
      end do
    end function weighted

    pure real(dp) function error_of_step()
      !! Return the estimated error of the step, in tolerances.
      real(dp) :: of_fifth(WIDTH), of_third(WIDTH)
      real(dp) :: scale, fifth, third
      integer :: i

      of_fifth = weighted(tableau%errors(:, 1), END_STAGE)
      of_third = weighted(tableau%errors(:, 2), END_STAGE)
      fifth = 0.0_dp
      third = 0.0_dp
      do i = 1, march%n
        scale = march%absolute(i) + march%relative*max(abs(y(i)), abs(y_new(i)))
        fifth = fifth + (of_fifth(i)/scale)**2
        third = third + (of_third(i)/scale)**2
      end do
      error_of_step = fifth
      if (fifth > 0.0_dp .or. third > 0.0_dp) then
        error_of_step = abs(h)*fifth/sqrt((fifth + SHARE_OF_THIRD*third)*march%n)
      end if
    end function error_of_step

    real(dp) function factor_of(error, is_rejected)
      !! Return the factor on the length of the next attempt. An error may be NaN.
      real(dp), intent(in) :: error
      logical, intent(inout) :: is_rejected !! in: whether the last attempt was; out: this one

      factor_of = SAFETY*max(error, tiny(error))**EXPONENT
      if (error < 1.0_dp) then
        factor_of = min(factor_of, merge(1.0_dp, MOST_FACTOR, is_rejected))
        is_rejected = .false.
      else
        factor_of = merge(max(factor_of, LEAST_FACTOR), LEAST_FACTOR, error <= huge(error))
        is_rejected = .true.
      end if
    end function factor_of

    subroutine add_rows()
      !! Compute the states at the times within the step.
      real(dp) :: part
      logical :: is_prepared
      integer :: i

      is_prepared = .false.
      do while (march%n_rows < size(march%times))
        associate (time => march%times(march%n_rows + 1))
          if (abs(time) > abs(march%reached)) exit
          march%n_rows = march%n_rows + 1
          if (.not. abs(time) < abs(march%reached)) then
            march%rows(:, march%n_rows) = y_new
            cycle
          end if
          if (.not. is_prepared) call prepare_dense_output()
          is_prepared = .true.
          part = (time - t)/h
          associate (row => march%rows(:, march%n_rows))
            row = 0.0_dp
            do i = INTERPOLATED, 1, -1
              row = (row + f(:, i))*merge(part, 1.0_dp - part, modulo(i, 2) == 1)
            end do
            row = y + (row + y_low)
          end associate
        end associate
      end do
    end subroutine add_rows

    subroutine prepare_dense_output()
      !! Compute the terms of dense output in the step.
      integer :: stage, i

      do stage = END_STAGE + 1, MOST_STAGES
        k(:, stage) = rates(t + tableau%nodes(stage)*h, y + change(stage))
      end do
      f(:, 1) = (y_new - y) + (y_new_low - y_low)
      f(:, 2) = h*k(:, 1) - f(:, 1)
      f(:, 3) = 2.0_dp*f(:, 1) - h*(k(:, END_STAGE) + k(:, 1))
      do i = 4, INTERPOLATED
        f(:, i) = h*weighted(tableau%dense(:, i - 3), MOST_STAGES)
      end do
    end subroutine prepare_dense_output

  end subroutine march_853

end module runge_kutta_853

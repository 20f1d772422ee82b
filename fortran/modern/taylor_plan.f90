module taylor_plan
  !! The plan of a Taylor series. Its order follows from the tolerance, its first step from the
  !! rates of the problem. Its local tolerance is the largest error of a step, relative to the
  !! scale.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t
  use series, only: LEAST_LOCAL_TOLERANCE, LEAST_ORDER, MOST_ORDER
  implicit none(type, external)
  private

  real(dp), parameter :: ALIKE = 0.05_dp ! weight of a radian of a wave in the local tolerance

  ! Factor on the local tolerance with attitude, whose errors add to those of omega. Without it one
  ! scene in six is integrated twice over 30 s.
  real(dp), parameter :: WITH_ATTITUDE_TOO = 0.25_dp

  ! Order of precise variations at the smallest local tolerance: enough for 1e6 radians.
  integer, parameter :: ORDER_FINEST = 18

  public :: add_wave_rates, first_step, local_tolerance_of, order_of_variations, plan, steady_rates

contains

  pure subroutine plan(problem, scale, tolerance, time, with_attitude, order, local_tolerance, h)
    !! Choose the order from the tolerance, and the first step from the rates of the problem.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: scale           !! largest |omega|, rad/s
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: time            !! time to go, s
    logical, intent(in) :: with_attitude    !! the attitude rotates even if omega is steady
    integer, intent(out) :: order
    real(dp), intent(out) :: local_tolerance !! largest last terms over the scale
    real(dp), intent(out) :: h              !! s
    real(dp) :: coupling
    real(dp) :: push                        ! largest torque over moment, rad/s2
    real(dp) :: ramp                        ! its largest rate, rad/s3
    real(dp) :: gain                        ! omega that torques may add, rad/s
    real(dp) :: rate                        ! rate of change, 1/s
    real(dp) :: turned                      ! angle of the waves, rad
    real(dp) :: part                        ! of the tolerance
    integer :: n

    turned = 0.0_dp
    coupling = max(abs(problem%coefficients(1)), abs(problem%coefficients(2)), &
                   abs(problem%coefficients(3)))
    push = max(abs(problem%constant(1)), abs(problem%constant(2)), abs(problem%constant(3)))
    ramp = max(abs(problem%rate(1)), abs(problem%rate(2)), abs(problem%rate(3)))
    call steady_rates(coupling, scale, push, ramp, time, gain, rate)
    do n = 1, problem%n_sines
      call add_wave_rates(problem%sines(:, n), .true., coupling, time, gain, rate, turned)
    end do
    do n = 1, problem%n_cosines
      call add_wave_rates(problem%cosines(:, n), .false., coupling, time, gain, rate, turned)
    end do
    if (with_attitude) coupling = max(coupling, 1.0_dp)
    h = first_step(rate, time)
    part = merge(WITH_ATTITUDE_TOO, 1.0_dp, with_attitude)
    local_tolerance = local_tolerance_of(coupling, scale, gain, turned, part*tolerance, time)
    order = order_for(local_tolerance)
  end subroutine plan

  elemental subroutine steady_rates(coupling, scale, push, ramp, time, gain, rate)
    !! Compute the contributions of the free motion and of the constant and linear torque.
    real(dp), intent(in) :: coupling        !! largest of |A|, |B|, |C|
    real(dp), intent(in) :: scale           !! largest |omega|, rad/s
    real(dp), intent(in) :: push            !! rad/s2
    real(dp), intent(in) :: ramp            !! rad/s3
    real(dp), intent(in) :: time            !! time to go, s
    real(dp), intent(out) :: gain           !! omega that the torque may add, rad/s
    real(dp), intent(out) :: rate           !! rate of change, 1/s

    gain = 0.5_dp*push*abs(time)
    rate = coupling*scale + sqrt(coupling)*sqrt(push)
    if (ramp > 0.0_dp) then
      gain = gain + ramp*time*time/6.0_dp
      rate = rate + sqrt(coupling)*sqrt(ramp*abs(time))
    end if
  end subroutine steady_rates

  elemental real(dp) function first_step(rate, time)
    !! Return the first step, s.
    real(dp), intent(in) :: rate            !! rate of change, 1/s
    real(dp), intent(in) :: time            !! time to go, s

    first_step = time
    if (rate*abs(time) > 0.5_dp) first_step = sign(0.5_dp/rate, time)
  end function first_step

  elemental real(dp) function local_tolerance_of(coupling, scale, gain, turned, tolerance, time)
    !! Return the local tolerance: the largest last terms over the scale. An error of omega becomes
    !! an error of phase, which grows with time and affects all later phases. The weights come from
    !! random scenes. Waves require more steps, whose errors may all have one sign.
    real(dp), intent(in) :: coupling, scale, gain, turned, tolerance, time
    real(dp) :: way                         ! weighted rotation of the body, rad

    way = coupling*abs(time)*(0.3_dp*scale + 0.12_dp*gain)
    local_tolerance_of = tolerance/(8.0_dp + way + way*(way/14.0_dp) + ALIKE*turned)
    local_tolerance_of = max(local_tolerance_of, LEAST_LOCAL_TOLERANCE)
  end function local_tolerance_of

  pure subroutine add_wave_rates(wave, is_sine, coupling, time, gain, rate, turned)
    !! Add the contributions of one wave to the omega that may be added and to the rate of change.
    real(dp), intent(in) :: wave(4)         !! amplitude (3) in rad/s2, frequency in rad/s
    logical, intent(in) :: is_sine
    real(dp), intent(in) :: coupling
    real(dp), intent(in) :: time            !! time to go, s
    real(dp), intent(inout) :: gain         !! rad/s
    real(dp), intent(inout) :: rate         !! 1/s
    real(dp), intent(inout) :: turned       !! rad
    real(dp) :: push                        ! rad/s2

    push = max(abs(wave(1)), abs(wave(2)), abs(wave(3)))
    ! A slow sine does not reach its amplitude.
    if (is_sine) push = push*min(1.0_dp, abs(wave(4)*time))
    if (push > 0.0_dp) then
      gain = gain + push*abs(time)/(1.0_dp + abs(wave(4)*time))
      rate = rate + sqrt(coupling)*sqrt(push) + abs(wave(4))
      turned = turned + abs(wave(4)*time)
    end if
  end subroutine add_wave_rates

  pure integer function order_for(local_tolerance)
    !! Return the even order with the least work, by a line through measured orders.
    real(dp), intent(in) :: local_tolerance
    integer(int64) :: bits  ! bits of accuracy

    bits = 1023 - ishft(transfer(local_tolerance, bits), -52)
    order_for = max(LEAST_ORDER, min(MOST_ORDER, 8 + 2*int((16*bits + 100)/100)))
  end function order_for

  pure integer function order_of_variations(order, tolerance, local_tolerance)
    !! Return the even order to which precise variations are propagated. Their errors grow in
    !! proportion to the square of the time, as those of the motion do, for which reason the local
    !! tolerance is smaller than the tolerance. Terms of omega decrease by its power 1/order.
    integer, intent(in) :: order
    real(dp), intent(in) :: tolerance, local_tolerance

    order_of_variations = ORDER_FINEST
    if (local_tolerance > LEAST_LOCAL_TOLERANCE) then
      order_of_variations = 2*ceiling(1.0_dp + 0.5_dp*order &
                                      *log(local_tolerance/tolerance)/log(local_tolerance))
    end if
    order_of_variations = max(LEAST_ORDER, min(order, order_of_variations))
  end function order_of_variations

end module taylor_plan

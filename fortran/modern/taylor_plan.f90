module taylor_plan
  !! The order of a Taylor series, from the tolerance; its local tolerance, the largest error of a
  !! step relative to the scale; and its first step, from the rates of the problem.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: problem_t
  use series, only: LEAST_LOCAL_TOLERANCE, LEAST_ORDER, MOST_ORDER
  implicit none(type, external)
  private

  real(dp), parameter :: ALIKE = 0.05_dp ! of the error in a step, for a radian of a wave

  public :: add_wave_rates, plan, tolerance_and_step, steady_rates

contains

  pure subroutine plan(problem, scale, tolerance, time, with_attitude, order, local_tolerance, h)
    !! Order from the tolerance, the first step from the rates of the problem.
    type(problem_t), intent(in) :: problem
    real(dp), intent(in) :: scale           !! largest |omega|, rad/s
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: time            !! to go, s
    logical, intent(in) :: with_attitude    !! which turns though omega may not
    integer, intent(out) :: order
    real(dp), intent(out) :: local_tolerance !! part of the scale that the last terms may have
    real(dp), intent(out) :: h              !! s
    real(dp) :: coupling
    real(dp) :: push                        ! largest torque over moment, 1/s2
    real(dp) :: ramp                        ! its largest rate, 1/s3
    real(dp) :: gain                        ! speed that torques may add, rad/s
    real(dp) :: rate                        ! 1/s
    real(dp) :: turned                      ! by the waves, rad
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
    if (with_attitude) then
      call tolerance_and_step(max(coupling, 1.0_dp), scale, gain, rate, turned, tolerance, time, &
                              local_tolerance, h)
    else
      call tolerance_and_step(coupling, scale, gain, rate, turned, tolerance, time, &
                              local_tolerance, h)
    end if
    order = order_for(local_tolerance)
  end subroutine plan

  elemental subroutine steady_rates(coupling, scale, push, ramp, time, gain, rate)
    !! What a body turns with, and the part of the torque that is no wave.
    real(dp), intent(in) :: coupling        !! largest of |A|, |B|, |C|
    real(dp), intent(in) :: scale           !! largest |omega|, rad/s
    real(dp), intent(in) :: push            !! 1/s2
    real(dp), intent(in) :: ramp            !! 1/s3
    real(dp), intent(in) :: time            !! to go, s
    real(dp), intent(out) :: gain           !! rad/s
    real(dp), intent(out) :: rate           !! 1/s

    gain = 0.5_dp*push*abs(time)
    rate = coupling*scale + sqrt(coupling)*sqrt(push)
    if (ramp > 0.0_dp) then
      gain = gain + ramp*time*time/6.0_dp
      rate = rate + sqrt(coupling)*sqrt(ramp*abs(time))
    end if
  end subroutine steady_rates

  elemental subroutine tolerance_and_step(coupling, scale, gain, rate, turned, tolerance, time, &
                                          local_tolerance, h)
    !! An error turns into one of phase and grows with it, and the phase of all later ones with
    !! that; the weights are from random scenes. Waves ask for more steps, which may all err alike.
    real(dp), intent(in) :: coupling, scale, gain, rate, turned, tolerance, time
    real(dp), intent(out) :: local_tolerance !! part of the scale that the last terms may have
    real(dp), intent(out) :: h              !! the first step, s
    real(dp) :: way                         ! about the body's, rad

    h = time
    if (rate*abs(time) > 0.5_dp) h = sign(0.5_dp/rate, time)
    way = coupling*abs(time)*(0.3_dp*scale + 0.12_dp*gain)
    local_tolerance = tolerance/(8.0_dp + way + way*(way/14.0_dp) + ALIKE*turned)
    local_tolerance = max(local_tolerance, LEAST_LOCAL_TOLERANCE)
  end subroutine tolerance_and_step

  pure subroutine add_wave_rates(wave, is_sine, coupling, time, gain, rate, turned)
    !! What a wave of torque adds to the speed that may be gained, and to the rate of change.
    real(dp), intent(in) :: wave(4)         !! amplitude (3) in 1/s2, frequency in rad/s
    logical, intent(in) :: is_sine
    real(dp), intent(in) :: coupling
    real(dp), intent(in) :: time            !! to go, s
    real(dp), intent(inout) :: gain         !! rad/s
    real(dp), intent(inout) :: rate         !! 1/s
    real(dp), intent(inout) :: turned       !! rad
    real(dp) :: push                        ! 1/s2

    push = max(abs(wave(1)), abs(wave(2)), abs(wave(3)))
    ! A slow sine never comes to its amplitude.
    if (is_sine) push = push*min(1.0_dp, abs(wave(4)*time))
    if (push > 0.0_dp) then
      gain = gain + push*abs(time)/(1.0_dp + abs(wave(4)*time))
      rate = rate + sqrt(coupling)*sqrt(push) + abs(wave(4))
      turned = turned + abs(wave(4)*time)
    end if
  end subroutine add_wave_rates

  pure integer function order_for(local_tolerance)
    !! Even order with the least work, a line through measured ones.
    real(dp), intent(in) :: local_tolerance
    integer(int64) :: bits  ! of accuracy

    bits = 1023 - ishft(transfer(local_tolerance, bits), -52)
    order_for = max(LEAST_ORDER, min(MOST_ORDER, 8 + 2*int((16*bits + 100)/100)))
  end function order_for

end module taylor_plan

module gauss_collocation
  !! Gauss collocation of 1 to 8 stages, with equal steps between the output times. Its order is
  !! twice the number of stages. As in Hairer, McLachlan and Razakarivony 2008, the iteration runs
  !! until rounding stops it, sums are compensated, and the weights are double-double. Energy and
  !! momentum then drift no faster than rounding errors accumulate.
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use gauss_tables, only: MOST_STAGES, NODES, WEIGHTS, WEIGHTS_LOW, MATRIX, &
                          MATRIX_LOW, ONWARD
  use problem, only: problem_t, request_t, solution_t
  use torque_law, only: torque_at
  use statuses, only: COMPLETE, GAVE_UP, INTERRUPTED, OVERFLOW
  use two_words, only: two_product, two_sum
  implicit none(type, external)
  private

  integer, parameter :: MOST_ITERATIONS = 60
  integer, parameter :: PATIENT = 50 ! an iteration that converges needs no more
  real(dp), parameter :: MOST_EVALUATIONS = 4e8_dp ! work limit: some ten seconds
  real(dp), parameter :: COUNTABLE = 4e18_dp
  real(dp), parameter :: BETWEEN_LOOKS = 5e5_dp ! right-hand sides between polls; some 8 a step
  real(dp), parameter :: ROUNDING = 1e-13_dp    ! smaller relative changes may stop falling
  real(dp), parameter :: EXCESS = 1e-6_dp       ! the last step may be longer by this part

  ! The state of an integration.
  type :: state_t
    real(dp) :: y(3)               ! omega, rad/s
    real(dp) :: carry(3)           ! rounding error of y
    real(dp) :: f(MOST_STAGES, 3)  ! rates at the nodes of the last step, rad/s2; 0: there is none
  end type state_t

  public :: gauss_rows

contains

  subroutine gauss_rows(problem, request, stages, step, solution, reached)
    !! Compute the angular velocity at each of the times, which are ordered away from 0.
    type(problem_t), intent(in) :: problem
    type(request_t), intent(in) :: request         !! its tolerance is not used
    integer, intent(in) :: stages                  !! 1 to 8
    real(dp), intent(in) :: step                   !! largest step, s, above 0
    type(solution_t), intent(inout) :: solution    !! without steps and estimates
    real(dp), intent(out) :: reached(4)            !! time and omega after the last successful step
    type(state_t) :: now
    real(dp) :: m(MOST_STAGES, 3)    ! torque over moment at the nodes, rad/s2
    real(dp) :: at_node(3)
    real(dp) :: begin, h
    real(dp) :: h_low                ! rounding error of the step, s
    real(dp) :: waves, n_steps
    real(dp) :: cost                 ! right-hand sides to the next output time
    real(dp) :: done
    real(dp) :: span                 ! from one output time to the next, s
    real(dp) :: span_low
    real(dp) :: walked               ! time since `begin`, s
    real(dp) :: walked_low
    real(dp) :: time                 ! beginning of the step, s
    real(dp) :: time_low
    real(dp) :: node                 ! time of a node, s
    real(dp) :: node_low
    integer(int64) :: most           ! right-hand sides allowed
    real(dp) :: stride               ! steps between polls for an interrupt
    real(dp) :: next_look            ! steps from `begin` to the next poll
    logical :: varies
    integer :: i, k

    solution%n_rows = 0
    solution%status = COMPLETE
    solution%evaluations = 0
    most = int(min(COUNTABLE, request%effort*MOST_EVALUATIONS), int64)
    waves = real(problem%n_sines + problem%n_cosines, dp)
    stride = 1.0_dp + BETWEEN_LOOKS/(stages*(8.0_dp + waves))
    next_look = stride
    now%y = request%omega
    now%carry = 0.0_dp
    now%f = 0.0_dp
    reached = [0.0_dp, now%y]
    varies = waves > 0.0_dp .or. any(abs(problem%rate) > 0.0_dp)
    do k = 1, MOST_STAGES
      m(k, :) = problem%constant
    end do
    begin = 0.0_dp
    do i = 1, size(request%times)
      n_steps = max(1.0_dp, aint(abs(request%times(i) - begin)/step + (1.0_dp - EXCESS)))
      ! At least two iterations a step; a wave costs as much as one iteration.
      cost = n_steps*real(stages, dp)*(2.0_dp + waves)
      if (.not. cost <= real(most - solution%evaluations, dp)) then
        solution%status = GAVE_UP
        return
      end if
      call two_sum(request%times(i), -begin, span, span_low)
      h = span/n_steps
      call two_product(n_steps, h, walked, walked_low)
      h_low = (((span - walked) - walked_low) + span_low)/n_steps
      ! The step has changed, so the rates of the last step are no help for this one.
      now%f = 0.0_dp
      done = 0.0_dp
      do while (done < n_steps)
        if (varies) then
          do k = 1, stages
            call two_product(done, h, walked, walked_low)
            call two_sum(begin, walked, time, time_low)
            time_low = time_low + (walked_low + done*h_low)
            call two_sum(time, NODES(k, stages)*h, node, node_low)
            call torque_at(problem, node, node_low + time_low, at_node)
            m(k, :) = at_node
          end do
        end if
        call advance(problem%coefficients, m, h, stages, most, now, solution)
        if (solution%status /= COMPLETE) return
        done = done + 1.0_dp
        reached = [begin + done*h, now%y]
        if (done >= next_look) then
          next_look = done + stride
          if (interrupt_raised() /= 0) then
            solution%status = INTERRUPTED
            return
          end if
        end if
      end do
      next_look = next_look - n_steps
      begin = request%times(i)
      solution%rows(:, i) = now%y
      solution%n_rows = i
    end do
  end subroutine gauss_rows

  pure subroutine advance(coefficients, m, h, stages, most, now, solution)
    !! Take one step.
    real(dp), intent(in) :: coefficients(3)
    real(dp), intent(in) :: m(MOST_STAGES, 3)
    real(dp), intent(in) :: h
    integer, intent(in) :: stages
    integer(int64), intent(in) :: most            !! right-hand sides allowed
    type(state_t), intent(inout) :: now
    type(solution_t), intent(inout) :: solution   !! status and evaluations change
    integer :: status
    real(dp) :: z(MOST_STAGES, 3)       ! states at the nodes minus y
    real(dp) :: zero(MOST_STAGES, 3), z_before(MOST_STAGES, 3)
    real(dp) :: states(MOST_STAGES, 3)
    real(dp) :: low(MOST_STAGES, 3)     ! contribution of MATRIX_LOW
    real(dp) :: change, change_before, scale
    real(dp) :: push                    ! largest torque over moment, rad/s2
    real(dp) :: increment, total, part, back, rest
    integer :: axis, iteration, k

    associate (y => now%y, carry => now%carry, f => now%f)
      status = GAVE_UP
      scale = max(abs(y(1)), abs(y(2)), abs(y(3)))
      push = maxval(abs(m(:stages, :)))
      zero = 0.0_dp
      low = 0.0_dp
      call stage_sums(ONWARD(:, :, stages), f, zero, stages, z)
      z = h*z
      change_before = huge(scale)
      do iteration = 1, MOST_ITERATIONS
        do axis = 1, 3
          do k = 1, stages
            states(k, axis) = y(axis) + (z(k, axis) + carry(axis))
          end do
        end do
        ! equations 16-18 at the nodes
        do k = 1, stages
          f(k, 1) = m(k, 1) + coefficients(1)*states(k, 2)*states(k, 3)
          f(k, 2) = m(k, 2) + coefficients(2)*states(k, 3)*states(k, 1)
          f(k, 3) = m(k, 3) + coefficients(3)*states(k, 1)*states(k, 2)
        end do
        z_before = z
        ! Rounding of the matrix would make the energy drift. The correction is so small that one
        ! evaluation of it suffices.
        if (iteration == 2) call stage_sums(MATRIX_LOW(:, :, stages), f, zero, stages, low)
        call stage_sums(MATRIX(:, :, stages), f, low, stages, z)
        z = h*z
        change = 0.0_dp
        do axis = 1, 3
          do k = 1, stages
            change = max(change, abs(z(k, axis) - z_before(k, axis)))
          end do
        end do
        if (.not. change > 0.0_dp) status = COMPLETE
        if (change >= change_before .and. change <= ROUNDING*scale) status = COMPLETE
        ! A torque may add far more than omega, and remove it; its rounding error then remains.
        if (iteration > PATIENT .and. change >= change_before &
            .and. change <= ROUNDING*(scale + abs(h)*push)) status = COMPLETE
        if (status == COMPLETE) exit
        change_before = change
      end do
      solution%evaluations = solution%evaluations + stages*min(iteration, MOST_ITERATIONS)
      if (solution%evaluations > most) status = GAVE_UP

      do axis = 1, 3
        increment = 0.0_dp
        part = 0.0_dp
        do k = 1, stages
          part = part + WEIGHTS_LOW(k, stages)*f(k, axis)
          increment = increment + WEIGHTS(k, stages)*f(k, axis)
        end do
        ! The low parts are finer than the last place of the sum. `carry` takes the rounding error
        ! of the sum (compensated summation, after Hairer, McLachlan and Razakarivony 2008).
        increment = h*increment
        part = carry(axis) + h*part
        total = increment + part
        back = total - increment
        rest = (increment - (total - back)) + (part - back)
        increment = total
        total = y(axis) + increment
        back = total - y(axis)
        carry(axis) = ((y(axis) - (total - back)) + (increment - back)) + rest
        y(axis) = total
        if (.not. abs(total) <= huge(total)) status = OVERFLOW
      end do
    end associate
    solution%status = status
  end subroutine advance

  pure subroutine stage_sums(table, f, start, stages, z)
    !! Compute z = start + table f.
    real(dp), intent(in) :: table(MOST_STAGES, MOST_STAGES)
    real(dp), intent(in) :: f(MOST_STAGES, 3), start(MOST_STAGES, 3)
    integer, intent(in) :: stages
    real(dp), intent(out) :: z(MOST_STAGES, 3)
    integer :: axis, j, k

    z = start
    do axis = 1, 3
      do j = 1, stages
        do k = 1, MOST_STAGES
          z(k, axis) = z(k, axis) + table(k, j)*f(j, axis)
        end do
      end do
    end do
  end subroutine stage_sums

end module gauss_collocation

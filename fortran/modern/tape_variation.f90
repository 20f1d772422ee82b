module tape_variation
  !! Derivatives of the solution of a tape with respect to parameters: the variational equations,
  !! integrated beside the solution by Taylor series (Biscani and Izzo 2021, section 2.4).
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use problem, only: step_request_t, step_t, variation_request_t, variation_t
  use statuses, only: COMPLETE, GAVE_UP, OVERFLOW
  use step_limit, only: check_steps, limit_of, step_limit_t
  use tape, only: arrays_of, FIRST_UNKNOWN, tape_t
  use tape_growth, only: MOST_UNKNOWNS
  use tape_series, only: allocate_series, block_t, derivatives_at, MOST_ORDER, series_t, &
                         SIDE_BY_SIDE, sum_perturbations, vary_tape
  use tape_step, only: take_step
  implicit none(type, external)
  private

  ! Errors of a step, over the tolerance, of the solution and of the derivatives.
  real(dp), parameter :: OF_STEP = 0.1_dp
  real(dp), parameter :: OF_DERIVATIVES = 0.3_dp
  real(dp), parameter :: LEAST_LOCAL_TOLERANCE = 1e-16_dp
  real(dp), parameter :: MOST_STEPS = 1e6_dp      ! work limit with ten slots and eight columns
  real(dp), parameter :: CHEAP_SLOTS = 10.0_dp
  real(dp), parameter :: STEPS_BETWEEN_LOOKS = 1e4_dp
  ! Turn in the step that is tried first, rad. The series tells how much shorter or longer the step
  ! will be.
  real(dp), parameter :: TURN = 1.0_dp

  public :: vary_solution

contains

  subroutine vary_solution(tape_at, request_at, variation_at) bind(c, name="vary_solution_level")
    !! Compute the derivatives at the requested times, which have one sign and are ordered away from
    !! 0. The status is COMPLETE, OVERFLOW, GAVE_UP or INTERRUPTED.
    ! Addresses of a tape_t, a variation_request_t and a variation_t, passed through C.
    type(c_ptr), intent(in), value :: tape_at, request_at, variation_at
    type(tape_t), pointer :: tape
    type(variation_request_t), pointer :: request
    type(variation_t), pointer :: found
    real(dp), allocatable, target :: memory(:)
    real(dp), target :: state(MOST_UNKNOWNS), tolerances(MOST_UNKNOWNS), ends(MOST_UNKNOWNS)
    real(dp), target :: terms(0:MOST_ORDER, MOST_UNKNOWNS)
    real(dp) :: weights(MOST_UNKNOWNS)        ! which make the unknowns comparable
    real(dp) :: sums(SIDE_BY_SIDE, MOST_UNKNOWNS)
    type(block_t), allocatable :: blocks(:)
    real(dp), allocatable :: lanes(:, :, :)   ! (SIDE_BY_SIDE, MOST_UNKNOWNS, blocks): derivatives
    type(series_t) :: s
    type(step_request_t) :: step_request
    type(step_t) :: step
    type(step_limit_t) :: limit
    real(dp) :: t, t_end, trial, local_tolerance, scale, largest, factor
    real(dp) :: cost, ahead
    integer(int64) :: steps
    integer :: failed, n, n_columns, n_blocks
    logical :: fits

    call c_f_pointer(tape_at, tape)
    call c_f_pointer(request_at, request)
    call c_f_pointer(variation_at, found)
    n = tape%n_unknowns
    n_columns = size(request%starts, 2)
    n_blocks = (n_columns + SIDE_BY_SIDE - 1)/SIDE_BY_SIDE
    found%status = GAVE_UP
    found%n_rows = 0
    steps = 0
    call allocate_series(tape, n_blocks, tape%n_slots, memory, s, fits)
    if (.not. fits) return
    allocate (blocks(n_blocks), stat=failed)
    if (failed /= 0) return
    allocate (lanes(SIDE_BY_SIDE, MOST_UNKNOWNS, n_blocks), stat=failed)
    if (failed /= 0) return
    call begin()
    do
      if (.not. found%n_rows < size(request%times)) exit
      call take()
      if (step%status /= COMPLETE) then
        found%status = step%status
        return
      end if
      factor = step%h/s%h
      call expand_derivatives()
      if (.not. factor > 0.0_dp) then
        found%status = OVERFLOW
        return
      end if
      call add_rows()
      call advance()
      steps = steps + 1
      call check_steps(steps, t, t_end - t, arrives() .or. step%is_switched, limit, ahead, &
                       found%status)
      if (found%status /= COMPLETE) return
    end do

  contains

    subroutine begin()
      integer :: block, column, lane

      s%forcings => request%forcings
      s%blocks = 0.0_dp
      do block = 1, n_blocks
        associate (b => blocks(block))
          lanes(:, :, block) = 0.0_dp
          b%forcings = 0
          b%sizes = 0.0_dp
          b%arrays = arrays_of(tape, c_loc(s%a), c_loc(s%blocks(1, 0, 1, block)), s%arrays%work)
          do column = SIDE_BY_SIDE*(block - 1) + 1, min(n_columns, SIDE_BY_SIDE*block)
            lane = column - SIDE_BY_SIDE*(block - 1)
            lanes(lane, :n, block) = request%starts(:, column)
            b%forcings(lane, :n) = request%forcings(:, column)
          end do
        end associate
      end do
      state(:n) = request%state
      t = 0.0_dp
      t_end = request%times(size(request%times))
      do while (found%n_rows < size(request%times))
        if (abs(request%times(found%n_rows + 1)) > 0.0_dp) exit
        found%n_rows = found%n_rows + 1
        found%rows(:, :, found%n_rows) = request%starts
      end do
      local_tolerance = max(LEAST_LOCAL_TOLERANCE, OF_STEP*request%tolerance)
      largest = maxval(abs(state(:3)))
      scale = largest
      if (.not. largest > 0.0_dp) then
        ! A guess of the omega that a body at rest is about to reach.
        call derivatives_at(tape, [0.0_dp, 0.0_dp], state(:n), t_end, s, ends(:n))
        scale = sqrt(maxval(abs(ends(:3))))
        if (.not. (scale > 0.0_dp .and. scale <= huge(scale))) scale = 1.0_dp
      end if
      call weigh()
      trial = TURN/scale
      cost = max(1.0_dp, tape%n_slots*n_blocks/CHEAP_SLOTS)
      limit = limit_of(request%effort*(MOST_STEPS/cost), 1 + int(STEPS_BETWEEN_LOOKS/cost, int64))
      ahead = 0.0_dp
      found%status = COMPLETE
    end subroutine begin

    subroutine take()
      real(dp) :: reached

      do
        tolerances(:3) = local_tolerance*scale
        tolerances(4:) = 0.5_dp*local_tolerance
        step_request%t = t
        step_request%may_be_long = .false.
        step_request%t_end = t_end
        step_request%trial = trial
        step_request%relative = local_tolerance
        step_request%state => state(:n)
        step_request%tolerances => tolerances(:n)
        step%terms(0:, 1:) => terms(:, :n)
        step%state => ends(:n)
        call take_step(tape, step_request, s, step)
        if (step%status /= COMPLETE) return
        reached = maxval(abs(ends(:3)))
        if (largest > 0.0_dp .or. .not. (reached > 0.0_dp .and. reached < 0.5_dp*scale)) exit
        scale = reached
        trial = abs(step%h)
        call weigh()
      end do
    end subroutine take

    subroutine weigh()
      !! Make the derivatives of omega and of the attitude comparable, and update their sizes.
      integer :: block, i, lane

      weights(:3) = 1.0_dp
      weights(4:) = 2.0_dp*scale
      do block = 1, n_blocks
        do i = 1, n
          do lane = 1, SIDE_BY_SIDE
            associate (largest_so_far => blocks(block)%sizes(lane))
              largest_so_far = max(largest_so_far, weights(i)*abs(lanes(lane, i, block)))
            end associate
          end do
        end do
      end do
    end subroutine weigh

    subroutine expand_derivatives()
      !! Compute the terms of all derivatives, and reduce the factor on the step until they suffice.
      !! The factor becomes 0 if they are not finite.
      real(dp) :: shortened
      integer :: block, i

      ! The check of the step has overwritten the values at its beginning.
      call derivatives_at(tape, [t, 0.0_dp], state(:n), s%h, s, ends(:n))
      shortened = factor
      do block = 1, n_blocks
        do i = 1, n
          s%blocks(:, 0, FIRST_UNKNOWN - 1 + i, block) = lanes(:, i, block)
        end do
        shortened = min(shortened, vary_tape(blocks(block), s%h, s%order, factor, weights, &
                                             OF_DERIVATIVES*request%tolerance))
      end do
      if (shortened < factor) then
        step%h = (t + shortened*s%h) - t
        factor = step%h/s%h
      end if
    end subroutine expand_derivatives

    subroutine add_rows()
      !! Compute the derivatives at the times within the step.
      real(dp) :: part
      integer :: block, column

      do while (found%n_rows < size(request%times))
        associate (time => request%times(found%n_rows + 1))
          if (abs(time) > abs(step%stop)) exit
          part = (time - t)/s%h
          ! The quotient of the step was rounded.
          if (arrives() .and. .not. abs(time) < abs(step%stop)) part = factor
        end associate
        if (part > factor) exit
        found%n_rows = found%n_rows + 1
        do block = 1, n_blocks
          call sum_perturbations(blocks(block)%arrays, blocks(block)%last_term, part, sums)
          do column = SIDE_BY_SIDE*(block - 1) + 1, min(n_columns, SIDE_BY_SIDE*block)
            found%rows(:, column, found%n_rows) = sums(column - SIDE_BY_SIDE*(block - 1), :n)
          end do
        end do
      end do
    end subroutine add_rows

    pure logical function arrives()
      !! Return whether the step ends at the break or the last time.
      arrives = abs(step%h) >= abs(step%stop - t)
    end function arrives

    subroutine advance()
      integer :: block, i, k

      do block = 1, n_blocks
        call sum_perturbations(blocks(block)%arrays, blocks(block)%last_term, factor, &
                               lanes(:, :, block))
      end do
      ends(:n) = 0.0_dp
      do k = s%order, 1, -1
        do i = 1, n
          ends(i) = factor*(ends(i) + s%a(k, FIRST_UNKNOWN - 1 + i))
        end do
      end do
      state(:n) = state(:n) + ends(:n)
      ! The length of a cut step is no guess for the next.
      trial = merge(max(trial, abs(step%h)), abs(step%h), arrives())
      t = merge(step%stop, t + step%h, arrives())
      largest = max(largest, maxval(abs(state(:3))))
      if (largest > 0.0_dp) scale = largest
      call weigh()
    end subroutine advance

  end subroutine vary_solution

end module tape_variation

module many_programs
  !! The three programs of the appendix on many bodies, one block of lanes at a time.
  use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_intptr_t, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use interruption, only: interrupt_raised
  use blocks, only: LANE_COUNT
  use kinds, only: dp
  use deck_binary64, only: steps_between_looks, stop_t
  use ensemble, only: ensemble_t
  use lanes, only: begin_block, block_t, EXCEEDS, GOES_ON, look, OVERFLOWS
  use lanes_four_term, only: grid_t, set_grid, step_four_term, torque_four_term
  use lanes_runge_kutta, only: begin_stages, stages_t, step_runge_kutta, test, &
                               torque_runge_kutta
  use lanes_two_term, only: points_t, set_points, step_two_term, torque_two_term
  use runge_kutta_program_binary64, only: lipschitz_test
  use statuses, only: COMPLETE, OVERFLOW, STOPPED
  implicit none(type, external)
  private

  integer(c_intptr_t), parameter :: ALIGNED = 64 ! bytes: no vector crosses a cache line

  type :: room_t
    type(block_t) :: b
    type(stages_t) :: stages
    type(points_t) :: points
    type(grid_t) :: grid
  end type room_t

  public :: run_lanes

contains

  subroutine run_lanes(ensemble_at) bind(c, name="run_lanes_level")
    !! Run all bodies, or until the user interrupts.
    type(c_ptr), intent(in), value :: ensemble_at !! address of an ensemble_t, passed through C
    type(ensemble_t), pointer :: e
    type(room_t), pointer :: room
    real(c_double), target :: place(storage_size(room)/64 + ALIGNED/8)
    integer(c_intptr_t) :: address
    integer :: first
    integer :: left  ! steps until the next poll for an interrupt

    call c_f_pointer(ensemble_at, e)
    address = transfer(c_loc(place), address)
    call c_f_pointer(c_loc(place(1 + modulo(-address, ALIGNED)/8)), room)
    left = 0
    do first = 1, e%n, LANE_COUNT
      call run_block(e, first, room%b, room%stages, room%points, room%grid, left)
      if (left < 0) return
    end do
  end subroutine run_lanes

  subroutine run_block(e, first, b, stages, points, grid, left)
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: first
    type(block_t), intent(out) :: b
    type(stages_t), intent(inout) :: stages
    type(points_t), intent(inout) :: points
    type(grid_t), intent(inout) :: grid
    integer, intent(inout) :: left
    integer(int64) :: verdict(LANE_COUNT)
    integer(int64) :: found
    integer :: step
    integer :: row   ! next requested row

    call begin_block(e, first, b)
    if (e%program == 3) call begin_stages(b, stages)
    row = 1
    do step = 1, e%scene%n_steps
      left = left - 1
      if (left < 0) then
        if (interrupt_raised() /= 0) return
        left = steps_between_looks(e%scene)/4
      end if
      b%TIME = b%TIME + b%DT
      select case (e%program)
      case (1)
        if (step == 1 .or. e%listing%dt_accumulates) call set_points(b, points)
        if (e%scene%torque_varies) call torque_two_term(e, step, b, points)
        call step_two_term(e, b, points)
      case (2)
        if (step == 1 .or. e%listing%dt_accumulates) call set_grid(b, grid)
        if (e%scene%torque_varies) call torque_four_term(e, step, b, grid)
        call step_four_term(e, b, grid)
      case default
        if (e%scene%torque_varies) call torque_runge_kutta(e, step, b)
        call step_runge_kutta(e, b, stages)
      end select
      call look(b, verdict, found)
      if (e%program == 3 .and. e%scene%may_stop) call test(e, b, stages, verdict, found)
      if (found /= GOES_ON) call end_overflows(e, step, verdict, b)
      if (row <= e%n_at) then
        if (e%at(row) == step) then
          call record(e, row, b)
          row = row + 1
        end if
      end if
      if (found /= GOES_ON) then
        call end_stops(e, step, verdict, stages, b)
        if (all(b%alive == 0)) return
      end if
      if (e%program /= 3 .and. e%listing%dt_accumulates) b%DT = b%DT + b%step
    end do
    call end_rest(e, b)
  end subroutine run_block

  subroutine end_overflows(e, step, verdict, b)
    !! End the runs that overflow in this step, which leaves no row.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: step
    integer(int64), intent(in) :: verdict(LANE_COUNT)
    type(block_t), intent(inout) :: b
    integer :: body
    integer :: i

    do i = 1, b%used
      if (iand(verdict(i), OVERFLOWS) == 0) cycle
      body = b%first + i - 1
      e%status(body) = OVERFLOW
      e%n_rows(body) = step - 1
      b%alive(i) = 0
    end do
  end subroutine end_overflows

  subroutine end_stops(e, step, verdict, stages, b)
    !! End the runs that the Lipschitz test stops in this step, which leaves a row. The program's
    !! own test finds the variable.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: step
    integer(int64), intent(in) :: verdict(LANE_COUNT)
    type(stages_t), intent(in) :: stages
    type(block_t), intent(inout) :: b
    type(stop_t) :: stop_at
    integer :: body
    integer :: i

    do i = 1, b%used
      if (b%alive(i) == 0 .or. iand(verdict(i), EXCEEDS) == 0) cycle
      body = b%first + i - 1
      call lipschitz_test(e%listing, stages%change_k(i, :), stages%change_u(i, :), &
                          b%lipschitz(i), stop_at)
      e%status(body) = STOPPED
      e%n_rows(body) = step
      e%stop_variable(body) = stop_at%variable
      e%stop_quotient(body) = stop_at%quotient
      b%alive(i) = 0
    end do
  end subroutine end_stops

  subroutine end_rest(e, b)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(in) :: b
    integer :: i

    do i = 1, b%used
      if (b%alive(i) == 0) cycle
      e%status(b%first + i - 1) = COMPLETE
      e%n_rows(b%first + i - 1) = e%scene%n_steps
    end do
  end subroutine end_rest

  subroutine record(e, row, b)
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: row
    type(block_t), intent(in) :: b
    integer :: body
    integer :: i

    do i = 1, b%used
      if (b%alive(i) == 0) cycle
      body = b%first + i - 1
      e%omega_rows(:, row, body) = b%U(i, :)
      if (size(e%velocity_rows, 3) > 0) e%velocity_rows(:, row, body) = b%V(i, :)
      if (size(e%ier_rows, 2) > 0) e%ier_rows(row, body) = b%ier(i)
      e%times(row, min(body, size(e%times, 2))) = b%TIME(i)
    end do
  end subroutine record

end module many_programs

module tape_rows
  !! The rows and nodes of an integration of a tape. The propagated truncation error is subtracted.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW
  use step_nodes, only: AT_ONCE, divide_step, powers_of, sum_at_nodes
  use tape, only: FIRST_UNKNOWN
  use tape_error, only: error_t
  use tape_series, only: MOST_ORDER, series_t, SIDE_BY_SIDE
  use tape_state, only: rotate, state_t
  use tape_values, only: LAST_TERM
  implicit none(type, external)
  private

  ! Largest error for which the linearised equations hold.
  real(dp), parameter :: LINEAR_RANGE = 0.1_dp
  integer, parameter :: ROWS_BETWEEN_LOOKS = 2**17

  public :: add_nodes, add_row, add_rows, evaluate

contains

  subroutine evaluate(x, s, e, factor, part, change, error)
    !! Compute the change of the unknowns since the beginning of the step, and their error.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    type(error_t), intent(in) :: e
    real(dp), intent(in) :: factor !! the step over that of the series
    real(dp), intent(in) :: part   !! of the step of the series
    real(dp), intent(out) :: change(:), error(:)
    integer :: i, k

    do i = 1, x%n
      change(i) = 0.0_dp
      do k = s%order, 1, -1
        change(i) = part*(change(i) + s%a(k, FIRST_UNKNOWN - 1 + i))
      end do
      error(i) = s%blocks(1, e%last_terms(1), FIRST_UNKNOWN - 1 + i, 1)
      do k = e%last_terms(1) - 1, 0, -1
        error(i) = part*error(i) + s%blocks(1, k, FIRST_UNKNOWN - 1 + i, 1)
      end do
    end do
    if (x%has_attitude) then
      call rotate(x%y(4) + change(4), x%y(5) + change(5), x%y(6) + change(6), x%y(7) + change(7), &
                  error(4), error(5), error(6), error(7))
    end if
    error = error - (part/factor)**(s%order + 1)*e%left
  end subroutine evaluate

  subroutine add_rows(x, s, e, factor, request, last_row, solution, largest)
    !! Compute the rows within the step.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    type(error_t), intent(in) :: e
    real(dp), intent(in) :: factor  !! the step over that of the series
    type(request_t), intent(in) :: request
    integer, intent(in) :: last_row !! that may be within the step
    type(solution_t), intent(inout) :: solution
    real(dp), intent(inout) :: largest !! error before it is subtracted
    real(dp) :: part, change(x%n), error(x%n)

    do while (solution%n_rows < last_row)
      part = ((request%times(solution%n_rows + 1) - x%t(1)) - x%t(2))/s%h
      if (abs(part) > factor) return
      call evaluate(x, s, e, factor, part, change, error)
      call add_row(x, request, x%y_low + change, error, solution, largest)
      if (solution%status /= COMPLETE) return
      if (mod(solution%n_rows, ROWS_BETWEEN_LOOKS) == 0) then
        if (interrupt_raised() /= 0) then
          solution%status = INTERRUPTED
          return
        end if
      end if
    end do
  end subroutine add_rows

  subroutine add_row(x, request, change, error, solution, largest)
    !! Add the next row. The error is subtracted if it is small enough to be known: a wrong estimate
    !! then costs no more than the tolerance.
    type(state_t), intent(in) :: x
    type(request_t), intent(in) :: request
    real(dp), intent(in) :: change(:), error(:) !! from the unknowns in `x`
    type(solution_t), intent(inout) :: solution
    real(dp), intent(inout) :: largest !! error before it is subtracted
    real(dp) :: z(x%n), size_of_error
    integer :: row

    size_of_error = maxval(x%weights*abs(error))
    if (.not. size_of_error <= largest) largest = size_of_error
    z = x%y + change
    if (size_of_error <= min(LINEAR_RANGE, request%tolerance)) z = x%y + (change - error)
    if (.not. maxval(abs(z)) <= huge(z)) then
      solution%status = OVERFLOW
      return
    end if
    row = solution%n_rows + 1
    solution%rows(:, row) = z(:3)
    if (associated(solution%attitudes)) then
      solution%attitudes(:, row) = z(4:7)/norm2(z(4:7))
      if (request%times(row) == 0.0_dp) solution%attitudes(:, row) = solution%attitudes(:, 0)
    end if
    if (x%first_own <= x%n) solution%own(:x%n - x%first_own + 1, row) = z(x%first_own:)
    solution%n_rows = row
  end subroutine add_row

  subroutine add_nodes(x, s, e, factor, t_end, tolerance, solution, largest)
    !! Compute the unknowns at the nodes of the step, divided as a polynomial between them requires.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    type(error_t), intent(in) :: e
    real(dp), intent(in) :: factor    !! the step over that of the series
    real(dp), intent(in) :: t_end     !! of the step, s
    real(dp), intent(in) :: tolerance !! of the results
    type(solution_t), intent(inout) :: solution
    real(dp), intent(inout) :: largest !! error before it is subtracted
    real(dp) :: sizes(AT_ONCE + 1:MOST_ORDER + 1), weights(x%n), power, error
    integer :: k, part, parts

    weights = 0.0_dp
    do k = s%order, 1, -1
      weights = factor*(weights + s%a(k, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + x%n))
    end do
    weights = abs(x%y + weights)
    weights(:3) = maxval(weights(:3))
    weights(4:x%first_own - 1) = 0.0_dp
    weights = x%weights/max(1.0_dp, x%weights*weights)
    sizes(s%order + 1) = maxval(weights*abs(e%left))
    power = factor**AT_ONCE
    do k = AT_ONCE + 1, s%order
      power = power*factor
      sizes(k) = power*maxval(weights*abs(s%a(k, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + x%n)))
    end do
    call divide_step(sizes(:s%order + 1), tolerance, parts, error)
    solution%between = max(error, merge(solution%between, 0.0_dp, solution%n_steps > 0))
    do part = 1, parts
      solution%n_steps = solution%n_steps + 1
      if (solution%n_steps >= size(solution%ends)) cycle
      associate (end => solution%ends(solution%n_steps + 1))
        end = t_end
        if (part < parts) end = x%t(1) + (x%t(2) + (real(part, dp)/real(parts, dp))*(factor*s%h))
      end associate
      call add_part(x, s, e, factor, (real(part - 1, dp) + solution%nodes(2:))/real(parts, dp), &
                    tolerance, solution, largest)
    end do
  end subroutine add_nodes

  subroutine add_part(x, s, e, factor, nodes, tolerance, solution, largest)
    !! Compute the unknowns at the nodes of a part of the step, as `evaluate` and `add_row`, side by
    !! side.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    type(error_t), intent(in) :: e
    real(dp), intent(in) :: factor    !! the step over that of the series
    real(dp), intent(in) :: nodes(AT_ONCE) !! in parts of the step
    real(dp), intent(in) :: tolerance !! of the results
    type(solution_t), intent(inout) :: solution
    real(dp), intent(inout) :: largest !! error before it is subtracted
    real(dp) :: parts(AT_ONCE), powers(AT_ONCE), errors(AT_ONCE, x%n)
    real(dp) :: changes(AT_ONCE, x%n), sizes(AT_ONCE), value(AT_ONCE)
    integer :: i, k

    associate (at_nodes => solution%at_nodes(:, :, solution%n_steps), n => x%n, y => x%y)
      if (solution%n_steps > 1) then
        at_nodes(:, 1) = solution%at_nodes(:, 1 + AT_ONCE, solution%n_steps - 1)
      else
        at_nodes(:, 1) = y
      end if
      parts = factor*nodes
      powers = powers_of(nodes, s%order + 1)
      sizes = 0.0_dp
      call sum_at_nodes(s%a(:, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n), n*(LAST_TERM + 1), 1, &
                        LAST_TERM + 1, n, s%order, parts, changes)
      call sum_at_nodes(s%blocks(:, :, FIRST_UNKNOWN:FIRST_UNKNOWN - 1 + n, 1), &
                        n*(MOST_ORDER + 1)*SIDE_BY_SIDE, SIDE_BY_SIDE, &
                        (MOST_ORDER + 1)*SIDE_BY_SIDE, n, e%last_terms(1), parts, errors)
      do i = 1, n
        errors(:, i) = errors(:, i) + s%blocks(1, 0, FIRST_UNKNOWN - 1 + i, 1)
      end do
      if (x%has_attitude) then
        call rotate(y(4) + changes(:, 4), y(5) + changes(:, 5), y(6) + changes(:, 6), &
                    y(7) + changes(:, 7), errors(:, 4), errors(:, 5), errors(:, 6), errors(:, 7))
      end if
      do i = 1, n
        errors(:, i) = errors(:, i) - powers*e%left(i)
        sizes = max(sizes, x%weights(i)*abs(errors(:, i)))
      end do
      do i = 1, n
        value = x%y_low(i) + changes(:, i)
        value = y(i) + merge(value - errors(:, i), value, sizes <= min(LINEAR_RANGE, tolerance))
        do k = 1, AT_ONCE
          at_nodes(i, 1 + k) = value(k)
        end do
      end do
    end associate
    do k = 1, AT_ONCE
      if (.not. sizes(k) <= largest) largest = sizes(k)
    end do
  end subroutine add_part

end module tape_rows

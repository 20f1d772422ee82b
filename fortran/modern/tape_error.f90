module tape_error
  !! The error of an integration of a tape: the truncation and rounding errors of its steps, and how
  !! they and perturbations of the unknowns propagate.
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use tape, only: FIRST_UNKNOWN, tape_arrays_t
  use tape_growth, only: MOST_UNKNOWNS
  use tape_series, only: MOST_BLOCKS, perturb_tape, series_t, SIDE_BY_SIDE, sum_perturbations, &
                         VARIATION_TOLERANCE
  use tape_state, only: rotate, state_t
  implicit none(type, external)
  private

  integer, parameter :: FITTED = 4   ! last terms from which the truncation error is estimated
  integer, parameter :: FEW = 3      ! terms whose decay bounds the truncation error
  real(dp), parameter :: RIDGE = 1.001_dp  ! makes the fit work for one pole or none
  real(dp), parameter :: FEW_STEPS = 32.0_dp ! for which perturbations may be inaccurate
  real(dp), parameter :: DECAYED = 1e-100_dp ! largest perturbation beside which the error counts

  type, public :: error_t
    ! The error, and a perturbation of each unknown, in blocks.
    real(dp) :: lanes(SIDE_BY_SIDE, MOST_UNKNOWNS, MOST_BLOCKS)
    integer :: n_blocks
    integer :: last_terms(MOST_BLOCKS) ! of the perturbations
    logical :: is_short                ! whether the terms of perturbations do not suffice
    real(dp) :: varied                 ! largest term of a perturbation that is left out
    real(dp), pointer, contiguous :: left(:) ! truncation error of the step
    real(dp), pointer, contiguous :: noise(:) ! squares of the rounding errors of all steps
    real(dp), pointer, contiguous :: noise_of_block(:) ! of those since a block of steps was closed
  end type error_t

  public :: add_noise, begin_block, begin_error, cross_error, estimate_truncation, fitting_lanes, &
            keep_lanes, matrix_of, perturb, set_lanes, take_change, take_error

contains

  subroutine begin_error(n, memory, e)
    !! Set the error to zero, and the perturbations to the unit vector of each unknown.
    integer, intent(in) :: n !! number of unknowns
    real(dp), intent(inout), target, contiguous :: memory(:, :) !! (unknowns, 3)
    type(error_t), intent(out) :: e

    memory = 0.0_dp
    e%left => memory(:, 1)
    e%noise => memory(:, 2)
    e%noise_of_block => memory(:, 3)
    e%n_blocks = 1 + n/SIDE_BY_SIDE
    e%lanes(1, :, 1) = 0.0_dp
    call begin_block(e)
  end subroutine begin_error

  subroutine begin_block(e)
    !! Set the perturbations to the unit vector of each unknown, and the rounding errors to zero.
    type(error_t), intent(inout) :: e
    integer :: i, n

    n = size(e%left)
    e%noise_of_block = 0.0_dp
    e%lanes(2:, :n, 1) = 0.0_dp
    e%lanes(:, :n, 2:e%n_blocks) = 0.0_dp
    do i = 1, n
      e%lanes(1 + mod(i, SIDE_BY_SIDE), i, 1 + i/SIDE_BY_SIDE) = 1.0_dp
    end do
  end subroutine begin_block

  subroutine add_noise(squares, e)
    !! Add the squares of rounding errors, in units.
    real(dp), intent(in) :: squares(:)
    type(error_t), intent(inout) :: e

    e%noise = e%noise + squares
    e%noise_of_block = e%noise_of_block + squares
  end subroutine add_noise

  subroutine set_lanes(x, e, s)
    !! Set term 0 of the perturbations.
    type(state_t), intent(in) :: x
    type(error_t), intent(in) :: e
    type(series_t), intent(inout) :: s
    integer :: block, i

    do block = 1, e%n_blocks
      do i = 1, x%n
        s%blocks(1:SIDE_BY_SIDE, 0, FIRST_UNKNOWN - 1 + i, block) = e%lanes(:, i, block)
      end do
    end do
    if (.not. x%has_attitude) return
    associate (v => s%blocks(:, 0, FIRST_UNKNOWN + 3:FIRST_UNKNOWN + 6, 1), q => x%y(4:7))
      call rotate(q(1), -q(2), -q(3), -q(4), v(:, 1), v(:, 2), v(:, 3), v(:, 4))
      v = v/dot_product(q, q)
    end associate
  end subroutine set_lanes

  subroutine perturb(x, s, steps, rest, factor, e)
    !! Expand the perturbations.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    integer(int64), intent(in) :: steps !! so far
    real(dp), intent(in) :: rest        !! time to the end, s
    real(dp), intent(in) :: factor
    type(error_t), intent(inout) :: e
    real(dp) :: all_steps
    integer :: block, is_long

    all_steps = steps + rest/(factor*s%h)
    ! Small errors of many steps would hide an amplification, or feign one.
    is_long = merge(1, 0, all_steps > FEW_STEPS)
    e%varied = VARIATION_TOLERANCE*min(1.0_dp, FEW_STEPS/all_steps)
    do block = 1, e%n_blocks
      e%last_terms(block) = perturb_tape(arrays_of_block(s, block), SIDE_BY_SIDE*(block - 1), &
                                         s%h, s%order, factor, x%weights, e%varied, is_long)
    end do
    e%is_short = any(e%last_terms(:e%n_blocks) < 0)
    e%last_terms(:e%n_blocks) = abs(e%last_terms(:e%n_blocks))
  end subroutine perturb

  type(tape_arrays_t) function arrays_of_block(s, block)
    !! Return what tape_perturbations.c reads of the tape, with a block of perturbations.
    type(series_t), intent(in) :: s
    integer, intent(in) :: block

    arrays_of_block = s%arrays
    arrays_of_block%v = c_loc(s%blocks(1, 0, 1, block))
  end function arrays_of_block

  real(dp) function fitting_lanes(x, s, e, factor)
    !! Return the factor on the step with which the last terms of the perturbations are small.
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    type(error_t), intent(in) :: e
    real(dp), intent(in) :: factor
    real(dp) :: first, size_of_last, unit
    integer :: i, block, lane, number

    first = 0.0_dp
    size_of_last = 0.0_dp
    ! The error, number 0, is last: it counts only where the others have decayed.
    do number = x%n, 0, -1
      block = 1 + number/SIDE_BY_SIDE
      lane = 1 + mod(number, SIDE_BY_SIDE)
      unit = 1.0_dp
      if (number > 0) unit = x%weights(number)
      if (.not. unit > 0.0_dp .or. (number == 0 .and. first >= DECAYED)) cycle
      do i = 1, x%n
        associate (v => s%blocks(lane, :, FIRST_UNKNOWN - 1 + i, block), &
                   relative => x%weights(i)/unit)
          first = max(first, relative*abs(v(1)))
          if (e%last_terms(block) < s%order) cycle
          size_of_last = max(size_of_last, relative*abs(v(1 + s%order)), &
                             relative*abs(v(s%order))/factor)
        end associate
      end do
    end do
    size_of_last = size_of_last*factor**s%order
    fitting_lanes = 0.25_dp
    if (size_of_last <= huge(s%h) .and. size_of_last > 0.0_dp .and. first > 0.0_dp) then
      fitting_lanes = min(1.0_dp, (e%varied*first/size_of_last)**(1.0_dp/s%order))
    end if
  end function fitting_lanes

  subroutine estimate_truncation(x, s, local_tolerance, factor, e, least)
    !! Estimate the sum of the terms that the step leaves out. One pair of poles is fitted to the
    !! last four terms by least squares: x(k + 1) = p x(k) - q x(k - 1).
    type(state_t), intent(in) :: x
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: local_tolerance, factor
    type(error_t), intent(inout) :: e
    real(dp), intent(inout) :: least !! lower bound
    real(dp) :: uu, vv, uv, ux, vx, p, q, determinant, powers(2*FEW), z(FITTED)
    real(dp) :: near, far
    integer :: i, k

    powers(1) = factor**(s%order - 2*FEW + 1)
    do k = 2, 2*FEW
      powers(k) = powers(k - 1)*factor
    end do
    uu = 0.0_dp
    vv = 0.0_dp
    uv = 0.0_dp
    ux = 0.0_dp
    vx = 0.0_dp
    do i = 1, x%n
      z = x%weights(i)/local_tolerance &
          *powers(2*FEW - FITTED + 1:)*s%a(s%order - FITTED + 1:s%order, FIRST_UNKNOWN - 1 + i)
      uu = uu + (z(3)*z(3) + z(2)*z(2))
      vv = vv + (z(2)*z(2) + z(1)*z(1))
      uv = uv + (z(3)*z(2) + z(2)*z(1))
      ux = ux + (z(3)*z(4) + z(2)*z(3))
      vx = vx + (z(2)*z(4) + z(1)*z(3))
    end do
    determinant = (RIDGE*uu)*(RIDGE*vv) - uv*uv
    p = (RIDGE*vv)*ux - uv*vx
    q = uv*ux - (RIDGE*uu)*vx
    ! A series that converges has no poles within the step, or nearly within.
    determinant = max((determinant - p) + q, abs(p - q), abs(q), tiny(p))
    p = (p - q)/determinant
    q = q/determinant
    do i = 1, x%n
      associate (slot => FIRST_UNKNOWN - 1 + i)
        e%left(i) = p*(s%a(s%order, slot)*powers(2*FEW)) &
                    - q*(s%a(s%order - 1, slot)*powers(2*FEW - 1))
      end associate
    end do
    ! The fit may be small by chance.
    near = 0.0_dp
    far = 0.0_dp
    do i = 1, x%n
      associate (last => s%a(s%order - 2*FEW + 1:s%order, FIRST_UNKNOWN - 1 + i))
        far = far + x%weights(i)*sum(abs(last(:FEW))*powers(:FEW))
        near = near + x%weights(i)*sum(abs(last(FEW + 1:))*powers(FEW + 1:))
      end associate
    end do
    least = max(least, near*min(0.5_dp, near/max(far, tiny(far))))
  end subroutine estimate_truncation

  subroutine take_error(x, s, factor, e)
    !! Advance the error and the perturbations to the end of the step.
    type(state_t), intent(in) :: x !! at the end of the step
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: factor
    type(error_t), intent(inout) :: e
    integer :: block

    do block = 1, e%n_blocks
      call sum_perturbations(arrays_of_block(s, block), e%last_terms(block), factor, &
                             e%lanes(1, 1, block))
    end do
    if (x%has_attitude) then
      call rotate(x%y(4), x%y(5), x%y(6), x%y(7), e%lanes(:, 4, 1), e%lanes(:, 5, 1), &
                  e%lanes(:, 6, 1), e%lanes(:, 7, 1))
    end if
    e%lanes(1, :x%n, 1) = e%lanes(1, :x%n, 1) - e%left
  end subroutine take_error

  subroutine keep_lanes(e)
    !! Let the error and the perturbations be constant in a step.
    type(error_t), intent(inout) :: e

    e%last_terms(:e%n_blocks) = 0
    e%left = 0.0_dp
  end subroutine keep_lanes

  subroutine take_change(derivatives, e)
    !! Advance the error and the perturbations by the derivatives of the change of the unknowns.
    real(dp), intent(in) :: derivatives(:, :) !! element (i, j) is that of change i by unknown j
    type(error_t), intent(inout) :: e
    real(dp) :: changes(SIDE_BY_SIDE, size(e%left))
    integer :: block, i, j, n

    n = size(e%left)
    do block = 1, e%n_blocks
      changes = 0.0_dp
      do j = 1, n
        do i = 1, n
          changes(:, i) = changes(:, i) + derivatives(i, j)*e%lanes(:, j, block)
        end do
      end do
      e%lanes(:, :n, block) = e%lanes(:, :n, block) + changes
    end do
  end subroutine take_change

  subroutine cross_error(gradient, slope, jump, e)
    !! Change the error and the perturbations where the rates jump. A perturbation changes the time
    !! of the jump (Leine and Nijmeijer 2004).
    real(dp), intent(in) :: gradient(:) !! of the operand
    real(dp), intent(in) :: slope       !! its derivative with respect to time
    real(dp), intent(in) :: jump(:)     !! of the rates
    type(error_t), intent(inout) :: e
    integer :: block, i

    do block = 1, e%n_blocks
      do i = 1, SIDE_BY_SIDE
        associate (lane => e%lanes(i, :size(jump), block))
          lane = lane + jump*(dot_product(gradient, lane)/slope)
        end associate
      end do
    end do
  end subroutine cross_error

  pure function matrix_of(e) result(matrix)
    !! Compute the matrix of the open block from the perturbations in the lanes.
    type(error_t), intent(in) :: e
    real(dp) :: matrix(MOST_UNKNOWNS, MOST_UNKNOWNS)
    integer :: i, n

    n = size(e%left)
    do i = 1, n
      matrix(:n, i) = e%lanes(1 + mod(i, SIDE_BY_SIDE), :n, 1 + i/SIDE_BY_SIDE)
    end do
  end function matrix_of

end module tape_error

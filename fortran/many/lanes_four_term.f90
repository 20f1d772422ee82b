module lanes_four_term
  !! A step of four_term.fypp in every lane; the margin names its cards. The matrix depends on DT
  !! alone: it is factored only when DT changes, and only once if all lanes have one step size.
  use blocks, only: LANE_COUNT
  use kinds, only: dp
  use ensemble, only: ensemble_t
  use lanes, only: block_t, torque_within
  use linear_solver_binary64, only: factor
  implicit none(type, external)
  private

  type, public :: grid_t
    real(dp), dimension(LANE_COUNT, 5) :: T, TL2, TL3, TL4 !! T1 to T5 and their powers 2 to 4, s
    real(dp) :: A(LANE_COUNT, 4, 4)       !! factors of the matrix
    real(dp) :: U(LANE_COUNT, 3, 0:4)     !! omega at the beginning and at T1 to T4, rad/s
    real(dp) :: sides(LANE_COUNT, 4, 3)   !! right-hand sides at T1 to T4
    real(dp) :: terms(LANE_COUNT, 4, 3)   !! coefficients of the trial functions
    integer :: row(LANE_COUNT, 4)         !! row of B for each row of the factors
    logical :: singular(LANE_COUNT)
    logical :: one_order                  !! whether all lanes have the same order of rows
    logical :: any_singular
  end type grid_t

  public :: set_grid, step_four_term, torque_four_term

contains

  subroutine set_grid(b, s)
    !! Compute everything that depends on DT alone.
    type(block_t), intent(inout) :: b
    type(grid_t), intent(inout) :: s
    real(dp), parameter :: shares(4) = [0.2_dp, 0.4_dp, 0.6_dp, 0.8_dp]
    real(dp) :: factors(4, 4)
    integer :: i
    integer :: k

    do k = 1, 4
      s%T(:, k) = b%DT*shares(k)                                                  ! 720-750
    end do
    s%T(:, 5) = b%step                                                            ! 760
    s%TL2 = s%T*s%T
    s%TL3 = s%TL2*s%T
    s%TL4 = s%TL2*s%TL2
    if (b%one_step_size) then
      call set_factors(s%T(1, 1:4), factors, s%row(1, :), b%ier(1))
      b%ier = b%ier(1)
      do k = 1, 4
        do i = 1, 4
          s%A(:, i, k) = factors(i, k)
        end do
        s%row(:, k) = s%row(1, k)
      end do
      s%one_order = .true.
    else
      do i = 1, LANE_COUNT
        call set_factors(s%T(i, 1:4), factors, s%row(i, :), b%ier(i))
        s%A(i, :, :) = factors
      end do
      s%one_order = .true.
      do k = 1, 4
        s%one_order = s%one_order .and. all(s%row(:, k) == s%row(1, k))
      end do
    end if
    s%singular = b%ier /= 0
    s%any_singular = any(s%singular)
  end subroutine set_grid

  subroutine set_factors(T, factors, row, ier)
    real(dp), intent(in) :: T(4)
    real(dp), intent(out) :: factors(4, 4)
    integer, intent(out) :: row(4)
    integer, intent(out) :: ier
    real(dp) :: A(4, 4)
    integer :: pivot(4)
    integer :: held
    integer :: k

    do k = 1, 4
      A(k, 1) = 1.0_dp                                                            ! 850-970
      A(k, 2) = 2.0_dp*T(k)                                                       ! 860-980
      A(k, 3) = 3.0_dp*(T(k)*T(k))                                                ! 870-990
      A(k, 4) = 4.0_dp*(T(k)*T(k)*T(k))                                           ! 880-1000
    end do
    call factor(A, 4, pivot, ier)
    row = [1, 2, 3, 4]
    factors = 1.0_dp
    if (ier /= 0) return
    factors = A
    do k = 1, 4
      held = row(pivot(k))
      row(pivot(k)) = row(k)
      row(k) = held
    end do
  end subroutine set_factors

  subroutine torque_four_term(e, I, b, s)
    !! Compute the torque at the beginning and at T1 to T4.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: I
    type(block_t), intent(inout) :: b
    type(grid_t), intent(in) :: s
    real(dp) :: after(LANE_COUNT, 5)

    after(:, 1) = 0.0_dp
    after(:, 2:) = s%T(:, :4)
    call torque_within(e, I, b, after, [1, 2, 3, 4, 5])
  end subroutine torque_four_term

  pure subroutine step_four_term(e, b, s)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(inout) :: b
    type(grid_t), intent(inout) :: s

    call turn(b, s)
    if (e%scene%with_velocity) call move(b, s)
  end subroutine step_four_term

  pure subroutine turn(b, s)
    !! Advance the angular velocity, which does not depend on the velocity.
    type(block_t), intent(inout) :: b
    type(grid_t), intent(inout) :: s
    real(dp) :: u1, u2, u3
    real(dp) :: there(LANE_COUNT, 3)
    integer :: i
    integer :: k

    ! first estimate: the right-hand sides are constant
    do i = 1, LANE_COUNT
      u1 = b%U(i, 1)
      u2 = b%U(i, 2)
      u3 = b%U(i, 3)
      s%U(i, 1, 0) = u1
      s%U(i, 2, 0) = u2
      s%U(i, 3, 0) = u3
      s%sides(i, 1, 1) = b%M(i, 1, 1) + b%A(i)*u2*u3                              ! 780
      s%sides(i, 1, 2) = b%M(i, 2, 1) + b%B(i)*u1*u3                              ! 790
      s%sides(i, 1, 3) = b%M(i, 3, 1) + b%C(i)*u1*u2                              ! 800
    end do
    call solve_alike(s)                                                           ! 1320
    do k = 1, 4
      call evaluate(s, k, b%U, there)                                             ! 1390-1440
      do i = 1, LANE_COUNT
        u1 = there(i, 1)
        u2 = there(i, 2)
        u3 = there(i, 3)
        s%U(i, 1, k) = u1
        s%U(i, 2, k) = u2
        s%U(i, 3, k) = u3
        s%sides(i, k, 1) = b%M(i, 1, k + 1) + b%A(i)*u2*u3                        ! 1510
        s%sides(i, k, 2) = b%M(i, 2, k + 1) + b%B(i)*u1*u3                        ! 1520
        s%sides(i, k, 3) = b%M(i, 3, k + 1) + b%C(i)*u1*u2                        ! 1530
      end do
    end do
    call solve(s)                                                                 ! 2010
    call evaluate(s, 5, s%U(:, :, 0), b%U)                                        ! 2030-2080
  end subroutine turn

  pure subroutine move(b, s)
    !! Advance the velocity, with the angular velocities at the beginning and at the points.
    type(block_t), intent(inout) :: b
    type(grid_t), intent(inout) :: s
    real(dp) :: v(LANE_COUNT, 3)
    integer :: k

    call push(b, s, 0, b%V)                                                       ! 810-830
    call solve_alike(s)                                                           ! 1320
    do k = 1, 4
      call evaluate(s, k, b%V, v)                                                 ! 1450-1500
      call push(b, s, k, v)                                                       ! 1540-1560
    end do
    call solve(s)                                                                 ! 2010
    v = b%V
    call evaluate(s, 5, v, b%V)                                                   ! 2090-2140
  end subroutine move

  pure subroutine push(b, s, k, v)
    !! Compute the right-hand sides at point k, or at the beginning if k = 0.
    type(block_t), intent(in) :: b
    type(grid_t), intent(inout) :: s
    integer, intent(in) :: k
    real(dp), intent(in) :: v(LANE_COUNT, 3)
    integer :: i
    integer :: at

    at = max(1, k)
    do i = 1, LANE_COUNT
      s%sides(i, at, 1) = b%ACL1 + v(i, 2)*s%U(i, 3, k) - v(i, 3)*s%U(i, 2, k)
      s%sides(i, at, 2) = b%ACL2 + v(i, 3)*s%U(i, 1, k) - v(i, 1)*s%U(i, 3, k)
      s%sides(i, at, 3) = b%ACL3 + v(i, 1)*s%U(i, 2, k) - v(i, 2)*s%U(i, 1, k)
    end do
  end subroutine push

  pure subroutine evaluate(s, k, base, x)
    !! Evaluate the trial functions at time k, from the values at the beginning.
    type(grid_t), intent(in) :: s
    integer, intent(in) :: k
    real(dp), intent(in) :: base(LANE_COUNT, 3)
    real(dp), intent(out) :: x(LANE_COUNT, 3)
    integer :: axis
    integer :: i

    do axis = 1, 3
      do i = 1, LANE_COUNT
        x(i, axis) = base(i, axis) + s%terms(i, 1, axis)*s%T(i, k) + &
                     s%terms(i, 2, axis)*s%TL2(i, k) + s%terms(i, 3, axis)*s%TL3(i, k) + &
                     s%terms(i, 4, axis)*s%TL4(i, k)
      end do
    end do
  end subroutine evaluate

  pure subroutine solve_alike(s)
    !! Solve with the first right-hand side in all four equations.
    type(grid_t), intent(inout) :: s
    integer :: variable

    do variable = 1, 3
      s%sides(:, 2, variable) = s%sides(:, 1, variable)
      s%sides(:, 3, variable) = s%sides(:, 1, variable)
      s%sides(:, 4, variable) = s%sides(:, 1, variable)
    end do
    call solve(s)
  end subroutine solve_alike

  pure subroutine solve(s)
    !! Substitute as LEQT1F does. A(1, 1) and all of its column are 1, so no division by it is
    !! needed.
    type(grid_t), intent(inout) :: s
    integer :: row(4)
    integer :: i
    integer :: variable
    real(dp) :: x1, x2, x3, x4, ordered(4)

    row = s%row(1, :)
    if (.not. s%one_order) then
      row = [1, 2, 3, 4]
      do variable = 1, 3
        do i = 1, LANE_COUNT
          ordered = s%sides(i, s%row(i, :), variable)
          s%sides(i, :, variable) = ordered
        end do
      end do
    end if
    do variable = 1, 3
      do i = 1, LANE_COUNT
        x1 = s%sides(i, row(1), variable)
        x2 = s%sides(i, row(2), variable) - s%A(i, 2, 1)*x1
        x3 = s%sides(i, row(3), variable) - s%A(i, 3, 1)*x1 - s%A(i, 3, 2)*x2
        x4 = s%sides(i, row(4), variable) - s%A(i, 4, 1)*x1 - s%A(i, 4, 2)*x2 - s%A(i, 4, 3)*x3
        x4 = x4/s%A(i, 4, 4)
        x3 = (x3 - s%A(i, 3, 4)*x4)/s%A(i, 3, 3)
        x2 = (x2 - s%A(i, 2, 3)*x3 - s%A(i, 2, 4)*x4)/s%A(i, 2, 2)
        x1 = x1 - s%A(i, 1, 2)*x2 - s%A(i, 1, 3)*x3 - s%A(i, 1, 4)*x4
        s%terms(i, 1, variable) = x1
        s%terms(i, 2, variable) = x2
        s%terms(i, 3, variable) = x3
        s%terms(i, 4, variable) = x4
      end do
    end do
    if (s%any_singular) then
      do i = 1, LANE_COUNT
        if (s%singular(i)) s%terms(i, :, :) = s%sides(i, :, :)
      end do
    end if
  end subroutine solve

end module lanes_four_term

module lanes_runge_kutta
  !! A step of runge_kutta.fypp in every lane; the margin names its cards. A listing only changes
  !! which array a stage reads, so that no decision is made lane by lane.
  use, intrinsic :: iso_fortran_env, only: int64
  use blocks, only: LANE_COUNT
  use kinds, only: dp
  use ensemble, only: ensemble_t
  use lanes, only: block_t, EXCEEDS, GOES_ON, torque_within
  implicit none(type, external)
  private

  type, public :: stages_t
    real(dp), dimension(LANE_COUNT, 3) :: U, V         !! U(1), V(1): base and first stage
    real(dp), dimension(LANE_COUNT, 6) :: change_k, change_u
    ! Values of one step: U and V after the stages, slopes.
    real(dp), dimension(LANE_COUNT, 3) :: first, second, third, first_v, second_v, third_v
    real(dp), dimension(LANE_COUNT, 3, 4) :: K, K_v
    real(dp) :: half(LANE_COUNT)
  end type stages_t

  public :: begin_stages, step_runge_kutta, test, torque_runge_kutta

contains

  pure subroutine begin_stages(b, s)
    type(block_t), intent(in) :: b
    type(stages_t), intent(out) :: s

    s%U = b%U
    s%V = b%V
    s%change_k = 0.0_dp
    s%change_u = 0.0_dp
  end subroutine begin_stages

  subroutine torque_runge_kutta(e, L, b)
    !! Compute the torque of the four stages, at points 1, 2 and 4.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: L
    type(block_t), intent(inout) :: b
    real(dp) :: after(LANE_COUNT, 3)

    after(:, 1) = 0.0_dp
    after(:, 2) = 0.5_dp*b%DT
    after(:, 3) = b%DT
    call torque_within(e, L, b, after, [1, 2, 4])
  end subroutine torque_runge_kutta

  subroutine step_runge_kutta(e, b, s)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(inout) :: b
    type(stages_t), intent(inout) :: s

    s%half = 0.5_dp*b%DT
    if (e%listing%stage_base) then
      call turn(b, 1, s%U, s%U, s%half, s%K(:, :, 1), s%first)                    ! 800-880
      call turn(b, 2, s%first, s%first, s%half, s%K(:, :, 2), s%second)           ! 800-880
      call turn(b, 2, s%second, s%second, b%DT, s%K(:, :, 3), s%third)            ! 950-1060
    else
      call turn(b, 1, s%U, b%U, s%half, s%K(:, :, 1), s%first)                    ! 800-880
      call turn(b, 2, s%first, b%U, s%half, s%K(:, :, 2), s%second)               ! 800-880
      call turn(b, 2, s%second, b%U, b%DT, s%K(:, :, 3), s%third)                 ! 950-1060
    end if
    if (e%listing%do_variable) call drop_third_stage(s%K(:, :, 3), s%third)
    call turn_last(b, s%third, s%K(:, :, 4))                                      ! 1120-1140
    if (e%scene%with_velocity) then
      ! velocity, with the angular velocities of the stages
      if (e%listing%stage_base) then
        call move(b, s%U, s%V, s%V, s%half, s%K_v(:, :, 1), s%first_v)            ! 830-910
        call move(b, s%first, s%first_v, s%first_v, s%half, s%K_v(:, :, 2), s%second_v) ! 830-910
        call move(b, s%second, s%second_v, s%second_v, b%DT, s%K_v(:, :, 3), s%third_v) ! 980-1090
      else
        call move(b, s%U, s%V, b%V, s%half, s%K_v(:, :, 1), s%first_v)            ! 830-910
        call move(b, s%first, s%first_v, b%V, s%half, s%K_v(:, :, 2), s%second_v) ! 830-910
        call move(b, s%second, s%second_v, b%V, b%DT, s%K_v(:, :, 3), s%third_v)  ! 980-1090
      end if
      if (e%listing%do_variable) call drop_third_stage(s%K_v(:, :, 3), s%third_v)
      call move(b, s%third, s%third_v, b%V, b%DT, s%K_v(:, :, 4), s%second_v)     ! 1150-1170
      call close_step(e, b%DT, s%K_v, s%third_v, b%V, s%V, s%change_u(:, 4:6), &
                      s%change_k(:, 4:6))                                         ! 1210-1230
      call begin_next(e, s%first_v, b%V, s%V)
    end if
    call close_step(e, b%DT, s%K, s%third, b%U, s%U, s%change_u(:, 1:3), &
                    s%change_k(:, 1:3))                                           ! 1180-1200
    call begin_next(e, s%first, b%U, s%U)
  end subroutine step_runge_kutta

  pure subroutine drop_third_stage(K, third)
    !! Clear the third stage: in FORTRAN 77 its results are stored in the place of the fourth.
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: K, third

    third = 0.0_dp
    K = 0.0_dp
  end subroutine drop_third_stage

  pure subroutine turn(b, point, u, base, step, K, after)
    !! Compute the slopes KF, KG, KH at u, and a step from the base with them.
    type(block_t), intent(in) :: b
    integer, intent(in) :: point
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: u, base
    real(dp), intent(in) :: step(LANE_COUNT)
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: K, after
    real(dp) :: u1, u2, u3, KF, KG, KH
    integer :: i

    do i = 1, LANE_COUNT
      u1 = u(i, 1)
      u2 = u(i, 2)
      u3 = u(i, 3)
      KF = b%M(i, 1, point) + b%A(i)*u2*u3
      KG = b%M(i, 2, point) + b%B(i)*u3*u1
      KH = b%M(i, 3, point) + b%C(i)*u1*u2
      K(i, 1) = KF
      K(i, 2) = KG
      K(i, 3) = KH
      after(i, 1) = base(i, 1) + step(i)*KF
      after(i, 2) = base(i, 2) + step(i)*KG
      after(i, 3) = base(i, 3) + step(i)*KH
    end do
  end subroutine turn

  pure subroutine move(b, u, v, base, step, K, after)
    !! Compute the slopes KX, KY, KZ at u and v, and a step from the base with them.
    type(block_t), intent(in) :: b
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: u, v, base
    real(dp), intent(in) :: step(LANE_COUNT)
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: K, after
    real(dp) :: v1, v2, v3, KX, KY, KZ
    integer :: i

    do i = 1, LANE_COUNT
      v1 = v(i, 1)
      v2 = v(i, 2)
      v3 = v(i, 3)
      KX = b%ACL1 + v2*u(i, 3) - v3*u(i, 2)
      KY = b%ACL2 + v3*u(i, 1) - v1*u(i, 3)
      KZ = b%ACL3 + v1*u(i, 2) - v2*u(i, 1)
      K(i, 1) = KX
      K(i, 2) = KY
      K(i, 3) = KZ
      after(i, 1) = base(i, 1) + step(i)*KX
      after(i, 2) = base(i, 2) + step(i)*KY
      after(i, 3) = base(i, 3) + step(i)*KZ
    end do
  end subroutine move

  pure subroutine turn_last(b, u, K)
    !! Compute KF, KG, KH at the fourth stage, from which no further step starts.
    type(block_t), intent(in) :: b
    real(dp), intent(in) :: u(LANE_COUNT, 3)
    real(dp), intent(out) :: K(LANE_COUNT, 3)
    integer :: i

    do i = 1, LANE_COUNT
      K(i, 1) = b%M(i, 1, 4) + b%A(i)*u(i, 2)*u(i, 3)
      K(i, 2) = b%M(i, 2, 4) + b%B(i)*u(i, 3)*u(i, 1)
      K(i, 3) = b%M(i, 3, 4) + b%C(i)*u(i, 1)*u(i, 2)
    end do
  end subroutine turn_last

  pure subroutine close_step(e, DT, K, third, U, before, change_u, change_k)
    !! Compute the result (eq. 31) and the changes that the Lipschitz test (eq. 19) compares.
    type(ensemble_t), intent(in) :: e
    real(dp), intent(in) :: DT(LANE_COUNT), K(LANE_COUNT, 3, 4)
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: third
    real(dp), dimension(LANE_COUNT, 3), intent(inout) :: U     !! UU of the cards, then U(4)
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: before   !! U(1) of this step
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: change_u, change_k
    real(dp) :: new
    integer :: axis
    integer :: i

    do axis = 1, 3
      do i = 1, LANE_COUNT
        new = U(i, axis) + (DT(i)/6.0_dp)*(K(i, axis, 1) + &
                                           2.0_dp*(K(i, axis, 2) + K(i, axis, 3)) + K(i, axis, 4))
        change_k(i, axis) = abs(K(i, axis, 4) - K(i, axis, 1))                    ! 1330-1380
        change_u(i, axis) = abs(new - U(i, axis))                                 ! 1270-1320
        U(i, axis) = new
      end do
    end do
    if (.not. e%listing%lipschitz_mismatched_pairs) then
      do axis = 1, 3
        do i = 1, LANE_COUNT
          change_u(i, axis) = abs(third(i, axis) - before(i, axis))               ! 1270-1320
        end do
      end do
    end if
  end subroutine close_step

  pure subroutine begin_next(e, first, U, next)
    !! Set the start of the next step.
    type(ensemble_t), intent(in) :: e
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: first, U
    real(dp), dimension(LANE_COUNT, 3), intent(inout) :: next  !! U(1) of this step, then the next
    integer :: axis
    integer :: i

    if (e%listing%base_not_restored) then
      do axis = 1, 3
        do i = 1, LANE_COUNT
          next(i, axis) = first(i, axis)
        end do
      end do
    else
      do axis = 1, 3
        do i = 1, LANE_COUNT
          next(i, axis) = U(i, axis)
        end do
      end do
    end if
  end subroutine begin_next

  pure subroutine test(e, b, s, verdict, found)
    !! Find the lanes that exceed the Lipschitz constant; lipschitz_test finds the variable.
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(in) :: b
    type(stages_t), intent(in) :: s
    integer(int64), intent(inout) :: verdict(LANE_COUNT)
    integer(int64), intent(inout) :: found
    real(dp) :: sum_k(LANE_COUNT), sum_u(LANE_COUNT)
    integer(int64) :: exceeding(LANE_COUNT)
    integer(int64) :: here
    integer :: i
    integer :: last
    integer :: variable

    last = merge(6, 3, e%listing%lipschitz_tests_velocity)
    exceeding = GOES_ON
    if (e%listing%lipschitz_per_component) then
      do variable = 1, last
        do i = 1, LANE_COUNT
          here = merge(EXCEEDS, GOES_ON, &
                       s%change_k(i, variable) > s%change_u(i, variable)*b%lipschitz(i)) ! 1410-1460
          exceeding(i) = ior(exceeding(i), here)
        end do
      end do
    else
      sum_k = 0.0_dp
      sum_u = 0.0_dp
      do variable = 1, last
        do i = 1, LANE_COUNT
          sum_k(i) = sum_k(i) + s%change_k(i, variable)*s%change_k(i, variable)
          sum_u(i) = sum_u(i) + s%change_u(i, variable)*s%change_u(i, variable)
        end do
      end do
      do i = 1, LANE_COUNT
        exceeding(i) = merge(EXCEEDS, GOES_ON, sqrt(sum_k(i)) > sqrt(sum_u(i))*b%lipschitz(i))
      end do
    end if
    do i = 1, LANE_COUNT
      verdict(i) = ior(verdict(i), iand(exceeding(i), b%alive(i)))
      found = ior(found, verdict(i))
    end do
  end subroutine test

end module lanes_runge_kutta

module lanes_runge_kutta
  !! A step of runge_kutta.f90 in every lane; the margin names its cards.
  !! What a listing changes is which array a stage reads: no question is asked lane by lane.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use ensemble, only: ensemble_t
  use lanes, only: block_t, first_torque, set_torque, spread_torque, EXCEEDS, GOES_ON, LANE_COUNT
  implicit none(type, external)
  private

  type, public :: stages_t
    real(dp), dimension(LANE_COUNT, 3) :: U, V         !! U(1): base and first stage at once
    real(dp), dimension(LANE_COUNT, 6) :: change_k, change_u
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
    !! Where the torque varies: as assumed where no card exists. Points 1, 2 and 4.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: L
    type(block_t), intent(inout) :: b
    real(dp) :: time(LANE_COUNT)

    if (e%listing%initial_torque .and. L == 1) then
      call first_torque(b)
    else if (e%listing%torque_held) then
      call set_torque(e%scene, b, b%TIME, 1)
      call spread_torque(b)
    else
      time = real(L - 1, dp)*b%step
      call set_torque(e%scene, b, time, 1)
      time = real(L - 1, dp)*b%step + 0.5_dp*b%DT
      call set_torque(e%scene, b, time, 2)
      time = real(L - 1, dp)*b%step + b%DT
      call set_torque(e%scene, b, time, 4)
    end if
  end subroutine torque_runge_kutta

  subroutine step_runge_kutta(e, b, s)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(inout) :: b
    type(stages_t), intent(inout) :: s
    real(dp), dimension(LANE_COUNT, 3) :: base, P, first, second, third
    real(dp), dimension(LANE_COUNT, 3) :: base_v, P_v, first_v, second_v, third_v
    real(dp), dimension(LANE_COUNT, 3, 4) :: K
    real(dp) :: half(LANE_COUNT)

    half = 0.5_dp*b%DT
    base = b%U
    P = s%U
    call turn(b, 1, P, K(:, :, 1))                                                ! 800-820
    call advance(e%listing%stage_base, base, P, half, K(:, :, 1), first)          ! 860-880
    call turn(b, 2, first, K(:, :, 2))                                            ! 800-820
    call advance(e%listing%stage_base, base, first, half, K(:, :, 2), second)     ! 860-880
    call turn(b, 2, second, K(:, :, 3))                                           ! 950-970
    call advance(e%listing%stage_base, base, second, b%DT, K(:, :, 3), third)     ! 1040-1060
    if (e%listing%do_variable) then
      ! FORTRAN 77: this stage goes to the place of the fourth, and the third stays zero.
      third = 0.0_dp
      K(:, :, 3) = 0.0_dp
    end if
    call turn(b, 4, third, K(:, :, 4))                                            ! 1120-1140
    call weigh(base, b%DT, K, b%U)                                                ! 1180-1200
    call carry(e, base, P, first, third, b%U, K, s%U, s%change_u(:, 1:3), s%change_k(:, 1:3))
    if (.not. e%scene%with_velocity) return

    ! the velocity, along the angular velocities of the stages
    base_v = b%V
    P_v = s%V
    call move(b, P, P_v, K(:, :, 1))                                              ! 830-850
    call advance(e%listing%stage_base, base_v, P_v, half, K(:, :, 1), first_v)    ! 890-910
    call move(b, first, first_v, K(:, :, 2))                                      ! 830-850
    call advance(e%listing%stage_base, base_v, first_v, half, K(:, :, 2), second_v) ! 890-910
    call move(b, second, second_v, K(:, :, 3))                                    ! 980-1000
    call advance(e%listing%stage_base, base_v, second_v, b%DT, K(:, :, 3), third_v) ! 1070-1090
    if (e%listing%do_variable) then
      third_v = 0.0_dp
      K(:, :, 3) = 0.0_dp
    end if
    call move(b, third, third_v, K(:, :, 4))                                      ! 1150-1170
    call weigh(base_v, b%DT, K, b%V)                                              ! 1210-1230
    call carry(e, base_v, P_v, first_v, third_v, b%V, K, s%V, s%change_u(:, 4:6), &
               s%change_k(:, 4:6))
  end subroutine step_runge_kutta

  pure subroutine turn(b, point, u, K)
    !! KF, KG, KH.
    type(block_t), intent(in) :: b
    integer, intent(in) :: point
    real(dp), intent(in) :: u(LANE_COUNT, 3)
    real(dp), intent(out) :: K(LANE_COUNT, 3)
    integer :: i

    do i = 1, LANE_COUNT
      K(i, 1) = b%M(i, 1, point) + b%A(i)*u(i, 2)*u(i, 3)
      K(i, 2) = b%M(i, 2, point) + b%B(i)*u(i, 3)*u(i, 1)
      K(i, 3) = b%M(i, 3, point) + b%C(i)*u(i, 1)*u(i, 2)
    end do
  end subroutine turn

  pure subroutine move(b, u, v, K)
    !! KX, KY, KZ.
    type(block_t), intent(in) :: b
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: u, v
    real(dp), intent(out) :: K(LANE_COUNT, 3)
    integer :: i

    do i = 1, LANE_COUNT
      K(i, 1) = b%ACL1 + v(i, 2)*u(i, 3) - v(i, 3)*u(i, 2)
      K(i, 2) = b%ACL2 + v(i, 3)*u(i, 1) - v(i, 1)*u(i, 3)
      K(i, 3) = b%ACL3 + v(i, 1)*u(i, 2) - v(i, 2)*u(i, 1)
    end do
  end subroutine move

  pure subroutine advance(stage_base, base, before, step, K, after)
    !! A stage, from the base of the step or from the stage before.
    logical, intent(in) :: stage_base
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: base, before, K
    real(dp), intent(in) :: step(LANE_COUNT)
    real(dp), intent(out) :: after(LANE_COUNT, 3)
    integer :: axis
    integer :: i

    if (stage_base) then
      do axis = 1, 3
        do i = 1, LANE_COUNT
          after(i, axis) = before(i, axis) + step(i)*K(i, axis)
        end do
      end do
    else
      do axis = 1, 3
        do i = 1, LANE_COUNT
          after(i, axis) = base(i, axis) + step(i)*K(i, axis)
        end do
      end do
    end if
  end subroutine advance

  pure subroutine weigh(base, DT, K, after)
    real(dp), intent(in) :: base(LANE_COUNT, 3), DT(LANE_COUNT), K(LANE_COUNT, 3, 4)
    real(dp), intent(out) :: after(LANE_COUNT, 3)
    real(dp) :: sixth(LANE_COUNT)
    integer :: axis
    integer :: i

    sixth = DT/6.0_dp
    do axis = 1, 3
      do i = 1, LANE_COUNT
        after(i, axis) = base(i, axis) + &
                         sixth(i)*(K(i, axis, 1) + 2.0_dp*(K(i, axis, 2) + K(i, axis, 3)) + &
                                   K(i, axis, 4))
      end do
    end do
  end subroutine weigh

  pure subroutine carry(e, base, P, first, third, after, K, next, change_u, change_k)
    !! What the next step begins with, and what the Lipschitz test compares.
    type(ensemble_t), intent(in) :: e
    real(dp), dimension(LANE_COUNT, 3), intent(in) :: base, P, first, third, after
    real(dp), intent(in) :: K(LANE_COUNT, 3, 4)
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: next, change_u, change_k

    if (e%listing%base_not_restored) then
      next = first
    else
      next = after
    end if
    if (.not. e%scene%may_stop) return
    if (e%listing%lipschitz_mismatched_pairs) then
      change_u = abs(after - base)                                                ! 1270-1320
    else
      change_u = abs(third - P)                                                   ! 1270-1320
    end if
    change_k = abs(K(:, :, 4) - K(:, :, 1))                                       ! 1330-1380
  end subroutine carry

  pure subroutine test(e, b, s, verdict, found)
    !! Whether any lane exceeds: lipschitz_test says in what.
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

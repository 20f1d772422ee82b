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
    ! Of one step: U when it began, at stage 1, and after the stages.
    real(dp), dimension(LANE_COUNT, 3) :: base, P, first, second, third
    real(dp), dimension(LANE_COUNT, 3) :: base_v, P_v, first_v, second_v, third_v
    real(dp), dimension(LANE_COUNT, 3, 4) :: K
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

    associate (base => s%base, P => s%P, first => s%first, second => s%second, &
               third => s%third, K => s%K, half => s%half)
      half = 0.5_dp*b%DT
      base = b%U
      P = s%U
      if (e%listing%stage_base) then
        call turn(b, 1, P, P, half, K(:, :, 1), first)                            ! 800-880
        call turn(b, 2, first, first, half, K(:, :, 2), second)                   ! 800-880
        call turn(b, 2, second, second, b%DT, K(:, :, 3), third)                  ! 950-1060
      else
        call turn(b, 1, P, base, half, K(:, :, 1), first)                         ! 800-880
        call turn(b, 2, first, base, half, K(:, :, 2), second)                    ! 800-880
        call turn(b, 2, second, base, b%DT, K(:, :, 3), third)                    ! 950-1060
      end if
      if (e%listing%do_variable) call leave_out(K(:, :, 3), third)
      call turn(b, 4, third, base, b%DT, K(:, :, 4), b%U)                         ! 1120-1140
      call weigh(base, b%DT, K, b%U)                                              ! 1180-1200
      call carry(e, base, P, first, third, b%U, K, s%U, s%change_u(:, 1:3), s%change_k(:, 1:3))
    end associate
    if (.not. e%scene%with_velocity) return

    ! along the angular velocities of the stages
    associate (base => s%base_v, P => s%P_v, first => s%first_v, second => s%second_v, &
               third => s%third_v, K => s%K, half => s%half)
      base = b%V
      P = s%V
      if (e%listing%stage_base) then
        call move(b, s%P, P, P, half, K(:, :, 1), first)                          ! 830-910
        call move(b, s%first, first, first, half, K(:, :, 2), second)             ! 830-910
        call move(b, s%second, second, second, b%DT, K(:, :, 3), third)           ! 980-1090
      else
        call move(b, s%P, P, base, half, K(:, :, 1), first)                       ! 830-910
        call move(b, s%first, first, base, half, K(:, :, 2), second)              ! 830-910
        call move(b, s%second, second, base, b%DT, K(:, :, 3), third)             ! 980-1090
      end if
      if (e%listing%do_variable) call leave_out(K(:, :, 3), third)
      call move(b, s%third, third, base, b%DT, K(:, :, 4), b%V)                   ! 1150-1170
      call weigh(base, b%DT, K, b%V)                                              ! 1210-1230
      call carry(e, base, P, first, third, b%V, K, s%V, s%change_u(:, 4:6), s%change_k(:, 4:6))
    end associate
  end subroutine step_runge_kutta

  pure subroutine leave_out(K, third)
    !! FORTRAN 77: this stage goes to the place of the fourth, and the third stays zero.
    real(dp), dimension(LANE_COUNT, 3), intent(out) :: K, third

    third = 0.0_dp
    K = 0.0_dp
  end subroutine leave_out

  pure subroutine turn(b, point, u, base, step, K, after)
    !! KF, KG, KH at u, and a step from the base.
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
    !! KX, KY, KZ at u and v, and a step from the base.
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

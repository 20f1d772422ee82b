module lanes_runge_kutta
  !! A step of runge_kutta.f90 in every lane; the margin names its cards.
  !! The stages are scalars: a lane goes through the whole step in registers.
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use ensemble, only: ensemble_t
  use lanes, only: block_t, first_torque, set_torque, spread_torque, EXCEEDS, GOES_ON, LANE_COUNT, &
                   OVERFLOWS
  implicit none(type, external)
  private

  type, public :: stages_t
    real(dp), dimension(LANE_COUNT) :: U11, U21, U31 !! U(1): base and first stage at once
    real(dp), dimension(LANE_COUNT) :: V11, V21, V31
    real(dp), dimension(LANE_COUNT, 3) :: P          !! U at which K(1) was evaluated
    real(dp), dimension(LANE_COUNT, 3, 3) :: U       !! after stages 1, 2, 3
    real(dp), dimension(LANE_COUNT, 6) :: change_k, change_u
  end type stages_t

  public :: begin_stages, step_runge_kutta, torque_runge_kutta

contains

  pure subroutine begin_stages(b, s)
    type(block_t), intent(in) :: b
    type(stages_t), intent(out) :: s

    s%U11 = b%U1
    s%U21 = b%U2
    s%U31 = b%U3
    s%V11 = b%V1
    s%V21 = b%V2
    s%V31 = b%V3
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

  subroutine step_runge_kutta(e, b, s, verdict, found)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(inout) :: b
    type(stages_t), intent(inout) :: s
    integer(int64), intent(out) :: verdict(LANE_COUNT) !! of lanes that are alive
    integer(int64), intent(out) :: found               !! of any of them
    integer :: i

    call turn(e%listing%stage_base, e%listing%base_not_restored, e%listing%do_variable, &
              e%listing%lipschitz_mismatched_pairs, b, s)
    if (e%scene%with_velocity) then
      call move(e%listing%stage_base, e%listing%base_not_restored, e%listing%do_variable, &
                e%listing%lipschitz_mismatched_pairs, b, s)
    end if
    found = GOES_ON
    do i = 1, LANE_COUNT
      verdict(i) = merge(GOES_ON, OVERFLOWS, abs(b%U1(i)) <= huge(1.0_dp) .and. &
                         abs(b%U2(i)) <= huge(1.0_dp) .and. abs(b%U3(i)) <= huge(1.0_dp))
      verdict(i) = iand(verdict(i), b%alive(i))
      found = ior(found, verdict(i))
    end do
    if (e%scene%may_stop) then
      if (.not. e%listing%lipschitz_per_component) then
        call test_norms(merge(6, 3, e%listing%lipschitz_tests_velocity), b, s, verdict, found)
      else
        call test_components(1, 3, b, s, verdict, found)
        if (e%listing%lipschitz_tests_velocity) call test_components(4, 6, b, s, verdict, found)
      end if
    end if
  end subroutine step_runge_kutta

  pure subroutine turn(stage_base, base_not_restored, do_variable, mismatched, b, s)
    !! The angular velocity, which does not see the velocity.
    logical, intent(in) :: stage_base, base_not_restored, do_variable, mismatched
    type(block_t), intent(inout) :: b
    type(stages_t), intent(inout) :: s
    real(dp) :: DT, half, p1, p2, p3, u1, u2, u3, base1, base2, base3
    real(dp) :: KF1, KF2, KF3, KF4, KG1, KG2, KG3, KG4, KH1, KH2, KH3, KH4
    integer :: i

    do i = 1, LANE_COUNT
      DT = b%DT(i)
      half = 0.5_dp*DT
      p1 = s%U11(i)
      p2 = s%U21(i)
      p3 = s%U31(i)
      s%P(i, 1) = p1
      s%P(i, 2) = p2
      s%P(i, 3) = p3
      KF1 = b%M(i, 1, 1) + b%A(i)*p2*p3                                           ! 800
      KG1 = b%M(i, 2, 1) + b%B(i)*p3*p1                                           ! 810
      KH1 = b%M(i, 3, 1) + b%C(i)*p1*p2                                           ! 820
      base1 = merge(p1, b%U1(i), stage_base)
      base2 = merge(p2, b%U2(i), stage_base)
      base3 = merge(p3, b%U3(i), stage_base)
      u1 = base1 + half*KF1                                                       ! 860
      u2 = base2 + half*KG1                                                       ! 870
      u3 = base3 + half*KH1                                                       ! 880
      s%U(i, 1, 1) = u1
      s%U(i, 2, 1) = u2
      s%U(i, 3, 1) = u3
      KF2 = b%M(i, 1, 2) + b%A(i)*u2*u3                                           ! 800
      KG2 = b%M(i, 2, 2) + b%B(i)*u3*u1                                           ! 810
      KH2 = b%M(i, 3, 2) + b%C(i)*u1*u2                                           ! 820
      base1 = merge(u1, b%U1(i), stage_base)
      base2 = merge(u2, b%U2(i), stage_base)
      base3 = merge(u3, b%U3(i), stage_base)
      u1 = base1 + half*KF2                                                       ! 860
      u2 = base2 + half*KG2                                                       ! 870
      u3 = base3 + half*KH2                                                       ! 880
      s%U(i, 1, 2) = u1
      s%U(i, 2, 2) = u2
      s%U(i, 3, 2) = u3
      KF3 = b%M(i, 1, 2) + b%A(i)*u2*u3                                           ! 950
      KG3 = b%M(i, 2, 2) + b%B(i)*u3*u1                                           ! 960
      KH3 = b%M(i, 3, 2) + b%C(i)*u1*u2                                           ! 970
      base1 = merge(u1, b%U1(i), stage_base)
      base2 = merge(u2, b%U2(i), stage_base)
      base3 = merge(u3, b%U3(i), stage_base)
      u1 = base1 + DT*KF3                                                         ! 1040
      u2 = base2 + DT*KG3                                                         ! 1050
      u3 = base3 + DT*KH3                                                         ! 1060
      ! FORTRAN 77: this stage goes to the place of the fourth, and the third stays zero.
      u1 = merge(0.0_dp, u1, do_variable)
      u2 = merge(0.0_dp, u2, do_variable)
      u3 = merge(0.0_dp, u3, do_variable)
      KF3 = merge(0.0_dp, KF3, do_variable)
      KG3 = merge(0.0_dp, KG3, do_variable)
      KH3 = merge(0.0_dp, KH3, do_variable)
      s%U(i, 1, 3) = u1
      s%U(i, 2, 3) = u2
      s%U(i, 3, 3) = u3
      KF4 = b%M(i, 1, 4) + b%A(i)*u2*u3                                           ! 1120
      KG4 = b%M(i, 2, 4) + b%B(i)*u3*u1                                           ! 1130
      KH4 = b%M(i, 3, 4) + b%C(i)*u1*u2                                           ! 1140
      u1 = b%U1(i) + (DT/6.0_dp)*(KF1 + 2.0_dp*(KF2 + KF3) + KF4)                 ! 1180
      u2 = b%U2(i) + (DT/6.0_dp)*(KG1 + 2.0_dp*(KG2 + KG3) + KG4)                 ! 1190
      u3 = b%U3(i) + (DT/6.0_dp)*(KH1 + 2.0_dp*(KH2 + KH3) + KH4)                 ! 1200
      s%change_u(i, 1) = abs(merge(u1 - b%U1(i), s%U(i, 1, 3) - p1, mismatched))  ! 1270
      s%change_u(i, 2) = abs(merge(u2 - b%U2(i), s%U(i, 2, 3) - p2, mismatched))  ! 1280
      s%change_u(i, 3) = abs(merge(u3 - b%U3(i), s%U(i, 3, 3) - p3, mismatched))  ! 1290
      s%change_k(i, 1) = abs(KF4 - KF1)                                           ! 1330
      s%change_k(i, 2) = abs(KG4 - KG1)                                           ! 1340
      s%change_k(i, 3) = abs(KH4 - KH1)                                           ! 1350
      b%U1(i) = u1                                                                ! 1480
      b%U2(i) = u2                                                                ! 1490
      b%U3(i) = u3                                                                ! 1500
      s%U11(i) = merge(s%U(i, 1, 1), u1, base_not_restored)
      s%U21(i) = merge(s%U(i, 2, 1), u2, base_not_restored)
      s%U31(i) = merge(s%U(i, 3, 1), u3, base_not_restored)
    end do
  end subroutine turn

  pure subroutine move(stage_base, base_not_restored, do_variable, mismatched, b, s)
    !! The velocity, along the angular velocities of the stages.
    logical, intent(in) :: stage_base, base_not_restored, do_variable, mismatched
    type(block_t), intent(inout) :: b
    type(stages_t), intent(inout) :: s
    real(dp) :: DT, half, p1, p2, p3, v1, v2, v3, first1, first2, first3, base1, base2, base3
    real(dp) :: KX1, KX2, KX3, KX4, KY1, KY2, KY3, KY4, KZ1, KZ2, KZ3, KZ4
    integer :: i

    do i = 1, LANE_COUNT
      DT = b%DT(i)
      half = 0.5_dp*DT
      p1 = s%V11(i)
      p2 = s%V21(i)
      p3 = s%V31(i)
      KX1 = b%ACL1 + p2*s%P(i, 3) - p3*s%P(i, 2)                                  ! 830
      KY1 = b%ACL2 + p3*s%P(i, 1) - p1*s%P(i, 3)                                  ! 840
      KZ1 = b%ACL3 + p1*s%P(i, 2) - p2*s%P(i, 1)                                  ! 850
      base1 = merge(p1, b%V1(i), stage_base)
      base2 = merge(p2, b%V2(i), stage_base)
      base3 = merge(p3, b%V3(i), stage_base)
      first1 = base1 + half*KX1                                                   ! 890
      first2 = base2 + half*KY1                                                   ! 900
      first3 = base3 + half*KZ1                                                   ! 910
      KX2 = b%ACL1 + first2*s%U(i, 3, 1) - first3*s%U(i, 2, 1)                    ! 830
      KY2 = b%ACL2 + first3*s%U(i, 1, 1) - first1*s%U(i, 3, 1)                    ! 840
      KZ2 = b%ACL3 + first1*s%U(i, 2, 1) - first2*s%U(i, 1, 1)                    ! 850
      base1 = merge(first1, b%V1(i), stage_base)
      base2 = merge(first2, b%V2(i), stage_base)
      base3 = merge(first3, b%V3(i), stage_base)
      v1 = base1 + half*KX2                                                       ! 890
      v2 = base2 + half*KY2                                                       ! 900
      v3 = base3 + half*KZ2                                                       ! 910
      KX3 = b%ACL1 + v2*s%U(i, 3, 2) - v3*s%U(i, 2, 2)                            ! 980
      KY3 = b%ACL2 + v3*s%U(i, 1, 2) - v1*s%U(i, 3, 2)                            ! 990
      KZ3 = b%ACL3 + v1*s%U(i, 2, 2) - v2*s%U(i, 1, 2)                            ! 1000
      base1 = merge(v1, b%V1(i), stage_base)
      base2 = merge(v2, b%V2(i), stage_base)
      base3 = merge(v3, b%V3(i), stage_base)
      v1 = base1 + DT*KX3                                                         ! 1070
      v2 = base2 + DT*KY3                                                         ! 1080
      v3 = base3 + DT*KZ3                                                         ! 1090
      v1 = merge(0.0_dp, v1, do_variable)
      v2 = merge(0.0_dp, v2, do_variable)
      v3 = merge(0.0_dp, v3, do_variable)
      KX3 = merge(0.0_dp, KX3, do_variable)
      KY3 = merge(0.0_dp, KY3, do_variable)
      KZ3 = merge(0.0_dp, KZ3, do_variable)
      KX4 = b%ACL1 + v2*s%U(i, 3, 3) - v3*s%U(i, 2, 3)                            ! 1150
      KY4 = b%ACL2 + v3*s%U(i, 1, 3) - v1*s%U(i, 3, 3)                            ! 1160
      KZ4 = b%ACL3 + v1*s%U(i, 2, 3) - v2*s%U(i, 1, 3)                            ! 1170
      base1 = b%V1(i)
      base2 = b%V2(i)
      base3 = b%V3(i)
      b%V1(i) = base1 + (DT/6.0_dp)*(KX1 + 2.0_dp*(KX2 + KX3) + KX4)              ! 1210
      b%V2(i) = base2 + (DT/6.0_dp)*(KY1 + 2.0_dp*(KY2 + KY3) + KY4)              ! 1220
      b%V3(i) = base3 + (DT/6.0_dp)*(KZ1 + 2.0_dp*(KZ2 + KZ3) + KZ4)              ! 1230
      s%change_u(i, 4) = abs(merge(b%V1(i) - base1, v1 - p1, mismatched))         ! 1300
      s%change_u(i, 5) = abs(merge(b%V2(i) - base2, v2 - p2, mismatched))         ! 1310
      s%change_u(i, 6) = abs(merge(b%V3(i) - base3, v3 - p3, mismatched))         ! 1320
      s%change_k(i, 4) = abs(KX4 - KX1)                                           ! 1360
      s%change_k(i, 5) = abs(KY4 - KY1)                                           ! 1370
      s%change_k(i, 6) = abs(KZ4 - KZ1)                                           ! 1380
      s%V11(i) = merge(first1, b%V1(i), base_not_restored)
      s%V21(i) = merge(first2, b%V2(i), base_not_restored)
      s%V31(i) = merge(first3, b%V3(i), base_not_restored)
    end do
  end subroutine move

  pure subroutine test_components(first, last, b, s, verdict, found)
    !! Whether any variable from first to last exceeds; lipschitz_test says which.
    integer, intent(in) :: first, last
    type(block_t), intent(in) :: b
    type(stages_t), intent(in) :: s
    integer(int64), intent(inout) :: verdict(LANE_COUNT)
    integer(int64), intent(inout) :: found
    integer(int64) :: here
    integer :: i
    integer :: variable

    do variable = first, last
      do i = 1, LANE_COUNT
        here = merge(EXCEEDS, GOES_ON, &
                     s%change_k(i, variable) > s%change_u(i, variable)*b%lipschitz(i)) ! 1410-1460
        verdict(i) = ior(verdict(i), iand(here, b%alive(i)))
        found = ior(found, verdict(i))
      end do
    end do
  end subroutine test_components

  pure subroutine test_norms(last, b, s, verdict, found)
    !! Whether the norm exceeds.
    integer, intent(in) :: last
    type(block_t), intent(in) :: b
    type(stages_t), intent(in) :: s
    integer(int64), intent(inout) :: verdict(LANE_COUNT)
    integer(int64), intent(inout) :: found
    real(dp) :: sum_k(LANE_COUNT), sum_u(LANE_COUNT)
    integer(int64) :: here
    integer :: i
    integer :: variable

    sum_k = 0.0_dp
    sum_u = 0.0_dp
    do variable = 1, last
      do i = 1, LANE_COUNT
        sum_k(i) = sum_k(i) + s%change_k(i, variable)*s%change_k(i, variable)
        sum_u(i) = sum_u(i) + s%change_u(i, variable)*s%change_u(i, variable)
      end do
    end do
    do i = 1, LANE_COUNT
      here = merge(EXCEEDS, GOES_ON, sqrt(sum_k(i)) > sqrt(sum_u(i))*b%lipschitz(i))
      verdict(i) = ior(verdict(i), iand(here, b%alive(i)))
      found = ior(found, verdict(i))
    end do
  end subroutine test_norms

end module lanes_runge_kutta

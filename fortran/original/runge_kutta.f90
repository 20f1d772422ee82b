module runge_kutta_program
  !! Runge-Kutta, Jacobs 1982, eq. 31, IV.3 and the program RK of the appendix (151 cards).
  !! The stop test is the thesis's use of the Lipschitz condition, eq. 19.
  !! Faithful in every operation and its order; the margin names the card.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use deck, only: deck_t, stop_t, euler_coefficients, normalized_torque, accelerations, is_finite, &
                  steps_between_looks
  use listing_flags, only: listing_t
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW, STOPPED
  implicit none(type, external)
  private

  public :: lipschitz_test, runge_kutta

contains

  subroutine runge_kutta(scene, listing, rows, n_rows, status, evaluations, stop_at)
    type(deck_t), intent(in) :: scene
    type(listing_t), intent(in) :: listing
    real(dp), intent(out) :: rows(8, scene%n_steps)  !! n h, TIME, U (rad/s), V (m/s)
    integer, intent(out) :: n_rows                   !! rows that hold a result
    integer, intent(out) :: status                   !! COMPLETE, STOPPED or OVERFLOW
    integer, intent(out) :: evaluations              !! right-hand sides KF, KG, KH
    type(stop_t), intent(out) :: stop_at             !! what the Lipschitz test found
    real(dp) :: KF(4)    ! right-hand side of eq. 16 at each stage, rad/s2
    real(dp) :: KG(4)    ! of eq. 17
    real(dp) :: KH(4)    ! of eq. 18
    real(dp) :: KX(4)    ! translational right-hand side, m/s2
    real(dp) :: KY(4)    ! along axis 2
    real(dp) :: KZ(4)    ! along axis 3
    real(dp) :: U1(4)    ! omega1 after each stage; (1) is the base as well, rad/s
    real(dp) :: U2(4)    ! omega2
    real(dp) :: U3(4)    ! omega3
    real(dp) :: V1(4)    ! velocity along axis 1, m/s
    real(dp) :: V2(4)    ! along axis 2
    real(dp) :: V3(4)    ! along axis 3
    real(dp) :: R1(4)    ! torque over moment at each stage, 1/s2
    real(dp) :: R2(4)    ! about axis 2
    real(dp) :: R3(4)    ! about axis 3
    real(dp) :: UU1      ! omega1 at the step's beginning, rad/s
    real(dp) :: UU2      ! omega2
    real(dp) :: UU3      ! omega3
    real(dp) :: VV1      ! velocity at the step's beginning, m/s
    real(dp) :: VV2      ! along axis 2
    real(dp) :: VV3      ! along axis 3
    real(dp) :: A        ! (I2-I3)/I1
    real(dp) :: B        ! (I3-I1)/I2
    real(dp) :: C        ! (I1-I2)/I3
    real(dp) :: ACL1     ! force over mass, m/s2
    real(dp) :: ACL2     ! along axis 2
    real(dp) :: ACL3     ! along axis 3
    real(dp) :: TIME     ! as TAPE5 gets it, s
    real(dp) :: DT       ! step, s
    real(dp) :: begin    ! true time of the step's beginning, s
    real(dp) :: P(6)     ! the point at which K(1) was evaluated: U, then V
    real(dp) :: change_u(6)  ! FL2, GL2, HL2, XL2, YL2, ZL2
    real(dp) :: change_k(6)  ! FL1, GL1, HL1, XL1, YL1, ZL1
    integer :: I
    integer :: J
    integer :: L
    integer :: next_look  ! step at which the user is looked at

    n_rows = 0
    status = COMPLETE
    evaluations = 0
    stop_at = stop_t(0, 0.0_dp)
    KF = 0.0_dp
    KG = 0.0_dp
    KH = 0.0_dp
    KX = 0.0_dp
    KY = 0.0_dp
    KZ = 0.0_dp
    U1 = 0.0_dp
    U2 = 0.0_dp
    U3 = 0.0_dp
    V1 = 0.0_dp
    V2 = 0.0_dp
    V3 = 0.0_dp

    TIME = 0.0_dp                                                                 ! 170
    U1(1) = scene%omega(1)                                                        ! 310
    U2(1) = scene%omega(2)                                                        ! 320
    U3(1) = scene%omega(3)                                                        ! 330
    call euler_coefficients(scene, A, B, C)                                       ! 360-380
    call normalized_torque(scene, 0.0_dp, R1(1), R2(1), R3(1))                    ! 410-430
    R1(2:4) = R1(1)
    R2(2:4) = R2(1)
    R3(2:4) = R3(1)
    V1(1) = 0.0_dp                                                                ! 460
    V2(1) = 0.0_dp                                                                ! 470
    V3(1) = 0.0_dp                                                                ! 480
    call accelerations(scene, ACL1, ACL2, ACL3)                                   ! 590-610
    DT = scene%step_size                                                          ! 640
    UU1 = U1(1)                                                                   ! 660
    UU2 = U2(1)                                                                   ! 670
    UU3 = U3(1)                                                                   ! 680
    VV1 = V1(1)                                                                   ! 690
    VV2 = V2(1)                                                                   ! 700
    VV3 = V3(1)                                                                   ! 710

    next_look = steps_between_looks(scene)
    do L = 1, scene%n_steps                                                       ! 750
      if (L >= next_look) then
        next_look = L + steps_between_looks(scene)
        if (interrupt_raised() /= 0) then
          status = INTERRUPTED
          return
        end if
      end if
      begin = real(L - 1, dp)*scene%step_size
      TIME = TIME + DT                                                            ! 760
      if (scene%torque_varies) then
        if (listing%initial_torque .and. L == 1) then
          R1 = scene%torque_first(1)
          R2 = scene%torque_first(2)
          R3 = scene%torque_first(3)
        else if (listing%torque_held) then
          call normalized_torque(scene, TIME, R1(1), R2(1), R3(1))
          R1(2:4) = R1(1)
          R2(2:4) = R2(1)
          R3(2:4) = R3(1)
        else
          call normalized_torque(scene, begin, R1(1), R2(1), R3(1))
          call normalized_torque(scene, begin + 0.5_dp*DT, R1(2), R2(2), R3(2))
          R1(3) = R1(2)
          R2(3) = R2(2)
          R3(3) = R3(2)
          call normalized_torque(scene, begin + DT, R1(4), R2(4), R3(4))
        end if
      end if
      P = [U1(1), U2(1), U3(1), V1(1), V2(1), V3(1)]

      do I = 1, 2                                                                 ! 770
        J = I - 1                                                                 ! 780
        if (I == 1) J = 1                                                         ! 790
        KF(I) = R1(I) + A*U2(J)*U3(J)                                             ! 800
        KG(I) = R2(I) + B*U3(J)*U1(J)                                             ! 810
        KH(I) = R3(I) + C*U1(J)*U2(J)                                             ! 820
        if (scene%with_velocity) then
          KX(I) = ACL1 + V2(J)*U3(J) - V3(J)*U2(J)                                ! 830
          KY(I) = ACL2 + V3(J)*U1(J) - V1(J)*U3(J)                                ! 840
          KZ(I) = ACL3 + V1(J)*U2(J) - V2(J)*U1(J)                                ! 850
        end if
        if (listing%stage_base) then
          U1(I) = U1(J) + 0.5_dp*DT*KF(I)                                         ! 860
          U2(I) = U2(J) + 0.5_dp*DT*KG(I)                                         ! 870
          U3(I) = U3(J) + 0.5_dp*DT*KH(I)                                         ! 880
          if (scene%with_velocity) then
            V1(I) = V1(J) + 0.5_dp*DT*KX(I)                                       ! 890
            V2(I) = V2(J) + 0.5_dp*DT*KY(I)                                       ! 900
            V3(I) = V3(J) + 0.5_dp*DT*KZ(I)                                       ! 910
          end if
        else
          U1(I) = UU1 + 0.5_dp*DT*KF(I)                                           ! 860
          U2(I) = UU2 + 0.5_dp*DT*KG(I)                                           ! 870
          U3(I) = UU3 + 0.5_dp*DT*KH(I)                                           ! 880
          if (scene%with_velocity) then
            V1(I) = VV1 + 0.5_dp*DT*KX(I)                                         ! 890
            V2(I) = VV2 + 0.5_dp*DT*KY(I)                                         ! 900
            V3(I) = VV3 + 0.5_dp*DT*KZ(I)                                         ! 910
          end if
        end if
      end do                                                                      ! 920
      if (listing%do_variable) then
        I = 3 ! FORTRAN 77: one beyond the last value
      else
        I = 2 ! FORTRAN 66 in practice: the last value
      end if
      I = I + 1                                                                   ! 930
      J = 2                                                                       ! 940
      KF(I) = R1(I) + A*U2(J)*U3(J)                                               ! 950
      KG(I) = R2(I) + B*U3(J)*U1(J)                                               ! 960
      KH(I) = R3(I) + C*U1(J)*U2(J)                                               ! 970
      if (scene%with_velocity) then
        KX(I) = ACL1 + V2(J)*U3(J) - V3(J)*U2(J)                                  ! 980
        KY(I) = ACL2 + V3(J)*U1(J) - V1(J)*U3(J)                                  ! 990
        KZ(I) = ACL3 + V1(J)*U2(J) - V2(J)*U1(J)                                  ! 1000
      end if
      if (listing%stage_base) then
        U1(I) = U1(J) + DT*KF(I)                                                  ! 1040
        U2(I) = U2(J) + DT*KG(I)                                                  ! 1050
        U3(I) = U3(J) + DT*KH(I)                                                  ! 1060
        if (scene%with_velocity) then
          V1(I) = V1(J) + DT*KX(I)                                                ! 1070
          V2(I) = V2(J) + DT*KY(I)                                                ! 1080
          V3(I) = V3(J) + DT*KZ(I)                                                ! 1090
        end if
      else
        U1(I) = UU1 + DT*KF(I)                                                    ! 1040
        U2(I) = UU2 + DT*KG(I)                                                    ! 1050
        U3(I) = UU3 + DT*KH(I)                                                    ! 1060
        if (scene%with_velocity) then
          V1(I) = VV1 + DT*KX(I)                                                  ! 1070
          V2(I) = VV2 + DT*KY(I)                                                  ! 1080
          V3(I) = VV3 + DT*KZ(I)                                                  ! 1090
        end if
      end if
      I = 4                                                                       ! 1100
      J = 3                                                                       ! 1110
      KF(I) = R1(I) + A*U2(J)*U3(J)                                               ! 1120
      KG(I) = R2(I) + B*U3(J)*U1(J)                                               ! 1130
      KH(I) = R3(I) + C*U1(J)*U2(J)                                               ! 1140
      if (scene%with_velocity) then
        KX(I) = ACL1 + V2(J)*U3(J) - V3(J)*U2(J)                                  ! 1150
        KY(I) = ACL2 + V3(J)*U1(J) - V1(J)*U3(J)                                  ! 1160
        KZ(I) = ACL3 + V1(J)*U2(J) - V2(J)*U1(J)                                  ! 1170
      end if
      U1(I) = UU1 + (DT/6.0_dp)*(KF(1) + 2.0_dp*(KF(2) + KF(3)) + KF(4))          ! 1180
      U2(I) = UU2 + (DT/6.0_dp)*(KG(1) + 2.0_dp*(KG(2) + KG(3)) + KG(4))          ! 1190
      U3(I) = UU3 + (DT/6.0_dp)*(KH(1) + 2.0_dp*(KH(2) + KH(3)) + KH(4))          ! 1200
      if (scene%with_velocity) then
        if (scene%with_velocity) then
          V1(I) = VV1 + (DT/6.0_dp)*(KX(1) + 2.0_dp*(KX(2) + KX(3)) + KX(4))      ! 1210
          V2(I) = VV2 + (DT/6.0_dp)*(KY(1) + 2.0_dp*(KY(2) + KY(3)) + KY(4))      ! 1220
          V3(I) = VV3 + (DT/6.0_dp)*(KZ(1) + 2.0_dp*(KZ(2) + KZ(3)) + KZ(4))      ! 1230
        end if
      end if
      evaluations = evaluations + 4
      if (.not. is_finite(U1(4), U2(4), U3(4))) then
        status = OVERFLOW
        return
      end if

      n_rows = L
      rows(1, L) = real(L, dp)*scene%step_size
      rows(2, L) = TIME                                                           ! 1250
      rows(3, L) = U1(4)                                                          ! 1250
      rows(4, L) = U2(4)                                                          ! 1250
      rows(5, L) = U3(4)                                                          ! 1250
      if (scene%with_velocity) then
        rows(6, L) = V1(4)                                                        ! 1250
        rows(7, L) = V2(4)                                                        ! 1250
        rows(8, L) = V3(4)                                                        ! 1250
      end if

      ! the Lipschitz test
      if (listing%lipschitz_mismatched_pairs) then
        change_u(1) = abs(U1(I) - UU1)                                            ! 1270
        change_u(2) = abs(U2(I) - UU2)                                            ! 1280
        change_u(3) = abs(U3(I) - UU3)                                            ! 1290
        change_u(4) = abs(V1(I) - VV1)                                            ! 1300
        change_u(5) = abs(V2(I) - VV2)                                            ! 1310
        change_u(6) = abs(V3(I) - VV3)                                            ! 1320
      else
        change_u(1) = abs(U1(J) - P(1))                                           ! 1270
        change_u(2) = abs(U2(J) - P(2))                                           ! 1280
        change_u(3) = abs(U3(J) - P(3))                                           ! 1290
        change_u(4) = abs(V1(J) - P(4))                                           ! 1300
        change_u(5) = abs(V2(J) - P(5))                                           ! 1310
        change_u(6) = abs(V3(J) - P(6))                                           ! 1320
      end if
      change_k(1) = abs(KF(4) - KF(1))                                            ! 1330
      change_k(2) = abs(KG(4) - KG(1))                                            ! 1340
      change_k(3) = abs(KH(4) - KH(1))                                            ! 1350
      change_k(4) = abs(KX(4) - KX(1))                                            ! 1360
      change_k(5) = abs(KY(4) - KY(1))                                            ! 1370
      change_k(6) = abs(KZ(4) - KZ(1))                                            ! 1380
      if (scene%may_stop) then
        call lipschitz_test(listing, change_k, change_u, scene%lipschitz, stop_at)
        if (stop_at%variable /= 0) then
          status = STOPPED
          return
        end if
      end if

      UU1 = U1(I)                                                                 ! 1480
      UU2 = U2(I)                                                                 ! 1490
      UU3 = U3(I)                                                                 ! 1500
      if (scene%with_velocity) then
        VV1 = V1(I)                                                               ! 1510
        VV2 = V2(I)                                                               ! 1520
        VV3 = V3(I)                                                               ! 1530
      end if
      if (.not. listing%base_not_restored) then
        U1(1) = U1(I)
        U2(1) = U2(I)
        U3(1) = U3(I)
        if (scene%with_velocity) then
          V1(1) = V1(I)
          V2(1) = V2(I)
          V3(1) = V3(I)
        end if
      end if
    end do                                                                        ! 1540
  end subroutine runge_kutta

  pure subroutine lipschitz_test(listing, change_k, change_u, LIP, stop_at)
    !! Condition of eq. 19 between two points: |change of K| <= LIP |change of U|.
    type(listing_t), intent(in) :: listing
    real(dp), intent(in) :: change_k(6)   !! along U1-U3, V1-V3
    real(dp), intent(in) :: change_u(6)   !! the same
    real(dp), intent(in) :: LIP           !! 1/s
    type(stop_t), intent(out) :: stop_at  !! variable 0: the condition holds
    integer, parameter :: order(6) = [4, 5, 6, 1, 2, 3] ! velocities are tested first
    real(dp) :: sum_k
    real(dp) :: sum_u
    integer :: first
    integer :: last
    integer :: variable

    stop_at = stop_t(0, 0.0_dp)
    if (listing%lipschitz_per_component) then
      first = 4
      if (listing%lipschitz_tests_velocity) first = 1                             ! 1410-1430
      do variable = first, 6
        if (change_k(order(variable)) > change_u(order(variable))*LIP) then       ! 1410-1460
          stop_at%variable = order(variable)
          stop_at%quotient = change_k(order(variable))/change_u(order(variable))
          return
        end if
      end do
    else
      last = 3
      if (listing%lipschitz_tests_velocity) last = 6
      sum_k = 0.0_dp
      sum_u = 0.0_dp
      do variable = 1, last
        sum_k = sum_k + change_k(variable)*change_k(variable)
        sum_u = sum_u + change_u(variable)*change_u(variable)
      end do
      if (sqrt(sum_k) > sqrt(sum_u)*LIP) then
        stop_at%variable = merge(8, 7, listing%lipschitz_tests_velocity)
        stop_at%quotient = sqrt(sum_k)/sqrt(sum_u)
      end if
    end if
  end subroutine lipschitz_test

end module runge_kutta_program

module two_term_program
  !! Two-term collocation, Jacobs 1982, IV.2 and the program FEM1 of the appendix (159 cards).
  !! omega = omega(0) + c1 t + c2 t**2 (eq. 34), residual zero at T1 and T2 (eq. 36).
  !! Faithful in every operation and its order; the margin names the card.
  use interruption, only: interrupt_raised
  use kinds, only: dp
  use deck, only: deck_t, euler_coefficients, normalized_torque, accelerations, is_finite, &
                  steps_between_looks
  use linear_solver, only: leqt1f
  use listing_flags, only: listing_t
  use statuses, only: COMPLETE, INTERRUPTED, OVERFLOW
  implicit none(type, external)
  private

  public :: two_term

contains

  subroutine two_term(scene, listing, rows, ier_rows, n_rows, status, evaluations)
    type(deck_t), intent(in) :: scene
    type(listing_t), intent(in) :: listing
    real(dp), intent(out) :: rows(8, scene%n_steps)  !! n h, TIME, U (rad/s), V (m/s)
    integer, intent(out) :: ier_rows(scene%n_steps)  !! IER as printed
    integer, intent(out) :: n_rows                   !! rows that hold a result
    integer, intent(out) :: status                   !! COMPLETE or OVERFLOW
    integer, intent(out) :: evaluations              !! right-hand sides F, G, H
    real(dp) :: A(2, 2)  ! collocation matrix
    real(dp) :: B(2, 6)  ! residual equations, then trial function coefficients
    real(dp) :: U1(4)    ! omega1 at the interval's beginning, T1, T2 and end, rad/s
    real(dp) :: U2(4)    ! omega2
    real(dp) :: U3(4)    ! omega3
    real(dp) :: V1(4)    ! velocity along axis 1, m/s
    real(dp) :: V2(4)    ! along axis 2
    real(dp) :: V3(4)    ! along axis 3
    real(dp) :: M1(3)    ! torque over moment at the beginning, T1 and T2, 1/s2
    real(dp) :: M2(3)    ! about axis 2
    real(dp) :: M3(3)    ! about axis 3
    real(dp) :: A1       ! (I2-I3)/I1
    real(dp) :: B1       ! (I3-I1)/I2
    real(dp) :: C        ! (I1-I2)/I3
    real(dp) :: C1       ! set by no card
    real(dp) :: ACL1     ! force over mass, m/s2
    real(dp) :: ACL2     ! along axis 2
    real(dp) :: ACL3     ! along axis 3
    real(dp) :: TIME     ! as TAPE5 gets it, s
    real(dp) :: DT       ! the step that sets the collocation points, s
    real(dp) :: T1       ! first collocation point, s
    real(dp) :: T2       ! second collocation point, s
    real(dp) :: T3       ! end of the interval, s
    real(dp) :: T12      ! T1**2
    real(dp) :: T22      ! T2**2
    real(dp) :: T32      ! T3**2
    real(dp) :: begin    ! true time of the interval's beginning, s
    real(dp) :: F1, F2, F3, G1, G2, G3, H1, H2, H3  ! right-hand sides of eq. 16-18, rad/s2
    real(dp) :: X1, X2, X3, Y1, Y2, Y3, Z1, Z2, Z3  ! translational right-hand sides, m/s2
    integer :: I
    integer :: M         ! right-hand sides of LEQT1F
    integer :: IER
    integer :: next_look  ! step at which the user is looked at

    n_rows = 0
    status = COMPLETE
    evaluations = 0

    TIME = 0.0_dp                                                                 ! 150
    U1(1) = scene%omega(1)                                                        ! 300
    U2(1) = scene%omega(2)                                                        ! 310
    U3(1) = scene%omega(3)                                                        ! 320
    call euler_coefficients(scene, A1, B1, C)                                     ! 400-420
    C1 = 0.0_dp
    call normalized_torque(scene, 0.0_dp, M1(1), M2(1), M3(1))                    ! 450-470
    M1(2:3) = M1(1)
    M2(2:3) = M2(1)
    M3(2:3) = M3(1)
    V1(1) = 0.0_dp                                                                ! 500
    V2(1) = 0.0_dp                                                                ! 510
    V3(1) = 0.0_dp                                                                ! 520
    call accelerations(scene, ACL1, ACL2, ACL3)                                   ! 630-650
    DT = scene%step_size                                                          ! 670
    M = merge(6, 3, scene%with_velocity)                                          ! 1010

    next_look = steps_between_looks(scene)
    do I = 1, scene%n_steps                                                       ! 690
      if (I >= next_look) then
        next_look = I + steps_between_looks(scene)
        if (interrupt_raised() /= 0) then
          status = INTERRUPTED
          return
        end if
      end if
      begin = real(I - 1, dp)*scene%step_size
      TIME = TIME + DT                                                            ! 700
      T1 = DT/3.0_dp                                                              ! 710
      T2 = 2.0_dp*DT/3.0_dp                                                       ! 720
      T3 = scene%step_size                                                        ! 730
      T12 = T1*T1
      T22 = T2*T2
      T32 = T3*T3
      if (scene%torque_varies) then
        if (listing%initial_torque .and. I == 1) then
          M1 = scene%torque_first(1)
          M2 = scene%torque_first(2)
          M3 = scene%torque_first(3)
        else if (listing%torque_held) then
          call normalized_torque(scene, TIME, M1(1), M2(1), M3(1))
          M1(2:3) = M1(1)
          M2(2:3) = M2(1)
          M3(2:3) = M3(1)
        else
          call normalized_torque(scene, begin, M1(1), M2(1), M3(1))
          call normalized_torque(scene, begin + T1, M1(2), M2(2), M3(2))
          call normalized_torque(scene, begin + T2, M1(3), M2(3), M3(3))
        end if
      end if

      ! first estimate: constant right-hand sides
      F1 = M1(1) + A1*U2(1)*U3(1)                                                 ! 750
      G1 = M2(1) + B1*U1(1)*U3(1)                                                 ! 760
      if (listing%c1_for_c) then
        H1 = M3(1) + C1*U1(1)*U2(1)                                               ! 770
      else
        H1 = M3(1) + C*U1(1)*U2(1)                                                ! 770
      end if
      if (scene%with_velocity) then
        X1 = ACL1 + V2(1)*U3(1) - V3(1)*U2(1)                                     ! 780
        Y1 = ACL2 + V3(1)*U1(1) - V1(1)*U3(1)                                     ! 790
        Z1 = ACL3 + V1(1)*U2(1) - V2(1)*U1(1)                                     ! 800
      end if
      A(1, 1) = 1.0_dp                                                            ! 820
      A(1, 2) = 2.0_dp*T1                                                         ! 830
      A(2, 1) = 1.0_dp                                                            ! 840
      A(2, 2) = 2.0_dp*T2                                                         ! 850
      B(1, 1) = F1                                                                ! 870
      B(2, 1) = F1                                                                ! 880
      B(1, 2) = G1                                                                ! 890
      B(2, 2) = G1                                                                ! 900
      B(1, 3) = H1                                                                ! 910
      B(2, 3) = H1                                                                ! 920
      if (scene%with_velocity) then
        B(1, 4) = X1                                                              ! 930
        B(2, 4) = X1                                                              ! 940
        B(1, 5) = Y1                                                              ! 950
        B(2, 5) = Y1                                                              ! 960
        B(1, 6) = Z1                                                              ! 970
        B(2, 6) = Z1                                                              ! 980
      end if
      call leqt1f(A, M, 2, B, IER)                                                ! 1050
      U1(2) = U1(1) + B(1, 1)*T1 + B(2, 1)*T12                                    ! 1070
      U1(3) = U1(1) + B(1, 1)*T2 + B(2, 1)*T22                                    ! 1080
      U2(2) = U2(1) + B(1, 2)*T1 + B(2, 2)*T12                                    ! 1090
      U2(3) = U2(1) + B(1, 2)*T2 + B(2, 2)*T22                                    ! 1100
      U3(2) = U3(1) + B(1, 3)*T1 + B(2, 3)*T12                                    ! 1110
      U3(3) = U3(1) + B(1, 3)*T2 + B(2, 3)*T22                                    ! 1120
      if (scene%with_velocity) then
        V1(2) = V1(1) + B(1, 4)*T1 + B(2, 4)*T12                                  ! 1130
        V1(3) = V1(1) + B(1, 4)*T2 + B(2, 4)*T22                                  ! 1140
        V2(2) = V2(1) + B(1, 5)*T1 + B(2, 5)*T12                                  ! 1150
        V2(3) = V2(1) + B(1, 5)*T2 + B(2, 5)*T22                                  ! 1160
        V3(2) = V3(1) + B(1, 6)*T1 + B(2, 6)*T12                                  ! 1170
        V3(3) = V3(1) + B(1, 6)*T2 + B(2, 6)*T22                                  ! 1180
      end if

      ! correction: right-hand sides at the collocation points
      F2 = M1(2) + A1*U2(2)*U3(2)                                                 ! 1190
      F3 = M1(3) + A1*U2(3)*U3(3)                                                 ! 1200
      G2 = M2(2) + B1*U1(2)*U3(2)                                                 ! 1210
      G3 = M2(3) + B1*U1(3)*U3(3)                                                 ! 1220
      H2 = M3(2) + C*U1(2)*U2(2)                                                  ! 1230
      H3 = M3(3) + C*U1(3)*U2(3)                                                  ! 1240
      if (scene%with_velocity) then
        X2 = ACL1 + V2(2)*U3(2) - V3(2)*U2(2)                                     ! 1250
        if (listing%x3_reads_acl2) then
          X3 = ACL2 + V2(3)*U3(3) - V3(3)*U2(3)                                   ! 1260
        else
          X3 = ACL1 + V2(3)*U3(3) - V3(3)*U2(3)                                   ! 1260
        end if
        Y2 = ACL2 + V3(2)*U1(2) - V1(2)*U3(2)                                     ! 1270
        Y3 = ACL2 + V3(3)*U1(3) - V1(3)*U3(3)                                     ! 1280
        Z2 = ACL3 + V1(2)*U2(2) - V2(2)*U1(2)                                     ! 1290
        Z3 = ACL3 + V1(3)*U2(3) - V2(3)*U1(3)                                     ! 1300
      end if
      A(1, 1) = 1.0_dp                                                            ! 1320
      A(1, 2) = 2.0_dp*T1                                                         ! 1330
      A(2, 1) = 1.0_dp                                                            ! 1340
      A(2, 2) = 2.0_dp*T2                                                         ! 1350
      B(1, 1) = F2                                                                ! 1360
      B(2, 1) = F3                                                                ! 1370
      B(1, 2) = G2                                                                ! 1380
      B(2, 2) = G3                                                                ! 1390
      B(1, 3) = H2                                                                ! 1400
      B(2, 3) = H3                                                                ! 1410
      if (scene%with_velocity) then
        B(1, 4) = X2                                                              ! 1420
        B(2, 4) = X3                                                              ! 1430
        B(1, 5) = Y2                                                              ! 1440
        B(2, 5) = Y3                                                              ! 1450
        B(1, 6) = Z2                                                              ! 1460
        B(2, 6) = Z3                                                              ! 1470
      end if
      call leqt1f(A, M, 2, B, IER)                                                ! 1480
      U1(4) = U1(1) + B(1, 1)*T3 + B(2, 1)*T32                                    ! 1500
      U2(4) = U2(1) + B(1, 2)*T3 + B(2, 2)*T32                                    ! 1510
      U3(4) = U3(1) + B(1, 3)*T3 + B(2, 3)*T32                                    ! 1520
      if (scene%with_velocity) then
        V1(4) = V1(1) + B(1, 4)*T3 + B(2, 4)*T32                                  ! 1530
        V2(4) = V2(1) + B(1, 5)*T3 + B(2, 5)*T32                                  ! 1540
        V3(4) = V3(1) + B(1, 6)*T3 + B(2, 6)*T32                                  ! 1550
      end if
      evaluations = evaluations + 3
      if (.not. is_finite(U1(4), U2(4), U3(4))) then
        status = OVERFLOW
        return
      end if

      n_rows = I
      ier_rows(I) = IER                                                           ! 1560
      rows(1, I) = real(I, dp)*scene%step_size
      rows(2, I) = TIME                                                           ! 1590
      rows(3, I) = U1(4)                                                          ! 1590
      rows(4, I) = U2(4)                                                          ! 1590
      rows(5, I) = U3(4)                                                          ! 1590
      if (scene%with_velocity) then
        rows(6, I) = V1(4)                                                        ! 1590
        rows(7, I) = V2(4)                                                        ! 1590
        rows(8, I) = V3(4)                                                        ! 1590
      end if
      U1(1) = U1(4)                                                               ! 1600
      U2(1) = U2(4)                                                               ! 1610
      U3(1) = U3(4)                                                               ! 1620
      if (scene%with_velocity) then
        V1(1) = V1(4)                                                             ! 1630
        V2(1) = V2(4)                                                             ! 1640
        V3(1) = V3(4)                                                             ! 1650
      end if
      if (listing%dt_accumulates) then
        DT = DT + scene%step_size                                                 ! 1660
      end if
    end do                                                                        ! 1670
  end subroutine two_term

end module two_term_program

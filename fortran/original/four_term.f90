module four_term_program
  !! Four-term collocation, Jacobs 1982, IV.2 and the second program of the appendix (218 cards).
  !! omega = omega(0) + c1 t + c2 t**2 + c3 t**3 + c4 t**4, residual zero at .2, .4, .6, .8 DT.
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

  public :: four_term

contains

  subroutine four_term(scene, listing, rows, ier_rows, n_rows, status, evaluations)
    type(deck_t), intent(in) :: scene
    type(listing_t), intent(in) :: listing
    real(dp), intent(out) :: rows(8, scene%n_steps)  !! n h, TIME, U (rad/s), V (m/s)
    integer, intent(out) :: ier_rows(scene%n_steps)  !! IER as printed
    integer, intent(out) :: n_rows                   !! rows that hold a result
    integer, intent(out) :: status                   !! COMPLETE or OVERFLOW
    integer, intent(out) :: evaluations              !! right-hand sides F, G, H
    real(dp) :: A(4, 4)  ! collocation matrix
    real(dp) :: B(4, 6)  ! residual equations, then trial function coefficients
    real(dp) :: T(5)     ! collocation points as the loop over L reads them, s
    real(dp) :: U1(6)    ! omega1 at the interval's beginning, T1, T2, T3, T4 and end, rad/s
    real(dp) :: U2(6)    ! omega2
    real(dp) :: U3(6)    ! omega3
    real(dp) :: V1(6)    ! velocity along axis 1, m/s
    real(dp) :: V2(6)    ! along axis 2
    real(dp) :: V3(6)    ! along axis 3
    real(dp) :: M1(5)    ! torque over moment at the beginning and at T1 to T4, 1/s2
    real(dp) :: M2(5)    ! about axis 2
    real(dp) :: M3(5)    ! about axis 3
    real(dp) :: F(5)     ! right-hand side of eq. 16 at T1 to T4, rad/s2
    real(dp) :: G(5)     ! of eq. 17
    real(dp) :: H(5)     ! of eq. 18
    real(dp) :: X(5)     ! translational right-hand side, m/s2
    real(dp) :: Y(5)     ! along axis 2
    real(dp) :: Z(5)     ! along axis 3
    real(dp) :: A1       ! (I2-I3)/I1
    real(dp) :: B1       ! (I3-I1)/I2
    real(dp) :: C        ! (I1-I2)/I3
    real(dp) :: ACL1     ! force over mass, m/s2
    real(dp) :: ACL2     ! along axis 2
    real(dp) :: ACL3     ! along axis 3
    real(dp) :: TIME     ! as TAPE5 gets it, s
    real(dp) :: DT       ! the step that sets the collocation points, s
    real(dp) :: T1       ! first collocation point, s
    real(dp) :: T2       ! second
    real(dp) :: T3       ! third
    real(dp) :: T4       ! fourth
    real(dp) :: T5       ! end of the interval, s
    real(dp) :: TL2      ! second, third and fourth power of the time at hand
    real(dp) :: TL3
    real(dp) :: TL4
    real(dp) :: begin    ! true time of the interval's beginning, s
    real(dp) :: F1, G1, H1  ! right-hand sides of eq. 16-18 at the beginning, rad/s2
    real(dp) :: X1, Y1, Z1  ! translational ones, m/s2
    integer :: I
    integer :: L
    integer :: M         ! right-hand sides of LEQT1F
    integer :: IER
    integer :: next_look  ! step at which the user is looked at

    n_rows = 0
    status = COMPLETE
    evaluations = 0

    TIME = 0.0_dp                                                                 ! 160
    U1(1) = scene%omega(1)                                                        ! 310
    U2(1) = scene%omega(2)                                                        ! 320
    U3(1) = scene%omega(3)                                                        ! 330
    call euler_coefficients(scene, A1, B1, C)                                     ! 410-430
    call normalized_torque(scene, 0.0_dp, M1(1), M2(1), M3(1))                    ! 460-480
    M1(2:5) = M1(1)
    M2(2:5) = M2(1)
    M3(2:5) = M3(1)
    V1(1) = 0.0_dp                                                                ! 510
    V2(1) = 0.0_dp                                                                ! 520
    V3(1) = 0.0_dp                                                                ! 530
    call accelerations(scene, ACL1, ACL2, ACL3)                                   ! 640-660
    DT = scene%step_size                                                          ! 680
    M = merge(6, 3, scene%with_velocity)                                          ! 1280

    next_look = steps_between_looks(scene)
    do I = 1, scene%n_steps                                                       ! 700
      if (I >= next_look) then
        next_look = I + steps_between_looks(scene)
        if (interrupt_raised() /= 0) then
          status = INTERRUPTED
          return
        end if
      end if
      begin = real(I - 1, dp)*scene%step_size
      TIME = TIME + DT                                                            ! 710
      T1 = DT*0.2_dp                                                              ! 720
      T2 = DT*0.4_dp                                                              ! 730
      T3 = DT*0.6_dp                                                              ! 740
      T4 = DT*0.8_dp                                                              ! 750
      T5 = scene%step_size                                                        ! 760
      if (scene%torque_varies) then
        if (listing%initial_torque .and. I == 1) then
          M1 = scene%torque_first(1)
          M2 = scene%torque_first(2)
          M3 = scene%torque_first(3)
        else if (listing%torque_held) then
          call normalized_torque(scene, TIME, M1(1), M2(1), M3(1))
          M1(2:5) = M1(1)
          M2(2:5) = M2(1)
          M3(2:5) = M3(1)
        else
          call normalized_torque(scene, begin, M1(1), M2(1), M3(1))
          call normalized_torque(scene, begin + T1, M1(2), M2(2), M3(2))
          call normalized_torque(scene, begin + T2, M1(3), M2(3), M3(3))
          call normalized_torque(scene, begin + T3, M1(4), M2(4), M3(4))
          call normalized_torque(scene, begin + T4, M1(5), M2(5), M3(5))
        end if
      end if

      ! first estimate: constant right-hand sides
      F1 = M1(1) + A1*U2(1)*U3(1)                                                 ! 780
      G1 = M2(1) + B1*U1(1)*U3(1)                                                 ! 790
      H1 = M3(1) + C*U1(1)*U2(1)                                                  ! 800
      if (scene%with_velocity) then
        X1 = ACL1 + V2(1)*U3(1) - V3(1)*U2(1)                                     ! 810
        Y1 = ACL2 + V3(1)*U1(1) - V1(1)*U3(1)                                     ! 820
        Z1 = ACL3 + V1(1)*U2(1) - V2(1)*U1(1)                                     ! 830
      end if
      A(1, 1) = 1.0_dp                                                            ! 850
      A(1, 2) = 2.0_dp*T1                                                         ! 860
      A(1, 3) = 3.0_dp*(T1*T1)                                                    ! 870
      A(1, 4) = 4.0_dp*(T1*T1*T1)                                                 ! 880
      A(2, 1) = 1.0_dp                                                            ! 890
      A(2, 2) = 2.0_dp*T2                                                         ! 900
      A(2, 3) = 3.0_dp*(T2*T2)                                                    ! 910
      A(2, 4) = 4.0_dp*(T2*T2*T2)                                                 ! 920
      A(3, 1) = 1.0_dp                                                            ! 930
      A(3, 2) = 2.0_dp*T3                                                         ! 940
      A(3, 3) = 3.0_dp*(T3*T3)                                                    ! 950
      A(3, 4) = 4.0_dp*(T3*T3*T3)                                                 ! 960
      A(4, 1) = 1.0_dp                                                            ! 970
      A(4, 2) = 2.0_dp*T4                                                         ! 980
      A(4, 3) = 3.0_dp*(T4*T4)                                                    ! 990
      A(4, 4) = 4.0_dp*(T4*T4*T4)                                                 ! 1000
      B(1, 1) = F1                                                                ! 1020
      B(2, 1) = F1                                                                ! 1030
      B(3, 1) = F1                                                                ! 1040
      B(4, 1) = F1                                                                ! 1050
      B(1, 2) = G1                                                                ! 1060
      B(2, 2) = G1                                                                ! 1070
      B(3, 2) = G1                                                                ! 1080
      B(4, 2) = G1                                                                ! 1090
      B(1, 3) = H1                                                                ! 1100
      B(2, 3) = H1                                                                ! 1110
      B(3, 3) = H1                                                                ! 1120
      B(4, 3) = H1                                                                ! 1130
      if (scene%with_velocity) then
        B(1, 4) = X1                                                              ! 1140
        B(2, 4) = X1                                                              ! 1150
        B(3, 4) = X1                                                              ! 1160
        B(4, 4) = X1                                                              ! 1170
        B(1, 5) = Y1                                                              ! 1180
        B(2, 5) = Y1                                                              ! 1190
        B(3, 5) = Y1                                                              ! 1200
        B(4, 5) = Y1                                                              ! 1210
        B(1, 6) = Z1                                                              ! 1220
        B(2, 6) = Z1                                                              ! 1230
        B(3, 6) = Z1                                                              ! 1240
        B(4, 6) = Z1                                                              ! 1250
      end if
      call leqt1f(A, M, 4, B, IER)                                                ! 1320
      T(1) = 0.0_dp
      T(2) = T1                                                                   ! 1350
      T(3) = T2                                                                   ! 1360
      T(4) = T3                                                                   ! 1370
      T(5) = T4                                                                   ! 1380
      do L = 2, 5                                                                 ! 1340
        TL2 = T(L)*T(L)
        TL3 = TL2*T(L)
        TL4 = TL2*TL2
        U1(L) = U1(1) + B(1, 1)*T(L) + B(2, 1)*TL2 + B(3, 1)*TL3 + &              ! 1390
                B(4, 1)*TL4                                                       ! 1400
        U2(L) = U2(1) + B(1, 2)*T(L) + B(2, 2)*TL2 + B(3, 2)*TL3 + &              ! 1410
                B(4, 2)*TL4                                                       ! 1420
        U3(L) = U3(1) + B(1, 3)*T(L) + B(2, 3)*TL2 + B(3, 3)*TL3 + &              ! 1430
                B(4, 3)*TL4                                                       ! 1440
        if (scene%with_velocity) then
          V1(L) = V1(1) + B(1, 4)*T(L) + B(2, 4)*TL2 + B(3, 4)*TL3 + &            ! 1450
                  B(4, 4)*TL4                                                     ! 1460
          V2(L) = V2(1) + B(1, 5)*T(L) + B(2, 5)*TL2 + B(3, 5)*TL3 + &            ! 1470
                  B(4, 5)*TL4                                                     ! 1480
          V3(L) = V3(1) + B(1, 6)*T(L) + B(2, 6)*TL2 + B(3, 6)*TL3 + &            ! 1490
                  B(4, 6)*TL4                                                     ! 1500
        end if
        F(L) = M1(L) + A1*U2(L)*U3(L)                                             ! 1510
        G(L) = M2(L) + B1*U1(L)*U3(L)                                             ! 1520
        H(L) = M3(L) + C*U1(L)*U2(L)                                              ! 1530
        if (scene%with_velocity) then
          X(L) = ACL1 + V2(L)*U3(L) - V3(L)*U2(L)                                 ! 1540
          Y(L) = ACL2 + V3(L)*U1(L) - V1(L)*U3(L)                                 ! 1550
          Z(L) = ACL3 + V1(L)*U2(L) - V2(L)*U1(L)                                 ! 1560
        end if
      end do                                                                      ! 1570

      ! correction: right-hand sides at the collocation points
      A(1, 1) = 1.0_dp                                                            ! 1590
      A(1, 2) = 2.0_dp*T1                                                         ! 1600
      A(1, 3) = 3.0_dp*(T1*T1)                                                    ! 1610
      A(1, 4) = 4.0_dp*(T1*T1*T1)                                                 ! 1620
      A(2, 1) = 1.0_dp                                                            ! 1630
      A(2, 2) = 2.0_dp*T2                                                         ! 1640
      A(2, 3) = 3.0_dp*(T2*T2)                                                    ! 1650
      A(2, 4) = 4.0_dp*(T2*T2*T2)                                                 ! 1660
      A(3, 1) = 1.0_dp                                                            ! 1670
      A(3, 2) = 2.0_dp*T3                                                         ! 1680
      A(3, 3) = 3.0_dp*(T3*T3)                                                    ! 1690
      A(3, 4) = 4.0_dp*(T3*T3*T3)                                                 ! 1700
      A(4, 1) = 1.0_dp                                                            ! 1710
      A(4, 2) = 2.0_dp*T4                                                         ! 1720
      A(4, 3) = 3.0_dp*(T4*T4)                                                    ! 1730
      A(4, 4) = 4.0_dp*(T4*T4*T4)                                                 ! 1740
      B(1, 1) = F(2)                                                              ! 1770
      B(2, 1) = F(3)                                                              ! 1780
      B(3, 1) = F(4)                                                              ! 1790
      B(4, 1) = F(5)                                                              ! 1800
      B(1, 2) = G(2)                                                              ! 1810
      B(2, 2) = G(3)                                                              ! 1820
      B(3, 2) = G(4)                                                              ! 1830
      B(4, 2) = G(5)                                                              ! 1840
      B(1, 3) = H(2)                                                              ! 1850
      B(2, 3) = H(3)                                                              ! 1860
      B(3, 3) = H(4)                                                              ! 1870
      B(4, 3) = H(5)                                                              ! 1880
      if (scene%with_velocity) then
        B(1, 4) = X(2)                                                            ! 1890
        B(2, 4) = X(3)                                                            ! 1900
        B(3, 4) = X(4)                                                            ! 1910
        B(4, 4) = X(5)                                                            ! 1920
        B(1, 5) = Y(2)                                                            ! 1930
        B(2, 5) = Y(3)                                                            ! 1940
        B(3, 5) = Y(4)                                                            ! 1950
        B(4, 5) = Y(5)                                                            ! 1960
        B(1, 6) = Z(2)                                                            ! 1970
        B(2, 6) = Z(3)                                                            ! 1980
        B(3, 6) = Z(4)                                                            ! 1990
        B(4, 6) = Z(5)                                                            ! 2000
      end if
      call leqt1f(A, M, 4, B, IER)                                                ! 2010
      TL2 = T5*T5
      TL3 = TL2*T5
      TL4 = TL2*TL2
      U1(6) = U1(1) + B(1, 1)*T5 + B(2, 1)*TL2 + B(3, 1)*TL3 + &                  ! 2030
              B(4, 1)*TL4                                                         ! 2040
      U2(6) = U2(1) + B(1, 2)*T5 + B(2, 2)*TL2 + B(3, 2)*TL3 + &                  ! 2050
              B(4, 2)*TL4                                                         ! 2060
      U3(6) = U3(1) + B(1, 3)*T5 + B(2, 3)*TL2 + B(3, 3)*TL3 + &                  ! 2070
              B(4, 3)*TL4                                                         ! 2080
      if (scene%with_velocity) then
        V1(6) = V1(1) + B(1, 4)*T5 + B(2, 4)*TL2 + B(3, 4)*TL3 + &                ! 2090
                B(4, 4)*TL4                                                       ! 2100
        V2(6) = V2(1) + B(1, 5)*T5 + B(2, 5)*TL2 + B(3, 5)*TL3 + &                ! 2110
                B(4, 5)*TL4                                                       ! 2120
        V3(6) = V3(1) + B(1, 6)*T5 + B(2, 6)*TL2 + B(3, 6)*TL3 + &                ! 2130
                B(4, 6)*TL4                                                       ! 2140
      end if
      evaluations = evaluations + 5
      if (.not. is_finite(U1(6), U2(6), U3(6))) then
        status = OVERFLOW
        return
      end if

      n_rows = I
      ier_rows(I) = IER                                                           ! 2150
      rows(1, I) = real(I, dp)*scene%step_size
      rows(2, I) = TIME                                                           ! 2180
      rows(3, I) = U1(6)                                                          ! 2180
      rows(4, I) = U2(6)                                                          ! 2180
      rows(5, I) = U3(6)                                                          ! 2180
      if (scene%with_velocity) then
        rows(6, I) = V1(6)                                                        ! 2180
        rows(7, I) = V2(6)                                                        ! 2180
        rows(8, I) = V3(6)                                                        ! 2180
      end if
      U1(1) = U1(6)                                                               ! 2190
      U2(1) = U2(6)                                                               ! 2200
      U3(1) = U3(6)                                                               ! 2210
      if (scene%with_velocity) then
        V1(1) = V1(6)                                                             ! 2220
        V2(1) = V2(6)                                                             ! 2230
        V3(1) = V3(6)                                                             ! 2240
      end if
      if (listing%dt_accumulates) then
        DT = DT + scene%step_size                                                 ! 2250
      end if
    end do                                                                        ! 2260
  end subroutine four_term

end module four_term_program

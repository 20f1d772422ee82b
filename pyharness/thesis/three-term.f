      PROGRAM FEM1(INPUT,OUTPUT,TAPE5,TAPE6)                                 100
      DIMENSION A(3,3),B(3,6),WKA(18),T(8),F(8),G(8),H(8),                   110
     CX(8),Y(8),Z(8)                                                         120
      REAL I1,I2,I3,M1,M2,M3,N1,N2,N3,MS1,MS2,MS3                            130
      REAL LIP                                                               140
      DIMENSION U1(8),U2(8),U3(8),V1(8),V2(8),V3(8)                          150
      TIME=0.                                                                160
C                                                                            170
C COLLOCATION PROGRAM                                                        180
C THREE TERM APPROXIMATION, A CONJECTURE                                     190
C MOMENTS OF INERTIA                                                         200
      I1=40.                                                                 210
      I2=40.                                                                 220
      I3=20.                                                                 230
C                                                                            240
C TORQUES                                                                    250
      N1=0.                                                                  260
      N2=0.                                                                  270
      N3=0.                                                                  280
C                                                                            290
C INITIAL CONDITIONS U                                                       300
      U1(1)=0.                                                               310
      U2(1)=1.                                                               320
      U3(1)=10.                                                              330
      WRITE(6,1)I1,N1,I2,N2,I3,N3                                            340
1     FORMAT(2X,F6.2,5X,F6.2,/,2X,F6.2,5X,F6.2,/,2X,F6.2,5X,F6.2)            350
      WRITE(6,4)                                                             360
4     FORMAT(6X,2HU1,18X,2HU2,18X,2HU3,16X,1HI,16X,2HV1,                     370
     C20X,2HV2,20X,2HV3)                                                     380
C                                                                            390
C NORMALIZED MOMENTS OF INERTIA                                              400
      A1=(I2-I3)/I1                                                          410
      B1=(I3-I1)/I2                                                          420
      C=(I1-I2)/I3                                                           430
C                                                                            440
C NORMALIZED TORQUES                                                         450
      M1=N1/I1                                                               460
      M2=N2/I2                                                               470
      M3=N3/I3                                                               480
C                                                                            490
C INITIAL VELOCITIES                                                         500
      V1(1)=0.                                                               510
      V2(1)=0.                                                               520
      V3(1)=0.                                                               530
C                                                                            540
C MASSES                                                                     550
      MS1=100.                                                               560
      MS2=110.                                                               570
      MS3=120.                                                               580
C                                                                            590
C FORCES                                                                     600
      FRC1=10.                                                               610
      FRC2=20.                                                               620
      FRC3=40.                                                               630
      ACL1=FRC1/MS1                                                          640
      ACL2=FRC2/MS2                                                          650
      ACL3=FRC3/MS3                                                          660
      LIP=500.                                                               670
      DT=.01                                                                 680
C END INITIALIZATION                                                         690
      DO 100 I=1,300,1                                                       700
      TIME=TIME+DT                                                           710
      T1=DT*1./4.                                                            720
      T2=DT*2./4.                                                            730
      T3=DT*3./4.                                                            740
      T4=.01                                                                 750
C RIGHT HAND SIDES                                                           760
      F1=M1+A1*U2(1)*U3(1)                                                   770
      G1=M2+B1*U1(1)*U3(1)                                                   780
      H1=M3+C*U1(1)*U2(1)                                                    790
      X1=ACL1+V2(1)*U3(1)-V3(1)*U2(1)                                        800
      Y1=ACL2+V3(1)*U1(1)-V1(1)*U3(1)                                        810
      Z1=ACL3+V1(1)*U2(1)-V2(1)*U1(1)                                        820
C COEFFICIENT MATRIX A                                                       830
      A(1,1)=1.                                                              840
      A(1,2)=2.*T1                                                           850
      A(1,3)=3.*T1**2                                                        860
      A(2,1)=1.                                                              870
      A(2,2)=2.*T2                                                           880
      A(2,3)=3.*T2**2                                                        890
      A(3,1)=1.                                                              900
      A(3,2)=2.*T3                                                           910
      A(3,3)=3.*T3**2                                                        920
C FORCING FUNCTION MATRICES                                                  930
      B(1,1)=F1                                                              940
      B(2,1)=F1                                                              950
      B(3,1)=F1                                                              960
      B(1,2)=G1                                                              970
      B(2,2)=G1                                                              980
      B(3,2)=G1                                                              990
      B(1,3)=H1                                                             1000
      B(2,3)=H1                                                             1010
      B(3,3)=H1                                                             1020
      B(1,4)=X1                                                             1030
      B(2,4)=X1                                                             1040
      B(3,4)=X1                                                             1050
      B(1,5)=Y1                                                             1060
      B(2,5)=Y1                                                             1070
      B(3,5)=Y1                                                             1080
      B(1,6)=Z1                                                             1090
      B(2,6)=Z1                                                             1100
      B(3,6)=Z1                                                             1110
C MATRIX SUBROUTINE PARAMETERS                                              1120
30    CONTINUE                                                              1130
      M=6                                                                   1140
      N=3                                                                   1150
      IA=3                                                                  1160
      IDGT=5                                                                1170
      CALL LEQT1F(A,M,N,IA,B,IDGT,WKA,IER)                                  1180
C ASSEMBLE U S FOR INTERVAL                                                 1190
      DO 400 L=2,4,1                                                        1200
      T(2)=T1                                                               1210
      T(3)=T2                                                               1220
      T(4)=T3                                                               1230
      U1(L)=U1(1)+B(1,1)*T(L)+B(2,1)*T(L)**2+B(3,1)*T(L)**3                 1240
      U2(L)=U2(1)+B(1,2)*T(L)+B(2,2)*T(L)**2+B(3,2)*T(L)**3                 1250
      U3(L)=U3(1)+B(1,3)*T(L)+B(2,3)*T(L)**2+B(3,3)*T(L)**3                 1260
      V1(L)=V1(1)+B(1,4)*T(L)+B(2,4)*T(L)**2+B(3,4)*T(L)**3                 1270
      V2(L)=V2(1)+B(1,5)*T(L)+B(2,5)*T(L)**2+B(3,5)*T(L)**3                 1280
      V3(L)=V3(1)+B(1,6)*T(L)+B(2,6)*T(L)**2+B(3,6)*T(L)**3                 1290
      F(L)=M1+A1*U2(L)*U3(L)                                                1300
      G(L)=M2+B1*U1(L)*U3(L)                                                1310
      H(L)=M3+C*U1(L)*U2(L)                                                 1320
      X(L)=ACL1+V2(L)*U3(L)-V3(L)*U2(L)                                     1330
      Y(L)=ACL2+V3(L)*U1(L)-V1(L)*U3(L)                                     1340
      Z(L)=ACL3+V1(L)*U2(L)-V2(L)*U1(L)                                     1350
400   CONTINUE                                                              1360
C NOW REDO INTERVAL                                                         1370
      A(1,1)=1.                                                             1380
      A(1,2)=2.*T1                                                          1390
      A(1,3)=3.*T1**2                                                       1400
      A(2,1)=1.                                                             1410
      A(2,2)=2.*T2                                                          1420
      A(2,3)=3.*T2**2                                                       1430
      A(3,1)=1.                                                             1440
      A(3,2)=2.*T3                                                          1450
      A(3,3)=3.*T3**2                                                       1460
C                                                                           1470
C                                                                           1480
      B(1,1)=F(2)                                                           1490
      B(2,1)=F(3)                                                           1500
      B(3,1)=F(4)                                                           1510
      B(1,2)=G(2)                                                           1520
      B(2,2)=G(3)                                                           1530
      B(3,2)=G(4)                                                           1540
      B(1,3)=H(2)                                                           1550
      B(2,3)=H(3)                                                           1560
      B(3,3)=H(4)                                                           1570
      B(1,4)=X(2)                                                           1580
      B(2,4)=X(3)                                                           1590
      B(3,4)=X(4)                                                           1600
      B(1,5)=Y(2)                                                           1610
      B(2,5)=Y(3)                                                           1620
      B(3,5)=Y(4)                                                           1630
      B(1,6)=Z(2)                                                           1640
      B(2,6)=Z(3)                                                           1650
      B(3,6)=Z(4)                                                           1660
      CALL LEQT1F(A,M,N,IA,B,IDGT,WKA,IER)                                  1670
C ASSEMBLE NEW U S FOR INTERVAL                                             1680
      U1(5)=U1(1)+B(1,1)*T4+B(2,1)*T4**2+B(3,1)*T4**3                       1690
      U2(5)=U2(1)+B(1,2)*T4+B(2,2)*T4**2+B(3,2)*T4**3                       1700
      U3(5)=U3(1)+B(1,3)*T4+B(2,3)*T4**2+B(3,3)*T4**3                       1710
      V1(5)=V1(1)+B(1,4)*T4+B(2,4)*T4**2+B(3,4)*T4**3                       1720
      V2(5)=V2(1)+B(1,5)*T4+B(2,5)*T4**2+B(3,5)*T4**3                       1730
      V3(5)=V3(1)+B(1,6)*T4+B(2,6)*T4**2+B(3,6)*T4**3                       1740
      WRITE(6,5)U1(5),U2(5),U3(5),I,IER,V1(5),V2(5),V3(5)                   1750
5     FORMAT(2X,F10.4,10X,F10.4,10X,F10.4,5X,I3,3X,I2,5X,F10.4,             1760
     C10X,F10.4,10X,F10.4)                                                  1770
      WRITE(5)TIME,U1(5),U2(5),U3(5),V1(5),V2(5),V3(5)                      1780
      U1(1)=U1(5)                                                           1790
      U2(1)=U2(5)                                                           1800
      U3(1)=U3(5)                                                           1810
      V1(1)=V1(5)                                                           1820
      V2(1)=V2(5)                                                           1830
      V3(1)=V3(5)                                                           1840
      DT=DT+.01                                                             1850
100   CONTINUE                                                              1860
      END                                                                   1870

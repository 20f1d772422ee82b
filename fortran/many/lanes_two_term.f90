module lanes_two_term
  !! A step of two_term.fypp in every lane; the margin names its cards. The matrix depends on DT
  !! alone: it is factored only when DT changes, and only once if all lanes have one step size.
  use blocks, only: LANE_COUNT
  use kinds, only: dp
  use ensemble, only: ensemble_t
  use lanes, only: block_t, torque_within
  use linear_solver_binary64, only: factor
  implicit none(type, external)
  private

  type, public :: points_t
    real(dp), dimension(LANE_COUNT) :: T1, T2, T3, T12, T22, T32
    ! Factors of A below, above and on the diagonal. A(1, 1) is 1 and always the first pivot: T1 is
    ! no later than T2, so the scale of row 1 is no smaller.
    real(dp), dimension(LANE_COUNT) :: low, high, diagonal
    real(dp) :: singular(LANE_COUNT)              !! 1: the matrix is singular, B is unchanged
    real(dp), dimension(LANE_COUNT, 3) :: before  !! U(1), at the interval's beginning, rad/s
    real(dp), dimension(LANE_COUNT, 3) :: Ua, Ub  !! U(2) and U(3), at T1 and T2, rad/s
  end type points_t

  public :: set_points, step_two_term, torque_two_term

contains

  subroutine set_points(b, s)
    !! Compute everything that depends on DT alone.
    type(block_t), intent(inout) :: b
    type(points_t), intent(inout) :: s
    real(dp) :: A(2, 2)
    integer :: pivot(2)
    integer :: i

    do i = 1, LANE_COUNT
      s%T1(i) = b%DT(i)/3.0_dp                                                    ! 710
      s%T2(i) = 2.0_dp*b%DT(i)/3.0_dp                                             ! 720
      s%T3(i) = b%step(i)                                                         ! 730
      s%T12(i) = s%T1(i)*s%T1(i)
      s%T22(i) = s%T2(i)*s%T2(i)
      s%T32(i) = s%T3(i)*s%T3(i)
    end do
    do i = 1, LANE_COUNT
      A(1, 1) = 1.0_dp                                                            ! 820
      A(1, 2) = 2.0_dp*s%T1(i)                                                    ! 830
      A(2, 1) = 1.0_dp                                                            ! 840
      A(2, 2) = 2.0_dp*s%T2(i)                                                    ! 850
      call factor(A, 2, pivot, b%ier(i))
      s%low(i) = A(2, 1)
      s%high(i) = A(1, 2)
      s%diagonal(i) = A(2, 2)
      if (b%one_step_size) exit
    end do
    if (b%one_step_size) then
      b%ier = b%ier(1)
      s%low = s%low(1)
      s%high = s%high(1)
      s%diagonal = s%diagonal(1)
    end if
    s%singular = merge(0.0_dp, 1.0_dp, b%ier == 0)
    where (b%ier /= 0) s%diagonal = 1.0_dp
  end subroutine set_points

  subroutine torque_two_term(e, I, b, s)
    !! Compute the torque at the beginning and at T1 and T2.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: I
    type(block_t), intent(inout) :: b
    type(points_t), intent(in) :: s
    real(dp) :: after(LANE_COUNT, 3)

    after(:, 1) = 0.0_dp
    after(:, 2) = s%T1
    after(:, 3) = s%T2
    call torque_within(e, I, b, after, [1, 2, 3])
  end subroutine torque_two_term

  subroutine step_two_term(e, b, s)
    type(ensemble_t), intent(in) :: e
    type(block_t), intent(inout) :: b
    type(points_t), intent(inout) :: s
    real(dp), parameter :: zero(LANE_COUNT) = 0.0_dp

    if (e%listing%c1_for_c) then
      call turn(b, zero, s)
    else
      call turn(b, b%C, s)
    end if
    if (e%scene%with_velocity) call move(e%listing%x3_reads_acl2, b, s)
  end subroutine step_two_term

  pure subroutine solve(p, q, low, high, diagonal, singular, x, y)
    !! Substitute as LEQT1F does in the two equations of one variable. A(1, 1) is 1, so no division
    !! by it is needed.
    real(dp), intent(in) :: p, q
    real(dp), intent(in) :: low, high, diagonal, singular
    real(dp), intent(out) :: x, y

    y = (q - low*p)/diagonal
    x = p - high*y
    x = merge(x, p, singular < 0.5_dp)
    y = merge(y, q, singular < 0.5_dp)
  end subroutine solve

  pure subroutine turn(b, C1, s)
    !! Advance the angular velocity, which does not depend on the velocity.
    type(block_t), intent(inout) :: b
    real(dp), intent(in) :: C1(LANE_COUNT)  !! C in the first estimate: b%C, or 0 as no card sets C1
    type(points_t), intent(inout) :: s
    real(dp) :: u1, u2, u3, a1, a2, a3, b1, b2, b3, F, G, H, F3, G3, H3
    real(dp) :: x1, x2, x3, y1, y2, y3
    integer :: i

    do i = 1, LANE_COUNT
      u1 = b%U(i, 1)
      u2 = b%U(i, 2)
      u3 = b%U(i, 3)
      ! first estimate: the right-hand sides are constant
      F = b%M(i, 1, 1) + b%A(i)*u2*u3                                             ! 750
      G = b%M(i, 2, 1) + b%B(i)*u1*u3                                             ! 760
      H = b%M(i, 3, 1) + C1(i)*u1*u2                                                  ! 770
      call solve(F, F, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x1, y1) ! 1050
      call solve(G, G, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x2, y2)
      call solve(H, H, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x3, y3)
      a1 = u1 + x1*s%T1(i) + y1*s%T12(i)                                          ! 1070
      b1 = u1 + x1*s%T2(i) + y1*s%T22(i)                                          ! 1080
      a2 = u2 + x2*s%T1(i) + y2*s%T12(i)                                          ! 1090
      b2 = u2 + x2*s%T2(i) + y2*s%T22(i)                                          ! 1100
      a3 = u3 + x3*s%T1(i) + y3*s%T12(i)                                          ! 1110
      b3 = u3 + x3*s%T2(i) + y3*s%T22(i)                                          ! 1120
      s%Ua(i, 1) = a1
      s%Ua(i, 2) = a2
      s%Ua(i, 3) = a3
      s%Ub(i, 1) = b1
      s%Ub(i, 2) = b2
      s%Ub(i, 3) = b3
      ! correction: the right-hand sides are those at the collocation points
      F = b%M(i, 1, 2) + b%A(i)*a2*a3                                             ! 1190
      F3 = b%M(i, 1, 3) + b%A(i)*b2*b3                                            ! 1200
      G = b%M(i, 2, 2) + b%B(i)*a1*a3                                             ! 1210
      G3 = b%M(i, 2, 3) + b%B(i)*b1*b3                                            ! 1220
      H = b%M(i, 3, 2) + b%C(i)*a1*a2                                             ! 1230
      H3 = b%M(i, 3, 3) + b%C(i)*b1*b2                                            ! 1240
      call solve(F, F3, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x1, y1) ! 1480
      call solve(G, G3, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x2, y2)
      call solve(H, H3, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x3, y3)
      s%before(i, 1) = u1
      s%before(i, 2) = u2
      s%before(i, 3) = u3
      b%U(i, 1) = u1 + x1*s%T3(i) + y1*s%T32(i)                                     ! 1500
      b%U(i, 2) = u2 + x2*s%T3(i) + y2*s%T32(i)                                     ! 1510
      b%U(i, 3) = u3 + x3*s%T3(i) + y3*s%T32(i)                                     ! 1520
    end do
  end subroutine turn

  pure subroutine move(x3_reads_acl2, b, s)
    !! Advance the velocity, with the angular velocities at the beginning and at the points.
    logical, intent(in) :: x3_reads_acl2
    type(block_t), intent(inout) :: b
    type(points_t), intent(in) :: s
    real(dp) :: v1, v2, v3, a1, a2, a3, b1, b2, b3, X, Y, Z, of_x3, Xb, Yb, Zb
    real(dp) :: x1, x2, x3, y1, y2, y3
    integer :: i

    of_x3 = merge(b%ACL2, b%ACL1, x3_reads_acl2)
    do i = 1, LANE_COUNT
      v1 = b%V(i, 1)
      v2 = b%V(i, 2)
      v3 = b%V(i, 3)
      X = b%ACL1 + v2*s%before(i, 3) - v3*s%before(i, 2)                          ! 780
      Y = b%ACL2 + v3*s%before(i, 1) - v1*s%before(i, 3)                          ! 790
      Z = b%ACL3 + v1*s%before(i, 2) - v2*s%before(i, 1)                          ! 800
      call solve(X, X, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x1, y1) ! 1050
      call solve(Y, Y, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x2, y2)
      call solve(Z, Z, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x3, y3)
      a1 = v1 + x1*s%T1(i) + y1*s%T12(i)                                          ! 1130
      b1 = v1 + x1*s%T2(i) + y1*s%T22(i)                                          ! 1140
      a2 = v2 + x2*s%T1(i) + y2*s%T12(i)                                          ! 1150
      b2 = v2 + x2*s%T2(i) + y2*s%T22(i)                                          ! 1160
      a3 = v3 + x3*s%T1(i) + y3*s%T12(i)                                          ! 1170
      b3 = v3 + x3*s%T2(i) + y3*s%T22(i)                                          ! 1180
      X = b%ACL1 + a2*s%Ua(i, 3) - a3*s%Ua(i, 2)                                  ! 1250
      Xb = of_x3 + b2*s%Ub(i, 3) - b3*s%Ub(i, 2)                                  ! 1260
      Y = b%ACL2 + a3*s%Ua(i, 1) - a1*s%Ua(i, 3)                                  ! 1270
      Yb = b%ACL2 + b3*s%Ub(i, 1) - b1*s%Ub(i, 3)                                 ! 1280
      Z = b%ACL3 + a1*s%Ua(i, 2) - a2*s%Ua(i, 1)                                  ! 1290
      Zb = b%ACL3 + b1*s%Ub(i, 2) - b2*s%Ub(i, 1)                                 ! 1300
      call solve(X, Xb, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x1, y1) ! 1480
      call solve(Y, Yb, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x2, y2)
      call solve(Z, Zb, s%low(i), s%high(i), s%diagonal(i), s%singular(i), x3, y3)
      b%V(i, 1) = v1 + x1*s%T3(i) + y1*s%T32(i)                                     ! 1530
      b%V(i, 2) = v2 + x2*s%T3(i) + y2*s%T32(i)                                     ! 1540
      b%V(i, 3) = v3 + x3*s%T3(i) + y3*s%T32(i)                                     ! 1550
    end do
  end subroutine move

end module lanes_two_term

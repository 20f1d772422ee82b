module deck
  !! What the three decks share: the data cards, equations 13-15 normalised, Case 7's torque.
  !! Two-term cards 200-320, 390-420, 440-470, 500-660; the other decks say the same.
  use kinds, only: dp
  implicit none(type, external)
  private

  type, public :: deck_t
    logical :: by_moments             !! body holds I1, I2, I3; else A, B, C
    real(dp) :: body(3)               !! kg m2; or without unit
    real(dp) :: omega(3)              !! U at time 0, rad/s
    real(dp) :: masses(3)             !! MS1, MS2, MS3, kg
    real(dp) :: forces(3)             !! FRC1, FRC2, FRC3, N
    real(dp) :: torque_constant(3)    !! N m
    real(dp) :: torque_rate(3)        !! N m/s
    real(dp) :: torque_first(3)       !! over moment, 1/s2: of the first step, where assumed
    logical :: torque_varies
    real(dp), pointer :: sines(:, :)    !! columns: amplitude (3), frequency in rad/s
    real(dp), pointer :: cosines(:, :)  !! the same
    real(dp) :: step_size             !! the literal .01, s
    integer :: n_steps
    real(dp) :: lipschitz             !! LIP, 1/s
    logical :: may_stop
    logical :: with_velocity          !! else the translational block is not computed
  end type deck_t

  type, public :: stop_t
    integer :: variable               !! 1-3: U1-U3; 4-6: V1-V3; 7: norm of U; 8: norm of U and V
    real(dp) :: quotient              !! change of K over change of U, 1/s
  end type stop_t

  ! Looks at the user (Ctrl-C): so many steps apart, where no wave makes them longer.
  real(dp), parameter :: STEPS_BETWEEN = 5e4_dp

  public :: euler_coefficients, normalized_torque, accelerations, is_finite, steps_between_looks

contains

  pure subroutine euler_coefficients(scene, A1, B1, C)
    !! A, B, C of equations 13-15. Two-term 400-420, four-term 410-430, Runge-Kutta 360-380.
    type(deck_t), intent(in) :: scene
    real(dp), intent(out) :: A1
    real(dp), intent(out) :: B1
    real(dp), intent(out) :: C

    if (scene%by_moments) then
      associate (I1 => scene%body(1), I2 => scene%body(2), I3 => scene%body(3))
        A1 = (I2 - I3)/I1 ! 400
        B1 = (I3 - I1)/I2 ! 410
        C = (I1 - I2)/I3  ! 420
      end associate
    else
      A1 = scene%body(1)
      B1 = scene%body(2)
      C = scene%body(3)
    end if
  end subroutine euler_coefficients

  pure subroutine normalized_torque(scene, time, M1, M2, M3)
    !! N(time) over the moments. Two-term 450-470, four-term 460-480, Runge-Kutta 410-430.
    type(deck_t), intent(in) :: scene
    real(dp), intent(in) :: time
    real(dp), intent(out) :: M1
    real(dp), intent(out) :: M2
    real(dp), intent(out) :: M3
    real(dp) :: N(3)
    integer :: axis
    integer :: term

    do axis = 1, 3
      N(axis) = scene%torque_constant(axis)
      if (scene%torque_varies) then
        N(axis) = N(axis) + scene%torque_rate(axis)*time
        do term = 1, size(scene%sines, 2)
          N(axis) = N(axis) + scene%sines(axis, term)*sin(scene%sines(4, term)*time)
        end do
        do term = 1, size(scene%cosines, 2)
          N(axis) = N(axis) + scene%cosines(axis, term)*cos(scene%cosines(4, term)*time)
        end do
      end if
    end do
    if (scene%by_moments) then
      M1 = N(1)/scene%body(1) ! 450
      M2 = N(2)/scene%body(2) ! 460
      M3 = N(3)/scene%body(3) ! 470
    else
      M1 = N(1)
      M2 = N(2)
      M3 = N(3)
    end if
  end subroutine normalized_torque

  pure subroutine accelerations(scene, ACL1, ACL2, ACL3)
    !! Force over mass. Two-term 630-650, four-term 640-660, Runge-Kutta 590-610.
    type(deck_t), intent(in) :: scene
    real(dp), intent(out) :: ACL1
    real(dp), intent(out) :: ACL2
    real(dp), intent(out) :: ACL3

    ACL1 = scene%forces(1)/scene%masses(1) ! 630
    ACL2 = scene%forces(2)/scene%masses(2) ! 640
    ACL3 = scene%forces(3)/scene%masses(3) ! 650
  end subroutine accelerations

  pure integer function steps_between_looks(scene)
    !! Steps that take some hundredths of a second.
    type(deck_t), intent(in) :: scene

    steps_between_looks = 1 + int(STEPS_BETWEEN/(1.0_dp + size(scene%sines) + size(scene%cosines)))
  end function steps_between_looks

  pure logical function is_finite(x, y, z)
    !! No NaN and no infinity. Not ieee_is_finite: that module ties the binary to libgfortran.
    real(dp), intent(in) :: x
    real(dp), intent(in) :: y
    real(dp), intent(in) :: z

    is_finite = abs(x) <= huge(x) .and. abs(y) <= huge(y) .and. abs(z) <= huge(z)
  end function is_finite

end module deck

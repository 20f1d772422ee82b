module problem
  !! The equations that the modern methods solve, divided by the moments (equations 16-18):
  !! omega' = M(t) + (A w2 w3, B w1 w3, C w1 w2), M(t) = constant + rate t + sines + cosines.
  !! A wave is one of the sines or cosines.
  use kinds, only: dp
  implicit none(type, external)
  private

  type, public :: problem_t
    real(dp) :: coefficients(3)                    !! A, B, C, without unit
    real(dp) :: constant(3)                        !! torque over moment, 1/s2
    real(dp) :: rate(3)                            !! torque over moment, 1/s3
    integer :: n_sines
    integer :: n_cosines
    ! Associated only if there is a wave.
    real(dp), pointer, contiguous :: sines(:, :)   !! amplitude (3) in 1/s2, frequency in rad/s
    real(dp), pointer, contiguous :: cosines(:, :) !! as sines
  end type problem_t

end module problem

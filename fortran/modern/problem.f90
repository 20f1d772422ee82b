module problem
  !! What a modern method solves, divided by the moments:
  !! omega' = M(t) + (A w2 w3, B w1 w3, C w1 w2), M(t) = constant + rate t + sines + cosines.
  use kinds, only: dp
  implicit none(type, external)
  private

  type, public :: problem_t
    real(dp) :: coefficients(3)                    !! A, B, C
    real(dp) :: constant(3)                        !! 1/s2
    real(dp) :: rate(3)                            !! 1/s3
    integer :: n_sines
    integer :: n_cosines
    ! Pointing somewhere only where there is a wave.
    real(dp), pointer, contiguous :: sines(:, :)   !! amplitude (3) in 1/s2, frequency in rad/s
    real(dp), pointer, contiguous :: cosines(:, :) !! the same
  end type problem_t

end module problem

module lanes
  !! Bodies side by side, each in a lane of its own: code that the three programs have in common.
  !! Every lane does the operations of deck.fypp in their order, so its results are bit-for-bit
  !! identical to those of a single run.
  use, intrinsic :: iso_fortran_env, only: int64
  use blocks, only: LANE_COUNT
  use kinds, only: dp
  use deck_binary64, only: accelerations, deck_t, euler_coefficients
  use ensemble, only: ensemble_t
  implicit none(type, external)
  private

  integer, parameter, public :: POINTS = 5 !! largest number of points in a step

  ! Verdict of a step on a lane: a bit mask.
  integer(int64), parameter, public :: GOES_ON = 0_int64
  integer(int64), parameter, public :: OVERFLOWS = 1_int64
  integer(int64), parameter, public :: EXCEEDS = 2_int64  !! beyond its Lipschitz constant
  integer(int64), parameter, public :: EVERY_BIT = -1_int64

  type, public :: block_t
    ! Members that are read lane by lane come first and fill whole cache lines.
    real(dp), dimension(LANE_COUNT, 3) :: U        !! when a step begins, then its result, rad/s
    real(dp), dimension(LANE_COUNT, 3) :: V        !! likewise, m/s
    real(dp), dimension(LANE_COUNT) :: A, B, C     !! coefficients of equations 13-15
    real(dp), dimension(LANE_COUNT) :: step, DT, TIME
    real(dp), dimension(LANE_COUNT) :: lipschitz
    real(dp), dimension(LANE_COUNT, 3) :: body, torque_constant, torque_first
    real(dp) :: M(LANE_COUNT, 3, POINTS)  !! torque over moment, rad/s2
    integer(int64) :: alive(LANE_COUNT)   !! EVERY_BIT until the run ends, then 0
    integer :: ier(LANE_COUNT)
    real(dp) :: ACL1, ACL2, ACL3          !! force over mass, m/s2
    integer :: first                      !! body in the first lane
    integer :: used                       !! lanes with a body; the others repeat the first body
    logical :: one_step_size              !! whether all lanes have one step size
    integer :: rest(7)                    !! padding to the end of a cache line
  end type block_t

  public :: begin_block, look, torque_within

contains

  subroutine begin_block(e, first, b)
    !! Execute the cards before the loop over steps.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: first
    type(block_t), intent(out) :: b
    type(deck_t) :: scene
    integer :: i
    integer :: of_body

    b%first = first
    b%used = min(LANE_COUNT, e%n - first + 1)
    scene = e%scene
    do i = 1, LANE_COUNT
      of_body = first + merge(i - 1, 0, i <= b%used)
      b%alive(i) = merge(EVERY_BIT, 0_int64, i <= b%used)
      scene%body = e%body(:, of_body)
      call euler_coefficients(scene, b%A(i), b%B(i), b%C(i))
      b%body(i, :) = scene%body
      b%U(i, :) = e%omega(:, of_body)
      b%torque_constant(i, :) = e%torque_constant(:, of_body)
      b%torque_first(i, :) = e%torque_first(:, of_body)
      b%step(i) = e%step_size(of_body)
      b%lipschitz(i) = e%lipschitz(of_body)
    end do
    b%one_step_size = all(b%step == b%step(1))
    b%V = 0.0_dp
    b%DT = b%step
    b%TIME = 0.0_dp
    b%ier = 0
    call accelerations(scene, e%listing, b%ACL1, b%ACL2, b%ACL3)
    if (.not. scene%torque_varies) then
      call set_torque(scene, b, b%TIME, 1)
      call spread_torque(b)
    end if
  end subroutine begin_block

  subroutine torque_within(e, step, b, after, points)
    !! Compute a varying torque for one step. There is no card for this; the listing's conjectures
    !! say at which times.
    type(ensemble_t), intent(in) :: e
    integer, intent(in) :: step
    type(block_t), intent(inout) :: b
    real(dp), intent(in) :: after(:, :)  !! time since the step's beginning, by lane and point, s
    integer, intent(in) :: points(:)
    real(dp) :: time(LANE_COUNT)
    integer :: k

    if (e%listing%initial_torque .and. step == 1) then
      b%M(:, :, 1) = b%torque_first
      call spread_torque(b)
    else if (e%listing%torque_held) then
      call set_torque(e%scene, b, b%TIME, 1)
      call spread_torque(b)
    else
      do k = 1, size(points)
        time = real(step - 1, dp)*b%step + after(:, k)
        call set_torque(e%scene, b, time, points(k))
      end do
    end if
  end subroutine torque_within

  subroutine spread_torque(b)
    !! Copy the torque of the first point to all points.
    type(block_t), intent(inout) :: b
    integer :: point

    do point = 2, POINTS
      b%M(:, :, point) = b%M(:, :, 1)
    end do
  end subroutine spread_torque

  subroutine set_torque(scene, b, time, point)
    !! Compute N(time) over the moments at one point, as normalized_torque of deck.fypp does.
    type(deck_t), intent(in) :: scene
    type(block_t), intent(inout) :: b
    real(dp), intent(in) :: time(LANE_COUNT)
    integer, intent(in) :: point
    real(dp) :: wave(LANE_COUNT)
    integer :: axis
    integer :: i
    integer :: last  ! last lane with a time of its own
    integer :: term

    associate (N => b%M(:, :, point))
      N = b%torque_constant
      if (scene%torque_varies) then
        do axis = 1, 3
          do i = 1, LANE_COUNT
            N(i, axis) = N(i, axis) + scene%torque_rate(axis)*time(i)
          end do
        end do
        last = merge(1, LANE_COUNT, b%one_step_size)
        do term = 1, size(scene%sines, 2)
          do i = 1, last
            wave(i) = sin(scene%sines(4, term)*time(i))
          end do
          wave(last + 1:) = wave(1)
          call add(scene%sines(1:3, term), wave, N)
        end do
        do term = 1, size(scene%cosines, 2)
          do i = 1, last
            wave(i) = cos(scene%cosines(4, term)*time(i))
          end do
          wave(last + 1:) = wave(1)
          call add(scene%cosines(1:3, term), wave, N)
        end do
      end if
      if (scene%by_moments) then
        do axis = 1, 3
          do i = 1, LANE_COUNT
            N(i, axis) = N(i, axis)/b%body(i, axis)
          end do
        end do
      end if
    end associate
  end subroutine set_torque

  pure subroutine add(amplitude, wave, N)
    real(dp), intent(in) :: amplitude(3)
    real(dp), intent(in) :: wave(LANE_COUNT)
    real(dp), intent(inout) :: N(LANE_COUNT, 3)
    integer :: axis
    integer :: i

    do axis = 1, 3
      do i = 1, LANE_COUNT
        N(i, axis) = N(i, axis) + amplitude(axis)*wave(i)
      end do
    end do
  end subroutine add

  pure subroutine look(b, verdict, found)
    !! Find the lanes that overflow, by the criterion of is_finite of deck.fypp.
    type(block_t), intent(in) :: b
    integer(int64), intent(out) :: verdict(LANE_COUNT) !! for lanes that are alive
    integer(int64), intent(out) :: found               !! union of all verdicts
    integer(int64) :: here
    integer :: i

    found = GOES_ON
    do i = 1, LANE_COUNT
      here = ior(ior(merge(GOES_ON, OVERFLOWS, abs(b%U(i, 1)) <= huge(1.0_dp)), &
                     merge(GOES_ON, OVERFLOWS, abs(b%U(i, 2)) <= huge(1.0_dp))), &
                 merge(GOES_ON, OVERFLOWS, abs(b%U(i, 3)) <= huge(1.0_dp)))
      verdict(i) = iand(here, b%alive(i))
      found = ior(found, verdict(i))
    end do
  end subroutine look

end module lanes

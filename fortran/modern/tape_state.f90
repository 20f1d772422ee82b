module tape_state
  !! The unknowns at the beginning of a step, and the sizes to which their errors are relative.
  use kinds, only: dp
  use problem, only: request_t, solution_t
  use tape, only: FIRST_UNKNOWN, tape_t, TIME_SLOT
  use tape_series, only: series_t
  implicit none(type, external)
  private

  ! Products of smaller omegas underflow, rad/s.
  real(dp), parameter, public :: LEAST_SCALE = 2.0_dp**(-500)
  ! Least size of an own state, which is part of a product with the local tolerance.
  real(dp), parameter, public :: LEAST_OWN = 2.0_dp**(-800)
  ! Largest of the last terms of an own state, relative to its guessed size.
  real(dp), parameter :: CONVERGED = 0.01_dp
  integer, parameter :: PARTS = 4 ! of a step, at whose ends the size of an own state is guessed
  ! Largest guess of the scale, over the omega that the step reaches.
  real(dp), parameter :: MOST_OF_REACHED = 2.0_dp

  type, public :: state_t
    integer :: n                   ! number of unknowns
    integer :: first_own           ! number of the first state of the user's own
    logical :: has_attitude
    real(dp) :: t(2)               ! time and its rounding error, s
    real(dp), pointer, contiguous :: y(:)         ! unknowns
    real(dp), pointer, contiguous :: y_low(:)     ! their rounding errors
    real(dp) :: scale              ! largest omega, rad/s
    real(dp) :: most_guessed       ! largest guess of the scale, rad/s
    real(dp), pointer, contiguous :: own_sizes(:) ! of own states: the largest so far
    real(dp), pointer, contiguous :: weights(:)   ! which make the unknowns comparable
    logical :: is_reaching         ! whether the scale is guessed from all terms
    logical :: is_guessed          ! whether the size of an own state is guessed
    logical :: diverges            ! whether the known terms of a guess do
  end type state_t

  public :: begin_state, bound_guess, keep_guesses, keep_sizes, reach, rotate, set_first_terms, &
            weigh

contains

  subroutine begin_state(tape, request, attitude, solution, memory, x)
    !! Set the unknowns at time 0.
    type(tape_t), intent(in) :: tape
    type(request_t), intent(in) :: request
    real(dp), intent(in) :: attitude(4)
    type(solution_t), intent(in) :: solution !! whose own states have values at time 0
    real(dp), intent(inout), target, contiguous :: memory(:, :) !! (unknowns, 4)
    type(state_t), intent(out) :: x

    x%n = tape%n_unknowns
    x%first_own = x%n + 1
    if (associated(solution%own)) x%first_own = x%n + 2 - size(solution%own, 1)
    x%has_attitude = tape%has_attitude
    x%t = 0.0_dp
    memory = 0.0_dp
    x%y => memory(:, 1)
    x%y_low => memory(:, 2)
    x%own_sizes => memory(:, 3)
    x%weights => memory(:, 4)
    x%y(:3) = request%omega
    x%y(4:x%first_own - 1) = attitude(:x%first_own - 4)
    x%scale = maxval(abs(request%omega))
    x%most_guessed = huge(x%scale)
    if (x%first_own > x%n) return
    associate (own => x%y(x%first_own:))
      own = solution%own(:size(own), 0)
      x%own_sizes(x%first_own:) = max(abs(own), solution%own_sizes(:size(own)))
    end associate
  end subroutine begin_state

  subroutine set_first_terms(x, s)
    !! Set the terms that the expansion begins with.
    type(state_t), intent(in) :: x
    type(series_t), intent(inout) :: s
    integer :: i

    s%a(0, TIME_SLOT) = x%t(1)
    s%a(1, TIME_SLOT) = s%h
    do i = 1, x%n
      s%a(0, FIRST_UNKNOWN - 1 + i) = x%y(i)
    end do
  end subroutine set_first_terms

  subroutine reach(from_rest, to_stop, s, x)
    !! Set the scale of a body at rest: the omega that it is about to reach.
    logical, intent(in) :: from_rest
    real(dp), intent(in) :: to_stop !! time to the next breakpoint, s
    type(series_t), intent(in) :: s
    type(state_t), intent(inout) :: x
    integer :: i

    if (from_rest) then
      x%scale = max(maxval(abs(x%y(:3))), &
                    min(x%most_guessed, largest_terms(s, to_stop, 1, 3, 1, 4)))
    end if
    x%is_reaching = .not. x%scale >= LEAST_SCALE
    if (.not. x%is_reaching) return
    do i = 1, 3
      x%scale = max(x%scale, reached_size(s, to_stop, i))
    end do
  end subroutine reach

  subroutine bound_guess(step, is_early, s, x, is_bounded)
    !! Bound the guessed scale by the omega that a step reaches, because the guess's terms may
    !! cancel, or be those of a longer step.
    real(dp), intent(in) :: step     !! s
    logical, intent(in) :: is_early  !! whether a switch ends it
    type(series_t), intent(in) :: s
    type(state_t), intent(inout) :: x
    logical, intent(out) :: is_bounded !! whether the guess was much larger
    real(dp) :: guess, reached
    integer :: i

    reached = 0.0_dp
    do i = 1, 3
      reached = max(reached, reached_size(s, step, i))
    end do
    guess = x%scale
    if (.not. is_early) guess = min(guess, largest_terms(s, step, 1, 3, 1, 4))
    is_bounded = reached >= LEAST_SCALE .and. guess > MOST_OF_REACHED*reached
    if (is_bounded) x%most_guessed = reached
  end subroutine bound_guess

  subroutine weigh(t_end, to_stop, s, x, least)
    !! Make errors of omega relative to the scale, errors of the quaternion angles, and errors of
    !! own states relative to their sizes, or to the sizes that they are about to reach.
    real(dp), intent(in) :: t_end
    real(dp), intent(in) :: to_stop !! time to the next breakpoint, s
    type(series_t), intent(in) :: s
    type(state_t), intent(inout) :: x
    real(dp), intent(in), optional :: least(:) !! sizes that are not rounding errors
    real(dp) :: own_size
    integer :: i

    x%weights(:3) = 1.0_dp/max(x%scale, LEAST_SCALE)
    ! Of a body that stays at rest, an omega counts that turns it by a radian.
    if (.not. x%scale >= LEAST_SCALE) x%weights(:3) = abs(t_end)
    x%weights(4:x%first_own - 1) = 2.0_dp
    x%is_guessed = .false.
    x%diverges = x%is_reaching
    if (x%diverges) x%diverges = has_large_terms(s, to_stop, 1, 3, x%scale)
    do i = x%first_own, x%n
      own_size = x%own_sizes(i)
      if (.not. own_size > 0.0_dp) then
        own_size = reached_size(s, to_stop, i)
        x%is_guessed = x%is_guessed .or. own_size > 0.0_dp
        x%diverges = x%diverges .or. has_large_terms(s, to_stop, i, i, own_size)
      end if
      if (present(least) .and. own_size > 0.0_dp) own_size = max(own_size, least(i))
      x%weights(i) = 0.0_dp
      if (own_size > 0.0_dp) x%weights(i) = 1.0_dp/max(own_size, LEAST_OWN)
    end do
  end subroutine weigh

  subroutine keep_guesses(x)
    !! Set the unknown sizes of own states to their guesses.
    type(state_t), intent(inout) :: x
    integer :: i

    do i = x%first_own, x%n
      if (x%weights(i) > 0.0_dp) x%own_sizes(i) = max(x%own_sizes(i), 1.0_dp/x%weights(i))
    end do
  end subroutine keep_guesses

  subroutine keep_sizes(sizes, from_rest, x)
    !! Set the scale from rest, and the unknown sizes of own states.
    real(dp), intent(in) :: sizes(:) !! of all unknowns
    logical, intent(in) :: from_rest
    type(state_t), intent(inout) :: x
    integer :: i

    if (from_rest) x%scale = maxval(sizes(:3))
    do i = x%first_own, x%n
      if (.not. x%own_sizes(i) > 0.0_dp) x%own_sizes(i) = sizes(i)
    end do
  end subroutine keep_sizes

  pure real(dp) function largest_terms(s, to_stop, first, last, first_term, last_term)
    !! Return the largest of some terms of unknowns for a step that ends at the next breakpoint.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: to_stop
    integer, intent(in) :: first, last, first_term, last_term
    real(dp) :: part
    integer :: k

    part = min(1.0_dp, abs(to_stop/s%h))
    largest_terms = 0.0_dp
    do k = first_term, last_term
      largest_terms = max(largest_terms, part**k*maxval(abs(s%a(k, FIRST_UNKNOWN - 1 + first: &
                                                                FIRST_UNKNOWN - 1 + last))))
    end do
    largest_terms = min(huge(s%h), largest_terms)
  end function largest_terms

  pure logical function has_large_terms(s, to_stop, first, last, total)
    !! Return whether the last terms of unknowns are not much smaller than their guessed size.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: to_stop
    integer, intent(in) :: first, last
    real(dp), intent(in) :: total

    has_large_terms = largest_terms(s, to_stop, first, last, 1, s%order - 2) > 0.0_dp .and. &
                      largest_terms(s, to_stop, first, last, s%order - 1, s%order) > CONVERGED*total
  end function has_large_terms

  pure real(dp) function reached_size(s, to_stop, number)
    !! Return the largest value of an unknown that begins at 0, in a step that ends at the next
    !! breakpoint. Its terms may be much larger, and cancel.
    type(series_t), intent(in) :: s
    real(dp), intent(in) :: to_stop
    integer, intent(in) :: number
    real(dp) :: part, total
    integer :: i, k

    reached_size = 0.0_dp
    do i = 1, PARTS
      part = i*min(1.0_dp, abs(to_stop/s%h))/PARTS
      total = 0.0_dp
      do k = s%order, 1, -1
        total = part*(total + s%a(k, FIRST_UNKNOWN - 1 + number))
      end do
      reached_size = max(reached_size, abs(total))
    end do
    reached_size = min(huge(s%h), reached_size)
  end function reached_size

  elemental subroutine rotate(w, x, y, z, a, b, c, d)
    !! Multiply the quaternion (a, b, c, d) by (w, x, y, z), from the left.
    real(dp), intent(in) :: w, x, y, z
    real(dp), intent(inout) :: a, b, c, d
    real(dp) :: p, q, r

    p = a
    q = b
    r = c
    a = w*p - x*q - y*r - z*d
    b = w*q + x*p + y*d - z*r
    c = w*r - x*d + y*p + z*q
    d = w*d + x*r - y*q + z*p
  end subroutine rotate

end module tape_state

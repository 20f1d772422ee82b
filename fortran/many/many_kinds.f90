module many_kinds
  !! The choice of the kernel that solves each of many bodies. Only the numbers of a body decide it,
  !! so that no result depends on the other bodies of a call.
  use bodies, only: acts, bodies_t, coefficients_of, FREE, has_torque, i1, MOST_WAVES, &
                    NEEDS_FALLBACK, of_body, RAMPED, STEPPED, WAVED, with_attitude
  use kinds, only: dp
  use methods, only: CLOSED_FORM, CLOSED_FORM_OR_TAYLOR, FIXED, SPHERE, TAYLOR
  implicit none(type, external)
  private

  public :: is_sphere, mark_bodies, single_code

contains

  subroutine mark_bodies(bodies, code, status, n_waves)
    !! Mark each body with the kernel that solves it.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code
    integer(i1), intent(out) :: status(bodies%n)
    integer, intent(out) :: n_waves    !! largest number on a body that is marked WAVED
    integer :: i

    n_waves = 0
    if (code == CLOSED_FORM) then
      status = FREE
    else if (.not. (code == TAYLOR .or. code == CLOSED_FORM_OR_TAYLOR .or. code > FIXED)) then
      status = NEEDS_FALLBACK
    else if (shares_mark(bodies, code)) then
      status = mark_of(bodies, 1, code, n_waves)
    else
      do i = 1, bodies%n
        status(i) = mark_of(bodies, i, code, n_waves)
      end do
    end if
  end subroutine mark_bodies

  pure logical function shares_mark(bodies, code)
    !! Return whether the mark of all bodies follows from that of the first.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: code

    shares_mark = max(size(bodies%constant, 2), size(bodies%rate, 2), size(bodies%sines, 3), &
                      size(bodies%cosines, 3)) == 1
    if (code /= CLOSED_FORM_OR_TAYLOR .or. size(bodies%body, 2) == 1) return
    if (shares_mark) shares_mark = .not. feels_torque(bodies, 1)
  end function shares_mark

  pure logical function feels_torque(bodies, i)
    !! Return whether a torque acts on body i.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i

    feels_torque = has_torque(bodies%constant(:, of_body(size(bodies%constant, 2), i))) &
                   .or. has_torque(bodies%rate(:, of_body(size(bodies%rate, 2), i)))
    if (.not. feels_torque) feels_torque = waves_on(bodies, i) > 0
  end function feels_torque

  pure integer function waves_on(bodies, i)
    !! Return the number of waves that act on body i.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i
    integer :: k

    waves_on = 0
    do k = 1, size(bodies%sines, 2)
      if (acts(bodies%sines(:, k, of_body(size(bodies%sines, 3), i)))) waves_on = waves_on + 1
    end do
    do k = 1, size(bodies%cosines, 2)
      if (acts(bodies%cosines(:, k, of_body(size(bodies%cosines, 3), i)))) waves_on = waves_on + 1
    end do
  end function waves_on

  integer(i1) function mark_of(bodies, i, code, n_waves)
    !! Return the mark of body i.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i, code
    integer, intent(inout) :: n_waves  !! largest number so far
    integer :: own_waves

    if (code == CLOSED_FORM_OR_TAYLOR) then
      mark_of = FREE
      if (.not. feels_torque(bodies, i)) then
        if (single_code(bodies, i, code) == TAYLOR .and. size(bodies%moments, 2) == 0) then
          mark_of = RAMPED
        end if
        return
      end if
      mark_of = NEEDS_FALLBACK
      if (single_code(bodies, i, code) == SPHERE) return
    end if
    own_waves = waves_on(bodies, i)
    if (code > FIXED) then
      mark_of = STEPPED
      if (has_torque(bodies%rate(:, of_body(size(bodies%rate, 2), i)))) mark_of = NEEDS_FALLBACK
      if (own_waves > 0 .or. with_attitude(bodies)) mark_of = NEEDS_FALLBACK
    else if (own_waves > MOST_WAVES) then
      mark_of = NEEDS_FALLBACK
    else if (own_waves > 0) then
      mark_of = WAVED
      n_waves = max(n_waves, own_waves)
    else
      mark_of = RAMPED
    end if
  end function mark_of

  pure logical function is_sphere(coefficients)
    real(dp), intent(in) :: coefficients(3) !! A, B, C

    is_sphere = all(abs(coefficients) <= 0.0_dp)
  end function is_sphere

  pure integer function single_code(bodies, i, code)
    !! Return the method by which the single-body kernel solves body i if `code` was requested.
    type(bodies_t), intent(in) :: bodies
    integer, intent(in) :: i, code

    single_code = code
    if (code /= CLOSED_FORM_OR_TAYLOR) return
    if (feels_torque(bodies, i)) then
      single_code = TAYLOR
      ! With attitude, a sphere under torque has no closed form.
      if (is_sphere(coefficients_of(bodies, i)) .and. .not. with_attitude(bodies)) then
        single_code = SPHERE
      end if
    else if (with_attitude(bodies) .and. .not. bodies%by_moments) then
      ! The coefficients do not determine the angular momentum of the body.
      single_code = TAYLOR
    end if
  end function single_code

end module many_kinds

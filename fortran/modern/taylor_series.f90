module taylor_series
  !! The terms of one step by recurrence, and the next step that follows from them. unroll.py writes
  !! out the marked loops. A term includes its power of the step, so that a step ends with a plain
  !! sum.
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use, intrinsic :: iso_fortran_env, only: int64
  use kinds, only: dp
  use series, only: MOST_ORDER
  implicit none(type, external)
  private

  integer, parameter, public :: MORE_TURNS = 2

  ! A column of four numbers fills a register; the fourth is not used. layout.py reads this
  ! declaration for the C that unroll.py writes (taylor_terms_*.c).
  type, bind(c), public :: series_t
    real(c_double) :: terms(4, 0:MOST_ORDER) !! coefficient times step**k, rad/s
    real(c_double) :: torque(4, MOST_ORDER)  !! what the torque adds to the terms, rad/s
    real(c_double) :: factors(4)             !! A, B, C times the step, s
    real(c_double) :: change(4)              !! sum of the terms from 1, rad/s
    real(c_double) :: lanes(4, 3)            !! perturbations, a vector in each lane, rad/s
    !! The terms of an attitude. The two beyond the order lack the next terms of omega.
    real(c_double) :: turns(4, 0:MOST_ORDER + MORE_TURNS)
    real(c_double) :: half(4)                !! half of the step, s
    real(c_double) :: turn(4)                !! sum of the attitude's terms from 1
    real(c_double) :: weight                 !! of these against the terms of omega, rad/s; 0: none
  end type series_t

  integer, parameter :: ORDER_CARRIED = 7 ! order of the exponential
  real(dp), parameter :: EXPONENT = 3.0_dp ! largest norm of an exponent that is taken at once
  real(dp), parameter :: MOST_PARTS = 1e3_dp
  integer, parameter :: MOST_MOMENTS = 8 ! terms that count in means and moments
  integer :: k_
  ! Weights of term k: its integral over the step, and its integral times the time from the middle.
  real(dp), parameter :: MEANS(MOST_MOMENTS) = [(1.0_dp/real(k_ + 1, dp), k_=1, MOST_MOMENTS)]
  real(dp), parameter :: MOMENTS(MOST_MOMENTS) = &
                         [(real(k_, dp)/real(2*(k_ + 1)*(k_ + 2), dp), k_=1, MOST_MOMENTS)]

  public :: evaluate, expand, fitting, predict_step, propagate_precisely, propagate_variations, &
            rescale, size_of

contains

  ! unroll: expand
  subroutine expand(order, s)
    !! Compute terms 1 to `order`, which is even, of equations 13-15, and their sum.
    integer(c_int), intent(in), value :: order
    type(series_t), intent(inout) :: s !! terms(:, 0), torque and factors are inputs
    real(dp) :: products(3)            ! of equations 13-15, (rad/s)**2
    integer :: j, k

    do k = 1, order
      products = 0.0_dp
      do j = 0, k - 1
        products = products + cshift(s%terms(:3, j), 1)*cshift(s%terms(:3, k - 1 - j), 2)
      end do
      s%terms(:3, k) = (s%factors(:3)*products)/k + s%torque(:3, k)
      s%terms(4, k) = 0.0_dp
    end do
    s%change = sum(s%terms(:, order:1:-1), dim=2)
  end subroutine expand
  ! end unroll

  pure subroutine propagate_variations(s)
    !! Propagate perturbations over a step, by Magnus's series to fourth order: the exponential of
    !! the mean of the Jacobian, minus its commutator with the first moment about the middle.
    type(series_t), intent(inout) :: s
    real(dp), dimension(4) :: mean, moment
    real(dp) :: c(3)                   ! cross product of mean and moment
    real(dp) :: o(6)                   ! the matrix, by rows; its diagonal is 0
    real(dp) :: size                   ! square of the matrix's norm
    integer :: i, k, parts

    do i = 1, 4
      mean(i) = s%terms(i, 0)
      moment(i) = 0.0_dp
    end do
    do k = 1, MOST_MOMENTS
      do i = 1, 4
        mean(i) = mean(i) + s%terms(i, k)*MEANS(k)
        moment(i) = moment(i) + s%terms(i, k)*MOMENTS(k)
      end do
    end do
    c(1) = mean(2)*moment(3) - mean(3)*moment(2)
    c(2) = mean(3)*moment(1) - mean(1)*moment(3)
    c(3) = mean(1)*moment(2) - mean(2)*moment(1)
    o(1) = s%factors(1)*(mean(3) + s%factors(3)*c(3))
    o(2) = s%factors(1)*(mean(2) - s%factors(2)*c(2))
    o(3) = s%factors(2)*(mean(3) - s%factors(3)*c(3))
    o(4) = s%factors(2)*(mean(1) + s%factors(1)*c(1))
    o(5) = s%factors(3)*(mean(2) + s%factors(2)*c(2))
    o(6) = s%factors(3)*(mean(1) - s%factors(1)*c(1))
    ! In these units the matrix of a body is symmetric except for signs.
    size = abs(o(1)*o(3)) + abs(o(2)*o(5)) + abs(o(4)*o(6))
    if (size <= EXPONENT*EXPONENT) then
      call multiply(o, s%lanes)
    else
      ! A spin about one axis, whose steps are long.
      parts = ceiling(min(MOST_PARTS, sqrt(size)))
      o = o*(1.0_dp/parts)
      do k = 1, parts
        call multiply(o, s%lanes)
      end do
    end if
  end subroutine propagate_variations

  ! unroll: propagate_precisely
  subroutine propagate_precisely(order, s)
    !! Propagate perturbations as accurately as the motion, by the linear part of the recurrence of
    !! the terms.
    integer(c_int), intent(in), value :: order
    type(series_t), intent(inout) :: s
    real(dp) :: d(4, 3, 0:MOST_ORDER), products(4, 3)
    integer :: i, j, k

    d(:, :, 0) = s%lanes
    do k = 1, order
      products = 0.0_dp
      do j = 0, k - 1
        do i = 1, 4
          products(i, 1) = products(i, 1) &
                           + (s%terms(2, j)*d(i, 3, k - 1 - j) + s%terms(3, j)*d(i, 2, k - 1 - j))
          products(i, 2) = products(i, 2) &
                           + (s%terms(1, j)*d(i, 3, k - 1 - j) + s%terms(3, j)*d(i, 1, k - 1 - j))
          products(i, 3) = products(i, 3) &
                           + (s%terms(1, j)*d(i, 2, k - 1 - j) + s%terms(2, j)*d(i, 1, k - 1 - j))
        end do
      end do
      do i = 1, 3
        d(:, i, k) = (s%factors(i)/k)*products(:, i)
      end do
      s%lanes = s%lanes + d(:, :, k)
    end do
  end subroutine propagate_precisely
  ! end unroll

  ! unroll: multiply
  pure subroutine multiply(o, lanes)
    !! Multiply vectors side by side by the exponential of a matrix whose diagonal is 0.
    real(dp), intent(in) :: o(6)       !! the matrix, by rows
    real(dp), intent(inout) :: lanes(4, 3)
    real(dp) :: d(4, 3), rise(4, 3)
    integer :: k

    d = lanes
    do k = ORDER_CARRIED, 1, -1
      rise(:, 1) = o(1)*d(:, 2) + o(2)*d(:, 3)
      rise(:, 2) = o(3)*d(:, 1) + o(4)*d(:, 3)
      rise(:, 3) = o(5)*d(:, 1) + o(6)*d(:, 2)
      d = lanes + rise/k
    end do
    lanes = d
  end subroutine multiply
  ! end unroll

  pure subroutine predict_step(h, s, order, part, allowed, decay, next)
    !! Predict the step with which the last terms would be as large as allowed, from the terms
    !! before the last two and from the decay in the previous step. The processor then need not wait
    !! for the last terms. The bits of a positive number, read as an integer, are its logarithm to
    !! 6 %, which suffices.
    real(dp), intent(in) :: h                !! s
    type(series_t), intent(in) :: s
    integer, intent(in) :: order
    integer(int64), intent(in) :: part       !! 65536 over the order, as a division would take long
    real(dp), intent(in) :: allowed          !! rad/s
    integer(int64), intent(inout) :: decay   !! logarithm of the decay over two orders
    real(dp), intent(out) :: next            !! s
    integer(int64) :: before                 ! logarithm of the size of the earlier terms
    integer(int64) :: change                 ! change of the logarithm of the step

    before = transfer(size_of(s, order - 2), before)
    change = transfer(allowed, change) - before - decay
    change = max(-ishft(2_int64, 52), min(ishft(2_int64, 52), shifta(change, 16)*part))
    next = transfer(transfer(h, change) + change, h)
    decay = transfer(size_of(s, order), before) - before
  end subroutine predict_step

  pure real(dp) function size_of(s, k)
    !! Return the size of the terms k - 1 and k, rad/s.
    type(series_t), intent(in) :: s
    integer, intent(in) :: k

    size_of = (abs(s%terms(1, k)) + abs(s%terms(1, k - 1))) &
              + (abs(s%terms(2, k)) + abs(s%terms(2, k - 1))) &
              + (abs(s%terms(3, k)) + abs(s%terms(3, k - 1)))
    if (s%weight > 0.0_dp) then
      size_of = max(size_of, s%weight*(sum(abs(s%turns(:, k))) + sum(abs(s%turns(:, k - 1)))))
    end if
  end function size_of

  pure real(dp) function fitting(h, last, order, allowed)
    !! Return the step with which the last terms would be as large as allowed.
    real(dp), intent(in) :: h        !! s
    real(dp), intent(in) :: last     !! size of the last terms, rad/s
    integer, intent(in) :: order
    real(dp), intent(in) :: allowed  !! rad/s
    integer(int64) :: change         ! change of the logarithm of the step

    change = (transfer(allowed, change) - transfer(last, change))/order
    change = max(-ishft(40_int64, 52), min(ishft(40_int64, 52), change))
    fitting = transfer(transfer(h, change) + change, h)
  end function fitting

  pure subroutine rescale(s, order, ratio, with_attitude)
    !! Rescale the terms to a step that is `ratio` times as long.
    type(series_t), intent(inout) :: s
    integer, intent(in) :: order
    real(dp), intent(in) :: ratio
    logical, intent(in) :: with_attitude

    call rescale_terms(order, ratio, s%terms, s%change)
    s%factors = s%factors*ratio
    if (with_attitude) then
      call rescale_terms(order, ratio, s%turns, s%turn)
      s%turns(:, order + 1) = s%turns(:, order + 1)*ratio**(order + 1)
      s%turns(:, order + 2) = s%turns(:, order + 2)*ratio**(order + 2)
      s%half = s%half*ratio
    end if
  end subroutine rescale

  pure subroutine rescale_terms(order, ratio, terms, change)
    integer, intent(in) :: order
    real(dp), intent(in) :: ratio
    real(dp), intent(inout) :: terms(4, 0:order)
    real(dp), intent(out) :: change(4) !! sum of the terms from 1
    real(dp) :: power
    integer :: k

    power = 1.0_dp
    do k = 1, order
      power = power*ratio
      terms(:, k) = terms(:, k)*power
    end do
    change = terms(:, order)
    do k = order - 1, 1, -1
      change = change + terms(:, k)
    end do
  end subroutine rescale_terms

  pure function evaluate(order, terms, part) result(change)
    !! Compute the change of omega, or of an attitude, at a fraction of the step.
    integer, intent(in) :: order
    real(dp), intent(in) :: terms(4, 0:order)
    real(dp), intent(in) :: part
    real(dp) :: change(4)
    integer :: k

    change = 0.0_dp
    do k = order, 1, -1
      change = (change + terms(:, k))*part
    end do
  end function evaluate

end module taylor_series

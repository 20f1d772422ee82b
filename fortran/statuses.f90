module statuses
  !! How a computation ended; pyharness/methods/kernels.py has their names.
  implicit none(type, external)
  private

  integer, parameter, public :: COMPLETE = 0 !! every row is a result
  integer, parameter, public :: STOPPED = 1  !! the Lipschitz test ended the run
  integer, parameter, public :: OVERFLOW = 2 !! an angular velocity left the range of numbers
  integer, parameter, public :: REFUSED = 3  !! the method can't take these coefficients
  integer, parameter, public :: GAVE_UP = 4  !! no digit of the phase is left, or too many steps
  integer, parameter, public :: INTERRUPTED = 5 !! by the user; an exception is set

end module statuses

module kinds
  !! The real kinds of the project, named after their formats in IEEE 754.
  implicit none(type, external)
  private

  integer, parameter, public :: binary32 = selected_real_kind(6, 37)
  integer, parameter, public :: binary64 = kind(1.0d0)
  integer, parameter, public :: binary128 = selected_real_kind(33, 4931) !! negative if unavailable
  integer, parameter, public :: dp = binary64 !! working kind; only fortran/original uses the others
end module kinds

module kinds
  !! The real kinds of the project, all of IEEE 754, by the names of the words.
  implicit none(type, external)
  private

  integer, parameter, public :: binary32 = selected_real_kind(6, 37)
  integer, parameter, public :: binary64 = kind(1.0d0)
  integer, parameter, public :: binary128 = selected_real_kind(33, 4931) !! below 0: there is none
  integer, parameter, public :: dp = binary64 !! of all but the words
end module kinds

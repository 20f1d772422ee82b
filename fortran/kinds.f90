module kinds
  !! The one real kind of the project: IEEE binary64.
  implicit none(type, external)
  private

  integer, parameter, public :: dp = kind(1.0d0)
end module kinds

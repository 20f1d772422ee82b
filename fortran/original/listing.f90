module listing_flags
  !! Flags of the defects, readings and conjectures of the appendix that are active, one bit each.
  !! The numbers of the bits are those of `flag` in pyharness/data/apparatus.toml.
  implicit none(type, external)
  private

  type, public :: listing_t
    logical :: dt_accumulates
    logical :: x3_reads_acl2
    logical :: torque_held
    logical :: stage_base
    logical :: base_not_restored
    logical :: lipschitz_tests_velocity
    logical :: lipschitz_per_component
    logical :: lipschitz_mismatched_pairs
    logical :: c1_for_c
    logical :: do_variable
    logical :: initial_torque
    logical :: three_masses
  end type listing_t

  public :: listing_from_bits

contains

  pure function listing_from_bits(bits) result(listing)
    integer, intent(in) :: bits !! sum of 2**flag over the active names
    type(listing_t) :: listing

    listing%dt_accumulates = btest(bits, 0)
    listing%x3_reads_acl2 = btest(bits, 1)
    listing%torque_held = btest(bits, 2)
    listing%stage_base = btest(bits, 3)
    listing%base_not_restored = btest(bits, 4)
    listing%lipschitz_tests_velocity = btest(bits, 5)
    listing%lipschitz_per_component = btest(bits, 6)
    listing%lipschitz_mismatched_pairs = btest(bits, 7)
    listing%c1_for_c = btest(bits, 8)
    listing%do_variable = btest(bits, 9)
    listing%initial_torque = btest(bits, 10)
    listing%three_masses = btest(bits, 11)
  end function listing_from_bits

end module listing_flags

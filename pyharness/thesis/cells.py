"""Pairs of a listing and a case (cells), in which the Fortran and Python ports are compared.

A listing is a program with chosen defects, readings and conjectures; a case is a scene of Table 1.
"""

from collections.abc import Iterator
from dataclasses import replace

from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.equations import initial_torque


def subsets(names: tuple[str, ...]) -> Iterator[frozenset[str]]:
    for bits in range(2 ** len(names)):
        yield frozenset(name for i, name in enumerate(names) if bits >> i & 1)


def all_listings(program: str) -> Iterator[Listing]:
    for readings in subsets(names_of("reading", program)):
        for defects in subsets(switches(program)):
            yield Listing(program, defects, readings)


def all_cells() -> Iterator[tuple[Listing, int]]:
    """Yield every pair of a listing and a case number."""
    cases = {case: initial_torque(case_scene(case)) is not None for case in case_numbers()}
    for program in PROGRAMS:
        for listing in all_listings(program):
            for case, has_torque in cases.items():
                yield listing, case
                if has_torque:
                    conjectures = listing.conjectures | {"initial-torque"}
                    yield replace(listing, conjectures=conjectures), case


def cell_name(listing: Listing, case: int) -> str:
    return f"{listing.program}/case-{case}/{listing_name(listing)}"


def listing_name(listing: Listing) -> str:
    """Return a name such as ``original``, ``corrected:READING`` or ``DEFECT+DEFECT``."""
    if listing.label == "custom":
        return "+".join(sorted(listing.active))
    return ":".join([listing.label, *sorted(listing.readings)])

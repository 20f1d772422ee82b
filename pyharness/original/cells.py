"""The cells in which Fortran and twin are compared: program x case x listing x reading."""

from collections.abc import Iterator
from dataclasses import replace

from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.original.equations import initial_torque


def subsets(names: tuple[str, ...]) -> Iterator[frozenset[str]]:
    """Return every subset, the empty one first."""
    for bits in range(2 ** len(names)):
        yield frozenset(name for i, name in enumerate(names) if bits >> i & 1)


def all_listings(program: str) -> Iterator[Listing]:
    """Return every subset of defects, with every choice of readings."""
    for readings in subsets(names_of("reading", program)):
        for defects in subsets(switches(program)):
            yield Listing(program, defects, readings)


def all_cells() -> Iterator[tuple[Listing, int]]:
    """Return every listing of every program with every case, and what a case alone allows."""
    for program in PROGRAMS:
        for listing in all_listings(program):
            for case in case_numbers():
                yield listing, case
                if initial_torque(case_scene(case)) is not None:
                    conjectures = listing.conjectures | {"initial-torque"}
                    yield replace(listing, conjectures=conjectures), case


def cell_name(listing: Listing, case: int) -> str:
    """Return a name without blanks, as in ``two-term/case-3/dt-accumulates+torque-held``."""
    return f"{listing.program}/case-{case}/{listing_name(listing)}"


def listing_name(listing: Listing) -> str:
    """Return `original`, with its readings after a colon, `corrected`, or all that is active."""
    if listing.label == "custom":
        return "+".join(sorted(listing.active))
    return ":".join([listing.label, *sorted(listing.readings)])

"""The cells in which Fortran and twin are compared: program x case x listing x reading."""

from collections.abc import Iterator

from pyharness.listing import PROGRAMS, Listing, names_of
from pyharness.scene_file import case_numbers


def subsets(names: tuple[str, ...]) -> Iterator[frozenset[str]]:
    for bits in range(2 ** len(names)):
        yield frozenset(name for i, name in enumerate(names) if bits >> i & 1)


def all_listings(program: str) -> Iterator[Listing]:
    """Every subset of defects, with every choice of readings."""
    for readings in subsets(names_of("reading", program)):
        for defects in subsets(names_of("defect", program)):
            yield Listing(program, defects, readings)


def all_cells() -> Iterator[tuple[Listing, int]]:
    for program in PROGRAMS:
        for listing in all_listings(program):
            for case in case_numbers():
                yield listing, case

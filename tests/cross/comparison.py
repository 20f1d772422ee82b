"""Checks from digests: every cell of every build is compared with the Python twin."""

from collections.abc import Collection, Iterator, Mapping

from pyharness.checks.check import Check, Name
from tests.cross.digests import replay

CHECKOUT = "checkout"  # the build with which the cross-check itself runs


def compared(
    build: str,
    digests: Mapping[str, str],
    twin: Mapping[str, str],
    listed: Collection[tuple[str, str]] = (),
) -> Iterator[Check]:
    """Yield a check for each cell of a build, which compares its digest with the Python twin's.

    `listed` has build and cell of each known divergence; one that no longer occurs fails.
    """
    known_cells = {cell for name, cell in listed if name == build}
    for cell in sorted(digests.keys() | twin.keys() | known_cells):
        differs = digests.get(cell) != twin.get(cell)
        known = cell in known_cells
        note = ""
        if differs:
            note = "listed" if known else "not the bits of the twin"
        elif known:
            note = "a listed divergence that no longer occurs"
        variables = "PYHARNESS_ALL_LISTINGS=1 " if cell.startswith("nasty/") else ""
        again = f"{variables}python -m {replay(cell)}"
        if build != CHECKOUT:
            again = inside(build, replay(cell), variables)
        yield Check(Name("bits", build, cell), differs == known, None, None, None, note, again)


def inside(build: str, module: str, variables: str = "") -> str:
    """Return the command that runs a module in the tree of a build."""
    python = f"PYTHONPATH=$PWD {variables}../environment/bin/python"
    return f"cd build/cross/{build} && {python} -m {module}"

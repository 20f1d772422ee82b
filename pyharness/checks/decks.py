"""Checks of the Fortran port against the decks, which are compiled from the author's cards.

The decks depend on neither the port nor the twins. TAPE5, the file of all steps, is compared bit
for bit, the printed page as text. An overflow ends a run of the port; the deck continues, but must
not produce finite omega.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pyharness.checks.cells import of_cell
from pyharness.checks.check import BITS, Check, Name, Selection
from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.cells import cell_name
from pyharness.thesis.decks import compiler, deck_text, run_deck, solver_object
from pyharness.thesis.printer import page
from pyharness.thesis.programs import PROGRAM_REGISTRY

_AT_ONCE = 2
_THIN = ("two-term/case-3/original", "four-term/case-7/corrected", "runge-kutta/case-2/original")


def listings(program: str) -> list[Listing]:
    """Return the original and the corrected listing, and each with every single change."""
    names = frozenset(switches(program))
    found = [Listing.original(program), Listing.corrected(program)]
    found += [Listing(program, frozenset([name])) for name in switches(program)]
    found += [Listing(program, names - {name}) for name in switches(program)]
    for reading in names_of("reading", program):
        found += [Listing.original(program, [reading]), Listing(program, [reading])]
    return list(dict.fromkeys(found))


def decks(chosen: Selection) -> Iterator[Check]:
    """Yield checks that each deck agrees with the port; none without a Fortran compiler."""
    asked = [
        (of_cell("decks", listing, case), listing, case)
        for program in PROGRAMS
        for listing in listings(program)
        for case in case_numbers()
        if not chosen.thin or cell_name(listing, case) in _THIN
    ]
    asked = [each for each in asked if chosen.asks(each[0].id)]
    if not asked or compiler() is None:
        return
    with TemporaryDirectory() as folder, ThreadPoolExecutor(_AT_ONCE) as pool:
        solver_object(Path(folder))
        yield from pool.map(partial(_compared, Path(folder)), asked)


def _compared(folder: Path, asked: tuple[Name, Listing, int]) -> Check:
    name, listing, case = asked
    scene = case_scene(case)
    port = PROGRAM_REGISTRY[listing.program].run(scene, listing)
    assert port.velocity is not None
    try:
        deck = run_deck(deck_text(listing, scene, "gfortran"), folder)
    except RuntimeError as failure:
        return name.judged(False, str(failure))
    wanted = np.column_stack([port.recorded_time, port.omega, port.velocity])
    found = deck.tape5[: port.steps]
    faults = []
    if found.tobytes() != wanted.tobytes():
        faults.append("TAPE5 differs")
    whole = page(scene, listing.program, port)
    overflowed = port.ended == "overflow"
    if not (deck.page.startswith(whole) if overflowed else deck.page == whole):
        faults.append("the page differs")
    # Records of the deck after the port's last row.
    rest = deck.tape5[port.steps :]
    if not overflowed:
        faults += [f"{len(rest)} records more"] if len(rest) else []
    elif not len(rest) or np.isfinite(rest[:, 1:4]).all(axis=1).any():
        faults.append("it continues with finite numbers where the port has none")
    with np.errstate(all="ignore"):
        apart = float(np.abs(found - wanted[: len(found)]).max(initial=0.0))
    return name.judged(not faults, ", ".join(faults), apart, 0.0, BITS)

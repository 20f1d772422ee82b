"""Checks that the Fortran and Python versions of the thesis's programs agree bit for bit.

A cell is a combination of a program, a case of Table 1, defects and readings (interpretations of
doubtful cards).

A deck is compiled from the author's cards and shares no code with our versions. Its output, TAPE5
and a printed page, must equal the output of our Fortran version. After an overflow our version
ends; the deck continues, but must not produce a finite omega.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import chain, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from pyharness.checks.check import BITS, Attempt, Check, Name, Selection, selected
from pyharness.checks.compare.agreement import differences, distance
from pyharness.checks.scenes.random_scenes import draw
from pyharness.model.basis import Basis
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis import in_word
from pyharness.thesis.cells import all_cells, cell_name, listing_name
from pyharness.thesis.decks import compiler, deck_text, run_deck, solver_object
from pyharness.thesis.printer import page
from pyharness.thesis.programs import BINARY64, PROGRAM_REGISTRY, run_program
from pyharness.thesis.vectors import answers
from pyharness.thesis.word import WORDS

# Evaluations of the right-hand sides in a step: collocation evaluates them at the start and at each
# collocation point. Also for the step that overflows.
_EVALUATIONS = {"two-term": 3, "four-term": 5, "runge-kutta": 4}


def cells(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks that Fortran and Python agree in each cell, or in a few if `chosen.thin`."""
    divergences = facts("divergences")["divergence"]
    listed = {entry["cell"] for entry in divergences if entry["kind"] == "cross-language"}
    for listing, case in all_cells():
        few = len(listing.defects) <= 1 or listing.label == "original"
        if not chosen.thin or (case in (3, 7) and few and len(listing.readings) <= 1):
            is_listed = cell_name(listing, case) in listed
            check = partial(_agreement, listing, case_scene(case), is_listed, ())
            yield Attempt(of_cell("cells", listing, case), check)


def of_cell(suite: str, listing: Listing, case: int) -> Name:
    return Name(suite, listing.program, f"case-{case}", listing_name(listing))


def random_programs(chosen: Selection) -> Iterator[Attempt]:
    for number in range(chosen.draws):
        yield Attempt(chosen.name_draw(number, "program"), partial(_of_draw, chosen.seed, number))


def _of_draw(seed: str, number: int, name: Name) -> Check:
    drawn = draw(seed, number)
    stop_test = drawn.lipschitz, drawn.may_stop
    return _agreement(drawn.listing, drawn.scene, False, stop_test, name)


def _agreement(
    listing: Listing, scene: Scene, is_listed: bool, options: Sequence[Any], name: Name
) -> Check:
    """Return the check that Fortran and Python agree or, if `is_listed`, differ."""
    # `options`: the constant of the stop test (1/s), and whether the test may end the run.
    run = PROGRAM_REGISTRY[listing.program].run
    compiled, twin = (run(scene, listing, language, *options) for language in ("fortran", "python"))
    found = differences(compiled, twin)
    if not np.array_equal(compiled.time, np.arange(1, compiled.steps + 1) * scene.step_size):
        found.append("time is not n h")
    evaluations = _EVALUATIONS[listing.program] * (compiled.steps + (compiled.ended == "overflow"))
    if compiled.evaluations != evaluations:
        found.append(f"{compiled.evaluations} right-hand sides, due {evaluations}")
    note = ", ".join(found)
    if is_listed:
        note = f"listed: {note}" if found else "a listed divergence that no longer occurs"
    limit, basis = (None, None) if is_listed else (0.0, BITS)
    return name.judged(bool(found) == is_listed, note, distance(compiled, twin), limit, basis)


_THIN_CASE = 3
_VECTORS = Basis(
    "derived",
    "no test vector of the CDC arithmetic may differ",
    "the rules of the CYBER 170 hardware reference, CDC 60463560 (`thesis/vectors.py`)",
)


def words(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of simulated arithmetics: CDC test vectors, and runs of the programs."""
    yield Attempt(Name("words", "vectors"), _vectors)
    for listing, case in all_cells():
        has_all_or_none = listing.label != "custom" and not listing.readings
        if chosen.thin and (case != _THIN_CASE or not has_all_or_none):
            continue
        name = of_cell("words", listing, case)
        if chosen.only or has_all_or_none or len(listing.defects) + len(listing.readings) <= 1:
            yield Attempt(name, partial(_in_word, listing, case, None))
        if chosen.only or has_all_or_none:
            for word in in_word.compiled_words():
                own = replace(name, subject=f"{word}/{listing.program}")
                yield Attempt(own, partial(_in_word, listing, case, word))


def _vectors(name: Name) -> Check:
    wrong = [each.vector.name for each in answers() if not each.agrees]
    return name.bounded(len(wrong), 0.0, _VECTORS, ", ".join(wrong))


def _in_word(listing: Listing, case: int, word: str | None, name: Name) -> Check:
    """Compare Python with Fortran in `word`, or, if it is None, our binary64 with floats."""
    scene = case_scene(case)
    ours = in_word.run(scene, listing, WORDS[word or BINARY64])
    if word is None:
        other = run_program(scene, listing, "python")
    else:
        other = in_word.run_compiled(scene, listing, WORDS[word])
    found = differences(ours, other)
    return name.judged(not found, ", ".join(found), distance(ours, other), 0.0, BITS)


_AT_ONCE = 2  # decks that are compiled and run at once
_THIN = ("two-term/case-3/original", "four-term/case-7/corrected", "runge-kutta/case-2/original")


def listings(program: str) -> list[Listing]:
    """Return the original and corrected program, and both with one defect or reading changed."""
    names = frozenset(switches(program))
    found = [Listing.original(program), Listing.corrected(program)]
    found += [Listing(program, frozenset([name])) for name in switches(program)]
    found += [Listing(program, names - {name}) for name in switches(program)]
    for reading in names_of("reading", program):
        found += [Listing.original(program, [reading]), Listing(program, [reading])]
    return list(dict.fromkeys(found))


def decks(chosen: Selection) -> Iterator[Check]:
    """Yield checks of our Fortran against the author's cards, if a compiler is installed."""
    every = product(chain.from_iterable(map(listings, PROGRAMS)), case_numbers())
    some = [cell for cell in every if not chosen.thin or cell_name(*cell) in _THIN]
    named = [(of_cell("decks", *cell), *cell) for cell in some]
    asked = [each for each in named if selected(each[0].id, chosen.only)]
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
    faults = [] if found.tobytes() == wanted.tobytes() else ["TAPE5 differs"]
    whole = page(scene, listing.program, port)
    overflowed = port.ended == "overflow"
    if not (deck.page.startswith(whole) if overflowed else deck.page == whole):
        faults.append("the page differs")
    # Records after our version's last row.
    rest = deck.tape5[port.steps :]
    if not overflowed:
        faults += [f"{len(rest)} records more"] if len(rest) else []
    elif not len(rest) or np.isfinite(rest[:, 1:4]).all(axis=1).any():
        faults.append("it continues with finite numbers where the port has none")
    with np.errstate(all="ignore"):
        apart = float(np.abs(found - wanted[: len(found)]).max(initial=0.0))
    return name.judged(not faults, ", ".join(faults), apart, 0.0, BITS)

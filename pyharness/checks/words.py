"""Checks of our arithmetic of machine words, by test vectors and runs of the programs.

The arithmetic reproduces a machine's mantissa length and rounding, such as 48 bits for the CDC.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from pyharness.checks.cells import of_cell
from pyharness.checks.check import BITS, Attempt, Check, Name
from pyharness.checks.compare.agreement import differences, distance
from pyharness.checks.selection import Selection
from pyharness.model.basis import Basis
from pyharness.model.listing import Listing
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis import compiled_in_word, in_word
from pyharness.thesis.cells import all_cells
from pyharness.thesis.programs import BINARY64, run_program
from pyharness.thesis.vectors import answers
from pyharness.thesis.word import WORDS

_THIN_CASE = 3
_VECTORS = Basis(
    "derived",
    "no test vector of the CDC arithmetic may differ",
    "the rules of the CYBER 170 hardware reference, CDC 60463560 (`thesis/vectors.py`)",
)


def words(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of our arithmetic of machine words, bit for bit.

    Test vectors are CDC instructions with expected results. In each cell (a program, a case,
    defects and readings), our 53 bits must agree with floats, and the program compiled for each
    word with the twin in that word. If `chosen.only` is empty, listings are fewer: for the floats
    those with at most one change, original and corrected; for the words the last two.
    """
    yield Attempt(Name("words", "vectors"), _vectors)
    for listing, case in all_cells():
        if chosen.thin and (case != _THIN_CASE or not _has_all_or_none(listing)):
            continue
        name = of_cell("words", listing, case)
        if chosen.only or _is_few(listing):
            yield Attempt(name, partial(_against_floats, listing, case))
        if chosen.only or _has_all_or_none(listing):
            for word in compiled_in_word.compiled_words():
                own = replace(name, subject=f"{word}/{listing.program}")
                yield Attempt(own, partial(_against_fortran, listing, case, word))


def _vectors(name: Name) -> Check:
    wrong = [each.vector.name for each in answers() if not each.agrees]
    return name.bounded(len(wrong), 0.0, _VECTORS, ", ".join(wrong))


def _against_floats(listing: Listing, case: int, name: Name) -> Check:
    floats = run_program(case_scene(case), listing, "python")
    return _same(name, floats, in_word.run(case_scene(case), listing, WORDS[BINARY64]))


def _against_fortran(listing: Listing, case: int, word: str, name: Name) -> Check:
    scene = case_scene(case)
    fortran = compiled_in_word.run(scene, listing, WORDS[word])
    return _same(name, in_word.run(scene, listing, WORDS[word]), fortran)


def _same(name: Name, one: Trajectory, other: Trajectory) -> Check:
    found = differences(one, other)
    return name.judged(not found, ", ".join(found), distance(one, other), 0.0, BITS)


def _has_all_or_none(listing: Listing) -> bool:
    return listing.label != "custom" and not listing.readings


def _is_few(listing: Listing) -> bool:
    few = len(listing.defects) + len(listing.readings) <= 1
    return few or _has_all_or_none(listing)

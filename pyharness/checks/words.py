"""Words: the vectors of the CDC, and our own arithmetic against the processor's and Fortran's."""

from collections.abc import Iterator

from pyharness.checks.check import Check, bounded
from pyharness.checks.selection import Selection, replay
from pyharness.compare.agreement import differences, distance
from pyharness.model.listing import Listing
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import compiled_in_word, in_word
from pyharness.original.cells import all_cells, cell_name
from pyharness.original.programs import BINARY64, run_program
from pyharness.original.vectors import answers
from pyharness.original.word import WORDS

_THIN_CASE = 3


def words(chosen: Selection) -> Iterator[Check]:
    """Hold every vector, the twin in `Word(53)` against that in floats, and Fortran in its words.

    Bit for bit: in every cell where words are asked for by name; else in those that have all
    defects, one or none, of which Fortran has those of all and none.
    """
    id = "words/vectors"
    if chosen.asks(id):
        wrong = [each.vector.name for each in answers() if not each.agrees]
        yield bounded(id, len(wrong), 0.0, replay(id), ", ".join(wrong))
    for listing, case in all_cells():
        if chosen.thin and (case != _THIN_CASE or not _has_all_or_none(listing)):
            continue
        yield from _against_floats(chosen, listing, case)
        yield from _against_fortran(chosen, listing, case)


def _against_floats(chosen: Selection, listing: Listing, case: int) -> Iterator[Check]:
    id = f"words/{cell_name(listing, case)}"
    if chosen.asks(id) and (chosen.only or _is_few(listing)):
        floats = run_program(case_scene(case), listing, "python")
        yield _check(id, floats, in_word.run(case_scene(case), listing, WORDS[BINARY64]))


def _against_fortran(chosen: Selection, listing: Listing, case: int) -> Iterator[Check]:
    if not (chosen.only or _has_all_or_none(listing)):
        return
    for word in compiled_in_word.compiled_words():
        id = f"words/{word}/{cell_name(listing, case)}"
        if chosen.asks(id):
            scene = case_scene(case)
            fortran = compiled_in_word.run(scene, listing, WORDS[word])
            yield _check(id, in_word.run(scene, listing, WORDS[word]), fortran)


def _check(id: str, one: Trajectory, other: Trajectory) -> Check:
    found = differences(one, other)
    return Check(id, not found, distance(one, other), 0.0, replay(id), ", ".join(found))


def _has_all_or_none(listing: Listing) -> bool:
    """Whether a listing is the original or the corrected one."""
    return listing.label != "custom" and not listing.readings


def _is_few(listing: Listing) -> bool:
    """Whether a listing has no reading and all defects, one or none; or a reading alone."""
    few = len(listing.defects) + len(listing.readings) <= 1
    return few or _has_all_or_none(listing)

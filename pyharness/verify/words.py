"""Words: the vectors of the CDC, and binary64 by our own arithmetic against the processor's."""

from collections.abc import Iterator

from pyharness.compare.agreement import differences, distance
from pyharness.compare.checks import Check, bounded
from pyharness.model.listing import Listing
from pyharness.model.scene_file import case_scene
from pyharness.original import in_word
from pyharness.original.cells import all_cells, cell_name
from pyharness.original.programs import BINARY64, run_program
from pyharness.original.vectors import answers
from pyharness.original.word import WORDS
from pyharness.verify.selection import Selection, replay


def words(chosen: Selection) -> Iterator[Check]:
    """Hold every vector, and the twin in `Word(53)` against the twin in floats, bit for bit.

    In every cell where words are asked for by name; else in those that have all defects, one or
    none.
    """
    id = "words/vectors"
    if chosen.asks(id):
        wrong = [each.vector.name for each in answers() if not each.agrees]
        yield bounded(id, len(wrong), 0.0, replay(id), ", ".join(wrong))
    for listing, case in all_cells():
        id = f"words/{cell_name(listing, case)}"
        if not chosen.asks(id) or not (chosen.only or _is_few(listing)):
            continue
        if chosen.thin and case not in (3, 7):
            continue
        scene = case_scene(case)
        ours = in_word.run(scene, listing, WORDS[BINARY64])
        floats = run_program(scene, listing, "python")
        found = differences(floats, ours)
        ulps = distance(floats, ours)
        yield Check(id, not found, ulps, 0.0, replay(id), ", ".join(found))


def _is_few(listing: Listing) -> bool:
    """Whether a listing has no reading and all defects, one or none; or a reading alone."""
    few = len(listing.defects) + len(listing.readings) <= 1
    return few or (listing.label == "original" and not listing.readings)

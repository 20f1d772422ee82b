"""A digest for each cell, and its build: `python -m tests.cross.digests LANGUAGE FILE`."""

import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import tests.conftest  # noqa: F401  (guards the kernels if traps are requested)
from pyharness import _build, _kernels  # noqa: PLC2701
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis import in_word
from pyharness.thesis.cells import all_cells, all_listings, cell_name, listing_name
from pyharness.thesis.in_word import compiled_words
from pyharness.thesis.programs import BINARY64, COMPILED_WORDS, PROGRAM_REGISTRY
from pyharness.thesis.word import WORDS
from tests.thesis.test_programs import NASTY


def digest(run: Trajectory) -> str:
    """Return a hash of all bits of a trajectory; NaN are equal, whatever their sign bit."""
    counters = [run.steps, run.evaluations, run.ended]
    if run.stop is not None:
        counters += [run.stop.step, run.stop.variable, float(run.stop.quotient).hex()]
    summed = hashlib.sha256(repr(counters).encode())
    for array in (run.time, run.recorded_time, run.omega, run.velocity):
        assert array is not None
        bits = np.ascontiguousarray(np.where(np.isnan(array), np.nan, array))
        summed.update(repr(bits.shape).encode() + bits.tobytes())
    if run.exact is not None:
        summed.update(repr([(x.m, x.e) for x in run.exact.ravel().tolist()]).encode())
    if run.ier is not None:
        summed.update(np.ascontiguousarray(run.ier, dtype=np.int32).tobytes())
    return summed.hexdigest()[:16]


def count_of_runs() -> int:
    """Return the number of digests of a compiler that supports every floating-point format."""
    cells = list(all_cells())
    nasty = sum(2 * len(list(all_listings(program))) for program in PROGRAMS) * len(NASTY)
    words = sum(_has_other_words(listing) for listing, _ in cells) * (len(COMPILED_WORDS) - 1)
    return len(cells) + nasty + words


def all_digests(language: str) -> Iterator[tuple[str, str]]:
    """Yield name and digest of every cell, every nasty scene, and the cells in other formats."""
    for listing, case in all_cells():
        run = PROGRAM_REGISTRY[listing.program].run(case_scene(case), listing, language)
        yield f"cells/{cell_name(listing, case)}", digest(run)
    for name, scene in NASTY.items():
        for program in PROGRAMS:
            for listing in all_listings(program):
                for may_stop in (True, False):
                    run = PROGRAM_REGISTRY[program].run(scene, listing, language, may_stop=may_stop)
                    end = "" if may_stop else "/no-stop"
                    yield f"nasty/{program}/{name}/{listing_name(listing)}{end}", digest(run)

    yield from _in_words(language)


def _in_words(language: str) -> Iterator[tuple[str, str]]:
    """Yield name and digest of cells with all defects or none, in the other IEEE formats."""
    compiled = language == "fortran"
    run = in_word.run_compiled if compiled else in_word.run
    for word in compiled_words() if compiled else COMPILED_WORDS:
        for listing, case in all_cells():
            if word != BINARY64 and _has_other_words(listing):
                found = run(case_scene(case), listing, WORDS[word])
                yield f"words/{word}/{cell_name(listing, case)}", digest(found)


def _has_other_words(listing: Listing) -> bool:
    return listing.label != "custom" and not listing.readings


def replay(cell: str) -> str:
    """Return the arguments of `python -m` that compare Fortran with the twin in a cell again."""
    if cell.startswith(("cells/", "words/")):
        return f"pyharness verify --only {cell}"
    _, program, name = cell.split("/")[:3]
    return (
        "pytest -q 'tests/thesis/test_programs.py::test_nasty_scenes_agree_to_the_last_bit"
        f"[{program}-{name}]'"
    )


def main(language: str, file: str) -> None:
    """Write the digests, and a description of the build that computed them."""
    record = {
        "extension": _kernels.__file__, "compiler": f"{_build.COMPILER} {_build.COMPILER_VERSION}",
        "flags": _build.FLAGS, "words": compiled_words(), "digests": dict(all_digests(language)),
    }  # fmt: skip
    Path(file).write_text(json.dumps(record))


if __name__ == "__main__":
    main(*sys.argv[1:])

"""The effect of word length: runs with p bits of significand, compared with binary64.

The errors of the runs are against the reference solution.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from pyharness.compare.agreement import accuracy
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import in_word
from pyharness.original.linear_solver import SINGULAR
from pyharness.original.printer import page
from pyharness.original.word import RULES, Word
from pyharness.truth.reference import reference

LENGTHS = (16, 20, 24, 28, 32, 36, 40, 44, 48, 53, 56, 60, 64, 80, 96, 113)
# In the widest word a program's error is the truncation error of its method alone.
DOUBLE, WIDEST = Word(53), Word(113)


@dataclass(frozen=True)
class WordRun:
    """A run of a program in an arithmetic with p bits of significand, compared with binary64.

    Attributes
    ----------
    case : int
        The case of Table 1.
    program, listing : str
        The name of the program, and the label of its listing.
    p : int
        Bits of the significand.
    rule : str
        The rounding rule, one of `RULES`.
    stop : str
        The reason for an early end and its step, as in ``V2 at 25`` or ``overflow at 50``; empty if
        the run is complete.
    fields, different : int
        How many numbers the rows of the printed page have, in binary64 or in this arithmetic,
        whichever has more; and how many of them binary64 and this arithmetic do not print alike.
    error : float
        Largest error of any omega component against the reference (rad/s).
    singular : int
        Number of rows for which LEQT1F reports IER = 129.
    """

    case: int
    program: str
    listing: str
    p: int
    rule: str
    stop: str
    fields: int
    different: int
    error: float
    singular: int


@dataclass(frozen=True)
class WordCell:
    """The runs of one listing on one case, in several arithmetics.

    `double` is the run in binary64, `widest` the run with 113 bits, and `runs` has a run for each
    chosen number of bits and rounding rule.
    """

    double: WordRun
    widest: WordRun
    runs: tuple[WordRun, ...]

    def of(self, p: int, rule: str) -> WordRun | None:
        """Return the run with p bits and the rounding rule `rule`, or None if there is none."""
        return next((run for run in self.runs if (run.p, run.rule) == (p, rule)), None)

    def settled(self, rule: str, same: Callable[[WordRun], bool]) -> int | None:
        """Return the least p (bits) such that `same` holds for all runs with at least p bits.

        Only runs with the rounding rule `rule` count. Return None if there is no such p.
        """
        least = None
        for run in sorted((r for r in self.runs if r.rule == rule), key=lambda run: -run.p):
            if not same(run):
                break
            least = run.p
        return least


def cells(
    cases: Sequence[int],
    programs: Sequence[str] = PROGRAMS,
    lengths: Sequence[int] = LENGTHS,
    progress: Progress = no_progress,
) -> Iterator[WordCell]:
    """Run the programs, original and corrected, on the cases in every arithmetic.

    The arithmetics have each number of bits in `lengths` with each rounding rule. Yield a
    `WordCell` for each listing and case. `progress` is called with the number of finished runs and
    the number of all runs.
    """
    words = [Word(p, rule) for rule in RULES for p in lengths]
    chosen = [
        (case, listing)
        for case in cases
        for program in programs
        for listing in (original(program), corrected(program))
    ]
    every, done = len(chosen) * (len(words) + 2), 0
    for case, listing in chosen:
        judge = _Judge(case_scene(case), listing)
        found = []
        for word in (DOUBLE, WIDEST, *words):
            found.append(judge.run(word))
            done += 1
            progress(done, every, f"case {case}, {listing.program}")
        yield WordCell(found[0], found[1], tuple(found[2:]))


class _Judge:
    """A listing on a scene, with the page in binary64 and the reference solution.

    Runs of the listing in other arithmetics are compared with this page and this solution.
    """

    def __init__(self, scene: Scene, listing: Listing) -> None:
        self.scene, self.listing = scene, listing
        self.truth = reference(scene, scene.times())
        self.double = self._page(in_word.run(scene, listing, DOUBLE))

    def run(self, word: Word) -> WordRun:
        found = in_word.run(self.scene, self.listing, word)
        pairs = list(zip_longest(self.double, self._page(found)))
        assert self.scene.case is not None
        return WordRun(
            self.scene.case,
            self.listing.program,
            self.listing.label,
            word.p,
            word.rule,
            _stop(found),
            len(pairs),
            sum(x != y for x, y in pairs),
            max(accuracy(self.scene, found, self.truth).omega),
            0 if found.ier is None else int((found.ier == SINGULAR).sum()),
        )

    def _page(self, found: Trajectory) -> list[str]:
        lines = page(self.scene, self.listing.program, found).splitlines()
        return " ".join(lines[len(lines) - found.steps :]).split()


def _stop(found: Trajectory) -> str:
    if found.stop is not None:
        return f"{found.stop.variable} at {found.stop.step}"
    return f"overflow at {found.steps + 1}" if found.ended == "overflow" else ""

"""The effect of word length: runs in emulated arithmetics of p bits, against binary64.

An arithmetic is a number p of significand bits and a rounding rule. A run's printed page is
compared with the page in binary64, and its omega with the reference solution.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from pyharness.checks.compare.agreement import accuracy
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis import in_word
from pyharness.thesis.linear_solver import SINGULAR
from pyharness.thesis.printer import page
from pyharness.thesis.word import RULES, Word
from pyharness.truth.reference import reference

LENGTHS = (16, 20, 24, 28, 32, 36, 40, 44, 48, 53, 56, 60, 64, 80, 96, 113)
# With 113 bits, rounding is negligible, so that the error is the method's truncation error.
DOUBLE, WIDEST = Word(53), Word(113)


@dataclass(frozen=True)
class WordRun:
    """A run of a program in one arithmetic, compared with binary64.

    `rule` is ``nearest-even``, ``chop`` (towards zero), or ``FX`` and ``RX``, the unrounded and the
    rounded operations of the CDC 6600. `stop` has reason and step of an early end, as in ``V2 at
    25``. The longer page has `fields` numbers, of which `different` differ. `error` is the largest
    error of omega (rad/s); `singular` counts rows with IER = 129.
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
    """The runs of one listing on one case: in binary64, with 113 bits, and in other arithmetics."""

    double: WordRun
    widest: WordRun
    runs: tuple[WordRun, ...]

    def find_run(self, p: int, rule: str) -> WordRun | None:
        """Return the run with p bits and a rounding rule, or None."""
        return next((run for run in self.runs if (run.p, run.rule) == (p, rule)), None)

    def settled(self, rule: str, same: Callable[[WordRun], bool]) -> int | None:
        """Return the least p from which on `same` is true of every run with the rule, or None."""
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
    """Yield the runs of each program, original and corrected, on each case."""
    words = [Word(p, rule) for rule in RULES for p in lengths]
    chosen = [
        (case, listing)
        for case in cases
        for program in programs
        for listing in (Listing.original(program), Listing.corrected(program))
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
    """The comparison of a program's runs with binary64 and the reference."""

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

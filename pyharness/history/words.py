"""What word length does: programs with p bits, by every rule, against binary64 and the truth."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from pyharness.compare.agreement import accuracy
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import in_word
from pyharness.original.linear_solver import SINGULAR
from pyharness.original.printer import page
from pyharness.original.word import RULES, Word
from pyharness.truth.reference import reference

LENGTHS = (16, 20, 24, 28, 32, 36, 40, 44, 48, 53, 56, 60, 64, 80, 96, 113)
# A wider word has no more of a program's error than its method leaves out.
DOUBLE, WIDEST = Word(53), Word(113)


@dataclass(frozen=True)
class WordRun:
    """A program in a word.

    Attributes
    ----------
    case : int
    program, listing : str
    p : int
        Bits.
    rule : str
        One of `RULES`.
    stop : str
        ``V2 at 25``, ``overflow at 50``: the step that has no more rows; empty where it ran on.
    fields, different : int
        Numbers in the rows of the page, in binary64 or here, whichever has more; and those that
        are not printed alike.
    error : float
        Largest error of any omega of its rows against the truth (rad/s).
    singular : int
        Rows with IER = 129 of LEQT1F.
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
    """A program with its listing on a case: its run in binary64, in the widest word, in all."""

    double: WordRun
    widest: WordRun
    runs: tuple[WordRun, ...]

    def of(self, p: int, rule: str) -> WordRun | None:
        """Return the run in a word, or None."""
        return next((run for run in self.runs if (run.p, run.rule) == (p, rule)), None)

    def settled(self, rule: str, same: Callable[[WordRun], bool]) -> int | None:
        """Return the least p from which on all runs are the same; None where the last is not."""
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
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Iterator[WordCell]:
    """Run all programs, original and corrected, on all cases in every word.

    `progress` gets how many runs are done, and of how many.
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
            progress(done, every)
        yield WordCell(found[0], found[1], tuple(found[2:]))


class _Judge:
    """Runs a program in words, and says of each how it differs from binary64 and the truth."""

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

"""The effect of word length: runs with p significand bits.

Printed pages are compared with the page in binary64, omega with the reference solution.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product, takewhile, zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

from pyharness.checks.compare.agreement import accuracy
from pyharness.model.assumptions import assumption_records, case_mark, legend, mark
from pyharness.model.listing import PROGRAMS, Listing, subset
from pyharness.model.progress import Progress, no_progress
from pyharness.model.records import build_record
from pyharness.model.report import (
    Column,
    Picture,
    Report,
    Section,
    Table,
    counted,
    numbers,
    short,
    words,
)
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis import in_word
from pyharness.thesis.linear_solver import SINGULAR
from pyharness.thesis.printer import page
from pyharness.thesis.programs import run_program
from pyharness.thesis.word import RULES, Word
from pyharness.truth.reference import reference

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LENGTHS = (16, 20, 24, 28, 32, 36, 40, 44, 48, 53, 56, 60, 64, 80, 96, 113)
# With 113 bits rounding is negligible, so that the error is the truncation error.
DOUBLE, WIDEST = Word(53), Word(113)
# An error of more than this multiple of the error with 113 bits counts as rounding.
ROUNDS = 2.0
_VISIBLE = 1e-9  # least error (rad/s) that is compared between arithmetics
_SMALL = 0.01  # largest relative change of an error that does not count as a change
_MACHINE = (("cdc48", 48, "FX"), ("rounded", 48, "RX"))
_SHORT = {"nearest-even": "ne", "chop": "chop", "FX": "FX", "RX": "RX"}
_STYLES: dict[str, dict[str, Any]] = {
    "nearest-even": {"color": "#1040a0", "linestyle": "-", "marker": "o"},
    "chop": {"color": "#c02020", "linestyle": (0, (5, 2)), "marker": "s"},
    "FX": {"color": "#107040", "linestyle": (0, (1, 1.2)), "marker": "^"},
    "RX": {"color": "#a06000", "linestyle": (0, (6, 1, 1, 1)), "marker": "v"},
}


class WordRun(NamedTuple):
    """A run in an arithmetic, compared with binary64."""

    case: int
    program: str
    listing: str
    p: int  # number of significand bits
    rule: str  # nearest-even, chop (towards zero), or the CDC's FX (truncating) or RX (rounding)
    stop: str  # reason and step of an early end, as in V2 at 25
    fields: int  # number of printed numbers on the longer page
    different: int  # number of printed numbers that differ
    error: float  # largest error of omega, rad/s
    singular: int  # number of steps with a singular matrix (IER = 129)


@dataclass(frozen=True)
class WordCell:
    """The runs of a program version in a case, in several arithmetics."""

    double: WordRun
    widest: WordRun | None  # with 113 bits; not computed for a verdict
    runs: tuple[WordRun, ...]

    def find_run(self, p: int, rule: str) -> WordRun | None:
        return next((run for run in self.runs if (run.p, run.rule) == (p, rule)), None)

    def settled(self, rule: str, same: Sequence[WordRun]) -> int | None:
        """Return the least p from which on all runs with this rounding are in `same`, or None."""
        of_rule = sorted((r for r in self.runs if r.rule == rule), key=lambda run: -run.p)
        return min((run.p for run in takewhile(same.__contains__, of_rule)), default=None)


def cells(
    cases: Sequence[int],
    programs: Sequence[str] = PROGRAMS,
    lengths: Sequence[int] = LENGTHS,
    progress: Progress = no_progress,
) -> Iterator[WordCell]:
    kinds = (Listing.original, Listing.corrected)
    listings = [kind(program) for program in programs for kind in kinds]
    words = [WIDEST, *(Word(p, rule) for rule in RULES for p in lengths)]
    for double, widest, *runs in _runs(cases, listings, words, progress):
        yield WordCell(double, widest, tuple(runs))


def machine_cells(
    cases: Sequence[int], programs: Sequence[str] = PROGRAMS, progress: Progress = no_progress
) -> list[WordCell]:
    """Return the runs of original programs in the CDC's arithmetic, by case and program."""
    words = [Word(p, rule) for _, p, rule in _MACHINE]
    found = _runs(cases, list(map(Listing.original, programs)), words, progress)
    return [WordCell(double, None, tuple(runs)) for double, *runs in found]


def _runs(
    cases: Sequence[int], listings: Sequence[Listing], words: Sequence[Word], progress: Progress
) -> Iterator[list[WordRun]]:
    """Yield the runs in binary64 and in `words`, for each case and listing."""
    every, done = len(cases) * len(listings) * len(words), 0
    truths = {case: reference(case_scene(case), case_scene(case).times()) for case in cases}
    for case, listing in product(cases, listings):
        scene, truth = case_scene(case), truths[case]
        pages: list[list[str]] = []
        found: list[WordRun] = []
        for word in (DOUBLE, *words):
            # In binary64 run the compiled program, which equals its Python port bit for bit.
            run = in_word.run(scene, listing, word) if found else run_program(scene, listing)
            lines = page(scene, listing.program, run).splitlines()
            pages.append(" ".join(lines[len(lines) - run.steps :]).split())
            pairs = list(zip_longest(pages[0], pages[-1]))
            different, error = sum(x != y for x, y in pairs), max(accuracy(scene, run, truth).omega)
            singular = 0 if run.ier is None else int((run.ier == SINGULAR).sum())
            head = (case, listing.program, listing.label, word.p, word.rule, _stop(run))
            found.append(WordRun(*head, len(pairs), different, error, singular))
        done += len(words)
        progress(done, every, f"case {case}, {listing.program}")
        yield found


def _stop(found: Trajectory) -> str:
    if found.stop is not None:
        return f"{found.stop.variable} at {found.stop.step}"
    return f"overflow at {found.steps + 1}" if found.ended == "overflow" else ""


def words_report(cells: Sequence[WordCell]) -> Report:
    """Return the report of `words`; all cells must have the same numbers of bits."""
    runs = [run for cell in cells for run in cell.runs]
    data = numbers(" ".join(WordRun._fields), runs)
    tables: list[Section] = [
        [
            "Smallest precision p, in bits, from which on the printed rows (page) or the end of "
            "the run (stop) are those of binary64; -: not up to the largest p. Rounding rules: ne "
            "(nearest even), chop (towards zero), FX and RX (CDC, unrounded and rounded):",
            _lengths(cells),
        ],
        [
            "truncation: largest error with 113 bits (rad/s). rounding: smallest p from which on "
            f"the error is at most {ROUNDS:g} times the truncation error. IER: largest p, with any "
            "rule, with which LEQT1F reports IER = 129:",
            _errors(cells),
        ],
    ]
    notes = legend(_scenes(cells))
    if all(cell.find_run(p, rule) for cell in cells for _, p, rule in _MACHINE):
        heads = (
            "fields: numbers on the printed page, in binary64. cdc48, rounded: how many of them "
            "differ in the CDC's arithmetic, unrounded and rounded. stop: variable and step at "
            "which the run ended. error: largest error of w (rad/s):"
        )
        tables.insert(0, [heads, _machine(cells)])
        notes += _changes(cells)
    tables.append(notes)
    record, pictures = partial(_record, runs, cells), {"words": partial(_picture, cells, data)}
    return Report("words", tables, record, data, tables, pictures=pictures)


def machine_report(cells: Sequence[WordCell]) -> Report:
    """Return the verdict on the CDC's arithmetic, from `machine_cells`."""
    runs = [(cell.double, run) for cell in cells for run in cell.runs]
    stops = sum(run.stop != double.stop for double, run in runs)
    changes = [
        abs(run.error / double.error - 1.0) for double, run in runs if double.error > _VISIBLE
    ]
    largest = max(changes, default=0.0)
    subject = "Some result" if stops or largest > _SMALL else "No result"
    told = [
        f"{subject} of the original programs depends on the CDC's 48 bits, truncated (cdc48) or "
        "rounded:",
        *_changes(cells),
        f"errors above {short(_VISIBLE)} rad/s change by at most {short(largest)} of themselves; "
        "--lengths shows each run",
    ]
    return Report("words", [told], lambda: _record([run for _, run in runs], cells))


def _record(runs: Sequence[WordRun], cells: Sequence[WordCell]) -> dict[str, Any]:
    found = {"runs": [run._asdict() for run in runs], "build": build_record()}
    return found | {"assumptions": assumption_records(_scenes(cells))}


def _scenes(cells: Sequence[WordCell]) -> list[tuple[Scene, list[Listing]]]:
    runs = (cell.double for cell in cells)
    return [(case_scene(x.case), [subset(x.program, x.listing)]) for x in runs]


def _head(cell: WordCell) -> list[Any]:
    case, program, listing, *_ = cell.double
    on_cards = mark(case_scene(case), subset(program, listing))
    return [f"{case}{case_mark(case)}", program, f"{listing}{on_cards}"]


def _machine(cells: Sequence[WordCell]) -> Table:
    columns = [Column("case"), *words("program listing"), Column("fields"), Column("stop")]
    columns += [Column("error", short, unit="rad/s")]
    for name, _, _ in _MACHINE:
        columns += [Column(name, name=f"{name}_different"), Column("stop", name=f"{name}_stop")]
        columns.append(Column("error", short, unit="rad/s", name=f"{name}_error"))
    rows = []
    for cell in cells:
        row = [*_head(cell), cell.double.fields, cell.double.stop or "-", cell.double.error]
        for _, p, rule in _MACHINE:
            run = cell.find_run(p, rule)
            assert run is not None
            row += [run.different, "same" if run.stop == cell.double.stop else run.stop, run.error]
        rows.append(row)
    return Table(columns, rows)


def _changes(cells: Sequence[WordCell]) -> list[str]:
    told = []
    for name, p, rule in _MACHINE:
        found = [(cell.double, run) for cell in cells if (run := cell.find_run(p, rule))]
        pages = sum(run.different > 0 for _, run in found)
        stops = sum(run.stop != double.stop for double, run in found)
        changed = sum(run.different for _, run in found)
        every = sum(run.fields for _, run in found)
        told.append(
            f"{name}: {changed} of {every} printed numbers differ from binary64, on {pages} of "
            f"{len(found)} pages; {counted(stops, 'run')} end{'s' if stops == 1 else ''} otherwise"
        )
    return told


def _lengths(cells: Sequence[WordCell]) -> Table:
    columns = [Column("case"), *words("program listing")]
    columns += [Column(f"{what} {_SHORT[rule]}") for what in ("page", "stop") for rule in RULES]
    rows = []
    for cell in cells:
        page = [run for run in cell.runs if run.different == 0]
        stop = [run for run in cell.runs if run.stop == cell.double.stop]
        least = (cell.settled(rule, same) for same in (page, stop) for rule in RULES)
        rows.append([*_head(cell), *least])
    return Table(columns, rows)


def _errors(cells: Sequence[WordCell]) -> Table:
    columns = [
        Column("case"), *words("program listing"), Column("truncation", short, unit="rad/s"),
        *(Column(f"rounding {_SHORT[rule]}") for rule in RULES), Column("IER"),
    ]  # fmt: skip
    rows = []
    for cell in cells:
        assert cell.widest is not None
        floor = cell.widest.error
        near = [run for run in cell.runs if run.error <= ROUNDS * floor]
        least = [cell.settled(rule, near) for rule in RULES]
        singular = max((run.p for run in cell.runs if run.singular), default=None)
        rows.append([*_head(cell), floor, *least, singular])
    return Table(columns, rows)


def _picture(cells: Sequence[WordCell], data: Table) -> Picture:
    from matplotlib.figure import Figure

    programs = list(dict.fromkeys(cell.double.program for cell in cells))
    listings = list(dict.fromkeys(cell.double.listing for cell in cells))
    figure = Figure(figsize=(4.4 * max(len(programs), 1.4), 7.5), dpi=110, layout="constrained")
    axes = figure.subplots(len(listings), len(programs), sharex=True, sharey=True, squeeze=False)
    for cell in cells:
        row, column = listings.index(cell.double.listing), programs.index(cell.double.program)
        _draw(axes[row, column], cell)
        axes[row, column].set_title(f"{cell.double.program} {cell.double.listing}")
    for place in axes[-1]:
        place.set_xlabel("p (bits)")
    for place in axes[:, 0]:
        place.set_ylabel("largest error (rad/s)")
    axes[0, 0].legend(fontsize=8)
    title = f"Case {cells[0].double.case}: largest error of omega against the length of the word"
    return Picture(figure, data, (title, "dashed: the method's truncation error"))


def _draw(axes: "Axes", cell: WordCell) -> None:
    for rule in RULES:
        points = sorted((run.p, run.error) for run in cell.runs if run.rule == rule)
        lengths, errors = zip(*points, strict=True)
        axes.plot(lengths, errors, label=rule, markersize=4.0, linewidth=1.2, **_STYLES[rule])
    if cell.widest is not None and cell.widest.error > 0.0:
        axes.axhline(cell.widest.error, color="black", linestyle="--", linewidth=0.8)
        axes.set_yscale("log")
    axes.grid(visible=True, linewidth=0.3)

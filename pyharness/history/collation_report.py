"""The report of `cards --collate`: comparison of the decks with each other and the thesis."""

from collections.abc import Sequence

from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Report, Table, counted, words
from pyharness.model.report import numbers as columns
from pyharness.thesis.deck_collation import Row, faults

_SHORT = dict(zip(PROGRAMS, ("2", "4", "R"), strict=True))
_COLUMNS = (
    Column("step", left=True), *words("in decks thesis"), Column("why", left=True, fit="wrap"),
)  # fmt: skip


def collation_report(found: Sequence[Row]) -> Report:
    """Return the report of the agreement of decks and thesis, operation by operation."""
    told = faults([*found])
    rows = [
        [
            row.what, "".join(_SHORT[program] for program in row.cards) or "-", row.decks,
            row.thesis, _why(row),
        ]
        for row in found
    ]  # fmt: skip
    legend = (
        "in: the decks that have the step, 2 two-term, 4 four-term, R runge-kutta. decks: whether "
        "their statements agree, differ in names or in order alone, or differ. thesis: whether "
        "sections II to V agree with the decks, differ, or are silent. why: entries of the "
        "apparatus (`defects NAME`), and what else explains it."
    )
    full = [
        [row.what, *(row.cards.get(program, "") for program in PROGRAMS), row.decks, row.text,
         row.says, row.thesis, " ".join(row.entries), row.reason]
        for row in found
    ]  # fmt: skip
    end = "nothing is unexplained" if not told else f"{len(told)} unexplained"
    names = "step two-term four-term runge-kutta decks text says thesis entries reason"
    return Report(
        "cards",
        [[legend], [Table(_COLUMNS, rows)], told, [f"{counted(len(found), 'step')}: {end}"]],
        record=lambda: {"steps": [row._asdict() for row in found], "unexplained": told},
        data=columns(names, full),
    )


def _why(row: Row) -> str:
    return "; ".join(each for each in (", ".join(row.entries), row.reason) if each) or "-"

"""The report of `cards --origins`: disagreements and supposed origins of faults."""

from collections.abc import Sequence

from pyharness.history.origins import Disagreement, origins, unexplained_defects
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Field, Report, Table, counted, words
from pyharness.model.report import numbers as columns

_SHORT = dict(zip(PROGRAMS, ("2", "4", "R"), strict=True))
_COLUMNS = (
    *words("disagreement in equation origin certainty"), Column("entries", left=True, fit="wrap"),
)  # fmt: skip


def origins_report(found: Sequence[Disagreement], mistakes: Sequence[str]) -> Report:
    """Return the report of disagreements, their origins, and mistakes in the table."""
    rows = [
        [
            each.id, "".join(_SHORT[program] for program in each.cards) or "-",
            ", ".join(each.equations) or "-", each.origin, each.certainty,
            ", ".join(each.entries) or "-",
        ]
        for each in found
    ]  # fmt: skip
    legend = (
        "in: the decks whose cards are quoted, 2 two-term, 4 four-term, R runge-kutta. equation: "
        "numbers of the formulas of the thesis. origin: kind of origin that we infer, as listed "
        "below. certainty: of this inference. entries: of the apparatus (`defects NAME`)."
    )
    full = [
        [each.id, each.title, " ".join(each.equations), each.where, each.says,
         *(" ".join(map(str, each.cards.get(program, ()))) for program in PROGRAMS),
         each.differs, each.known, each.suggests, each.origin, each.certainty,
         " ".join(each.entries), each.unnoticed]
        for each in found
    ]  # fmt: skip
    names = (
        "disagreement title equations where says two-term four-term runge-kutta differs known "
        "suggests origin certainty entries unnoticed"
    )
    kinds = [Field(f"{name:16s}", text) for name, text in origins().items()]
    left = [f"not explained: {name}" for name in unexplained_defects()]
    return Report(
        "cards",
        [
            [legend], [Table(_COLUMNS, rows)], kinds,
            [*left, *mistakes, counted(len(found), "disagreement")],
        ],
        record=lambda: {
            "disagreements": [
                {
                    **each._asdict(),
                    "cards": {
                        program: {str(number): text for number, text in quotes.items()}
                        for program, quotes in each.cards.items()
                    },
                }
                for each in found
            ],
            "unexplained": [*unexplained_defects(), *mistakes],
        },
        data=columns(names, full),
    )  # fmt: skip

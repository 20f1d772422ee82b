"""Reports: the results of a subcommand as data, which `pyharness.views` renders."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from decimal import Decimal

    from matplotlib.figure import Figure

    from pyharness.model.trajectory import Array


def exact(value: Any) -> str:
    """Return a value as text for CSV, with all digits; None is empty."""
    if isinstance(value, float):
        return float.__repr__(value)  # the repr of a NumPy float names its type
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def plain(value: Any) -> str:
    return "-" if value is None else str(value)


def short(x: "float | Decimal | None") -> str:
    """Return a number with two digits, such as 1.2e-3; None is a dash."""
    if x is None:
        return "-"
    if math.isnan(x) or math.isinf(x) or x == 0:
        return {"nan": "nan", "inf": "inf", "-inf": "-inf"}.get(str(x), "0")
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def digits(form: str, scale: float = 1.0) -> Callable[[float | None], str]:
    return lambda x: "-" if x is None else f"{scale * x:{form}}"


def counted(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def format_duration(seconds: float) -> str:
    for limit, unit, name in ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (172800.0, 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / unit:{'.2g' if seconds < 99.5 else '.0f'}} {name}"
    return f"{seconds / 86400.0:.0f} days"


def format_count(number: int) -> str:
    return str(number) if number < 10**7 else f"{float(number):.4g}"


def format_bytes(number: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if number < 1000.0:
            return f"{number:.3g} {unit}"
        number /= 1000.0
    return f"{float(number):.3g} PB"


class Column(NamedTuple):
    """A table column, for rounded numbers and for CSV."""

    head: str
    write: Callable[[Any], str] = plain  # formats rounded numbers
    left: bool = False  # whether the values are aligned left; numbers are aligned right
    unit: str = ""  # of the values in CSV; `write` may convert them
    name: str = ""  # head in CSV; if empty, `head` is used
    full: Callable[[Any], str] = exact  # formats numbers in CSV
    fit: str = ""  # "wrap" or "cut": treatment of a last column that is too wide


def words(heads: str) -> list[Column]:
    """Return left-aligned columns; blanks separate their `heads`."""
    return [Column(head, left=True) for head in heads.split()]


class Table(NamedTuple):
    columns: Sequence[Column]
    rows: "Sequence[Sequence[Any]] | Array"

    def written(self) -> list[list[str]]:
        return self._cells([(each.head, each.write) for each in self.columns])

    def in_full(self) -> list[list[str]]:
        return self._cells([(each.name or each.head, each.full) for each in self.columns])

    def _cells(self, columns: list[tuple[str, Callable[[Any], str]]]) -> list[list[str]]:
        heads, writers = zip(*columns, strict=True)
        rows = ([write(x) for write, x in zip(writers, row, strict=True)] for row in self.rows)
        return [list(heads), *rows]


def numbers(names: str, rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table for CSV only; blanks separate its heads `names`."""
    return Table([Column(name) for name in names.split()], rows)


class Line(str):
    """A line of a report that is not wrapped."""

    __slots__ = ()


class Field(NamedTuple):
    label: str
    text: str


# Paragraphs and tables. Blank lines are written only between sections.
Section = Sequence[str | Field | Table]


class Picture:
    def __init__(self, figure: "Figure", numbers: Table, title: Sequence[str] = ()) -> None:
        self.figure, self.numbers, self.title = figure, numbers, title


# A check for JUnit: kind, id, reason of a failure (empty if passed), command that repeats it, and
# run time (s) if known.
Case = tuple[str, str, str, str, float | None]


class Report(NamedTuple):
    """The results of a subcommand, for all output formats."""

    title: str  # the subcommand
    text: Sequence[Section]  # for the terminal; empty sections are skipped
    record: Callable[[], dict[str, Any]]  # for JSON
    data: Table | None = None  # for CSV, which has all digits
    page: Sequence[Section] | None = None  # for Markdown; if None, `data` is written
    cases: Sequence[Case] = ()  # for JUnit
    properties: Mapping[str, str] = {}  # for JUnit, by name
    # By name, functions that draw the pictures; None if the subcommand has no picture.
    pictures: Mapping[str, Callable[[], Picture]] | None = None

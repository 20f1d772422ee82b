"""A report: what a finding has to say, as data; `pyharness.views` renders it.

Tuples with names, where other rooms have dataclasses: these are made at every cold start, and a
dataclass takes as long as five of them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pyharness.model.trajectory import Array


def exact(value: Any) -> str:
    """Return a value in full: floats round-trip; empty where there is none."""
    if isinstance(value, float):
        return float.__repr__(value)  # NumPy's own would name their type
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def plain(value: Any) -> str:
    """Return a word or a whole number; a dash where there is none."""
    return "-" if value is None else str(value)


def short(x: float | None) -> str:
    """Return two digits of a number in a few characters: 1.2e-3, 0, -, inf."""
    if x is None:
        return "-"
    if math.isnan(x) or math.isinf(x) or x == 0:
        return {"nan": "nan", "inf": "inf", "-inf": "-inf"}.get(str(x), "0")
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def digits(form: str, scale: float = 1.0) -> Callable[[float | None], str]:
    """Return what writes a number in a form, as in ``.3g``, `scale` times it; a dash for none."""
    return lambda x: "-" if x is None else f"{scale * x:{form}}"


def counted(number: int, what: str) -> str:
    """Say a number of things: 1 step, 2 steps."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


class Column(NamedTuple):
    """A column of a table: `head` for people, `name` where numbers are given in full."""

    head: str
    write: Callable[[Any], str] = plain
    left: bool = False  # words stand to the left, numbers to the right
    unit: str = ""  # of the values, which `write` may scale
    name: str = ""  # `head` where empty
    full: Callable[[Any], str] = exact
    fit: str = ""  # "wrap" or "cut": what becomes of a last column that is too wide


def words(heads: str) -> list[Column]:
    """Return columns of words, which stand to the left."""
    return [Column(head, left=True) for head in heads.split()]


class Table(NamedTuple):
    """Columns, and rows of as many values; an array of (rows, columns) will do."""

    columns: Sequence[Column]
    rows: "Sequence[Sequence[Any]] | Array"

    def written(self) -> list[list[str]]:
        """Return the heads and all cells as people read them."""
        return self._cells([(each.head, each.write) for each in self.columns])

    def in_full(self) -> list[list[str]]:
        """Return the heads and all cells, numbers in full."""
        return self._cells([(each.name or each.head, each.full) for each in self.columns])

    def _cells(self, columns: list[tuple[str, Callable[[Any], str]]]) -> list[list[str]]:
        heads, writers = zip(*columns, strict=True)
        rows = ([write(x) for write, x in zip(writers, row, strict=True)] for row in self.rows)
        return [list(heads), *rows]


def numbers(names: str, rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table for CSV alone, of columns with these names."""
    return Table([Column(name) for name in names.split()], rows)


class Line(str):
    """A line that is left as it is, however long."""

    __slots__ = ()


class Field(NamedTuple):
    """A paragraph that stands behind its label."""

    label: str
    text: str


# Paragraphs and tables without a blank line between them; a blank line is between sections.
Section = Sequence[str | Field | Table]


class Picture:
    """A figure, the table of its numbers, and what is written above it, a line or more each."""

    def __init__(self, figure: "Figure", numbers: Table, title: Sequence[str] = ()) -> None:
        """Keep all three."""
        self.figure, self.numbers, self.title = figure, numbers, title


# A check as JUnit knows it: kind, id, why it failed (empty where it did not), replay.
Case = tuple[str, str, str, str]


class Report(NamedTuple):
    """What a finding has to say."""

    title: str  # the verb that asked
    text: Sequence[Section]  # in the terminal; empty sections do not count
    record: Callable[[], dict[str, Any]]  # JSON
    data: Table | None = None  # CSV, in full
    page: Sequence[Section] | None = None  # Markdown; None for `data`
    cases: Sequence[Case] = ()  # JUnit
    pictures: Mapping[str, Callable[[], Picture]] | None = None

"""Reports: the results of a verb (subcommand) as data, which `pyharness.views` renders.

The types are named tuples and not dataclasses, because they are created whenever the program
starts. The creation of a dataclass takes as long as that of five named tuples.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from decimal import Decimal

    from matplotlib.figure import Figure

    from pyharness.model.trajectory import Array


def exact(value: Any) -> str:
    """Return a value as text with all its digits, for CSV.

    A float has as many digits as are needed to restore it exactly. None becomes an empty text.
    """
    if isinstance(value, float):
        return float.__repr__(value)  # the repr of a NumPy float names its type
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def plain(value: Any) -> str:
    """Return a word or a whole number as text; None becomes a dash."""
    return "-" if value is None else str(value)


def short(x: "float | Decimal | None") -> str:
    """Return the number x as text with two digits, as in 1.2e-3; None becomes a dash."""
    if x is None:
        return "-"
    if math.isnan(x) or math.isinf(x) or x == 0:
        return {"nan": "nan", "inf": "inf", "-inf": "-inf"}.get(str(x), "0")
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def digits(form: str, scale: float = 1.0) -> Callable[[float | None], str]:
    """Return a function that formats `scale` times a number as text.

    `form` is the format specification, as in ``.3g``. The function returns a dash for None.
    """
    return lambda x: "-" if x is None else f"{scale * x:{form}}"


def counted(number: int, what: str) -> str:
    """Return a number with the noun `what`, in the plural if needed, as in 1 step, 2 steps."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


class Column(NamedTuple):
    """A column of a table: its heads, its unit, and the functions that format its values.

    A table can be written with rounded numbers, or as CSV with all digits. With rounded numbers
    `head` is the head, and `write` formats the values. In CSV `name` is the head, and `full`
    formats the values.
    """

    head: str
    write: Callable[[Any], str] = plain
    left: bool = False  # whether the values are aligned left; numbers are aligned right
    unit: str = ""  # of the values, as CSV has them; `write` may convert them
    name: str = ""  # head in CSV; if empty, `head` is used
    full: Callable[[Any], str] = exact
    fit: str = ""  # "wrap" or "cut": what is done with a last column that is too wide


def words(heads: str) -> list[Column]:
    """Return a list of left-aligned columns, one for each head in the text `heads`.

    The heads in the text are separated by blanks.
    """
    return [Column(head, left=True) for head in heads.split()]


class Table(NamedTuple):
    """A table of a report: its columns, and its rows with a value for each column.

    `rows` may be an array, shape (number of rows, number of columns).
    """

    columns: Sequence[Column]
    rows: "Sequence[Sequence[Any]] | Array"

    def written(self) -> list[list[str]]:
        """Return the table as lists of texts, first the heads and then the rows.

        The numbers are rounded, as the function `write` of each column formats them.
        """
        return self._cells([(each.head, each.write) for each in self.columns])

    def in_full(self) -> list[list[str]]:
        """Return the table for CSV as lists of texts, first the heads and then the rows.

        The numbers have all their digits.
        """
        return self._cells([(each.name or each.head, each.full) for each in self.columns])

    def _cells(self, columns: list[tuple[str, Callable[[Any], str]]]) -> list[list[str]]:
        heads, writers = zip(*columns, strict=True)
        rows = ([write(x) for write, x in zip(writers, row, strict=True)] for row in self.rows)
        return [list(heads), *rows]


def numbers(names: str, rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table of `rows` for CSV only.

    The text `names` has the heads of its columns, separated by blanks.
    """
    return Table([Column(name) for name in names.split()], rows)


class Line(str):
    """A line of a report that is not wrapped, however long it is."""

    __slots__ = ()


class Field(NamedTuple):
    """A paragraph of a report, printed after its label on the same line."""

    label: str
    text: str


# A section is a list of paragraphs and tables. Blank lines are only written between sections.
Section = Sequence[str | Field | Table]


class Picture:
    """A matplotlib figure, the table of the numbers that it shows, and the text of its title.

    The title is a sequence of paragraphs.
    """

    def __init__(self, figure: "Figure", numbers: Table, title: Sequence[str] = ()) -> None:
        """Store the figure, the table of the numbers that it shows, and its title."""
        self.figure, self.numbers, self.title = figure, numbers, title


# A check for JUnit: kind, id, reason of a failure (empty if it passed), command that repeats it.
Case = tuple[str, str, str, str]


class Report(NamedTuple):
    """The results of a subcommand as data, from which every output format is written.

    The formats are text, JSON, CSV, Markdown, JUnit and pictures.
    """

    title: str  # the verb that made the report
    text: Sequence[Section]  # for the terminal; empty sections are skipped
    record: Callable[[], dict[str, Any]]  # for JSON
    data: Table | None = None  # for CSV, in full
    page: Sequence[Section] | None = None  # for Markdown; if None, `data` is written
    cases: Sequence[Case] = ()  # for JUnit
    pictures: Mapping[str, Callable[[], Picture]] | None = None

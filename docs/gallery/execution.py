"""Execution of the Python examples in documents, with what they print and draw.

A document has its examples in blocks that begin with three backquotes and ``python``. A block
``output`` after an example is the text that the example prints. In a page of the gallery, a
picture after an example is the figure that the example leaves open in matplotlib.
"""

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.report import Picture, numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PYTHON = re.compile(r"```python\n(.*?)```", re.DOTALL)
"""An example in a document; its first group is the code."""

OUTPUT = re.compile(r"\n*```output\n(.*?)```", re.DOTALL)
"""The text that an example prints, directly after the example."""

PICTURE = re.compile(r"!\[[^]]*\]\(([^)/]+\.(?:svg|png))\)")
"""A picture of a document in the document's folder; its first group is the file."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?![\w.]*\w)")
# Below this, a printed number is a rounding error, which differs from machine to machine.
_ROUNDING = 1e-9
# Points of a curve in the numbers of a picture.
_POINTS = 30


class Step(NamedTuple):
    """An executed example: its code, the text that it printed, and the figure that it drew.

    `end` is the position of the end of its block in the document. `figure` is None if the example
    leaves no figure open.
    """

    code: str
    printed: str
    figure: "Figure | None"
    end: int


def executed(text: str, name: str) -> Iterator[Step]:
    """Execute the examples of a document one after another, and yield each after its execution.

    All examples of a document share their variables. `text` is the document, and `name` the name
    of its file, for error messages.
    """
    variables: dict[str, Any] = {"__name__": name}
    for block in PYTHON.finditer(text):
        buffer = io.StringIO()
        with contextlib.redirect_stdout(buffer):
            exec(compile(block[1], name, "exec"), variables)
        yield Step(block[1], buffer.getvalue(), _open_figure(), block.end())


def shown_output(text: str, step: Step) -> str | None:
    """Return the text that a document shows as the output of an example; None if it shows none."""
    found = OUTPUT.match(text, step.end)
    return None if found is None else found[1]


def is_current(shown: str, printed: str) -> bool:
    """Return whether a shown output and a printed one agree, apart from the machine's rounding.

    The texts between the numbers are identical. A whole number is identical, and another number
    differs by at most two units of its last digit. Numbers below 1e-9 are rounding errors, and
    differ by at most a factor of 10, or are both below 1e-13.
    """
    if _NUMBER.sub("#", " ".join(shown.split())) != _NUMBER.sub("#", " ".join(printed.split())):
        return False
    pairs = zip(_NUMBER.findall(shown), _NUMBER.findall(printed), strict=True)
    return all(_are_close(first, second) for first, second in pairs)


def _are_close(shown: str, printed: str) -> bool:
    if shown == printed:
        return True
    if re.fullmatch(r"[-+]?\d+", shown):
        return False
    a, b = float(shown), float(printed)
    if max(abs(a), abs(b)) < _ROUNDING:
        return min(abs(a), abs(b)) * 10.0 >= max(abs(a), abs(b)) or max(abs(a), abs(b)) < 1e-13
    mantissa, _, exponent = shown.partition("e")
    places = len(mantissa.partition(".")[2])
    return abs(a - b) <= 2.001 * 10.0 ** (int(exponent or 0) - places)


def picture_of(figure: "Figure") -> Picture:
    """Return a figure with its numbers: points of each curve, of each set of dots and each map."""
    rows: list[list[Any]] = []
    for number, axes in enumerate(figure.axes, 1):
        for label, columns in _drawn(axes):
            points = np.column_stack([np.asarray(each, dtype=float).ravel() for each in columns])
            chosen = np.unique(np.linspace(0, len(points) - 1, _POINTS).astype(int))
            rows += [
                [number, label, *(float(f"{x:.5g}") for x in row)] + [None] * (3 - len(row))
                for row in points[chosen].tolist()
            ]
    return Picture(figure, numbers("plot curve x y z", rows))


def _drawn(axes: Any) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield the label and the arrays of coordinates of everything that a diagram shows."""
    for line in axes.lines:
        columns = line.get_data_3d() if hasattr(line, "get_data_3d") else line.get_data()
        yield line.get_label(), columns
    for each in [*axes.collections, *axes.images]:
        if each.get_array() is not None:
            values: Array = np.ma.filled(
                np.ma.asarray(each.get_array(), dtype=float), np.nan
            ).ravel()
            yield each.get_label(), (np.arange(len(values)), values)
        elif hasattr(each, "get_offsets") and len(each.get_offsets()) > 1:
            yield each.get_label(), tuple(np.asarray(each.get_offsets()).T)


def _open_figure() -> "Figure | None":
    """Return the figure that is open in matplotlib, and close it; None if no figure is open."""
    import sys

    if "matplotlib.pyplot" not in sys.modules:
        return None
    import matplotlib.pyplot as plt

    if not plt.get_fignums():
        return None
    figure = plt.gcf()
    plt.close("all")
    return figure


def picture_file(path: Path, step: Step) -> Path | None:
    """Return the file of the picture that a page shows after an example; None if it shows none.

    `path` is the file of the page.
    """
    text = path.read_text(encoding="utf-8")
    following = PYTHON.search(text, step.end)
    end = len(text) if following is None else following.start()
    found = PICTURE.search(text, step.end, end)
    return None if found is None else path.parent / found[1]

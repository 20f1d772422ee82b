"""Execution of the Python examples in documents, with their outputs and figures.

An example is a fenced block ``python``. A block ``output`` after it is the text that it prints. A
picture after it is the figure that it leaves open in matplotlib.
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
"""An example; the first group is its code."""

OUTPUT = re.compile(r"\n*```output\n(.*?)```", re.DOTALL)
"""The output directly after an example; the first group is its text."""

PICTURE = re.compile(r"!\[[^]]*\]\(([^)/]+\.(?:svg|png))\)")
"""A picture in the folder of its document; the first group is the file."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?![\w.]*\w)")
_ROUNDING = 1e-9  # smaller numbers may be rounding errors, which depend on the machine
_POINTS = 30  # stored of each curve, at most


class Step(NamedTuple):
    """An executed example: code, printed text, figure, and the end of its block in the document."""

    code: str
    printed: str
    figure: "Figure | None"
    end: int


def executed(text: str, name: str) -> Iterator[Step]:
    """Execute the examples of a document, which share their variables, and yield each.

    `name` is the name of the file, for error messages.
    """
    variables: dict[str, Any] = {"__name__": name}
    for block in PYTHON.finditer(text):
        buffer = io.StringIO()
        with contextlib.redirect_stdout(buffer):
            exec(compile(block[1], name, "exec"), variables)
        yield Step(block[1], buffer.getvalue(), _open_figure(), block.end())


def shown_output(text: str, step: Step) -> str | None:
    """Return the output of an example in a document; None if the document has none."""
    found = OUTPUT.match(text, step.end)
    return None if found is None else found[1]


def is_current(shown: str, printed: str) -> bool:
    """Return whether two outputs agree, apart from rounding, which depends on the machine.

    Texts and whole numbers must be identical. Other numbers may differ by two units of the last
    digit; below 1e-9 by a factor of 10, and below 1e-13 by any factor.
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
    """Return a figure with some points of each curve, set of dots and map as numbers."""
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
    """Yield the label and arrays of coordinates of each curve, set of dots and map."""
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
    """Close and return the figure that is open in matplotlib; None if there is none."""
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
    """Return the file of the picture after an example in a page; None if there is none."""
    text = path.read_text(encoding="utf-8")
    following = PYTHON.search(text, step.end)
    end = len(text) if following is None else following.start()
    found = PICTURE.search(text, step.end, end)
    return None if found is None else path.parent / found[1]

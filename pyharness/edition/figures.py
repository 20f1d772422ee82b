"""The pictures of the pages, drawn once: Figures 6 to 12, and Figure 7 with its limit."""

from collections.abc import Mapping
from typing import NamedTuple

from pyharness.history.figures import (
    FigureFinding,
    figure_picture,
    findings,
    together_picture,
)
from pyharness.views.pictures import saved


class Drawn(NamedTuple):
    """A figure in one set, and its files by name: the picture and its numbers."""

    finding: FigureFinding
    files: dict[str, bytes]


def drawn() -> dict[str, Drawn]:
    """Compute and draw all figures; return them by the stem of their files."""
    return {
        each.plan.stem: Drawn(each, saved(figure_picture(each), f"{each.plan.stem}.svg"))
        for each in findings()
    }


def together(figures: Mapping[str, Drawn]) -> dict[str, bytes]:
    """Draw Figure 7, original and corrected, with its limit in one picture; return its files."""
    original, corrected = (figures[name].finding for name in ("figure-07", "figure-07-corrected"))
    return saved(together_picture(original, corrected), "figure-07-together.svg")

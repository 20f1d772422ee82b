"""The figures of the thesis as pictures for the site: Figures 6 to 12, and Figure 7 with a limit.

The limit is the function to which an original program tends as its step size goes to 0.
"""

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
    """A figure of the thesis, drawn with the original or with the corrected programs.

    `finding` has its computed curves. `files` has the content of its files by name: the picture
    (SVG) and the plotted numbers (CSV).
    """

    finding: FigureFinding
    files: dict[str, bytes]


def drawn() -> dict[str, Drawn]:
    """Compute and draw all figures; return each by the name of its files without the suffix."""
    return {
        each.plan.stem: Drawn(each, saved(figure_picture(each), f"{each.plan.stem}.svg"))
        for each in findings()
    }


def together(figures: Mapping[str, Drawn]) -> dict[str, bytes]:
    """Draw the original and the corrected Figure 7 and its limit in one picture.

    `figures` is the result of `drawn`. Return the content of the files by name: the picture (SVG)
    and the plotted numbers (CSV).
    """
    original, corrected = (figures[name].finding for name in ("figure-07", "figure-07-corrected"))
    return saved(together_picture(original, corrected), "figure-07-together.svg")

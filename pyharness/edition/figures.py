"""Figures 6 to 12 of the thesis as pictures for the web site, drawn from computed curves.

A further picture shows Figure 7 with the limit of its original program: the function to which
omega converges as the step size goes to 0.
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

    `finding` has the computed curves of the figure. `files` has the content of two files by name:
    the picture (SVG) and the plotted numbers (CSV).
    """

    finding: FigureFinding
    files: dict[str, bytes]


def drawn() -> dict[str, Drawn]:
    """Compute and draw all figures of the thesis for the web site.

    The result maps the name of a figure's files, without the suffix, to the drawn figure.
    """
    return {
        each.plan.stem: Drawn(each, saved(figure_picture(each), f"{each.plan.stem}.svg"))
        for each in findings()
    }


def together(figures: Mapping[str, Drawn]) -> dict[str, bytes]:
    """Draw the original and the corrected Figure 7 of the thesis and its limit in one picture.

    The limit is the function to which the result of the original program converges as the step size
    goes to 0. `figures` is the result of `drawn`. Return the content of two files by name: the
    picture (SVG) and the plotted numbers (CSV).
    """
    original, corrected = (figures[name].finding for name in ("figure-07", "figure-07-corrected"))
    return saved(together_picture(original, corrected), "figure-07-together.svg")

"""Figures 6 to 12 of the thesis for the web site, drawn from computed curves.

Figures are given by file name without suffix.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pyharness.edition.ledger import SentenceVerdicts
from pyharness.edition.markdown import inline
from pyharness.history.figures import FigureFinding, figure_picture, together_picture
from pyharness.model.facts import facts
from pyharness.views.pictures import saved


def draw_figures(figures: Mapping[str, FigureFinding]) -> dict[str, bytes]:
    """Return the figures, and Figure 7 with its limit, as SVG and CSV.

    Figure 7 with its limit shows the original and the corrected programs, and the limit of omega of
    the original one as the step size goes to 0.
    """
    together = together_picture(figures["figure-07"], figures["figure-07-corrected"])
    files = saved(together, "figure-07-together.svg")
    for stem, each in figures.items():
        files |= saved(figure_picture(each), f"{stem}.svg")
    return files


def printed(
    figures: Mapping[str, FigureFinding], told: Sequence[SentenceVerdicts]
) -> list[dict[str, Any]]:
    """Return the thesis's figures in order, each with its number, caption and place.

    `drawn` has our drawings. `says` has the thesis's sentences on the figure, each with its anchor,
    which is empty for sections I to IV. `ours` is the text for a figure that is not drawn.
    """
    found = []
    for each in facts("figures")["printed"]:
        drawn = {
            stem: figure for stem, figure in figures.items() if figure.plan.number == each["number"]
        }
        cases = {f"V.2, Case {figure.plan.case}" for figure in drawn.values()}
        says = [
            (inline(other.sentence.text), other.anchor)
            for other in told
            if other.sentence.where in cases
        ]
        if "says" in each:
            says = [(inline(each["says"]), "")]
        found.append({**each, "says": says, "ours": inline(each.get("ours", "")), "drawn": drawn})
    return found

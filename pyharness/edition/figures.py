"""Figures 6 to 12 of the thesis for the web site, drawn from computed curves.

Figures are given by file name without suffix.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from markupsafe import Markup

from pyharness.edition.ledger import SentenceVerdicts
from pyharness.edition.markdown import inline
from pyharness.history.figures import FigureFinding, figure_picture, together_picture
from pyharness.model.facts import facts
from pyharness.views.pictures import saved


class Printed(NamedTuple):
    """A figure of the thesis, with our drawings of it by file name without suffix.

    `says` has the thesis's sentences on the figure, each with its anchor, which is empty for
    sections I to IV. `ours` is the text for a figure that is not drawn, else empty.
    """

    number: int
    caption: str
    where: str
    says: list[tuple[Markup, str]]
    ours: Markup
    drawn: dict[str, FigureFinding]

    @property
    def anchor(self) -> str:
        """Return the anchor of a figure that is not drawn, else ""."""
        return "" if self.drawn else f"figure-{self.number:02d}"


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
) -> list[Printed]:
    """Return the thesis's figures in order, with our drawings and its sentences on them."""
    found = []
    for each in facts("figures")["printed"]:
        ours = {
            stem: figure for stem, figure in figures.items() if figure.plan.number == each["number"]
        }
        cases = {f"V.2, Case {figure.plan.case}" for figure in ours.values()}
        says = [
            (inline(other.sentence.text), other.anchor)
            for other in told
            if other.sentence.where in cases
        ]
        if "says" in each:
            says = [(inline(each["says"]), "")]
        found.append(
            Printed(
                each["number"], each["caption"], each["where"], says,
                inline(each.get("ours", "")), ours,
            )
        )  # fmt: skip
    return found

"""Figures 6 to 12 of the thesis for the web site, drawn from computed curves.

Another picture shows Figure 7 with the limit of omega of its original program as the step size goes
to 0.
"""

from collections.abc import Mapping
from typing import NamedTuple

from markupsafe import Markup

from pyharness.edition.markdown import inline
from pyharness.history.claims.sentences import sentences
from pyharness.history.figures import (
    FigureFinding,
    figure_picture,
    findings,
    together_picture,
)
from pyharness.model.facts import facts
from pyharness.views.pictures import saved


class Drawn(NamedTuple):
    """A figure, drawn with original or corrected programs.

    `finding` has the curves; `files` are the SVG and the CSV, by name.
    """

    finding: FigureFinding
    files: dict[str, bytes]


def draw_figures() -> dict[str, Drawn]:
    """Return all figures, by file name without suffix."""
    return {
        each.plan.stem: Drawn(each, saved(figure_picture(each), f"{each.plan.stem}.svg"))
        for each in findings()
    }


def together(figures: Mapping[str, Drawn]) -> dict[str, bytes]:
    """Return Figure 7, original, corrected and with its limit, as SVG and CSV."""
    original, corrected = (figures[name].finding for name in ("figure-07", "figure-07-corrected"))
    return saved(together_picture(original, corrected), "figure-07-together.svg")


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
    drawn: dict[str, Drawn]

    @property
    def anchor(self) -> str:
        """Return the anchor of a figure that is not drawn, else ""."""
        return "" if self.drawn else f"figure-{self.number:02d}"


def printed(figures: Mapping[str, Drawn]) -> list[Printed]:
    """Return the thesis's figures in order, with our drawings from `figures`."""
    found = []
    for each in facts("figures")["printed"]:
        ours = {
            stem: drawing
            for stem, drawing in figures.items()
            if drawing.finding.plan.number == each["number"]
        }
        cases = {f"V.2, Case {drawing.finding.plan.case}" for drawing in ours.values()}
        says = [
            (inline(sentence.text), f"sentence-{number}")
            for number, sentence in enumerate(sentences(), 1)
            if sentence.where in cases
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

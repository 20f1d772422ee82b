"""Figures 6 to 12 of the thesis as pictures for the web site, drawn from computed curves.

A further picture shows Figure 7 with the limit of its original program: the function to which
omega converges as the step size goes to 0.
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


class Printed(NamedTuple):
    """A figure as the thesis has it, beside our drawings of it.

    Attributes
    ----------
    number : int
        The number of the figure in the thesis.
    caption : str
        Its printed caption.
    where : str
        Its place in the thesis.
    says : list of tuple of Markup and str
        What the text of the thesis says of the figure, sentence by sentence, each with the anchor
        of the sentence in the page of the thesis; the anchor is empty for sections I to IV.
    ours : Markup
        What this edition has in place of a figure that it does not draw; empty if it draws it.
    drawn : dict of str to Drawn
        Our drawings of the figure, by the names of their files without the suffix.
    """

    number: int
    caption: str
    where: str
    says: list[tuple[Markup, str]]
    ours: Markup
    drawn: dict[str, Drawn]

    @property
    def anchor(self) -> str:
        """Return the anchor of a figure that is not drawn; our drawings have their own anchors."""
        return "" if self.drawn else f"figure-{self.number:02d}"


def printed(figures: Mapping[str, Drawn]) -> list[Printed]:
    """Return the figures of the thesis in their order, each with our drawings of it.

    `figures` is the result of `drawn`.
    """
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

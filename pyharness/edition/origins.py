"""Links to disagreements of the decks, relative to the site's root."""

from pyharness.edition.markdown import slug
from pyharness.history.origins import Disagreement, disagreements

PAGE = "listing/collation.html"
"""The path of the page of disagreements."""


def origins_of(entry: str) -> list[tuple[str, str]]:
    """Return title and link of each disagreement related to an apparatus entry."""
    return [_linked(each) for each in disagreements() if entry in each.entries]


def origins_of_step(what: str) -> list[tuple[str, str]]:
    """Return title and link of each disagreement in a step of the comparison."""
    return [_linked(each) for each in disagreements() if what in each.steps]


def anchor_of(disagreement: Disagreement) -> str:
    """Return the anchor of a disagreement on its page."""
    return slug(disagreement.title)


def thesis_on(disagreement: Disagreement) -> str:
    """Return the equations and the place in the thesis of a disagreement."""
    given = ", ".join(disagreement.equations)
    noun = "equations" if "," in given or "-" in given else "equation"
    return "; ".join(
        each for each in (f"{noun} {given}" if given else "", disagreement.where) if each
    )


def _linked(each: Disagreement) -> tuple[str, str]:
    return each.title, f"{PAGE}#{anchor_of(each)}"

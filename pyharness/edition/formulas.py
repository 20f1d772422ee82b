"""The formulas of sections II to IV of the thesis, as MathML, with the cards that compute them."""

from collections.abc import Iterator
from typing import NamedTuple

from markupsafe import Markup

from pyharness.edition.markdown import inline
from pyharness.model.facts import facts


class Formula(NamedTuple):
    """A displayed formula of the thesis.

    Attributes
    ----------
    number : str
        The equation's number, as in ``34a``, or numbers, as in ``13-15``; empty if it has none.
    where : str
        The section of the thesis.
    lines : list of Markup
        The lines of the formula as MathML.
    what : Markup
        One sentence that says what the formula is, as HTML.
    cards : dict of str to str
        By program, the numbers of the cards that compute the formula; empty if no card does.
    entry : str
        The entry of the critical apparatus about the formula, or an empty text.
    """

    number: str
    where: str
    lines: list[Markup]
    what: Markup
    cards: dict[str, str]
    entry: str

    @property
    def title(self) -> str:
        """Return the name of the formula, as in ``Equation 34a`` or ``Equations 13-15``."""
        if not self.number:
            return f"Without a number, {self.where}"
        return f"Equation{'s' if '-' in self.number else ''} {self.number}, {self.where}"


def formulas() -> dict[str, list[Formula]]:
    """Return, by section of the thesis, its displayed formulas in their order."""
    found: dict[str, list[Formula]] = {}
    for each in _formulas():
        found.setdefault(each.where.partition(".")[0], []).append(each)
    return found


def _formulas() -> Iterator[Formula]:
    for row in facts("formulas")["formula"]:
        lines = [inline(f"${tex}$") for tex in row["tex"].strip().split("\n")]
        yield Formula(
            row.get("number", ""), row["where"], lines, inline(row["what"]),
            row.get("cards", {}), row.get("entry", ""),
        )  # fmt: skip

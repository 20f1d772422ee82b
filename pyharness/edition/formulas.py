"""The formulas of sections II to IV as MathML, with the cards that compute them."""

from collections.abc import Iterator
from typing import NamedTuple

from markupsafe import Markup

from pyharness.edition.markdown import inline
from pyharness.model.facts import facts


class Formula(NamedTuple):
    """A displayed formula of the thesis.

    `number` is as in ``34a`` or ``13-15``, or empty; `lines` are MathML, `what` is a sentence in
    HTML. `cards` has the numbers of the cards that compute it, by program; `entry` is its apparatus
    entry, or empty.
    """

    number: str
    where: str
    lines: list[Markup]
    what: Markup
    cards: dict[str, str]
    entry: str

    @property
    def title(self) -> str:
        """Return a title, as in ``Equation 34a, III.1`` or ``Equations 13-15, II.2``."""
        if not self.number:
            return f"Without a number, {self.where}"
        return f"Equation{'s' if '-' in self.number else ''} {self.number}, {self.where}"


def formulas() -> dict[str, list[Formula]]:
    """Return the displayed formulas, by section."""
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

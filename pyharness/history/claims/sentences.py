"""The sentences of sections V and VI of the thesis, each with the claims that it makes.

A sentence without claims has the reason why it makes none.
"""

from typing import NamedTuple

from pyharness.model.facts import facts


class Sentence(NamedTuple):
    """A sentence of the thesis with the claims that it makes; fields that do not apply are empty.

    `text` is our reading, with formulas in LaTeX and a line for each that a formula or table has of
    its own, `quote` a few words of it. `why` is the function of a sentence without claims.
    `laboratory` is the run that shows it best, as in ``case=2&program=two-term``; `command`,
    without ``pyharness``, shows more than `claims --explain`.
    """

    where: str
    quote: str
    text: str
    claims: tuple[str, ...] = ()
    why: str = ""
    laboratory: str = ""
    command: str = ""


def sentences() -> tuple[Sentence, ...]:
    """Return the sentences of sections V and VI of the thesis, in order, with their claims."""
    return tuple(
        Sentence(**{**row, "claims": tuple(row.get("claims", ()))})
        for row in facts("sentences")["sentence"]
    )

"""The sentences of sections V and VI of the thesis, with their claims."""

from typing import NamedTuple

from pyharness.model.facts import facts


class Sentence(NamedTuple):
    """A sentence of the thesis with its claims; fields that do not apply are empty.

    `text` is our reading, with formulas in LaTeX, and `quote` a few words of it. `why` tells why a
    sentence has no claims. `laboratory` is the run that shows it best, as in
    ``case=2&program=two-term``. `command` is one that shows more than `claims --explain`.
    """

    where: str
    quote: str
    text: str
    claims: tuple[str, ...] = ()
    why: str = ""
    laboratory: str = ""
    command: str = ""


def sentences() -> tuple[Sentence, ...]:
    """Return the sentences of sections V and VI of the thesis, in order."""
    return tuple(
        Sentence(**{**row, "claims": tuple(row.get("claims", ()))})
        for row in facts("sentences")["sentence"]
    )

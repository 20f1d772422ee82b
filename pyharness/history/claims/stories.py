"""Sentences of the thesis with their claims, and the claims' stories.

The stories in `data/claims.toml` have placeholders for the numbers of our verdicts.
"""

import re
from fnmatch import fnmatchcase
from typing import NamedTuple

from pyharness.history.claims.ledger import Judgement
from pyharness.model.facts import facts

FIELD = re.compile(r"\{(original|corrected): (?:(min|max) of )?(.+?)( in %)?\}")
"""Pattern of a placeholder, as in ``{original: max of case *: gain in %}``.

It has the programs, the name of a number, and perhaps `in %`. After `min of` or `max of` the name
is a wildcard pattern for several numbers, of which the smallest or largest is taken.
"""
_TIMES = "\N{NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Story(NamedTuple):
    """A claim in three sentences, with LaTeX between dollar signs."""

    saw: str
    why: str
    truth: str


def story(judgement: Judgement) -> Story:
    """Return a claim's story, or raise ValueError if a placeholder matches no number."""
    outcomes = {"original": judgement.original, "corrected": judgement.corrected}

    def number(field: re.Match[str]) -> str:
        programs, which, name, percent = field.groups()
        found = outcomes[programs].numbers
        fitting = [
            x for each, x in found.items() if (fnmatchcase(each, name) if which else each == name)
        ]
        if not fitting:
            raise ValueError(f"claim {judgement.claim['id']} has no number {field[0]}")
        x = min(fitting) if which == "min" else max(fitting)
        return f"{prose(100.0 * x)} %" if percent else prose(x)

    return Story(*(FIELD.sub(number, judgement.claim[name]) for name in Story._fields))


def prose(x: float, digits: int = 3) -> str:
    """Return a number as text for a sentence, as web/story/numbers.js writes it."""
    if x == 0 or 1e-3 <= abs(x) < 1e6:
        rounded = float(f"{x:.{digits}g}") + 0.0  # without the sign of -0
        return f"{rounded:,.0f}" if rounded == int(rounded) else f"{rounded:.{digits}g}"
    mantissa, exponent = f"{x:.{digits - 1}e}".split("e")
    return f"{float(mantissa):g}{_TIMES}{power_of_ten(int(exponent))}"


def power_of_ten(exponent: int) -> str:
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"


class Sentence(NamedTuple):
    """A sentence of the thesis with its claims."""

    where: str  # place in the thesis
    quote: str  # a few words of the sentence
    text: str  # with formulas in LaTeX
    claims: tuple[str, ...] = ()
    why: str = ""  # explanation of a sentence without claims
    laboratory: str = ""  # run that shows the claims best, as in case=2&program=two-term
    command: str = ""  # command that shows more than `claims --explain`


def sentences() -> tuple[Sentence, ...]:
    """Return the sentences of sections V and VI of the thesis, in order."""
    return tuple(
        Sentence(**{**row, "claims": tuple(row.get("claims", ()))})
        for row in facts("sentences")["sentence"]
    )

"""Sections V and VI of the thesis, sentence by sentence: which claims judge each, or why none."""

from typing import NamedTuple

from pyharness.model.facts import facts


class Sentence(NamedTuple):
    """A sentence of the thesis; what it does not have is empty.

    Attributes
    ----------
    where : str
        Its section, with the paragraph, the case or the recommendation.
    quote : str
        A few words of it.
    claims : tuple of str
        The claims that judge it.
    why : str
        Where there is none, what the sentence does instead.
    laboratory : str
        The run that shows it best: ``case=2&program=two-term``, in words of the command line.
    command : str
        What shows it better than its claims explained, without ``pyharness``.
    """

    where: str
    quote: str
    claims: tuple[str, ...] = ()
    why: str = ""
    laboratory: str = ""
    command: str = ""


def sentences() -> tuple[Sentence, ...]:
    """Return the sentences in the order of the thesis."""
    return tuple(
        Sentence(**{**row, "claims": tuple(row.get("claims", ()))})
        for row in facts("sentences")["sentence"]
    )

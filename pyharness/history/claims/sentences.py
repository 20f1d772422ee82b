"""The sentences of sections V and VI of the thesis, each with the claims that it makes.

A sentence without claims has the reason why it makes none.
"""

from typing import NamedTuple

from pyharness.model.facts import facts


class Sentence(NamedTuple):
    """A sentence of the thesis with the claims that it makes; fields that do not apply are empty.

    Attributes
    ----------
    where : str
        The section, with the paragraph, the case or the recommendation.
    quote : str
        A few words of the sentence.
    text : str
        The whole sentence in our reading, with formulas in LaTeX. It has a line for each line of
        the thesis that a formula or a table has of its own.
    claims : tuple of str
        The identifiers of the claims that the sentence makes.
    why : str
        For a sentence without claims, its function in the text of the thesis.
    laboratory : str
        The run that shows best what the sentence says, as options of the command `pyharness run`:
        ``case=2&program=two-term``.
    command : str
        A command, without ``pyharness``, that shows more about the sentence's claims than the
        command `pyharness claims --explain` does.
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

"""More names for the calls: truths, programs, history and checks."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from pyharness import ChangingMoments, Scene, subset, torques
from pyharness.checks.external_file import read_problem
from pyharness.checks.theory.rotations import steady_rotations
from pyharness.history.family import Member
from pyharness.thesis.cards import chosen
from pyharness.thesis.decks import deck_text
from pyharness.thesis.vectors import answers
from pyharness.truth.certificate import prove
from pyharness.truth.elliptic import torque_free
from pyharness.truth.enclosure import enclose
from pyharness.truth.reference import reference

__all__ = ["CHANGING", "DAMPED", "GROWING", "TWO", "Member", "answers", "chosen", "deck_text",
           "edited", "enclose", "enclose_free", "prove", "pytest", "read_problem", "reference",
           "steady_rotations", "torque_free"]  # fmt: skip

BRICK = Scene("brick", (0.1, 1.0, 0.2), moments=(1.0, 2.0, 2.5))
CHANGING = Scene(
    "changing", (0.1, 1.0, 1.0), moments=ChangingMoments([[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]])
)
DAMPED = replace(BRICK, torque=torques.damping(0.1))
GROWING = Scene("growing", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))  # 1 / (1 - t)
TWO = subset("two-term")
_FOLDER = TemporaryDirectory()  # beside that of the row, in which no file may be made


def edited(name: str, old: str, new: str) -> Path:
    """Return the path of a copy of a file with another text in place of one that it has."""
    text, copy = Path(name).read_text(), Path(_FOLDER.name, name)
    assert old in text
    copy.write_text(text.replace(old, new))
    return copy


def enclose_free(*given: Any) -> Any:
    """Call the function, if python-flint is installed."""
    pytest.importorskip("flint")
    from pyharness.truth import enclosure_free

    return enclosure_free.enclose_free(*given)

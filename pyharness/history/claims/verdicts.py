"""Verdicts on a claim, and the numbers that they rest on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pyharness.history.claims.laboratory import Laboratory

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
NOT_REPRODUCED = "not reproduced"
FALSE = "false"
NOT_TESTABLE = "not testable"
VERDICTS = (REPRODUCED, IN_PART, NOT_REPRODUCED, FALSE, NOT_TESTABLE)


@dataclass(frozen=True)
class Judged:
    """A verdict with the numbers that it rests on."""

    verdict: str
    numbers: dict[str, float]


Test = Callable[[Laboratory, dict[str, Any]], Judged]


def graded(whole: bool, part: bool, otherwise: str = NOT_REPRODUCED) -> str:
    """Return reproduced, reproduced in part, or otherwise."""
    return REPRODUCED if whole else IN_PART if part else otherwise

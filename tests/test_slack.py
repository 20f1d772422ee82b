"""Slack of `verify` and `stress`: what lies just beyond a limit fails, what lies within passes."""

import ast
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

import pyharness
from pyharness.checks import Check, bounded
from pyharness.selection import Selection
from pyharness.stress import TRIALS, stress
from pyharness.verify import KINDS, verify
from tests.slack import SLACK, Slack

PACKAGE = Path(pyharness.__file__).parent
# A place of the source: file and line.
Place = tuple[str, int]


def _made(id: str) -> list[Check]:
    """Make one check."""
    if id.partition("/")[0] in KINDS:
        return list(verify(Selection(only=[id], seed="fixed", draws=1)))
    return [outcome.check for outcome in stress([id])]


@contextmanager
def _failing(places: set[Place]) -> Iterator[None]:
    """Gather where checks are made that fail."""
    init = Check.__init__

    def seen(self: Check, *rest: Any, **named: Any) -> None:
        init(self, *rest, **named)
        if not self.passed:
            frame = sys._getframe(1)
            if frame.f_code is bounded.__code__ and frame.f_back:
                frame = frame.f_back
            places.add((str(Path(frame.f_code.co_filename).relative_to(PACKAGE)), frame.f_lineno))

    with patch.object(Check, "__init__", seen):
        yield


@cache
def _fared(slack: Slack) -> tuple[bool | None, bool | None, frozenset[Place]]:
    """Return whether the check passed within, and beyond, and where it failed."""
    places: set[Place] = set()
    id = slack.failing or slack.check
    with slack.planted(slack.within):
        within = {check.id: check.passed for check in _made(slack.check)}
    with slack.planted(slack.beyond), _failing(places):
        beyond = {check.id: check.passed for check in _made(slack.check)}
    return within.get(slack.check), beyond.get(id), frozenset(places)


@pytest.mark.parametrize("slack", SLACK, ids=lambda slack: slack.check)
def test_limit_lies_between_the_plants(slack: Slack) -> None:
    within, beyond, _ = _fared(slack)
    assert within is True
    assert beyond is False

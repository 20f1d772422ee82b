"""Slack of `verify` and `stress`: errors just beyond a limit fail, errors just within it pass."""

import ast
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any
from unittest.mock import patch

import pytest

import pyharness
from pyharness.checks.check import Check, Sample
from pyharness.checks.kinds import KINDS, verify
from pyharness.checks.port import port
from pyharness.checks.selection import Selection
from pyharness.checks.stress import TRIALS, stress
from tests.ports import documented_command, sample
from tests.slack.table import SLACK, Slack, kept

PACKAGE = Path(pyharness.__file__).parent
# A place in the source: file and line.
Place = tuple[str, int]


def _made(slack: Slack) -> list[Check]:
    """Make one check."""
    id = slack.check
    if slack.trials is not None:
        return list(stress([id], slack.trials()))
    if id.partition("/")[0] in KINDS:
        return list(verify(Selection(only=[id], seed="fixed", draws=1000)))
    if id.startswith("port/"):
        return list(port(documented_command(), sample([id.removeprefix("port/")])))
    return list(stress([id]))


@contextmanager
def _failing(places: set[Place]) -> Iterator[None]:
    """Collect the places at which failing checks are made."""

    def seeing(init: Callable[..., None]) -> Callable[..., None]:
        def seen(self: Check, *rest: Any, **named: Any) -> None:
            init(self, *rest, **named)
            if not self.passed:
                frame = sys._getframe(1)
                while _is_between(frame.f_code) and frame.f_back:
                    frame = frame.f_back
                file = Path(frame.f_code.co_filename).relative_to(PACKAGE)
                places.add((str(file), frame.f_lineno))

        return seen

    with (
        patch.object(Check, "__init__", seeing(Check.__init__)),
        patch.object(Sample, "__init__", seeing(Sample.__init__)),
    ):
        yield


def _is_between(code: CodeType) -> bool:
    """Whether a function only makes the check that another requests, as `dataclasses` does."""
    is_ours = Path(code.co_filename).is_relative_to(PACKAGE)
    return not is_ours or code.co_name in ("bounded", "judged")


# Modules that compute limits, and that plants do not change.
_KEPT = (
    "checks.judge", "checks.hold", "checks.trials.torque", "checks.trials.scales",
    "checks.trials.attitude",
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _once() -> Iterator[None]:
    """Compute each truth and each conditioning only once."""
    with pytest.MonkeyPatch.context() as patched:
        for room in _KEPT:
            for name in ("conditioning", "reference", "free_attitude"):
                target = f"pyharness.{room}.{name}"
                if hasattr(pkgutil.resolve_name(f"pyharness.{room}"), name):
                    patched.setattr(target, kept(pkgutil.resolve_name(target)))
        yield


@cache
def _fared(slack: Slack) -> tuple[list[Check], list[Check], frozenset[Place]]:
    """Return the checks within the limit and beyond it, and the places of those that failed."""
    places: set[Place] = set()
    with slack.planted(slack.within):
        within = _made(slack)
    with slack.planted(slack.beyond), _failing(places):
        beyond = _made(slack)
    return within, beyond, frozenset(places)


@pytest.mark.parametrize("slack", SLACK, ids=lambda slack: slack.check)
def test_limit_lies_between_the_plants(slack: Slack) -> None:
    within, beyond, _ = _fared(slack)
    own = [check for check in within if check.id == slack.check] or within
    assert own
    assert all(check.passed for check in own)
    assert (slack.failing or slack.check) in [check.id for check in beyond if not check.passed]


def test_every_kind_and_every_trial_has_a_plant() -> None:
    assert {slack.check.partition("/")[0] for slack in SLACK} == {*KINDS, *TRIALS, "port"}


def _sites() -> Iterator[tuple[str, range]]:
    """Yield the places of the source where a check is made that can fail."""
    for path in sorted([*PACKAGE.glob("checks/*.py"), *PACKAGE.glob("checks/trials/*.py")]):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and _may_fail(node):
                last = node.end_lineno or node.lineno
                yield str(path.relative_to(PACKAGE)), range(node.lineno, last + 1)


def _may_fail(call: ast.Call) -> bool:
    """Whether a call makes a check, and not always one that passed."""
    if not isinstance(call.func, ast.Attribute) or call.func.attr not in ("bounded", "judged"):
        return False
    return not (call.args and getattr(call.args[0], "value", None) is True)


def test_every_place_that_makes_a_check_is_seen_to_fail() -> None:
    places = {place for slack in SLACK for place in _fared(slack)[2]}
    sites = list(_sites())
    assert len(sites) > 50
    unseen = [
        f"{file}:{lines.start}"
        for file, lines in sites
        if not any((file, line) in places for line in lines)
    ]
    assert unseen == []

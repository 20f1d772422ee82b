"""The campaign against proved solutions: a few of its scenes, and planted errors."""

import math
from fractions import Fraction

import pytest

from pyharness import solve
from pyharness.model.trajectory import Trajectory
from pyharness.truth.enclosed import Balls
from tests import proved


def test_no_promise_is_broken_in_a_few_scenes() -> None:
    pytest.importorskip("flint")
    tally = proved.campaign(8, "a few")
    assert not tally.broken
    assert all(tally.counts[f"{group} scenes"] == 2 for group in ("free", "short", "law", "state"))
    assert {"law auto", "state auto", "law reference", "law precise"} <= tally.largest.keys()
    assert "0 promises broken" in tally.table()


def test_a_wrong_result_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*arguments: object, **options: object) -> Trajectory:
        found = solve(*arguments, **options)  # type: ignore[arg-type]
        found.omega[-1, 1] *= 1.001
        return found

    monkeypatch.setattr(proved, "solve", wrong)
    tally = proved.campaign(1, "a few", 2)
    assert tally.broken
    assert "python -m tests.proved 1 a few 2" in tally.broken[0]


def test_distance_is_rounded_up() -> None:
    balls = Balls((Fraction(1), Fraction(2)), Fraction(1, 8))
    assert proved.distance([1.0, 2.5], balls) == 0.625
    assert proved.distance([1.0, math.pi], balls) >= math.pi - 2.0 + 0.125

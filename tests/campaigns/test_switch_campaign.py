"""Tests of the campaign of random controlled bodies."""

import math
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from pyharness import Trajectory, solve
from tests.campaigns import driver, switch_campaign
from tests.campaigns.switch_campaign import MODULE, truth_of, try_scene
from tests.campaigns.switched import SlidingError
from tests.campaigns.switched_scenes import Controlled, controlled


def _damped(m: Any, t: Any, w: Any, q: Any, states: Any) -> Any:
    return {0: m.clip(-0.5 * w[0], -0.1, 0.1)}, {}


def _braked(m: Any, t: Any, w: Any, q: Any, states: Any) -> Any:
    return {0: 0.1 - 0.2 * m.above(w[0], 0.0)}, {}


def test_the_truth_has_the_closed_form() -> None:
    """Omega decreases by 0.1 each second to 0.1/0.5 = 0.2, and then as exp(-t/2)."""
    body = Controlled([0.3, 0.0, 0.0], [1.0, 1.0, 1.0], [_damped], 4.0, {})
    truth, _, crossings = truth_of(body, [0.5, 1.5, 4.0])
    wanted = [0.25, 0.2 * math.exp(-0.25), 0.2 * math.exp(-1.5)]
    assert truth.omega[:, 0] == pytest.approx(wanted, rel=1e-15)
    assert crossings == 1
    assert truth.scale == 0.3


def test_the_truth_slides() -> None:
    body = Controlled([0.25, 0.0, 0.0], [1.0, 1.0, 1.0], [_braked], 4.0, {})
    with pytest.raises(SlidingError) as error:
        truth_of(body, [4.0])
    assert error.value.args[0] == pytest.approx(2.5, rel=1e-15)


def test_no_result_exceeds_the_limit() -> None:
    tally = driver.campaign(MODULE, try_scene, 4, "test")
    assert tally.faults == []
    assert tally.counts["sliding: sliding"] == 1
    assert max(tally.ratios["controlled: error"]) < 1.0


def test_a_wrong_result_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*args: Any, **keywords: Any) -> Trajectory:
        found = solve(*args, **keywords)
        return replace(found, omega=found.omega * 1.1, ended="complete")

    monkeypatch.setattr(switch_campaign, "solve", wrong)
    tally = driver.campaign(MODULE, try_scene, 1, "test", 2)
    assert any("controlled: error: error 0.09" in each for each in tally.faults)
    assert any("estimate" in each for each in tally.faults)


def test_scenes_have_one_to_three_elements() -> None:
    source = Random("elements")
    for _ in range(20):
        kinds, body = controlled(source)
        assert len(body.elements) + int(body.table is not None) <= 1 + len(kinds.split(" + ")) <= 4

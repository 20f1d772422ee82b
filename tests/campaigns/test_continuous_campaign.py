"""Tests of the campaign of dense output and events."""

from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve
from pyharness.model.dense_output import Pieces
from tests.campaigns import continuous_campaign, driver
from tests.campaigns.continuous_campaign import KINDS, MODULE, Drawn, drawn, main, try_scene
from tests.conftest import Capture, Patch


def test_no_result_exceeds_the_limit() -> None:
    tally = driver.campaign(MODULE, try_scene, 40 * len(KINDS), "test")
    assert tally.faults == []
    assert tally.counts["left out"] <= 40
    assert tally.counts["roots"] > 1000


def test_the_truth_is_an_integral() -> None:
    def torque(t: Any, w: Any, states: Any) -> Any:
        return [0.0, 0.0, 3.0 * t**2], {"x": np.cos(t)}

    def rates(t: Any) -> Any:
        return [0.0 * t, 0.0 * t, 3.0 * t**2, np.cos(t)]

    body = Scene("", (0.0, 0.0, 0.5), moments=(1.0, 1.0, 1.0), torque=torque, states={"x": 2.0})
    times = np.array([-1.0, -0.3, 0.0, 0.2, 2.0])
    found = Drawn(body, (-1.0, 2.0), rates=rates).truth(times)
    assert found[2] == pytest.approx(0.5 + times**3, rel=1e-15)
    assert found[3] == pytest.approx(2.0 + np.sin(times), rel=1e-15)
    assert Drawn(body, (-1.0, 2.0)).truth(times) == pytest.approx(found, rel=1e-13, abs=1e-13)


def test_polynomials_have_all_degrees() -> None:
    degrees = set()
    for number in range(400):
        function = continuous_campaign.polynomial(Random(f"degree {number}"), 1.0)
        samples = np.abs([function(x) for x in (1e6, 1e7)])
        degrees.add(round(float(np.log10(samples[1] / samples[0]))))
    assert degrees == set(range(continuous_campaign.MOST_DEGREE + 1))


@pytest.mark.parametrize("fault", ["nodes", "root", "lost", "twice"])
def test_a_wrong_result_is_reported(fault: str, monkeypatch: Patch, capsys: Capture) -> None:
    right = Pieces.__call__

    def wrong(*args: Any, **keywords: Any) -> Any:
        found: Any = solve(*args, **keywords)
        for k, roots in enumerate(found.t_events or ()):
            roots = roots + 0.01 if fault == "root" else roots[:-1] if fault == "lost" else roots
            found.t_events[k] = np.append(roots, roots) if fault == "twice" else roots
        return found

    monkeypatch.setattr(continuous_campaign, "solve", wrong)
    if fault == "nodes":
        monkeypatch.setattr(Pieces, "__call__", lambda own, times: right(own, times) * 1.01)
    assert main(["3", "wrong"]) == 1
    shown = {"nodes": ": sol: error", "root": ": root: error"}.get(fault, "where the sign changes")
    assert shown in capsys.readouterr().out


def test_kinds_are_drawn() -> None:
    names = [drawn(Random(f"kind {k}"), "kind", k).scene.name for k in range(len(KINDS))]
    assert names[:6] == list(KINDS[:6])

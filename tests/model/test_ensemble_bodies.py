"""An ensemble is a sequence of trajectories."""

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, InputError, Scene, solve, solve_many

STARTS = np.random.default_rng(3).normal(size=(5, 3))
SCENE = Scene("b", (0.1, 1.0, 0.2), moments=(1.0, 2.0, 3.0), attitude=(1, 0, 0, 0))
WHEEL = Scene("w", (0.1, 1.0, 0.2), moments=(1.0, 2.0, 3.0), states={"h": 0.5},
              torque=lambda t, w, s: ([0.0, 0.0, -s["h"]], {"h": w[2]}))  # fmt: skip


@pytest.mark.parametrize("scene", [SCENE, WHEEL], ids=["attitude", "states"])
@pytest.mark.parametrize("when", [{"t_end": 2.0}, {"times": [1.0, 2.0, 4.0]}])
def test_each_body_is_the_trajectory_of_its_scene(scene: Scene, when: dict[str, Any]) -> None:
    found = solve_many(scene, omega=STARTS, estimates=True, **when)
    assert len(found) == len(list(found)) == 5
    times = when.get("times", [2.0])
    for k, body in enumerate(found):
        alone = solve(dataclasses.replace(scene, omega=tuple(STARTS[k])), times)
        assert body.t.tolist() == times
        assert body.y == pytest.approx(alone.y, abs=1e-9)
        assert body.y == pytest.approx(found.y[k].reshape(body.y.shape), abs=0.0)
        assert body.success
        assert body.error < 1e-9
        assert body.message == alone.message
    assert found.success.tolist() == [True] * 5
    assert found[-1].y.tolist() == found[4].y.tolist()
    assert [each.y.tolist() for each in found[1:3]] == [found[1].y.tolist(), found[2].y.tolist()]
    with pytest.raises(IndexError):
        found[5]
    assert next(itertools.islice(found, 3, None)).omega.tolist() == found[3].omega.tolist()
    if scene is SCENE:
        assert found[2].rotation().as_quat() == pytest.approx(
            found[2].attitude[:, [1, 2, 3, 0]], abs=1e-12
        )


def test_final_times_and_rotations_of_all_bodies(tmp_path: Path) -> None:
    found = solve_many(SCENE, np.arange(1.0, 6.0), omega=STARTS)
    assert found.t.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert found[3].t.tolist() == [4.0]
    assert found.rotation().as_quat()[2] == pytest.approx(found[2].rotation().as_quat()[0])
    found.save(tmp_path / "many.npz")
    assert Ensemble.load(tmp_path / "many.npz").t.tolist() == found.t.tolist()
    again = solve_many(SCENE, 2.0, omega=STARTS, out=found)
    assert again is found
    assert again.t.tolist() == [2.0] * 5
    rows = solve_many(SCENE, times=[1.0, 2.0], omega=STARTS)
    with pytest.raises(InputError, match="several times"):
        rows.rotation()
    with pytest.raises(InputError, match="no attitudes"):
        solve_many(dataclasses.replace(SCENE, attitude=None), 1.0).rotation()


def test_missing_results_are_left_out_and_told() -> None:
    moments = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, -3.0], [1.0, 2.0, 3.0]])
    found = solve_many(SCENE, times=[1.0, 2.0], moments=moments, sensitivities=["omega"])
    assert found.success.tolist() == [True, False, True]
    body = found[1]
    assert (body.success, body.ended, body.t.size) == (False, "refused", 0)
    assert "I3 is -3" in body.message
    assert "3 bodies at 2 times" in found.message
    assert "2 refused" in found.message
    assert found[2].sensitivities["omega"].shape == (2, 7, 3)
    html = found._repr_html_()
    assert html.count("<details>") == 3
    assert "omega1" in html


def test_events_of_a_body() -> None:
    def zero(t: Any, w: Any) -> Any:
        return w[0]

    found = solve_many(SCENE, 20.0, omega=STARTS, events=zero)
    alone = solve(dataclasses.replace(SCENE, omega=tuple(STARTS[1])), 20.0, events=zero)
    assert found[1].t_events[0] == pytest.approx(alone.t_events[0], abs=1e-8)
    assert found[1].y_events[0].shape == alone.y_events[0].shape

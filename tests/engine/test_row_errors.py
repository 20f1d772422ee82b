"""Up to which row a result is right: `error_at` and `trusted_until`."""

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, opaque, solve


def tumbling(t: Any, w: Any, q: Any) -> list[Any]:
    return [0.9 * np.sin(1.1 * t) * q[1], 0.7 * q[2] * q[3], 0.8 * np.cos(0.7 * t) * q[1]]


LAW = TorqueLaw(sines=[((0.9, 0.7, 0.0), 1.1)], cosines=[((0.0, 0.3, 0.8), 0.7)])
TOP = Scene("top", (0.1, 0.9, 0.4), (1.0, 2.1, 2.9), torque=tumbling, attitude=(1, 0.1, 0, 0.3))
SCENES = {
    "attitude": (TOP, 300.0),
    "law": (Scene("law", (0.1, 0.9, 0.4), (1.0, 2.1, 2.9), torque=LAW), 300.0),
    "later": (dataclasses.replace(TOP, t0=20.0), 320.0),
    "backwards": (TOP, -300.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_rows_are_right_until_the_time_that_is_stated(name: str) -> None:
    scene, end = SCENES[name]
    times = np.linspace(scene.t0, end, 61)[1:]
    found = solve(scene, times)
    assert found.ended == "sensitive"
    row = times.tolist().index(found.trusted_until)
    assert 5 < row < 55
    right = solve(scene, times[: row + 6], tolerance=1e-14)
    error = np.abs(found.omega[: row + 6] - right.omega) / np.abs(found.omega).max()
    assert error[: row + 1].max() < 1e-9
    assert found.error_at(times[row]) <= 1e-9 < found.error_at(times[row + 1]) <= found.error
    assert found.error_at(times[row + 5]) > error[row + 5].max()
    again = pickle.loads(pickle.dumps(found))
    assert again.error_at(times[row]) is again.trusted_until is None


def test_what_is_known_without_another_solution() -> None:
    scene = Scene("free", (0.1, 1.0, 0.2), moments=(1.0, 2.0, 3.0))
    found = solve(scene, [1.0, 5.0])
    assert found.ended == "complete"
    assert found.trusted_until == 5.0
    assert 0.0 < found.error_at(0.5) < 1e-12
    with pytest.raises(InputError, match="error_at: 6 s; allowed: times from 0 to 5 s"):
        found.error_at(6.0)
    assert solve(scene, [-1.0, 1.0]).trusted_until is None
    # The second result is that of a solver which the scene keeps.
    assert None is not solve(scene, 5.0).error_at(0.5) == solve(scene, 5.0).error_at(0.5)
    called = dataclasses.replace(scene, torque=opaque(lambda t, w: -0.1 * w))
    assert solve(called, [1.0, 2.0]).error_at(1.0) is None
    assert solve(scene, 1.0, "rk4").trusted_until is None

"""Many bodies that differ in parameters of their recorded torque, and in moments."""

from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve, solve_many
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.torques import damping, recorded

MOMENTS = (1.0, 2.0, 2.5)


def law(t: Any, omega: Any, *, gain: float = 0.3, push: float = 0.1) -> Any:
    return -gain * omega * np.sqrt(1.0 + omega @ omega) + np.array([0.0, push * np.sin(t), 0.0])


def pointed(t: Any, omega: Any, attitude: Any, *, stiffness: float = 1.0) -> Any:
    return -stiffness * attitude[1:] - 0.2 * omega


EXPRESSION = {
    "expression": ["-k*w1*w1*w1", "-k*w2 + 0.1*sin(t)", "-0.2*w3"], "constants": {"k": 0.4},
}  # fmt: skip


def drawn(n: int, seed: int = 5) -> dict[str, Any]:
    draw = np.random.default_rng(seed)
    return {
        "omega": draw.normal(size=(n, 3)), "moments": draw.uniform(1.0, 2.0, (n, 3)),
        "t_end": draw.uniform(-0.2, 9.0, n), "gain": draw.uniform(0.1, 0.5, n),
    }  # fmt: skip


@pytest.mark.parametrize("with_moments", [False, True])
@pytest.mark.parametrize("kind", ["law", "attitude", "expression", "sum", "coefficients"])
def test_each_body_is_solved_to_the_tolerance(kind: str, with_moments: bool) -> None:
    given = drawn(23)
    torque: Any = {"law": law, "attitude": pointed, "sum": damping(0.05) + recorded(law)}.get(kind)
    name = {"attitude": "stiffness", "expression": "k"}.get(kind, "gain")
    body: dict[str, Any] = {"moments": MOMENTS}
    if kind == "coefficients":
        torque, body = law, {"coefficients": (0.3, -0.4, 0.2)}
    if kind == "expression":
        start = {"omega": [1.0, 0.0, 0.0]}
        torque = scene_of({"body": body, "initial": start, "torque": EXPRESSION}, "").torque
    scene = Scene("many", (1.0, 0.0, 0.0), torque=torque, **body)
    arrays: dict[str, Any] = {"attitude": (0.5, 0.5, 0.5, 0.5)} if kind == "attitude" else {}
    if with_moments:
        arrays["moments"] = given["moments"]
    found = solve_many(
        scene, given["t_end"], omega=given["omega"], parameters={name: given["gain"]},
        tolerance=1e-8, estimates=True, **arrays,
    )  # fmt: skip
    assert found.has_result.all()
    assert found.error is not None
    assert found.growth is not None
    alike = solve_many(scene, given["t_end"], omega=given["omega"], tolerance=1e-8, **arrays)
    assert np.abs(alike.omega - found.omega).max() > 1e-3
    for i in range(0, 23, 3):
        value = float(given["gain"][i])
        own: Any = {
            "attitude": lambda t, w, q, value=value: pointed(t, w, q, stiffness=value),
            "law": lambda t, w, value=value: law(t, w, gain=value),
        }
        own["sum"] = lambda t, w, value=value: law(t, w, gain=value) - 0.05 * w
        own["coefficients"] = own["law"]
        own["expression"] = lambda t, w, k=value: [
            -k * w[0] ** 3, -k * w[1] + 0.1 * np.sin(t), -0.2 * w[2]
        ]  # fmt: skip
        of_row = {"moments": tuple(given["moments"][i])} if with_moments else body
        one = Scene(
            "one", tuple(given["omega"][i]), torque=own[kind],
            attitude=arrays.get("attitude"), **of_row,
        )  # fmt: skip
        truth = solve(
            one, [0.0, given["t_end"][i]][:: 1 if given["t_end"][i] > 0 else -1], tolerance=1e-13,
            attitude=kind == "attitude",
        )  # fmt: skip
        last = -1 if given["t_end"][i] > 0 else 0
        allowed = np.abs(truth.omega).max() * (1e-8 + 4e-15 * found.growth[i])
        assert np.abs(found.omega[i] - truth.omega[last]).max() <= allowed
        if truth.attitude is not None and found.attitude is not None:
            apart = np.abs(found.attitude[i]) - np.abs(truth.attitude[last])
            assert np.abs(apart).max() <= 0.5e-8 + 4e-15 * found.growth[i]


def test_no_bit_depends_on_other_bodies() -> None:
    scene, given = Scene("many", (1.0, 0.0, 0.0), MOMENTS, torque=law), drawn(19)
    every = solve_many(
        scene, 4.0, omega=given["omega"], moments=given["moments"],
        parameters={"gain": given["gain"]}, threads=2,
    )  # fmt: skip
    for i in (0, 7, 18):
        one = solve_many(
            scene, 4.0, omega=given["omega"][i], moments=given["moments"][i],
            parameters={"gain": float(given["gain"][i])},
        )  # fmt: skip
        assert one.omega[0].tolist() == every.omega[i].tolist()


def test_invalid_bodies_are_refused_alone() -> None:
    scene = Scene("many", (1.0, 0.5, 0.0), MOMENTS, torque=law)
    moments = [MOMENTS, (-1.0, 1.0, 1.0), MOMENTS, (1.0, np.nan, 1.0), MOMENTS]
    gains = [0.1, 0.1, np.nan, 0.1, np.inf]
    found = solve_many(scene, 3.0, moments=moments, parameters={"gain": gains})
    assert found.status.tolist() == [0, 3, 3, 3, 3]
    assert np.isnan(found.omega[1:]).all()


def test_rows_events_and_sensitivities_are_those_of_a_scene_with_the_value() -> None:
    scene = Scene("many", (1.0, 0.5, -0.2), MOMENTS, torque=law)
    asked: dict[str, Any] = {
        "sensitivities": ["torque.gain", "omega"],
        "events": lambda t, omega: omega[0] - 0.5,
    }
    found = solve_many(scene, times=[1.0, 4.0], parameters={"gain": [0.1, 0.4]}, **asked)
    own = Scene("own", scene.omega, MOMENTS, torque=lambda t, w, *, gain=0.4: law(t, w, gain=gain))
    one = solve(own, [1.0, 4.0], **asked)
    assert found.omega[1] == pytest.approx(one.omega, rel=1e-11, abs=1e-12)
    assert found.t_events is not None
    assert found.t_events[0][1] == pytest.approx(one.t_events[0], rel=1e-10)
    assert found.sensitivities is not None
    assert one.sensitivities is not None
    assert found.sensitivities["torque.gain"][1] == pytest.approx(
        one.sensitivities["torque.gain"], rel=1e-7, abs=1e-9
    )


def test_a_torque_of_time_alone_has_parameters_too() -> None:
    def wave(t: Any, omega: Any, *, size: float = 0.3) -> Any:
        return [size * np.sin(t), 0.0, 0.0]

    scene = Scene("law", (1.0, -0.5, 0.7), MOMENTS, torque=wave)
    found = solve_many(scene, 3.0, parameters={"size": [0.1, 0.3]})
    assert found.omega[1] == pytest.approx(solve(scene, 3.0).omega[0], rel=1e-11)
    assert np.abs(found.omega[0] - found.omega[1]).max() > 0.1


def test_constants_of_expressions_beside_own_states() -> None:
    """The state x is a sine of frequency k, and omega3 its integral."""
    data = {
        "body": {"moments": [4, 3, 2]}, "initial": {"omega": [0, 0, 0.8]},
        "torque": {
            "expression": ["0", "0", "2*x"], "constants": {"k": 1.5},
            "terms": [{"kind": "wheels", "momentum": [0, 0, 1]}],
        },
        "states": {"x": {"rate": "v"}, "v": {"start": 1, "rate": "-k*k*x"}},
    }  # fmt: skip
    scene, k, t = scene_of(data, ""), np.array([1.5, 0.7]), 2.0
    found = solve_many(scene, t, parameters={"k": k}, tolerance=1e-11)
    assert found.omega[:, 2] == pytest.approx(0.8 + (1.0 - np.cos(k * t)) / k**2, rel=1e-10)
    assert found.states["x"] == pytest.approx(np.sin(k * t) / k, rel=1e-10)
    slopes = solve(scene, t, sensitivities=["torque.k"]).sensitivities
    assert slopes is not None
    angle = 1.5 * t
    slope = t * np.sin(angle) / 1.5**2 - 2.0 * (1.0 - np.cos(angle)) / 1.5**3
    assert slopes["torque.k"][0, 2, 0] == pytest.approx(slope, rel=1e-8)

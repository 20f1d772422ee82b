"""Scenes that begin at another time than 0, and trajectories that are continued."""

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import (
    ChangingInertia,
    ChangingMoments,
    InputError,
    Scene,
    Stepper,
    TorqueLaw,
    load,
    opaque,
    prepare,
    solve,
    solve_many,
)
from pyharness.model.expressions import parsed
from pyharness.torques import damping, pulses, recorded, table

replace: Any = dataclasses.replace  # its types know no functions as torques
TIMES = [3.7, 5.0, 6.5, 8.0]
GRID = np.linspace(0.0, 10.0, 11)
VALUES = np.stack([np.sin(GRID), 0.1 * GRID, 0.0 * GRID], axis=1)
WAVES: dict[str, Any] = {
    "sines": [((0.1, 0.0, 0.2), 1.3)], "cosines": [((0.3, 0.1, 0.0), 0.7)],
}  # fmt: skip


def with_switch(t: Any, w: Any, *, k: float = 0.3) -> list[Any]:
    return [np.sin(t) - k * w[0], np.where(t > 4.5, 0.2, -0.1), 0.1 * t]


def with_attitude(t: Any, w: Any, q: Any) -> list[Any]:
    return [np.sin(t) * q[0], 0.1 * q[1] * t, 0.0]


def with_state(t: Any, w: Any, s: Any) -> Any:
    return [-s["h"], np.cos(2 * t), 0.0], {"h": np.sin(t) + w[0]}


TORQUES: dict[str, Any] = {
    "none": TorqueLaw(),
    "law": TorqueLaw((0.1, 0.2, 0.0), (0.01, 0.0, 0.02), **WAVES),
    "space": TorqueLaw((0.1, 0.2, 0.0), (0.01, 0.0, 0.02), frame="space", **WAVES),
    "switch": with_switch,
    "attitude": with_attitude,
    "state": with_state,
    "expression": parsed(["a*sin(t)", "-0.1*w2", "0.1*t"], {"a": 0.2}),
    "table": table(GRID, VALUES),
    "series": lambda t, w: [np.interp(t, GRID, VALUES[:, 0]), 0.0, -0.1 * w[2]],
    "pulses": pulses([1.0, 4.2, 6.0], [0.5, 0.6, 0.1], (0.3, 0.1, 0.0)),
    "sum": table(GRID, VALUES) + damping(0.1) + recorded(with_switch),
    "opaque": opaque(lambda t, w: [np.sin(t) - 0.1 * w[0], 0.1 * t, 0.0]),
}
MOMENTS = {"moments": (1.0, 2.0, 3.0)}
FIRST = [[4, 1, 0], [1, 3, 0], [0, 0, 2]], [[0, 0.1, 0], [0.1, 0, 0], [0, 0, 0.3]]
BODIES: dict[str, dict[str, Any]] = {
    "matrix": {"inertia": [[3, 0.2, 0.1], [0.2, 2, 0.3], [0.1, 0.3, 2.5]]},
    "coefficients": {"coefficients": (0.3, -0.4, 0.2)},
    "polynomials": {"moments": ChangingMoments([[4, 0.1, 0.01], [3, 0.2], [2, 0, 0.02]])},
    "matrices": {"inertia": ChangingInertia(FIRST)},
    "function": {"moments": lambda t: [3 + np.sin(t), 3.0, 2.0 + 0.1 * t]},
}
PAIRS = [("moments", each) for each in TORQUES]
PAIRS += [(body, each) for body in BODIES for each in ("none", "switch", "state")]


def scene_of(body: str, torque: str) -> Scene:
    more: dict[str, Any] = {"states": {"h": 0.3}} if torque == "state" else {}
    given = TORQUES[torque]
    shape = BODIES.get(body, MOMENTS)
    return Scene("x", (0.3, 1.0, -0.5), attitude=(1, 0.2, 0.1, 0), torque=given, **shape, **more)


def crossing(torque: str) -> Any:
    if torque == "state":
        return lambda t, w, s: w[1] - 0.2 * np.sin(t)
    return lambda t, w: w[1] - 0.2 * np.sin(t)


@pytest.mark.parametrize(("body", "torque"), PAIRS)
def test_continued_motion_is_the_motion(body: str, torque: str) -> None:
    more: dict[str, Any] = {"events": crossing(torque), "dense_output": True, "attitude": True}
    whole = solve(scene_of(body, torque), TIMES, **more)
    scene = whole.scene_at(TIMES[0])
    rest = solve(scene, TIMES[1:], **more)
    assert rest.time.tolist() == TIMES[1:]
    assert rest.scene is scene
    assert rest.y == pytest.approx(whole.y[:, 1:], abs=1e-9)
    (events,), (later,) = whole.t_events or [], rest.t_events or []
    assert later == pytest.approx(events[events > TIMES[0]], abs=1e-9)
    assert whole.sol is not None
    assert rest.sol is not None
    sol = pickle.loads(pickle.dumps(rest.sol)) if torque == "none" else rest.sol
    assert sol(5.3) == pytest.approx(whole.sol(5.3), abs=1e-9)
    assert sol.derivative(5.3) == pytest.approx(whole.sol.derivative(5.3), abs=1e-8)
    assert solve(scene, [0.0]).omega[0] == pytest.approx((0.3, 1.0, -0.5), abs=1e-9)
    if body != "coefficients":
        assert rest.power() == pytest.approx(whole.power()[1:], abs=1e-9)
        assert rest.angular_momentum() == pytest.approx(whole.angular_momentum()[1:], abs=1e-8)
    if torque != "opaque":
        stepper = Stepper(scene)
        assert stepper.until(TIMES[-1]) == stepper.time == TIMES[-1]
        assert stepper.omega == pytest.approx(rest.omega[-1], abs=1e-8)


@pytest.mark.parametrize("direction", [0, 1, -1])
def test_phases_find_each_root_once(direction: int) -> None:
    def zero(t: Any, w: Any) -> Any:
        return w[0]

    zero.direction = direction  # type: ignore[attr-defined]
    scene = Scene("b", (0.1, 1.0, 0.1), moments=(1.0, 2.0, 3.0), torque=(0.01, 0.0, 0.0))
    (right,) = solve(scene, 60.0, events=zero).t_events or []
    zero.terminal = True  # type: ignore[attr-defined]
    seen: list[float] = []
    while (found := solve(scene, 60.0, events=zero)).status == 1:
        scene = found.scene_at()
        seen.append(scene.t0)
    assert len(right) > 2
    assert seen == pytest.approx(right.tolist(), abs=1e-7)


def test_a_phase_may_have_another_torque() -> None:
    first = solve(scene_of("moments", "law"), 5.0)
    second = replace(first.scene_at(), torque=TorqueLaw(sines=[((1.0, 0.0, 0.0), 2.0)]))
    right = replace(second, t0=0.0, torque=lambda t, w: [np.sin(2.0 * (t + 5.0)), 0.0, 0.0])
    assert solve(second, 6.0).omega == pytest.approx(solve(right, 1.0).omega, abs=1e-10)


@pytest.mark.parametrize("torque", ["none", "law", "switch", "state", "sum"])
def test_many_bodies_begin_at_their_times(torque: str) -> None:
    scene = replace(scene_of("moments", torque), t0=2.5)
    right = solve(scene, [4.0, 6.0])
    rows = solve_many(scene, times=[4.0, 6.0])
    assert rows.times is not None
    assert rows.times.tolist() == [4.0, 6.0]
    assert rows.omega[0] == pytest.approx(right.omega, abs=1e-9)
    assert solve_many(scene, [6.0]).omega[0] == pytest.approx(right.omega[1], abs=1e-9)
    if torque == "state":
        return
    scenes = [scene, replace(scene, t0=3.0)]
    found = solve_many(scenes, [4.0, 6.0]).omega
    assert found[0] == pytest.approx(right.omega[0], abs=1e-9)
    assert found[1] == pytest.approx(solve(scenes[1], 6.0).omega[0], abs=1e-9)
    with pytest.raises(InputError, match="times: the scenes differ in t0"):
        solve_many(scenes, times=[4.0, 6.0])


def test_many_events_are_at_true_times() -> None:
    scene = replace(scene_of("moments", "switch"), t0=2.5)
    (one,) = solve(scene, 20.0, events=crossing("")).t_events or []
    (many,) = solve_many(scene, 20.0, events=crossing("")).t_events or []
    assert one.size
    assert many[0] == pytest.approx(one, abs=1e-9)


def test_reasons_and_errors_have_true_times() -> None:
    def singular(t: Any, w: Any) -> list[Any]:
        return [np.sqrt(7.0 - t), 0.0, 0.0]

    def sliding(t: Any, w: Any) -> list[Any]:
        return [-np.sign(w[0] + t - 7.0) * 4.0, 0.0, 0.0]

    scene = replace(scene_of("moments", "none"), t0=5.0, torque=singular)
    assert "at t = 7 s" in solve(scene, 9.0).message
    scene = Scene("s", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=sliding, t0=5.0)
    message = solve(scene, 9.0).message
    assert "from t = 5.2 s on" in message
    assert "it is the sign of w1 + t - 7" in message or "it is the sign of t + w1 - 7" in message
    shrinking = ChangingMoments([[4.0, -0.5], [3.0], [2.0]])
    with pytest.raises(InputError, match="reaches 0 at t = 8 s"):
        solve(Scene("s", (1.0, 0.0, 0.0), moments=shrinking, t0=5.0), 9.0)


@pytest.mark.parametrize("name", ["torque.a", "torque.k", "omega", "moments", "torque.constant"])
def test_sensitivities_of_a_later_scene(name: str) -> None:
    kind = {"torque.a": "expression", "torque.k": "switch", "torque.constant": "law"}
    scene = replace(scene_of("moments", kind.get(name, "law")), t0=2.5)
    found = solve(scene, 4.0, "taylor", sensitivities=[name]).sensitivities
    h, column = 1e-6, 0

    def moved(by: float) -> Any:
        if name == "torque.a":
            return replace(scene, torque=parsed(["a*sin(t)", "-0.1*w2", "0.1*t"], {"a": 0.2 + by}))
        if name == "torque.k":
            return replace(scene, torque=lambda t, w: with_switch(t, w, k=0.3 + by))
        if name == "torque.constant":
            law: Any = scene.torque
            return replace(scene, torque=replace(law, constant=(0.1 + by, 0.2, 0.0)))
        key = {"omega": "omega", "moments": "moments"}[name]
        x, y, z = getattr(scene, key)
        return replace(scene, **{key: (x + by, y, z)})

    up, down = (solve(moved(by), 4.0, "taylor", 1e-13).omega[0] for by in (h, -h))
    assert found is not None
    assert found[name][0, :3, column] == pytest.approx((up - down) / (2 * h), abs=1e-6)


def test_what_a_later_scene_refuses() -> None:
    scene = replace(scene_of("moments", "law"), t0=2.5)
    with pytest.raises(InputError, match=r"torque.rate of a scene with t0 = 2.5 s"):
        solve(scene, 4.0, "taylor", sensitivities=["torque.rate"])
    with pytest.raises(InputError, match=r"begins at t0 = 2.5 s; allowed: 0"):
        prepare(scene)
    with pytest.raises(InputError, match="t0"):
        replace(scene, t0=float("inf"))
    found = solve(scene, [3.0, 4.0])
    with pytest.raises(InputError, match=r"no row or event is at 3.5 s"):
        found.scene_at(3.5)
    with pytest.raises(InputError, match="the attitude was not computed"):
        solve(scene, 3.0, attitude=False).scene_at()
    with pytest.raises(InputError, match="the trajectory has no scene"):
        replace(found, scene=None).scene_at()


def test_files_keep_the_start_time(tmp_path: Path) -> None:
    scene = replace(scene_of("moments", "law"), t0=2.5)
    found = solve(scene, [3.0, 4.0])
    found.save(tmp_path / "found.npz")
    assert load(tmp_path / "found.npz").scene == scene
    assert solve(load(tmp_path / "found.npz").scene_at(), 5.0).omega == pytest.approx(
        solve(found.scene_at(), 5.0).omega
    )

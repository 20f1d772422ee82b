"""The estimated errors and amplifications that `solve_many` returns for each body."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, solve, solve_many
from pyharness.model.trajectory import Array

MANY: Any = solve_many  # whose results may lack estimates
BASE = Scene("body", (0.3, -0.4, 1.2), moments=(3.0, 2.0, 1.0))
DAMPED = Scene(
    "damped",
    BASE.omega,
    moments=BASE.moments,
    torque=lambda t, w: [-0.1 * w[0], 0.2 * w[1] * w[2], -0.1 * w[2] ** 3],
)
N = 300
RNG = np.random.default_rng(2611)
STARTS = RNG.standard_normal((N, 3))
BODIES = {
    "free": {"moments": RNG.uniform(1.0, 3.0, (N, 3))},
    "constant": {"torque_constant": RNG.standard_normal((N, 3))},
    "waves": {"sines": RNG.standard_normal((N, 2, 4))},
}
ATTITUDE = {"attitude": RNG.standard_normal((N, 4))}
SCENES: dict[str, tuple[Scene, dict[str, Any]]] = {
    **{name: (BASE, own) for name, own in BODIES.items()},
    **{f"{name} with attitude": (BASE, own | ATTITUDE) for name, own in BODIES.items()},
    "recorded": (DAMPED, {}),
    "recorded with attitude": (DAMPED, ATTITUDE),
    "inertia": (BASE, {"inertia": np.diag([3.0, 2.0, 1.0]) + 0.1 * (1.0 - np.eye(3))} | ATTITUDE),
    "in space": (replace(BASE, torque=TorqueLaw(frame="space")),
                 {"torque_constant": [0.1, 0.2, 0.3]} | ATTITUDE),
}  # fmt: skip


def solved(name: str, tolerance: float = 1e-9, t_end: Any = 3.0, **more: Any) -> Any:
    scene, own = SCENES[name]
    return MANY(scene, t_end, omega=STARTS, tolerance=tolerance, **own, **more)


def largest(name: str) -> Array:
    scales = [np.abs(solved(name, 1e-6, t).omega).max(axis=1) for t in np.linspace(0.0, 3.0, 25)]
    found: Array = np.max(scales, axis=0)
    return found


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.campaign] * (name == "in space")) for name in SCENES],
)
def test_estimates_are_not_below_the_errors(name: str) -> None:
    scale, truth = largest(name), solved(name, 1e-14)
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        found = solved(name, tolerance, estimates=True)
        assert found.has_result.all()
        assert not np.isnan(found.error).any()
        # No method measures the amplification under a torque about the axes of space.
        assert (found.growth >= 1.0).all()
        error = np.abs(found.omega - truth.omega).max(axis=1) / scale
        if found.attitude is not None:
            away = [np.linalg.norm(found.attitude + s * truth.attitude, axis=1) for s in (1, -1)]
            error = np.maximum(error, 2.0 * np.min(away, axis=0))
        # The error of the truth itself, which is amplified.
        ratio = error / (found.error + 2e-15 * np.nan_to_num(found.growth, nan=100.0))
        assert np.quantile(ratio, 0.98) <= 1.0
        assert ratio.max() < 5.0
        # They are estimates of the error, not the tolerance or infinity.
        assert np.median(found.error) <= max(tolerance, 4e-14)


@pytest.mark.parametrize("name", SCENES)
def test_estimates_change_no_bit_and_do_not_depend_on_the_threads(name: str) -> None:
    without, found = solved(name), solved(name, estimates=True)
    assert without.error is without.growth is without.estimates is None
    for each in ("omega", "attitude", "status"):
        np.testing.assert_array_equal(getattr(found, each), getattr(without, each))
    assert solved(name, estimates=True, threads=3, out=found) is found
    np.testing.assert_array_equal(found.estimates, solved(name, estimates=True).estimates)


def test_growth_is_that_of_the_motion() -> None:
    # Without torque it is an upper bound, from the invariants of the motion.
    for name, most in (("free", 500.0), ("constant", 4.0), ("recorded", 2.0)):
        scene, own = SCENES[name]
        found = solved(name, estimates=True)
        for i in range(0, N, 30):
            given: Any = {key: tuple(each[i]) for key, each in own.items()}
            if "torque_constant" in given:
                given["torque"] = TorqueLaw(constant=given.pop("torque_constant"))
            one = replace(scene, omega=tuple(STARTS[i]), **given)
            growth: Any = solve(one, 3.0, "taylor", 1e-9).growth
            assert 0.5 * growth <= found.growth[i] <= most * growth


def test_bodies_that_are_solved_alone_have_the_estimates_of_a_single_call() -> None:
    # The exact middle axis, and a time of 0, are left by the kernel for many bodies.
    starts = np.array([[0.0, 2.0, 0.0], [1e-9, 2.0, 1e-9]])
    found = MANY(BASE, [3.0, 0.0], omega=starts, tolerance=1e-12, estimates=True)
    solver = prepare(BASE, tolerance=1e-12)
    for i, time in enumerate((3.0, 0.0)):
        solver(starts[i], time)
        assert found.growth[i] == pytest.approx(solver.growth, rel=1e-6)
        assert found.error[i] == pytest.approx(solver.error, rel=1e-6, abs=0.0)
    assert found.growth[0] > 40.0


def test_unknown_estimates_are_nan() -> None:
    starts = np.array([[0.3, 0.2, 0.1], [np.nan, 1.0, 1.0]])
    found = MANY(BASE, 1.0, omega=starts, estimates=True)
    assert np.isnan(found.estimates).tolist() == [[False, False], [True, True]]
    found = MANY(DAMPED, 1.0, omega=starts, estimates=True)
    assert np.isnan(found.estimates).tolist() == [[False, False], [True, True]]
    found = MANY(BASE, 1.0, omega=starts, method="rk4", estimates=True)
    assert np.isnan(found.error).all()


def test_many_scenes_have_estimates() -> None:
    scenes = [replace(DAMPED, omega=(0.1, 0.2, 0.3)), BASE, replace(BASE, omega=(1.0, 2.0, 3.0))]
    found = MANY(scenes, 2.0, estimates=True)
    alone = [MANY([each], 2.0, estimates=True).estimates[0] for each in scenes]
    np.testing.assert_array_equal(found.estimates, alone)
    # The moments of scenes in a list are data of their equations, those of one scene are constants.
    plain = [MANY(each, 2.0, estimates=True).estimates[0] for each in scenes]
    np.testing.assert_allclose(found.estimates, plain, rtol=1e-3)


def test_long_steps_hide_no_amplification() -> None:
    omega, end, tolerance = (0.18674826, -3.25642659, -1.20781679), 38.05315613443448, 5.8e-5

    def torque(t: Any, w: Any) -> Any:
        first = 0.2 / (1.0 + w[0] ** 2) - 0.1 * w[0]
        return [first, w[2] / (1.2 + np.sin(t)), -0.2 * np.tanh(3.0 * w[2])]

    scene = Scene("amplified", omega, moments=(1.0, 2.0, 2.5), torque=torque)
    found: Any = solve_many(scene, end, omega=[omega], tolerance=tolerance, estimates=True)
    truth = solve(scene, end, tolerance=1e-12).omega[-1]
    assert np.abs(found.omega[0] - truth).max() <= tolerance * np.abs(omega).max()
    assert found.growth[0] > 1e4


@pytest.mark.parametrize("time", [2.994238392143583, 3.2519603690527905, 4.131954592862878])
def test_error_of_a_strongly_damped_body_does_not_grow(time: float) -> None:
    """In a block of steps its perturbations underflow, and the error of each step is added."""
    rate = 1.5e4
    body = Scene(
        "damped", (0, 0, 1), moments=(1, 2, 2),
        torque=lambda t, w: -2 * rate * w + np.array([0, 0, 2 * rate * np.cos(t)]),
    )  # fmt: skip
    exact = (rate * rate * np.cos(time) + rate * np.sin(time)) / (rate * rate + 1.0)
    alone: Any = solve(body, time, tolerance=1e-6)
    many = MANY(body, time, omega=[(0, 0, 1)] * 2, tolerance=1e-6, estimates=True)
    assert alone.ended == "complete"
    assert (many.status == 0).all()
    for omega, error in ((alone.omega[-1], alone.error), *zip(many.omega, many.error, strict=True)):
        assert abs(omega[2] - exact) < 1e-14
        assert error < 1e-9

"""Torques whose terms nearly cancel: results are accurate, or their status is `sensitive`.

Each term, divided by a moment, is rounded by itself. Waves of one frequency are added first. The
rounding of the other terms is in the error estimate, at every entry point.
"""

import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, solve, solve_many
from pyharness.engine.methods.sensitivity import torque_noise
from pyharness.model.scene import Triple
from pyharness.model.torque_law import Wave
from pyharness.truth.reference import reference
from tests.checks.scenes.cancelling import LEFT, MERGED, cancelling


def _triple(source: random.Random, size: float) -> Triple:
    return source.gauss(0.0, size), source.gauss(0.0, size), source.gauss(0.0, size)


_TIME = 1.5


def _truth(scene: Scene) -> tuple[np.ndarray, float]:
    found = reference(scene, [_TIME * k / 8.0 for k in range(1, 9)])
    return found.omega[-1], max(float(np.abs(found.omega).max()), *map(abs, scene.omega))


@pytest.mark.parametrize("kind", [*MERGED, *LEFT])
@pytest.mark.parametrize("number", range(5))
def test_every_entry_point_is_right_or_says_that_it_is_not(kind: str, number: int) -> None:
    scene = cancelling(kind, number)
    truth, largest = _truth(scene)
    law = scene.law

    def rows(waves: tuple[Wave, ...]) -> np.ndarray:
        return np.array([[[*amplitude, frequency] for amplitude, frequency in waves]] * 3)

    starts = np.array([scene.omega] * 3)
    bare = replace(scene, torque=TorqueLaw())
    for tolerance in (1e-12, 1e-6):
        answers: list[tuple[str, str, np.ndarray, float | None]] = []
        for method in ("auto", "gauss-4"):
            found = solve(scene, [_TIME], method, tolerance)
            answers.append((method, found.ended, found.omega[-1], found.error))
        for method in ("auto", "taylor"):
            solver = prepare(scene, method, tolerance)
            omega = solver(scene.omega, _TIME)
            answers.append((f"prepared {method}", solver.status, omega, solver.error))
        many = solve_many([scene] * 3, _TIME, tolerance=tolerance)
        answers.append(("many", str(many.ended[1]), many.omega[1], None))
        many = solve_many(
            bare, _TIME, omega=starts, torque_constant=np.array([law.constant] * 3),
            sines=rows(law.sines), cosines=rows(law.cosines), tolerance=tolerance,
        )  # fmt: skip
        answers.append(("arrays", str(many.ended[1]), many.omega[1], None))
        for name, ended, omega, estimate in answers:
            error = float(np.abs(omega - truth).max()) / largest
            where = f"{name} to {tolerance:g}: error {error:g}, estimate {estimate}"
            assert ended in ("complete", "sensitive"), where
            if kind in MERGED:
                assert ended == "complete", where
            if ended == "complete":
                assert error <= 2.0 * tolerance + 4e-14, where
            else:
                assert tolerance < 1e-6 or error > 1e-10, where
            assert estimate is None or error <= 10.0 * estimate, where


def test_a_sphere_knows_what_rounding_leaves() -> None:
    for number in range(8):
        scene = replace(cancelling("near frequencies", number), moments=(1.5, 1.5, 1.5))
        truth, largest = _truth(scene)
        found: Any = solve(scene, [_TIME], "closed-form", 1e-13)
        error = float(np.abs(found.omega[0] - truth).max()) / largest
        assert error <= 10.0 * found.error
        assert (found.ended == "sensitive") == (found.error > 1e-13)
        solver = prepare(scene, "closed-form", 1e-13)
        solver(scene.omega, _TIME)
        assert (solver.status, solver.error) == (found.ended, found.error)


def test_quick_says_what_rounding_leaves() -> None:
    seen = set()
    for number in range(12):
        scene = replace(cancelling("near frequencies", number), omega=(0.3, -0.2, 0.5))
        truth, largest = _truth(scene)
        solver: Any = prepare(scene, "quick", 1e-11)
        omega = solver(scene.omega, _TIME)
        seen.add(solver.status)
        if np.isfinite(omega).all():
            error = float(np.abs(omega - truth).max()) / largest
            assert error <= 10.0 * solver.error
            assert solver.status == "sensitive" or error <= 1e-11
    assert "sensitive" in seen


def test_gauss_sees_soon_that_no_step_will_do() -> None:
    seen = 0
    for number in range(8):
        for kind in LEFT:
            found = solve(cancelling(kind, number), [_TIME], "gauss-4", 1e-12)
            seen += found.ended == "sensitive"
            assert found.evaluations < 20_000
    assert seen >= 8


def test_ordinary_torques_have_no_noise() -> None:
    source = random.Random("ordinary")
    for _ in range(50):
        waves = [(_triple(source, 1.0), source.uniform(0.1, 5.0)) for _ in range(2)]
        law = TorqueLaw(_triple(source, 1.0), sines=waves[:1], cosines=waves[1:])
        scene = Scene("", _triple(source, 1.0), moments=(1.0, 2.0, 2.5), torque=law)
        assert torque_noise(scene, scene.omega, source.uniform(0.1, 50.0)) == 0.0
    assert (
        torque_noise(replace(scene, torque=TorqueLaw((1.0, 2.0, 3.0))), (1.0, 1.0, 1.0), 9.0) == 0
    )


def test_noise_is_what_the_terms_give_over_what_they_give_together() -> None:
    amplitude = (1.0, 0.0, 0.0)
    law = TorqueLaw(sines=[(amplitude, 1.0), ((-1.0, 0.0, 0.0), 1.0 + 1e-8)])
    scene = Scene("", (0.0, 1e-6, 0.0), moments=(1.0, 2.0, 2.5), torque=law)
    # Each wave contributes half of t**2, relative to the largest omega.
    assert torque_noise(scene, scene.omega, 0.1) == pytest.approx(0.01 / 1e-6, rel=0.1)
    # Steps round at random too; and if a scale is given, it replaces the largest omega.
    walk = torque_noise(scene, scene.omega, 0.1, 100.0) / torque_noise(scene, scene.omega, 0.1)
    assert walk == pytest.approx(1.0 + 2.0 * 0.1, rel=0.05)
    assert torque_noise(scene, scene.omega, 0.1, scale=1e-4) == pytest.approx(100.0, rel=0.1)
    assert torque_noise(scene, scene.omega, 0.1, scale=1.0) == 0.0
    assert torque_noise(scene, scene.omega, 0.0) == 0.0
    # A cosine contributes all of t, and is rounded at its whole amplitude in every step.
    law = TorqueLaw(cosines=[(amplitude, 1.0), ((-1.0, 0.0, 0.0), 1.0 + 1e-8)])
    scene = replace(scene, torque=law)
    assert torque_noise(scene, scene.omega, 0.1) == pytest.approx(0.2 / 1e-6, rel=0.1)
    walk = torque_noise(scene, scene.omega, 0.1, 100.0) / torque_noise(scene, scene.omega, 0.1)
    assert walk == pytest.approx(1.0 + 0.1, rel=0.02)


def test_a_torque_in_space_that_cancels_is_told_of() -> None:
    amplitude = (1e9, -2e9, 1e9)
    law = TorqueLaw(sines=[(amplitude, 1.0), ((-1e9, 2e9, -1e9), 1.0 + 1e-9)], frame="space")
    scene = Scene("", (0.3, 0.2, 0.1), moments=(1.0, 1.5, 2.0), torque=law)
    found: Any = solve(scene, [1.0], "auto", 1e-12, attitude=True)
    assert found.ended == "sensitive"
    assert 1e-9 < found.error < 1e-5
    alone = replace(
        scene, torque=TorqueLaw(sines=[(amplitude, 1.0), (amplitude, -1.0)], frame="space")
    )
    assert solve(alone, [1.0], "auto", 1e-12, attitude=True).ended == "complete"


def test_scipy_says_so_too() -> None:
    seen = set()
    for number in range(4):
        scene = cancelling("near frequencies", number)
        ours = solve(scene, [_TIME], "taylor", 1e-11)
        found = solve(scene, [_TIME], "dop853", 1e-11)
        seen.add(found.ended)
        assert found.ended == ours.ended
        assert found.error is None
        assert found.evaluations < 50_000
    assert seen == {"complete", "sensitive"}

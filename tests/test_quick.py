"""Runge-Kutta for few digits: within its tolerance, also on scenes that it was not tuned on."""

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare
from pyharness.reference import reference
from pyharness.scene import Triple, Wave


def _triple(values: np.ndarray) -> Triple:
    first, second, third = (float(x) for x in values)
    return first, second, third


def random_scene(generator: np.random.Generator) -> Scene:
    """Return a body, a start and a torque of any kind, over two orders of magnitude each."""
    moments = np.sort(generator.uniform(1.0, 10.0, 3))
    moments[2] = min(moments[2], 0.999 * (moments[0] + moments[1]))
    kind = generator.integers(5)

    def size(low: float, high: float) -> np.ndarray:
        values: np.ndarray = generator.normal(size=3) * 10.0 ** generator.uniform(low, high)
        return values

    def waves() -> tuple[Wave, ...]:
        return tuple(
            (_triple(size(-1, 2)), float(10.0 ** generator.uniform(-0.5, 2.5)))
            for _ in range(generator.integers(1, 3))
        )

    law = TorqueLaw(
        _triple(size(-1, 2) * (kind != 0)),
        _triple(size(-1, 1) * (kind in (2, 4))),
        waves() if kind >= 3 else (),
        waves() if kind == 4 else (),
    )
    start = _triple(size(-1, 1))
    return Scene("", start, moments=_triple(generator.permutation(moments)), torque=law)


def test_tolerance_holds_on_random_scenes() -> None:
    """The estimate sees what few steps show: one in a hundred may exceed it, none by much."""
    generator = np.random.default_rng(1982)
    ratios = []
    for _ in range(60):
        scene = random_scene(generator)
        t_end = float(10.0 ** generator.uniform(-1.0, 0.7))
        times = [t_end * k / 10.0 for k in range(1, 11)]
        truth = reference(scene, times).omega
        scale = max(np.abs(truth).max(), max(map(abs, scene.omega)))
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-6):
            for method in ("quick", "auto"):
                solver = prepare(scene, method, tolerance)
                found = solver(np.array(scene.omega), t_end)
                assert solver.status == "complete"
                ratios.append(np.abs(found - truth[-1]).max() / (scale * tolerance))
    assert np.mean(np.array(ratios) > 1.0) <= 0.01
    assert max(ratios) < 5.0
    # And it is no series in disguise: errors are near what was asked for.
    assert np.percentile(ratios, 90) > 1e-2


def test_every_instruction_set(level: int) -> None:
    for case in (3, 4, 5, 6, 7):
        scene = case_scene(case)
        truth = reference(scene, [1.5])
        for tolerance in (1e-2, 1e-4, 1e-6):
            found = prepare(scene, "quick", tolerance)(np.array(scene.omega), 1.5)
            assert np.abs(found - truth.omega[0]).max() <= tolerance * np.abs(truth.omega).max()


def test_fast_weak_waves_are_averaged_and_their_integral_is_exact() -> None:
    """Case 7 to 1e-3: a few steps for 300 radians of torque."""
    scene = case_scene(7)
    solver = prepare(scene, "quick", 1e-3)
    found = solver(np.array(scene.omega), 3.0)
    truth = reference(scene, [3.0]).omega[0]
    assert solver.steps < 20
    assert np.abs(found - truth).max() < 1e-3 * np.abs(truth).max()
    # For more digits the waves are resolved.
    finer = prepare(scene, "quick", 1e-7)
    finer(np.array(scene.omega), 3.0)
    assert finer.steps > 150


def test_strong_or_resonant_waves_are_not_averaged() -> None:
    """A wave in step with the precession pumps it: averaging would miss all of it."""
    law = TorqueLaw(sines=(((20.0, 0.0, 0.0), 5.0),))
    scene = Scene("", (0.0, 1.0, 10.0), moments=(40.0, 40.1, 20.0), torque=law)
    truth = reference(scene, [5.0]).omega[0]
    found = prepare(scene, "quick", 1e-4)(np.array(scene.omega), 5.0)
    assert np.abs(found - truth).max() < 1e-4 * np.abs(truth).max()


def test_body_that_can_not_be_scaled_is_left_to_the_series() -> None:
    """A symmetric body has a zero coefficient: quick refuses, auto goes on."""
    scene = Scene("", (0.0, 1.0, 2.0), moments=(3.0, 3.0, 1.0), torque=TorqueLaw((1.0, 0.0, 0.0)))
    quick = prepare(scene, "quick", 1e-3)
    assert np.isnan(quick(np.array(scene.omega), 1.0)).all()
    assert quick.status == "refused"
    auto = prepare(scene, tolerance=1e-3)
    truth = reference(scene, [1.0]).omega[0]
    np.testing.assert_allclose(auto(np.array(scene.omega), 1.0), truth, atol=1e-2)


@pytest.mark.parametrize(
    "signs", [(1, 1, 1), (-1, -1, -1), (1, -1, 1), (-1, 1, -1), (1, 1, -1), (-1, 1, 1)]
)
def test_every_pattern_of_signs(signs: tuple[int, int, int]) -> None:
    coefficients = _triple(np.array([0.3, 0.7, 0.5]) * signs)
    law = TorqueLaw((0.2, -0.1, 0.3), (0.0, 0.1, 0.0), (((0.1, 0.2, 0.3), 2.0),))
    for torque in (law, TorqueLaw((0.2, -0.1, 0.3))):
        scene = Scene("", (0.4, -0.3, 0.2), coefficients=coefficients, torque=torque)
        for t_end in (1.0, -1.0):
            truth = reference(scene, [t_end]).omega[0]
            found = prepare(scene, "quick", 1e-5)(np.array(scene.omega), t_end)
            assert np.abs(found - truth).max() < 1e-5 * max(np.abs(truth).max(), 0.4)


def test_run_away_is_an_overflow_and_nothing_hangs() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    solver = prepare(scene, "quick", 1e-3)
    assert np.isnan(solver(np.array(scene.omega), 2.0)).all()
    assert solver.status in ("overflow", "gave up")

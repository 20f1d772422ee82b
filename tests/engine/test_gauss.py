"""Gauss collocation: its coefficients, its order, its invariants, and the steps it chooses."""

import math
import runpy
from dataclasses import replace
from decimal import Decimal, localcontext
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene, solve
from pyharness.engine.plan.registry import GAUSS, METHODS
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference
from tests.checks.scenes.timed_kinds import timed_scenes
from tests.engine.tolerance_scenes import motions
from tests.within import check_error

_MAKER = Path(__file__).parent.parent.parent / "fortran/make_gauss.py"
_STAGES = range(1, 9)
_SPHERE = Scene("", (1.0, 1.0, 1.0), moments=(1.0, 1.0, 1.0), torque=TorqueLaw((1.0, 2.0, 3.0)))


def _run(scene: Scene, times: list[float], stages: int, step: float, effort: float = 1.0) -> Any:
    """Return rows, omega after the last good step, its time, row count, status, evaluations."""
    return extension().gauss_solution(
        *normalized(scene), scene.omega, times, stages, step, effort=effort
    )


def _end(scene: Scene, times: list[float], stages: int, step: float) -> Array:
    rows, _, n_rows, status, _ = _run(scene, times, stages, step)
    assert (n_rows, status) == (len(times), 0)
    result: Array = rows.T
    return result


@pytest.mark.skipif(not _MAKER.exists(), reason="needs a checkout")
@pytest.mark.parametrize("stages", _STAGES)
def test_coefficients_agree_with_mpmath(stages: int) -> None:
    maker = SimpleNamespace(**runpy.run_path(str(_MAKER)))
    with localcontext(prec=maker.DIGITS), mpmath.workdps(70):
        nodes = maker.nodes(stages)
        assert nodes == sorted(set(nodes))
        for node in nodes:
            assert abs(mpmath.legendre(stages, 2 * mpmath.mpf(str(node)) - 1)) < 1e-50
        weights = maker.integrals(nodes, Decimal(0), Decimal(1))
        rows = [maker.integrals(nodes, Decimal(0), c) for c in nodes]
        # The integrals of 1 ... c**(s-1) are exact, which determines the matrix.
        for power in range(stages):
            for row, end in zip([*rows, weights], [*nodes, Decimal(1)], strict=True):
                total = sum(a * c**power for a, c in zip(row, nodes, strict=True))
                assert abs(total - end ** (power + 1) / (power + 1)) < Decimal("1e-50")
        # With this condition the method conserves quadratic invariants.
        for i, j in np.ndindex(stages, stages):
            left = weights[i] * rows[i][j] + weights[j] * rows[j][i]
            assert abs(left - weights[i] * weights[j]) < Decimal("1e-50")


# Steps for which the error is far above rounding, and its leading term dominates.
_STEPS = {
    4: ((40, 80), (40, 80), (20, 40), (10, 20), (10, 20), (6, 12), (5, 9), (5, 8)),
    7: ((40, 80), (20, 40), (8, 16), (5, 10), (3, 6), (2, 4), (2, 3), (2, 4)),
}


@pytest.mark.parametrize(
    ("case", "stages", "steps"),
    [(case, s, steps[s - 1]) for case, steps in _STEPS.items() for s in _STAGES],
)
def test_order_is_twice_the_stages(case: int, stages: int, steps: tuple[int, int]) -> None:
    law = TorqueLaw()
    if case == 7:
        law = TorqueLaw(rate=case_scene(7).law.rate, sines=(((9.0, 9.0, 0.0), 3.0),))
    scene = replace(case_scene(case), torque=law)
    end = 3.0
    truth = reference(scene, [end]).omega[0]
    errors = [np.abs(_end(scene, [end], stages, end / n) - truth).max() for n in steps]
    slope = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert slope == pytest.approx(2 * stages, abs=0.9)


@pytest.mark.parametrize("method", GAUSS)
def test_finest_tolerance_is_met(method: str) -> None:
    finest = METHODS[method].finest
    for name, motion in motions("cases").items():
        found = solve(motion.scene, motion.times, method, finest)
        check_error(motion, found.omega, None, finest, name, steps=found.steps)
        assert np.abs(found.omega - motion.omega).max() <= (finest + 1e-15) * motion.largest
        assert 0 < found.steps < found.evaluations


@pytest.mark.parametrize(
    ("kind", "seed"), [("from rest", 16), *(("nearly symmetric", seed) for seed in (8, 10, 18))]
)
def test_long_steps_of_high_order_are_not_trusted(kind: str, seed: int) -> None:
    """If both steps are too long to show the order, their difference is too small an estimate."""
    for scene, t_end in islice(timed_scenes(kind, seed), 25):
        truth = solve(scene, [t_end], "taylor", 1e-14).omega[0]
        found = solve(scene, [t_end], "gauss-8", 1e-10).omega[0]
        scale = max(np.abs(truth).max(), *map(abs, scene.omega))
        assert np.abs(found - truth).max() <= 1e-10 * scale


@pytest.mark.parametrize("stages", [4, 5])
def test_what_rounding_takes_off_is_carried_in_long_steps(stages: int) -> None:
    """60 000 steps of a third of a radian: without all parts of double-doubles energy drifts."""
    scene = case_scene(4)
    moments = np.array(scene.moments)
    rows = _end(scene, [300.0 * k for k in range(1, 61)], stages, 0.3)
    for weight in (moments, moments**2):
        start = weight @ np.array(scene.omega) ** 2
        # The method conserves these invariants whatever its truncation error; only rounding is
        # left.
        assert np.abs(rows**2 @ weight / start - 1.0).max() <= 6e-15


@pytest.mark.parametrize("stages", _STAGES)
def test_right_hand_sides_are_counted_at_every_node(stages: int) -> None:
    """A constant rate is found, gets its low part, and is confirmed."""
    *_, status, evaluations = _run(_SPHERE, [0.5], stages, 0.5)
    assert status == 0
    assert evaluations in (2 * stages, 3 * stages)


@pytest.mark.parametrize(("stages", "step"), [(1, 2.5), (2, 3.0), (3, 4.0), (4, 4.5), (5, 5.0)])
def test_iterations_that_do_not_end_are_counted_and_no_more(stages: int, step: float) -> None:
    scene = Scene("", (1.0, 1.0, 1.0), moments=(3.0, 2.0, 1.5))
    assert _run(scene, [step], stages, step)[3:] == (4, 60 * stages)


def test_rates_of_the_last_step_spare_iterations() -> None:
    """Every requested time starts anew, without the rates of the last step."""
    together, apart = (
        _run(case_scene(5), times, 4, 0.01)[-1]
        for times in ([1.0], [0.01 * k for k in range(1, 101)])
    )
    assert together < 0.8 * apart


def test_time_that_was_reached_is_told() -> None:
    """For omega = 1/(1 - t), the steps continue after a first result at 0.5 until near 1."""
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    _, reached, _, status, _ = _run(scene, [0.5, 2.0], 4, 0.01)
    assert status != 0
    assert 0.9 < reached[0] < 1.1


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, int]]:
    """Return a list to which every call of the kernel appends its step and its evaluations."""
    solution = extension().gauss_solution
    calls: list[tuple[float, int]] = []

    def watched(*arguments: Any, **named: Any) -> Any:
        found = solution(*arguments, **named)
        calls.append((arguments[-1], found[-1]))
        return found

    room = SimpleNamespace(gauss_solution=watched)
    monkeypatch.setattr("pyharness.engine.methods.gauss.extension", lambda: room)
    return calls


def test_steps_and_right_hand_sides_of_all_tries_are_told(calls: list[tuple[float, int]]) -> None:
    found = solve(case_scene(5), [0.5, 1.2], "gauss-3", 1e-9)
    assert len(calls) > 2
    assert found.evaluations == sum(evaluations for _, evaluations in calls)
    assert found.steps == sum(math.ceil(length / calls[-1][0]) for length in (0.5, 1.2 - 0.5))


def test_time_and_right_hand_sides_of_a_refusal(
    calls: list[tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pyharness.engine.methods.gauss._MOST_EVALUATIONS", 50_000)
    with pytest.raises(InputError) as refusal:
        solve(case_scene(3), [10.0, 20.0], "gauss-2", 1e-11)
    spent = sum(evaluations for _, evaluations in calls)
    assert f"t = 20 s after {spent} " in str(refusal.value)
    assert spent > 25_000


@pytest.mark.parametrize("parts", [3, 7, 10])
def test_step_that_divides_the_time_but_for_rounding_is_not_cut_once_more(parts: int) -> None:
    """A tenth is no binary fraction: 0.3/0.1 is below 3, and other quotients are just above."""
    for time in (0.1 * parts, sum([0.1] * parts)):
        one = _run(_SPHERE, [time], 1, time)[-1]
        assert _run(_SPHERE, [time], 1, 0.1)[-1] <= one * parts
    # No step is longer than the given one.
    scene = case_scene(3)
    for whole, count in ((0.35, 4), (0.301, 4), (0.3, 3)):
        found = _end(scene, [whole], 3, 0.1)
        np.testing.assert_array_equal(found, _end(scene, [whole], 3, whole / count))


def test_waves_count_among_right_hand_sides_before_any_is_taken() -> None:
    waves = tuple(((1e-3, 0.0, 0.0), float(k)) for k in range(1, 21))
    scene = Scene("", (1.0, 2.0, 3.0), moments=(3.0, 2.0, 1.0), torque=TorqueLaw(sines=waves))
    for effort, count in ((1.0, 1), (0.5e-6, 0)):
        assert _run(scene, [0.1], 1, 0.01, effort)[2] == count

"""The reported error of an attitude if omega has no error: spins about one axis.

The attitude is then an elementary rotation about that axis by the integral of omega, computed here
to many digits. The scenes are drawn at random.
"""

import math
from itertools import islice
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene, prepare, solve
from pyharness.model.trajectory import Array
from tests.checks.scenes.timed_kinds import SPINS, timed_scenes
from tests.exact_attitude import times as hamilton

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
ROUNDING = 2.0**-53
# Relative to the angle of rotation (rad): a smaller error is the rounding of a double, not an error
# of the method.
_DOUBT = 1e-15


def _angle_errors(scene: Scene, times: Array | list[float], attitudes: Array) -> list[float]:
    """Return the angle (rad) from the true attitude at each time, for a spin about one axis."""
    assert scene.attitude is not None
    assert scene.moments is not None
    law = scene.law
    vectors = [scene.omega, law.constant, law.rate, *(amplitude for amplitude, _ in law.sines)]
    axis = int(np.argmax(np.abs(vectors).max(axis=0)))
    found = []
    with mpmath.workdps(40):
        moment = mpmath.mpf(scene.moments[axis])
        for time, attitude in zip(map(mpmath.mpf, times), attitudes, strict=True):
            gained = mpmath.mpf(law.constant[axis]) * time**2 / 2
            gained += mpmath.mpf(law.rate[axis]) * time**3 / 6
            for amplitude, frequency in law.sines:
                turn = mpmath.mpf(frequency) * time
                gained += mpmath.mpf(amplitude[axis]) * (turn - mpmath.sin(turn)) / frequency**2
            half = (mpmath.mpf(scene.omega[axis]) * time + gained / moment) / 2
            spun = [mpmath.cos(half), 0, 0, 0]
            spun[1 + axis] = mpmath.sin(half)
            length = mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in scene.attitude))
            true = hamilton([mpmath.mpf(x) / length for x in scene.attitude], spun)
            back = [true[0], -true[1], -true[2], -true[3]]
            apart = hamilton(back, [mpmath.mpf(float(x)) for x in attitude])
            found.append(float(2 * mpmath.sqrt(sum(x**2 for x in apart[1:]))))
    return found


@pytest.mark.parametrize("kind", SPINS)
def test_reported_error_is_no_less_than_a_tenth_of_the_true_one(kind: str) -> None:
    scenes = timed_scenes(f"spin: {kind}", [25, SPINS.index(kind)])
    judged = 0
    for number, (scene, time) in enumerate(islice(scenes, 60)):
        tolerance = TOLERANCES[number % len(TOLERANCES)]
        times = [time] if number % 2 else [0.3 * time, 0.7 * time, time]
        found: Any = solve(scene, times, "taylor", tolerance, attitude=True)
        error = max(_angle_errors(scene, times, found.attitude))
        turned = 1.0 + float(np.abs(found.omega).max()) * abs(time)
        # About the axis of the middle moment perturbations grow, but here there are none.
        assert found.ended == "sensitive" or max(error, found.error) <= tolerance
        assert found.error >= 0.1 * (error - _DOUBT * turned), (number, tolerance)
        judged += error > 10.0 * _DOUBT * turned
    assert judged > 10 or kind == "slow"


def test_prepared_solver_reports_it_too() -> None:
    judged = 0
    for scene, time in islice(timed_scenes("spin: constant", 2501), 40):
        solver: Any = prepare(scene, "auto", 1e-3, attitude=True)
        _, attitude = solver(scene.omega, time)
        (error,) = _angle_errors(scene, [time], np.array([attitude]))
        assert solver.error >= 0.1 * error - 1e-13
        judged += error > 1e-8
    assert judged > 10


def test_steady_spin_of_a_brick(level: int) -> None:
    """Regression test: the error was twenty thousand times the reported one."""
    scene = Scene("", (0.0, 0.0, 1.0), moments=(4.0, 3.0, 2.0), attitude=(1.0, 0.0, 0.0, 0.0))
    found: Any = solve(scene, [40.0], "taylor", 1e-3, attitude=True)
    (error,) = _angle_errors(scene, [40.0], found.attitude)
    # Most of the estimated error has been subtracted.
    assert 1e-8 < error < 0.5 * found.error < 1e-4
    assert found.digits == pytest.approx(-math.log10(found.error), abs=0.1)


def test_error_is_accumulated_from_step_to_step() -> None:
    """Missing rotations add up about the axes of space: the error is proportional to the steps."""
    scene = Scene("", (0.0, 0.0, 1.0), moments=(4.0, 3.0, 2.0), attitude=(0.5, -0.5, 0.5, 0.5))
    errors = []
    for time in (40.0, 400.0):
        found = solve(scene, [time], "taylor", 1e-3, attitude=True)
        errors.append((found.error or 0.0) / found.steps)
        assert found.evaluations == found.steps
    # The local tolerance is smaller for the longer integration.
    assert 0.0 < errors[1] < errors[0]
    assert 400.0 * errors[1] > 1e-7


def test_intermediate_rows_have_the_error_of_their_own_times() -> None:
    """Within the first step the error is far smaller than at its end, or at the last time."""
    for scene, _ in islice(timed_scenes("spin: steady", 2502), 20):
        period = 2.0 * math.pi / max(map(abs, scene.omega))
        times = [0.2 * period, 0.3 * period, 20.0 * period]
        found: Any = solve(scene, times, "taylor", 1e-3, attitude=True)
        early, later, last = _angle_errors(scene, times, found.attitude)
        assert max(early, later) < 1e-3 * last + 1e-15
        alone = solve(scene, times[:2], "taylor", 1e-3, attitude=True)
        assert (alone.error or 0.0) < 1e-2 * found.error + 1e-15

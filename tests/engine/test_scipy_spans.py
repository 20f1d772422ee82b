"""SciPy's methods under recorded torques that act for a short time."""

import math
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, StateTorque, opaque, solve
from pyharness.engine.methods.scipy_run import series_beside
from pyharness.engine.plan.registry import SCIPY_METHODS
from pyharness.engine.problem.sides import joined
from pyharness.torques import table

SPHERE = Scene("", (0.0, 0.0, 1.0), moments=(2.0, 2.0, 3.0))
KINK = Scene(
    "", (1.0, 0.0, 0.0), moments=(1, 1, 1), torque=lambda t, w: [abs(t - 4.0) ** -0.5, 0, 0]
)


def pulse(seed: str) -> tuple[Scene, float]:
    """Return a scene with a random short pulse, and omega about axis 3 after 20 s (rad/s)."""
    source = Random(seed)
    centre, width = source.uniform(2.0, 18.0), 10.0 ** source.uniform(-4.0, -1.0)
    added = source.uniform(0.2, 0.5)
    size = 3.0 * added / width

    def bell(t: Any, w: Any) -> Any:
        return [0.0, 0.0, size / math.sqrt(math.pi) * np.exp(-(((t - centre) / width) ** 2))]

    def sech(t: Any, w: Any) -> Any:
        return [0.0, 0.0, size / math.pi / np.cosh((t - centre) / width)]

    def bump(t: Any, w: Any) -> Any:
        return [0.0, 0.0, size / math.pi / (1.0 + ((t - centre) / width) ** 2)]

    torque = source.choice((bell, sech, bump))
    if torque is bump:
        added *= (math.atan((20.0 - centre) / width) + math.atan(centre / width)) / math.pi
    return Scene("", SPHERE.omega, moments=SPHERE.moments, torque=torque), 1.0 + added


@pytest.mark.campaign
@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_short_pulse_is_not_passed(method: str) -> None:
    for number in range(3):
        scene, wanted = pulse(f"spans {number}")
        found = solve(scene, 20.0, method, 1e-6)
        assert found.ended == "complete"
        assert abs(found.omega[0, 2] - wanted) <= 1e-6 * wanted


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_spans_are_short_where_the_torque_is(sign: float) -> None:
    scene = Scene(
        "", SPHERE.omega, moments=SPHERE.moments,
        torque=lambda t, w: [0.0, 0.0, np.exp(-(((sign * t - 14.0) / 0.01) ** 2))],
    )  # fmt: skip
    times = [0.0, 15.0 * sign, 20.0 * sign]
    beside: Any = series_beside(scene, times, 1e-9)
    assert np.abs(beside.rows - solve(scene, np.sort(times)).omega[:: int(sign)]).max() < 1e-9
    spans = beside.spans
    assert spans[-1].end == 20.0 * sign
    assert next(each for each in spans if abs(each.end) >= 14.0).longest < 0.02
    assert spans[0].longest > 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_spans_end_where_a_table_changes(sign: float) -> None:
    values = [(0.1, 0.0, 0.0), (0.0, 2.0, 0.0), (0.3, 0.0, 0.1)]
    torque = table(np.sort(sign * np.array([1.0, 2.0, 4.0])), values)
    beside: Any = series_beside(replace(SPHERE, torque=torque), [5.0 * sign], 1e-9)
    ends = [sign * each.end for each in beside.spans]
    assert ends == sorted(ends)
    assert {1.0, 2.0, 4.0, 5.0} <= {*ends}
    assert ends[-1] == 5.0


def test_an_infinite_torque_is_unchecked() -> None:
    """The series ends there, and does not bound SciPy's steps."""
    found = solve(KINK, 6.0, "dop853", 1e-6)
    assert (found.ended, found.success) == ("unchecked", True)
    assert "may have passed a short change" in found.message
    assert abs(found.omega[0, 0] - 5.0 - math.sqrt(8.0)) < 1e-4
    assert solve(KINK, 3.0, "dop853", 1e-6).ended == "complete"
    assert solve(KINK, [-3.0, 6.0], "dop853", 1e-6).ended == "unchecked"


@pytest.mark.parametrize("method", ["radau", "lsoda"])
def test_stiff_torque_takes_the_steps_of_the_implicit_method(method: str) -> None:
    """The steps of the series are limited by its stability."""
    scene = Scene(
        "", (0.1, 0.2, 0.3), moments=(1.0, 1.5, 2.2),
        torque=lambda t, w: [-1e3 * (w[0] - np.sin(t)), -1e3 * w[1], -1e3 * w[2]],
    )  # fmt: skip
    found = solve(scene, 5.0, method, 1e-5)
    assert found.ended == "complete"
    assert found.evaluations < 10_000


def test_opaque_torque_has_no_spans() -> None:
    torque = opaque(lambda t, w: [math.sqrt((t - 4.0) ** 2), 0.0, 0.0])
    scene = Scene("", KINK.omega, moments=KINK.moments, torque=torque)
    assert isinstance(scene.torque, StateTorque)
    assert solve(scene, 6.0, "dop853", 1e-6, dense_output=True).ended == "complete"


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_perturbations_that_outgrow_the_local_tolerance_are_told(method: str) -> None:
    scene = Scene("", (1e-6, 1.0, 1e-6), moments=(40.0, 30.0, 20.0))
    found = solve(scene, 30.0, method, 1e-8)
    assert found.ended == "sensitive"
    assert (found.error, found.growth) == (None, None)
    assert f"above 1000, {method} may miss its tolerance" in found.message
    # The reason belongs to the side whose ending is reported.
    overflow = replace(found, ended="overflow", reason=None)
    assert (joined(found, overflow).ended, joined(found, overflow).reason) == ("overflow", None)
    assert joined(replace(found, reason=None), found).reason == found.reason
    assert solve(scene, 10.0, method, 1e-8).ended == "complete"

"""The flow's conditioning, compared with finite differences of the true solution.

The comparison uses no linearised equations and no propagator: the truth is computed in decimal
arithmetic from neighbouring starts, and differences show the amplification of an error.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene
from pyharness.checks.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.engine.methods import linearised
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference

_CHANGE = 1e-6
_SCENES = {
    "beside the separatrix": (Scene("", (1e-3, 1.0, 0.0), moments=(6.0, 5.0, 2.0)), 14.0),
    "any body": (Scene("", (0.4, -1.1, 0.7), moments=(3.0, 2.0, 4.0)), -7.0),
    "constant torque": (case_scene(5), 0.8),
}


@cache
def _sampled(name: str, count: int = 32) -> tuple[Array, Array, Array]:
    """Return times, omega and propagators from each time to the end."""
    scene, time = _SCENES[name]
    times = np.linspace(0.0, time, count + 1)

    def omega(shift: Array) -> Array:
        first, second, third = (scene.omega + shift).tolist()
        found = reference(replace(scene, omega=(first, second, third)), times[1:].tolist())
        return np.vstack([[first, second, third], found.omega])

    shifts = _CHANGE * np.eye(3)
    columns = [(omega(shift) - omega(-shift)) / (2.0 * _CHANGE) for shift in shifts]
    # The derivatives of each row with respect to the start; the last is the product of the
    # propagator from a row to the end with the derivatives of that row.
    made = np.array(columns).transpose(1, 2, 0)
    return times, omega(np.zeros(3)), made[-1] @ np.linalg.inv(made)


@pytest.mark.parametrize("name", _SCENES)
def test_amplification_is_that_of_neighbouring_solutions(name: str) -> None:
    scene, time = _SCENES[name]
    _, omega, rest = _sampled(name)
    sampled = float(np.abs(rest).sum(axis=2).max())
    found = conditioning(scene, time)
    # Samples miss the maximum by a little, and never exceed it.
    assert 0.999 * sampled <= found.amplification <= 1.1 * sampled
    assert found.largest == pytest.approx(np.abs(omega).max(), rel=1e-3)


@pytest.mark.parametrize("name", _SCENES)
def test_rounding_and_storing_are_sums_over_neighbouring_solutions(name: str) -> None:
    scene, time = _SCENES[name]
    times, omega, rest = _sampled(name)
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    terms = np.abs(np.column_stack([a * y * z, b * x * z, c * x * y]))
    terms = terms + np.abs(scene.normalized_torque(0.0))
    found = conditioning(scene, time)

    def gathered(made: Array) -> Array:
        arriving = np.array([np.abs(p) @ m for p, m in zip(rest, made, strict=True)])
        return np.asarray(np.abs(np.trapezoid(arriving, times, axis=0)))

    ends = np.abs(rest[0]) @ np.abs(omega[0]) + np.abs(omega[-1])
    rounding = 8.0 * ROUNDING * (gathered(terms) + ends).max() / found.largest
    assert found.rounding == pytest.approx(rounding, rel=0.02)
    storing = ROUNDING * gathered(np.abs(omega)).max() / (abs(time) * found.largest)
    assert found.storing == pytest.approx(storing, rel=0.02)


def test_torque_that_varies_counts_with_its_angle() -> None:
    """The rounding of frequency times t is proportional to this angle."""
    law = TorqueLaw(sines=(((1.0, 0.0, 0.0), 1000.0),))
    found = conditioning(Scene("", (1.0, 1.0, 1.0), moments=(2.0, 2.0, 2.0), torque=law), 4.0)
    # On a sphere errors just add up: 1000 t over the moment, integrated.
    wanted = 8.0 * ROUNDING * (0.5 * 1000.0 * 4.0**2 / 2.0 + 0.5 * 4.0 + 2.0)
    assert found.rounding == pytest.approx(wanted, rel=0.01, abs=0.0)
    assert found.amplification == 1.0
    assert found.unamplified == pytest.approx(wanted, rel=0.01, abs=0.0)


def test_limit_says_nothing_beyond_two_and_is_none_without_a_number() -> None:
    """min(2.0, nan) is 2.0, which would let anything pass."""
    flow = Conditioning(3.0, 1e-15, 1e-16, 0.0, 1.0)
    assert flow.limit(1e-9) == pytest.approx(3e-9 + 1e-15, rel=1e-12)
    assert flow.limit(1e-9, 1e6) == pytest.approx(3e-9 + 1e-15 + 1e-10, rel=1e-12)
    assert flow.limit(1.0) == flow.limit(math.inf) == 2.0
    assert replace(flow, rounding=math.nan).limit(1e-9) == 0.0


@pytest.mark.campaign
def test_flow_between_nodes_is_that_of_the_middle() -> None:
    """The error falls with the square of the distance of nodes; taken at an end, linearly."""
    scene, time = _SCENES["any body"]

    def flow(count: int) -> Array:
        times = np.linspace(0.0, time, count + 1)
        omega = np.vstack([scene.omega, reference(scene, times[1:].tolist()).omega])
        return np.asarray(linearised.propagators(scene, times, omega)[0])

    errors = [np.abs(flow(count) - flow(16 * count)).max() for count in (40, 80)]
    assert errors[0] > 3.5 * errors[1]


def test_the_limit_counts_the_steps_that_round_alone() -> None:
    found = Conditioning(
        amplification=3.0, rounding=0.25, storing=0.5, unamplified=0.0, largest=1.0
    )
    assert (found.limit(0.125), found.limit(0.125, 2.0)) == (0.625, 1.625)
    assert found.limit(100.0) == 2.0
    assert replace(found, rounding=math.nan).limit(0.0) == 0.0

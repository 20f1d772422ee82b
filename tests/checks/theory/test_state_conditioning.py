"""Error amplification under torques that depend on the state, compared with perturbed motions."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest

from pyharness import InputError, Scene, solve, torques
from pyharness.checks.scenes.random_scenes import draw as draw_law
from pyharness.checks.scenes.state_scenes import draw, draw_ready
from pyharness.checks.theory.conditioning import conditioning, conditioning_at
from pyharness.model.state_torque import of_law


@pytest.mark.sampled
@pytest.mark.parametrize("number", range(12))
def test_perturbations_grow_by_at_most_the_amplification(number: int) -> None:
    scene, time = (draw, draw_ready)[number % 2](Random(f"perturbed {number}"))
    try:
        flow = conditioning_at(scene, [time])
    except InputError:
        scene, time = replace(scene, torque=torques.damping(0.1)), 1.0
        flow = conditioning_at(scene, [time])
    with_attitude = scene.attitude is not None

    def end(one: Scene) -> tuple[np.ndarray, np.ndarray | None]:
        found = solve(one, time, tolerance=1e-14, attitude=with_attitude)
        return found.omega[0], None if found.attitude is None else found.attitude[0]

    omega, attitude = end(scene)
    size = 1e-5 / np.sqrt(flow.amplification)
    changes = []
    for axis in range(3):
        moved = np.array(scene.omega)
        moved[axis] += size * flow.largest
        other, turned = end(replace(scene, omega=tuple(moved)))
        changes.append(np.abs(other - omega).max() / flow.largest / size)
        if attitude is not None and turned is not None:
            changes.append(2.0 * np.abs(turned - attitude).max() / size)
    assert max(changes) <= 1.05 * flow.amplification
    assert flow.amplification >= 1.0
    assert flow.rounding > 2e-16


@pytest.mark.parametrize("number", [0, 2, 4, 6])
def test_a_law_as_a_tape_has_the_conditioning_of_the_law(number: int) -> None:
    drawn = draw_law("conditioning", number)
    law, scene = drawn.scene.law, replace(drawn.scene, attitude=None)

    time = 0.1 * drawn.time
    one = conditioning(scene, time)
    other = conditioning_at(replace(scene, torque=of_law(law)), [time])
    assert other.amplification == pytest.approx(one.amplification, rel=0.05)
    assert other.largest == pytest.approx(one.largest, rel=0.01)
    # The two count the roundings of the torque and of the products in different ways.
    assert 0.2 * one.rounding <= other.rounding <= 5.0 * one.rounding


def test_the_largest_sensitivity_at_any_time_counts() -> None:
    """A body that is first accelerated, and then damped to rest."""
    torque = torques.pulses([0.0], [2.0], [0.0, 0.0, 1.0]) + torques.damping([0.0, 0.0, 3.0])
    scene = Scene("damped", (0.0, 0.0, 1.0), moments=(1.0, 2.0, 3.0), torque=torque)
    both = conditioning_at(scene, [1.0, 20.0])
    assert both.rounding > conditioning_at(scene, [20.0]).rounding
    assert both == conditioning_at(scene, [20.0, 1.0])

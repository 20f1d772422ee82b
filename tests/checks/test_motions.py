"""The trials of motions (torque, length, invariance, threads), and the truth of the comparison."""

import time
from dataclasses import replace

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw
from pyharness.checks.stress import named, stress, worst
from pyharness.checks.theory import brouwer
from pyharness.checks.trials import length, threads
from pyharness.truth.axial_top import axial_top
from pyharness.truth.reference import reference


def test_the_axial_top_is_the_reference() -> None:
    law = TorqueLaw(
        (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), (((0.0, 0.0, 5.0), 30.0), ((0.0, 0.0, 1.0), 0.0)),
        (((0.0, 0.0, 7.0), 10.0), ((0.0, 0.0, 2.0), 0.0)),
    )  # fmt: skip
    scene = Scene("", (1.0, 2.0, 3.0), moments=(40.0, 40.0, 20.0), torque=law)
    times = [0.3, 2.0]
    truth = reference(scene, times, precise=True)
    assert np.abs(brouwer.floats(axial_top(scene, times)) - truth.omega).max() <= 2.0 * truth.error


@pytest.mark.campaign
@pytest.mark.parametrize("only", [
    "torque/taylor/fast-1e6,torque/taylor/axial-1e6,torque/gauss-2/huge-from-rest",
    "torque/dop853/tiny-5e-324,torque/quick/averaged-1e16,torque/prepared-auto/resonant",
    "torque/closed-form,torque/runge-kutta/axial-1e6",
    "length/closed-form,length/dop853,length/two-term/case-4/corrected",
    "invariance/taylor,invariance/gauss-4,invariance/runge-kutta,invariance/quick",
    "attitude/closed-form/montgomery,attitude/auto/needle,attitude/taylor/space,attitude/angles",
    "threads/taylor,threads/prepared-auto,threads/refusals,threads/two-term",
])  # fmt: skip
def test_bounds_hold(only: str) -> None:
    asked = only.split(",")
    checks = list(stress(asked))
    assert [check.id for check in checks if not check.passed] == []
    assert {check.id.split("/")[1] for check in checks} == {each.split("/")[1] for each in asked}
    assert len({check.id for check in checks}) == len(checks)
    assert worst(checks)


@pytest.mark.campaign
@pytest.mark.parametrize("name", length.INTEGRATORS)
def test_brouwers_law_holds(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Integrate 1e4 revolutions, where 4-stage Gauss drifts if its weights lose their low parts."""
    monkeypatch.setattr(length, "_FIT_FROM", 1e2)
    shorter = replace(length.INTEGRATORS[name], revolutions=1e4, others=1e4)
    checks = list(length.check_growth(shorter, named("length", name, "tumbling")))
    assert [check.id for check in checks if not check.passed] == []
    assert len(checks) == 3 * 8


@pytest.mark.campaign
def test_the_power_tells_chance_from_a_preference() -> None:
    """Classify 1000 random walks and 1000 drifts: at most 5 are taken for the other kind."""
    source = np.random.default_rng(1)
    steps = np.array([10.0 ** (k / 2.0) for k in range(6, 11)])
    lengths = np.diff([0.0, *steps])
    wrong = 0
    for _ in range(1000):
        walks = np.cumsum(source.normal(size=(length.STARTS, 5)) * np.sqrt(lengths), axis=1)
        wrong += brouwer.exponent(steps, walks) > 0.75
        drifts = walks + 0.3 * steps
        wrong += brouwer.exponent(steps, drifts) <= 0.75
    assert wrong <= 5


@pytest.mark.parametrize("shared", [False, True])
def test_a_buffer_that_threads_share_is_found(shared: bool) -> None:
    buffer = np.zeros(3)

    def job(number: int) -> threads.Job:
        def call() -> bytes:
            own = buffer if shared else np.zeros(3)
            own[:] = number
            time.sleep(0.002)
            return own.tobytes()

        return threads.Job("planted", threads.SCENES[0], call)

    assert bool(threads.different([job(number) for number in range(8)], repeats=2)) == shared

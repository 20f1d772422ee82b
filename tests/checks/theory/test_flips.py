"""Flip times, compared with half the exact period and with the motion itself."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pyharness import Scene, solve_many
from pyharness.checks.theory.flips import flip_times
from pyharness.model.trajectory import Array
from pyharness.truth.free_attitude import period_of


def _drawn(n: int, least: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return bodies, angular velocities near the middle axis, and the index of that axis."""
    rng = np.random.default_rng(7)
    parts = np.sort(rng.uniform(0.01, 1.0, (n, 3)), axis=1)
    moments = np.stack([parts[:, 0] + parts[:, 1], parts[:, 0] + parts[:, 2],
                        parts[:, 1] + parts[:, 2]], axis=1)  # fmt: skip
    tilt, azimuth = np.exp(rng.uniform(np.log(least), 0.0, n)), rng.uniform(0.0, 2.0 * np.pi, n)
    omega = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.cos(tilt), np.sin(tilt) * np.sin(azimuth)], axis=1
    )
    order = rng.permuted(np.tile(np.arange(3), (n, 1)), axis=1)
    shuffled = (np.take_along_axis(each, order, axis=1) for each in (moments, omega))
    return *shuffled, np.argmax(order == 1, axis=1)


def test_is_half_the_period_of_the_exact_motion() -> None:
    moments, omega, _ = _drawn(60, 1e-8)
    found = flip_times(moments, omega)
    for body, start, time in zip(moments.tolist(), omega.tolist(), found, strict=True):
        period: Any = period_of(Scene("", tuple(start), moments=tuple(body)))
        assert time == pytest.approx(float(period / 2), rel=1e-14)


def test_no_bit_depends_on_other_bodies() -> None:
    moments, omega, _ = _drawn(400, 1e-8)
    alone = [flip_times(*each)[0] for each in zip(moments, omega, strict=True)]
    assert flip_times(moments, omega).tolist() == alone


@pytest.mark.campaign
def test_middle_component_changes_its_sign_once_in_it() -> None:
    moments, omega, middle = _drawn(2000, 1e-3)
    times = flip_times(moments, omega)
    signs = []
    for part in np.linspace(0.0, 1.0, 21):
        ends = solve_many(Scene("", (0, 1, 0), moments=(1, 2, 3)), part * times, omega=omega,
                          moments=moments).omega  # fmt: skip
        signs.append(np.sign(np.take_along_axis(ends, middle[:, None], axis=1)[:, 0]))
    changes: Any = (np.diff(np.array(signs), axis=0) != 0).sum(axis=0)
    assert (changes == 1).all()
    # Half a period later omega points the other way along the middle axis.
    before = np.take_along_axis(omega, middle[:, None], axis=1)
    assert np.abs(before + np.take_along_axis(ends, middle[:, None], axis=1)).max() < 1e-8


def test_it_grows_with_the_logarithm_of_the_tilt() -> None:
    tilts = np.geomspace(1e-300, 1e-5, 60)
    omega = np.stack([tilts, np.ones(60), np.zeros(60)], axis=1)
    # With A = 1, B = 1, C = 1/3 it is (2 / sqrt(A C)) log(4 sqrt(A / B) / tilt).
    expected = 2.0 * np.sqrt(3.0) * np.log(4.0 / tilts)
    assert flip_times([1.0, 2.0, 3.0], omega) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("moments", "omega"), [
    ((1.0, 2.0, 3.0), (0.0, 1.0, 0.0)),  # on the axis
    ((2.0, 2.0, 2.0), (1.0, 1.0, 0.0)),  # a sphere
    ((1.0, 2.0, 2.0), (0.0, 1.0, 0.1)),  # an axis in the plane of equal moments
])  # fmt: skip
def test_what_never_turns_takes_for_ever(moments: Any, omega: Any) -> None:
    assert flip_times(moments, omega)[0] == np.inf

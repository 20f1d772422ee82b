"""Error and error amplification that the Taylor kernel reports, compared with the truth."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, solve
from pyharness.model.scene import Triple
from pyharness.model.trajectory import ROUNDING, Trajectory
from pyharness.truth.reference import reference
from tests import as_written
from tests.campaigns.estimates import truth
from tests.campaigns.estimates.scenes import Draw, drawn

BODY = (1.0, 2.0, 2.7)
WAVES = TorqueLaw(
    (0.3, -0.2, 0.1), sines=[((0.5, 0.1, -0.4), 3.0)], cosines=[((-0.3, 0.6, 0.2), 5.0)]
)
SCENES = {"case 5": case_scene(5), "waves": Scene("", (1.0, -2.0, 0.5), BODY, torque=WAVES)}
# No size is small enough for linear theory, so that no error is subtracted.
UNTAKEN = {"taylor_rows": ("LINEAR = 0.1_dp", "LINEAR = -1.0_dp")}
CALM = 1e4  # error amplification
pytestmark = [
    pytest.mark.external,
    pytest.mark.skipif(not as_written.compiler_here(), reason="no compiler"),
]


@pytest.fixture(scope="module")
def untaken(tmp_path_factory: pytest.TempPathFactory) -> as_written.Solve:
    """Return the kernel that estimates its error without subtracting it from the rows."""
    return as_written.as_written(tmp_path_factory.mktemp("untaken"), UNTAKEN)


@cache
def _draws() -> list[tuple[Draw, Trajectory]]:
    draws = [
        drawn("error", number, (1e-3, 1e-5, 1e-7, 1e-9, 1e-11), dressed=False)
        for number in range(120)
    ]
    return [(each, solve(each.scene, [each.time], "taylor", each.tolerance)) for each in draws]


@pytest.mark.campaign
def test_error_is_known_and_taken_off(untaken: as_written.Solve) -> None:
    measured, left, held = [], [], []
    for of, found in _draws():
        assert found.error is not None
        assert found.growth is not None
        assert found.error >= ROUNDING * found.growth
        before = untaken(of.scene, [of.time], of.tolerance)
        if of.truth.growth > CALM or before.error < 10.0 * ROUNDING * before.growth:
            continue
        error = of.truth.error(before.omega[-1])
        measured.append(before.error / error)
        left.append(of.truth.error(found.omega[-1]) / error)
        held.append(of.truth.error(found.omega[-1]) / of.tolerance)
    assert len(measured) > 60
    # Stated errors include what the fitted terms may lack.
    assert np.quantile(measured, [0.05, 0.5]) == pytest.approx([0.9, 2.7], rel=0.15)
    assert np.quantile(measured, 0.75) < 8.0
    assert np.quantile(left, 0.5) < 0.3
    assert np.quantile(left, 0.75) < 0.8
    assert max(held) < 0.3


@pytest.mark.campaign
def test_growth_is_that_of_differences() -> None:
    ratios = [
        (found.growth or 0.0) / of.truth.growth
        for of, found in _draws() if of.truth.growth < 1e13
    ]  # fmt: skip
    assert np.quantile(ratios, [0.05, 0.5, 0.95]) == pytest.approx([0.85, 0.98, 1.0], rel=0.05)
    assert 0.4 < min(ratios) <= max(ratios) < 2.5


@pytest.mark.campaign
def test_march_made_again_knows_it_well() -> None:
    ratios = [
        (found.growth or 0.0) / of.truth.growth
        for of, found in _draws()
        if found.evaluations > found.steps and 4e3 < of.truth.growth < 1e13
    ]
    assert len(ratios) > 10
    assert np.quantile(ratios, [0.25, 0.5, 0.75]) == pytest.approx([0.99, 1.0, 1.0], abs=0.02)
    assert 0.8 < min(ratios) <= max(ratios) < 2.0


@pytest.mark.parametrize("number", [2359, 2555, 3755])
def test_growth_of_several_times_is_the_largest_of_any(number: int) -> None:
    """Near the middle axis, an earlier perturbation is smaller again at the last time."""
    of = drawn("20263", number)
    each = [solve(of.scene, [time], "taylor", of.tolerance).growth or 0.0 for time in of.times]
    assert max(each) > 20.0 * each[-1]
    together = solve(of.scene, of.times, "taylor", of.tolerance).growth or 0.0
    # The growth is measured at the end of the block of steps that contains the time.
    assert 0.8 * max(each) < together < 2.5 * max(each)


def test_is_made_again_where_much_grows_and_hardly_else() -> None:
    calm = []
    for of, found in _draws():
        is_again = found.evaluations > found.steps
        if of.truth.growth > 4e3:
            assert is_again
        if of.truth.growth < 1e3:
            calm.append(is_again)
    assert len(calm) > 60
    assert np.mean(calm) < 0.1


def test_says_where_no_digit_is_left() -> None:
    lost = []
    for of, _ in _draws():
        if of.truth.growth < 100.0:
            continue
        for tolerance in (1e-9, 1e-11, 1e-13):
            ended = solve(of.scene, [of.time], "taylor", tolerance).ended
            lost.append(of.truth.growth * ROUNDING / tolerance)
            if lost[-1] > 1.0:
                assert ended == "sensitive"
            if lost[-1] < 0.15:
                assert ended == "complete"
    assert sum(each > 1.0 for each in lost) > 20


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("name", "tolerance", "factor"),
    [("case 5", 1e-4, 3.0), ("case 5", 1e-6, 30.0), ("waves", 1e-4, 3.0), ("waves", 1e-7, 2.5)],
)
def test_rows_within_steps_have_their_error_taken_off(
    name: str, tolerance: float, factor: float, untaken: as_written.Solve
) -> None:
    """The rows within steps are as accurate as the last one."""
    scene = SCENES[name]
    times = np.linspace(0.0, 3.0, 301)[1:].tolist()
    known = reference(scene, times).omega
    found: Any = solve(scene, times, "taylor", tolerance)
    before = untaken(scene, times, tolerance)
    scale = np.abs(known).max()
    errors, worse = (
        np.abs(omega - known).max(axis=1) / scale for omega in (found.omega, before.omega)
    )
    assert found.steps < 60
    assert max(errors) <= max(worse) / factor <= tolerance
    assert max(errors) <= max(errors[-1] * 4.0, 0.1 * found.error)
    assert 0.65 * max(worse) < found.error < 4.0 * max(worse)


def _beside(small: float) -> Scene:
    """Return a body that rotates nearly about its middle axis."""
    return Scene("", (small, 2.0, 0.3 * small), BODY)


@pytest.mark.parametrize(("small", "time", "tolerance"), [
    (1.0, 800.0, 1e-4),
    (1.0, 800.0, 1e-12),
    (0.1, -100.0, 1e-8),
    (0.1, 800.0, 1e-8),
    (0.1, 800.0, 1e-12),
    (1e-3, 800.0, 1e-8),
    (1e-6, 800.0, 1e-8),
    (1e-6, -100.0, 1e-4),
    (1e-12, 20.0, 1e-9),
    (1e-12, 60.0, 1e-9),
])  # fmt: skip
def test_growth_over_thousands_of_steps(small: float, time: float, tolerance: float) -> None:
    """Blocks of steps are merged, also if the growth exceeds the precision of binary64."""
    known = truth.truth_of(_beside(small), [time]).growth
    found = solve(_beside(small), [time], "taylor", tolerance)
    assert found.growth == pytest.approx(known, rel=0.4)


@pytest.mark.parametrize(
    ("omega", "torque", "time"),
    [((0.0, 0.0, 2.0), 0.1, 5.0), ((0.0, 0.0, 2.0), 0.1, 20.0), ((0.0, 0.0, 2.0), 0.0, 500.0)],
)
def test_growth_beside_a_spin_is_none(omega: Triple, torque: float, time: float) -> None:
    """The series of a spin has hardly a term, and its steps are long."""
    law = TorqueLaw((0.0, 0.0, torque))
    found = solve(Scene("", omega, BODY, torque=law), [time], "taylor", 1e-9)
    assert found.steps < 20
    assert found.growth == pytest.approx(1.0, abs=0.3)


def test_growth_on_the_middle_axis_is_exponential() -> None:
    found = solve(Scene("", (0.0, 2.0, 0.0), BODY), [60.0], "taylor", 1e-6)
    rate = 2.0 * np.sqrt((BODY[1] - BODY[0]) * (BODY[2] - BODY[1]) / (BODY[0] * BODY[2]))
    assert np.log(found.growth or 1.0) == pytest.approx(60.0 * rate, rel=0.02)


@pytest.mark.campaign
def test_growth_stands_where_the_way_is_too_long_to_measure_it_again() -> None:
    found = solve(Scene("", (0.0, 2.0, 0.0), BODY), [2e7], "taylor", 1e-6)
    assert found.ended == "sensitive"
    # Only the beginning is integrated twice.
    assert found.steps < found.evaluations < 1.01 * found.steps


def test_growth_of_what_hardly_turns_is_one() -> None:
    found = solve(Scene("", (1e-3, 0.0, 1.0), BODY), [1e-3], "taylor", 1e-6)
    assert found.growth == pytest.approx(1.0, abs=1e-3)


def test_steps_are_counted_over_all_marches() -> None:
    """The repeated integration takes more steps, because perturbations grow."""
    twice = solve(_beside(1e-3), [20.0], "taylor", 1e-6)
    assert twice.ended == "complete"
    assert 1.3 * twice.steps <= twice.evaluations < 2 * twice.steps
    once = solve(case_scene(5), [3.0], "taylor", 1e-6)
    assert once.steps == once.evaluations

"""The Taylor kernel: its tolerance, both directions, rows, endings, every instruction set."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, solve
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.build import build
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from pyharness.model.values import Triple
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference
from tests.as_written import as_written, compiler_here
from tests.checks.scenes.timed_kinds import NASTY, timed_scenes
from tests.instruction_sets import CHOSEN, levels_here

RUNS = [(case, 3.0) for case in range(1, 8)] + [(3, 100.0), (4, 100.0)]
REST = Scene("", (0.0, 0.0, 0.0), moments=(40.0, 30.0, 20.0))
SPUN = replace(REST, omega=(0.3, -1.0, 2.0))
WAVES = TorqueLaw(
    (10.0, 0.0, -5.0), (1.0, 2.0, 0.0), (((20.0, 0.0, 5.0), 3.0), ((0.0, 9.0, 0.0), 11.0)),
    (((5.0, 5.0, 5.0), 3.0), ((0.0, 0.0, 30.0), 0.5), ((1.0, 2.0, 3.0), 0.0)),
)  # fmt: skip
TWO_SPEEDS = TorqueLaw(sines=(((20.0, 0.0, 5.0), 2.0),), cosines=(((5.0, 30.0, -5.0), 5.0),))
FROM_REST = {
    "from rest": TorqueLaw((5.0, 3.0, 1.0)),
    "rate from rest": TorqueLaw(rate=(90.0, 60.0, 70.0)),
    "sine from rest": TorqueLaw(sines=(((50.0, 30.0, 10.0), 2.0),)),
    "about one axis from rest": TorqueLaw(sines=(((0.0, 0.0, 10.0), 2.0),)),
}
SCENES = {
    **{f"case {case}": case_scene(case) for case in range(1, 8)},
    "waves": replace(SPUN, torque=WAVES),
    "sine and cosine of two speeds": replace(SPUN, torque=TWO_SPEEDS),
    **{name: replace(REST, torque=law) for name, law in FROM_REST.items()},
    "two zeros": Scene("", (1.0, 2.0, 3.0), coefficients=(0.0, -1.0, 0.0)),
    "not a body": Scene("", (0.1, 0.2, -0.3), coefficients=(1.0, 1.0, 0.5)),
}


@cache
def _truth(name: str, time: float) -> Array:
    """Return omega; over a long time by elliptic functions, which are faster than a series."""
    if time > 10.0:
        return np.array(torque_free(SCENES[name], time), dtype=float)
    return np.asarray(reference(SCENES[name], [time]).omega[0])


def _error(found: Array, truth: Array) -> float:
    error: float = np.abs(found - truth).max() / np.abs(truth).max()
    return error


def _end(scene: Scene, time: float, tolerance: float) -> tuple[Array, int, int]:
    rows, _, status, steps, _ = extension().taylor_rows(
        *normalized(scene), scene.omega, [time], tolerance
    )
    return rows[:, 0], status, steps


@pytest.mark.parametrize(("case", "horizon"), RUNS)
def test_best_error_is_rounding(case: int, horizon: float, level: int) -> None:
    """Single runs scatter by a factor of two around their median, so the best of four counts."""
    truth = _truth(f"case {case}", horizon)
    errors = [
        _error(_end(case_scene(case), horizon, tolerance)[0], truth)
        for tolerance in (1e-15, 1.5e-15, 2e-15, 3e-15)
    ]
    assert min(errors) <= (3e-16 if horizon == 3.0 else 2e-15)
    assert max(errors) <= (1e-15 if horizon == 3.0 else 5e-15)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-6, 1e-9, 1e-12, 1e-14])
@pytest.mark.parametrize(("frequency", "time"), [(242.25, 70.5), (1000.3, 60.0)])
def test_thousands_of_turns_of_a_wave(frequency: float, time: float, tolerance: float) -> None:
    """The errors of all steps add up, and so do the rounding errors of a phase."""
    law = TorqueLaw(sines=(((2.0, -1.0, 6.0), frequency),))
    scene = Scene("", (0.3, -1.0, 0.5), moments=(2.0, 2.0, 2.0), torque=law)
    omega, status, _ = _end(scene, time, tolerance)
    assert status == 0
    assert _error(omega, reference(scene, [time]).omega[0]) <= tolerance


def test_blow_up_ends_the_rows(level: int) -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = solve(scene, [0.5, 0.9, 0.999, 1.001, 2.0], "taylor", 1e-12)
    assert found.ended == "overflow"
    np.testing.assert_allclose(found.omega, [[2.0] * 3, [10.0] * 3, [1000.0] * 3], rtol=1e-10)
    assert found.steps < 10_000
    _, n_rows, status, *_ = extension().taylor_rows(*normalized(scene), scene.omega, [2.0], 1e-12)
    assert (n_rows, status) == (0, 2)


@pytest.mark.parametrize(("name", "time", "counts"), [
    ("case 5", 3.0, (13, 18, 21, 23, 28)),
    ("case 6", 3.0, (51, 60, 74, 89, 109)),
    ("case 7", 3.0, (67, 75, 92, 93, 113)),
    ("case 3", 100.0, (302, 395, 433, 518, 631)),
    ("sine and cosine of two speeds", 20.0, (41, 50, 63, 67, 81)),
    ("waves", 2.0, (7, 9, 9, 10, 12)),
    ("rate from rest", 2.0, (5, 6, 7, 8, 9)),
])  # fmt: skip
def test_steps_are_few(name: str, time: float, counts: tuple[int, ...]) -> None:
    """Take at most a quarter more steps than recorded here, and one integration."""
    for count, tolerance in zip(counts, (1e-3, 1e-6, 1e-9, 1e-12, 1e-14), strict=True):
        found = solve(SCENES[name], [time], "taylor", tolerance)
        assert found.evaluations == found.steps <= 1.25 * count + 1.0


@pytest.mark.skipif(
    any(flag in (build().flags or "") for flag in ("-O0", "=native")),
    reason="without optimisation nothing is fused, and natively the plain kernel is",
)
def test_levels_agree_to_rounding() -> None:
    """The bits differ: with fused multiply-adds they would agree only if one kernel ran twice."""
    found = []
    for number in levels_here():
        assert extension().choose_instructions(number) == number
        found.append(_end(case_scene(5), 4.0, 1e-15)[0])
    extension().choose_instructions(CHOSEN)
    for omega in found[1:]:
        assert 0.0 < _error(omega, found[0]) <= 1e-15


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.skipif(not compiler_here(), reason="no compiler")
def test_loops_as_written_do_what_they_do_written_out(tmp_path: Path) -> None:
    """The source is the definition; unroll.py only writes out its loops."""
    loops = as_written(tmp_path)
    for name, scene in SCENES.items():
        found = loops(scene, [2.0], 1e-12)
        omega, status, steps = _end(scene, 2.0, 1e-12)
        assert (found.status, abs(found.steps - steps) <= 1) == (status, True), name
        limit = 1e-13 * np.abs(omega).max()
        np.testing.assert_allclose(found.omega[0], omega, rtol=0, atol=limit)


def test_row_that_overflows_within_a_step_ends_the_rows() -> None:
    scene = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=TorqueLaw((1e308, 0.0, 0.0)))
    for times in ([1.0, 3.0, 4.0], [3.0], [1.0, 1.5, 3.0]):
        found = solve(scene, times, "taylor", 1e-9)
        assert found.ended == "overflow"
        np.testing.assert_allclose(found.omega[:, 0], [1e308 * t for t in times if t < 1.7])


@pytest.mark.parametrize(
    ("kind", "number"), [("near the separatrix", 127), ("other units", 190), ("resonant", 153)]
)
def test_growth_of_small_differences_is_followed_the_right_way(kind: str, number: int) -> None:
    """Test the draws, of 1500, that a wrongly propagated perturbation would affect most."""
    scene, time = next(islice(timed_scenes(kind, [11, list(NASTY).index(kind)]), number, None))
    truth = solve(scene, np.linspace(0.0, time, 33)[1:], "taylor", 1e-15).omega
    scale = max(np.abs(truth).max(), *map(abs, scene.omega))
    assert np.abs(_end(scene, time, 1e-3)[0] - truth[-1]).max() <= 0.4e-3 * scale


def test_the_error_is_the_largest_of_all_rows() -> None:
    """Rows within the steps have errors of their own, which the last row does not show."""
    generator = np.random.default_rng(3)
    for _ in range(8):
        least, middle, largest = np.sort(generator.uniform(1.0, 3.0, 3))
        moments = (least, middle, min(largest, 0.95 * (least + middle)))
        scene = Scene("", tuple(generator.standard_normal(3)), moments=moments)
        times = np.linspace(0.0, generator.uniform(3.0, 12.0), 81)[1:]
        for tolerance in (1e-3, 1e-5):
            rows, end = (solve(scene, each, "taylor", tolerance) for each in (times, times[-1:]))
            assert rows.steps == end.steps
            assert rows.error is not None
            assert end.error is not None
            assert rows.error >= end.error
            truth = solve(scene, times, "taylor", 1e-14).omega
            assert np.abs(rows.omega - truth).max() / np.abs(truth).max() <= rows.error


# Moments and omega of motions in which the energy drifted by one rounding error in 50 to 100 steps.
LONG_MOTIONS = [
    ((1.3073304409711017, 0.5449721574778303, 1.7698593734825447),
     (0.6962841951234314, -3.4096004948800256, 1.6657125111117101), 25_000.0),
    ((1.0279068765861359, 1.0279068765861334, 0.42430591737718243),
     (0.6972130936578528, 0.3626360236457626, 3.8883282616286095), 120_000.0),
    ((1.0452751939024452, 1.9991761150650715, 1.048757710727168),
     (-1.2333286640307717, -0.9582652054360887, 1.6000190889991115), 200_000.0),
]  # fmt: skip


@pytest.mark.sampled
@pytest.mark.parametrize("with_attitude", [False, True])
@pytest.mark.parametrize(("moments", "omega", "time"), LONG_MOTIONS)
def test_energy_follows_a_random_walk(
    moments: Triple, omega: Triple, time: float, with_attitude: bool, level: int
) -> None:
    """The rounding errors of 200 000 steps cancel, except for the square root of their number."""
    turn = (1.0, 0.0, 0.0, 0.0) if with_attitude else None
    scene = Scene("", omega, moments=moments, attitude=turn)
    found = solve(scene, [time], "taylor", 1e-9, attitude=with_attitude)
    energy, at_start = (
        sum(Fraction(i) * Fraction(w) ** 2 for i, w in zip(moments, row, strict=True))
        for row in (found.omega[-1].tolist(), omega)
    )
    assert found.steps > 100_000
    assert abs(energy / at_start - 1) <= 1.5 * 2.0**-53 * found.steps**0.5


def test_growth_of_a_long_motion_does_not_lose_its_phase() -> None:
    """The fast axis shears the motion: the derivative by it grows in proportion to time."""
    moments, omega, time = LONG_MOTIONS[1]
    found = solve(Scene("", omega, moments=moments), [time], "taylor", 1e-9)
    spin = (moments[1] - moments[2]) / moments[0]
    shear = spin * time * float(np.hypot(*omega[:2]))
    assert found.growth == pytest.approx(shear, rel=0.1)


@pytest.mark.parametrize(("case", "growth"), [(5, 900.0), (7, 110.0)])
def test_growth_of_a_motion_that_becomes_fast_is_that_of_every_tolerance(
    case: int, growth: float
) -> None:
    """The start does not show that the motion is long: the torque increases omega to 600 rad/s."""
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        found = solve(case_scene(case), [300.0], "taylor", tolerance)
        assert found.growth == pytest.approx(growth, rel=0.15), tolerance
        # Only the beginning is integrated twice.
        assert found.steps < found.evaluations < 1.05 * found.steps


@pytest.mark.sampled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-13])
def test_a_motion_that_was_expected_to_be_longer_has_its_growth(tolerance: float) -> None:
    """A torque that swings: the beginning lets expect more radians than the work limit allows."""
    swing = TorqueLaw(cosines=[((0.0, 0.0, 2.7), 0.01)])
    scene = Scene("", (1e-3, 1e-3, 0.0), moments=(1.0, 2.0, 2.7), torque=swing)
    assert solve(scene, [1e4], "taylor", tolerance).growth == pytest.approx(11.1, rel=0.1)


@pytest.mark.campaign
def test_a_long_motion_is_not_called_sensitive_by_chance() -> None:
    found = solve(case_scene(7), [1000.0], "taylor", 1e-6)
    assert found.ended == "complete"
    assert found.growth == pytest.approx(222.0, rel=0.05)


@pytest.mark.campaign
def test_variations_are_as_accurate_as_the_motion() -> None:
    """Variations of a fixed order lost their phase in 190 000 steps: 1e-3 was exceeded unseen."""
    wave = (-4.738442472713716, -5.436985716429409, 8.688557959572783), 0.8007463433344562
    scene = Scene(
        "",
        (-1.1357864924906, 0.8281719570376277, 0.7690656766038253),
        moments=(32.355947334924124, 13.540422433697994, 20.00696713406161),
        torque=TorqueLaw(sines=[wave]),
    )
    time = [16849.658046512755]
    truth = solve(scene, time, "taylor", 1e-12).omega
    for tolerance in (1e-3, 1e-4):
        found: Any = solve(scene, time, "taylor", tolerance)
        assert np.abs(found.omega - truth).max() <= found.error * np.abs(truth).max()


def test_growth_from_few_starts_is_seen() -> None:
    """Near the separatrix, the motion amplifies most from the few starts near the middle axis."""
    moments = (1.908871055132049, 1.6944745539067607, 0.5085885178521218)
    omega = (0.0012638412446339218, -0.40645864143219074, -3.387026803568728e-05)
    scene, times = Scene("", omega, moments=moments), [9000.0, 18365.7655353155]
    for asked in (times[:1], times[1:], times):
        # The closed form has the amplification until the last time.
        known = max(solve(scene, [time], "closed-form", 1e-9).growth or 0.0 for time in asked)
        found: Any = solve(scene, asked, "taylor", 1e-9).growth
        assert known / 2.0 <= found <= 2.0 * known


def test_error_of_a_row_near_the_separatrix_does_not_depend_on_later_rows() -> None:
    """The first row has an error of 8e-4; with a later row, `error` was 8e-8, and not sensitive."""
    moments = (1.5320323227537336, 2.0627587124960307, 1.0113959197659328)
    omega = (1.0, -1.588848788890011e-06, 1.0894257045411488e-06)
    scene, end = Scene("", omega, moments=moments), 7495.232634479441
    times = [0.3 * end, end]
    truth = solve(scene, times, "closed-form", 1e-13).omega
    for chosen in (times[:1], times, np.linspace(0.0, end, 2001)[1:].tolist()):
        found: Any = solve(scene, chosen, "taylor", 7e-7)
        error = np.abs(found.omega[np.argmin(np.abs(found.time - times[0]))] - truth[0]).max()
        assert 1e-5 < error <= 2.0 * found.error
        assert found.ended == "sensitive"

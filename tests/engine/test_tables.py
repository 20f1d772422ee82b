"""Torques given by tables of values over time, and pulses: values, and the motion."""

import itertools
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pandas
import pytest
from scipy.interpolate import CubicSpline

from pyharness import InputError, Scene, StateTorque, TorqueLaw, solve
from pyharness.engine.system.recorded import slopes_of, system_of
from pyharness.model.state_torque import law_of, replayed
from pyharness.model.symbols import SYMBOLS
from pyharness.model.tape import TIME, Operation, Table
from pyharness.model.trajectory import Array
from pyharness.torques import damping, pulses, table, wheels
from pyharness.truth.reference import reference
from tests.refused import refused

SOURCE = np.random.default_rng(80)
TIMES = np.cumsum(SOURCE.uniform(0.1, 1.0, 9)) - 2.0
VALUES = SOURCE.normal(size=(9, 3))
# Times within the pieces, at their breaks, and before and after the table.
WITHIN = SOURCE.uniform(TIMES[0], TIMES[-1], 200)
OUTSIDE = [-1e9, TIMES[0] - 1e-9, TIMES[0] - 0.5, TIMES[-1] + 1e-9, TIMES[-1] + 3.0, 1e9]
STARTS, DURATIONS = [1.5, -1.0, 0.25, 2.75], [1.0, 0.5, 1.25, 0.5]
TORQUES = SOURCE.normal(size=(4, 3))
SPHERE: dict[str, Any] = {"moments": (2.0, 2.0, 2.0)}
BODY: dict[str, Any] = {"moments": (1.5, 2.0, 3.0)}
CASES: dict[str, StateTorque] = {
    "held": table(TIMES, VALUES, "held"), "linear": table(TIMES, VALUES),
    "cubic": table(TIMES, VALUES, "cubic"), "pulses": pulses(STARTS, DURATIONS, TORQUES),
}  # fmt: skip


def at(torque: StateTorque, t: float) -> Array:
    """Return the torque at a time; it does not depend on the state."""
    return np.array(torque.at(t, (7.0, 8.0, 9.0), (0.0, 1.0, 0.0, 0.0)))


def tables_of(torque: StateTorque) -> list[Table]:
    """Return the tables on the tape of a torque."""
    assert torque.tape is not None
    return [each.table for each in torque.tape.operations if each.table is not None]


def scene_with(torque: StateTorque, **body: Any) -> Scene:
    return Scene("table", (0.3, -1.1, 2.2), torque=torque, **body)


# The values.


def test_tables_equal_those_of_numpy_and_scipy() -> None:
    spline = CubicSpline(TIMES, VALUES)
    for t in [*WITHIN, *TIMES, *OUTSIDE]:
        wanted = [np.interp(t, TIMES, column) for column in VALUES.T]
        assert at(CASES["linear"], t) == pytest.approx(wanted, rel=1e-14, abs=1e-14)
        place = max(0, sum(time <= t for time in TIMES) - 1)
        assert at(CASES["held"], t).tolist() == VALUES[place].tolist()
        if TIMES[0] <= t <= TIMES[-1]:
            assert at(CASES["cubic"], t) == pytest.approx(spline(t), rel=1e-13, abs=1e-13)
        else:
            end = VALUES[0] if t < TIMES[0] else VALUES[-1]
            assert at(CASES["cubic"], t).tolist() == end.tolist()


@pytest.mark.parametrize("count", [2, 3])
def test_cubic_table_of_few_times_is_the_polynomial_through_them(count: int) -> None:
    torque = table(TIMES[:count], VALUES[:count], "cubic")
    polynomial = np.polyfit(TIMES[:count], VALUES[:count], count - 1)
    for t in np.linspace(TIMES[0], TIMES[count - 1], 7)[:-1]:
        wanted = [np.polyval(column, t) for column in polynomial.T]
        assert at(torque, t) == pytest.approx(wanted, rel=1e-11, abs=1e-11)


def test_cubic_table_of_distant_times_is_its_parabola() -> None:
    torque = table([0.0, 1.0, 1e20], [(0, 0, 0), (1, 0, 0), (0, 0, 1)], "cubic")
    assert at(torque, 0.5) == pytest.approx([0.5, 0.0, 0.0], abs=1e-19)


def test_pulses_act_from_their_start_until_their_end() -> None:
    for t in [*np.linspace(-2.0, 4.0, 97), -1e9, 1e9]:
        wanted = np.zeros(3)
        for start, duration, each in zip(STARTS, DURATIONS, TORQUES, strict=True):
            if start <= t < start + duration:
                wanted = each
        assert at(CASES["pulses"], t).tolist() == wanted.tolist()


def test_one_torque_is_that_of_all_pulses() -> None:
    assert pulses(STARTS, DURATIONS, TORQUES[0]) == pulses(STARTS, DURATIONS, [TORQUES[0]] * 4)
    # Three rows are torques of three pulses, and three numbers are one torque.
    assert at(pulses([0, 1, 2], [1, 1, 1], TORQUES[:3]), 1.5).tolist() == TORQUES[1].tolist()
    assert at(pulses([0, 1, 2], [1, 1, 1], TORQUES[0]), 1.5).tolist() == TORQUES[0].tolist()


def test_pulses_that_touch_but_for_rounding_have_no_gap_and_no_overlap() -> None:
    starts = [n * 0.1 for n in range(50)]
    (found,) = tables_of(pulses(starts, [0.1] * 50, [(n, 0, 0) for n in range(1, 51)]))
    assert len(found.breaks) == 52
    assert np.diff(found.breaks[1:]) == pytest.approx(0.1)
    assert len(tables_of(pulses(starts, [0.1] * 50, (1, 0, 0)))[0].breaks) == 3


def test_axes_that_are_constant_have_no_table() -> None:
    torque = table([0, 1, 2], [(0, 5, 1), (0, 5, 1), (0, 5, 2)])
    (found,) = tables_of(torque)
    # Where the value remains, there is no break.
    assert found.breaks[1:].tolist() == [1.0, 2.0]
    assert at(torque, 1.5).tolist() == [0.0, 5.0, 1.5]
    assert tables_of(table([0, 1], [(0, 0, 0), (0, 0, 0)])) == []


@pytest.mark.parametrize(
    "times", [[-1.0, -1.0 + 2.0**-53], [1e300 - 1e285, 1e300], [0.0, 1e-300], [-1e300, 1e300]]
)
@pytest.mark.parametrize("interpolation", ["held", "linear"])
def test_breaks_are_in_order(times: list[float], interpolation: str) -> None:
    (found,) = tables_of(table(times, [(0, 0, 0), (1e-9, 0, 0)], interpolation))
    assert all(a < b for a, b in itertools.pairwise(found.breaks))
    assert all(map(math.isfinite, found.breaks))


# The tape.


@pytest.mark.parametrize("name", CASES)
def test_tables_are_operations_of_the_tape(name: str) -> None:
    torque: Any = CASES[name]
    assert torque.tape.inputs == {TIME}
    assert not torque.needs_attitude
    assert law_of(torque) is None
    for each in torque.tape.operations:
        assert each == Operation("table", (), None, each.table)
    # The tables remain in sums, in equations of motion, and about other axes.
    total = torque + damping(0.5) + TorqueLaw((1.0, 0.0, 0.0))
    assert tables_of(total) == tables_of(torque)
    tape = system_of(scene_with(total, **BODY), True)
    assert {each.table for each in tape.operations} - {None} == set(tables_of(torque))
    assert at(total, 1.2) == pytest.approx(at(torque, 1.2) - [2.5, 4.0, 4.5])
    axes = np.linalg.qr(SOURCE.normal(size=(3, 3)))[0]
    assert at(torque.rotated(axes), 1.2) == pytest.approx(axes.T @ at(torque, 1.2))


def test_table_of_anything_but_the_time_is_refused() -> None:
    (found, *_) = tables_of(CASES["linear"])
    for change in (lambda t, w: 2 * t, lambda t, w: t + 1, lambda t, w: w[0], lambda t, w: t * t):
        with pytest.raises(InputError, match="time"):
            replayed(lambda t, w, q, f=change: [SYMBOLS.table(found, f(t, w)), 0.0, 0.0])


# The motion.


def integral(each: Table, t: Fraction) -> Fraction:
    """Return the exact integral of a table from 0 to the time `t`."""

    def until(end: Fraction) -> Fraction:
        """Return the integral from a time before all others."""
        total, begins = Fraction(0), [Fraction(-100), *map(Fraction, each.breaks[1:])]
        rows = zip(begins, [*begins[1:], Fraction(100)], each.breaks, each.pieces, strict=True)
        for begin, after, origin, piece in rows:
            for power, c in enumerate(piece, 1):
                low, high = (min(x, end) - Fraction(origin) for x in (begin, after))
                total += Fraction(c) * (high**power - low**power) / power
        return total

    return until(t) - until(Fraction(0))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", CASES)
def test_reference_of_a_sphere_is_the_integral(name: str, side: int) -> None:
    torque = CASES[name]
    breaks = {t for each in tables_of(torque) for t in each.breaks[1:]}
    times = sorted({abs(t) for t in breaks if side * t > 0} | {0.4, 1.0, 1.7, 4.5})
    found: Any = reference(scene_with(torque, **SPHERE), [side * t for t in times])
    assert len(found.time) == len(times)
    assert found.estimate < 1e-25
    tables = tables_of(torque)
    assert len(tables) == 3
    for axis, start in enumerate((0.3, -1.1, 2.2)):
        for n, t in enumerate(times):
            wanted = Fraction(start) + integral(tables[axis], Fraction(side * t)) / 2
            error = Fraction(found.omega[n, axis]) + Fraction(found.remainder[n, axis]) - wanted
            assert abs(error) < 1e-25


def test_reference_of_held_torques_is_the_sum_of_torque_times_duration() -> None:
    torque = table([0.0, 0.5, 2.0, 3.0], [(1, 0, 0), (0, 4, 0), (-2, 0, 8), (0, 0, 0)], "held")
    found = reference(Scene("held", (0.0, 0.0, 0.0), torque=torque, **SPHERE), [0.5, 1.0, 4.0])
    assert found.omega.tolist() == [[0.25, 0, 0], [0.25, 1.0, 0], [-0.75, 3.0, 4.0]]
    found = reference(Scene("held", (0.0, 0.0, 0.0), torque=torque, **SPHERE), [-1.0, -4.0])
    assert found.omega.tolist() == [[-0.5, 0, 0], [-2.0, 0, 0]]


def test_reference_accepts_a_short_pulse_in_a_long_motion() -> None:
    """A step that ends early at a break is no sign of many steps until the end."""
    torque = pulses([1e-9, 1e-6], [1e-9, 1e-9], (2e9, 0, 0))
    found = reference(Scene("short", (0.0, 0.0, 0.0), torque=torque, **SPHERE), [1e6], effort=0.01)
    assert found.omega[0] == pytest.approx([2.0, 0.0, 0.0], rel=1e-9)


def test_reference_accepts_many_pulses_before_a_long_motion() -> None:
    torque = pulses([1e-6 * n for n in range(50)], [5e-7] * 50, (8e4, 0, 0))
    scene = Scene("many", (0.0, 0.0, 0.0), torque=torque, **SPHERE)
    assert reference(scene, [1e6], effort=1.0).omega[0] == pytest.approx([1.0, 0.0, 0.0], rel=1e-9)
    # Each pulse takes two steps, which count in the work limit.
    refused("50", reference, scene, [1e6], effort=0.0025)


@pytest.mark.parametrize("name", CASES)
def test_reference_of_a_general_body_continues_at_a_break(name: str) -> None:
    """A motion back from a state returns to the start; the breaks are in both directions."""
    torque, end = CASES[name], 2.5
    scene = scene_with(torque, **BODY)
    there = reference(scene, [end])
    # Time is shifted, so that the same table is on the other side of 0.
    moved = [Table(tuple(t - end for t in each.breaks), each.pieces) for each in tables_of(torque)]
    back = replayed(lambda t, w, q: [SYMBOLS.table(each, t) for each in moved])
    again = reference(Scene("back", there.omega[0], torque=back, **BODY), [-end])
    assert again.omega[0] == pytest.approx(scene.omega, abs=1e-13)


def test_slopes_have_the_torque_over_the_moment() -> None:
    scene = Scene("rest", (0.0, 0.0, 0.0), torque=CASES["linear"], **BODY)
    found = slopes_of(scene)(1.2, [0.0] * 3)
    assert found == pytest.approx(at(CASES["linear"], 1.2) / BODY["moments"])


@pytest.mark.parametrize("start", [1.0, 1e3, 1e6, 1e9])
def test_the_impulse_of_a_late_pulse_is_torque_times_duration(start: float) -> None:
    alone = pulses([start], [0.02], (50.0, 0.0, 0.0))
    train = pulses([start, start + 0.02], [0.02, 0.03], [(20.0, 0.0, 0.0), (20.0, 0.0, 0.0)])
    for torque in (alone, train):
        found = solve(Scene("", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), torque=torque), [2.0 * start])
        assert found.omega[0, 0] == pytest.approx(1.0, abs=4e-15)


@pytest.mark.sampled
@pytest.mark.parametrize("duration", [1e-2, 1e-5, 1e-7])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_short_pulse_on_a_body_at_rest_sets_its_scale(duration: float, side: float) -> None:
    """The pulse, extended to the end, would have let expect a much larger omega."""
    push = tuple(each / duration for each in (1e-3, 2e-3, 1e-3))
    start = 1.0 if side > 0.0 else -1.0 - duration
    torque = pulses([start], [duration], push) + wheels((30.0, 20.0, 10.0))
    scene = Scene("", (0.0, 0.0, 0.0), moments=(4.0, 3.0, 2.0), torque=torque)
    truth = reference(scene, [side * 3.0]).omega
    for tolerance in (1e-3, 1e-6, 1e-12):
        found: Any = solve(scene, [side * 3.0], tolerance=tolerance)
        error = np.abs(found.omega - truth).max() / np.abs(truth).max()
        # Near rounding errors the estimate is one by order of magnitude.
        assert error <= found.error + 4e-15 * found.growth
        assert found.error <= tolerance


@pytest.mark.parametrize("duration", [1e-6, 1e-8])
def test_first_step_that_a_pulse_cuts_forecasts_nothing(duration: float) -> None:
    torque = pulses([0.0], [duration], (1e-3 / duration, 0.0, 0.0))
    scene = Scene("", (0.1, 0.2, 0.3), moments=(4.0, 3.0, 2.0), torque=torque)
    found = solve(scene, [100.0], tolerance=1e-9)
    assert (found.ended, found.steps < 100) == ("complete", True)
    assert np.abs(found.omega - reference(scene, [100.0]).omega).max() < 1e-9


def test_arrays_and_frames_are_those_of_lists() -> None:
    source = np.random.default_rng(7)
    times, values = np.sort(source.uniform(0.0, 9.0, 300)), source.normal(size=(300, 3))
    frame = pandas.DataFrame(values, index=times, columns=["x", "y", "z"])
    whole = np.round(100 * values).astype(int)
    for way in ("held", "linear", "cubic"):
        wanted = table(times.tolist(), values.tolist(), way)
        assert table(times, values, way) == wanted
        assert table(frame.index, frame, way) == wanted
        assert table(times, 2.0 * values, way).tape != wanted.tape
        assert table(times, whole, way) == table(times, whole.tolist(), way)
    masked = np.ma.masked_greater(values[:3], 2.0 * values.max())
    assert table([0, 1, 2], masked) == table([0, 1, 2], values[:3])
    refused("values", table, [0, 1, 2], np.ma.masked_less(values[:3], 0.0))
    assert table([0, 1, 2], np.eye(3)).terms == table([0, 1, 2], np.eye(3).tolist()).terms


def test_a_long_table_is_solved_piece_by_piece() -> None:
    times, values = np.arange(100_001) * 0.01, np.zeros((100_001, 3))
    values[:, 2] = np.arange(100_001) % 2
    scene = Scene("", (0.0, 0.0, 1.0), moments=(1.0, 2.0, 2.5), torque=table(times, values, "held"))
    assert solve(scene, [1.0, 3.0]).omega[:, 2] == pytest.approx([1.2, 1.6], abs=1e-12)

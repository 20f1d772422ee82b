"""Trials of motions: torque, length, invariance, threads; and plants that each must catch."""

import random
import time
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest

import pyharness.methods.prepared as room
from pyharness import InputError, Scene, TorqueLaw, prepare, solve
from pyharness.compare.checks import Check
from pyharness.model import extension
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array
from pyharness.stress.run import TRIALS, trial, worst
from pyharness.stress.trials import invariance, length, threads
from pyharness.theory import brouwer
from pyharness.truth.axial_top import axial_top
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference
from tests.exact_tops import DIGITS, exact_top

OWN = ("torque", "length", "invariance", "threads")


def _failed(checks: Sequence[Check]) -> list[str]:
    return [check.id for check in checks if not check.passed]


# The truth of the trials.


def test_the_torque_free_top_has_forty_digits() -> None:
    source = random.Random(5)
    for _ in range(50):
        sign = source.choice((1.0, -1.0))
        a = [sign * each * 10 ** source.uniform(-1, 1) for each in (1.0, -1.0, 1.0)]
        turn = source.randrange(3)
        a = a[turn:] + a[:turn]
        omega = [source.choice((-1.0, 1.0)) * 10 ** source.uniform(-2, 1) for _ in range(3)]
        at = source.choice((-1.0, 1.0)) * 10 ** source.uniform(-2, 7)
        scene = Scene("", (omega[0], omega[1], omega[2]), coefficients=(a[0], a[1], a[2]))
        found = torque_free(scene, at)
        with mpmath.workdps(DIGITS):
            exact = exact_top(a, omega, at)
            error = max(abs(mpmath.mpf(str(x)) - y) for x, y in zip(found, exact, strict=True))
            assert error <= mpmath.mpf(10) ** -40 * max(map(abs, omega)), (a, omega, at)


def test_the_axial_top_is_the_reference() -> None:
    law = TorqueLaw(
        (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), (((0.0, 0.0, 5.0), 30.0), ((0.0, 0.0, 1.0), 0.0)),
        (((0.0, 0.0, 7.0), 10.0), ((0.0, 0.0, 2.0), 0.0)),
    )  # fmt: skip
    scene = Scene("", (1.0, 2.0, 3.0), moments=(40.0, 40.0, 20.0), torque=law)
    times = [0.3, 2.0]
    truth = reference(scene, times, precise=True)
    found = np.array([[float(w) for w in row] for row in axial_top(scene, times)])
    assert np.abs(found - truth.omega).max() <= 2.0 * truth.error
    with pytest.raises(InputError, match="axis 3"):
        axial_top(replace(scene, moments=(40.0, 41.0, 20.0)), times)


# The trials.


def test_every_trial_of_motions_is_there() -> None:
    for name in OWN:
        assert name in TRIALS
        assert trial(name).name == name
        assert trial(name).bound


@pytest.mark.parametrize(
    ("name", "only"),
    [
        (
            "torque",
            ["torque/taylor/fast-1e6", "torque/taylor/axial-1e6", "torque/taylor/huge-1e+12"],
        ),
        ("torque", ["torque/gauss-2/huge-from-rest", "torque/dop853/tiny-5e-324"]),
        ("torque", ["torque/quick/averaged-1e16", "torque/prepared-auto/resonant"]),
        ("torque", ["torque/closed-form", "torque/runge-kutta/axial-1e6"]),
        ("length", ["length/closed-form", "length/dop853", "length/two-term/case-4/corrected"]),
        ("invariance", ["invariance/taylor", "invariance/gauss-4", "invariance/runge-kutta"]),
        ("invariance", ["invariance/dop853", "invariance/closed-form", "invariance/quick"]),
        ("threads", ["threads/taylor", "threads/prepared-auto", "threads/refusals"]),
        ("threads", ["threads/lsoda", "threads/gauss-8", "threads/two-term"]),
    ],
)
def test_bounds_hold(name: str, only: list[str]) -> None:
    outcomes = list(trial(name).run(only))
    assert _failed([each.check for each in outcomes]) == []
    asked = {each.split("/")[1] for each in only}
    assert {each.check.id.split("/")[1] for each in outcomes} == asked
    assert len({each.check.id for each in outcomes}) == len(outcomes)
    assert worst(outcomes)


@pytest.mark.parametrize("name", length.MARCHERS)
@pytest.mark.parametrize("motion", length.MOTIONS)
def test_brouwers_law_holds(name: str, motion: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To 1e4 revolutions; with four stages energy drifts there if weights lose their low words."""
    monkeypatch.setattr(length, "_FIT_FROM", 1e2)
    shorter = replace(length.MARCHERS[name], revolutions=1e4, others=1e4)
    checks = [each.check for each in length.hold(name, shorter, motion)]
    assert _failed(checks) == []
    assert len(checks) == 3 * 8


def test_the_power_tells_chance_from_a_preference() -> None:
    """Of a thousand sets of true random walks hardly one is taken for a drift, or the reverse."""
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


# Plants.


def _stepped(bias: float) -> length.Runner:
    """Return a runner in single steps whose results are pushed outward by so many roundings."""

    def run(scene: Scene, times: Sequence[float]) -> tuple[Array, Array]:
        step = 0.5 / max(map(abs, scene.omega))
        solver = prepare(replace(scene, step_size=step), "gauss-8")
        omega, rows, counts, begin, count = np.array(scene.omega), [], [], 0.0, 0
        for each in times:
            number = max(1, round((each - begin) / step))
            for _ in range(number):
                omega = solver(omega, (each - begin) / number)
                omega += bias * brouwer.ROUNDING * omega
            begin, count = each, count + number
            rows.append(omega)
            counts.append(count)
        return np.array(rows), np.array(counts, dtype=float)

    return run


@pytest.mark.parametrize("bias", [0.0, 2.0])
def test_a_rounding_with_a_preference_is_found(
    bias: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(length, "_FIT_FROM", 10.0)
    contender = replace(length.MARCHERS["gauss-8"], run=_stepped(bias), revolutions=1e3, others=1e3)
    failed = _failed([each.check for each in length.hold("planted", contender, "tumbling")])
    wanted = [f"length/planted/tumbling/{what}/power" for what in ("energy", "momentum", "phase")]
    assert [id for id in failed if id.endswith("power")] == (wanted if bias else [])


def test_half_a_step_in_the_label_of_time_is_found_by_phase_alone() -> None:
    def late(scene: Scene, times: Sequence[float]) -> tuple[Array, Array]:
        half = 0.5 * times[-1] / 1e5
        return solve(scene, [t + half for t in times], "taylor", 1e-15).omega, np.array(times)

    contender = replace(length.MARCHERS["taylor"], run=late, revolutions=1e4, others=1e4)
    failed = _failed([each.check for each in length.hold("late", contender, "case-4")])
    at_horizons = [id for id in failed if not id.endswith("power")]
    assert len(at_horizons) == 7
    assert all("/phase/" in id for id in at_horizons)


def test_a_swapped_axis_is_found_by_turning_the_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    """B and C are taken for each other: all signs still change together, the axes do not turn."""
    honest = invariance.end

    def swapped(scene: Scene, at: float, name: str, tolerance: float) -> Array:
        a, b, c = scene.euler_coefficients
        return honest(replace(scene, moments=None, coefficients=(a, c, b)), at, name, tolerance)

    scene, at = invariance.SCENES["free"]
    found = {}
    for end in (honest, swapped):
        monkeypatch.setattr(invariance, "end", end)
        for what in ("cyclic", "signs-12"):
            symmetry = invariance.SYMMETRIES[what]
            for name in ("taylor", "gauss-4"):
                check = invariance.turned_check("id", scene, at, name, 1e-9, symmetry)
                found[end is swapped, what, name] = check.passed
    assert [key for key, passed in found.items() if not passed] == [
        (True, "cyclic", "taylor"),
        (True, "cyclic", "gauss-4"),
    ]


def test_one_unit_in_the_last_place_is_found_where_bits_are_held(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Added where omega1 is negative: rounding that knows signs."""
    honest = invariance.end

    def pushed(scene: Scene, at: float, name: str, tolerance: float) -> Array:
        omega = honest(scene, at, name, tolerance)
        return np.nextafter(omega, np.inf) if scene.omega[0] < 0.0 else omega

    monkeypatch.setattr(invariance, "end", pushed)
    scene, at = invariance.SCENES["driven"]
    symmetry = invariance.SYMMETRIES["signs-12"]
    assert not invariance.turned_check("id", scene, at, "taylor", 1e-9, symmetry).passed


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

    differing = threads.different([job(number) for number in range(8)], repeats=2)
    assert bool(differing) == shared


@pytest.mark.parametrize("shared", [False, True])
def test_a_kernel_that_writes_where_all_do_is_found(
    shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All threads call one solver, whose buffer was its own."""
    entry, buffer = extension.extension().solve_packed, np.zeros(3)

    def kernel(*arguments: Any) -> Any:
        omega, *rest = entry(*arguments)
        own = buffer if shared else np.zeros(3)
        own[:] = omega
        time.sleep(1e-5)
        return own.copy(), *rest

    monkeypatch.setattr(room, "extension", lambda: SimpleNamespace(solve_packed=kernel))
    threads._shared.cache_clear()
    jobs = [each for each in threads.jobs() if each.subject == "prepared-rk4"]
    differing = threads.different(jobs, repeats=3)
    threads._shared.cache_clear()
    assert len(jobs) == 3
    assert bool(differing) == shared


# What the trials found.


@pytest.mark.parametrize("omega", [(0.3, 1.0, 2.0), (1e-6, 0.0, 0.0)])
@pytest.mark.parametrize("size", [1e4, 1e12])
@pytest.mark.parametrize("name", ["gauss-2", "gauss-8"])
def test_growth_by_a_huge_torque_is_no_blow_up(name: str, size: float, omega: Triple) -> None:
    law = TorqueLaw((size, 0.7 * size, -0.5 * size))
    scene = Scene("", omega, moments=(40.0, 30.0, 20.0), torque=law)
    at = (4e3 / size) ** 0.5
    found = solve(scene, [at], name, 1e-8)
    assert found.ended == "complete"
    truth = reference(scene, [at]).omega
    assert np.abs(found.omega - truth).max() <= 1e-6 * np.abs(truth).max()


def test_what_blows_up_by_itself_still_does() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    assert solve(scene, [2.0], "gauss-4", 1e-8).ended == "overflow"

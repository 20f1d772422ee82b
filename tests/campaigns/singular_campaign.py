"""Torques with roots and powers that reach 0, against closed forms or in smooth variables.

The command is ``python -m tests.campaigns.singular_campaign COUNT SEED [FIRST]``. The limit of an
error is the tolerance plus 4e-15 K.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import mpmath
import numpy as np
from mpmath import mp
from scipy.integrate import solve_ivp

from pyharness import InputError, Scene, solve
from pyharness.model.trajectory import Array
from tests.campaigns import driver

MODULE = "tests.campaigns.singular_campaign"
SPHERE, BRICK = (1.0, 1.0, 1.0), (1.0, 2.0, 3.0)
_MOST = 20_000  # evaluations near a zero of a rate
_SETTLED = 1e-2  # largest change of the truth by its own tolerance, over the tolerance


@dataclass(frozen=True)
class Case:
    """A scene, its times, and the true omega there; own states follow omega."""

    scene: Scene
    times: list[float]
    truth: Array  # shape (n, 3 or more)
    scale: float


def _powers() -> list[tuple[str, float, Callable[[Any], Any]]]:
    return [
        ("root", 0.5, lambda x: np.sqrt(np.abs(x)) * np.sign(x)),
        ("power 3/2", 1.5, lambda x: np.abs(x) ** 1.5 * np.sign(x)),
        ("cube root", 1.0 / 3.0, lambda x: np.abs(x) ** (1.0 / 3.0) * np.sign(x)),
        ("power 2/3", 2.0 / 3.0, lambda x: np.abs(x) ** (2.0 / 3.0) * np.sign(x)),
        ("norm", 2.0, lambda x: np.sqrt(x * x) * x),
    ]


def _on_axis(axis: int, value: Any, zero: Any) -> list[Any]:
    return [value if k == axis else zero for k in range(3)]


def timed(source: Random) -> Case:
    """Return a power of the time since an instant, about one axis of a sphere."""
    _, p, f = source.choice(_powers())
    begin = source.choice([0.0, source.uniform(0.1, 2.0)])
    a, end, axis = source.uniform(-2.0, 2.0), source.uniform(2.5, 5.0), source.randrange(3)
    start = source.choice([0.0, source.uniform(-1.0, 1.0)])
    scene = Scene("timed", tuple(_on_axis(axis, start, 0.0)), moments=SPHERE,
                  torque=lambda t, w: _on_axis(axis, a * f(t - begin), 0.0 * t))  # fmt: skip
    times = [0.4 * end, end]
    rows = [
        start + a / (p + 1.0) * (abs(t - begin) ** (p + 1.0) - begin ** (p + 1.0)) for t in times
    ]
    return _single(scene, axis, times, rows, start)


def high(source: Random) -> Case:
    """Return a high power of the time from rest, of omega or an own state."""
    n, axis, end = source.randint(10, 45), source.randrange(3), source.uniform(0.5, 3.0)
    times = [0.5 * end, end]
    rows = [(t / end) ** (n + 1) for t in times]

    def rate(t: Any) -> Any:
        return (n + 1) / end * (t / end) ** n

    if source.random() < 0.5:
        scene = Scene("high", (0.0, 0.0, 0.0), moments=BRICK, torque=lambda t, w: _on_axis(
            axis, BRICK[axis] * rate(t), 0.0 * t))  # fmt: skip
        return _single(scene, axis, times, rows, 0.0)
    omega = source.choice([(0.0, 0.0, 0.0), (0.0, 0.3, 0.0)])
    scene = Scene("high state", omega, moments=BRICK, states={"x": 0.0},
                  torque=lambda t, w, s: (0.0 * w, {"x": rate(t)}))  # fmt: skip
    return Case(scene, times, np.array([[*omega, x] for x in rows]), max(omega))


def dragged(source: Random) -> Case:
    """Return a constant push against a power of omega, about one axis of a sphere."""
    _, p, f = source.choice(_powers())
    k, push, axis = source.uniform(0.1, 1.0), source.uniform(0.3, 1.5), source.randrange(3)
    start = source.choice([0.0, -source.uniform(0.2, 2.0)])
    scene = Scene("dragged", tuple(_on_axis(axis, start, 0.0)), moments=SPHERE,
                  torque=lambda t, w: _on_axis(axis, push - k * f(w[axis]), 0.0 * t))  # fmt: skip
    limit = (push / k) ** (1.0 / p)
    ends = [source.uniform(0.05, 0.6) * limit, source.uniform(0.6, 0.9) * limit]
    with mp.workdps(30):
        slowness = lambda w: 1 / (push - k * mpmath.sign(w) * abs(w) ** mpmath.mpf(p))  # noqa: E731
        before = mpmath.quad(slowness, [start, 0]) if start else 0
        exact = [float(before + mpmath.quad(slowness, [0, end])) for end in ends]
    return _single(scene, axis, exact, ends, start)


def crossing(source: Random) -> Case:
    """Return a brick under powers of its rates w; in v, w = v**m, the motion is smooth."""
    _, p, f = source.choice(_powers()[:4])
    k = source.uniform(0.01, 0.1)
    start = tuple(source.uniform(-1.0, 1.0) for _ in range(3))
    scene = Scene("crossing", start, moments=BRICK, torque=lambda t, w: -k * f(w))
    end = source.uniform(5.0, 20.0)
    rows = [smooth_motion(start, k, p, end, tolerance) for tolerance in (1e-13, 1e-11)]
    if np.abs(rows[0] - rows[1]).max() > 1e-9:
        raise ValueError("the truth is not settled")
    return Case(scene, [end], rows[0][None], max(map(abs, start)))


def smooth_motion(
    start: tuple[float, ...], k: float, p: float, end: float, tolerance: float
) -> Array:
    """Return omega at `end`; near a zero of a rate, a root of the rate is the variable."""
    m = round(1.0 / math.gcd(round(6 * p), 6) * 6)
    near = 0.02 * max(map(abs, start))

    def rates(w: Array) -> Array:
        x, y, z = w
        a = np.array([(2.0 - 3.0) * y * z, (3.0 - 1.0) * z * x, (1.0 - 2.0) * x * y])
        found: Array = (a - k * np.abs(w) ** p * np.sign(w)) / np.array(BRICK)
        return found

    def entered(i: int, side: float) -> Any:
        def event(t: float, w: Array) -> float:
            return side * float(w[i]) - near

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event

    options: Any = {"method": "DOP853", "rtol": tolerance, "atol": 1e-3 * tolerance}
    time = 0.0
    state: Array = np.array(start)
    zones = [(i, side) for i in range(3) for side in (1.0, -1.0)]
    while time < end:
        if [i for i in range(3) if abs(state[i]) < near]:
            raise ValueError("two rates are near 0, or one turns there")
        found: Any = solve_ivp(lambda t, w: rates(w), (time, end), state,
                          events=[entered(*zone) for zone in zones], **options)  # fmt: skip
        time, state = float(found.t[-1]), found.y[:, -1]
        if not time < end:
            return state
        i, side = next(zone for zone, each in zip(zones, found.t_events, strict=True) if len(each))
        v = near ** (1.0 / m)
        for sign, span in ((side, (v, 0.0)), (-side, (0.0, v * (1.0 + 1e-9)))):
            left = iter(range(_MOST))

            def slopes(
                v: float, y: Array, sign: float = sign, i: int = i, left: Any = left
            ) -> Array:
                if next(left, None) is None:
                    raise ValueError("the rate turns near 0, where the slopes are infinite")
                w = y[1:].copy()
                w[i] = sign * v**m
                f = rates(w)
                change: Array = np.array([1.0, *f]) * (sign * m * v ** (m - 1) / f[i])
                return change

            def at_end(v: float, y: Array) -> float:
                return float(y[0] - end)

            at_end.terminal = True  # type: ignore[attr-defined]
            found = solve_ivp(slopes, span, [time, *state], events=at_end, **options)
            if found.status < 0 or not np.all(np.diff(found.y[0]) > 0.0):
                raise ValueError("the rate turns near 0")
            time, state = float(found.y[0, -1]), found.y[1:, -1]
            if found.status == 1:
                return state
            state[i] = sign * found.t[-1] ** m
    return state


def _single(scene: Scene, axis: int, times: list[float], rows: list[float], start: float) -> Case:
    truth = np.zeros((len(times), 3))
    truth[:, axis] = rows
    return Case(scene, times, truth, max(abs(start), *map(abs, rows)))


FAMILIES = [timed, high, dragged, crossing]


def try_scene(tally: driver.Tally) -> None:
    """Solve one random scene with one tolerance."""
    source = Random(f"singular {tally.seed} {tally.number}")
    family = FAMILIES[tally.number % len(FAMILIES)]
    tolerance = 10.0 ** source.uniform(-12.0, -3.0)
    try:
        case = family(source)
    except ValueError:
        tally.counts[f"{family.__name__}: no truth"] += 1
        return
    if family is crossing:
        tolerance = max(tolerance, 1e-8)
    try:
        found: Any = solve(case.scene, case.times, tolerance=tolerance, dense_output=True)
    except InputError as refusal:
        tally.fault(f"{family.__name__}: {refusal}")
        return
    more = f", tolerance {tolerance:.3g}"
    tally.counts[f"{family.__name__}: {found.ended}"] += 1
    if len(found.omega) < len(case.times):
        tally.fault(f"{family.__name__}: {found.ended}{more}: {found.reason}")
        return
    limit = tolerance + 4e-15 * (found.growth or 1.0)
    for name, values in (("row", found.omega), ("sol", np.atleast_2d(found.sol(case.times).T))):
        error = float(np.abs(values[:, :3] - case.truth[:, :3]).max()) / (case.scale or 1.0)
        tally.judge(f"{family.__name__}: {name}", error, limit, more)
    if found.error is not None:
        tally.record(f"{family.__name__}: estimate over limit", found.error / limit)
    if case.truth.shape[1] > 3:
        own = np.asarray(found.states["x"])
        error = float(np.abs(own - case.truth[:, 3]).max() / np.abs(case.truth[:, 3]).max())
        tally.judge(f"{family.__name__}: state", error, limit, more)


if __name__ == "__main__":
    sys.exit(driver.run(MODULE, try_scene, sys.argv[1:]))

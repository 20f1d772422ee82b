"""Random scenes, whose sensitivities are compared with differences of solutions of 40 digits.

The command is ``python -m tests.campaigns.parameter_campaign COUNT SEED [FIRST]``. The limit of a
relative error, at a tolerance of 1e-12, is 1e-9 or 4e-14 times the error amplification if larger.
"""

import decimal
import sys
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from functools import partial
from random import Random
from typing import Any

import numpy as np

from pyharness import InputError, Scene, TorqueLaw, solve
from pyharness.checks.scenes.state_scenes import STEADY, TURNING, draw, draw_ready
from pyharness.model.state_torque import of_law
from pyharness.model.trajectory import Array
from pyharness.truth.decimal_series import taylor_series
from pyharness.truth.reference import exact_coefficients
from tests.campaigns import driver

TOLERANCE, LIMIT, LIMIT_OF_GROWTH = 1e-12, 1e-9, 4e-14
KINDS = ("free", "law", "space", "function", "terms", "ready")
_DIGITS, _ORDER, _LOCAL = 40, 32, Decimal("1e-32")
_EXPONENT = -20  # of the differences of a parameter, relative
_EFFORT = 0.1  # factor on the work limit of a solution
_PARTS = (0.37, 1.0)  # of the last time
# Weights of the solutions with twice and once the difference, on both sides: order four.
_STENCIL = (
    (-2, Decimal(1) / 12), (-1, Decimal(-8) / 12), (1, Decimal(8) / 12), (2, Decimal(-1) / 12),
)  # fmt: skip


def random_scene(source: Random, kind: str) -> tuple[Scene, float, list[str]]:
    """Return a random scene of a kind, a time (s), and the names of its parameters."""
    names = ["omega", "moments"]
    if kind in ("terms", "ready"):
        drawn = draw(source, STEADY + TURNING) if kind == "terms" else draw_ready(source)
        return *drawn, names + ["attitude"] * (drawn[0].attitude is not None)
    moments = _moments(source)
    omega = _three(source, 1.5)
    time = source.choice((-1.0, 1.0)) * source.uniform(2.0, 15.0)
    scene = Scene(kind, omega, moments)
    if kind == "free":
        return scene, time, [*names, "torque.constant"]
    if kind == "function":
        torque: Any = partial(_torque, **{name: source.uniform(0.05, 0.5) for name in "abc"})
        # Towards earlier times omega would grow without bound.
        return (
            replace(scene, torque=torque),
            abs(time),
            names + [f"torque.{name}" for name in "abc"],
        )
    wave = (_three(source, 0.3), source.uniform(0.3, 3.0))
    law = TorqueLaw(_three(source, 0.2), _three(source, 0.02), [wave], [wave], "body")
    names += [f"torque.{name}" for name in ("constant", "rate", "sines", "cosines")]
    if kind == "space":
        scene = replace(scene, attitude=(1.0, *_three(source, 1.0)))
        return replace(scene, torque=replace(law, frame="space")), time, [*names, "attitude"]
    return replace(scene, torque=law), time, names


def _torque(t: Any, omega: Any, *, a: float, b: float, c: float) -> list[Any]:
    x, y, z = omega
    return [-a * x - b * x**3, b * np.sin(c * t) - a * y, c * x / np.sqrt(1.0 + z * z)]


def differences(scene: Scene, names: list[str], times: list[float]) -> dict[str, Array] | None:
    """Return the derivatives with respect to parameters from solutions of 40 digits.

    The result is None if a solution of the scene is not known at all times.
    """
    found = {}
    for name in names:
        columns = []
        for steps in _variants(scene, name):
            total: Any = 0
            for (factor, weight), (size, variant) in zip(_STENCIL, steps, strict=True):
                solution = _solution(variant, times)
                if solution is None:
                    return None
                total = total + weight / (Decimal(size) / factor) * solution
            columns.append(total)
        found[name] = np.moveaxis(np.array(columns, dtype=float), 0, 2)
    return found


def _solution(scene: Scene, times: list[float]) -> Any:
    if scene.torque.in_space:
        scene = replace(scene, torque=of_law(scene.law))
    coefficients = exact_coefficients(scene)
    exact = [Decimal(t) for t in times]
    rows = taylor_series(scene, coefficients, exact, False, _ORDER, _LOCAL, _EFFORT)
    return np.array([list(row) for row in rows]) if len(rows) == len(times) else None


def _variants(scene: Scene, name: str) -> Iterator[list[tuple[float, Scene]]]:
    """Yield for each value of a parameter the differences of the stencil, and their scenes."""
    law: Any = scene.torque
    for k in range(len(_values(scene, name))):
        steps = []
        for factor, _ in _STENCIL:
            values: Any = list(_values(scene, name))
            size = factor * 2.0 ** (_EXPONENT + int(np.floor(np.log2(abs(values[k]) or 1.0))))
            before = values[k]
            values[k] += size
            size = values[k] - before
            if name == "omega":
                changed = replace(scene, omega=values)
            elif name == "moments":
                changed = replace(scene, moments=values)
            elif name in ("torque.constant", "torque.rate"):
                changed = replace(scene, torque=replace(law, **{name[7:]: values}))
            elif name in ("torque.sines", "torque.cosines"):
                wave = (values[:3], values[3])
                changed = replace(scene, torque=replace(law, **{name[7:]: [wave]}))
            else:
                keywords = dict(law.parameters) | {name[7:]: values[0]}
                torque: Any = partial(_torque, **keywords)
                changed = replace(scene, torque=torque)
            steps.append((size, changed))
        yield steps


def _values(scene: Scene, name: str) -> list[float]:
    if name in ("omega", "moments"):
        return list(getattr(scene, name.removesuffix("0")) or ())
    torque: Any = scene.torque
    if name in ("torque.constant", "torque.rate"):
        return list(getattr(torque, name[7:]))
    if name in ("torque.sines", "torque.cosines"):
        ((amplitude, frequency),) = getattr(torque, name[7:])
        return [*amplitude, frequency]
    return [dict(torque.parameters)[name[7:]]]


def error_of(scene: Scene, time: float, names: list[str]) -> tuple[float, float] | None:
    """Return the largest relative error of a column, and the error amplification.

    Derivatives with respect to the attitude are not compared. The result is None for a scene that
    can't be solved.
    """
    names = [name for name in names if name != "attitude"]
    times = [part * time for part in _PARTS]
    attitude = scene.attitude is not None
    try:
        found = solve(scene, times, "auto", TOLERANCE, attitude=attitude, sensitivities=names)
        with decimal.localcontext() as context:
            context.prec = _DIGITS
            truth = differences(scene, names, times)
    except InputError:
        return None
    if truth is None or found.sensitivities is None or len(found.time) < len(times):
        return None
    worst = 0.0
    for name in names:
        values, exact = found.sensitivities[name], truth[name]
        size = np.abs(exact).max(axis=(0, 1))
        error = np.abs(values - exact).max(axis=(0, 1))
        worst = max(worst, float((error[size > 0.0] / size[size > 0.0]).max(initial=0.0)))
    return worst, found.growth or 1.0


def _moments(source: Random) -> tuple[float, ...]:
    a, b, c = (source.uniform(0.2, 2.0) for _ in range(3))
    return b + c, c + a, a + b


def _three(source: Random, size: float) -> tuple[float, float, float]:
    x, y, z = (source.uniform(-size, size) for _ in range(3))
    return x, y, z


def try_scene(tally: driver.Tally) -> None:
    """Compare the sensitivities of a random scene."""
    source = Random(f"sensitivities {tally.seed} {tally.number}")
    kind = KINDS[tally.number % len(KINDS)]
    found = error_of(*random_scene(source, kind))
    if found is None:
        tally.counts["not solved"] += 1
    else:
        tally.judge(kind, found[0], max(LIMIT, LIMIT_OF_GROWTH * found[1]))


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.parameter_campaign", try_scene, sys.argv[1:]))

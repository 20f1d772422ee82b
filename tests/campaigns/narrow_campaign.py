"""A campaign of torques that act in a short time or a narrow band of omega, by every entry point.

The command is ``python -m tests.campaigns.narrow_campaign COUNT SEED [FIRST]``. A symmetric body
rotates about its axis under a torque about this axis. The torque is a pulse, a switch, a kink or a
brake in a narrow band of omega, of relative widths from 1e-7 to .03, or it has a pole, or a root
whose argument becomes negative. The true omega is known in closed form. Each scene is solved by
`auto` through every entry point, and by one of the other methods. The limit of the error of a
`complete` result is the tolerance plus 4e-15 K. Beyond a pole every such result is a fault.
"""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any, NamedTuple

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

from pyharness import InputError, Scene, Stepper, Taylor, prepare, solve, solve_many
from pyharness.engine.plan.registry import METHODS
from pyharness.model.attitude import IDENTITY
from pyharness.model.state_torque import StateTorque, torque_of
from tests.campaigns import driver

TIME, MOMENT = 20.0, 3.0
_EFFORT = 0.2
_WAYS = ("solve", "prepare", "solve_many", "sol", "Stepper", "Taylor")
# Tolerances of the other methods: SciPy's would take long at smaller ones.
_FINEST = {"rk45": 1e-7, "radau": 1e-5, "lsoda": 1e-7, "dop853": 1e-9}


class Drawn(NamedTuple):
    """A scene, and its omega about axis 3 at the last time (rad/s); None if there is none."""

    kind: str
    scene: Scene
    omega: float | None


def _softplus(x: Any) -> Any:
    return max(x, 0) + mpmath.log1p(mpmath.exp(-abs(x)))


# Torques over the moment, and their integrals over time in units of the width.
_FORMS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "bell": (lambda x: np.exp(-x * x), lambda x: mpmath.sqrt(mpmath.pi) / 2 * mpmath.erf(x)),
    "sech": (lambda x: 1 / np.cosh(x), lambda x: 2 * mpmath.atan(mpmath.tanh(x / 2))),
    "sech2": (lambda x: 1 / np.cosh(x) ** 2, mpmath.tanh),
    "bump": (lambda x: 1 / (1 + x * x), mpmath.atan),
    "logistic": (lambda x: 1.0 / (1.0 + np.exp(-x)), _softplus),
    "Fermi": (lambda x: 1.0 - 1.0 / (np.exp(x) + 1.0), _softplus),
    "tanh": (lambda x: 0.5 + 0.5 * np.tanh(0.5 * x), _softplus),
    "kink": (lambda x: np.sqrt(x * x), lambda x: x * abs(x) / 2),
}


def _timed(source: Random, kind: str, width: float) -> Drawn:
    """Return a scene whose torque depends on time alone."""
    centre, added = source.uniform(0.1, 0.9) * TIME, source.uniform(0.1, 0.5)
    start = source.choice((0.0, 1.0))
    form, primitive = _FORMS[kind]
    size = added / (TIME if primitive is _softplus else width)
    if kind == "kink":
        size, width = added / TIME**2, 1.0

    def torque(t: Any, w: Any) -> Any:
        return [0.0, 0.0, MOMENT * size * form((t - centre) / width)]

    a, b, c = map(mpmath.mpf, (centre, width, size))
    omega = start + c * b * (primitive((TIME - a) / b) - primitive(-a / b))
    scene = Scene(kind, (0.0, 0.0, start), moments=(2.0, 2.0, MOMENT), torque=torque)
    return Drawn(kind, scene, float(omega))


def _band(source: Random, width: float) -> Drawn:
    """Return a scene with a brake that is stronger in a narrow band of omega."""
    level, strength = source.uniform(0.6, 0.9), 10.0 ** source.uniform(-1.0, 2.0)
    rate = source.uniform(0.2, 0.5) / TIME

    def torque(t: Any, w: Any) -> Any:
        x = (w[2] - level) / width
        return [0.0, 0.0, -MOMENT * rate * (1.0 + strength / np.cosh(x) ** 2)]

    a, s, d, r = map(mpmath.mpf, (level, strength, width, rate))
    q = mpmath.sqrt(s / (1 + s))

    def late(w: Any) -> Any:  # time at which omega is w
        def integral(x: Any) -> Any:
            return x - q * mpmath.atanh(q * mpmath.tanh(x))

        return d / r * (integral((1 - a) / d) - integral((w - a) / d)) - TIME

    low, high = 1 - r * TIME * (1 + s), mpmath.mpf(1)
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if late(middle) > 0 else (low, middle)
    scene = Scene("band", (0.0, 0.0, 1.0), moments=(2.0, 2.0, MOMENT), torque=torque)
    return Drawn("band", scene, float(low))


def _ending(source: Random, kind: str) -> Drawn:
    """Return a scene whose torque has a pole, or a root whose argument becomes negative."""
    end = source.uniform(0.1, 0.9) * TIME

    def torque(t: Any, w: Any) -> Any:
        return [0.0, 0.0, 0.1 / (end - t) if kind == "pole" else 0.1 * np.sqrt(end - t)]

    scene = Scene(kind, (0.0, 0.0, 1.0), moments=(2.0, 2.0, MOMENT), torque=torque)
    return Drawn(kind, scene, None)


KINDS = (*_FORMS, "band", "pole", "root")


def drawn(seed: str, number: int) -> Drawn:
    """Return scene `number` of a seed."""
    source = Random(f"narrow {seed} {number}")
    kind, width = KINDS[number % len(KINDS)], TIME * 10.0 ** source.uniform(-7.0, -1.5)
    with mpmath.workdps(60):
        if kind == "band":
            return _band(source, width / TIME)
        return _ending(source, kind) if kind in ("pole", "root") else _timed(source, kind, width)


def results(one: Drawn, seed: str, number: int) -> Iterator[tuple[str, float, Callable[[], Any]]]:
    """Yield name, tolerance and call of each result; a call returns omega, the ending and K."""
    source = Random(f"narrow results {seed} {number}")
    scene, start = one.scene, one.scene.omega
    other = source.choice([name for name in METHODS if name != "auto"])
    tolerance = 10.0 ** -source.uniform(3.0, 12.0)

    def solved(method: str, own: float | None) -> Any:
        found = solve(scene, TIME, method, own, effort=_EFFORT)
        return found.omega[-1, 2] if found.has_all_rows else math.nan, found.ended, found.growth

    def prepared() -> Any:
        solver = prepare(scene, tolerance=tolerance)
        return solver(start, TIME)[2], solver.status, solver.growth

    def many() -> Any:
        found = solve_many(scene, TIME, omega=np.array([start] * 3), tolerance=tolerance)
        return found.omega[1, 2], found.ended[1], None

    def by_sol() -> Any:
        found = solve(scene, TIME, tolerance=tolerance, dense_output=True, effort=_EFFORT)
        value = found.sol(TIME)[2] if found.sol and found.has_all_rows else math.nan
        return value, found.ended, found.growth

    def stepped() -> Any:
        stepper = Stepper(scene, max(tolerance, 1e-12))
        stepper.until(TIME)
        return stepper.omega[2], "complete", 100.0 * stepper.steps

    def series() -> Any:
        assert isinstance(scene.torque, StateTorque)
        tape: Any = scene.torque.tape

        def fun(t: Any, y: Any) -> Any:
            return [torque_of(tape, t, (0.0, 0.0, y[0]), IDENTITY)[2] / MOMENT]

        own = max(tolerance, 1e-12)
        found = solve_ivp(fun, (0.0, TIME), [start[2]], method=Taylor, rtol=own, atol=own)
        # Its tolerance is that of a step.
        return found.y[0, -1], "complete" if found.success else "failed", 1e15 * own * len(found.t)

    calls = dict(zip(_WAYS, (lambda: solved("auto", tolerance), prepared, many, by_sol, stepped,
                             series), strict=True))  # fmt: skip
    for name, call in calls.items():
        yield name, tolerance, call
    chosen = METHODS[other]
    if chosen.is_fixed_step:
        yield other, 1.0, lambda: solved(other, None)
    else:
        finest = max(chosen.finest, _FINEST.get(other, 1e-12))
        own = 10.0 ** source.uniform(math.log10(finest), -3.0)
        yield other, own, lambda: solved(other, own)


def try_scene(tally: driver.Tally) -> None:
    """Solve one scene in every way."""
    one = drawn(tally.seed, tally.number)
    for name, tolerance, call in results(one, tally.seed, tally.number):
        try:
            omega, ended, growth = call()
        except InputError as refusal:
            tally.counts[f"{name}: refused" + (" (work)" if "work" in str(refusal) else "")] += 1
            continue
        tally.counts[f"{name}: {ended}"] += 1
        if ended != "complete":
            continue
        size = max(abs(one.scene.omega[2]), abs(one.omega or 0.0))
        error = math.inf if one.omega is None else abs(omega - one.omega) / size
        limit = tolerance + 4e-15 * max(1.0, growth or 1.0)
        tally.judge(name, error, limit, f", {one.kind}, tolerance {tolerance:.1e}, K {growth}")


def main(arguments: Sequence[str]) -> int:
    return driver.run("tests.campaigns.narrow_campaign", try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

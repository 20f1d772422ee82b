"""A campaign of random scenes, whose dense output and events are compared with true rows.

The command is ``python -m tests.campaigns.continuous_campaign COUNT SEED [FIRST]``. Torques are
polynomials of time of up to degree 30, their products with waves, laws, recorded functions and
switches. `sol` at 300 times, and the values of event functions at their roots and between them, are
compared with quadratures, or else with rows of a tolerance of 1e-14. The limit of an error is the
tolerance plus 8e-15 K, where the error amplification K is below 1e6.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from pyharness import InputError, Scene, solve
from pyharness.checks.scenes.random_scenes import draw as draw_law
from pyharness.checks.scenes.state_scenes import SUDDEN, draw, draw_ready
from pyharness.model.array_type import Array
from pyharness.model.attitude import angle_between
from tests.campaigns import driver
from tests.campaigns.switched_scenes import controlled

MODULE = "tests.campaigns.continuous_campaign"
TIMES = 300
MOST_GROWTH = 1e6
MOST_DEGREE = 30
_FINEST = 1e-14
_FLOOR = 8e-15  # error of the true rows, over the error amplification
KINDS = ("axis", "axis", "axes", "axes", "own", "own", "law", "state", "sudden", "ready", "switched")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)

# A function of time, which may be a symbol.
OfTime = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A random scene, its first and last time (s), and the rates of its unknowns if of time."""

    scene: Scene
    ends: tuple[float, float]
    rates: Callable[[Array], Any] | None = None  # of omega and own states, (m, n)
    methods: tuple[str, ...] = ("auto", "taylor")
    turning: bool = False


def polynomial(source: Random, length: float) -> OfTime:
    """Return a random polynomial of time, about 1 at `length` (s)."""
    degree = source.randrange(MOST_DEGREE + 1)
    kind = source.randrange(3)
    if kind == 0:
        return lambda t: (t / length) ** degree
    shift = source.choice((0.0, 0.0, source.uniform(-0.5, 0.5)))
    factors = [source.uniform(-1.0, 1.0) for _ in range(degree + 1)]
    if kind == 1:
        factors = [x * (source.random() < 0.2) for x in factors[:-1]] + [1.0]

    def horner(t: Any) -> Any:
        x = t / length - shift
        found = factors[-1] + 0.0 * x
        for factor in factors[-2::-1]:
            found = found * x + factor
        return found

    return horner


def of_time(source: Random, length: float) -> OfTime:
    """Return a random polynomial, or its product with a wave."""
    plain = polynomial(source, length)
    if source.random() < 0.6:
        return plain
    f, phase = 10.0 ** source.uniform(-1.0, 1.3) / length, source.uniform(0.0, 6.0)
    return lambda t: plain(t) * np.sin(f * t + phase)


def timed(source: Random, kind: str) -> Drawn:
    """Return a body under torques of time, about one axis or several, with own states or not."""
    length = 10.0 ** source.uniform(-1.0, 1.0)
    if kind != "own" and source.random() < 0.1:
        length = math.ldexp(length, source.choice((-320, 320, 460)))
    ends = source.choice(((0.0, length), (0.0, length), (-length, 0.0), (-0.7 * length, length)))
    moments = [source.uniform(1.0, 1.9) for _ in range(3)]
    axis, about = source.randrange(3), range(3)
    pushes: list[OfTime] = [of_time(source, length) for _ in about]
    sizes = [10.0 ** source.uniform(-2.0, 1.0) / length for _ in about]
    if kind == "axis":
        sizes = [size * (i == axis) for i, size in enumerate(sizes)]
    rest = source.random() < 0.4
    omega = [0.0 if rest else source.uniform(-1.0, 1.0) * size for size in sizes]
    own = {f"x{i}": of_time(source, length) for i in range(source.randrange(1, 3))}
    starts = {name: source.choice((0.0, source.uniform(-1.0, 1.0))) for name in own}
    mixing = source.choice((0.0, 0.0, source.uniform(-1.0, 1.0)))
    damping = source.choice((0.0, source.uniform(0.0, 1.0))) if kind == "axes" else 0.0

    def torque(t: Any, w: Any) -> Any:
        return [
            moments[i] * sizes[i] / length * pushes[i](t) - damping / length * w[i] for i in about
        ]

    def with_states(t: Any, w: Any, states: Any) -> Any:
        rates = {
            name: push(t) / length + mixing * states[name] * w[axis] * t / length
            for name, push in own.items()
        }
        return torque(t, w), rates

    states = starts if kind == "own" else {}
    if kind == "own" and source.random() < 0.7:
        sizes, omega, mixing = [size * (i == axis) for i, size in enumerate(sizes)], [0.0] * 3, 0.0
    body: dict[str, Any] = {"moments": moments}
    if kind == "axes" and source.random() < 0.3:
        body = {"inertia": _matrix(moments, source)}
    scene = Scene(kind, omega, torque=with_states if states else torque, states=states, **body)

    def rates(times: Array) -> Any:
        nothing = np.zeros_like(times)
        found = [sizes[i] / length * pushes[i](times) + nothing for i in about]
        return [*found, *(own[name](times) / length + nothing for name in states)]

    is_of_time = np.count_nonzero([*sizes, *omega]) <= 2 and mixing == damping == 0.0
    return Drawn(scene, ends, rates if is_of_time and "moments" in body else None)


def _matrix(moments: list[float], source: Random) -> Array:
    axes = np.linalg.qr(np.array([[source.gauss(0.0, 1.0) for _ in range(3)] for _ in range(3)]))[0]
    found = axes @ np.diag(moments) @ axes.T
    return np.asarray(0.5 * (found + found.T))


def drawn(source: Random, seed: str, number: int) -> Drawn:
    """Return the random scene of a number."""
    kind = KINDS[number % len(KINDS)]
    if kind in ("axis", "axes", "own"):
        return timed(source, kind)
    if kind == "switched":
        body = controlled(source)[1]
        scene, end, turning = body.scene(), body.end, body.turning
    elif kind == "law":
        scene, end = draw_law(f"continuous {seed}", number).scene, source.uniform(-20.0, 20.0)
        turning = source.random() < 0.3
    else:
        names = {"sudden": lambda: draw(source, (source.choice(SUDDEN),)), "ready": lambda: draw_ready(source)}
        scene, end = names.get(kind, lambda: draw(source))()
        turning = scene.torque.needs_attitude or source.random() < 0.3
    methods = ("auto", "taylor")
    if kind == "law" and not turning:
        methods = "auto", "taylor", "taylor", "gauss-4", "gauss-6"
    return Drawn(scene, (min(0.0, end), max(0.0, end)), None, methods, turning)


class Truth:
    """The true unknowns of a scene at any times."""

    def __init__(self, given: Drawn) -> None:
        self.given = given

    def __call__(self, times: Array) -> Array:
        """Return the unknowns at ascending times (s), (m, n)."""
        scene = self.given.scene
        if self.given.rates is None:
            found = solve(scene, times, "taylor", _FINEST, attitude=self.given.turning)
            if not found.has_all_rows:
                raise InputError("the solution ends early")
            return found.y
        start = [*scene.omega, *(each.start for each in scene.states)]
        both = np.unique([*times, 0.0])
        half, middle = 0.5 * np.diff(both), 0.5 * (both[1:] + both[:-1])
        inner = middle[:, None] + half[:, None] * _NODES
        rates = np.array(self.given.rates(inner.ravel())).reshape(len(start), *inner.shape)
        sums = np.cumsum((rates @ _WEIGHTS) * half, axis=1)
        sums = np.concatenate([np.zeros((len(start), 1)), sums], axis=1)
        sums -= sums[:, [np.searchsorted(both, 0.0)]]
        return np.array(start)[:, None] + sums[:, np.searchsorted(both, times)]


def function_of(source: Random, states: Array) -> Callable[[Array], Array]:
    """Return a random function of the unknowns, (m, ...), that has roots within their ranges."""
    m = len(states)
    low, high = states.min(axis=1), states.max(axis=1)

    def level(i: int) -> float:
        return float(low[i] + source.uniform(0.02, 0.98) * (high[i] - low[i]))

    moving = [i for i in range(m) if high[i] > low[i]] or [0]
    i, j = source.choice(moving), source.choice(moving)
    a, b = level(i), level(j)
    if source.random() < 0.6:
        return lambda y: y[i] - a
    return lambda y: (y[i] - a) * (y[j] - b)


def try_scene(tally: driver.Tally) -> None:
    """Compare the dense output and the events of a random scene.

    A scene is left out if its solution ends early or is sensitive.
    """
    source = Random(f"continuous {tally.seed} {tally.number}")
    given = drawn(source, tally.seed, tally.number)
    kind, scene = KINDS[tally.number % len(KINDS)], given.scene
    method, tolerance = source.choice(given.methods), 10.0 ** source.uniform(-13.0, -3.0)
    low, high = given.ends
    inner = sorted(source.uniform(low, high) for _ in range(TIMES))
    times = np.unique([low, *inner, *np.linspace(low, high, 900), 0.0, high])
    truth = Truth(given)
    tally.counts["left out"] += 1
    try:
        states = truth(times)
        functions = [function_of(source, states) for _ in range(2)]
        found: Any = solve(
            scene, [x for x in (low, high) if x], method, tolerance, attitude=given.turning,
            dense_output=True, events=[_event(each, given) for each in functions],
        )  # fmt: skip
        growth = solve(scene, [x for x in (low, high) if x], tolerance=1e-9, attitude=given.turning).growth
    except InputError:
        return
    if found.ended != "complete" or not growth or growth > MOST_GROWTH:
        return
    tally.counts["left out"] -= 1
    allowed = tolerance + _FLOOR * growth
    more = f", {method}, tolerance {tolerance:.2g}, K {growth:.2g}, claim {found.error}"
    sizes = sizes_of(times, states, scene)
    for values, limit, name in (
        (found.sol(times), allowed, "sol"),
        (found.sol(times), (found.error or math.inf) + _FLOOR * growth, "claim of sol"),
    ):
        apart = np.abs(values - states)
        error = float(np.max(apart / sizes, initial=0.0))
        if name == "sol":
            tally.judge(f"{kind}: {name}", error, limit, more)
        else:
            tally.counts[f"{name} exceeded"] += error > limit
            tally.counts[f"{name} exceeded 10 times"] += error > 10.0 * limit
    for function, roots in zip(functions, found.t_events, strict=True):
        judge_roots(tally, kind, truth, function, np.sort(roots), (times, states, allowed * sizes), more)


def _event(function: Callable[[Any], Any], given: Drawn) -> Callable[..., Any]:
    names = [each.name for each in given.scene.states]
    if given.turning and names:
        return lambda t, w, q, x: function([*w, *q, *(x[name] for name in names)])
    if given.turning:
        return lambda t, w, q: function([*w, *q])
    if names:
        return lambda t, w, x: function([*w, *(x[name] for name in names)])
    return lambda t, w: function(w)


def sizes_of(times: Array, states: Array, scene: Scene) -> Array:
    """Return the sizes to which errors of the unknowns are relative, (m, n).

    They are the largest values between time 0 and an end, because a state that begins at 0 has no
    size before the end of a step.
    """
    sizes = np.ones_like(states)
    sizes[:3] = np.abs(states[:3]).max()
    for i, each in enumerate(scene.states, len(states) - len(scene.states)):
        for side in (times <= 0.0, times >= 0.0):
            sizes[i, side] = max(np.abs(states[i, side]).max(), each.scale)
    return np.where(sizes > 0.0, sizes, 1.0)


def judge_roots(
    tally: driver.Tally, kind: str, truth: Truth, function: Callable[[Array], Array], roots: Array,
    given: tuple[Array, Array, Array], more: str,
) -> None:  # fmt: skip
    """Compare roots with the true values of the function at and between them."""
    times, states, errors = given
    tally.counts["roots"] += len(roots)
    between = 0.5 * (roots[1:] + roots[:-1])
    every = np.unique(np.concatenate([roots, between]))
    at, near = states, errors
    if len(every):
        at = truth(every)
        near = np.array([np.interp(every, times, each) for each in errors])
        spread = 4.0 * np.spacing(np.abs(every)) * np.abs(np.gradient(states, times, axis=1)).max(axis=1)[:, None]
        values, limits = function(at), margin(function, at, near + spread)
        which = np.searchsorted(every, roots)
        ratios = np.abs(values[which]) / limits[which]
        for root, ratio in zip(roots, ratios, strict=True):
            tally.judge(f"{kind}: root", float(ratio), 1.0, f", root {float(root)!r}{more}")
        times, values = np.append(times, every), np.append(function(states), values)
        limits = np.append(margin(function, states, errors), limits)
    else:
        values, limits = function(states), margin(function, states, errors)
    is_clear = np.abs(values) > 2.0 * limits
    order = np.argsort(times[is_clear])
    clear, signs = times[is_clear][order], np.sign(values[is_clear][order])
    counts = np.diff(np.searchsorted(roots, clear))
    changes = signs[1:] != signs[:-1]
    for k in np.flatnonzero(changes & (counts % 2 == 0)):
        tally.fault(f"{kind}: {counts[k]} roots from {float(clear[k])!r} to {float(clear[k + 1])!r} s{more}")
    # A root without sign change is a touch, or one of a pair.
    tally.counts["touches or pairs"] += int((~changes & (counts > 0)).sum())


def margin(function: Callable[[Array], Array], states: Array, errors: Array) -> Array:
    """Return the largest changes of a function by errors of the unknowns."""
    values = function(states)
    found = np.zeros_like(values)
    for i in range(len(states)):
        moved = states.copy()
        moved[i] += errors[i]
        found += np.abs(function(moved) - values)
    return found + sys.float_info.min


def main(arguments: Sequence[str]) -> int:
    return driver.run(MODULE, try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

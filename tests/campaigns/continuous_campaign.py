"""A campaign of random scenes, whose dense output and events are compared with true rows.

The command is ``python -m tests.campaigns.continuous_campaign COUNT SEED [FIRST]``. Torques are
polynomials of time of degrees up to 30, their products with waves, laws, recorded functions and
switches. `sol` at 300 times, and event functions at and between their roots, are compared with
quadratures if rates depend on time alone, else with rows of a tolerance of 1e-14. The limit of an
error is the tolerance plus 8e-15 K, where the error amplification K is below 1e6.
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
from tests.campaigns import driver
from tests.campaigns.switched_scenes import controlled

MODULE = "tests.campaigns.continuous_campaign"
TIMES, _GRID = 300, 900  # random times, and equidistant ones between which roots are counted
KINDS = (
    "axis", "axis", "axes", "axes", "own", "own", "law", "state", "sudden", "ready", "switched",
)  # fmt: skip
MOST_DEGREE = 30
MOST_GROWTH = 1e6
_FINEST = 1e-14
_FLOOR = 8e-15  # error of the true rows, over the error amplification
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)

# A function of time, which may be a symbol; and a function of the unknowns, (m, ...).
OfTime = Callable[[Any], Any]
OfState = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A random scene, and its first and last time (s)."""

    scene: Scene
    ends: tuple[float, float]
    turning: bool = False  # with attitude
    methods: tuple[str, ...] = ("auto", "taylor")
    rates: Callable[[Array], Any] | None = (
        None  # of the unknowns, (m, n), if they are of time alone
    )

    @property
    def times(self) -> list[float]:
        """The ends that are not 0."""
        return [time for time in self.ends if time]

    def truth(self, times: Array) -> Array:
        """Return the true unknowns at n ascending times (s), (m, n)."""
        if self.rates is None:
            found = solve(self.scene, times, "taylor", _FINEST, attitude=self.turning)
            if not found.has_all_rows:
                raise InputError("the solution ends early")
            return found.y
        start = np.array([*self.scene.omega, *(each.start for each in self.scene.states)])
        edges = np.unique([*times, 0.0])
        half = 0.5 * np.diff(edges)
        inner = (edges[:-1] + half)[:, None] + half[:, None] * _NODES
        rates = np.array(self.rates(inner.ravel())).reshape(len(start), *inner.shape)
        parts, zero = rates @ _WEIGHTS * half, int(np.searchsorted(edges, 0.0))
        before = -np.cumsum(parts[:, :zero][:, ::-1], axis=1)[:, ::-1]
        changes = [before, np.zeros((len(start), 1)), np.cumsum(parts[:, zero:], axis=1)]
        states = start[:, None] + np.concatenate(changes, axis=1)
        return np.asarray(states[:, np.searchsorted(edges, times)])


def polynomial(source: Random, length: float) -> OfTime:
    """Return a random polynomial of time, of the size 1 until `length` (s)."""
    degree = source.randrange(MOST_DEGREE + 1)
    if source.random() < 0.3:
        return lambda t: (t / length) ** degree
    shift = source.choice((0.0, 0.0, source.uniform(-0.5, 0.5)))
    density = source.choice((0.2, 1.0))
    factors = [source.uniform(-1.0, 1.0) * (source.random() < density) for _ in range(degree)]

    def found(t: Any) -> Any:
        x, total = t / length - shift, 1.0
        for factor in factors:
            total = total * x + factor
        return total + 0.0 * t

    return found


def of_time(source: Random, length: float) -> OfTime:
    """Return a random polynomial, or its product with a wave."""
    plain = polynomial(source, length)
    if source.random() < 0.6:
        return plain
    rate, phase = 10.0 ** source.uniform(-1.0, 1.3) / length, source.uniform(0.0, 6.0)
    return lambda t: plain(t) * np.sin(rate * t + phase)


def timed(source: Random, kind: str) -> Drawn:
    """Return a body under torques of time about one axis or all, or with own states."""
    length = 10.0 ** source.uniform(-1.0, 1.0)
    if kind != "own" and source.random() < 0.1:
        length = math.ldexp(length, source.choice((-320, 320, 460)))
    ends = source.choice(((0.0, length), (-length, 0.0), (-0.7 * length, length)))
    moments = [source.uniform(1.0, 1.9) for _ in range(3)]
    axis, about = source.randrange(3), range(3)
    pushes: list[OfTime] = [of_time(source, length) for _ in about]
    sizes = [10.0 ** source.uniform(-2.0, 1.0) / length for _ in about]
    is_single = kind == "axis" or (kind == "own" and source.random() < 0.7)
    if is_single:
        sizes = [size * (i == axis) for i, size in enumerate(sizes)]
    rest = source.random() < 0.4
    omega = [0.0 if rest else source.uniform(-1.0, 1.0) * size for size in sizes]
    own = [of_time(source, length) for _ in range(source.randrange(1, 3) * (kind == "own"))]
    starts = [source.choice((0.0, source.uniform(-1.0, 1.0))) for _ in own]
    mixing = 0.0 if is_single else source.uniform(-1.0, 1.0)

    def accelerations(t: Any, w: Any) -> list[Any]:
        return [sizes[i] / length * pushes[i](t) - 0.1 * mixing / length * w[i] for i in about]

    def torque(t: Any, w: Any) -> Any:
        return [moment * each for moment, each in zip(moments, accelerations(t, w), strict=True)]

    def with_states(t: Any, w: Any, states: Any) -> Any:
        mixed = mixing * w[axis] * t / length
        return torque(t, w), {x: own[int(x[1])](t) / length + mixed * states[x] for x in states}

    def rates(times: Array) -> Any:
        nothing = np.zeros((3, len(times)))
        found = [*accelerations(times, nothing), *(each(times) / length for each in own)]
        return [each + nothing[0] for each in found]

    body: dict[str, Any] = {"moments": moments}
    if kind == "axes" and source.random() < 0.3:
        axes, _ = np.linalg.qr([[source.gauss(0.0, 1.0) for _ in about] for _ in about])
        body = {"inertia": axes @ np.diag(moments) @ axes.T}
    body |= {"torque": with_states, "states": {f"x{i}": x for i, x in enumerate(starts)}}
    scene = Scene(kind, omega, **(body if own else body | {"torque": torque}))
    return Drawn(scene, ends, rates=rates if is_single else None)


def drawn(source: Random, seed: str, number: int) -> Drawn:
    """Return the random scene of a number."""
    kind = KINDS[number % len(KINDS)]
    if kind in ("axis", "axes", "own"):
        return timed(source, kind)
    turning = source.random() < 0.3
    methods: tuple[str, ...] = ("auto", "taylor")
    if kind == "law":
        scene, end = draw_law(f"continuous {seed}", number).scene, source.uniform(-20.0, 20.0)
        methods += () if turning else ("gauss-4", "gauss-6")
    elif kind == "switched":
        body = controlled(source)[1]
        scene, end = body.scene(), body.end
    elif kind == "ready":
        scene, end = draw_ready(source)
    else:
        scene, end = draw(source, (source.choice(SUDDEN),)) if kind == "sudden" else draw(source)
    turning = turning or scene.torque.needs_attitude
    return Drawn(scene, (min(0.0, end), max(0.0, end)), turning, methods)


def function_of(source: Random, states: Array) -> OfState:
    """Return an unknown minus a level in its range, or the product of two."""
    low, high = states.min(axis=1), states.max(axis=1)
    moving = np.flatnonzero(high > low).tolist() or [0]
    i, j = source.choice(moving), source.choice(moving)
    a, b = (low[k] + source.uniform(0.02, 0.98) * (high[k] - low[k]) for k in (i, j))
    if source.random() < 0.6:
        return lambda y: y[i] - a
    return lambda y: (y[i] - a) * (y[j] - b)


def event(function: OfState, given: Drawn) -> Callable[..., Any]:
    """Return the event of a function of all unknowns."""
    if not given.scene.states:
        return (lambda t, w, q: function([*w, *q])) if given.turning else lambda t, w: function(w)
    if given.turning:
        return lambda t, w, q, states: function([*w, *q, *states.values()])
    return lambda t, w, states: function([*w, *states.values()])


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


def margin(function: OfState, states: Array, errors: Array) -> Array:
    """Return the largest changes of a function by errors of the unknowns, (n,)."""
    moved = [
        np.where(np.arange(len(states))[:, None] == i, errors, 0.0) for i in range(len(states))
    ]
    changes = [np.abs(function(states + each) - function(states)) for each in moved]
    return np.asarray(np.sum(changes, axis=0) + sys.float_info.min)


def try_scene(tally: driver.Tally) -> None:
    """Compare the dense output and the events of a random scene.

    A scene is left out if its solution ends early or is sensitive.
    """
    source = Random(f"continuous {tally.seed} {tally.number}")
    given, kind = drawn(source, tally.seed, tally.number), KINDS[tally.number % len(KINDS)]
    scene, (low, high) = given.scene, given.ends
    method, tolerance = source.choice(given.methods), 10.0 ** source.uniform(-13.0, -3.0)
    inner = [source.uniform(low, high) for _ in range(TIMES)]
    times = np.unique([low, 0.0, high, *inner, *np.linspace(low, high, _GRID)])
    tally.counts["left out"] += 1
    try:
        states = given.truth(times)
        functions = [function_of(source, states) for _ in range(2)]
        found: Any = solve(
            scene, given.times, method, tolerance, attitude=given.turning, dense_output=True,
            events=[event(each, given) for each in functions],
        )  # fmt: skip
        growth = solve(scene, given.times, tolerance=1e-9, attitude=given.turning).growth
    except InputError:
        return
    if found.ended != "complete" or not growth or growth > MOST_GROWTH:
        return
    tally.counts["left out"] -= 1
    sizes, floor = sizes_of(times, states, scene), _FLOOR * growth
    more = f", {method}, tolerance {tolerance:.2g}, K {growth:.2g}, claim {found.error}"
    error = float((np.abs(found.sol(times) - states) / sizes).max())
    tally.judge(f"{kind}: sol", error, tolerance + floor, more)
    if found.error is not None:
        tally.counts["claims below a tenth of the error"] += error > 10.0 * found.error + floor
    rows = times, states, (tolerance + floor) * sizes
    for function, roots in zip(functions, found.t_events, strict=True):
        judge_roots(tally, (f"{kind}: root", more), given, function, np.sort(roots), rows)


def judge_roots(
    tally: driver.Tally, names: tuple[str, str], given: Drawn, function: OfState, roots: Array,
    rows: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """Compare roots with the function at and between them, at the true unknowns of `rows`."""
    times, states, errors = rows
    (name, more), values = names, function(states)
    limits = margin(function, states, errors)
    tally.counts["roots"] += len(roots)
    if len(roots):
        every = np.unique([*roots, *(0.5 * (roots[1:] + roots[:-1]))])
        at = given.truth(every)
        # Times are rounded.
        rates = np.abs(np.diff(states, axis=1) / np.diff(times)).max(axis=1)
        near = np.array([np.interp(every, times, each) for each in errors])
        near += 4.0 * np.spacing(np.abs(every)) * rates[:, None]
        times, values = np.append(times, every), np.append(values, function(at))
        limits = np.append(limits, margin(function, at, near))
        for k, root in enumerate(np.searchsorted(every, roots) - len(every)):
            error = float(abs(values[root]))
            tally.judge(name, error, float(limits[root]), f", t = {float(roots[k])!r} s{more}")
    order = np.argsort(times)
    order = order[np.abs(values[order]) > 2.0 * limits[order]]
    clear, signs = times[order], np.sign(values[order])
    counts = np.diff(np.searchsorted(roots, clear))
    changes = signs[1:] != signs[:-1]
    for k in np.flatnonzero(changes & (counts % 2 == 0)).tolist():
        ends = f"from {float(clear[k])!r} to {float(clear[k + 1])!r} s"
        tally.fault(f"{name}: {counts[k]} roots {ends}, where the sign changes{more}")
    # Pairs of roots, and extrema near 0.
    tally.counts["roots without a change of the sign"] += int(counts[~changes].sum())


def main(arguments: Sequence[str]) -> int:
    return driver.run(MODULE, try_scene, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

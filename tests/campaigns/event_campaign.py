"""A campaign of functions with planted roots.

The command is ``python -m tests.campaigns.event_campaign COUNT SEED [FIRST]``.

Each function has known roots: simple and double ones, and corners at 0 without a change of sign.
Some are at random times, some pairs within a step of the integrator, some at the ends of the
integration or of its intervals. Most functions depend on time alone, some on an omega in closed
form, and some are above 0.
A missed or invented root is a fault, and so are a wrong direction, and an error of a time above
LARGEST in addition to its rounding error.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness import Scene, solve
from pyharness.model.array_type import Array
from tests.campaigns import driver

LARGEST = 1e-12
_EPS = 2.0**-52
BODY = Scene("body", omega=(0.1, 2.0, 0.1), moments=(1.0, 2.0, 3.0))
CORNERS = ("corners", "least", "branch", "rectified", "omega")
KINDS = ("polynomial", "edges", "cosine", "sine", "squared sine", "modulated", "odd", *CORNERS)


@dataclass(frozen=True)
class Planted:
    """A function with known roots from time 0 to `end` (s), and the rounding error of each root."""

    function: Callable[..., Any]
    end: float
    roots: Array
    changes: Any
    rounding: Array
    scene: Scene = BODY

    def only(self, kept: Any) -> "Planted":
        roots, changes, rounding = (
            each[: len(kept)][kept] for each in (self.roots, self.changes, self.rounding)
        )
        return replace(self, roots=roots, changes=changes, rounding=rounding)


def planted(kind: str, rng: np.random.Generator) -> Planted:
    """Return a random function of a kind in `KINDS`."""
    end = float(rng.choice([1.0, 10.0, 40.0]) * rng.uniform(0.5, 1.0))
    if kind in ("polynomial", "edges"):
        return _product(end, kind == "edges", rng)
    if kind == "odd":
        return _of_odd_multiplicity(end, rng)
    if kind in CORNERS[:3]:
        return _with_corners(kind, end, rng)
    if kind == "omega":
        return _of_omega(end, rng)
    rate, phase = rng.uniform(1.0, 40.0), rng.uniform(0.0, 2.0 * np.pi)
    n: Any = np.arange(-2, int(rate * end / np.pi) + 4)
    if kind == "cosine":
        # Pairs of roots at a distance of down to 1e-6 rad.
        gap = 10.0 ** rng.uniform(-6.0, 0.0)
        n = np.arange(-1, int(rate * end / (2.0 * np.pi)) + 3)
        angles = np.sort(np.array([2.0 * np.pi * n - gap, 2.0 * np.pi * n + gap]).ravel())
        roots = (angles - phase) / rate
        changes = np.where(np.arange(len(roots)) % 2, -1, 1)
        rounding = np.full(len(roots), 8.0 * _EPS * (1.0 + rate * end) / (rate * np.sin(gap)))
        level = np.cos(gap)
        return _within(lambda t, w: np.cos(rate * t + phase) - level, end, roots, changes, rounding)
    roots = np.asarray((np.pi * n - phase) / rate)
    simple = np.full(len(roots), 8.0 * _EPS * (1.0 + rate * end) / rate)
    signs = np.where(n % 2, -1, 1)
    if kind == "sine":
        return _within(lambda t, w: np.sin(rate * t + phase), end, roots, signs, simple)
    if kind == "squared sine":
        return _within(lambda t, w: np.sin(rate * t + phase) ** 2, end, roots, 0 * n, simple)
    decay = rng.uniform(0.0, 30.0) / end
    if kind == "rectified":
        above = rng.choice([0.0, 0.0, 10.0 ** rng.uniform(-9.0, 0.0)])
        decay *= above == 0.0
        return _within(
            lambda t, w: np.exp(-decay * t) * (abs(np.sin(rate * t + phase)) + above),
            end, roots[: None if above == 0.0 else 0], 0 * n, simple,
        )  # fmt: skip
    return _within(
        lambda t, w: np.exp(-decay * t) * np.sin(rate * t + phase), end, roots, signs, simple
    )


def _within(
    function: Callable[..., Any], end: float, roots: Array, changes: Any, rounding: Array
) -> Planted:
    kept = (roots > 1e-9 * end) & (roots < end * (1.0 - 1e-9))
    return Planted(function, end, roots, changes, rounding).only(kept)


def _product(end: float, at_edges: bool, rng: np.random.Generator) -> Planted:
    """Return a product of factors, with roots at random times or at simple fractions of the end."""
    count = int(rng.integers(1, 5))
    if at_edges:
        roots = end * rng.choice(np.arange(17), count, replace=False) / 16.0
    else:
        roots = rng.uniform(0.0, end, count)
        if count > 1 and rng.random() < 0.5:
            # Two roots within a step.
            roots[1] = min(roots[0] + end * 10.0 ** rng.uniform(-5.0, -2.0), end)
    roots = np.sort(roots)
    powers = rng.integers(1, 3, len(roots))
    # Double roots are not near to others, because rounding errors would combine them.
    if len(roots) > 1 and np.diff(roots).min() < 1e-2 * end:
        powers[:] = 1
    sign = rng.choice([-1.0, 1.0])

    def function(t: Any, omega: Any) -> Any:
        found = sign + 0.0 * t
        for root, power in zip(roots, powers, strict=True):
            found = found * (t - root) ** int(power)
        return found

    after = sign * np.array([np.prod([1.0 if p % 2 == 0 or k <= j else -1.0
                                      for k, p in enumerate(powers)])
                             for j in range(len(roots))])  # fmt: skip
    changes = np.where(powers % 2, after, 0).astype(int)
    # A double root is the root of the derivative of a polynomial with rounding errors.
    largest = np.abs(function(np.linspace(0.0, end, 1001), None)).max()
    curvature = [2.0 * abs(np.prod([(r - x) ** int(p) for x, p in zip(roots, powers, strict=True)
                                    if x != r])) for r in roots]  # fmt: skip
    double = 4000.0 * _EPS * largest / (end * np.array(curvature))
    rounding = 4.0 * _EPS * end + np.where(powers == 2, double, 0.0)
    return Planted(function, end, roots, changes, rounding)


def _of_odd_multiplicity(end: float, rng: np.random.Generator) -> Planted:
    """Return a product of factors to the powers 1, 3, 5 and 7, whose signs are exact."""
    roots = end * (np.arange(3) + rng.uniform(0.3, 0.7, 3)) / 3.0
    powers = rng.permutation([1, 1, rng.choice([3, 5, 7])])
    sign = rng.choice([-1.0, 1.0])

    def function(t: Any, omega: Any) -> Any:
        factors = [(t - root) ** int(n) for root, n in zip(roots, powers, strict=True)]
        return sign * factors[0] * factors[1] * factors[2]

    changes = sign * np.array([1, -1, 1])
    return Planted(function, end, roots, changes, np.full(3, 4.0 * _EPS * end))


def _with_corners(kind: str, end: float, rng: np.random.Generator) -> Planted:
    """Return a product, or the least, of powers of |t - root|, or a product with branches."""
    count = int(rng.integers(1, 7))
    roots = end * rng.choice(np.arange(1, 17), count, replace=False) / 16.0
    if rng.random() < 0.7:
        roots = rng.uniform(0.01 * end, end, count)
    roots = np.sort(roots)
    # Between adjacent nodes of a polynomial, a product of two corners is a parabola.
    roots = roots[np.diff(roots, append=math.inf) > 0.2]
    powers = rng.choice([0.5, 1.0, 1.0, 1.0, 1.5], len(roots))
    sizes = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0, len(roots))

    def product(t: Any, omega: Any) -> Any:
        found = sizes[0] + 0.0 * t
        for root, power in zip(roots, powers, strict=True):
            found = found * abs(t - root) ** power
        return found

    def least(t: Any, omega: Any) -> Any:
        each = [size * abs(t - root) for size, root in zip(sizes, roots, strict=True)]
        return (np.minimum if sizes[0] > 0.0 else np.maximum).reduce(each)

    def with_branches(t: Any, omega: Any) -> Any:
        found = float(sizes[0])
        for size, root in zip(np.abs(sizes), roots, strict=True):
            found *= t - root if t > root else size * (root - t)
        return found

    function = {"corners": product, "least": least, "branch": with_branches}[kind]
    zeros = np.zeros(len(roots), dtype=int)
    return Planted(function, end, roots, zeros, np.full(len(roots), 4.0 * _EPS * end))


def _of_omega(end: float, rng: np.random.Generator) -> Planted:
    """Return a product, or the least, of |omega - level| of a symmetric top."""
    size, spin, third = rng.uniform([0.2, 0.5, 0.4], [2.0, 3.0, 0.9])
    phase = rng.uniform(0.0, 2.0 * np.pi)
    omega = size * np.cos(phase), size * np.sin(phase), spin
    scene = Scene("top", omega, moments=(1.0, 1.0, third))
    # The first two components are size * cos(angle) and size * sin(angle), with this rate.
    rate = (1.0 - third) * spin
    axes = rng.integers(0, 2, int(rng.integers(1, 4)))
    tilts = np.where(rng.random(len(axes)) < 0.2, 0.0, rng.uniform(0.3, np.pi - 0.3, len(axes)))
    levels, is_least = size * np.cos(tilts), rng.random() < 0.5
    sign = rng.choice([-1.0, 1.0])

    def function(t: Any, w: Any) -> Any:
        each = [abs(w[axis] - level) for axis, level in zip(axes, levels, strict=True)]
        return sign * (np.minimum.reduce(each) if is_least else np.prod(each, axis=0))

    turns = 2.0 * np.pi * np.arange(-int(rate * end / 6.0) - 2, 2)
    angles = [(0.5 * np.pi * axis + side * tilt + turns, 0.0 * turns + tilt)
              for axis, tilt in zip(axes, tilts, strict=True)
              for side in ((1.0, -1.0) if tilt else (1.0,))]  # fmt: skip
    angle, tilt = np.concatenate(angles, axis=1)
    order = np.argsort(-angle)
    roots = (phase - angle[order]) / rate
    if np.diff(roots).min() < 0.4 / rate:
        return _of_omega(end, rng)
    # An extremum of omega is flat.
    rounding = np.where(tilt[order] == 0.0, 1e-4, 1e-9) / rate
    return replace(_within(function, end, roots, 0 * order, rounding), scene=scene)


def search(kind: str, seed: int, tally: driver.Tally) -> None:
    """Search for the roots of one random function, and add the result to the tally."""
    given = planted(kind, np.random.default_rng(seed))

    def rising(t: Any, omega: Any) -> Any:
        return given.function(t, omega)

    rising.direction = 1  # type: ignore[attr-defined]
    found: Any = solve(given.scene, given.end, events=[given.function, rising])
    times, rises = found.t_events
    # A root at the start is no event.
    given = given.only(given.roots > 0.0)
    tally.counts["roots"] += len(given.roots)
    what = f"{kind} {seed}: {given.roots.tolist()}, found {times.tolist()}"
    if len(times) != len(given.roots):
        tally.fault(f"{'missed' if len(times) < len(given.roots) else 'invented'} roots, {what}")
        return
    expected = given.roots[(given.roots < given.end) & (given.changes == 1)]
    if np.count_nonzero(rises < given.end) != len(expected):
        tally.fault(f"{what}, rises {rises.tolist()}")
    error = np.abs(times - given.roots)
    excess = np.max(np.maximum(error - given.rounding, 0.0) / given.end, initial=0.0)
    tally.judge("error beyond rounding", float(excess), LARGEST, f", {what}")
    is_exact = given.rounding < 1e-13 * given.end
    alone = np.max(error[is_exact], initial=0.0) / given.end
    tally.record("error where rounding explains at most 1e-13", float(alone))


def try_function(tally: driver.Tally, kinds: Sequence[str] = KINDS) -> None:
    """Search for the roots of a random function of one of the kinds, by the number."""
    number = int(tally.seed) * 1_000_000 + tally.number
    search(kinds[number % len(kinds)], number, tally)


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.event_campaign", try_function, sys.argv[1:]))

"""Random bodies with controllers: as a user writes them, and as series in the zones of switches."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from random import Random
from typing import Any

import numpy as np

from pyharness import Scene
from pyharness.torques import table
from tests.campaigns.switched import Modes, Series, series


class Plain:
    """The elements of controllers as a user writes them."""

    def __getattr__(self, name: str) -> Any:
        """Return a function of NumPy."""
        return getattr(np, name)

    def above(self, x: Any, level: float) -> Any:
        """Return 1 above a level, else 0."""
        return np.where(x > level, 1.0, 0.0)

    def dead(self, x: Any, width: float) -> Any:
        """Return the distance from a dead zone, with its sign."""
        return np.where(np.abs(x) < width, 0.0, x - width * np.sign(x))

    def inside(self, x: Any, width: float) -> Any:
        """Return 1 in an interval, else 0."""
        return np.where(np.abs(x) < width, 1.0, 0.0)


# An element returns its torques by axis, and the rates of its states by name. Its arguments are a
# Plain or Modes, the time, omega, the attitude and all states.
Element = Callable[[Any, Any, Any, Any, Any], tuple[dict[int, Any], dict[str, Any]]]


@dataclass
class Controlled:
    """A body with the elements of a controller."""

    omega: list[float]
    moments: list[float]
    elements: list[Element]
    end: float
    states: dict[str, float]
    turning: bool = False
    table: tuple[Any, Any, str] | None = None  # times, values and interpolation

    def rates(self, m: Any, t: Any, w: Any, q: Any, states: Any) -> tuple[list[Any], list[Any]]:
        """Return the torque and the rates of the states."""
        torque: list[Any] = [0.0 * w[0], 0.0 * w[1], 0.0 * w[2]]
        rates: dict[str, Any] = {}
        for each in self.elements:
            found, more = each(m, t, w, q, states)
            for axis, value in found.items():
                torque[axis] = torque[axis] + value
            rates.update(more)
        return torque, [rates[name] for name in self.states]

    def scene(self) -> Scene:
        """Return the scene as a user writes it."""

        def with_states(t: Any, omega: Any, attitude: Any, states: Any) -> Any:
            return self.rates(Plain(), t, omega, attitude, states)

        def still(t: Any, omega: Any, states: Any) -> Any:
            return with_states(t, omega, None, states)

        def turned(t: Any, omega: Any, attitude: Any) -> Any:
            return with_states(t, omega, attitude, {})[0]

        def plain(t: Any, omega: Any) -> Any:
            return with_states(t, omega, None, {})[0]

        torque: Any = turned if self.turning else plain
        if self.states:
            torque = with_states if self.turning else still
        if self.table is not None:
            torque = table(*self.table) + torque
        attitude = (1.0, 0.0, 0.0, 0.0) if self.turning else None
        return Scene("", self.omega, self.moments, torque=torque, attitude=attitude,
                     states=self.states)  # fmt: skip

    def expanded(self, t: Decimal, y: list[Decimal], m: Modes) -> list[Series]:
        """Return the series of the unknowns."""
        unknowns = [Series(lambda k: Decimal(0), each) for each in y]
        time = Series(lambda k: Decimal(k == 1), t)
        w, n = unknowns[:3], 7 if self.turning else 3
        q = unknowns[3:n]
        torque, rates = self.rates(m, time, w, q, dict(zip(self.states, unknowns[n:], strict=True)))
        if self.table is not None:
            times, values, kind = self.table
            for axis, column in enumerate(np.transpose(values).tolist()):
                held = column[max(0, m.zone(time, *times) - 1)] if kind == "held" else None
                torque[axis] += m.interp(time, times, column) if held is None else held
        a, b, c = map(Decimal, self.moments)
        slopes = [(w[1] * w[2] * (b - c) + torque[0]) * (1 / a),
                  (w[2] * w[0] * (c - a) + torque[1]) * (1 / b),
                  (w[0] * w[1] * (a - b) + torque[2]) * (1 / c)]  # fmt: skip
        if q:
            half = [0.5 * each for each in w]
            slopes += [-(q[1] * half[0] + q[2] * half[1] + q[3] * half[2]),
                       q[0] * half[0] + q[2] * half[2] - q[3] * half[1],
                       q[0] * half[1] + q[3] * half[0] - q[1] * half[2],
                       q[0] * half[2] + q[1] * half[1] - q[2] * half[0]]  # fmt: skip
        for each, slope in zip(unknowns, [*slopes, *map(series, rates)], strict=True):
            each.make = _integral(slope)
        return unknowns


def _integral(slope: Series) -> Callable[[int], Decimal]:
    return lambda k: slope.at(k - 1) / k


def element(kind: str, source: Random, name: str) -> tuple[Element, dict[str, float]]:
    """Return a random element of a controller, and its states at the beginning."""
    i, j = source.sample(range(3), 2)
    k, limit, width = source.uniform(0.1, 1.0), source.uniform(0.02, 0.3), source.uniform(0.05, 0.4)
    a, push, speed = source.uniform(-0.5, 0.5), source.uniform(-0.3, 0.3), source.uniform(0.5, 3.0)
    level, rate = source.uniform(-0.4, 0.4), source.uniform(0.5, 5.0)
    low, high = source.uniform(-0.2, 0.2), source.uniform(-0.2, 0.2)
    gap = 10.0 ** source.uniform(-13.0, -1.0)
    places = sorted(source.uniform(-1.0, 1.0) for _ in range(5))
    moments = sorted(source.uniform(-6.0, 6.0) for _ in range(6))
    values = [source.uniform(-0.3, 0.3) for _ in range(6)]

    def u(m: Any, t: Any, w: Any) -> Any:
        return w[i] + a * w[j] + push * m.sin(speed * t)

    def held(m: Any, t: Any, w: Any, h: Any) -> tuple[dict[int, Any], dict[str, Any]]:
        wanted = -2.0 * k * w[i] - k * h[name]
        return {i: m.clip(wanted, -limit, limit)}, {name: m.inside(wanted, limit) * w[i]}

    def relay(m: Any, t: Any, w: Any, h: Any) -> tuple[dict[int, Any], dict[str, Any]]:
        on = 2.0 * m.above(u(m, t, w) + width * h[name], level) - 1.0
        return {j: limit * h[name]}, {name: rate * (on - h[name])}

    def sudden(m: Any, t: Any, w: Any, h: Any) -> tuple[dict[int, Any], dict[str, Any]]:
        on = 2.0 * m.above(h[name], 0.0) - 1.0
        up = 2.0 * m.above(u(m, t, w) + width * on, level) - 1.0
        return {j: limit * on}, {name: rate * (up - h[name])}

    plain: dict[str, Callable[[Any, Any, Any, Any], dict[int, Any]]] = {
        "clip": lambda m, t, w, q: {i: m.clip(-k * u(m, t, w), -limit, limit)},
        "dead zone": lambda m, t, w, q: {i: -k * m.dead(u(m, t, w), width)},
        "gap": lambda m, t, w, q: {j: k * w[i] * m.inside(u(m, t, w), width)},
        "switch": lambda m, t, w, q: {j: low + (high - low) * m.above(u(m, t, w), level)},
        "interp": lambda m, t, w, q: {i: m.interp(u(m, t, w), places, values[:5])},
        "program": lambda m, t, w, q: {i: m.interp(t, moments, values)},
        "stairs": lambda m, t, w, q: {j: 0.1 * m.floor(u(m, t, w) * 2.5)},
        "maximum": lambda m, t, w, q: {j: -k * m.maximum(w[i], u(m, t, w)) * w[j]},
        "pulse": lambda m, t, w, q: {
            j: limit * (m.above(u(m, t, w), level) - m.above(u(m, t, w), level + gap))
        },
        "unstable": lambda m, t, w, q: {i: (0.5 + k) * w[i]},
        "slew": lambda m, t, w, q: {
            n: m.clip(-k * q[n + 1] - (0.5 + k) * w[n], -limit, limit) for n in range(3)
        },
        "pointing": lambda m, t, w, q: {
            j: m.clip(-k * m.dead(q[j + 1] + rate * w[j], width), -limit, limit)
        },
    }  # fmt: skip
    if kind in plain:
        return lambda m, t, w, q, h: (plain[kind](m, t, w, q), {}), {}
    state = {"windup": held, "relay": relay, "sudden relay": sudden}[kind]
    start = source.choice([0.0, source.uniform(-1.0, 1.0)])
    return lambda m, t, w, q, h: state(m, t, w, h), {name: start}


TURNING = ("slew", "pointing")
KINDS = ("clip", "dead zone", "gap", "switch", "interp", "program", "stairs", "maximum", "pulse",
         "unstable", *TURNING, "windup", "relay", "sudden relay", "table")  # fmt: skip


def _body(source: Random) -> tuple[list[float], list[float], list[Element]]:
    """Return omega, moments, and a smooth torque."""
    size = source.uniform(0.2, 1.5)
    a, b, c = (source.uniform(0.2, 1.0) for _ in range(3))
    mean, wave = ([source.uniform(-0.1, 0.1) for _ in range(3)] for _ in range(2))
    speed = source.uniform(0.3, 2.0)

    def smooth(m: Any, t: Any, w: Any, q: Any, h: Any) -> Any:
        return {n: mean[n] + wave[n] * m.sin(speed * t + n) for n in range(3)}, {}

    return [source.gauss(0.0, size) for _ in range(3)], [b + c, c + a, a + b], [smooth]


def controlled(source: Random) -> tuple[str, Controlled]:
    """Return a random body with one to three elements, and their kinds."""
    omega, moments, elements = _body(source)
    kinds = source.choices(KINDS, k=source.randint(1, 3))
    end = source.choice([1.0, 1.0, 1.0, -0.3]) * source.uniform(1.0, 6.0)
    if "unstable" in kinds:
        end *= 0.3
    found = Controlled(omega, moments, elements, end, {})
    for number, kind in enumerate(kinds):
        if kind == "table":
            times = sorted(source.uniform(-6.0, 6.0) for _ in range(5))
            values = [[source.uniform(-0.3, 0.3) for _ in range(3)] for _ in range(5)]
            found.table = times, values, source.choice(["linear", "held"])
            continue
        one, states = element(kind, source, "abc"[number])
        elements.append(one)
        found.states |= states
        found.turning |= kind in TURNING
    if found.states:
        found.table = None  # a sum has no states
    return " + ".join(kinds), found


def grazing(source: Random) -> Controlled:
    """Return a body about an axis, whose omega or time nearly touches a level."""
    speed, phase, size = (
        source.uniform(0.5, 3.0),
        source.uniform(0.0, 6.0),
        source.uniform(0.2, 2.0),
    )
    gap = source.choice([0.0, 1.0, -1.0, -1.0]) * 10.0 ** source.uniform(-17.0, -1.0)
    kind, push, rate = (
        source.randrange(4),
        10.0 ** source.uniform(-7.0, 0.0),
        source.uniform(0.5, 3.0),
    )
    growing = source.choice([0.0, source.uniform(0.5, 1.5)])

    def one(m: Any, t: Any, w: Any, q: Any, h: Any) -> Any:
        turned = speed * t + phase
        other = m.sin(turned) if kind % 2 else w[0] * (1.0 / size)
        on = m.above(other, 1.0 + gap)
        if kind > 1:
            return {
                0: size * speed * m.sin(turned + 0.5 * math.pi),
                1: push * on + growing * w[1],
            }, {}
        latched = m.above(h["a"], 0.0)
        rates = {"a": rate * (on - 0.001)}
        return {0: size * speed * m.sin(turned + 0.5 * math.pi), 1: push * latched}, rates

    states = {} if kind > 1 else {"a": -1e-9}
    omega = [size * math.sin(phase), 0.1, 0.0]
    return Controlled(omega, [1.0, 1.0, 1.0], [one], source.uniform(2.0, 8.0), states)


def sliding(source: Random) -> Controlled:
    """Return a body whose relay pushes omega to a surface from both sides."""
    omega, moments, elements = _body(source)
    i, j = source.sample(range(3), 2)
    push, a, level = source.uniform(1.0, 4.0), source.uniform(-0.3, 0.3), source.uniform(-0.2, 0.2)
    soft = source.random() < 0.5

    def one(m: Any, t: Any, w: Any, q: Any, h: Any) -> Any:
        x = w[i] + a * w[j]
        more = m.clip(-x, -0.1, 0.1) if soft else 0.0
        return {i: push * (1.0 - 2.0 * m.above(x, level)) + more}, {}

    return Controlled(omega, moments, [*elements, one], source.uniform(10.0, 30.0), {})

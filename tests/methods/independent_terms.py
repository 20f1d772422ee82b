"""Random scenes with torques of the state, and their right-hand sides as formulas of mpmath.

Nothing here but the scenes themselves comes from pyharness: the formulas are written a second time,
in plain arithmetic of mpmath's numbers.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np
from mpmath import mp, mpf

from pyharness import Scene, TorqueLaw, torques
from pyharness.model.expressions import parsed
from pyharness.torques import recorded

# A torque (N m) in numbers of mpmath: a function of the time, omega, the attitude, and a time
# within the piece of tables that holds.
Formula = Callable[[Any, Any, Any, Any], list[Any]]
Vector = list[Any]
Term = tuple[Any, Formula, list[float]]  # the torque for a scene, its formula, and its breaks

KINDS = (
    "damping", "drag", "drag_per_axis", "rate_control", "attitude_control", "wheels", "motors",
    "gravity_gradient", "magnetic_dipole", "magnetic_damping", "in_space", "held", "linear",
    "cubic", "pulses", "law", "expression", "expression", "expression", "function", "function",
)  # fmt: skip
# Kinds whose tapes have no rounded constants if the numbers of the scene have few binary digits.
_EXACT = ("damping", "drag", "drag_per_axis", "rate_control", "wheels", "in_space", "held",
          "pulses", "law", "expression", "function")  # fmt: skip


@dataclass
class Drawn:
    """A scene, the times (s) and the tolerance to solve it with, and its right-hand side."""

    scene: Scene
    times: list[float]
    tolerance: float
    breaks: list[float]
    rates: Callable[[Vector, Vector], Vector]  # of the torque and omega
    formulas: list[Formula]
    # Whether pyharness rounds no constant of the scene, so that all digits can be compared.
    is_exact: bool

    def slopes(self, t: Any, state: Vector, middle: Any) -> Vector:
        """Return the derivatives of omega and of the quaternion, in numbers of mpmath."""
        omega, q = state[:3], state[3:]
        total = [mpf(0)] * 3
        for formula in self.formulas:
            total = plus(total, formula(t, omega, q, middle))
        (a, b, c, d), (x, y, z) = q, omega
        half = mpf(0.5)
        return [
            *self.rates(total, omega),
            -half * (b * x + c * y + d * z),
            half * (a * x + c * z - d * y),
            half * (a * y + d * x - b * z),
            half * (a * z + b * y - c * x),
        ]


def plus(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return [x + y for x, y in zip(a, b, strict=True)]


def times(factor: Any, a: Vector) -> Vector:
    """Return a vector times a number."""
    return [factor * x for x in a]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def applied(matrix: Any, a: Vector) -> Vector:
    """Return the product of a matrix, in rows, and a vector."""
    return [sum((x * y for x, y in zip(row, a, strict=True)), mpf(0)) for row in matrix]


def to_body(q: Vector, v: Vector) -> Vector:
    """Return a vector of space about the body axes: q* v q, for the normalised q."""
    norm = mp.sqrt(sum((x * x for x in q), mpf(0)))
    w, u = q[0] / norm, [-x / norm for x in q[1:]]
    once = cross(u, v)
    return plus(v, plus(times(2 * w, once), times(2, cross(u, once))))


def exact(value: Any) -> Any:
    """Return numbers, or nested lists of them, as numbers of mpmath."""
    return [exact(x) for x in value] if isinstance(value, (list, tuple)) else mpf(value)


class _Source:
    """Random numbers; with few binary digits if `short`, so that sums and products are exact."""

    def __init__(self, source: Random) -> None:
        self.random = source
        self.short = source.random() < 0.5

    def number(self, low: float, high: float) -> float:
        return self.rounded(self.random.uniform(low, high))

    def rounded(self, x: float) -> float:
        if not self.short or x == 0.0:
            return x
        mantissa, exponent = math.frexp(x)
        return math.ldexp(round(16 * mantissa) / 16, exponent)

    def vector(self, size: float) -> list[float]:
        return [self.number(-size, size) for _ in range(3)]

    def quaternion(self) -> list[float]:
        if self.short:  # its norm is exactly 1
            return [self.random.choice((-0.5, 0.5)) for _ in range(4)]
        return [self.random.gauss(0.0, 1.0) for _ in range(4)]

    def matrix(self, size: float) -> list[list[float]]:
        """Return a matrix with a positive diagonal that dominates."""
        rows = [self.vector(0.3 * size) for _ in range(3)]
        for n in range(3):
            rows[n][n] = self.number(size, 2.0 * size)
        return rows


def draw(random: Random) -> Drawn:
    """Return a random scene with one to three torques, of which one depends on the state."""
    source = _Source(random)
    speed = source.rounded(10.0 ** random.uniform(-0.5, 0.7))
    names = random.sample(KINDS, random.choice((1, 1, 2, 2, 3)))
    body: dict[str, Any]
    kind = random.choice(("moments",) * 5 + ("inertia",) * 3 + ("coefficients",) * 2)
    size = source.rounded(10.0 ** random.uniform(-1.0, 1.0))
    inertia, rates = _body(source, kind, size)
    if kind == "coefficients":
        size = 1.0
        names = [name for name in names if name != "gravity_gradient"] or ["damping"]
    terms = [_term(source, name, size, speed, inertia) for name in names]
    if names == ["law"]:
        names.append("damping")
        terms.append(_term(source, "damping", size, speed, inertia))
    torque = sum(term[0] for term in terms[1:]) + terms[0][0] if terms[1:] else terms[0][0]
    turning = getattr(torque, "needs_attitude", False) or random.random() < 0.4
    radians = 10.0 ** random.uniform(-0.3, 1.6)
    end = random.choice((1.0, 1.0, -0.5)) * radians / speed
    body = {kind: inertia}
    scene = Scene(
        " + ".join(names) + f", {kind}{', short' if source.short else ''}",
        source.vector(speed),
        torque=torque,
        attitude=source.quaternion() if turning else None,
        **body,
    )
    breaks = sorted({x for term in terms for x in term[2]})
    tolerance = 10.0 ** random.uniform(-13.0, -3.0)
    is_exact = source.short and kind != "inertia" and all(name in _EXACT for name in names)
    formulas = [term[1] for term in terms]
    return Drawn(scene, [0.37 * end, end], tolerance, breaks, rates, formulas, is_exact)


def _body(
    source: _Source, kind: str, size: float
) -> tuple[Any, Callable[[Vector, Vector], Vector]]:
    """Return the moments, the inertia matrix or the coefficients of a body, and Euler's equations.

    The equations are a function of the torque and omega that returns the derivative of omega.
    """
    if kind == "coefficients":
        given = source.vector(0.9)
        a, b, c = exact(given)
        return given, lambda n, w: [
            n[0] + a * w[1] * w[2], n[1] + b * w[2] * w[0], n[2] + c * w[0] * w[1]
        ]  # fmt: skip
    while True:
        moments = [size * source.number(0.3, 1.0) for _ in range(3)]
        if 2.0 * max(moments) < sum(moments):
            break
    if kind == "moments":
        i, j, k = exact(moments)
        return moments, lambda n, w: [
            (n[0] + (j - k) * w[1] * w[2]) / i,
            (n[1] + (k - i) * w[2] * w[0]) / j,
            (n[2] + (i - j) * w[0] * w[1]) / k,
        ]
    turn, _ = np.linalg.qr(np.array([source.vector(1.0) for _ in range(3)]))
    full = turn @ np.diag(moments) @ turn.T
    rows = [[source.rounded(float(full[min(i, j), max(i, j)])) for j in range(3)] for i in range(3)]
    matrix = exact(rows)
    with mp.workdps(40):
        inverse = (mp.matrix(matrix) ** -1).tolist()

    def rates(n: Vector, w: Vector) -> Vector:
        return applied(inverse, plus(n, times(-1, cross(w, applied(matrix, w)))))

    return rows, rates


def _law(source: _Source, size: float, speed: float, frame: str) -> tuple[TorqueLaw, list[Any]]:
    """Return a random law, and its value, integral and derivative as functions of the time."""
    constant, rate, one, two = (source.vector(size) for _ in range(4))
    rate = [source.rounded(0.1 * speed * x) for x in rate]
    f, g = (source.rounded(speed * 10.0 ** source.random.uniform(-1.0, 0.4)) for _ in range(2))
    law = TorqueLaw(constant, rate, [(one, f)], [(two, g)], frame)
    parts = [exact(each) for each in (constant, rate, one, two)]
    f, g = mpf(f), mpf(g)

    def combined(a: Any, b: Any, c: Any, d: Any) -> Vector:
        return [a * p + b * q + c * r + d * s for p, q, r, s in zip(*parts, strict=True)]

    functions: list[Any] = [
        lambda t: combined(1, t, mp.sin(f * t), mp.cos(g * t)),
        lambda t: combined(t, t * t / 2, (1 - mp.cos(f * t)) / f, mp.sin(g * t) / g),
        lambda t: combined(0, 1, f * mp.cos(f * t), -g * mp.sin(g * t)),
    ]
    return law, functions


def _term(source: _Source, name: str, size: float, speed: float, inertia: Any) -> Term:
    """Return a random term whose torque is about `size` (kg m2) times `speed` squared."""
    part = size * source.number(0.05, 0.7)
    if source.short:
        part = source.rounded(part)
    push = part * speed
    if name in ("held", "linear", "cubic", "pulses"):
        return _tabulated(source, name, push * speed, speed)
    if name in ("expression", "function"):
        return _expressed(source, name, push * speed, speed)
    make, formula = _ready(source, name, part, speed, inertia)
    return make, formula, []


def _ready(
    source: _Source, name: str, part: float, speed: float, inertia: Any
) -> tuple[Any, Formula]:
    """Return a ready term, and its formula."""
    push = part * speed
    if name == "damping":
        d = source.matrix(0.3 * push)
        m = exact(d)
        return torques.damping(d), lambda t, w, q, _: times(-1, applied(m, w))
    if name == "drag":
        c0, c1, c2 = source.number(0, 0.2 * push), source.vector(0.2 * part / speed), 0.0
        c1 = [abs(x) for x in c1]
        c2 = source.number(0.0, 0.05 * part / speed**3)
        e0, e1, e2 = mpf(c0), exact(c1), mpf(c2)

        def drag(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
            square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
            return [-x * (e0 + e * square + e2 * square**2) for x, e in zip(w, e1, strict=True)]

        return torques.drag([c0, c1, c2]), drag
    if name == "drag_per_axis":
        c0, d = source.number(0.0, 0.2 * push), source.matrix(0.1 * part / speed)
        e0, m = mpf(c0), exact(d)
        return torques.drag([c0, d], per_axis=True), lambda t, w, q, _: plus(
            times(-e0, w), times(-1, applied(m, [x**3 for x in w]))
        )
    if name == "rate_control":
        k, target = source.matrix(0.3 * push), source.vector(speed)
        m, aim = exact(k), exact(target)
        return torques.rate_control(k, target), lambda t, w, q, _: times(
            -1, applied(m, plus(w, times(-1, aim)))
        )
    if name == "attitude_control":
        spring, brake, target = (
            source.matrix(push * speed), source.matrix(0.2 * push), source.quaternion()
        )  # fmt: skip
        s, b, (g, h, i, j) = exact(spring), exact(brake), exact(target)
        with mp.workdps(40):
            norm = mp.sqrt(g * g + h * h + i * i + j * j)
            g, h, i, j = g / norm, h / norm, i / norm, j / norm

        def control(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
            scalar = g * q[0] + h * q[1] + i * q[2] + j * q[3]
            # The vector part of target* q.
            vector = plus(
                plus(times(g, q[1:]), times(-q[0], [h, i, j])), times(-1, cross([h, i, j], q[1:]))
            )
            return plus(applied(s, times(-2 * scalar, vector)), times(-1, applied(b, w)))

        return torques.attitude_control(spring, brake, target), control
    if name == "wheels":
        stored = source.vector(push)
        h0 = exact(stored)
        return torques.wheels(stored), lambda t, w, q, _: times(-1, cross(w, h0))
    if name == "motors":
        stored = source.vector(push)
        h1 = exact(stored)
        law, (value, integral, _) = _law(source, 0.3 * push * speed, speed, "body")
        return torques.wheels(stored, law), lambda t, w, q, _: times(
            -1, plus(cross(w, plus(h1, integral(t))), value(t))
        )
    if name == "gravity_gradient":
        rate = source.number(0.1 * speed, 0.8 * speed)
        n = mpf(rate)
        rows = exact(
            inertia
            if isinstance(inertia[0], list)
            else [[inertia[i] if i == j else 0.0 for j in range(3)] for i in range(3)]
        )

        def gradient(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
            r = to_body(q, [mp.cos(n * t), mp.sin(n * t), mpf(0)])
            return times(3 * n * n, cross(r, applied(rows, r)))

        return torques.gravity_gradient(inertia, rate), gradient
    if name == "law":
        law, (value, _, _) = _law(source, push * speed, speed, "body")
        return law, lambda t, w, q, _: value(t)
    law, (value, _, change) = _law(source, push * speed, speed, "space")
    if name == "in_space":
        return torques.in_space(law), lambda t, w, q, _: to_body(q, value(t))
    if name == "magnetic_dipole":
        moment = source.vector(1.0)
        m = exact(moment)
        return torques.magnetic_dipole(moment, law), lambda t, w, q, _: cross(
            m, to_body(q, value(t))
        )
    assert name == "magnetic_damping"
    # The field is of the size 1.
    law, (value, _, change) = _law(source, 1.0, speed, "space")
    gain = source.number(0.0, push)
    k = mpf(gain)

    def coils(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
        b = to_body(q, value(t))
        rate = plus(to_body(q, change(t)), times(-1, cross(w, b)))
        return cross(times(-k, rate), b)

    return torques.magnetic_damping(gain, law), coils


def _tabulated(source: _Source, name: str, size: float, speed: float) -> Term:
    """Return a random table or pulses, with its formula and its breaks."""
    gaps = [source.number(0.3, 2.0) / speed for _ in range(10)]
    start = source.number(-3.0, 0.5) / speed
    if name == "pulses":
        starts, durations, begin = [], [], start
        for gap, pause in zip(gaps[::2], gaps[1::2], strict=True):
            starts.append(begin)
            durations.append(gap)
            begin = begin + gap + pause
        torque = source.vector(size)
        value: Vector = exact(torque)
        ends = [a + b for a, b in zip(starts, durations, strict=True)]

        def pulse(t: Any, w: Vector, q: Vector, middle: Any) -> Vector:
            inside = any(a < middle < b for a, b in zip(starts, ends, strict=True))
            return value if inside else [mpf(0)] * 3

        return torques.pulses(starts, durations, torque), pulse, [*starts, *ends]
    begins = [start]
    for gap in gaps[: source.random.choice((4, 5, 7))]:
        begins.append(begins[-1] + gap)
    rows = [source.vector(size) for _ in begins]
    at: Vector = exact(begins)
    values: list[Vector] = exact(rows)
    bends = [_second_derivatives(at, [row[i] for row in values]) for i in range(3)]

    def tabulated(t: Any, w: Vector, q: Vector, middle: Any) -> Vector:
        if middle <= at[0]:
            return values[0]
        if middle >= at[-1]:
            return values[-1]
        k = max(n for n, x in enumerate(at) if x <= middle)
        if name == "held":
            return values[k]
        h, s = at[k + 1] - at[k], t - at[k]
        a, b = (h - s) / h, s / h
        line = [a * x + b * y for x, y in zip(values[k], values[k + 1], strict=True)]
        if name == "linear":
            return line
        # The cubic polynomial of a spline from its second derivatives at the two ends.
        return [
            x + ((a**3 - a) * m[k] + (b**3 - b) * m[k + 1]) * h * h / 6
            for x, m in zip(line, bends, strict=True)
        ]

    return torques.table(begins, rows, name), tabulated, begins


def _second_derivatives(at: Vector, values: Vector) -> Vector:
    """Return the second derivatives of a cubic spline, whose third is continuous near its ends."""
    with mp.workdps(40):
        n, h = len(at), [b - a for a, b in itertools.pairwise(at)]
        matrix, right = mp.zeros(n), mp.zeros(n, 1)
        for k in range(1, n - 1):
            matrix[k, k - 1], matrix[k, k + 1] = h[k - 1] / 6, h[k] / 6
            matrix[k, k] = (h[k - 1] + h[k]) / 3
            right[k] = (values[k + 1] - values[k]) / h[k] - (values[k] - values[k - 1]) / h[k - 1]
        for row, k in ((0, 1), (n - 1, n - 2)):
            matrix[row, k - 1], matrix[row, k], matrix[row, k + 1] = (
                1 / h[k - 1], -1 / h[k - 1] - 1 / h[k], 1 / h[k]
            )  # fmt: skip
        return list(mp.lu_solve(matrix, right))


# The nodes of a random expression: the text, the operation on symbols with NumPy, and that of
# mpmath, with a place for each operand. All are smooth everywhere.
_NODES: list[tuple[str, Callable[..., Any], Callable[..., Any]]] = [
    ("({} + {})", lambda x, y: x + y, lambda x, y: x + y),
    ("({} - {})", lambda x, y: x - y, lambda x, y: x - y),
    ("({} * {})", lambda x, y: x * y, lambda x, y: x * y),
    ("({} / (2 + {}**2))", lambda x, y: x / (2.0 + y**2), lambda x, y: x / (2 + y * y)),
    ("sin({})", lambda x: np.sin(x), lambda x: mp.sin(x)),
    ("cos({})", lambda x: np.cos(x), lambda x: mp.cos(x)),
    ("tanh({})", lambda x: np.tanh(x), lambda x: mp.tanh(x)),
    ("exp(-{}**2)", lambda x: np.exp(-(x**2)), lambda x: mp.exp(-x * x)),
    ("sqrt(1.25 + {}**2)", lambda x: np.sqrt(1.25 + x**2), lambda x: mp.sqrt(mpf(1.25) + x * x)),
    ("({} / sqrt(1.5 + {}**2))", lambda x, y: x / np.sqrt(1.5 + y**2),
     lambda x, y: x / mp.sqrt(mpf(1.5) + y * y)),
    ("tan(0.5*sin({}))", lambda x: np.tan(0.5 * np.sin(x)), lambda x: mp.tan(mp.sin(x) / 2)),
    ("cosh(sin({}))", lambda x: np.cosh(np.sin(x)), lambda x: mp.cosh(mp.sin(x))),
    ("sinh(cos({}))", lambda x: np.sinh(np.cos(x)), lambda x: mp.sinh(mp.cos(x))),
    ("(({})**3)", lambda x: x**3, lambda x: x * x * x),
    ("((1.5 + {}**2)**-2)", lambda x: (1.5 + x**2) ** -2, lambda x: 1 / (mpf(1.5) + x * x) ** 2),
]  # fmt: skip


def _expressed(source: _Source, name: str, size: float, speed: float) -> Term:
    """Return a random expression of a scene file or a Python function, and its formula."""
    turning = source.random.random() < 0.5
    axes = [_tree(source, source.random.choice((1, 2, 3)), speed, turning) for _ in range(3)]
    sizes = source.vector(size)
    brake = source.number(0.0, 0.3) * size / speed
    if source.short:
        brake = source.rounded(brake)
    factors, b = exact(sizes), mpf(brake)

    def formula(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
        return [
            f * mp.tanh(axis[2](t, w, q)) - b * x
            for f, axis, x in zip(factors, axes, w, strict=True)
        ]

    if name == "expression":
        texts = [
            f"{s!r}*tanh({axis[0]}) - brake*w{n}"
            for n, (s, axis) in enumerate(zip(sizes, axes, strict=True), 1)
        ]
        return parsed(texts, {"brake": brake}), formula, []

    def function(t: Any, w: Any, q: Any) -> Any:
        return np.array([np.tanh(axis[1](t, w, q)) for axis in axes]) * sizes - brake * w

    return recorded(function), formula, []


def _tree(source: _Source, depth: int, speed: float, turning: bool) -> tuple[str, Any, Any]:
    """Return a random expression as a text, as a function of symbols, and as one of mpmath."""
    if depth == 0:
        return _leaf(source, speed, turning)
    text, symbols, numbers = source.random.choice(_NODES)
    parts = [_tree(source, depth - 1, speed, turning) for _ in range(symbols.__code__.co_argcount)]
    return (
        text.format(*(part[0] for part in parts)),
        lambda t, w, q: symbols(*(part[1](t, w, q) for part in parts)),
        lambda t, w, q: numbers(*(part[2](t, w, q) for part in parts)),
    )


def _leaf(source: _Source, speed: float, turning: bool) -> tuple[str, Any, Any]:
    n = source.random.randrange(4)
    c = source.rounded(source.random.choice((-1.0, 1.0)) * source.number(0.3, 1.5))
    kind = source.random.choice(("w", "w", "t", "q" if turning else "w"))
    if kind == "q":
        k = mpf(c)
        return f"({c!r}*q{n})", lambda t, w, q: c * q[n], lambda t, w, q: k * q[n]
    if kind == "t":
        f = source.rounded(c * speed)
        k = mpf(f)
        return f"sin({f!r}*t)", lambda t, w, q: np.sin(f * t), lambda t, w, q: mp.sin(k * t)
    i, f = n % 3, source.rounded(c / speed)
    k = mpf(f)
    return f"({f!r}*w{i + 1})", lambda t, w, q: f * w[i], lambda t, w, q: k * w[i]

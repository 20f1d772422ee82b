"""Random scenes with torques of the state, and their right-hand sides as formulas of mpmath.

Only the scenes come from pyharness. The formulas are written a second time, in plain arithmetic of
mpmath's numbers.
"""

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
Formula = Callable[[Any, Any, Any, Any], Any]
Vector = Any  # an array of mpmath's numbers
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
        total = sum(formula(t, omega, q, middle) for formula in self.formulas)
        turn = q[0] * omega + np.cross(q[1:], omega)
        return np.array([*self.rates(total, omega), *(x / 2 for x in (-(q[1:] @ omega), *turn))])


def to_body(q: Vector, v: Vector) -> Vector:
    """Return a vector of space about the body axes: q* v q, for the normalised q."""
    w, *u = q / mp.sqrt(q @ q)
    once = np.cross(v, u)
    return v + 2 * w * once + 2 * np.cross(once, u)


# Return numbers, or nested lists of them, as numbers of mpmath.
exact: Any = np.frompyfunc(mpf, 1, 1)


class _Source:
    """Random numbers; if `short`, with few binary digits, so that sums and products are exact."""

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
        " + ".join(names) + f", {kind}{', short' if source.short else ''}", source.vector(speed),
        torque=torque, attitude=source.quaternion() if turning else None, **body,
    )  # fmt: skip
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

    def products(w: Vector) -> Vector:
        return w[[1, 2, 0]] * w[[2, 0, 1]]

    if kind == "coefficients":
        given = source.vector(0.9)
        factors = exact(given)
        return given, lambda n, w: n + factors * products(w)
    while True:
        moments = [size * source.number(0.3, 1.0) for _ in range(3)]
        if 2.0 * max(moments) < sum(moments):
            break
    if kind == "moments":
        m = exact(moments)
        return moments, lambda n, w: (n + (m[[1, 2, 0]] - m[[2, 0, 1]]) * products(w)) / m
    turn, _ = np.linalg.qr(np.array([source.vector(1.0) for _ in range(3)]))
    full = turn @ np.diag(moments) @ turn.T
    rows = [[source.rounded(float(full[min(i, j), max(i, j)])) for j in range(3)] for i in range(3)]
    matrix = exact(rows)
    with mp.workdps(40):
        inverse = np.array((mp.matrix(rows) ** -1).tolist())
    return rows, lambda n, w: inverse @ (n - np.cross(w, matrix @ w))


def _law(source: _Source, size: float, speed: float, frame: str) -> tuple[TorqueLaw, list[Any]]:
    """Return a random law, and its value, integral and derivative as functions of the time."""
    constant, rate, one, two = (source.vector(size) for _ in range(4))
    rate = [source.rounded(0.1 * speed * x) for x in rate]
    f, g = (source.rounded(speed * 10.0 ** source.random.uniform(-1.0, 0.4)) for _ in range(2))
    law = TorqueLaw(constant, rate, [(one, f)], [(two, g)], frame)
    parts = exact((constant, rate, one, two))
    f, g = mpf(f), mpf(g)

    def combined(*factors: Any) -> Vector:
        return np.array(factors) @ parts

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
        return torques.damping(d), lambda t, w, q, _: -m @ w
    if name == "drag":
        c0, c1 = source.number(0, 0.2 * push), [abs(x) for x in source.vector(0.2 * part / speed)]
        c2 = source.number(0.0, 0.05 * part / speed**3)
        e1 = exact(c1)
        return torques.drag(
            [c0, c1, c2]
        ), lambda t, w, q, _: -w * (c0 + e1 * (w @ w) + c2 * (w @ w) ** 2)
    if name == "drag_per_axis":
        c0, d = source.number(0.0, 0.2 * push), source.matrix(0.1 * part / speed)
        m = exact(d)
        return torques.drag([c0, d], per_axis=True), lambda t, w, q, _: -c0 * w - m @ w**3
    if name == "rate_control":
        k, target = source.matrix(0.3 * push), source.vector(speed)
        m, aim = exact(k), exact(target)
        return torques.rate_control(k, target), lambda t, w, q, _: -m @ (w - aim)
    if name == "attitude_control":
        spring, brake, target = (
            source.matrix(push * speed), source.matrix(0.2 * push), source.quaternion()
        )  # fmt: skip
        s, b, g = exact(spring), exact(brake), exact(target)
        with mp.workdps(40):
            g = g / mp.sqrt(g @ g)

        def control(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
            # The vector part of target* q.
            vector = g[0] * q[1:] - q[0] * g[1:] - np.cross(g[1:], q[1:])
            return s @ (-2 * (g @ q) * vector) - b @ w

        return torques.attitude_control(spring, brake, target), control
    if name == "wheels":
        stored = source.vector(push)
        h0 = exact(stored)
        return torques.wheels(stored), lambda t, w, q, _: -np.cross(w, h0)
    if name == "motors":
        stored = source.vector(push)
        h1 = exact(stored)
        law, (value, integral, _) = _law(source, 0.3 * push * speed, speed, "body")
        return torques.wheels(
            stored, law
        ), lambda t, w, q, _: -np.cross(w, h1 + integral(t)) - value(t)
    if name == "gravity_gradient":
        rate = source.number(0.1 * speed, 0.8 * speed)
        n, rows = mpf(rate), exact(inertia)
        rows = rows if rows.ndim == 2 else np.diag(rows)

        def gradient(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
            r = to_body(q, np.array([mp.cos(n * t), mp.sin(n * t), mpf(0)]))
            return 3 * n * n * np.cross(r, rows @ r)

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
        return torques.magnetic_dipole(moment, law), lambda t, w, q, _: np.cross(
            m, to_body(q, value(t))
        )
    assert name == "magnetic_damping"
    # The field is of the size 1.
    law, (value, _, change) = _law(source, 1.0, speed, "space")
    gain = source.number(0.0, push)

    def coils(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
        b = to_body(q, value(t))
        return np.cross(-gain * (to_body(q, change(t)) - np.cross(w, b)), b)

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
            return value if inside else 0 * value

        return torques.pulses(starts, durations, torque), pulse, [*starts, *ends]
    begins = [start]
    for gap in gaps[: source.random.choice((4, 5, 7))]:
        begins.append(begins[-1] + gap)
    rows = [source.vector(size) for _ in begins]
    at: Vector = exact(begins)
    values: Vector = exact(rows)
    bends = _second_derivatives(at, values)

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
        line = a * values[k] + b * values[k + 1]
        if name == "linear":
            return line
        # The cubic polynomial of a spline from its second derivatives at the two ends.
        bent = (a**3 - a) * bends[k] + (b**3 - b) * bends[k + 1]
        return line + bent * h * h / 6

    return torques.table(begins, rows, name), tabulated, begins


def _second_derivatives(at: Vector, values: Vector) -> Vector:
    """Return the second derivatives of cubic splines, whose third is continuous near their ends."""
    with mp.workdps(40):
        n, h = len(at), np.diff(at)
        matrix, right = mp.zeros(n), 0 * values
        for k in range(1, n - 1):
            matrix[k, k - 1], matrix[k, k + 1] = h[k - 1] / 6, h[k] / 6
            matrix[k, k] = (h[k - 1] + h[k]) / 3
            right[k] = (values[k + 1] - values[k]) / h[k] - (values[k] - values[k - 1]) / h[k - 1]
        for row, k in ((0, 1), (n - 1, n - 2)):
            matrix[row, k - 1], matrix[row, k + 1] = 1 / h[k - 1], 1 / h[k]
            matrix[row, k] = -1 / h[k - 1] - 1 / h[k]
        return np.array((matrix**-1).tolist()) @ right


_FUNCTIONS = ("sin", "cos", "tan", "exp", "sqrt", "tanh", "cosh", "sinh")
# The nodes of a random expression, with a place for each operand. All are smooth everywhere.
_NODES = (
    "({} + {})", "({} - {})", "({} * {})", "({} / (2 + {}**2))", "sin({})", "cos({})", "tanh({})",
    "exp(-{}**2)", "sqrt(1.25 + {}**2)", "({} / sqrt(1.5 + {}**2))", "tan(0.5*sin({}))",
    "cosh(sin({}))", "sinh(cos({}))", "(({})**3)", "((1.5 + {}**2)**-2)",
)  # fmt: skip


def _values(texts: list[str], functions: Any) -> Callable[[Any, Any, Any], Any]:
    """Return the function of t, omega and the quaternion that expressions are."""
    known = {n: getattr(functions, n) for n in _FUNCTIONS}
    codes = [compile(f"tanh({text})", text, "eval") for text in texts]

    def values(t: Any, w: Any, q: Any) -> Any:
        names = {"t": t, "w1": w[0], "w2": w[1], "w3": w[2]}
        names |= {f"q{n}": each for n, each in enumerate(q)}
        return np.array([eval(code, known, names) for code in codes])

    return values


def _expressed(source: _Source, name: str, size: float, speed: float) -> Term:
    """Return a random expression of a scene file or a Python function, and its formula."""
    turning = source.random.random() < 0.5
    texts = [_tree(source, source.random.choice((1, 2, 3)), speed, turning) for _ in range(3)]
    sizes = source.vector(size)
    brake = source.number(0.0, 0.3) * size / speed
    if source.short:
        brake = source.rounded(brake)
    factors, exactly = exact(sizes), _values(texts, mp)

    def formula(t: Any, w: Vector, q: Vector, _: Any) -> Vector:
        return factors * exactly(t, w, q) - brake * w

    if name == "expression":
        rows = [
            f"{s!r}*tanh({text}) - brake*w{n}"
            for n, (s, text) in enumerate(zip(sizes, texts, strict=True), 1)
        ]
        return parsed(rows, {"brake": brake}), formula, []
    symbols = _values(texts, np)
    return recorded(lambda t, w, q: symbols(t, w, q) * sizes - brake * w), formula, []


def _tree(source: _Source, depth: int, speed: float, turning: bool) -> str:
    """Return the text of a random expression."""
    if depth == 0:
        return _leaf(source, speed, turning)
    node = source.random.choice(_NODES)
    return node.format(*(_tree(source, depth - 1, speed, turning) for _ in range(node.count("{}"))))


def _leaf(source: _Source, speed: float, turning: bool) -> str:
    n = source.random.randrange(4)
    c = source.rounded(source.random.choice((-1.0, 1.0)) * source.number(0.3, 1.5))
    kind = source.random.choice(("w", "w", "t", "q" if turning else "w"))
    if kind == "q":
        return f"({c!r}*q{n})"
    if kind == "t":
        return f"sin({source.rounded(c * speed)!r}*t)"
    return f"({source.rounded(c / speed)!r}*w{n % 3 + 1})"

"""Random scenes with torques that depend on omega or attitude.

Torques are sums of recorded functions or ready-made terms, about as large as the gyroscopic torque.
End times may be negative.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from pyharness.engine.torques.term_file import KINDS
from pyharness.model.array_type import Array
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw

# A torque as a function of t, omega and attitude, which are symbols or numbers.
Term = Callable[[Any, Any, Any], Any]
Body = tuple[float, list[float], float]
STEADY = ("damping", "wheel", "drag", "wave", "control", "quotient", "root", "decay", "swing")
TURNING = ("gradient", "field", "spring", "mixed")
# Terms that change mostly in small ranges of time or omega.
SUDDEN = ("switch", "friction", "bell", "peak", "burst", "flash", "sigmoid", "swings")

READY = tuple(KINDS)
TIMED = ("table", "pulses")  # depend on time alone


@dataclass
class Sizes:
    """Random numbers from which a ready torque draws its arguments; units from kg m2 and s."""

    source: Random
    moments: list[float]
    speed: float

    def __post_init__(self) -> None:
        source, speed = self.source, self.speed
        self.part = max(self.moments) * speed * source.uniform(0.05, 1.0)
        self.vector = [source.uniform(-1.0, 1.0) for _ in range(3)]
        self.several = [source.uniform(0.1, 0.5) * self.part for _ in range(3)]
        self.rate = speed * 10.0 ** source.uniform(-1.0, 0.5)
        waves = [([self.part, 0.0, self.part], self.rate)]
        self.field = TorqueLaw(self.vector, sines=waves, frame="space")

    def times(self) -> Array:
        length = 1.0 / self.speed
        found = [self.source.uniform(0.1, 3.0) * length for _ in range(12)]
        return np.cumsum(found) - 3.0 * length

    def rows(self, count: int) -> list[list[float]]:
        size = self.part * self.speed
        return [[self.source.uniform(-size, size) for _ in range(3)] for _ in range(count)]


def draw(source: Random, names: tuple[str, ...] = STEADY + TURNING) -> tuple[Scene, float]:
    """Return a random scene under one to three terms of `names`, and its end time (s)."""
    chosen = source.sample(names, min(len(names), source.choice((1, 1, 2, 2, 3))))
    size, _, speed = body = _body(source)
    terms = [term(source, name, size, speed) for name in chosen]
    turning = any(name in TURNING for name in chosen)

    def torque(t: Any, omega: Any, q: Any) -> Any:
        return sum(each(t, omega, q) for each in terms)

    def still(t: Any, omega: Any) -> Any:
        return torque(t, omega, None)

    with_attitude = turning or source.random() < 0.3
    return _moving(source, chosen, body, torque if turning else still, with_attitude)


def draw_ready(source: Random, names: tuple[str, ...] = READY) -> tuple[Scene, float]:
    """Return a random scene under one or two ready-made terms, and its end time (s)."""
    chosen = source.sample(names, source.choice((1, 2)))
    _, moments, speed = body = _body(source)
    torque = sum(ready(source, name, moments, speed) for name in chosen)
    return _moving(source, chosen, body, torque, with_attitude=True)


def _body(source: Random) -> Body:
    """Return a size (kg m2), random possible moments of this size (kg m2), and a speed (rad/s)."""
    size = 10.0 ** source.uniform(-2.0, 1.0)
    while True:
        found = sorted(10.0 ** source.uniform(-0.5, 0.3) for _ in range(3))
        if found[2] < found[0] + found[1]:
            source.shuffle(found)
            return size, [size * x for x in found], 10.0 ** source.uniform(-1.0, 1.0)


def _moving(
    source: Random, chosen: list[str], body: Body, torque: Any, with_attitude: bool
) -> tuple[Scene, float]:
    _, moments, speed = body
    omega = [source.uniform(-speed, speed) for _ in range(3)]
    attitude = [source.gauss(0.0, 1.0) for _ in range(4)] if with_attitude else None
    scene = Scene(" + ".join(chosen), omega, moments, torque=torque, attitude=attitude)
    radians = 10.0 ** source.uniform(-0.5, 1.7)
    return scene, source.choice((1.0, 1.0, -0.3)) * radians / speed


def ready(source: Random, name: str, moments: list[float], speed: float) -> StateTorque:
    """Return a ready-made term with random arguments, about as large as the gyroscopic torque."""
    draw = KINDS[name].draw
    assert draw is not None
    found: StateTorque = KINDS[name].function(**draw(Sizes(source, moments, speed)))
    return found


def term(source: Random, name: str, size: float, speed: float) -> Term:
    """Return a random torque of the kind `name`, of about `size` (kg m2) times `speed` squared."""
    scale = size * speed * source.uniform(0.05, 1.0)
    a, b, c = (source.uniform(-1.0, 1.0) for _ in range(3))
    vector = np.array([source.uniform(-1.0, 1.0) for _ in range(3)])
    other = np.array([source.uniform(-1.0, 1.0) for _ in range(3)])
    matrix = np.array([[source.uniform(-1.0, 1.0) for _ in range(3)] for _ in range(3)])
    f = speed * 10.0 ** source.uniform(-1.0, 0.7)
    if name in SUDDEN:
        width = 10.0 ** source.uniform(-2.0 if name == "sigmoid" else -3.0, -0.5)
        middle = source.uniform(0.0, 5.0)
    push = scale * speed * vector
    terms: dict[str, Term] = {
        "damping": lambda t, w, q: -0.2 * scale * ((matrix @ matrix.T) @ w),
        "wheel": lambda t, w, q: scale * np.cross(vector, w),
        "drag": lambda t, w, q: -0.2 * scale / speed * w * np.sqrt(w @ w + 0.01 * speed**2),
        "wave": lambda t, w, q: scale * speed * (vector * np.sin(f * t + a) + b * other),
        "control": lambda t, w, q: -scale * (w - speed * vector),
        "quotient": lambda t, w, q: scale * w * (a + b * f * t) / (1.0 + (f * t) ** 2),
        "root": lambda t, w, q: scale * vector * w[0] / np.sqrt(1.5 + (w[1] / speed) ** 2),
        "decay": lambda t, w, q: push * np.exp(-((w[2] / speed) ** 2) - c * c),
        "swing": lambda t, w, q: push * np.cos(w[0] / speed + a * w[1] / speed),
        "gradient": lambda t, w, q: gradient(t, q, scale * speed * (1.0 + np.abs(vector)), f),
        "field": lambda t, w, q: scale * speed * np.cross(vector, to_body(q, orbit(t, f) + other)),
        "spring": lambda t, w, q: -scale * speed * q[0] * q[1:] - 0.3 * scale * w,
        "switch": lambda t, w, q: -scale * speed * vector * np.tanh(w[0] / (width * speed)),
        "friction": lambda t, w, q: -scale * speed * w / np.sqrt(w @ w + (width * speed) ** 2),
        "bell": lambda t, w, q: push * np.exp(-((w[1] / (width * speed)) ** 2)),
        "peak": lambda t, w, q: push / (1.0 + (w[2] / (width * speed)) ** 2) ** 2,
        "burst": lambda t, w, q: push * np.exp(-(((speed * t - middle) / width) ** 2)),
        "flash": lambda t, w, q: push / (1.0 + ((speed * t - middle) / width) ** 2),
        "sigmoid": lambda t, w, q: push / (1.0 + np.exp(-w[0] / (width * speed))),
        "swings": lambda t, w, q: push * np.sin(f * t + a) ** 24,
        "mixed": lambda t, w, q: scale * vector * (w @ vector) * q[1] * np.sin(q[2] + f * t),
    }
    return terms[name]


def orbit(t: Any, rate: float) -> Any:
    """Return the unit vector to a satellite in a circular orbit, in space axes."""
    return np.array([np.cos(rate * t), np.sin(rate * t), 0.0 * t])


def gradient(t: Any, q: Any, inertia: Any, rate: float) -> Any:
    """Return r x I r, the gravity-gradient torque without its factor, with the local vertical r."""
    r = to_body(q, orbit(t, rate))
    return np.cross(r, inertia * r)


def to_body(q: Any, vector: Any) -> Any:
    """Return the body-axis components of a vector given in space axes."""
    w, v = q[0], q[1:]
    return (w * w - v @ v) * vector + 2.0 * (v @ vector) * v - 2.0 * w * np.cross(v, vector)

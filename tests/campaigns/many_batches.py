"""Random batches of `solve_many` with arrays of parameters of their torque."""

from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any, NamedTuple

import numpy as np

from pyharness import ChangingMoments, Scene, TorqueLaw
from pyharness.checks.scenes.state_scenes import READY, ready
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.model.trajectory import Array
from pyharness.torques import recorded, wheels


def timed(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [a * np.sin(c * t) - 0.05 * t, b + 0.0 * t, a * b * np.cos(0.7 * t)]


def still(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [a, -b, 0.3 * c]


def smooth(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    x, y, z = w
    return [-a * x - b * x**3, b * np.sin(c * t) - a * y, c * x / np.sqrt(1.0 + z * z)]


def pole(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [a * w[0] ** 2 + b, 0.05 / (c - 0.4 * t), -b * w[2]]


def clipped(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [*np.clip(-a * w[:2], -0.5 * b, b), -a * np.maximum(w[2], 0.3 * c)]


def switched(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [np.where(t > 2.0 * c, a, -b), np.where(w[0] > b, -a, a * w[2]), -b * w[2]]


def braked(t: Any, w: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return [-a * np.sign(w[0]), b * np.sin(c * t), 0.0 * t]


def pointed(t: Any, w: Any, q: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return -5.0 * a * q[1:] - b * w + 0.1 * np.sin(c * t)


def slewed(t: Any, w: Any, q: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return np.clip(-c * q[1:] - a * w, -b, b)


def motor(t: Any, w: Any, states: Any, *, a: float = 0.2, b: float = 0.1, c: float = 1.3) -> Any:
    return a * w - b * np.sin(c * t)


# Texts in terms of a, b and c: the torque, and the start and rates of own states.
EXPRESSIONS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "expression": (["-a*w1 - b*w1**3", "b*sin(c*t) - a*w2", "-b*w3*abs(w3)"], {}),
    "expression with a switch": (
        ["where(w1 > b, -a, 0.1)", "clip(-a*w2, -b, b)", "where(t > 2*c, a, -b)"], {},
    ),
    "law in expressions": (["a*sin(c*t)", "b", "-a*t*0.1"], {}),
    "expression of the attitude": (["-a*q1 - b*w1", "-a*q2", "c*0.1*q3*q0 - b*w3"], {}),
    "states": (
        ["-a*x", "0.1*sin(c*t)", "-b*w3"],
        {"x": {"start": 0.3, "rate": "w1 - b*x"}, "y": {"rate": "a*y + c*0.1"}},
    ),
    "states with a switch": (
        ["where(x > b, -a, a)", "-b*w2", "0.1"],
        {"x": {"start": -0.2, "rate": "where(t > c, 0.3, w1) - b*x"}},
    ),
    "states and the attitude": (["-a*q1 - x", "0", "-b*w3"], {"x": {"rate": "c*q2 - a*x"}}),
}  # fmt: skip
FUNCTIONS: dict[str, Callable[..., Any]] = {
    each.__name__: each
    for each in (timed, still, smooth, pole, clipped, switched, braked, pointed, slewed)
}
_RANGES = {"a": (-0.1, 0.6), "b": (0.02, 0.6), "c": (0.02, 2.0)}
KINDS = (*FUNCTIONS, *EXPRESSIONS, "ready", "ready and a switch", "with a law", "wheels")


class Batch(NamedTuple):
    """The arguments of `solve_many`, and of each body's scene."""

    kind: str
    scene: Scene
    arguments: dict[str, Any]
    alone: Callable[[int], Scene]
    n: int


def _torque(source: Random, kind: str, turning: bool, speed: float) -> Callable[..., Any]:
    """Return a function of the values a, b and c, as keywords, that returns a torque."""
    if kind in FUNCTIONS:
        return lambda **values: partial(FUNCTIONS[kind], **values)
    if kind == "wheels":
        return lambda **values: wheels((0.0, 0.0, 0.5), partial(motor, **values))
    if kind == "with a law":
        wave = [source.uniform(-0.2, 0.2) for _ in range(3)], source.uniform(0.3, 3.0)
        frame = "space" if turning else "body"
        law = TorqueLaw([0.05, 0.0, -0.02], sines=[wave], frame=frame)
        return lambda **values: recorded(partial(smooth, **values)) + law
    names = [each for each in READY if turning or each in ("damping", "drag", "rate_control",
             "table", "pulses")]  # fmt: skip
    term = ready(source, source.choice(names), [1.0, 1.5, 2.0], 0.3 * speed)
    function = smooth if kind == "ready" else source.choice([clipped, switched])
    return lambda **values: term + recorded(partial(function, **values))


def draw(source: Random, kind: str) -> Batch:
    """Return a random batch."""
    rng = np.random.default_rng(source.getrandbits(64))
    n = source.choice((1, 2, 3, 5, 9))
    usual = {name: source.uniform(0.05, 0.5) for name in "ab"} | {"c": source.uniform(0.3, 2.0)}
    turning = kind in ("pointed", "slewed") or "attitude" in kind or source.random() < 0.4
    speed = 10.0 ** source.uniform(-1.0, 0.5)
    make = None if kind in EXPRESSIONS else _torque(source, kind, turning, speed)

    def several(low: float, high: float, *shape: int) -> tuple[Any, Callable[[int], Any]]:
        """Return values for all bodies, or for each, and the function that chooses a body's."""
        is_one = source.random() < 0.3
        values = rng.uniform(low, high, shape if is_one else (n, *shape))
        return values, lambda i: values if is_one else values[i]

    given: dict[str, Any] = {}
    own: dict[str, Callable[[int], Any]] = {}
    body: dict[str, Any] = {"moments": sorted(rng.uniform(1.0, 1.9, 3))}
    if source.random() < 0.15 and not turning:
        body = {"coefficients": (0.3, -0.4, 0.2)}
    elif source.random() < 0.15:
        body = {"inertia": _matrices(rng)}
    elif source.random() < 0.1:
        body = {"moments": ChangingMoments([[1.5, 0.004], [1.3, 0.0, 1e-4], [1.6]])}
    arrays = source.choice((None, None, "moments", "moments", "inertia", "coefficients"))
    if arrays == "inertia":
        is_one = source.random() < 0.3
        matrices = _matrices(rng) if is_one else np.array([_matrices(rng) for _ in range(n)])
        given[arrays], own[arrays] = matrices, lambda i: matrices if is_one else matrices[i]
    elif arrays and not (arrays == "coefficients" and turning):
        low = -0.9 if arrays == "coefficients" else 1.0
        given[arrays], own[arrays] = several(low, 0.9 if low < 0.0 else 1.9, 3)
    start = rng.normal(0.0, speed, 3)
    if source.random() < 0.8:
        size = source.choice((speed, speed, speed, 0.0, 1e-6))
        given["omega"], own["omega"] = several(-size, size, 3)
    attitude = rng.normal(size=4) if turning else None
    if turning and source.random() < 0.5:
        given["attitude"], own["attitude"] = several(-1.0, 1.0, 4)
    names = source.sample("abc", source.randint(1, 3))
    parameters = {}
    for name in names:
        parameters[name], own[name] = several(*_RANGES[name])
        if source.random() < 0.1:
            parameters[name] = np.array(source.choice((0, 1)))
            own[name] = partial(lambda value, i: value, float(parameters[name]))
    if source.random() < 0.1 and n > 1:  # one body can't be solved
        name = source.choice(names)
        parameters[name] = np.broadcast_to(parameters[name], n).copy().astype(float)
        parameters[name][-1] = source.choice((np.nan, np.inf))
        own[name] = parameters[name].__getitem__
    ends = _times(source, rng, n)
    starts: dict[str, Any] = {}
    if kind.startswith("states") and source.random() < 0.5:
        starts["x"], own["x"] = several(-0.5, 0.5)
    arguments = {
        **given, **ends, "parameters": parameters, "effort": 0.05,
        "tolerance": 10.0 ** source.uniform(-11.0, -4.0),
        "method": source.choice(("auto",) * 6 + ("taylor",) * 3 + ("gauss-4",)),
        "estimates": source.random() < 0.5, "threads": source.choice((1, 2)),
    }  # fmt: skip
    if starts:
        arguments["states"] = starts
    if source.random() < 0.03:
        arguments["compiled"] = True
    if source.random() < 0.08:
        arguments["sensitivities"] = ["omega", *(f"torque.{name}" for name in names)]

    def scene(values: dict[str, float], **fields: Any) -> Scene:
        if make is not None:
            return Scene(**{**fields, "torque": make(**values)})
        texts, states = EXPRESSIONS[kind]
        found = scene_of(
            {"body": {"moments": [1, 1, 1]}, "initial": {"omega": [0, 0, 0]}, "states": states,
             "torque": {"expression": texts, "constants": values}}, "",
        )  # fmt: skip
        own = {each.name: float(fields.pop(each.name, each.start)) for each in found.states}
        return Scene(**{**fields, "torque": found.torque, "states": own})

    def alone(i: int) -> Scene:
        mine = {name: get(i) for name, get in own.items()}
        values = {name: float(mine.pop(name, usual[name])) for name in "abc"}
        of_body: dict[str, Any] = {
            key: mine.pop(key) for key in ("moments", "inertia", "coefficients") if key in mine
        }
        fields = {"omega": start, "attitude": attitude, **(of_body or body), **mine}
        return scene(values, name=f"{kind} {i}", **fields)

    return Batch(
        kind, scene(usual, name=kind, omega=start, attitude=attitude, **body), arguments, alone, n
    )


def _matrices(rng: np.random.Generator) -> Array:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix: Array = turn @ np.diag(rng.uniform(1.0, 1.9, 3)) @ turn.T
    return np.maximum(matrix, matrix.T)


def _times(source: Random, rng: np.random.Generator, n: int) -> dict[str, Any]:
    last = source.choice((2.0, 6.0, 15.0, 15.0, 80.0))
    kind = source.choice(("one", "each", "several", "both sides"))
    if kind == "one":
        return {"t_end": source.choice((1.0, 1.0, -0.3, 0.0)) * last}
    if kind == "each":
        return {"t_end": rng.uniform(-0.2, 1.0, n) * last}
    times = np.sort(rng.uniform(0.0 if kind == "several" else -0.3, 1.0, source.randint(1, 4)))
    return {"times": last * times[:: source.choice((1, -1))]}

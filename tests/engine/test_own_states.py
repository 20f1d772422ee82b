"""States of the user's own: examples with a closed form or conserved quantity, random ones."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import (
    Scene,
    solve,
)  # fmt: skip
from pyharness.model.attitude import quaternion_rates
from pyharness.model.trajectory import turned_to_space

MOMENTS = (2.0, 3.0, 4.0)


def integral(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque about axis 3 of a controller with an integral term, and its rate."""
    return [0.0, 0.0, -0.8 * omega[2] - 2.0 * states["turned"]], {"turned": omega[2]}


def oscillates(found: Any, tolerance: float) -> Any:
    decay, frequency = 0.1, math.sqrt(0.5 - 0.01)
    turned = np.exp(-decay * found.time) * np.sin(frequency * found.time) / frequency
    yield found.states["turned"] - turned, tolerance * np.abs(turned).max() + 1e-14
    yield found.error, tolerance


def wheel(t: Any, omega: Any, attitude: Any, states: Any) -> Any:
    """Return the torque of a wheel about axis 3 on a body, whose motor damps the body."""
    motor = 0.4 * omega[2] - 0.1 * np.sin(attitude[3])
    about = np.array([0.0, 0.0, states["wheel"]], dtype=object)
    return -np.cross(omega, about) - np.array([0.0, 0.0, motor]), {"wheel": motor}


def keeps_momentum(found: Any, tolerance: float) -> Any:
    momentum = found.omega * np.array(MOMENTS)
    momentum[:, 2] += found.states["wheel"]
    yield np.ptp(turned_to_space(found.attitude, momentum), axis=0), 20.0 * tolerance + 1e-13
    yield 0.5, np.ptp(found.states["wheel"])


def flexible(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of an appendage on a spring about axis 3, of moment 0.5 kg m2."""
    push = 3.0 * states["angle"]
    # The appendage turns relative to the body: 0.5 (rate' + omega3') = -push.
    return [0.0, 0.0, push], {"angle": states["rate"], "rate": -push / 0.5 - push / 4.0}


def vibrates(found: Any, tolerance: float) -> Any:
    angle, rate, spin = found.states["angle"], found.states["rate"], found.omega[:, 2]
    yield angle - 0.1 * np.cos(math.sqrt(3.0 / 0.5 + 3.0 / 4.0) * found.time), 1e-13
    yield np.ptp(2.0 * spin**2 + 0.25 * (spin + rate) ** 2 + 1.5 * angle**2), 1e-14


def pendulum(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of a slosh pendulum in a body that is accelerated along axis 1."""
    pull = 0.3 * np.sin(states["angle"])
    return [0.0, 0.0, pull], {"angle": states["rate"], "rate": -pull / 0.2 - pull / 4.0}


def swings(found: Any, tolerance: float) -> Any:
    angle, rate, spin = found.states["angle"], found.states["rate"], found.omega[:, 2]
    # In the relative motion, the reduced moment is that of both bodies in series.
    yield np.ptp(0.5 / (1.0 / 0.2 + 1.0 / 4.0) * rate**2 - 0.3 * np.cos(angle)), 2e-13
    yield 4.0 * spin + 0.2 * (spin + rate) - 0.06, 1e-13


def lagging(t: Any, omega: Any, states: Any, *, lag: float = 0.25) -> Any:
    """Return the torque of an actuator that follows a step of its command with a lag."""
    return [states["torque"], 0.0, 0.0], [(1.0 - states["torque"]) / lag]


def follows(found: Any, tolerance: float) -> Any:
    reached = 1.0 - np.exp(-found.time / 0.25)
    yield found.states["torque"] - reached, 1e-14
    yield found.omega[:, 0] - 0.5 * (found.time - 0.25 * reached), 1e-14


def held(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of a saturated controller, whose integral waits while it is saturated."""
    wanted = -4.0 * omega[2] - 0.5 * states["integral"]
    torque = np.clip(wanted, -0.5, 0.5)
    return [0.0, 0.0, torque], {"integral": np.where(abs(wanted) < 0.5, omega[2], 0.0)}


def waits(found: Any, tolerance: float) -> Any:
    late = found.time > 7.0  # where omega3, which decreases by 1/8 rad/s2, is 1/8 rad/s
    t = found.time[late] - 7.0
    slow, fast = (-0.5 + sign * math.sqrt(0.125) for sign in (1, -1))
    turned = 0.125 * (np.exp(slow * t) - np.exp(fast * t)) / (slow - fast)
    yield found.states["integral"][found.time < 7.0], 0.0
    yield found.states["integral"][late] - turned, 1e-10


# Torque, omega, states, times, tolerances, and the function of errors and their limits.
EXAMPLES: dict[str, Any] = {
    "integral term": (
        integral, (0.0, 0.0, 1.0), {"turned": 0.0}, (-4.0, 20.0, 60), (1e-4, 1e-8, 1e-12),
        oscillates,
    ),
    "wheel": (
        wheel, (0.3, -0.2, 1.0), {"wheel": 1.5}, (0.0, 30.0, 40), (1e-4, 1e-8, 1e-12),
        keeps_momentum,
    ),
    "flexible appendage": (
        flexible, (0.0, 0.0, 0.2), {"angle": 0.1, "rate": 0.0}, (0.0, 50.0, 80), (1e-12,), vibrates,
    ),
    "slosh pendulum": (
        pendulum, (0.0, 0.0, 0.0), {"angle": 2.0, "rate": 0.3}, (0.0, 60.0, 100), (1e-12,), swings,
    ),
    "actuator with a lag": (
        lagging, (0.0, 0.0, 0.0), {"torque": 0.0}, (0.0, 3.0, 20), (1e-12,), follows,
    ),
    "anti-windup": (held, (0.0, 0.0, 1.0), {"integral": 0.0}, (0.0, 12.0, 60), (1e-10,), waits),
}  # fmt: skip


@pytest.mark.parametrize(("name", "tolerance"), [(k, x) for k in EXAMPLES for x in EXAMPLES[k][4]])
def test_examples_have_their_closed_form_or_conserved_quantity(name: str, tolerance: float) -> None:
    torque, omega, states, times, _, errors = EXAMPLES[name]
    scene = Scene(name, omega, MOMENTS, torque=torque, states=states)
    found = solve(scene, np.linspace(*times), tolerance=tolerance, attitude=torque is wheel)
    assert found.ended == "complete"
    for error, limit in errors(found, tolerance):
        assert np.abs(error).max() <= limit


def test_an_integral_that_waits_may_hold_the_body_at_its_limit() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        wanted = -1.5 * omega[2] - 2.0 * states["integral"]
        held = np.where(abs(wanted) < 0.5, omega[2], 0.0)
        return [0.0, 0.0, np.clip(wanted, -0.5, 0.5)], {"integral": held}

    scene = Scene("slides", (0.0, 0.0, 1.0), MOMENTS, torque=law, states={"integral": 0.0})
    found: Any = solve(scene, 12.0)
    assert found.ended == "sliding"
    assert "t = 5.33333 s" in found.reason


NAMES = ("a", "b", "c", "d", "e", "f", "g", "h")


def random_scene(seed: int) -> tuple[Scene, Any, float, np.ndarray[Any, Any]]:
    """Return a scene, the right-hand side of its unknowns, the last time, and their sizes."""
    draw = np.random.default_rng(seed)
    k, attitude = 1 + seed % 8, seed % 3 > 0
    own, by, of = (draw.normal(size=(k, m)) for m in (k, 3, 3))
    turned, size = draw.normal(size=(3, 4)) * 0.3, 10.0 ** draw.uniform(-5, 5, k)
    own = 0.4 * own - np.eye(k)

    def parts(t: Any, omega: Any, q: Any, states: Any) -> Any:
        u = [states[j] / size[j] for j in range(k)]
        torque = [
            np.tanh(sum(0.3 * of[j, i] * u[j] for j in range(k)) - 0.4 * omega[i])
            + sum(turned[i, m] * q[m] for m in range(len(q)))
            for i in range(3)
        ]
        inner = [sum(own[i, j] * u[j] for j in range(k)) for i in range(k)]
        outer = [sum(by[i, j] * omega[j] for j in range(3)) for i in range(k)]
        drive = [0.3 * np.sin(1.3 * t + u[0])] * k
        return torque, [
            s * (a + b + c) for s, a, b, c in zip(size, inner, outer, drive, strict=True)
        ]

    def plain(t: Any, omega: Any, states: Any) -> Any:
        torque, rates = parts(t, omega, (), [*states.values()])
        return torque, dict(zip(states, rates, strict=True))

    def with_attitude(t: Any, omega: Any, q: Any, states: Any) -> Any:
        return parts(t, omega, q, [*states.values()])

    moments = draw.uniform(1.0, 2.0, 3)
    axes = np.linalg.qr(draw.normal(size=(3, 3)))[0]
    inertia = axes @ np.diag(moments) @ axes.T
    inertia = 0.5 * (inertia + inertia.T)
    start = np.where(draw.random(k) < 0.6, size, 0.0)
    scene = Scene(
        "random", draw.normal(size=3), inertia=inertia.tolist(),
        torque=with_attitude if attitude else plain,
        states=dict(zip(NAMES[:k], start.tolist(), strict=True)),
    )  # fmt: skip

    def slopes(t: float, y: Any) -> Any:
        omega, q, states = np.split(y, [3, 7 if attitude else 3])
        torque, rates = parts(t, omega, q, states)
        push = np.array(torque, dtype=float) - np.cross(omega, inertia @ omega)
        turning = quaternion_rates(omega, q) if attitude else []
        return [*np.linalg.solve(inertia, push), *turning, *rates]

    sizes = np.array([1.0] * (7 if attitude else 3) + size.tolist())
    return scene, slopes, float(draw.uniform(2.0, 6.0)), sizes


@pytest.mark.parametrize("seed", range(8))
def test_random_states_are_within_the_tolerance(seed: int) -> None:
    scene, slopes, end, sizes = random_scene(seed)
    attitude = len(sizes) - len(scene.states) == 7
    times = np.linspace(0.0, end, 6)[1:]
    start = [*scene.omega, *([1.0, 0.0, 0.0, 0.0] if attitude else [])]
    start += [each.start for each in scene.states]
    truth = solve_ivp(
        lambda t, z: np.array(slopes(t, z * sizes)) / sizes, (0.0, end), np.array(start) / sizes,
        "DOP853", times, rtol=1e-12, atol=1e-14,
    ).y.T * sizes  # fmt: skip
    largest = np.abs(np.vstack([truth, start])).max(axis=0)
    largest[:3] = largest[:3].max()
    if attitude:
        largest[3:7] = 0.5
    for tolerance in (1e-4, 1e-9):
        found: Any = solve(scene, times, tolerance=tolerance, attitude=attitude, dense_output=True)
        assert found.ended == "complete"
        growth = found.growth or 1.0
        assert (np.abs(found.y.T - truth) <= largest * (tolerance + 1e-11 * growth)).all()
        assert (np.abs(found.sol(times).T - found.y.T) <= largest * 2.0 * tolerance).all()
        rates = np.array([slopes(t, found.sol(t)) for t in times])
        assert (np.abs(found.sol.derivative(times).T - rates) <= 1e-11 * sizes * 10.0).all()

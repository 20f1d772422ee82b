"""States of the user's own: examples with a closed form or conserved quantity, random ones."""

import cmath
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import (
    ChangingMoments,
    Scene,
    Stepper,
    TorqueLaw,
    events,
    load,
    read_scene,
    solve,
)  # fmt: skip
from pyharness.model.archive import archive_of
from pyharness.model.attitude import quaternion_rates
from pyharness.model.errors import InputError
from pyharness.model.scene_file import scene_text
from pyharness.model.trajectory import turned_to_space
from pyharness.torques import damping, recorded, wheels

MOMENTS = (2.0, 3.0, 4.0)
TOLERANCES = (1e-4, 1e-8, 1e-12)


def integral(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque about axis 3 of a controller with an integral term, and its rate."""
    return [0.0, 0.0, -0.8 * omega[2] - 2.0 * states["turned"]], {"turned": omega[2]}


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_an_integral_term_makes_a_damped_oscillation(tolerance: float) -> None:
    scene = Scene("integral", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states={"turned": 0.0})
    times = np.linspace(-4.0, 20.0, 60)
    found: Any = solve(scene, times, tolerance=tolerance)
    decay, frequency = 0.1, math.sqrt(0.5 - 0.01)
    turned = np.exp(-decay * times) * np.sin(frequency * times) / frequency
    assert np.abs(found.states["turned"] - turned).max() <= tolerance * np.abs(turned).max() + 1e-14
    assert found.error <= tolerance


def wheel(t: Any, omega: Any, attitude: Any, states: Any) -> Any:
    """Return the torque of a wheel about axis 3 on a body, whose motor damps the body."""
    motor = 0.4 * omega[2] - 0.1 * np.sin(attitude[3])
    about = np.array([0.0, 0.0, states["wheel"]], dtype=object)
    return -np.cross(omega, about) - np.array([0.0, 0.0, motor]), {"wheel": motor}


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_a_wheel_under_a_law_keeps_the_angular_momentum(tolerance: float) -> None:
    scene = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
    found: Any = solve(scene, np.linspace(0.0, 30.0, 40), tolerance=tolerance, attitude=True)
    momentum = found.omega * np.array(MOMENTS)
    momentum[:, 2] += found.states["wheel"]
    kept = turned_to_space(found.attitude, momentum)
    assert np.ptp(kept, axis=0).max() <= 20.0 * tolerance + 1e-13
    assert np.ptp(found.states["wheel"]) > 0.5


def flexible(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of an appendage on a spring about axis 3, of moment 0.5 kg m2."""
    push = 3.0 * states["angle"]
    # The appendage turns relative to the body: 0.5 (rate' + omega3') = -push.
    return [0.0, 0.0, push], {"angle": states["rate"], "rate": -push / 0.5 - push / 4.0}


def test_a_flexible_appendage_keeps_energy_and_has_its_frequency() -> None:
    start = {"angle": 0.1, "rate": 0.0}
    scene = Scene("flexible", (0.0, 0.0, 0.2), MOMENTS, torque=flexible, states=start)
    times = np.linspace(0.0, 50.0, 80)
    found = solve(scene, times, tolerance=1e-12)
    angle, rate = found.states["angle"], found.states["rate"]
    frequency = math.sqrt(3.0 / 0.5 + 3.0 / 4.0)
    assert np.abs(angle - 0.1 * np.cos(frequency * times)).max() < 1e-13
    spin = found.omega[:, 2]
    energy = 2.0 * spin**2 + 0.25 * (spin + rate) ** 2 + 1.5 * angle**2
    assert np.ptp(energy) < 1e-14


def pendulum(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of a slosh pendulum in a body that is accelerated along axis 1."""
    pull = 0.3 * np.sin(states["angle"])
    return [0.0, 0.0, pull], {"angle": states["rate"], "rate": -pull / 0.2 - pull / 4.0}


def test_a_slosh_pendulum_keeps_its_energy() -> None:
    start = {"angle": 2.0, "rate": 0.3}
    scene = Scene("slosh", (0.0, 0.0, 0.0), MOMENTS, torque=pendulum, states=start)
    found = solve(scene, np.linspace(0.0, 60.0, 100), tolerance=1e-12)
    angle, rate = found.states["angle"], found.states["rate"]
    # In the relative motion, the reduced moment is that of both bodies in series.
    energy = 0.5 / (1.0 / 0.2 + 1.0 / 4.0) * rate**2 - 0.3 * np.cos(angle)
    assert np.ptp(energy) < 2e-13
    assert np.abs(4.0 * found.omega[:, 2] + 0.2 * (found.omega[:, 2] + rate) - 0.06).max() < 1e-13


def lagging(t: Any, omega: Any, states: Any, *, lag: float = 0.25) -> Any:
    """Return the torque of an actuator that follows a step of its command with a lag."""
    return [states["torque"], 0.0, 0.0], [(1.0 - states["torque"]) / lag]


def test_an_actuator_follows_its_command_with_a_lag() -> None:
    scene = Scene("lag", (0.0, 0.0, 0.0), MOMENTS, torque=lagging, states={"torque": 0.0})
    times = np.linspace(0.0, 3.0, 20)
    found = solve(scene, times, tolerance=1e-12)
    assert np.abs(found.states["torque"] - (1.0 - np.exp(-times / 0.25))).max() < 1e-14
    spin = 0.5 * (times - 0.25 * (1.0 - np.exp(-times / 0.25)))
    assert np.abs(found.omega[:, 0] - spin).max() < 1e-14


def held(t: Any, omega: Any, states: Any) -> Any:
    """Return the torque of a saturated controller, whose integral waits while it is saturated."""
    wanted = -4.0 * omega[2] - 0.5 * states["integral"]
    torque = np.clip(wanted, -0.5, 0.5)
    return [0.0, 0.0, torque], {"integral": np.where(abs(wanted) < 0.5, omega[2], 0.0)}


def test_an_integrator_with_anti_windup_waits() -> None:
    scene = Scene("held", (0.0, 0.0, 1.0), MOMENTS, torque=held, states={"integral": 0.0})
    found = solve(scene, np.linspace(0.0, 12.0, 60), tolerance=1e-10)
    leaves = 7.0  # where omega3, which decreases by 1/8 rad/s2, is 1/8 rad/s
    assert found.ended == "complete"
    assert (found.states["integral"][found.time < leaves] == 0.0).all()
    t = found.time[found.time > leaves] - leaves
    slow, fast = (-0.5 + sign * math.sqrt(0.125) for sign in (1, -1))
    turned = 0.125 * (np.exp(slow * t) - np.exp(fast * t)) / (slow - fast)
    assert np.abs(found.states["integral"][found.time > leaves] - turned).max() < 1e-10


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
        rates = [
            size[i]
            * (
                sum(own[i, j] * u[j] for j in range(k))
                + sum(by[i, j] * omega[j] for j in range(3))
                + 0.3 * np.sin(1.3 * t + u[0])
            )
            for i in range(k)
        ]
        return torque, rates

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


def test_size_of_a_state_does_not_matter() -> None:
    found = []
    for power in (0, 100, -100):
        size = 2.0**power

        def law(t: Any, omega: Any, states: Any, *, size: float = size) -> Any:
            return [0.0, 0.0, -states["x"] / size], {"x": size * (omega[2] - states["x"] / size)}

        scene = Scene("sized", (0.1, 0.2, 1.0), MOMENTS, torque=law, states={"x": 0.0})
        rows = solve(scene, np.linspace(0.0, 9.0, 10), tolerance=1e-9)
        found.append((rows.omega.tolist(), (rows.states["x"] / size).tolist(), rows.steps))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-9, 1e-12])
@pytest.mark.parametrize("start", [0.0, 1.7])
@pytest.mark.parametrize("power", [0, 6])
def test_a_state_that_begins_at_zero_has_a_size(tolerance: float, start: float, power: int) -> None:
    """The first step follows the omega, which is slow, and the guessed size of the state."""

    def law(t: Any, omega: Any, states: Any) -> Any:
        late = t - start
        fast = (
            np.where(t > start, late**power * np.sin(90.0 * late), 0.0)
            if start
            else (t**power * np.sin(90.0 * t))
        )
        return [0.0, 0.0, 1e-9 * states["fast"]], {"fast": fast}

    scene = Scene("fast", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"fast": 0.0})
    found: Any = solve(scene, [5.0], tolerance=tolerance)
    # The integral of s**n exp(90 i s), by parts.
    late, integral = 5.0 - start, 0j
    for k in range(power + 1):
        edge = late**k * cmath.exp(90j * late) - (k == 0)
        integral = (edge - k * integral) / 90j
    wanted = integral.imag
    size = max(late**power / 90.0, abs(wanted))
    assert found.ended in ("complete", "sensitive")
    assert found.states["fast"][0] == pytest.approx(wanted, abs=tolerance * size)
    assert found.error < max(tolerance, 1e-12)


def test_a_guessed_size_does_not_shrink_with_rejected_steps() -> None:
    """The rates after the switch are rounded, the more so the nearer the step is to it."""
    start = 3.873697255942001

    def law(t: Any, omega: Any, states: Any) -> Any:
        late = t - start
        rate = 3.1e7 * np.where(late > 0.0, late**6 * np.sin(212.0 * late), 0.0)
        return [0.0, 0.0, 3e-11 * states["x"]], {"x": rate}

    scene = Scene("", (0.0, 0.0, 0.0126758), MOMENTS, torque=law, states={"x": 0.0})
    for tolerance in (1e-12, 1e-13, 3e-14):
        assert solve(scene, 5.559, tolerance=tolerance).ended in ("complete", "sensitive")


@pytest.mark.parametrize("omega", [0.01, 1.0, 30.0])
def test_the_terms_of_a_state_that_begins_at_zero_cancel(omega: float) -> None:
    """They are up to 1e30 times as large as its values in the first step that is tried."""
    shapes: list[tuple[Any, Any]] = [
        (lambda t: 25.0 * np.sin(25.0 * t), lambda t: 1.0 - np.cos(25.0 * t)),
        (lambda t: 400.0 * np.sin(400.0 * t), lambda t: 1.0 - np.cos(400.0 * t)),
        (lambda t: 31.0 * (1.0 - t) ** 30, lambda t: 1.0 - (1.0 - t) ** 31),
        (lambda t: np.exp(-90.0 * t), lambda t: -np.expm1(-90.0 * t) / 90.0),
    ]
    times = np.array([1.0, 2.0])

    def driven(rate: Any) -> Scene:
        def law(t: Any, omega: Any, states: Any) -> Any:
            return [0.0, 0.0, 0.0], {"x": rate(t)}

        return Scene("", (0.0, 0.0, omega), MOMENTS, torque=law, states={"x": 0.0})

    for rate, value in shapes:
        scene = driven(rate)
        for tolerance in (1e-6, 1e-9, 1e-12):
            found: Any = solve(scene, times, tolerance=tolerance)
            assert found.ended == "complete"
            assert found.states["x"] == pytest.approx(value(times), rel=tolerance)
            assert found.error < 0.1 * max(tolerance, 1e-12)


@pytest.mark.parametrize("power", [25, 26, 27])
def test_a_state_whose_first_terms_vanish_takes_few_steps(power: int) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"late": t**power}

    found = solve(Scene("", (0.1, 0.0, 0.0), MOMENTS, torque=law, states={"late": 0.0}), 1.0)
    assert found.states["late"][0] * (power + 1) == pytest.approx(1.0, abs=1e-9)
    assert found.steps < 40


def test_a_larger_scale_is_a_looser_tolerance() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"fast": np.sin(40.0 * t)}

    steps = [
        solve(Scene("scaled", (0.0, 0.0, 0.1), MOMENTS, torque=law, states={"fast": x}), 9.0).steps
        for x in (0.0, (0.0, 1e6))
    ]
    assert steps[1] < 0.8 * steps[0]


def test_events_and_their_states() -> None:
    def low(t: Any, omega: Any, states: Any) -> Any:
        return states["turned"] - 0.3

    low.terminal = 2  # type: ignore[attr-defined]
    scene = Scene("integral", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states={"turned": 0.0})
    found: Any = solve(scene, [1.0, 20.0], events=[low, events.crosses(3, 0.0)], tolerance=1e-11)
    assert found.ended == "event"
    decay, frequency = 0.1, 0.7
    for time, state in zip(found.t_events[0], found.y_events[0], strict=True):
        turned = math.exp(-decay * time) * math.sin(frequency * time) / frequency
        assert abs(turned - 0.3) < 1e-10
        assert abs(state[3] - 0.3) < 1e-10
    assert len(found.t_events[0]) == 2
    # The largest angle is where omega3 is 0.
    assert math.tan(frequency * found.t_events[1][0]) == pytest.approx(frequency / decay, rel=1e-9)


def test_stepper_agrees_and_states_may_be_set() -> None:
    scene = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
    stepper = Stepper(scene, 1e-12, attitude=True)
    stepper.until(5.0)
    found = solve(scene, 5.0, attitude=True)
    assert stepper.states["wheel"] == pytest.approx(found.states["wheel"][0], rel=1e-12)
    assert stepper.at(5.0) == pytest.approx(found.y[:, 0], rel=1e-11)
    stepper.states = {"wheel": 0.0}
    stepper.until(6.0)
    later = Scene(
        "later", found.omega[0], MOMENTS, attitude=found.attitude[0],  # type: ignore[index]
        torque=wheel, states={"wheel": 0.0},
    )  # fmt: skip
    assert stepper.omega == pytest.approx(solve(later, 1.0, attitude=True).omega[0], rel=1e-11)
    with pytest.raises(InputError, match="an argument states; give the scene's states="):
        Scene("none", (0.0, 0.0, 1.0), MOMENTS, torque=lambda t, omega, states: states["wheel"])
    with pytest.raises(InputError, match="allowed: a dict of wheel"):
        stepper.states = {"wheels": 0.0}
    with pytest.raises(InputError, match="allowed: those of the first scene"):
        stepper.scene = Scene("none", (0.0, 0.0, 1.0), MOMENTS)


def test_stepper_takes_an_inertia_that_changes() -> None:
    moments = ChangingMoments([(2.0, 0.1), (3.0, 0.0, 0.01), (4.0,)])
    scene = Scene("fuel", (0.3, -0.2, 1.0), moments, torque=integral, states={"turned": 0.0})
    stepper = Stepper(scene, 1e-13)
    stepper.until(7.0)
    found = solve(scene, 7.0)
    assert stepper.omega == pytest.approx(found.omega[0], rel=1e-12)
    assert stepper.states["turned"] == pytest.approx(found.states["turned"][0], rel=1e-12)
    stepper.held_torque = (0.0, 0.0, 0.4)
    stepper.until(7.5)

    def pushed(t: Any, omega: Any, states: Any) -> Any:
        torque, rates = integral(t, omega, states)
        return [*torque[:2], torque[2] + np.where(t > 7.0, 0.4, 0.0)], rates

    other = Scene("pushed", (0.3, -0.2, 1.0), moments, torque=pushed, states={"turned": 0.0})
    assert stepper.omega == pytest.approx(solve(other, 7.5).omega[0], rel=1e-11)


def test_results_have_the_states_by_name(tmp_path: Any) -> None:
    scene = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
    found: Any = solve(
        scene, [4.0, 2.0], attitude=True, events=lambda t, omega, states: states["wheel"] - 1.7,
        sensitivities=["omega"],
    )  # fmt: skip
    assert found.to_pandas()["wheel"].tolist() == found.states["wheel"].tolist()
    assert found.to_xarray()["wheel"].sel(time=2.0) == found.states["wheel"][1]
    assert found.y.shape == (8, 2)
    found.save(tmp_path / "wheel.npz")
    read: Any = load(tmp_path / "wheel.npz")
    assert read.states["wheel"].tolist() == found.states["wheel"].tolist()
    assert read.scene == scene
    assert (read.sensitivities["omega"] == found.sensitivities["omega"]).all()
    assert read.y_events[0].tolist() == found.y_events[0].tolist()
    again = solve(read.scene, [4.0, 2.0], attitude=True)
    assert again.own.tolist() == found.own.tolist()  # type: ignore[union-attr]
    assert found.power().shape == (2,)


FILE = """\
[body]
moments = [2.0, 3.0, 4.0]
[initial]
omega = [0.3, -0.2, 1.0]
[torque]
expression = ["-w2*wheel", "w1*wheel", "-k*w3 + 0.1*sin(t)"]
constants = { k = 0.4 }
[[torque.terms]]
kind = "damping"
matrix = [[0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.05]]
[states.wheel]
start = 1.5
scale = 2.0
rate = "k*w3 - 0.1*sin(t)"
"""


def test_a_scene_file_has_states(tmp_path: Any) -> None:
    (tmp_path / "wheel.toml").write_text(FILE)
    scene = read_scene(tmp_path / "wheel.toml")

    def law(t: Any, omega: Any, states: Any) -> Any:
        motor = 0.4 * omega[2] - 0.1 * np.sin(t)
        h = states["wheel"]
        return [-omega[1] * h, omega[0] * h, -motor], {"wheel": motor}

    torque = damping(0.05) + recorded(law, ["wheel"])
    other = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=torque, states={"wheel": (1.5, 2.0)})
    found, expected = (solve(each, [1.0, 6.0]) for each in (scene, other))
    assert found.y == pytest.approx(expected.y, rel=1e-12)
    written = scene_text(scene)
    (tmp_path / "again.toml").write_text(written)
    assert read_scene(tmp_path / "again.toml") == scene
    found.save(tmp_path / "wheel.npz")
    assert load(tmp_path / "wheel.npz").scene == scene


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rate =", "rates =", r"\[states.wheel\]: unknown key"),
        ('rate = "k*w3 - 0.1*sin(t)"', "", r"\[states.wheel\]: rate is missing"),
        ("[states.wheel]", "[states.w1]", "another meaning"),
        ("[states.wheel]", "[states.k]", "another meaning"),
        ("expression = [", "constant = [1.0]  # [", "expression is missing, which a scene with"),
        ('rate = "k', 'rate = "u', "'u'"),
        ("scale = 2.0", "scale = -2.0", "from 0 on"),
    ],
)
def test_a_mistake_in_a_scene_file_is_told(tmp_path: Any, old: str, new: str, words: str) -> None:
    assert old in FILE
    (tmp_path / "wrong.toml").write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=words) as raised:
        read_scene(tmp_path / "wrong.toml")
    assert "\n" not in str(raised.value)


def test_states_that_no_series_ends_are_told_with_their_time() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": states["x"] ** 2}

    scene = Scene("pole", (0.0, 0.0, 1.0), MOMENTS, torque=law, states={"x": 0.5})
    found = solve(scene, [1.0, 3.0])
    assert found.ended == "overflow"
    assert found.states["x"] == pytest.approx([1.0], rel=1e-12)


@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("unstable", range(8))
def test_growth_is_that_of_any_state(unstable: int, attitude: bool) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [-0.1 * x + 0.1 * omega[0] for x in states.values()]
        rates[unstable] = 0.5 * states[NAMES[unstable]]
        return [-0.1 * omega[0], 0.0, 0.0], rates

    scene = Scene("grows", (0.5, 0.0, 0.0), MOMENTS, torque=law, states=dict.fromkeys(NAMES, 1.0))
    found: Any = solve(scene, 10.0, tolerance=1e-9, attitude=attitude)
    assert math.exp(5.0) * 0.9 < found.growth < math.exp(5.0) * 20.0
    assert found.states[NAMES[unstable]][0] == pytest.approx(math.exp(5.0), rel=1e-9)


def test_rounding_that_grows_is_told() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": states["y"], "y": states["x"] - omega[2] * states["y"] * 0.0}

    # A saddle: the start is on the stable direction, and any error grows as exp(t).
    start = {"x": (1.0, 1.0), "y": (-1.0, 1.0)}
    scene = Scene("saddle", (0.0, 0.0, 0.1), MOMENTS, torque=law, states=start)
    found: Any = solve(scene, 32.0, tolerance=1e-9)
    assert found.ended == "sensitive"
    assert abs(found.states["x"][0] - math.exp(-32.0)) <= 100.0 * found.error


@pytest.mark.parametrize("attitude", [False, True])
def test_perturbations_of_states_that_rest_may_be_fast(attitude: bool) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [0.0 * x for x in states.values()]
        rates[6:] = [90.0 * states["h"], -90.0 * states["g"]]
        return [0.0, 0.0, -0.1 * omega[2]], rates

    states = dict.fromkeys(NAMES, (0.0, 1.0))
    scene = Scene("rests", (0.0, 0.0, 0.5), MOMENTS, torque=law, states=states)
    found: Any = solve(scene, 10.0, tolerance=1e-9, attitude=attitude)
    assert found.growth < 20.0
    assert found.ended == "complete"


def test_growth_counts_what_a_state_does_to_the_time_of_a_switch() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [0.0 * x for x in states.values()]
        # An error of h by d changes the time of the switch by d, and g by 10 d.
        rates[6:] = [np.where(states["h"] > 1.0, 5.0, -5.0), 1.0]
        return [0.0, 0.0, 0.0], rates

    scene = Scene("late", (0.0, 0.0, 0.5), MOMENTS, torque=law, states=dict.fromkeys(NAMES, 0.0))
    found = solve(scene, 2.0, tolerance=1e-9)
    assert found.growth == pytest.approx(math.hypot(1.0, 10.0 * 2.0 / 5.0), rel=0.01)
    assert found.states["g"] == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize("start", [0.0, 2.0])
def test_steps_are_as_short_as_a_fast_state_needs(start: float) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": 40.0 * np.cos(40.0 * t)}

    scene = Scene("fast", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"x": start})
    for tolerance in (1e-4, 1e-10):
        stepper = Stepper(scene, tolerance)
        while stepper.time < 3.0:
            stepper.step(3.0 - stepper.time)
            exact = start + math.sin(40.0 * stepper.time)
            allowed = 3.0 * tolerance * stepper.steps + 1e-13
            assert abs(stepper.states["x"] - exact) <= allowed
        assert stepper.steps < 150


@pytest.mark.parametrize("size", [1.0, 2.0**-300, 2.0**200])
def test_events_of_a_state_of_any_size(size: float) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, -2.0 * states["x"] / size], {"x": size * omega[2]}

    scene = Scene("sized", (0.0, 0.0, 1.0), MOMENTS, torque=law, states={"x": 0.0})
    found: Any = solve(scene, 10.0, events=lambda t, omega, states: states["x"] - 0.5 * size)
    frequency = math.sqrt(0.5)
    first = math.asin(0.5 * frequency) / frequency
    second = math.pi / frequency - first
    period = 2.0 * math.pi / frequency
    assert found.t_events[0] == pytest.approx([first, second, first + period], rel=1e-12)


def test_ready_events_see_omega_and_attitude_alone() -> None:
    scene = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
    ready = [events.tilt(1, (1, 0, 0), 1.0), events.extremum(2)]
    found: Any = solve(scene, 6.0, attitude=True, events=ready, dense_output=True)
    assert len(found.t_events[0]) > 0
    assert len(found.t_events[1]) > 0
    for state in found.y_events[0]:
        axis = turned_to_space(state[None, 3:7], np.array([[1.0, 0.0, 0.0]]))[0]
        assert math.acos(axis[0]) == pytest.approx(1.0, abs=1e-10)
    for time in found.t_events[1]:
        assert abs(found.sol.derivative(time)[1]) < 1e-11


def test_rows_at_time_0_have_the_start() -> None:
    scene = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
    assert solve(scene, 0.0, attitude=True).states["wheel"].tolist() == [1.5]
    found = solve(scene, [-1.0, 0.0, 1.0], attitude=True)
    assert found.states["wheel"][1] == 1.5


def test_a_constant_torque_keeps_the_states() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.2, 0.0, 0.0], {"x": 1.0}

    scene = Scene("constant", (0.0, 0.0, 0.0), MOMENTS, torque=law, states={"x": 0.0})
    found = solve(scene, 3.0)
    assert found.states["x"] == pytest.approx([3.0])
    assert found.omega[0] == pytest.approx([0.3, 0.0, 0.0])


@pytest.mark.parametrize(
    ("rates", "start", "spin", "end"),
    [
        (lambda x, w: 0.0, 1e-9, 1.0, 500.0),
        (lambda x, w: 0.3, 0.0, 1000.0, 1.5),
        (lambda x, w: w[0], 0.0, 0.1, 500.0),
        (lambda x, w: w[0] - x, 0.0, 5.0, 50.0),
        (lambda x, w: -x, 1e-100, 1.0, 10.0),
    ],
)
def test_growth_is_not_that_of_the_size_of_a_state(
    rates: Any, start: float, spin: float, end: float
) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [-0.1 * omega[0], -0.1 * omega[1], 0.0], {"x": rates(states["x"], omega)}

    scene = Scene("steady", (0.0, 0.0, spin), MOMENTS, torque=law, states={"x": start})
    for tolerance in (1e-6, 1e-9, 1e-12):
        found: Any = solve(scene, end, tolerance=tolerance)
        assert found.ended == "complete"
        assert found.growth < 20.0
        assert found.error < tolerance


def test_another_torque_brings_its_own_states() -> None:
    first, second = (wheels((0.0, 0.0, h), motor=lambda t, omega, h: -omega) for h in (1.0, 2.0))
    scene = Scene("wheel", (0.0, 0.1, 1.0), MOMENTS, torque=first)
    assert replace(scene, omega=(0.0, 0.0, 1.0)).states == scene.states
    assert replace(scene, torque=second).states == replace(scene, torque=second, states=()).states
    assert replace(scene, torque=second).states != scene.states
    given = tuple(each._replace(start=3.0) for each in scene.states)
    assert {each.start for each in replace(scene, torque=second, states=given).states} == {3.0}
    assert replace(scene, torque=TorqueLaw()).states == ()


def test_states_of_other_scenes_are_checked_too() -> None:
    scene = Scene("spring", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states={"turned": 0.0})
    with pytest.raises(InputError, match="given twice"):
        Scene("two", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states=scene.states * 2)
    many = tuple(scene.states[0]._replace(name=f"x{k}") for k in range(10))
    with pytest.raises(InputError, match="10 are given"):
        Scene("many", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states=many)


def test_the_first_step_from_0_is_as_short_as_a_very_fast_state_needs() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": 4e6 * np.cos(4e6 * t)}

    stepper = Stepper(
        Scene("fast", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"x": 0.0}), 1e-12
    )
    stepper.step()
    assert abs(stepper.states["x"] - math.sin(4e6 * stepper.time)) < 1e-11


def test_the_size_of_a_state_is_the_largest_so_far() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": -2.0 * states["x"]}

    stepper = Stepper(
        Scene("decay", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"x": 1.0}), 1e-6
    )
    lengths = []
    while stepper.time < 20.0:
        before = stepper.time
        stepper.step()
        lengths.append(stepper.time - before)
    assert lengths[-1] > 1.5 * lengths[0]


def test_terms_that_cancel_shorten_the_step() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": 21.0 * (1.0 - t) ** 20}

    scene = Scene("cancels", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"x": 0.0})
    found = solve(scene, [1.0, 2.0], tolerance=1e-13)
    assert found.states["x"] == pytest.approx([1.0, 2.0], rel=4e-13)


def test_terms_that_cancel_and_are_rounded_shorten_the_step() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": 21.0 * (1.1 - t) ** 20}

    scene = Scene("cancels", (0.0, 0.0, 0.01), MOMENTS, torque=law, states={"x": 1.0})
    found = solve(scene, [1.1, 2.2], tolerance=1e-13)
    wanted = [1.0 + 1.1**21, 1.0 + 2.0 * 1.1**21]
    assert found.states["x"] == pytest.approx(wanted, rel=4e-13)


def test_a_file_without_its_states_is_refused(tmp_path: Any) -> None:
    scene = Scene("spring", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states={"turned": 0.0})
    solve(scene, [1.0, 2.0]).save(tmp_path / "whole.npz")
    with np.load(tmp_path / "whole.npz") as archive:
        arrays = {name: archive[name] for name in archive if name not in ("own", "sha256")}
    (tmp_path / "part.npz").write_bytes(archive_of(arrays))
    with pytest.raises(InputError, match="missing or damaged"):
        load(tmp_path / "part.npz")


def test_wheels_under_a_law_keep_the_total_momentum() -> None:
    def motor(t: Any, omega: Any, attitude: Any, h: Any) -> Any:
        return 0.5 * omega + 0.3 * attitude[1:] - 0.01 * h

    moments = (4.0, 3.0, 2.0)
    scene = Scene(
        omega=(0.1, 0.2, -0.1), moments=moments, attitude=(1, 0.2, 0.1, 0),
        torque=wheels((0.0, 0.0, 0.5), motor),
    )  # fmt: skip
    assert [(each.name, each.start) for each in scene.states] == [
        ("wheel1", 0.0), ("wheel2", 0.0), ("wheel3", 0.5),
    ]  # fmt: skip
    found: Any = solve(scene, [0.0, 5.0, 60.0], tolerance=1e-12)
    h = np.stack([found.states[f"wheel{axis}"] for axis in (1, 2, 3)], axis=1)
    total = found.rotation().apply(found.omega * moments + h)
    assert np.ptp(total, axis=0).max() < 3e-13
    assert np.abs(found.omega[-1]).max() < 0.01
    # A constant law is that of a constant torque of the motors.
    constant = [
        solve(Scene(omega=(0.1, 0.2, -0.1), moments=moments, torque=each), 9.0).omega[0]
        for each in (
            wheels((0, 0, 0.5), lambda t, omega, h: (0.0, 0.0, 0.1)) + damping(0.1),
            wheels((0, 0, 0.5), (0.0, 0.0, 0.1)) + damping(0.1),
        )
    ]
    assert constant[0] == pytest.approx(constant[1], abs=1e-12)
    own = Scene(
        omega=(0.1, 0.2, -0.1), moments=moments, attitude=(1, 0, 0, 0),
        torque=wheels((0, 0, 0.5), motor),
        states={"wheel1": 0.2, "wheel2": 0.0, "wheel3": (0.0, 1.0)},
    )  # fmt: skip
    assert own.states[0].start == 0.2
    with pytest.raises(InputError, match="wheels motor: the function has 2 arguments"):
        wheels((0, 0, 1), lambda t, omega: omega)

"""Enclosures: three provers agree, and balls contain the reference."""

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import (
    ChangingInertia,
    ChangingMoments,
    Scene,
    TorqueLaw,
    case_scene,
    principal,
    torques,
)
from pyharness.checks.scenes import state_scenes
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.checks.scenes.state_scenes import READY, STEADY, TURNING
from pyharness.model.errors import InputError
from pyharness.model.state_torque import of_law
from pyharness.torques import table
from pyharness.truth import enclosure
from pyharness.truth.certificate import prove
from pyharness.truth.enclosed import Balls
from pyharness.truth.enclosure import can_enclose, enclose
from pyharness.truth.reference import Reference, reference
from tests.refused import refused
from tests.truth.test_certificate import away

flint: Any = pytest.importorskip("flint")
enclosure_steps: Any = pytest.importorskip("pyharness.truth.enclosure_steps")
enclose_steps = enclosure_steps.enclose_steps

OMEGA = (0.3, -1.0, 0.7)
MOMENTS = (4.0, 3.0, 2.0)
TURN = (0.5, -0.1, 0.7, 0.3)
INERTIA = [[3.0, 0.1, 0.2], [0.1, 4.0, 0.3], [0.2, 0.3, 5.0]]
LAW = TorqueLaw((0.1, 0.0, 0.3), (0.0, 0.2, 0.0), sines=[((1.0, 0.5, 0.0), 3.0)])
BODY = Scene("", OMEGA, moments=MOMENTS)


def _functions(t: Any, w: Any) -> Any:
    damping = np.tanh(w) / (2.0 + np.cos(w[0] + t))
    return np.sqrt(1.0 + w @ w) * np.exp(-t) * np.array([1.0, 0.0, 0.5]) - damping


SCENES = {
    "law and attitude": replace(BODY, torque=LAW, attitude=TURN),
    "in space": replace(BODY, torque=replace(LAW, frame="space"), attitude=TURN),
    "full inertia": Scene("", OMEGA, inertia=INERTIA, torque=LAW),
    # The quotients of its constant elements are no binary64 numbers.
    "changing inertia": Scene(
        "", OMEGA, inertia=ChangingInertia([INERTIA, np.diag([0.0, 0.0, 0.5]).tolist()])
    ),
    "changing moments": Scene(
        "", OMEGA, changing=ChangingMoments([[4.0, 0.3, 0.1], [3.0], [2.0, -0.1]]), torque=LAW
    ),
    "functions": Scene("", OMEGA, moments=MOMENTS, torque=_functions),
    "coefficients": Scene("", OMEGA, coefficients=(0.5, -0.25, 0.125), torque=LAW),
}


def separation(first: Balls, second: Balls) -> Fraction:
    """Return the largest distance of the middles over the sum of radii; balls overlap up to 1."""
    pairs = zip(first.middle, second.middle, strict=True)
    return max(abs(x - y) for x, y in pairs) / (first.radius + second.radius)


def exact_solution(scene: Scene, times: Sequence[float], velocity: bool = False) -> Reference:
    """Return the precise reference of a scene, also for a full inertia and a torque in space.

    A change of the inertia by 1e-40 kg m2/s is far below the error of the reference.
    """
    if isinstance(scene.torque, TorqueLaw) and scene.torque.in_space:
        scene = replace(scene, torque=of_law(scene.torque))
    if scene.inertia is not None:
        matrices = [[list(row) for row in scene.inertia], np.diag([1e-40] * 3).tolist()]
        scene = replace(scene, inertia=None, changing=ChangingInertia(matrices))
    return reference(scene, times, velocity=velocity, precise=True)


def outside(found: Sequence[Balls], scene: Scene, times: Sequence[float]) -> float:
    """Return how far the precise reference is outside the balls, enlarged by its estimate."""
    return away(tuple(found), exact_solution(scene, times))


@pytest.mark.parametrize("end", [1.0, -0.7])
@pytest.mark.parametrize("case", [2, 3, 4])
def test_three_provers_agree_without_torque(case: int, end: float) -> None:
    scene = replace(case_scene(case), omega=(0.1, 1.0, 3.0))
    times = [end / 3, end]
    closed = enclose(scene, times, 30)
    integers = prove(scene, times, 30).enclosure
    steps = enclose_steps(scene, times, 30)
    assert len({closed.how, integers.how, steps.how}) == 3
    for first, second in ((closed, integers), (integers, steps), (steps, closed)):
        for balls, other in zip(first.omega, second.omega, strict=True):
            assert separation(balls, other) <= 1


@pytest.mark.parametrize("kind", ["near-symmetric", "violent torque", "many speeds", "driven"])
def test_two_provers_agree_on_random_laws(kind: str) -> None:
    for seed in range(2):
        scene = random_scene(kind, seed)
        end = (1.0, -1.0)[seed] * 0.1 * scene.step_size * scene.steps
        integers = prove(scene, [end], 20).enclosure
        assert separation(integers.omega[0], enclose_steps(scene, [end], 25).omega[0]) <= 1


@pytest.mark.parametrize("end", [0.8, -0.8])
def test_waves_of_one_frequency_have_an_exact_sum(end: float) -> None:
    """One tape of the law would have the rounded sum of 0.1 and 0.2 as an amplitude."""
    waves = [((0.1, 0.2, 0.3), 1.0), ((0.2, 0.1, 0.7), 1.0), ((0.2, 0.1, 0.7), -1.0)]
    scene = replace(BODY, torque=TorqueLaw(sines=waves, cosines=waves))
    found = enclose_steps(scene, [end], 40).omega[0]
    assert separation(prove(scene, [end], 40).enclosure.omega[0], found) <= 1


def test_full_inertia_agrees_with_principal_moments() -> None:
    scene = principal(Scene("", OMEGA, inertia=INERTIA))[0]
    integers = prove(scene, [1.0], 40).enclosure
    for other in (enclose_steps(scene, [1.0], 40), enclose(scene, [1.0], 40)):
        assert separation(integers.omega[0], other.omega[0]) <= 1
    moments = scene.exact_moments or ()
    energy: Any = enclose(scene, [1.0], 40).energy
    begin = sum(i * Fraction(x) ** 2 / 2 for i, x in zip(moments, scene.omega, strict=True))
    assert abs(energy[0].middle[0] - begin) <= energy[0].radius


@pytest.mark.parametrize("name", SCENES)
def test_balls_contain_the_reference(name: str) -> None:
    end = 0.6 if len(name) % 2 else -0.6
    times = [end / 2, end]
    found = enclose(SCENES[name], times, 28)
    assert max(each.radius for each in found.omega) <= Fraction(1, 10**28)
    assert outside(found.omega, SCENES[name], times) <= 0.0


@pytest.mark.parametrize(("draw", "names"), [
    *((state_scenes.draw, (name,)) for name in (*STEADY, *TURNING, "flash")),
    *((state_scenes.draw_ready, (name, "damping")) for name in READY),
])  # fmt: skip
def test_balls_contain_the_reference_of_a_state_torque(draw: Any, names: tuple[str, ...]) -> None:
    scene, end = draw(Random(f"enclosure {names[0]}"), names)
    times = [math.copysign(min(abs(end), 0.3 / max(map(abs, scene.omega))), end)]
    assert outside(enclose(scene, times, 24).omega, scene, times) <= 0.0


@pytest.mark.sampled
@pytest.mark.parametrize(("kind", "side"), [("held", 1.0), ("linear", -1.0), ("cubic", 1.0)])
def test_breakpoints_of_a_table(kind: str, side: float) -> None:
    """Steps end at breakpoints, some of which are requested times."""
    torque = table([-0.9, -0.5, -0.1, 0.0, 0.2, 0.5, 0.9], np.eye(7)[:, :3] * 3.0 + 0.1, kind)
    scene = replace(BODY, torque=torque)
    times = [side * 0.1, side * 0.5, side * 0.6]
    found = enclose(scene, times, 15)
    assert outside(found.omega, scene, times) <= 0.0
    assert found.steps >= len(times)


def test_attitude_agrees_with_the_closed_form() -> None:
    for end in (1.1, -2.0):
        scene = replace(BODY, attitude=TURN)
        closed, steps = enclose(scene, [end], 30), enclose_steps(scene, [end], 30)
        assert closed.steps == 0 < steps.steps
        assert closed.attitude is not None
        assert separation(closed.attitude[0], steps.attitude[0]) <= 1
        assert sum(x * x for x in steps.attitude[0].middle) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["in space", "law and attitude", "functions", "full inertia"])
def test_attitude_and_velocity_agree_with_the_reference(name: str) -> None:
    scene = replace(SCENES[name], attitude=TURN, masses=(2.0, 1.0, 1.0), forces=(1.0, -2.0, 0.5))
    found: Any = enclose(scene, [0.3], 15, velocity=True)
    numbers: Any = exact_solution(scene, [0.3], velocity=True)
    for balls, values in ((found.attitude, numbers.attitude), (found.velocity, numbers.velocity)):
        assert np.allclose([float(x) for x in balls[0].middle], values[-1], atol=1e-14, rtol=0.0)


@pytest.mark.parametrize("name", [*SCENES, "table"])
def test_transition_matrix_is_a_limit_of_difference_quotients(name: str) -> None:
    """Its balls contain central difference quotients up to their error of order two."""
    torque = table([0.0, 0.2, 0.9], [[0.1, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3]])
    damped = torque + (lambda t, w: -0.3 * w)
    scene = replace(BODY, torque=damped) if name == "table" else SCENES[name]
    found: Any = enclose(scene, [0.25], 12, transition=True)
    matrix = [found.transition[0].middle[k : k + 3] for k in (0, 3, 6)]
    for direction in ((1.0, -0.75, 0.5), (0.5, 1.0, -0.75), (-0.75, 0.5, 1.0)):
        moved: Any = [np.add(scene.omega, np.array(direction) * h) for h in (1e-6, -1e-6)]
        starts = [replace(scene, omega=omega) for omega in moved]
        ends = [enclose_steps(each, [0.25], 18).omega[0].middle for each in starts]
        begin = [Fraction(x) - Fraction(y) for x, y in zip(*(s.omega for s in starts), strict=True)]
        for row, x, y in zip(matrix, *ends, strict=True):
            wanted = sum(each * move for each, move in zip(row, begin, strict=True))
            assert abs(x - y - wanted) <= 2e-16
    assert found.transition[0].radius < 1e-9
    assert len(found.transition[0].middle) == (9 if scene.attitude is None else 21)


def test_energy_of_a_torque_free_body_is_constant() -> None:
    begin = sum(Fraction(i) * Fraction(x) ** 2 / 2 for i, x in zip(MOMENTS, OMEGA, strict=True))
    for found in (enclose(BODY, [0.0, 3.0], 30), enclose(BODY, [0.0, 3.0], 3)):
        assert found.energy is not None
        for balls in found.energy:
            assert abs(balls.middle[0] - begin) <= balls.radius
    assert enclose(SCENES["coefficients"], [1.0], 5).energy is None


def test_energy_beyond_binary64_is_left_out() -> None:
    found = enclose(Scene(moments=(3.0, 2.0, 1.0), omega=(1e200, 1.0, 1.0)), [1.0], 25)
    assert found.energy is None
    assert len(found.rows()) == 1


@pytest.mark.parametrize("digits", [1, 3, 40])
def test_requested_digits_are_reached(digits: int) -> None:
    for scene in (case_scene(3), case_scene(5), SCENES["functions"]):
        found = enclose(scene, [0.2], digits)
        largest = max(Fraction(1), *map(abs, found.omega[0].middle))
        assert found.omega[0].radius <= largest / 10**digits
        assert separation(found.omega[0], enclose(scene, [0.2], digits + 5).omega[0]) <= 1


@pytest.mark.parametrize("digits", [1, 2, 5])
def test_first_balls_contain_omega(digits: int) -> None:
    """With one digit, the precision is less than that of a binary64 number."""
    scene = Scene("", (1.0 / 3.0, 0.7, 1e-9), inertia=INERTIA)
    found = enclose(scene, [0.0], digits).omega[0]
    for x, exact in zip(found.middle, scene.omega, strict=True):
        assert abs(x - Fraction(exact)) <= found.radius


def test_an_attempt_ends_when_the_radius_exceeds_omega() -> None:
    scene = Scene(coefficients=(-1.0, 2.8, 1.8), omega=(-2.0, -2.3, 1.9))
    assert enclose_steps(scene, [7.0], 1, effort=0.12).omega[0].radius < 0.1


def test_an_omega_that_is_large_or_0_needs_one_attempt() -> None:
    fast = Scene("", (1e20, 2e20, 1e20), moments=(1.0, 2.0, 3.0))
    assert 1.0 < enclose_steps(fast, [1e-20], 8).omega[0].radius < 1e12
    braked = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=TorqueLaw((-1.0, 0.0, 0.0)))
    first, second = enclose_steps(braked, [1.0, 2.0], 8).omega
    assert (first.middle[0], second.middle[0]) == (0, -1)


def test_solution_is_enclosed_until_shortly_before_it_is_infinite() -> None:
    """With coefficients and components of 1, each component is 1/(1 - t)."""
    blown = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    balls = enclose(blown, [0.96875], 10).omega[0]
    assert all(abs(x - 32) <= balls.radius for x in balls.middle)


def test_certificates_need_no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(enclosure, "find_spec", lambda name: None)
    assert can_enclose(case_scene(5))
    for case in (3, 5):
        assert "integer" in enclose(case_scene(case), [0.1], 10).how
    for name in ("functions", "in space", "full inertia"):
        assert not can_enclose(SCENES[name])
        refused("python-flint", enclose, SCENES[name], [0.1], 10)
    refused("python-flint", enclose, case_scene(5), [0.1], 10, transition=True)


def test_progress_is_reported() -> None:
    seen: list[int] = []
    for scene in (SCENES["functions"], SCENES["coefficients"]):
        seen.clear()
        enclose(scene, [2.0], 10, progress=lambda done, total, text: seen.append(done))
        assert set(seen) <= set(range(101))
        assert seen[-1] == 100


def _proof(scene: Scene, digits: int = 20) -> Any:
    return enclosure_steps._Proof(enclosure_steps.Equations(scene, False, False), digits, True)


def test_rest_of_a_series_is_bounded() -> None:
    """The torque 1/(2 - t) has the Taylor coefficients 2**-(k+1)."""
    scene = Scene("pole", (0, 0, 0), (1, 1, 1), torque=lambda t, w: (1 / (2 - t), 0, 0))
    count, h = 10, Fraction(1, 4)
    proof = _proof(scene)
    rates = proof.equations.at(Fraction(0), True)
    bounds = proof._rests(rates, [[enclosure_steps.ball(Fraction(0))]] * 3, h, count)
    true = float(sum(h**k * Fraction(1, 2 ** (k + 1)) for k in range(count, 60)))
    assert true < float(bounds[0]) < 1e6 * true


def test_errors_of_the_attitude_reach_omega() -> None:
    """The matrix of the growth has bounds of the derivatives of one block by another."""
    scene = Scene(
        "", (1, 2, 3), (2, 2, 2), torque=lambda t, w, q: (10 * q[1], 0, 0), attitude=(1, 0, 0, 0)
    )
    proof = _proof(scene)
    rates = proof.equations.at(Fraction(0), True)
    ball = enclosure_steps.ball
    inputs = [ball(x) for x in proof.equations.start]
    matrix = proof._growth(rates, ball(Fraction(0)), inputs).tolist()
    assert float(matrix[0][1]) >= 5.0 / proof.equations.scales[0] * (1 - 1e-9)
    assert 0.5 <= float(matrix[1][0]) / proof.equations.scales[0] < 1.0
    assert 0.0 <= float(matrix[1][1]) < 1e-9  # a rotation


def test_the_settings_of_the_library_are_kept() -> None:
    """A proof changes the precision and the length of series, which are global in python-flint."""
    before = flint.ctx.prec, flint.ctx.cap
    scene = random_scene("plain", 1)
    enclose_steps(scene, [0.01], 10)
    refused("", enclose_steps, scene, [1.0], 10, effort=1e-6)
    assert (flint.ctx.prec, flint.ctx.cap) == before


def test_work_limit_holds_for_all_attempts_and_orders() -> None:
    """Regression test: later attempts, with a higher order, had the steps of the first."""
    scene = Scene(omega=(1.0, 2.0, 3.0), moments=(4.0, 3.0, 2.0), torque=torques.drag([-0.1]))
    counts = []
    for digits in (25, 100):
        with pytest.raises(InputError, match=r"steps; .*effort") as caught:
            enclose_steps(scene, [100.0], digits, effort=0.01)
        counts.append(int(str(caught.value).split()[3]))
    assert counts[0] > 10 * counts[1] > 0


def test_operations_and_derivatives_count_as_work() -> None:
    scene = Scene(omega=(1.0, 2.0, 3.0), moments=(4.0, 3.0, 2.0))
    dragged = replace(scene, torque=torques.drag([0.1, 0.1]))
    counts = []
    for body, transition in ((scene, False), (dragged, False), (scene, True)):
        with pytest.raises(InputError, match=r"steps; .*effort") as caught:
            enclose_steps(body, [1e3], 20, transition=transition, effort=0.02)
        counts.append(int(str(caught.value).split()[3]))
    assert counts[1] < 0.8 * counts[0]
    assert counts[2] < 0.2 * counts[0]

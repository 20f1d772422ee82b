"""Tests of recorded torques in rescaled time, for omegas whose products are beyond binary64."""

import math
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import ChangingMoments, Scene, TorqueLaw, opaque, prepare, solve, solve_many, torques
from pyharness.engine.problem.rescaled import rescaling_factor, scaled_tape
from pyharness.engine.torques import term_file
from pyharness.model.codes import Statuses
from pyharness.model.constant_body import with_constant_body
from pyharness.model.expressions import parsed
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import FLOATS, Tape, evaluate
from pyharness.truth.reference import reference

OMEGA = np.array([0.3, 1.0, 0.2])
MOMENTS = (3.0, 2.0, 1.5)
EVERY = [
    "exp(-t)*w1/(2 + cos(w2)) + sqrt(w1**2 + w3**2)*w2",
    "sin(2*t)*w3**3 - sqrt(sqrt(w1**2 + 1) + q0**2)",
    "tanh(w1*w2)/(t**2 + 3) + sin(t + w1)*q1 + cos(t) + 0.5",
]


def tape_of(torque: Any) -> Tape:
    assert isinstance(torque, StateTorque)
    assert torque.tape is not None
    return torque.tape


def tapes() -> dict[str, Tape]:
    """Return recorded torques with every operation of a tape."""
    found = {"expressions": tape_of(parsed(EVERY, {}))}
    waves = TorqueLaw((0.1, 0.2, 0.3), sines=[((0.3, 0.1, 0.2), 0.7)], frame="space")
    ready = {name: each.function(**each.sample) for name, each in term_file.KINDS.items()}
    ready["drag by axes"] = torques.drag([0.1, (0.2, 0.3, 0.1)], per_axis=True)
    ready["coils"] = torques.magnetic_damping(0.3, waves)
    ready["sum"] = torques.in_space(waves) + torques.pulses([1.0], [0.5], (0.1, 0.2, 0.3))
    found |= {name: tape_of(torque) for name, torque in ready.items()}
    moments = ChangingMoments([[3.0, 0.1, -0.01], [2.0], [1.5, 0.0, 0.0, 0.001]])
    changing = Scene("changing", OMEGA, moments=moments, torque=torques.damping(0.2))
    found["changing"] = tape_of(with_constant_body(changing).torque)
    table = torques.table(
        [0.0, 1.0, 2.0, 3.5], [[0, 1, 2], [2, 1, 0], [3, 0, 1], [1, 1, 1]], "cubic"
    )
    found["table"] = tape_of(table + torques.wheels((0.1, 0.2, 0.3)))
    return found


@pytest.mark.parametrize(("name", "tape"), tapes().items(), ids=tapes())
@pytest.mark.parametrize("exponent", [-96, -16, 16, 96])
def test_outputs_are_the_scaled_ones_bit_for_bit(name: str, tape: Tape, exponent: int) -> None:
    found = scaled_tape(tape, exponent)
    assert found is not None, name
    source = Random(f"{name} {exponent}")
    factor = 2.0**exponent
    for _ in range(10):
        time, *omega = (source.uniform(0.1, 3.0) for _ in range(4))
        attitude = [source.gauss(0.0, 1.0) for _ in range(4)]
        expected = evaluate(tape, [time, *omega, *attitude], FLOATS)
        inputs = [time / factor, *(factor * w for w in omega), *attitude]
        assert evaluate(found, inputs, FLOATS) == [x * factor * factor for x in expected]


def test_tape_beyond_the_range_of_binary64_is_not_scaled() -> None:
    tape = tape_of(torques.table([0.0, 1.0], [[0, 1, 2], [2, 1, 0]]))
    assert scaled_tape(tape, 496) is not None
    assert scaled_tape(tape, 512) is None
    assert scaled_tape(tape, -560) is None
    odd = tape_of(torques.recorded(lambda t, w: [np.sqrt(w[0]) * w[1], w[2], w[0]]))
    assert scaled_tape(odd, 15) is None
    assert scaled_tape(odd, 16) is not None


def of_size(kind: str, size: float) -> Any:
    """Return a torque for omega(0) = size * OMEGA; all solutions agree in rescaled time."""
    return {
        "wheel": lambda: torques.wheels((0.0, 1.5 * size, 0.0)),
        "damping": lambda: torques.damping(0.1 * size),
        "drag": lambda: torques.recorded(lambda t, w: -0.1 * w * np.sqrt(w @ w)),
        "ratio": lambda: torques.recorded(lambda t, w: [w[1] ** 4 / (w @ w), 0, 0]),
        "wave": lambda: torques.recorded(lambda t, w: [0, size * np.sin(0.7 * size * t) * w[0], 0]),
        "turning": lambda: torques.recorded(
            lambda t, w, q: size * q[0] * np.array([w[1], 0, w[0]])
        ),
    }[kind]()


KINDS = ("wheel", "damping", "drag", "ratio", "wave", "turning")


@pytest.mark.parametrize("kind", KINDS)
def test_estimates_do_not_depend_on_the_unit_of_time(kind: str) -> None:
    found = []
    # No such omega is rescaled, so that the kernel itself treats all sizes alike.
    for size in (1.0, 2.0**-6, 2.0**6):
        scene = Scene("any", tuple(size * OMEGA), moments=MOMENTS, torque=of_size(kind, size))
        end = solve(scene, 5.0 / size, attitude=True)
        found.append((end.steps, end.growth, end.error))
    assert found[0] == pytest.approx(found[1], rel=1e-13, abs=0.0)
    assert found[0] == pytest.approx(found[2], rel=1e-13, abs=0.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("power", [-960, -700, -520, -310, 310, 520, 700, 960])
def test_motion_of_any_size_is_solved(kind: str, power: int) -> None:
    size = 2.0**power
    small = Scene("any size", tuple(size * OMEGA), moments=MOMENTS, torque=of_size(kind, size))
    one = replace(small, omega=tuple(OMEGA), torque=of_size(kind, 1.0))
    times = [2.0, 5.0]
    expected = solve(one, times, attitude=True)
    found = solve(small, np.array(times) / size, attitude=True)
    assert found.ended == "complete"
    # Estimates have some three correct digits.
    assert found.error == pytest.approx(expected.error, rel=1e-2, abs=0.0)
    assert found.growth == pytest.approx(expected.growth, rel=1e-2)
    assert found.omega / size == pytest.approx(expected.omega, rel=1e-14, abs=1e-14)
    assert found.attitude == pytest.approx(expected.attitude, abs=1e-14)
    by_scipy = solve(small, np.array(times) / size, "dop853", 1e-9, attitude=True)
    assert by_scipy.omega / size == pytest.approx(expected.omega, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS[:5])
@pytest.mark.parametrize("power", [-700, 700])
def test_prepared_solvers_refuse_what_only_solve_rescales(kind: str, power: int) -> None:
    size = 2.0**power
    scene = Scene("any size", tuple(size * OMEGA), moments=MOMENTS, torque=of_size(kind, size))
    assert solve(scene, 5.0 / size).ended == "complete"
    solver = prepare(scene)
    assert np.isnan(solver(scene.omega, 5.0 / size)).all()
    assert (solver.status, solver.error, solver.growth) == ("refused", None, None)
    assert solver.trajectory(scene.omega, 5.0 / size).ended == "complete"
    many = solve_many(scene, 5.0 / size, omega=[scene.omega, tuple(OMEGA)])
    assert many.status[0] == Statuses.REFUSED
    turning = prepare(scene, attitude=True)
    assert np.isnan(turning(scene.omega, 5.0 / size)[1]).all()
    assert turning.status == "refused"


@pytest.mark.parametrize("power", [-700, 700])
def test_changing_moments_are_solved_for_any_size(power: int) -> None:
    size = 2.0**power
    polynomials = [[3.0, 0.2], [2.0, 0.0, -0.01], [1.5]]
    moments = [[c * size**n for n, c in enumerate(each)] for each in polynomials[::2]]
    small = Scene(
        "any size", tuple(size * OMEGA),
        moments=ChangingMoments([moments[0], [2.0], moments[1]]),
    )  # fmt: skip
    one = replace(small, omega=tuple(OMEGA), changing=ChangingMoments([[3.0, 0.2], [2.0], [1.5]]))
    found, expected = solve(small, 5.0 / size), solve(one, 5.0)
    assert found.omega / size == pytest.approx(expected.omega, rel=1e-14, abs=1e-14)
    momentum = found.angular_momentum() / size
    assert np.linalg.norm(momentum) == pytest.approx(np.linalg.norm(OMEGA * MOMENTS), rel=1e-14)


@pytest.mark.parametrize("torque", [
    torques.pulses([0.31], [0.05], (1.0, 2.0, 3.0)) + torques.damping(0.1),
    torques.recorded(lambda t, w: [np.sin(t) - 0.1 * w[0], 1.0, w[1]]),
])  # fmt: skip
@pytest.mark.parametrize("start", [0.0, 2.0**-460, 2.0**-1000])
def test_torque_that_makes_omega_ordinary_is_solved_in_seconds(torque: Any, start: float) -> None:
    scene = Scene("pushed", tuple(start * OMEGA), moments=MOMENTS, torque=torque)
    # Such a start differs from rest by less than the rounding of the result.
    truth = reference(replace(scene, omega=(0.0, 0.0, 0.0)), [0.2, 2.0])
    found = solve(scene, [0.2, 2.0], tolerance=1e-12)
    assert found.has_all_rows
    assert np.abs(found.omega - truth.omega).max() <= 1e-14 * np.abs(truth.omega).max()


def test_estimate_counts_the_torque_and_an_opaque_one_is_not_rescaled() -> None:
    tiny = Scene("tiny", tuple(1e-200 * OMEGA), moments=MOMENTS, torque=torques.damping(1e-200))
    factor = rescaling_factor(tiny, 1e200)
    assert math.frexp(factor)[0] == 0.5
    assert 1e-5 < factor * 1e-200 < 1e5
    pushed = replace(tiny, torque=torques.recorded(lambda t, w: [1e-100 * w[0] / w[1], 0.0, t * 0]))
    assert rescaling_factor(pushed, 1.0) * 1e-100 < 1e5
    assert rescaling_factor(replace(tiny, torque=opaque(lambda t, w: -1e-200 * w)), 1e200) == 1.0

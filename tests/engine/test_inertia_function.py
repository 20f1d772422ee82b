"""Tests of inertias that are functions of time: recorded, in expressions, in tables."""

import json
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import (
    ChangingInertia,
    ChangingMoments,
    Scene,
    Stepper,
    inertia_table,
    load,
    opaque,
    prepare,
    read_scene,
    solve,
    solve_many,
)
from pyharness.cli.main import main
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.scene_file import scene_text
from pyharness.torques import gravity_gradient
from pyharness.truth.reference import reference
from tests.conftest import Capture
from tests.refused import refused

BODY = np.diag([4.0, 3.0, 2.0])
START = (1.0, 0.2, 0.1)
FINE: Any = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def turning(t: Any) -> Any:
    c, s = np.cos(0.3 * t), np.sin(0.3 * t)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return turn @ BODY @ turn.T


def by_momentum(inertia: Any) -> Any:
    """Return the right-hand side of L' = -omega x L for L about the body axes."""
    return lambda t, momentum: np.cross(momentum, np.linalg.solve(inertia(t), momentum))


@pytest.mark.parametrize("seed", range(6))
def test_functions_agree_with_the_momentum_equations(seed: int) -> None:
    random = Random(f"inertia function {seed}")
    a, b, c, rate, shift = (random.uniform(0.2, 1.0) for _ in range(5))

    def moments(t: Any) -> Any:
        return [
            4.0 + a * np.exp(-rate * t),
            3.0 + b * np.sin(2.0 * rate * t + shift) ** 2,
            2.0 + c * np.minimum(t, 3.0 * shift) + a * abs(t - b),
        ]

    scene = Scene(omega=START, moments=moments)
    found = solve(scene, [1.0, 6.0], tolerance=1e-11)
    assert found.ended == "complete"
    start = np.array(moments(0.0)) * START

    def matrix(t: float) -> Any:
        return np.diag(moments(t))

    other = solve_ivp(by_momentum(matrix), (0.0, 6.0), start, max_step=0.05, **FINE)
    assert found.omega[-1] == pytest.approx(other.y[:, -1] / moments(6.0), abs=3e-9)
    assert np.abs(found.omega - reference(scene, [1.0, 6.0]).omega).max() < 1e-11


def test_a_matrix_that_turns_is_as_its_polynomial_and_keeps_momentum() -> None:
    scene = Scene(omega=START, inertia=turning, attitude=(1, 0, 0, 0))
    found: Any = solve(scene, [0.0, 2.0, 5.0], tolerance=1e-12)
    assert np.ptp(found.angular_momentum("space"), axis=0).max() < 3e-12
    start = BODY @ START
    other = solve_ivp(by_momentum(turning), (0.0, 5.0), start, **FINE)
    assert turning(5.0) @ found.omega[-1] == pytest.approx(other.y[:, -1], abs=1e-10)
    assert prepare(scene)(scene.omega, 5.0)[0] == pytest.approx(found.omega[-1], abs=1e-9)
    both = solve_many(scene, [2.0, 5.0], omega=[START, START])
    assert both.omega == pytest.approx(found.omega[1:], abs=1e-8)
    for method in ("dop853", "lsoda"):
        assert solve(scene, 5.0, method).omega[0] == pytest.approx(found.omega[-1], abs=1e-6)
    stepper = Stepper(scene)
    stepper.until(5.0)
    assert stepper.omega == pytest.approx(found.omega[-1], abs=1e-8)
    matrices = [np.diag([4.0, 3.0, 2.0]), 0.1 * np.ones((3, 3))]
    line = Scene(omega=START, inertia=lambda t: matrices[0] + t * matrices[1])
    wanted = Scene(omega=START, inertia=ChangingInertia(matrices))
    assert (solve(line, 3.0).omega == solve(wanted, 3.0).omega).all()


def test_a_table_is_its_polynomial() -> None:
    times = np.linspace(0.0, 10.0, 11)
    rows = np.stack([4.0 + 0.1 * times, 3.0 + 0.0 * times, 2.0 + 0.01 * times**2], axis=1)
    polynomial = ChangingMoments([[4.0, 0.1], [3.0], [2.0, 0.0, 0.01]])
    wanted = solve(Scene(omega=START, moments=polynomial), 10.0, tolerance=1e-12).omega
    table = inertia_table(times, rows)
    assert solve(Scene(omega=START, moments=table), 10.0, tolerance=1e-12).omega == pytest.approx(
        wanted, abs=1e-11
    )
    matrices = np.stack([np.diag(row) for row in rows])
    scene = Scene(omega=START, inertia=inertia_table(times, matrices))
    assert solve(scene, 10.0, tolerance=1e-12).omega == pytest.approx(wanted, abs=1e-11)
    # Beyond its ends a table is constant.
    later = Scene(omega=START, moments=inertia_table([-2.0, -1.0], [(1, 2, 3), (2, 3, 4)]))
    fixed = Scene(omega=START, moments=(2, 3, 4))
    assert solve(later, 5.0).omega == pytest.approx(solve(fixed, 5.0).omega, abs=1e-9)


def test_torques_and_states_with_a_function() -> None:
    table = inertia_table([0.0, 100.0], [(10, 60, 65), (11, 60, 65)], "linear")
    line = ChangingMoments([[10.0, 0.01], [60.0], [65.0]])
    found = [
        solve(
            Scene(
                omega=(1e-4, 0, 1e-3), moments=each, attitude=(1, 0.1, 0, 0),
                torque=gravity_gradient(each, 1e-3),
            ),
            90.0,
        ).omega
        for each in (table, line)
    ]  # fmt: skip
    assert found[0] == pytest.approx(found[1], abs=1e-12)

    def law(t: Any, omega: Any, states: Any) -> Any:
        return [-0.1 * states["h"], 0.0, 0.0], {"h": 0.1 * omega[0]}

    own = solve(Scene(omega=START, moments=turning_moments, states={"h": 0.5}, torque=law), 3.0)
    bare = Scene(omega=START, moments=turning_moments, torque=opaque(lambda t, w: -0.1 * w))
    assert own.ended == "complete"
    recorded = Scene(omega=START, moments=turning_moments, torque=lambda t, w: -0.1 * w)
    assert solve(bare, 3.0, "dop853").omega == pytest.approx(solve(recorded, 3.0).omega, abs=1e-6)


def turning_moments(t: Any) -> Any:
    return 4.0 + t, 3.0 + np.cos(t), 2.0


def test_files_keep_functions_expressions_and_tables(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "body.toml"
    path.write_text(
        '[body]\nmoments = ["20 + 3*exp(-t)", 23, "26 + 0.1*t"]\n[initial]\nomega = [0.1, 0, 1]\n'
    )
    expressions: Any = read_scene(path)
    assert expressions.changing.at(1.0) == (20.0 + 3.0 * np.exp(-1.0), 23.0, 26.1)
    table = inertia_table([0, 1, 3], [BODY, 2 * BODY, 2 * BODY], "linear")
    scenes = [
        expressions,
        Scene(omega=START, inertia=table),
        Scene(omega=START, inertia=turning),
        Scene(omega=START, moments=turning_moments, torque=lambda t, w: -0.1 * w),
    ]
    for scene in scenes:
        found = solve(scene, [1.0, 2.0])
        found.save(tmp_path / "rows.npz")
        again: Any = load(tmp_path / "rows.npz")
        assert again.scene == scene
        function = again.scene.changing
        assert isinstance(function, InertiaFunction)
        assert (function.phrase == "a recorded function of t") == (function.values() is None)
        assert (again.angular_momentum() == found.angular_momentum()).all()
        assert (solve(again.scene, 2.0).omega == solve(scene, 2.0).omega).all()
    for scene in scenes[:2]:
        path.write_text(scene_text(scene))
        assert read_scene(path).changing == scene.changing
    refused("function of time can't be written", scene_text, scenes[2])
    path.write_text(scene_text(expressions))
    assert main(["run", "--scene", str(path), "--times", "1", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["scene"]["body"] == {"moments": ["20 + 3*exp(-t)", 23, "26 + 0.1*t"]}


@pytest.mark.parametrize("end", [1.0, -20.0])
@pytest.mark.parametrize("place", [0.0015, 0.01666, 0.2005, 0.51667, 0.9995])
def test_a_moment_below_0_for_a_thousandth_of_the_time_is_found(place: float, end: float) -> None:
    """The moment is below 0 in an interval that is 1.1 times as long as a thousandth of the end."""

    def moments(t: Any) -> Any:
        return 4.0, 3.0, 1e-4 * (np.abs(t / end - place) - 0.00055) + 0.0

    message = refused(r"a principal moment is -\S+ kg m2 at t = ", solve,
                      Scene(omega=START, moments=moments), end)  # fmt: skip
    when = float(message.partition("t = ")[2].partition(" s;")[0])
    assert abs(when / end - place) <= 0.00055


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_product_of_inertia_may_become_zero(interpolation: Any) -> None:
    for k in range(1, 40):
        matrices = [[[2.0, p, 0.0], [p, 2.0, 0.0], [0.0, 0.0, 3.0]] for p in (0.1 + k / 200, 0, 0)]
        inertia_table([0.0, k / 10, 30.0], matrices, interpolation)


def test_choices_that_do_not_jump_are_recorded() -> None:
    def moments(t: Any) -> Any:
        return np.where(t > 10.0, 5.0, t - 5.0) + 20.0, np.clip(t, 1, 2) + 20.0, abs(t - 2.0) + 20.0

    assert Scene(omega=START, moments=moments).changing is not None

"""The registry: its statements about methods are true, and all take times and tolerances alike."""

import math
import re
from unittest.mock import Mock

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare, solve, solve_many
from pyharness.engine.plan.registry import METHODS, REGISTRY, SCIPY_METHODS
from pyharness.engine.problem.rescaled import scaled
from pyharness.model.errors import TimedError
from pyharness.thesis.programs import PROGRAM_REGISTRY
from tests.conftest import Patch


def test_properties_of_the_registry_are_those_of_its_methods() -> None:
    for name, method in REGISTRY.items():
        assert method.name == name
        assert re.search(r"[12][09]\d\d|\.f90|solve_ivp|pyharness\.", method.source), name
        assert method.is_fixed_step == (method.evaluations > 0) == (method.finest == 1.0)
        assert (method.order > 0) == (method.is_fixed_step or name.startswith("gauss"))
    assert [name for name in REGISTRY if name not in METHODS] == ["quick"]


@pytest.mark.sampled
@pytest.mark.parametrize("method", METHODS)
def test_times_may_run_either_way_on_either_side(method: str) -> None:
    scene, times = case_scene(3), [-0.5, -0.25, 0.0, 0.25, 0.5]
    tolerance = max(1e-9, METHODS[method].finest)
    forth, back = (solve(scene, each, method, tolerance) for each in (times, times[::-1]))
    for name in ("time", "recorded_time", "omega"):
        np.testing.assert_array_equal(getattr(back, name), getattr(forth, name)[::-1])
    for name in ("steps", "evaluations", "ended"):
        assert getattr(back, name) == getattr(forth, name)
    assert back.time.tolist() == back.recorded_time.tolist() == times[::-1]
    np.testing.assert_array_equal(forth.omega[2], scene.omega)
    # Without torque and with omega1(0) = 0, reversing time only changes the sign of omega1.
    turned = back.omega[:2] * np.array([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(forth.omega[:2], turned, rtol=0, atol=1e-7)


# The method `averaged` takes no motion that is not nearly periodic.
@pytest.mark.sampled
@pytest.mark.parametrize(
    "method", [name for name in METHODS if name not in ("closed-form", "averaged")]
)
def test_solution_that_blows_up_returns_the_rows_until_then(method: str) -> None:
    """The solution is 1 / (1 - t) or, backward, -1 / (1 + t) on every axis."""
    # `tests/model/test_effort.py` integrates the reference forward.
    sign = -1.0 if method == "reference" else 1.0
    scene = Scene("", (sign, sign, sign), coefficients=(1.0, 1.0, 1.0))
    tolerance = max(1e-6, METHODS[method].finest)
    found = solve(scene, [sign * 0.5, sign * 0.9, sign * 2.0], method, tolerance)
    assert found.ended == "overflow"
    # The scene's own steps of 0.01 s are long near the pole.
    limit = 1e-5 if tolerance < 1.0 else 1e-2
    limit = 1e-15 if method == "reference" else limit
    np.testing.assert_allclose(sign * found.omega, [[2.0] * 3, [10.0] * 3], rtol=limit)


@pytest.mark.parametrize("power", [0, -400, 400])
@pytest.mark.parametrize(
    "method", [*SCIPY_METHODS, "auto", "closed-form", "taylor", "gauss-2", "rk4"]
)
def test_time_of_a_refusal_is_in_the_seconds_of_the_scene(
    method: str, power: int, monkeypatch: Patch
) -> None:
    """The time belongs to the result that could not be reached, neither the first nor the last."""
    monkeypatch.setattr("pyharness.engine.methods.scipy_ivp._MOST_EVALUATIONS", 2000)
    monkeypatch.setattr("pyharness.engine.methods.gauss._MOST_EVALUATIONS", 2000)
    plain = Scene("", (1.0, 1.0, 2.0), moments=(3.0, 2.0, 1.0))
    factor = math.ldexp(1.0, power)
    scene = scaled(plain, factor)
    # No method can reach the last two.
    times = [1.0 / factor, 1e19 / factor, 1e20 / factor]
    tolerance = max(1e-6, METHODS[method].finest)
    with pytest.raises(TimedError) as refusal:
        solve(scene, times, method, tolerance)
    found = re.search(r"([\d.e+-]+) s\b", str(refusal.value))
    assert found is not None, refusal.value
    time = float(found[1]) * factor
    if method in SCIPY_METHODS:
        assert 5.0 < time < 1e4
    else:
        reached = {"rk4": 0.01, "taylor": 1.0, "gauss-2": 0.0, "closed-form": 1e19, "auto": 1e19}
        assert time == pytest.approx(reached[method], rel=1e-5, abs=0.0)
    assert refusal.value.time * factor == pytest.approx(time, rel=1e-5, abs=0.0)


def test_time_of_a_refusal_in_a_span_whose_square_is_no_number(monkeypatch: Patch) -> None:
    monkeypatch.setattr("pyharness.engine.methods.scipy_ivp._MOST_EVALUATIONS", 2000)
    law = TorqueLaw(sines=(((1e105, 2e105, 3e105), 1e104),))
    scene = Scene("", (1.0, 2.0, -1.0), moments=(3.0, 2.0, 1.0), torque=law)
    with pytest.raises(TimedError) as refusal:
        solve(scene, [1e-100], "rk45", 1e-9)
    assert 0.0 < refusal.value.time < 1e-100


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_every_call_of_the_right_hand_side_is_counted(method: str, monkeypatch: Patch) -> None:
    scene = case_scene(5)
    slope = Mock(side_effect=scene.right_hand_side())
    monkeypatch.setattr(Scene, "right_hand_side", lambda _: slope)
    # The count includes the forecast's calls; SciPy's own count leaves out Radau's Jacobians.
    assert solve(scene, [0.5, 1.0], method, 1e-6).evaluations == slope.call_count


def test_names_of_methods_are_in_any_case() -> None:
    scene = case_scene(2)
    wanted = solve(scene, 1.0, "dop853").omega.tolist()
    assert solve(scene, 1.0, "DOP853").omega.tolist() == wanted
    many = solve_many(scene, 1.0, omega=[scene.omega], method="TAYLOR", tolerance=1e-12).omega[0]
    assert prepare(scene, "Taylor", 1e-12)(scene.omega, 1.0) == pytest.approx(many, abs=1e-13)


def test_orders_of_gauss_collocation_are_twice_its_stages() -> None:
    assert [METHODS[f"gauss-{stages}"].order for stages in range(1, 9)] == list(range(2, 17, 2))


def test_orders_of_the_programs_are_those_of_their_schemes() -> None:
    """Two or four points with one correction have order 2; eq. 31 has order 4."""
    orders = {name: program.order for name, program in PROGRAM_REGISTRY.items()}
    assert orders == {"two-term": 2, "four-term": 2, "runge-kutta": 4}

"""First scripts as users of SciPy write them: they run, or the message says what to write."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import pyharness
from pyharness import InputError, Taylor, events, load, torques
from tests.refused import refused

# Calls that a type checker refuses too.
Scene: Any = pyharness.Scene
prepare: Any = pyharness.prepare
solve: Any = pyharness.solve
solve_many: Any = pyharness.solve_many
Stepper: Any = pyharness.Stepper
BODY: Any = {"moments": [40, 30, 20], "omega": [0, 1, 1]}
TIMES = np.linspace(0.0, 10.0, 11)


def test_scene_needs_no_name_and_shows_its_body_alone() -> None:
    assert repr(Scene(**BODY)) == "Scene(omega=(0.0, 1.0, 1.0), moments=(40.0, 30.0, 20.0))"
    named = Scene("top", (0, 1, 1), (4, 4, 2), attitude=(1, 0, 0, 0), steps=5)
    assert eval(repr(named)) == named
    assert "forces" not in repr(named)
    sphere = Scene(omega=(1, 2, 3), moments=(1, 1, 1))
    assert eval(repr(sphere)) == sphere


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau", "LSODA", "Taylor", "AUTO"])
def test_methods_have_their_names_in_scipy(method: str) -> None:
    found = solve(Scene(**BODY), TIMES, method=method)
    assert np.abs(found.y - solve(Scene(**BODY), TIMES, tolerance=1e-14).y).max() < 1e-6
    assert found.success
    assert found.status == 0
    assert found.t.tolist() == TIMES.tolist()


def test_events_dense_output_and_attitudes_are_as_in_scipy() -> None:
    def rising(t: float, omega: Any) -> Any:
        return omega[0] - 0.1

    rising.terminal, rising.direction = True, 1  # type: ignore[attr-defined]
    turned = Scene(**BODY, attitude=Rotation.from_euler("xyz", [0.1, 0.2, 0.3]))
    found = solve(turned, TIMES, events=rising, dense_output=True)
    assert found.status == 1
    assert found.sol(0.1).shape == (7,)
    assert found.attitude.shape == (len(found.t), 4)

    def equations(t: float, omega: Any) -> Any:
        moments = np.array(BODY["moments"])
        return np.cross(moments * omega, omega) / moments

    by_scipy = solve_ivp(equations, (0, 10), BODY["omega"], method=Taylor, events=rising)
    assert abs(by_scipy.t_events[0][0] - found.t_events[0][0]) < 1e-3


@pytest.mark.parametrize(("call", "hint"), [
    (lambda: solve(Scene(**BODY), (0, 10), t_eval=TIMES), "times"),
    (lambda: solve(Scene(**BODY), t_span=(0, 10)), "times"),
    (lambda: solve(Scene(**BODY), TIMES, rtol=1e-9, atol=1e-9), "tolerance"),
    (lambda: solve(Scene(**BODY), TIMES, max_step=0.1), "nothing"),
    (lambda: solve(Scene(**BODY), TIMES, strange=1), "dense_output"),
    (lambda: prepare(Scene(**BODY), rtol=1e-9), "tolerance"),
    (lambda: solve_many(Scene(**BODY), 1.0, tol=1e-9), "tolerance"),
    (lambda: solve_many(Scene(**BODY), 1.0, omega0=[[1, 2, 3]]), "omega"),
    (lambda: Stepper(Scene(**BODY), tol=1e-9), "tolerance"),
    (lambda: Scene(I=[40, 30, 20], omega=[0, 1, 1]), "moments"),
    (lambda: Scene(moments=[40, 30, 20], w0=[0, 1, 1]), "omega"),
    (lambda: Scene(**BODY, q0=[1, 0, 0, 0]), "attitude"),
    (lambda: Scene(**BODY, torque=lambda t, w, k: -k * w, args=(1,)), "defaults"),
])  # fmt: skip
def test_keyword_of_scipy_is_answered_with_ours(call: Any, hint: str) -> None:
    with pytest.raises(TypeError, match=f"write .*{hint}|allowed: .*{hint}") as caught:
        call()
    assert "\n" not in str(caught.value)


class Quantity:
    """Numbers with a unit, as of astropy: NumPy drops the unit, and float() raises."""

    unit = "deg / s"

    def __init__(self, values: Any) -> None:
        self.values = values
        self.to = values

    def __iter__(self) -> Any:
        """Return the quantities of an array; a single one raises TypeError."""
        return map(Quantity, self.values)

    def __array__(self, *_: Any, **__: Any) -> Any:
        """Return the numbers without their unit."""
        return np.array(self.values)


@pytest.mark.parametrize("call", [
    lambda: Scene(moments=BODY["moments"], omega=Quantity([0.0, 57.0, 57.0])),
    lambda: solve_many(Scene(**BODY), 1.0, omega=Quantity([0.0, 57.0, 57.0])),
    lambda: solve(Scene(**BODY), Quantity(1.0)),
    lambda: solve(Scene(**BODY), Quantity([0.0, 1.0])),
])  # fmt: skip
def test_numbers_with_a_unit_are_refused_rather_than_taken_for_those_of_si(call: Any) -> None:
    refused(r"a number in deg / s; give its value in SI units", call)


def test_torque_that_accepts_numbers_only_is_told_of_opaque() -> None:
    def torque(t: Any, omega: Any, attitude: Any) -> Any:
        return -Rotation.from_quat(attitude).as_rotvec() - omega

    with pytest.raises(InputError, match=r"accepts numbers only, .*opaque\(function\)"):
        Scene(**BODY, attitude=(1, 0, 0, 0), torque=torque)

    refused(r"the function raised IndexError", Scene, **BODY, torque=lambda t, omega: omega[3])
    for returned, what in ((None, "nothing"), (2.0, "one number")):
        with pytest.raises(InputError, match=f"the function returned {what}; allowed: a function"):
            Scene(**BODY, torque=lambda t, omega, returned=returned: returned)


def test_file_gets_an_ending(tmp_path: Path) -> None:
    found = solve(Scene(**BODY), TIMES)
    found.save(tmp_path / "motion")
    assert [each.name for each in tmp_path.iterdir()] == ["motion.npz"]
    assert load(tmp_path / "motion").omega.tolist() == found.omega.tolist()


def test_every_public_callable_has_a_signature() -> None:
    public = [(pyharness, name) for name in pyharness.__all__]
    public += [(module, name) for module in (events, torques) for name in module.__all__]
    for module, name in public:
        found = getattr(module, name)
        if isinstance(found, type) and issubclass(found, (Warning, RuntimeError)):
            continue
        assert "*args" not in str(inspect.signature(found)), name
        assert found.__doc__
    assert list(inspect.signature(Scene).parameters)[:3] == ["name", "omega", "moments"]

"""Torques that a compiled function computes, compared with SciPy's own DOP853 and the reference."""

import ctypes
import os
import shlex
import signal
import subprocess
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy import LowLevelCallable
from scipy.integrate import solve_ivp

from pyharness import ChangingMoments, Scene, solve
from pyharness.dynamics.system import slopes_of
from pyharness.methods import scipy_state
from pyharness.methods.compiled_run import integrated
from pyharness.methods.scipy_ivp import scipy_method
from pyharness.model.compiled_torque import CompiledTorque
from pyharness.model.errors import InputError, TimedError
from pyharness.model.state_torque import StateTorque, opaque, replayed
from pyharness.model.trajectory import Trajectory
from pyharness.scenes.state_scenes import draw
from pyharness.truth.reference import reference

METHODS = ("DOP853", "RK45", "Radau", "LSODA")
NUMBERS = ctypes.POINTER(ctypes.c_double)
ARGUMENTS = (ctypes.c_double, NUMBERS, NUMBERS, NUMBERS, ctypes.c_void_p)
PROTOTYPE = ctypes.CFUNCTYPE(None, *ARGUMENTS)
BRICK = Scene("brick", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2))
SOURCE = """
#include <math.h>

void damped(double t, const double *w, const double *q, double *n, void *data)
{
  const double rate = data ? *(double *)data : 0.1;
  (void)t, (void)q;
  for (int i = 0; i < 3; i++) n[i] = -rate * w[i];
  n[0] += 0.2;
}

void pulled(double t, const double *w, const double *q, double *n, void *data)
{
  (void)data;
  for (int i = 0; i < 3; i++) n[i] = -q[0] * q[i + 1] - 0.05 * w[i] + 0.1 * sin(t);
}

void growing(double t, const double *w, const double *q, double *n, void *data)
{
  (void)t, (void)q, (void)data;
  n[0] = 3.0 * w[0] * w[0];
}

void chattering(double t, const double *w, const double *q, double *n, void *data)
{
  (void)t, (void)q, (void)data;
  for (int i = 0; i < 3; i++) n[i] = w[i] > 0.0 ? -0.5 : 0.5;
}

void late(double t, const double *w, const double *q, double *n, void *data)
{
  (void)data;
  n[0] = t > 0.5 ? q[0] : -w[0];
}

void turning(double t, const double *w, const double *q, double *n, void *data)
{
  (void)t, (void)q, (void)data;
  n[0] = w[1], n[1] = -w[0];
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return a shared library with torques that a user would compile."""
    folder = tmp_path_factory.mktemp("torques")
    source, built = folder / "torques.c", folder / "torques.so"
    source.write_text(SOURCE)
    flags = ["-O2", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror"]
    compiler = shlex.split(os.environ.get("CC", "cc"))
    subprocess.run([*compiler, *flags, str(source), "-o", str(built), "-lm"], check=True)
    found = ctypes.CDLL(str(built))
    for name in ("damped", "pulled", "growing", "chattering", "late", "turning"):
        function = getattr(found, name)
        function.restype, function.argtypes = None, ARGUMENTS
    return found


def called(torque: StateTorque) -> Any:
    """Return a function of ctypes that computes a recorded torque."""

    def function(t: float, omega: Any, attitude: Any, found: Any, data: Any) -> None:
        found[0], found[1], found[2] = torque.at(t, omega[:3], attitude[:4])

    return PROTOTYPE(function)


def error_of(found: Trajectory, scene: Scene) -> float:
    """Return the error of omega over the largest |omega| of the rows, or the angle's error."""
    truth = reference(scene, found.time.tolist())
    error = float(np.abs(found.omega - truth.omega).max() / np.abs(truth.omega).max())
    if found.attitude is None or truth.attitude is None:
        return error
    return max(error, float(2.0 * np.abs(found.attitude - truth.attitude).max()))


@pytest.mark.parametrize("end", [4.0, -2.0])
@pytest.mark.parametrize("attitude", [None, (0.5, 0.5, -0.5, 0.5)])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-11])
def test_the_steps_are_those_of_scipy(
    library: Any, tolerance: float, attitude: Any, end: float
) -> None:
    function = library.pulled if attitude else library.damped
    torque = opaque(function, needs_attitude=bool(attitude))
    scene = replace(BRICK, torque=torque, attitude=attitude)
    times = [0.1 * end, 0.11 * end, 0.6 * end, end]
    start = [*scene.omega, *(scene.attitude or ())]
    sizes = np.linspace(1.0, 2.0, len(start)) * tolerance
    assert isinstance(torque.function, CompiledTorque)
    found = integrated(scene, torque.function, times, tolerance, sizes.tolist(), 0.7, 10**6)
    scipys = solve_ivp(
        slopes_of(scene), (0.0, end), start, "DOP853", times, rtol=tolerance, atol=sizes,
        max_step=0.7,
    )  # fmt: skip
    np.testing.assert_allclose(found.state, scipys.y.T, rtol=0, atol=1e-14)
    # SciPy prepares dense output for the end of the last step too.
    assert scipys.nfev - found.evaluations in (0, 3)
    assert (found.status, found.reached) == (0, end)


def test_rounding_errors_do_not_add_up_over_many_steps(library: Any) -> None:
    """A sum of 100 000 steps without their remainders has an error of about 1e-12."""
    rate = ctypes.c_double(0.0)
    address = ctypes.cast(ctypes.pointer(rate), ctypes.c_void_p)
    torque = opaque(LowLevelCallable(library.damped, address))  # a constant of 0.2 N m
    scene = Scene("ball", (1.0, 0.0, 0.0), moments=(3.0, 3.0, 3.0), torque=torque)
    assert isinstance(torque.function, CompiledTorque)
    found = integrated(scene, torque.function, [1.0], 1e-9, [1e-9] * 3, 1e-5, 10**7)
    assert found.evaluations > 10**6
    assert abs(found.state[0, 0] - (1.0 + 0.2 / 3.0)) <= 2.3e-16


@pytest.mark.parametrize("number", range(12))
def test_random_torques_meet_the_tolerance(number: int) -> None:
    source = Random(f"compiled {number}")
    scene, end = draw(source)
    while not isinstance(scene.torque, StateTorque):
        scene, end = draw(source)
    torque = opaque(called(scene.torque), needs_attitude=scene.torque.needs_attitude)
    turning = scene.torque.needs_attitude or number % 2 == 0
    for tolerance in (1e-3, 1e-8):
        found = solve(
            replace(scene, torque=torque), [0.3 * end, end], "dop853", tolerance, attitude=turning
        )
        truth = solve(scene, [0.3 * end, end], tolerance=1e-13, attitude=turning)
        assert len(found.time) == len(truth.time) == 2
        scale = np.abs(truth.omega).max()
        assert np.abs(found.omega - truth.omega).max() <= tolerance * scale
        if truth.attitude is not None and found.attitude is not None:
            assert 2.0 * np.abs(found.attitude - truth.attitude).max() <= tolerance


@pytest.mark.parametrize("method", METHODS)
def test_every_method_of_scipy_takes_a_compiled_torque(library: Any, method: str) -> None:
    rate = ctypes.c_double(0.3)
    address = ctypes.cast(ctypes.pointer(rate), ctypes.c_void_p)
    function = LowLevelCallable(library.damped, address)
    recorded = replayed(lambda t, w, q: [0.2 - 0.3 * w[0], -0.3 * w[1], -0.3 * w[2]])
    found = scipy_method(method)(replace(BRICK, torque=opaque(function)), [1.0, 2.0], 1e-7)
    assert error_of(found, replace(BRICK, torque=recorded)) <= 1e-7


def test_the_attitude_of_a_torque(library: Any) -> None:
    scene = replace(BRICK, torque=opaque(library.pulled, needs_attitude=True))
    recorded = replayed(lambda t, w, q: -q[0] * q[1:] - 0.05 * w + 0.1 * np.sin(t))
    for attitude in ((1.0, 0.0, 0.0, 0.0), (0.1, -0.7, 0.5, 0.5)):
        found, truth = (
            solve(
                replace(BRICK, torque=x, attitude=attitude), [1.0, 8.0], name, 1e-9, attitude=True
            )
            for x, name in ((scene.torque, "dop853"), (recorded, "taylor"))
        )
        assert np.abs(found.y - truth.y).max() <= 1e-9
    with pytest.raises(InputError, match="attitude=True"):
        solve(scene, 1.0, "dop853")
    for given in (False, True):
        undeclared = replace(BRICK, torque=opaque(library.pulled))
        with pytest.raises(InputError, match="needs_attitude=True"):
            solve(undeclared, 1.0, "dop853", attitude=given)


def test_an_attitude_that_is_used_late_is_nan(library: Any) -> None:
    """At time 0 nothing shows that the function uses the attitude."""
    found = solve(replace(BRICK, torque=opaque(library.late)), [0.4, 1.0], "dop853", 1e-8)
    assert (found.ended, len(found.time)) == ("overflow", 1)


def test_components_that_a_function_does_not_set_are_zero(library: Any) -> None:
    scene = replace(BRICK, torque=opaque(library.turning))
    first, second = (solve(scene, 2.0, name, 1e-8).omega for name in ("dop853", "lsoda"))
    recorded = replayed(lambda t, w, q: [w[1], -w[0], 0.0])
    truth = solve(replace(BRICK, torque=recorded), 2.0).omega
    assert np.abs(first - truth).max() <= 2e-8
    assert np.abs(second - truth).max() <= 2e-8


def test_python_is_not_called(library: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    own = CompiledTorque.__call__

    def counted(self: CompiledTorque, *given: Any) -> list[float]:
        calls.append(given)
        return own(self, *given)

    monkeypatch.setattr(CompiledTorque, "__call__", counted)
    found = solve(replace(BRICK, torque=opaque(library.damped)), [1.0, 9.0], "dop853", 1e-9)
    assert found.evaluations > 1000
    assert len(calls) == 1  # at time 0


def test_rows_end_before_omega_becomes_infinite(library: Any) -> None:
    body = Scene("growing", (0.3, -1.1, 2.2), moments=(1.5, 2.0, 3.0))
    scene = replace(body, torque=opaque(library.growing))
    recorded = replace(body, torque=replayed(lambda t, w, q: [3.0 * w[0] * w[0], 0.0, 0.0]))
    times = [0.5, 1.0, 3.0]
    found = solve(scene, times, "dop853", 1e-8)
    assert found.ended == "overflow"
    assert found.time.tolist() == solve(recorded, times, "dop853", 1e-8).time.tolist()
    assert 0 < len(found.time) < 3
    assert error_of(found, recorded) <= 1e-8
    undefined = PROTOTYPE(lambda t, w, q, n, d: n.__setitem__(0, float("nan")))
    found = solve(replace(BRICK, torque=opaque(undefined)), times, "dop853", 1e-8)
    assert (found.ended, len(found.time)) == ("overflow", 0)


def test_the_limits_of_work_and_phase(library: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyharness.methods.scipy_ivp._MOST_EVALUATIONS", 30)
    scene = replace(BRICK, torque=opaque(library.chattering))
    with pytest.raises(TimedError, match=r"t = 2\d*\.\d* s after 9600"):
        solve(scene, 300.0, "dop853", 1e-9)
    monkeypatch.setattr(scipy_state, "LARGEST_PHASE", 30.0)
    monkeypatch.setattr("pyharness.methods.compiled_run.LARGEST_PHASE", 30.0)
    with pytest.raises(TimedError, match="phase"):
        solve(replace(BRICK, torque=opaque(library.turning)), 300.0, "dop853", 1e-3)


def test_all_integrations_have_one_work_limit(
    library: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits, counts = [], []

    def watched(*given: Any) -> Any:
        found = integrated(*given)
        limits.append(given[-1])
        counts.append(found.evaluations)
        return found

    monkeypatch.setattr(scipy_state, "integrated", watched)
    solve(replace(BRICK, torque=opaque(library.damped)), 5.0, "dop853", 1e-9)
    assert len(limits) > 2
    assert (-np.diff(limits)).tolist() == counts[:-1]


def test_ctrl_c_ends_an_integration(library: Any) -> None:
    scene = replace(BRICK, torque=opaque(library.turning))
    # A process in the background may ignore the signal of Ctrl-C itself.
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        with pytest.raises(KeyboardInterrupt):
            solve(scene, 1e6, "dop853", 1e-9, effort=1e6)  # takes minutes
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_dense_output_and_events(library: Any) -> None:
    scene = replace(BRICK, torque=opaque(library.damped))
    recorded = replace(
        BRICK, torque=replayed(lambda t, w, q: [0.2 - 0.1 * w[0], -0.1 * w[1], -0.1 * w[2]])
    )
    crossing: Any = lambda t, w: w[1]  # noqa: E731
    found, truth = (
        solve(each, 10.0, "dop853", 1e-9, dense_output=True, events=[crossing])
        for each in (scene, recorded)
    )
    at = np.linspace(0.0, 10.0, 101)
    assert found.sol
    assert truth.sol
    assert np.abs(found.sol(at) - truth.sol(at)).max() <= 2e-9
    assert found.t_events is not None
    assert truth.t_events is not None
    assert len(found.t_events[0]) > 0
    np.testing.assert_allclose(found.t_events[0], truth.t_events[0], rtol=0, atol=1e-7)


def test_a_changing_inertia_calls_the_function_from_python(library: Any) -> None:
    moments = ChangingMoments([[3.0, 0.1], [2.0], [1.5, 0.05]])
    scene = Scene("booms", (0.3, 1.1, -0.7), moments=moments, torque=opaque(library.damped))
    recorded = replayed(lambda t, w, q: [0.2 - 0.1 * w[0], -0.1 * w[1], -0.1 * w[2]])
    found, truth = (solve(replace(scene, torque=x), 2.0, "dop853", 1e-8)
                    for x in (scene.torque, recorded))  # fmt: skip
    assert np.abs(found.omega - truth.omega).max() <= 2e-8


def test_functions_say_what_they_need() -> None:
    with pytest.raises(InputError, match="argtypes"):
        opaque(ctypes.CDLL(None).labs)
    # The arguments of a Python function say what it needs.
    assert not opaque(lambda t, w: -w).needs_attitude
    assert opaque(lambda t, w, q: -w, needs_attitude=True).needs_attitude


def test_a_cfunc_of_numba() -> None:
    numba: Any = pytest.importorskip("numba")
    numbers = numba.types.CPointer(numba.types.double)
    signature = numba.types.void(
        numba.types.double, numbers, numbers, numbers, numba.types.voidptr
    )  # fmt: skip

    def brake(t: Any, omega: Any, attitude: Any, torque: Any, data: Any) -> None:
        for i in range(3):
            torque[i] = -0.2 * omega[i]

    torque = opaque(numba.cfunc(signature)(brake))
    found = solve(replace(BRICK, torque=torque), 5.0, "dop853", 1e-10)
    recorded = replayed(lambda t, w, q: [-0.2 * w[0], -0.2 * w[1], -0.2 * w[2]])
    assert error_of(found, replace(BRICK, torque=recorded)) <= 1e-10

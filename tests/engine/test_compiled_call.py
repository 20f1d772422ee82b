"""Prepared solvers in compiled code: C with the header, ctypes, SciPy's low-level calls, numba."""

import ctypes
import gc
import os
import pickle
import re
import shlex
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import LowLevelCallable
from scipy.integrate import quad

from pyharness import Scene, TorqueLaw, get_include, prepare
from pyharness.model.codes import Statuses
from pyharness.model.extension import ENDS
from pyharness.torques import damping

BRICK = Scene("brick", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2))
LAW = TorqueLaw((0.1, -0.2, 0.05), sines=[((0.1, 0.2, 0.3), 1.3)])
SOLVERS: dict[str, Any] = {
    "closed form": (BRICK, {}),
    "sphere": (Scene("ball", (1.0, 0.0, 0.5), moments=(2.0, 2.0, 2.0), torque=LAW), {}),
    "series": (Scene("law", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2), torque=LAW), {}),
    "tape": (Scene("tape", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2), torque=damping(0.1)), {}),
    "quick": (BRICK, {"method": "quick", "tolerance": 1e-6}),
    "attitude": (Scene("law", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2), torque=LAW),
                 {"attitude": True}),
    "attitude without torque": (BRICK, {"attitude": True}),
}  # fmt: skip
SOURCE = """
#include <Python.h>
#include "pyharness.h"

/* The mean of a component of omega is an integral over time. */
double second(double t, void *data)
{
  const double start[3] = {0.3, 1.1, -0.7};
  double state[3];
  return pyharness_solve(data, start, t, state, NULL) == PYHARNESS_COMPLETE ? state[1] : NAN;
}

void *of_capsule(PyObject *capsule) { return PyCapsule_GetPointer(capsule, PYHARNESS_SOLVER); }

int ends(void *capsule, const double *starts, int n, double t, double *states, double *errors)
{
  const pyharness_solver *solver = of_capsule(capsule);
  int failed = 0;
  if (solver == NULL) return -1;
  for (int i = 0; i < n; i++)
    failed += pyharness_solve(solver, starts + i * solver->width, t, states + i * solver->width,
                              errors + i) != PYHARNESS_COMPLETE;
  return failed;
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return a shared library that a user would compile with the header."""
    folder = tmp_path_factory.mktemp("compiled")
    source, built = folder / "user.c", folder / "user.so"
    source.write_text(SOURCE)
    flags = ["-O2", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", f"-I{get_include()}"]
    flags.append(f"-I{sysconfig.get_paths()['include']}")
    undefined = ["-undefined", "dynamic_lookup"] if os.uname().sysname == "Darwin" else []
    compiler = shlex.split(os.environ.get("CC", "cc"))
    subprocess.run([*compiler, *flags, str(source), "-o", str(built), *undefined], check=True)
    return ctypes.PyDLL(str(built))


def prepared(kind: str) -> Any:
    scene, options = SOLVERS[kind]
    return prepare(scene, **options)


def expected(solver: Any, start: Any, time: float) -> Any:
    if len(start) == 3:
        return solver(start, time)
    return np.concatenate(solver(start[:3], time, start[3:]))


def starts_of(solver: Any, n: int) -> Any:
    starts = np.random.default_rng(7).uniform(-1.0, 1.0, (n, 3))
    if solver.with_attitude:
        starts = np.column_stack([starts, np.tile([0.6, 0.0, 0.8, 0.0], (n, 1))])
    return starts


@pytest.mark.parametrize("kind", SOLVERS)
def test_c_has_the_bits_of_python(kind: str, library: Any) -> None:
    solver = prepared(kind)
    starts = starts_of(solver, 20)
    states, errors = np.empty_like(starts), np.empty(20)
    given = [ctypes.c_void_p(each.ctypes.data) for each in (starts, states, errors)]
    capsule = ctypes.py_object(solver.capsule)
    number, time = ctypes.c_int(20), ctypes.c_double(-2.5)
    assert library.ends(capsule, given[0], number, time, given[1], given[2]) == 0
    for start, state, error in zip(starts, states, errors, strict=True):
        assert state.tobytes() == expected(solver, start, -2.5).tobytes()
        if not solver.plan.closed_form:
            assert error == solver.error


@pytest.mark.parametrize("kind", SOLVERS)
def test_function_has_the_bits_of_python(kind: str) -> None:
    solver = prepared(kind)
    call = solver.ctypes
    for start in starts_of(solver, 5):
        state = np.empty_like(start)
        assert call.function(call.data, start.ctypes.data, 3.0, state.ctypes.data) == 0
        assert state.tobytes() == expected(solver, start, 3.0).tobytes()


def test_scipy_integrates_a_component(library: Any) -> None:
    solver = prepare(BRICK, tolerance=1e-12)
    library.second.restype, library.second.argtypes = ctypes.c_double, (
        ctypes.c_double, ctypes.c_void_p,
    )  # fmt: skip
    integrand = LowLevelCallable(library.second, ctypes.c_void_p(solver.ctypes.data))
    found, _ = quad(integrand, 0.0, 4.0, epsabs=1e-12, epsrel=1e-12)
    slowly, _ = quad(lambda t: solver(BRICK.omega, t)[1], 0.0, 4.0, epsabs=1e-12, epsrel=1e-12)
    assert found == slowly


@pytest.mark.campaign
def test_capsule_and_function_keep_the_solver() -> None:
    start, state = np.array(BRICK.omega), np.empty(3)
    call = prepare(BRICK).ctypes
    capsule = prepare(BRICK).capsule
    gc.collect()
    assert call.function(call.data, start.ctypes.data, 1.0, state.ctypes.data) == 0
    assert state.tobytes() == prepare(BRICK)(start, 1.0).tobytes()
    assert "pyharness.solver.1" in repr(capsule)


def test_solution_that_fails_says_so() -> None:
    call = prepare(Scene("runaway", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0)), "taylor").ctypes
    start, state = np.ones(3), np.zeros(3)
    assert ENDS[call.function(call.data, start.ctypes.data, 2.0, state.ctypes.data)] == "overflow"
    assert np.isnan(state).all()


def test_statuses_of_the_header_are_those_of_the_kernels() -> None:
    text = Path(get_include(), "pyharness.h").read_text()
    found = re.findall(r"PYHARNESS_([A-Z_]+) = (\d)", text)
    assert len(found) == 6
    for name, number in found:
        assert getattr(Statuses, name) == int(number)


def test_a_copy_has_an_address_of_its_own() -> None:
    solver = prepare(BRICK)
    assert pickle.loads(pickle.dumps(solver)).ctypes.data != solver.ctypes.data


def test_a_solver_for_a_full_inertia_has_no_compiled_call() -> None:
    full = Scene("full", BRICK.omega, inertia=((3.0, 0.2, -0.1), (0.2, 2.0, 0.3), (-0.1, 0.3, 1.2)))
    for solver in (prepare(full), prepare(full, attitude=True)):
        assert not hasattr(solver, "ctypes")
        assert not hasattr(solver, "capsule")


def test_numba_calls_a_solver_from_a_loop() -> None:
    numba = pytest.importorskip("numba")
    solver = prepare(BRICK)
    function, data, _ = solver.ctypes

    @numba.njit  # type: ignore[untyped-decorator]
    def ends(starts: Any, t: float, states: Any) -> int:
        failed = 0
        for i in range(len(starts)):
            failed += function(data, starts[i].ctypes.data, t, states[i].ctypes.data) != 0
        return failed

    starts = starts_of(solver, 1000)
    states = np.empty_like(starts)
    assert ends(starts, 1.5, states) == 0
    assert states.tobytes() == np.array([solver(start, 1.5) for start in starts]).tobytes()

"""Fortran kernels compiled with loops as written, or with a passage of the source replaced."""

import ctypes
import os
import runpy
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness import Scene
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.trajectory import Array

COMPILER = os.environ.get("FC", "gfortran")
_FORTRAN = Path(__file__).parent.parent / "fortran"
_TAYLOR = (
    "two_words", "step_nodes", "problem", "torque_noise", "torque_terms", "taylor_plan",
    "taylor_series", "taylor_error", "taylor_attitude", "taylor_rows", "taylor_march", "taylor",
)  # fmt: skip
_MANY = ("two_words", "problem", "torque_noise", "torque_terms", "taylor_plan")
_BODIES = (
    "bodies", "many_circular", "many_columns", "many_orbits", "many_growth", "many_turns",
    "many_free", "many_fixed", "many_slots", "many_attitudes", "many_rows", "many_taylor",
)  # fmt: skip


class Found(NamedTuple):
    """The result of one integration by the series."""

    omega: Array  # one row for each time
    status: int
    steps: int  # of the last integration
    error: float  # estimated relative error
    growth: float


Solve = Callable[[Scene, Sequence[float], float], Found]


def compiler_here() -> bool:
    """Return whether a Fortran compiler is on the PATH."""
    return shutil.which(COMPILER) is not None


def as_written(folder: Path, changes: Mapping[str, tuple[str, str]] | None = None) -> Solve:
    """Compile the loops as written, not unrolled; return a function that solves by them.

    `changes` maps a module's name to a passage, which occurs once in it, and its replacement.
    """
    sources = [f"modern/{name}.f90" for name in _TAYLOR]
    sources += ["../tests/taylor_as_written.f90"]
    loops = _compiled(folder, sources, changes or {}).taylor_as_written

    def solved(scene: Scene, times: Sequence[float], tolerance: float) -> Found:
        coefficients, constant, rate, sines, cosines = normalized(scene)
        rows, found = np.zeros((len(times), 3)), np.zeros(3)
        n_rows, status, steps = ctypes.c_int(), ctypes.c_int(), ctypes.c_int64()
        loops(
            coefficients.ctypes, constant.ctypes, rate.ctypes, sines.shape[1], sines.ctypes,
            cosines.shape[1], cosines.ctypes, np.array(scene.omega).ctypes,
            np.array([tolerance]).ctypes, len(times), np.array(times, dtype=float).ctypes,
            rows.ctypes, ctypes.byref(n_rows), ctypes.byref(status), ctypes.byref(steps),
            found.ctypes,
        )  # fmt: skip
        return Found(rows[: n_rows.value], status.value, steps.value, found[0], found[1])

    return solved


def many_as_written(folder: Path) -> Callable[..., tuple[Array, Array, NDArray[np.int8]]]:
    """Compile the loops over bodies as written, not unrolled; return a function that uses them."""
    sources = [f"modern/{name}.f90" for name in _MANY]
    # Order of compilation: `bodies` uses `problem`, and the other modules use both.
    sources += [f"many/{name}.f90" for name in _BODIES] + ["../tests/many_as_written.f90"]
    loops = _compiled(folder, sources, {}).many_as_written
    loops.argtypes = [ctypes.c_int] * 3 + [ctypes.c_double] * 2 + [ctypes.c_void_p] * 6 + [
        ctypes.c_int, ctypes.c_int
    ] + [ctypes.c_void_p] * 4  # fmt: skip

    def solved(
        method: int, tolerance: float, step: float, *arrays: Array
    ) -> tuple[Array, Array, NDArray[np.int8]]:
        body, constant, rate, sines, omega0, times, attitude0 = map(np.ascontiguousarray, arrays)
        omega, status = np.empty_like(omega0), np.empty(len(omega0), np.int8)
        attitude = np.empty_like(attitude0)
        loops(
            method, len(omega0), sines.shape[1], tolerance, step, body.ctypes, constant.ctypes,
            rate.ctypes, sines.ctypes, omega0.ctypes, times.ctypes, len(times), len(attitude0),
            attitude0.ctypes, omega.ctypes, attitude.ctypes, status.ctypes,
        )  # fmt: skip
        return omega, attitude, status

    return solved


def _compiled(
    folder: Path, kernels: Sequence[str], changes: Mapping[str, tuple[str, str]]
) -> ctypes.CDLL:
    for name, text in runpy.run_path(str(_FORTRAN / "make_codes.py"))["texts"]().items():
        (folder / name).write_text(text)
    command = [COMPILER, "-shared", "-fPIC", "-O1", "-o", "loops.so"]
    command += sorted(path.name for path in folder.glob("*.f90"))
    sources = ["kinds.f90", "interruption.f90", "../tests/never_interrupted.f90", *kernels]
    for source in sources:
        text = (_FORTRAN / source).read_text()
        old, new = changes.get(Path(source).stem, ("", ""))
        if old:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        (folder / Path(source).name).write_text(text)
    subprocess.run([*command, *(Path(each).name for each in sources)], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "loops.so"))

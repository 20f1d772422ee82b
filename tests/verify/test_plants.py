"""Planted faults: every check of the suite is seen to fail. A plant nothing catches fails here."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pyharness.compare.agreement import differences
from pyharness.compare.orders import measured_order
from pyharness.model import codes
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.scene_file import case_scene
from pyharness.original import compiled
from pyharness.truth.reference import reference
from pyharness.verify.plants.planted_twins import plant_in_twin

FORTRAN = Path(__file__).parent.parent.parent / "fortran"
SOURCES = (
    "kinds",
    "interruption",
    "../tests/never_interrupted",
    "original/listing",
    "original/linear_solver",
    "original/deck",
    "original/two_term",
    "original/four_term",
    "original/runge_kutta",
    "original/programs",
    "api",
)

# program, file, what stands there, the fault, whether the truth shows it too: it can't where the
# fault is of the size of rounding, is in the velocity, or leaves a method of the same order.
TWIN_PLANTS = {
    "a sign in omega": (
        "two-term", "equations.py", "m[2] + c * u[0]", "m[2] - c * u[0]", True,
    ),
    "a sign in the Runge-Kutta": (
        "runge-kutta", "runge_kutta.py", "r2 + b * u[2]", "r2 - b * u[2]", True,
    ),
    "a swapped axis": (
        "four-term", "equations.py", "m[1] + b * u[0] * u[2]", "m[1] + b * u[1] * u[2]", True,
    ),
    "half a step": ("runge-kutta", "runge_kutta.py", "(dt / 6.0)", "(dt / 12.0)", True),
    "half an interval": (
        "four-term", "collocation.py", "interval(state, points, h,",
        "interval(state, points, h / 2,", True,
    ),
    "a collocation point": ("two-term", "two_term.py", "2.0 * dt / 3.0", "2.1 * dt / 3.0", False),
    "one unit in the last place of a point": (
        "four-term", "four_term.py", "dt * 0.6", "dt * 0.6000000000000001", False,
    ),
    "one unit in the last place of a weight": (
        "runge-kutta", "runge_kutta.py", "(dt / 6.0)", "(dt / 6.000000000000001)", False,
    ),
    "a sign in the velocity": (
        "two-term", "equations.py", "acceleration[0] + v[1]", "acceleration[0] - v[1]",
        False,
    ),
    "another order of summation": (
        "runge-kutta", "runge_kutta.py", "k1 + 2.0 * (k2 + k3) + k4", "k1 + (2.0 * (k2 + k3) + k4)",
        False,
    ),
    "the last of equal pivots": (
        "four-term", "linear_solver.py", "if scaled > biggest", "if scaled >= biggest", False,
    ),
}  # fmt: skip


@pytest.mark.bitwise
@pytest.mark.parametrize("name", TWIN_PLANTS)
def test_fault_in_a_twin_is_caught(name: str, tmp_path: Path) -> None:
    """By the bits in every case, and by the truth where the fault is larger than rounding."""
    program, file, old, new, shows_in_truth = TWIN_PLANTS[name]
    planted = plant_in_twin(program, file, old, new, tmp_path)
    scene = case_scene(5)
    listing = corrected(program)
    assert differences(compiled.run(scene, listing), planted.run(scene, listing)), "bits"
    truth = reference(scene, scene.times())
    misses = measured_order(scene, planted, listing, truth).state == "misses"
    assert misses == shows_in_truth, "truth"


def test_twin_without_a_fault_is_not_caught(tmp_path: Path) -> None:
    """The control: the same machinery without a plant raises no alarm."""
    for program in PROGRAMS:
        planted = plant_in_twin(program, "equations.py", "m[2] + c", "m[2] + c", tmp_path)
        scene = case_scene(5)
        listing = corrected(program)
        assert differences(compiled.run(scene, listing), planted.run(scene, listing)) == []
        truth = reference(scene, scene.times())
        assert measured_order(scene, planted, listing, truth).state == "as due"


# file, what stands there, the fault, the cell that must notice
FORTRAN_PLANTS = {
    "none": ("two_term", "", "", original("two-term")),
    "a sign": ("two_term", "M2(1) + B1*U1(1)", "M2(1) - B1*U1(1)", corrected("two-term")),
    "one unit in the last place": ("four_term", "0.6_dp", "0.60000000000000009_dp",
                                   corrected("four-term")),
    "half a step": ("runge_kutta", "U1(I) = UU1 + (DT/6.0_dp)", "U1(I) = UU1 + (DT/12.0_dp)",
                    corrected("runge-kutta")),
    "a wrong card corrected": ("listing", "btest(bits, 3)", "btest(bits, 4)",
                            Listing("runge-kutta", frozenset(["stage-base"]))),
    "the time label": ("runge_kutta", "rows(2, L) = TIME", "rows(2, L) = TIME - 0.5_dp*DT",
                       original("runge-kutta")),
}  # fmt: skip


@pytest.mark.external
@pytest.mark.skipif(shutil.which(os.environ.get("FC", "gfortran")) is None, reason="no compiler")
@pytest.mark.parametrize("name", FORTRAN_PLANTS)
def test_fault_in_the_fortran_is_caught(name: str, tmp_path: Path) -> None:
    """Compile the programs with a fault and compare their bits with the twin's."""
    file, old, new, listing = FORTRAN_PLANTS[name]
    library = _compiled(tmp_path, file, old, new)
    scene = case_scene(3)
    twin = _twin_rows(listing)
    rows = _rows(library, listing, scene.moments or (), scene.omega, len(twin))
    assert np.array_equal(rows, twin) == (name == "none")


def _compiled(folder: Path, file: str, old: str, new: str) -> ctypes.CDLL:
    paths = ["codes.f90"]
    maker = [sys.executable, str(FORTRAN / "make_codes.py"), codes.__file__, *paths]
    subprocess.run(maker, cwd=folder, check=True)
    for source in SOURCES:
        text = (FORTRAN / f"{source}.f90").read_text()
        if source == "api":
            # The entries of the programs; the modern kernels have tests of their own.
            text = (
                text.partition("end subroutine solve_linear\n")[0] + "end subroutine solve_linear\n"
            )
        path = folder / f"{Path(source).name}.f90"
        if path.stem == file and old:
            assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {file}"
            text = text.replace(old, new)
        path.write_text(text)
        paths.append(path.name)
    library = folder / "planted.so"
    command = [os.environ.get("FC", "gfortran"), "-shared", "-fPIC", "-O1", "-ffp-contract=off"]
    subprocess.run([*command, *paths, "-o", str(library)], cwd=folder, check=True)
    return ctypes.CDLL(str(library))


def _twin_rows(listing: Listing) -> np.ndarray:
    from pyharness.original.programs import PROGRAM_REGISTRY

    run = PROGRAM_REGISTRY[listing.program].run(case_scene(3), listing, "python", may_stop=False)
    assert run.velocity is not None
    return np.column_stack([run.time, run.recorded_time, run.omega, run.velocity])


def _rows(
    library: ctypes.CDLL,
    listing: Listing,
    moments: tuple[float, ...],
    omega: tuple[float, ...],
    steps: int,
) -> np.ndarray:
    """Call run_program by reference, as Fortran expects."""
    zero = (0.0, 0.0, 0.0)
    rows = np.zeros((steps, 8))
    ier = np.zeros(steps, dtype=np.int32)
    answers = [ctypes.c_int(0) for _ in range(4)]

    def vector(values: tuple[float, ...]) -> ctypes.Array[ctypes.c_double]:
        return (ctypes.c_double * 3)(*values)

    def whole(value: int) -> object:
        return ctypes.byref(ctypes.c_int(value))

    def real(value: float) -> object:
        return ctypes.byref(ctypes.c_double(value))

    number = ("two-term", "four-term", "runge-kutta").index(listing.program) + 1
    scene = case_scene(3)
    library.run_program_(
        whole(number), whole(listing.flags), whole(1), vector(moments), vector(omega),
        vector(scene.masses), vector(scene.forces), vector(zero), vector(zero), whole(0),
        whole(0), None, whole(0), None, real(scene.step_size), whole(steps), real(500.0),
        whole(0), whole(1),
        rows.ctypes.data_as(ctypes.c_void_p), ier.ctypes.data_as(ctypes.c_void_p),
        *map(ctypes.byref, answers), ctypes.byref(ctypes.c_double()),
    )  # fmt: skip
    return rows[: answers[0].value]

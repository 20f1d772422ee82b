"""Run time saved by omitting unnecessary computations."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pyharness.checks.compare.timing import seconds
from pyharness.engine.prepared.solver import prepare
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.thesis import compiled

_BATCHES = 9
_SECONDS = 2e-3  # duration (s) of a batch


@dataclass(frozen=True)
class Saving:
    """The median run times (s) with and without a computation that a plan can omit."""

    part: str  # as the plan names it
    where: str  # name of the scene or program
    with_it: float
    without: float

    @property
    def ratio(self) -> float:
        return self.with_it / self.without


def savings(t_end: float = 3.0, tolerance: float = 1e-9) -> list[Saving]:
    constant = case_scene(5)
    times = [t_end * k / 100.0 for k in range(1, 101)]
    rows = prepare(constant, "taylor", tolerance)
    one: Callable[[], object]
    other: Callable[[], object]
    found = []
    for case in (2, 3, 4):
        scene = case_scene(case)
        one, other = (_solver(scene, name, t_end, tolerance) for name in ("taylor", "closed-form"))
        found.append(measured_saving("integration", f"Case {case}: closed form", one, other))
    # The rate changes no bit of the result, but forces the kernel to evaluate the torque at each
    # time.
    varying = replace(constant, torque=replace(constant.law, rate=(1e-300, 0.0, 0.0)))
    one, other = (_solver(scene, "taylor", t_end, tolerance) for scene in (varying, constant))
    found.append(measured_saving("torque of time", "Case 5: constant torque", one, other))
    one, other = (partial(rows.trajectory, constant.omega, each) for each in (times, times[-1:]))
    found.append(measured_saving("dense output", "Case 5: 100 rows", one, other))
    for program in PROGRAMS:
        one = partial(compiled.run, replace(constant, steps=1000), Listing.corrected(program))
        other, where = partial(one, velocity=False), f"{program}, 1000 steps"
        found.append(measured_saving("velocity", where, one, other))
    code = "import pyharness.engine.prepared.solver"
    for part, module in (("SciPy", "scipy.integrate"), ("reference", "pyharness.truth.reference")):
        one, other = partial(_python, f"{code}, {module}"), partial(_python, code)
        found.append(measured_saving(part, f"a process that imports {module}", one, other))
    return found


def _solver(scene: Scene, method: str, t_end: float, tolerance: float) -> Callable[[], object]:
    return partial(prepare(scene, method, tolerance), np.array(scene.omega), t_end)


def _python(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True)


def measured_saving(
    part: str, where: str, with_it: Callable[[], object], without: Callable[[], object]
) -> Saving:
    return Saving(part, where, *seconds([with_it, without], _SECONDS, _BATCHES))

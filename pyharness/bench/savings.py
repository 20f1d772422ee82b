"""What each skip of the plan saves: the same result with and without it, timed in one run."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pyharness.compare.timing import seconds
from pyharness.methods.prepared import prepare
from pyharness.model.listing import PROGRAMS, corrected
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.original import compiled

_BATCHES = 9
_SECONDS = 2e-3  # of a batch


@dataclass(frozen=True)
class Saving:
    """One skip.

    Attributes
    ----------
    part : str
        What is skipped, as the plan names it.
    where : str
        The scene or program that shows it.
    with_it, without : float
        Seconds with the part computed and without, medians of interleaved batches.
    """

    part: str
    where: str
    with_it: float
    without: float

    @property
    def ratio(self) -> float:
        """How many times longer it takes with the part computed."""
        return self.with_it / self.without


def savings(t_end: float = 3.0, tolerance: float = 1e-9) -> list[Saving]:
    """Measure every skip; `t_end` in s, `tolerance` relative."""
    found = []
    for case in (2, 3, 4):
        scene = case_scene(case)
        found.append(
            _saving(
                "integration",
                f"Case {case}: closed form",
                _solver(scene, "taylor", t_end, tolerance),
                _solver(scene, "closed-form", t_end, tolerance),
            )
        )
    constant = case_scene(5)
    found.append(
        _saving(
            "torque of time",
            "Case 5: constant torque",
            _solver(_as_if_varying(constant), "taylor", t_end, tolerance),
            _solver(constant, "taylor", t_end, tolerance),
        )
    )
    times = [t_end * k / 100.0 for k in range(1, 101)]
    rows = prepare(constant, "taylor", tolerance)
    found.append(
        _saving(
            "dense output",
            "Case 5: 100 rows",
            lambda: rows.trajectory(constant.omega, times),
            lambda: rows.trajectory(constant.omega, times[-1:]),
        )
    )
    for program in PROGRAMS:
        scene = replace(constant, steps=1000)
        listing = corrected(program)
        found.append(
            _saving(
                "velocity",
                f"{program}, 1000 steps",
                partial(compiled.run, scene, listing),
                partial(compiled.run, scene, listing, velocity=False),
            )
        )
    for part, module in (("SciPy", "scipy.integrate"), ("reference", "pyharness.truth.reference")):
        code = "import pyharness.methods.prepared"
        found.append(
            _saving(
                part,
                f"a process that imports {module}",
                partial(_python, f"{code}, {module}"),
                partial(_python, code),
            )
        )
    return found


def _solver(scene: Scene, method: str, t_end: float, tolerance: float) -> Callable[[], object]:
    solver = prepare(scene, method, tolerance)
    omega = np.array(scene.omega)
    return lambda: solver(omega, t_end)


def _as_if_varying(scene: Scene) -> Scene:
    # A rate too small to move a bit, so that the kernel has to look at the time.
    law = replace(scene.torque, rate=(1e-300, 0.0, 0.0))
    return replace(scene, torque=law)


def _python(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True)


def _saving(
    part: str, where: str, with_it: Callable[[], object], without: Callable[[], object]
) -> Saving:
    return Saving(part, where, *seconds([with_it, without], _SECONDS, _BATCHES))

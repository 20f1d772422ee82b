"""Python twins with one fault: copies of their source in which one piece of code is changed."""

import importlib
import itertools
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

from pyharness import original
from pyharness.checks.plants.faults import Fault
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY, Program


class TwinFault(NamedTuple):
    """A fault in the Python version (the twin) of programs: a piece of its source, and another.

    `right` occurs once in `file`, and `wrong` replaces it. In `wrong`, the word ``SIZE`` stands for
    the size of the fault, by default `size`. `programs` are names of programs. `shows` has the
    comparisons that detect the fault: with the ``bits`` of the compiled program, with the
    ``truth``, or a kind of check.
    """

    file: str
    right: str
    wrong: str
    size: float
    programs: str
    shows: str


# Where the truth does not show a fault, it is of the size of rounding, or in the velocity, or it
# leaves a method of the same order.
_COLLOCATION, _ALL, _RK = "two-term four-term", "two-term four-term runge-kutta", "runge-kutta"
_STEPS, _SLOPES = "runge_kutta.py", "equations.py"
TWIN_FAULTS = {
    "sign": TwinFault(_SLOPES, "m[2] + c * u[0]", "m[2] + (1.0 - SIZE) * c * u[0]", 2.0,
                      "two-term", "bits truth"),
    "sign of a slope": TwinFault(_STEPS, "r2 + b * u[2]", "r2 - b * u[2]", 1.0, _RK, "bits truth"),
    "axis": TwinFault(_SLOPES, "m[1] + b * u[0] * u[2]", "m[1] + b * u[1] * u[2]", 1.0,
                      "four-term", "bits truth"),
    "step": TwinFault(_STEPS, "(dt / 6.0)", "((1.0 - SIZE) * dt / 6.0)", 0.5, _RK, "bits truth"),
    "interval": TwinFault("collocation.py", "interval(state, points, h,",
                          "interval(state, points, (1.0 - SIZE) * h,", 0.5,
                          "four-term", "bits truth"),
    "point": TwinFault("two_term.py", "2.0 * dt / 3.0", "(2.0 + SIZE) * dt / 3.0", 0.1,
                       "two-term", "bits"),
    "last place of a point": TwinFault("four_term.py", "dt * 0.6", "dt * 0.6000000000000001", 1.0,
                                       "four-term", "bits"),
    "last place of a weight": TwinFault(_STEPS, "(dt / 6.0)", "(dt / 6.000000000000001)", 1.0,
                                        _RK, "bits"),
    "sign of an acceleration": TwinFault(_SLOPES, "acceleration[0] + v[1]",
                                         "acceleration[0] - v[1]", 1.0, "two-term", "bits"),
    "order of summation": TwinFault(_STEPS, "k1 + 2.0 * (k2 + k3) + k4",
                                    "k1 + (2.0 * (k2 + k3) + k4)", 1.0, _RK, "bits"),
    "last of equal pivots": TwinFault("linear_solver.py", "if scaled > biggest",
                                      "if scaled >= biggest", 1.0, "four-term", "bits"),
    "another point": TwinFault("two_term.py", "2.0 * dt / 3.0]", "dt / 3.0]", 1.0,
                               "two-term", "orders"),
    "order of points": TwinFault("four_term.py", "dt * 0.6,", "dt * 0.4,", 1.0,
                                 "four-term", "orders"),
    "pivot": TwinFault("linear_solver.py", "if n + biggest == n:", "if n + biggest > n:", 1.0,
                       "four-term", "orders"),
    "coefficient": TwinFault(_SLOPES, "m[1] + b * u[0]", "m[1] + (1.0 + SIZE) * b * u[0]", 1e-9,
                             _COLLOCATION, "schemes"),
    "torque": TwinFault(_SLOPES, "m[0] + a * u[1]", "(1.0 + SIZE) * m[0] + a * u[1]", 1e-9,
                        _COLLOCATION, "schemes"),
    "coefficient b": TwinFault(_STEPS, "r2 + b * u[2]", "r2 + (1.0 + SIZE) * b * u[2]", 1e-9,
                               _RK, "schemes"),
    "torque of a slope": TwinFault(_STEPS, "[r1 + a", "[(1.0 + SIZE) * r1 + a", 1e-9,
                                   _RK, "schemes"),
    "acceleration": TwinFault(_SLOPES, "acceleration[1] + v[2]",
                              "(1.0 + SIZE) * acceleration[1] + v[2]", 1e-9, _ALL, "schemes"),
    "sign of a velocity": TwinFault(_SLOPES, "- v[1] * u[0]", "+ v[1] * u[0]", 1.0,
                                    _ALL, "schemes"),
    **{
        f"{name} of the stop test": TwinFault(_STEPS, right, wrong, size, _RK, "stops")
        for name, right, wrong, size in (
            ("stage", "_distances(slope[4], slope[1])", "_distances(slope[3], slope[1])", 1.0),
            ("point", "_distances(point[3], first_point)", "_distances(point[2], first_point)",
             1.0),
            ("result", "_distances(result, base)", "_distances(result, point[3])", 1.0),
            ("order", "found[3:] + found[:3]", "found", 1.0),
            ("variable", "found = [*zip(STOP_VARIABLES[:last]",
             "found = [*zip(STOP_VARIABLES[last - 1 :: -1]", 1.0),
            ("velocity", "last = 6 if velocity_counts else 3", "last = 3", 1.0),
            ("norm", "_norm(change_k[:last])", "(1.0 - SIZE) * _norm(change_k[:last])", 1e-10),
            ("constant", "> by * lipschitz", "> (1.0 + SIZE) * by * lipschitz", 1e-7),
            ("square", "total = total + each * each", "total = total + abs(each)", 1.0),
            ("step", "Stop(step + 1, *found)", "Stop(step, *found)", 1.0),
        )
    },
}  # fmt: skip

_COUNT = itertools.count()


@dataclass(frozen=True)
class PlantedTwin(Program):
    """A program of the thesis whose Python version (its twin) has a planted fault.

    The faulty twin is `module`, a changed copy of the twin. If `both`, it also runs in place of the
    compiled Fortran program.
    """

    module: ModuleType
    both: bool = True

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        """Run the faulty Python version of the program on a scene, and return the trajectory.

        If `both` is not set and the Fortran version is requested, the compiled program runs
        unchanged.
        """
        if self.both or implementation == "python":
            lipschitz, may_stop, _ = options
            found: Trajectory = self.module.run(scene, listing, lipschitz, may_stop)
            return found
        return super()._computed(scene, listing, implementation, *options)


def twin(program: str, name: str, both: bool = True) -> Fault:
    """Return the fault named `name` in the Python version (its twin) of the program `program`.

    Within the context, the program in the registry is a `PlantedTwin`, which the context yields.
    The fault has the key `name` in `TWIN_FAULTS`. If `both`, the faulty twin also runs in place of
    the compiled program.
    """
    fault = TWIN_FAULTS[name]

    @contextmanager
    def planted(size: float) -> Iterator[PlantedTwin]:
        wrong = fault.wrong.replace("SIZE", repr(size)) if size else fault.right
        with tempfile.TemporaryDirectory() as folder:
            module = _altered(program, fault.file, fault.right, wrong, Path(folder))
            known = PROGRAM_REGISTRY[program]
            faulty = PlantedTwin(known.name, known.order, known.source, module, both)
            with patch.dict(PROGRAM_REGISTRY, {program: faulty}):
                yield faulty

    return planted


def _altered(program: str, file: str, right: str, wrong: str, folder: Path) -> ModuleType:
    """Return the twin of a program from a copy of the source of the twins.

    The source is copied into `folder`, and the text `right` in the copy of `file` is replaced by
    `wrong`.
    """
    package = f"planted_{next(_COUNT)}"
    target = folder / package
    ignore = shutil.ignore_patterns("__pycache__")
    assert original.__file__ is not None
    shutil.copytree(Path(original.__file__).parent, target, ignore=ignore)
    for path in target.glob("*.py"):
        text = path.read_text().replace("pyharness.original", package)
        if path.name == file:
            assert text.count(right) == 1, f"{right!r} stands {text.count(right)} times in {file}"
            text = text.replace(right, wrong)
        path.write_text(text)
    sys.path.insert(0, str(folder))
    try:
        importlib.invalidate_caches()
        return importlib.import_module(f"{package}.{program.replace('-', '_')}")
    finally:
        sys.path.remove(str(folder))

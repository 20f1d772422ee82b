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
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY, Program


class TwinFault(NamedTuple):
    """A fault in the Python version (the twin) of programs: a piece of its source, and another.

    The fields are the columns of the table `data/plants.toml`.
    """

    file: str
    right: str
    wrong: str
    size: float
    programs: str
    shows: str


TWIN_FAULTS = {name: TwinFault(*row) for name, *row in facts("plants")["twin"]}
"""The faults of the twins, by name."""

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

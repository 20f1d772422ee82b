"""Python twins with one fault: copies of their source in which one piece of code is changed."""

import importlib
import itertools
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pyharness import original
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY, Program

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


def plant_in_twin(
    program: str, file: str, old: str, new: str, folder: Path, both: bool = True
) -> PlantedTwin:
    """Return the program named `program`, with one fault in its Python version (its twin).

    The source of the twins is copied into `folder`, the text `old` is replaced by `new` in the copy
    of `file`, and the copy is imported. If `both`, the faulty twin also runs in place of the
    compiled program.
    """
    package = f"planted_{next(_COUNT)}"
    target = folder / package
    ignore = shutil.ignore_patterns("__pycache__")
    assert original.__file__ is not None
    shutil.copytree(Path(original.__file__).parent, target, ignore=ignore)
    for path in target.glob("*.py"):
        text = path.read_text().replace("pyharness.original", package)
        if path.name == file:
            assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {file}"
            text = text.replace(old, new)
        path.write_text(text)
    sys.path.insert(0, str(folder))
    try:
        importlib.invalidate_caches()
        module = importlib.import_module(f"{package}.{program.replace('-', '_')}")
    finally:
        sys.path.remove(str(folder))
    known = PROGRAM_REGISTRY[program]
    return PlantedTwin(known.name, known.order, known.source, module, both)

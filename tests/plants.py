"""Plants: the twins with one fault, to see that a check catches it."""

import importlib
import itertools
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pyharness.original.two_term as twin
from pyharness.listing import Listing
from pyharness.methods import PROGRAM_REGISTRY, Program
from pyharness.scene import Scene
from pyharness.trajectory import Trajectory

_COUNT = itertools.count()


@dataclass(frozen=True)
class PlantedTwin(Program):
    """A program that runs a faulty twin, whatever implementation is asked for."""

    module: ModuleType

    def run(
        self,
        scene: Scene,
        listing: Listing,
        implementation: str = "python",
        lipschitz: float = 500.0,
        may_stop: bool = True,
        velocity: bool = True,
    ) -> Trajectory:
        """Run the faulty twin."""
        trajectory: Trajectory = self.module.run(scene, listing, lipschitz, may_stop)
        return trajectory


def plant(program: str, file: str, old: str, new: str, folder: Path) -> PlantedTwin:
    """Copy the twins into `folder`, replace `old` by `new` in one file, import the copy."""
    package = f"planted_{next(_COUNT)}"
    target = folder / package
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(twin.__file__).parent, target, ignore=ignore)
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
    return PlantedTwin(known.name, known.order, known.source, module)

"""Python twins with one fault, made from copies of their sources with one replacement."""

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

from pyharness import thesis
from pyharness.checks.plants.faults import Fault
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import PROGRAM_REGISTRY, Program


class TwinFault(NamedTuple):
    """A fault in a twin, the Python port of a program: a row of `data/plants.toml`."""

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
    """A program with a faulty twin, which also replaces the Fortran program if `both`."""

    module: ModuleType
    both: bool = True

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        if self.both or implementation == "python":
            lipschitz, may_stop, _ = options
            found: Trajectory = self.module.run(scene, listing, lipschitz, may_stop)
            return found
        return super()._computed(scene, listing, implementation, *options)


def twin(program: str, name: str, both: bool = True) -> Fault:
    """Return a fault in a program's twin; its context yields the program."""
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
    """Return a program's twin from a copy of the sources with `right` in `file` replaced."""
    package = f"planted_{next(_COUNT)}"
    target = folder / package
    ignore = shutil.ignore_patterns("__pycache__")
    assert thesis.__file__ is not None
    shutil.copytree(Path(thesis.__file__).parent, target, ignore=ignore)
    for path in target.glob("*.py"):
        text = path.read_text().replace("pyharness.thesis", package)
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

"""Faults of a chosen size, planted in the running process within a context.

A fault replaces a function, or changes its result. A program's Python version (twin) becomes faulty
by one replacement in a copied source.
"""

import importlib
import itertools
import pkgutil
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

from pyharness import thesis
from pyharness.engine.plan.registry import METHODS
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import PROGRAM_REGISTRY, Program

Fault = Callable[[float], AbstractContextManager[Any]]
"""A function of a fault's size that returns a context with this fault.

A fault of size 0 changes no result.
"""

Change = Callable[[Any, float], Any]
"""A function of a right result and a fault's size that returns the wrong result."""

Faulty = Callable[..., Any]
"""A function that replaces a right function.

Its arguments are the size of the fault, the right function, and the arguments of a call.
"""


def instead(target: str, faulty: Faulty) -> Fault:
    """Return a fault that replaces the function `target` (a dotted name) by `faulty`."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = pkgutil.resolve_name(target)
        # A lambda, unlike a partial function, can replace a method.
        return patch(target, lambda *rest, **named: faulty(size, right, *rest, **named))

    return planted


def in_method(name: str, faulty: Faulty) -> Fault:
    """Return a fault that replaces the function `solve` of the method `name`."""
    known = METHODS[name]
    return lambda size: patch.dict(
        METHODS, {name: replace(known, solve=partial(faulty, size, known.solve))}
    )


def changing(change: Change) -> Faulty:
    return lambda size, right, *rest, **named: change(right(*rest, **named), size)


def change_result(target: str, change: Change) -> Fault:
    return instead(target, changing(change))


def change_at(path: str, change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    """Return a function that changes the value at `path`, such as ``scene.run``, of a record."""
    *outer, last = path.split(".")

    def changed(record: dict[str, Any]) -> None:
        for name in outer:
            record = record.get(name) or {}
        if record.get(last):
            record[last] = change(record[last])

    return changed


def change_attribute(name: str, change: Change) -> Change:
    def changed(found: Any, size: float) -> Any:
        value = getattr(found, name)
        return found if value is None else replace(found, **{name: change(value, size)})

    return changed


class TwinFault(NamedTuple):
    """An entry of `data/plants.toml`: `wrong` replaces `right` in a `file` of the twins."""

    file: str
    right: str
    wrong: str
    size: float
    programs: str
    shows: str


TWIN_FAULTS = {name: TwinFault(*row) for name, *row in facts("plants")["twin"]}
"""Faults of the twins by name."""

_COUNT = itertools.count()


@dataclass(frozen=True)
class PlantedTwin(Program):
    """A program with a faulty Python version, which replaces Fortran too if `both`."""

    module: ModuleType
    both: bool = True

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        found: Trajectory
        if self.both or implementation == "python":
            found = self.module.run(scene, listing, *options[:2])
        else:
            found = super()._computed(scene, listing, implementation, *options)
        return found


def twin(program: str, name: str, both: bool = True) -> Fault:
    """Return the fault `name` of a program's twin and, if `both`, of its Fortran version."""
    fault = TWIN_FAULTS[name]

    @contextmanager
    def planted(size: float) -> Iterator[PlantedTwin]:
        right, package = fault.right, f"planted_{next(_COUNT)}"
        wrong = fault.wrong.replace("SIZE", repr(size)) if size else right
        assert thesis.__file__ is not None
        with tempfile.TemporaryDirectory() as folder:
            target, ignore = Path(folder) / package, shutil.ignore_patterns("__pycache__")
            shutil.copytree(Path(thesis.__file__).parent, target, ignore=ignore)
            for path in target.glob("*.py"):
                text = path.read_text().replace("pyharness.thesis", package)
                if path.name == fault.file:
                    times = text.count(right)
                    assert times == 1, f"{right!r} stands {times} times in {fault.file}"
                    text = text.replace(right, wrong)
                path.write_text(text)
            with patch.object(sys, "path", [folder, *sys.path]):
                importlib.invalidate_caches()
                module = importlib.import_module(f"{package}.{program.replace('-', '_')}")
            known = PROGRAM_REGISTRY[program]
            faulty = PlantedTwin(known.name, known.order, known.source, module, both)
            with patch.dict(PROGRAM_REGISTRY, {program: faulty}):
                yield faulty

    return planted

"""Three 1982 FORTRAN programs for Euler's rigid body equations: as punched, mended, checked."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyharness.errors import InputError, NotBuiltError
    from pyharness.listing import Listing, subset
    from pyharness.scene import Scene, TorqueLaw
    from pyharness.scene_file import case_scene, read_scene
    from pyharness.solver import Solver, prepare, solve
    from pyharness.trajectory import Stop, Trajectory

    __version__: str
    # What the build makes.
    _build: Any
    _kernels: Any

__all__ = [
    "InputError",
    "Listing",
    "NotBuiltError",
    "Scene",
    "Solver",
    "Stop",
    "TorqueLaw",
    "Trajectory",
    "case_scene",
    "prepare",
    "read_scene",
    "solve",
    "subset",
]

# Names load their room when they are first asked for: a program that needs one pays for one.
_ROOMS = {
    "errors": ("InputError", "NotBuiltError"),
    "listing": ("Listing", "subset"),
    "solver": ("Solver", "prepare", "solve"),
    "scene": ("Scene", "TorqueLaw"),
    "scene_file": ("case_scene", "read_scene"),
    "trajectory": ("Stop", "Trajectory"),
}


# For a type checker the imports above say it all: with this, any name would be one.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        for room, names in _ROOMS.items():
            if name in names:
                return getattr(import_module(f"pyharness.{room}"), name)
        if name == "__version__":
            from importlib.metadata import version

            return version("pyharness")
        raise AttributeError(f"module 'pyharness' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

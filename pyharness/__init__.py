"""Three FORTRAN programs of 1982 for rotating rigid bodies, their corrections, and fast solvers.

The programs are from a thesis. The package has them as printed and as corrected, checks their
results, and solves Euler's equations by other methods.
"""

# Type checkers assume that this name is true. Nothing is imported here, because Ctrl-C is not yet
# handled while a command imports the package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from pyharness import events as events
    from pyharness import torques as torques
    from pyharness.checks.compare.comparison import Comparison, compare_programs
    from pyharness.checks.compare.method_comparison import compare_methods
    from pyharness.engine.compiled_call import get_include
    from pyharness.engine.many import solve_many
    from pyharness.engine.prepared import prepare
    from pyharness.engine.scene_reader import read_scene
    from pyharness.engine.solve import solve
    from pyharness.engine.solver import Solver
    from pyharness.engine.stepper import Stepper
    from pyharness.engine.taylor_ivp import Taylor
    from pyharness.engine.trajectory_reader import load
    from pyharness.model.batch_result import Ensemble
    from pyharness.model.changing import ChangingInertia, ChangingMoments
    from pyharness.model.dense_output import DenseOutput
    from pyharness.model.errors import InputError, NotBuiltError
    from pyharness.model.listing import Listing, subset
    from pyharness.model.principal import principal
    from pyharness.model.scene import ImpossibleBodyWarning, Scene
    from pyharness.model.scene_file import case_scene
    from pyharness.model.state_torque import StateTorque, opaque
    from pyharness.model.torque_law import TorqueLaw
    from pyharness.model.trajectory import Stop, Trajectory
    from pyharness.thesis.many import ProgramEnsemble, run_many
    from pyharness.thesis.programs import run_program

    __version__: str
    # Modules that the build generates.
    _build: Any
    _kernels: Any

__all__ = [
    "ChangingInertia",
    "ChangingMoments",
    "Comparison",
    "DenseOutput",
    "Ensemble",
    "ImpossibleBodyWarning",
    "InputError",
    "Listing",
    "NotBuiltError",
    "ProgramEnsemble",
    "Scene",
    "Solver",
    "StateTorque",
    "Stepper",
    "Stop",
    "Taylor",
    "TorqueLaw",
    "Trajectory",
    "case_scene",
    "compare_methods",
    "compare_programs",
    "get_include",
    "load",
    "opaque",
    "prepare",
    "principal",
    "read_scene",
    "run_many",
    "run_program",
    "solve",
    "solve_many",
    "subset",
]

# The public names by module. Modules are imported at their first use, so that a program loads only
# those that it needs.
_SUBMODULES = {
    "checks.compare.comparison": ("Comparison", "compare_programs"),
    "checks.compare.method_comparison": ("compare_methods",),
    "engine.scene_reader": ("read_scene",),
    "engine.trajectory_reader": ("load",),
    "model.changing": ("ChangingInertia", "ChangingMoments"),
    "model.dense_output": ("DenseOutput",),
    "model.errors": ("InputError", "NotBuiltError"),
    "model.listing": ("Listing", "subset"),
    "model.principal": ("principal",),
    "model.scene": ("ImpossibleBodyWarning", "Scene"),
    "model.scene_file": ("case_scene",),
    "model.state_torque": ("StateTorque", "opaque"),
    "model.torque_law": ("TorqueLaw",),
    "model.trajectory": ("Stop", "Trajectory"),
    "thesis.many": ("ProgramEnsemble", "run_many"),
    "thesis.programs": ("run_program",),
    "engine.many": ("solve_many",),
    "model.batch_result": ("Ensemble",),
    "engine.prepared": ("prepare",),
    "engine.compiled_call": ("get_include",),
    "engine.solver": ("Solver",),
    "engine.stepper": ("Stepper",),
    "engine.taylor_ivp": ("Taylor",),
    "engine.solve": ("solve",),
}
# Public modules, also imported at their first use.
_MODULES = ("events", "torques")


# Type checkers read the imports above; with this function they would accept any attribute.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        from importlib import import_module

        for room, names in _SUBMODULES.items():
            if name in names:
                return getattr(import_module(f"pyharness.{room}"), name)
        if name in _MODULES:
            return import_module(f"pyharness.{name}")
        if name == "__version__":
            from pyharness.model.distribution import version

            return version()
        raise AttributeError(f"module 'pyharness' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, *_MODULES, "__version__"])

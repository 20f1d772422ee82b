"""Rigid-body rotation: a fast engine, checks, and three FORTRAN programs of a thesis.

The engine integrates the motion and estimates the error of each result. The thesis programs (1982)
run as printed or as corrected. The checks also test ports (translations) of these programs, and
other integrators.
"""

# The public names by module; type checkers read `__init__.pyi`. A module is imported at its first
# use, so that a program loads only what it needs.
_SUBMODULES = {
    "checks.compare.comparison": ("compare_methods", "compare_programs"),
    "checks.compare.findings": ("Comparison",),
    "engine.torques.scene_reader": ("read_scene",),
    "engine.torques.table_terms": ("inertia_table",),
    "engine.torques.trajectory_reader": ("load",),
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
    "model.ensemble": ("Ensemble",),
    "engine.many.many": ("solve_many",),
    "engine.prepared.compiled_call": ("get_include",),
    "engine.prepared.solver": ("Solver", "prepare"),
    "engine.steps.stepper": ("Stepper",),
    "engine.steps.taylor_ivp": ("Taylor",),
    "engine.solve": ("solve",),
}
# Public modules, imported likewise.
_MODULES = ("events", "torques")
# `from pyharness import *` leaves out Taylor, whose base class is in SciPy.
__all__ = sorted({name for names in _SUBMODULES.values() for name in names} - {"Taylor"})


def __getattr__(name: str) -> object:
    from importlib import import_module

    for module, names in _SUBMODULES.items():
        if name in names:
            return getattr(import_module(f"pyharness.{module}"), name)
    if name in _MODULES:
        return import_module(f"pyharness.{name}")
    if name == "__version__":
        from pyharness.model.distribution import version

        return version()
    raise AttributeError(f"module 'pyharness' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, "Taylor", *_MODULES, "__version__"])

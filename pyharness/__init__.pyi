# What type checkers see of `__init__.py`, which imports these names at their first use.
from typing import Any

from pyharness import events as events
from pyharness import torques as torques
from pyharness.checks.compare.comparison import compare_methods as compare_methods
from pyharness.checks.compare.comparison import compare_programs as compare_programs
from pyharness.checks.compare.findings import Comparison as Comparison
from pyharness.engine.many.many import solve_many as solve_many
from pyharness.engine.prepared.compiled_call import get_include as get_include
from pyharness.engine.prepared.solver import Solver as Solver
from pyharness.engine.prepared.solver import prepare as prepare
from pyharness.engine.solve import solve as solve
from pyharness.engine.steps.stepper import Stepper as Stepper
from pyharness.engine.steps.taylor_ivp import Taylor as Taylor
from pyharness.engine.torques.scene_reader import read_scene as read_scene
from pyharness.engine.torques.table_terms import inertia_table as inertia_table
from pyharness.engine.torques.trajectory_reader import load as load
from pyharness.model.changing import ChangingInertia as ChangingInertia
from pyharness.model.changing import ChangingMoments as ChangingMoments
from pyharness.model.dense_output import DenseOutput as DenseOutput
from pyharness.model.ensemble import Ensemble as Ensemble
from pyharness.model.errors import InputError as InputError
from pyharness.model.errors import NotBuiltError as NotBuiltError
from pyharness.model.listing import Listing as Listing
from pyharness.model.listing import subset as subset
from pyharness.model.principal import principal as principal
from pyharness.model.scene import ImpossibleBodyWarning as ImpossibleBodyWarning
from pyharness.model.scene import Scene as Scene
from pyharness.model.scene_file import case_scene as case_scene
from pyharness.model.state_torque import StateTorque as StateTorque
from pyharness.model.state_torque import opaque as opaque
from pyharness.model.torque_law import TorqueLaw as TorqueLaw
from pyharness.model.trajectory import Stop as Stop
from pyharness.model.trajectory import Trajectory as Trajectory
from pyharness.thesis.many import ProgramEnsemble as ProgramEnsemble
from pyharness.thesis.many import run_many as run_many
from pyharness.thesis.programs import run_program as run_program

__all__: list[str]
__version__: str
# Modules that the build generates.
_build: Any
_kernels: Any

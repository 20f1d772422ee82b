"""Scenes of a load solved one after the other: for methods that take no arrays."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness.ensembles.batches import Load
from pyharness.methods.registry import METHODS
from pyharness.methods.solve import solve
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, Array
from pyharness.original.programs import run_program

STATUSES = {
    "complete": Statuses.COMPLETE,
    "stopped": Statuses.STOPPED,
    "overflow": Statuses.OVERFLOW,
    "refused": Statuses.REFUSED,
    "gave up": Statuses.GAVE_UP,
    "sensitive": Statuses.SENSITIVE,
}


class Ends(NamedTuple):
    """The angular velocity at the end of each scene, (n, 3), and its status, (n,)."""

    omega: Array
    status: NDArray[np.int8]


class ProgramRows(NamedTuple):
    """What programs made of n scenes: omega (n, k, 3) at k steps, NaN where not reached."""

    omega: Array
    n_rows: NDArray[np.int32]
    status: NDArray[np.int8]
    stop_variable: NDArray[np.int8]


def solve_each(load: Load, method: str, tolerance: float, t_end: Array, omega0: Array) -> Ends:
    """Return the ends by a method, one scene after the other."""
    ends = np.full((len(omega0), 3), np.nan)
    status = np.full(len(omega0), Statuses.REFUSED, dtype=np.int8)
    for i, scene in enumerate(_scenes(load, omega0)):
        if scene is None:
            continue
        try:
            found = solve(scene, float(t_end[i]), method, max(tolerance, METHODS[method].finest))
        except InputError:
            continue
        status[i] = STATUSES[found.ended]
        if found.has_all_rows:
            ends[i] = found.omega[-1]
    return Ends(ends, status)


def run_each(load: Load, omega0: Array, at: list[int]) -> ProgramRows:
    """Return the rows of a program at steps, one scene after the other."""
    n = len(omega0)
    omega = np.full((n, len(at), 3), np.nan)
    n_rows, status = np.zeros(n, np.int32), np.full(n, Statuses.REFUSED, np.int8)
    variable = np.zeros(n, np.int8)
    assert load.listing is not None
    for i, scene in enumerate(_scenes(load, omega0)):
        if scene is None:
            continue
        found = run_program(
            scene,
            load.listing,
            lipschitz=load.solver.lipschitz if load.lipschitz is None else load.lipschitz[i],
            may_stop=load.solver.may_stop,
            velocity=False,
        )
        n_rows[i], status[i] = len(found.time), STATUSES[found.ended]
        if found.stop is not None:
            variable[i] = 1 + STOP_VARIABLES.index(found.stop.variable)
        reached = [k for k, step in enumerate(at) if step <= n_rows[i]]
        omega[i, reached] = found.omega[[at[k] - 1 for k in reached]]
    return ProgramRows(omega, n_rows, status, variable)


def _scenes(load: Load, omega0: Array) -> Iterator[Scene | None]:
    """Yield the scenes, None where there is no such."""
    torque = load.scene.torque
    for i, start in enumerate(omega0):
        law = torque
        try:
            if load.torque_constant is not None:
                law = replace(law, constant=load.torque_constant[i])
            if load.torque_rate is not None:
                law = replace(law, rate=load.torque_rate[i])
            scene = replace(load.scene, omega=start, torque=law, attitude=None)
            if load.step_size is not None:
                scene = replace(scene, step_size=load.step_size[i])
            if load.moments is not None:
                scene = replace(scene, moments=load.moments[i])
            if load.coefficients is not None:
                scene = replace(scene, coefficients=load.coefficients[i])
            yield scene
        except InputError:
            yield None

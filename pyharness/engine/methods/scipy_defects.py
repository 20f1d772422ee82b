"""The check of solutions under stiff recorded torques, whose Taylor series needs too many steps.

SciPy may step over a short change of the torque. The defect of its dense output, f(t, y) - y', then
is large there. In a step h, it changes y by about (1/h - J)^-1 times the defect, with the Jacobian
J: by h times the defect if the equations are not stiff, and by J^-1 times it if they are.
"""

from typing import Any

import numpy as np

from pyharness.engine.methods.scipy_state_run import StateRows, StateRun
from pyharness.engine.system.recorded import outputs_at, system_of
from pyharness.model.array_type import Array
from pyharness.model.scene import Scene
from pyharness.model.tape import Tape

_TIMES = 20_000  # as many as the series may have steps
_MOVED = 1e-7  # difference of a state in quotients, relative to its size
_BESIDE = 1e-4  # difference of times in quotients, relative to the step
# Largest change by a defect, in tolerances; interpolants are less accurate than steps.
_ALLOWED = 10.0


def has_small_defects(run: StateRun, scene: Scene, found: StateRows, tolerance: float) -> bool:
    """Return whether defects at some 20 000 times change the state by less than the tolerance."""
    if not (found.is_complete and found.solutions):
        return False
    system, sizes = system_of(scene), np.ones(len(run.start))
    sizes[:3] = found.largest or 1.0
    for sol in found.solutions:
        count = int(_TIMES * abs((sol.ts[-1] - sol.ts[0]) * run.unit / run.end)) + 2
        shares = np.random.default_rng(count).uniform(0.01, 0.99, count)
        times = sol.ts[0] + (np.arange(count) + shares) * ((sol.ts[-1] - sol.ts[0]) / count)
        change = _changes(system, sol, times, run.unit, sizes) / sizes
        # Also false for NaN.
        if not np.abs(change).max() <= _ALLOWED * tolerance:
            return False
    return True


def _changes(system: Tape, sol: Any, times: Array, unit: float, sizes: Array) -> Array:
    """Return the changes of n states by defects at `times` (in `unit` s), shape (n, m)."""
    order = np.searchsorted(np.abs(sol.ts), np.abs(times)).clip(1, len(sol.ts) - 1)
    steps = np.diff(sol.ts)[order - 1]
    beside = _BESIDE * steps
    after, before = sol(times + beside).T, sol(times - beside).T
    states, m = sol(times).T, len(sizes)
    slopes = (after - before) / (2.0 * unit * beside[:, None])
    rates = outputs_at(system, unit * times, states)
    jacobian = np.empty((len(times), m, m))
    for k, size in enumerate(_MOVED * sizes):
        moved = states.copy()
        moved[:, k] += size
        jacobian[:, :, k] = (outputs_at(system, unit * times, moved) - rates) / size
    matrix = np.eye(m) / (unit * steps)[:, None, None] - jacobian
    found: Array = np.linalg.solve(matrix, (rates - slopes)[:, :, None])[:, :, 0]
    return found

"""The single-step methods of section III.2 of the thesis, with a fixed step."""

from collections.abc import Sequence

import numpy as np

from pyharness.engine.problem import normalized, trajectory_of
from pyharness.model.codes import Methods
from pyharness.model.effort import Integrator, advice
from pyharness.model.errors import TimedError
from pyharness.model.extension import GAVE_UP, REFUSED, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory


def fixed_step(name: str) -> Integrator:
    """Return the solver named ``improved-euler``, ``taylor-3`` or ``rk4``, without error control.

    A step that would pass a requested time is shortened to end there.
    """
    number = getattr(Methods, name.upper().replace("-", "_"))

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        work = np.array([effort, 0.0])
        rows, n_rows, status, steps, evaluations = extension().fixed_step_solution(
            scene.euler_coefficients, *normalized(scene)[1:], scene.omega, times, number,
            scene.step_size, effort=work,
        )  # fmt: skip
        if status == REFUSED:
            raise NotImplementedError(f"{name} has no kernel in fortran/modern/fixed_step.f90")
        if status == GAVE_UP:
            raise TimedError(
                f"{name}: {abs(times[-1]) / scene.step_size:.3g} steps of {{time}} s would "
                "take too long; " + advice("use a larger step or a shorter time", effort, work[1]),
                scene.step_size,
            )
        return trajectory_of(times, rows, n_rows, status, steps, evaluations)

    return solve

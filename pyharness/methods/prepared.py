"""Solvers: prepared once, called in a loop at little more than the cost of the kernel itself.

`prepare` validates the scene, decides what it needs (`plan`) and packs it; a call then looks at
three arguments and enters the kernel.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, overload

from pyharness.methods.plan import plan
from pyharness.methods.registry import check_torque, requested_tolerance
from pyharness.methods.solver import PREPARED, Solver
from pyharness.model.effort import checked_effort
from pyharness.model.errors import unknown
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.values import Number
from pyharness.model.waves import with_merged_waves

if TYPE_CHECKING:
    from pyharness.methods.prepared_attitude import AttitudeSolver


@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    effort: float = ...,
    attitude: Literal[False] = ...,
) -> Solver: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    effort: float = ...,
    *,
    attitude: Literal[True],
) -> "AttitudeSolver": ...
def prepare(
    scene: Scene,
    method: str = "auto",
    tolerance: Number | None = None,
    effort: float = 1.0,
    attitude: bool = False,
) -> "Solver | AttitudeSolver":
    """Prepare a solver of a scene.

    Parameters
    ----------
    scene : Scene
        Its step size is that of the methods with a fixed step. One with a full inertia matrix is
        solved about principal axes; its calls cost some microseconds more.
    method : str
        A name in `PREPARED`; `auto` takes the fastest that meets the tolerance.
    tolerance : float
        Largest error of any component at the end, relative to the largest |omega| until then; by
        default the method's own, as in `solve`. Methods with a fixed step ignore it. Where the
        motion amplifies perturbations K times, no method has an error below some 1e-15 K.
    effort : float
        Factor on the work of a call, beyond which its status is `gave up`: 1 is some ten seconds.
    attitude : bool
        Whether calls give the attitude too; a torque about the axes of space needs it.

    Raises
    ------
    InputError
        For an unknown method, one that can't take the scene or carry its attitude, or a tolerance
        or an effort out of range.
    NotBuiltError
        Where the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(2), tolerance=1e-12)
    >>> np.round(solver(np.array([0.0, 1.0, 10.0]), 1.0), 6) + 0.0
    array([-0.958924,  0.283662, 10.      ])
    """
    checked_scene(scene, any_axes=True, any_torque=True)
    if not isinstance(method, str) or method not in PREPARED:
        raise unknown("method", method, PREPARED)
    tolerance = requested_tolerance(method, tolerance)
    effort = checked_effort(effort)
    check_torque(scene, method, attitude)
    if scene.inertia is not None:
        from pyharness.methods.prepared_inertia import prepared_inertia, prepared_inertia_attitude

        prepared = prepared_inertia_attitude if attitude else prepared_inertia
        return prepared(scene, method, tolerance, effort)
    scene = with_merged_waves(scene)
    if attitude:
        from pyharness.methods.prepared_attitude import prepared_attitude

        return prepared_attitude(scene, method, tolerance, effort)
    # Who does not ask for it pays nothing.
    scene = replace(scene, attitude=None)
    return Solver(plan(scene, method, tolerance), tolerance, method, effort)

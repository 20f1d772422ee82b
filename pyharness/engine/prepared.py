"""Preparation of solvers for many calls with one scene."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, overload

from pyharness.engine.plan import plan
from pyharness.engine.registry import check_prepared, check_torque, requested_tolerance
from pyharness.engine.solver import PREPARED, Solver
from pyharness.model.effort import checked_effort
from pyharness.model.errors import unknown
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.values import Number, boolean
from pyharness.model.waves import with_merged_waves

if TYPE_CHECKING:
    from pyharness.engine.prepared_attitude import AttitudeSolver


@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[False] = ...,
) -> Solver: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[True],
) -> "AttitudeSolver": ...
def prepare(
    scene: Scene,
    method: str = "auto",
    tolerance: Number | None = None,
    *,
    effort: float = 1.0,
    attitude: bool = False,
) -> "Solver | AttitudeSolver":
    """Prepare a solver for many calls with the same scene.

    Parameters
    ----------
    scene : Scene
        The scene. With a full inertia matrix, a call takes some microseconds more.
    method : str
        A name in `pyharness.engine.solver.PREPARED`; `auto` selects the fastest.
    tolerance : float
        Largest allowed error of a component of omega, relative to the largest |omega| from 0 to the
        end, by default as in `solve`. It does not affect the error of fixed steps and Gauss
        collocation. If the motion amplifies perturbations by a factor K, no method has a relative
        error below some 1e-15 K.
    effort : float
        Factor on the work limit of a call, some ten seconds, beyond which the status is `gave up`.
    attitude : bool
        Whether calls return the attitude too, as in `solve`.

    Returns
    -------
    Solver or AttitudeSolver
        A callable. ``solver(omega0, t_end)`` returns omega (rad/s), shape (3,), at `t_end` (s).
        With `attitude` it also returns a quaternion from body to space, scalar first, shape (4,).
        Under a torque that depends on the state, an initial omega above 2**300 or below 2**-300
        rad/s is `refused`; `solve` accepts it.

    Raises
    ------
    InputError
        If the method is unknown, or can't solve the scene or its attitude; if the torque needs the
        attitude, and `attitude` is false; or if the tolerance or effort is out of range. A call
        raises InputError if a changing moment reaches 0 before `t_end`.
    NotBuiltError
        If the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, prepare
    >>> solver = prepare(case_scene(2), tolerance=1e-12)
    >>> np.round(solver(np.array([0.0, 1.0, 10.0]), 1.0), 6) + 0.0
    array([-0.958924,  0.283662, 10.      ])
    """
    checked_scene(scene, any_axes=True, any_torque=True, any_state=True, changing=True)
    attitude = boolean("attitude", attitude)
    if not isinstance(method, str) or method not in PREPARED:
        raise unknown("method", method, PREPARED)
    tolerance = requested_tolerance(method, tolerance)
    effort = checked_effort(effort)
    check_torque(scene, method, attitude)
    check_prepared(scene, method)
    if scene.changing is not None:
        from pyharness.engine.prepared_changing import prepared_changing

        return prepared_changing(scene, method, tolerance, effort, attitude)
    if scene.inertia is not None:
        from pyharness.engine.prepared_inertia import prepared_inertia, prepared_inertia_attitude

        prepared = prepared_inertia_attitude if attitude else prepared_inertia
        return prepared(scene, method, tolerance, effort)
    scene = with_merged_waves(scene)
    if attitude:
        from pyharness.engine.prepared_attitude import prepared_attitude

        return prepared_attitude(scene, method, tolerance, effort)
    # An attitude that was not requested is not computed.
    scene = replace(scene, attitude=None)
    return Solver(plan(scene, method, tolerance), tolerance, method, effort)

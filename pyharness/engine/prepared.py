"""Preparation of solvers for many calls with one scene."""

from dataclasses import replace
from typing import Any, Literal, overload

from pyharness.engine.plan import plan
from pyharness.engine.registry import (
    check_attitude,
    check_prepared,
    check_torque,
    requested_tolerance,
)
from pyharness.engine.solver import PREPARED, Solver
from pyharness.model.attitude import IDENTITY
from pyharness.model.effort import checked_effort
from pyharness.model.errors import known
from pyharness.model.keywords import with_hints
from pyharness.model.principal import principal
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, boolean
from pyharness.model.waves import with_merged_waves


@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[False] = ...,
) -> Solver[Array]: ...
@overload
def prepare(
    scene: Scene,
    method: str = ...,
    tolerance: Number | None = ...,
    *,
    effort: float = ...,
    attitude: Literal[True],
) -> Solver[tuple[Array, Array]]: ...
@with_hints
def prepare(
    scene: Scene,
    method: str = "auto",
    tolerance: Number | None = None,
    *,
    effort: float = 1.0,
    attitude: bool = False,
) -> Solver[Any]:
    """Prepare a solver for many calls with the same scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    method : str
        A name in `pyharness.engine.solver.PREPARED`; `auto` selects the fastest.
    tolerance : float
        Largest allowed error of a component of omega, relative to the largest |omega| from 0 to the
        end, by default as in `solve`. It does not affect the error of fixed steps and Gauss
        collocation. If the motion amplifies perturbations by a factor K, no method has a relative
        error below some 1e-15 K.
    effort : float
        Factor on the work limit of a call (some ten seconds); beyond it the status is `gave up`.
    attitude : bool
        Whether calls return the attitude too, as in `solve`.

    Returns
    -------
    Solver
        A callable. ``solver(omega, t_end)`` returns omega (rad/s), shape (3,), at `t_end` (s).
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
    method = known("method", method, PREPARED)
    tolerance = requested_tolerance(method, tolerance)
    effort = checked_effort(effort)
    check_prepared(scene, method)
    check_torque(scene, method, attitude)
    # An attitude that was not requested is not computed, unless the torque needs it.
    own = scene.attitude or IDENTITY if attitude else None
    about_principal, _ = principal(replace(scene, attitude=own))
    if attitude:
        check_attitude(method)
    else:
        about_principal = replace(about_principal, attitude=None)
    chosen = plan(with_merged_waves(about_principal), method, tolerance, rows=attitude)
    return Solver(scene, chosen, tolerance, method, effort, attitude)

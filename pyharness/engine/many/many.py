"""Solution of many bodies in one call, side by side in the kernel and in threads.

The result of a body is bit for bit independent of other bodies, their order and the threads.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.engine.many.many_details import prepare_details
from pyharness.engine.many.many_law_scenes import choose_kernel, solve_laws
from pyharness.engine.many.many_mistakes import reasons_of
from pyharness.engine.many.many_recorded import NO_ATTITUDE, needs_equations, solve_recorded
from pyharness.engine.many.many_start_times import solve_many_from_zero, starts_later
from pyharness.engine.plan.registry import PREPARED
from pyharness.engine.prepared.many_scenes import (
    BODIES,
    ONES,
    PARAMETER,
    TORQUES,
    check_alike,
    rows_of_alike,
)
from pyharness.engine.solve import ascending_times
from pyharness.engine.system.parameters import check_values
from pyharness.model.arrays import check_rows, only_one, rows_of, spread
from pyharness.model.attitude import scalar_first
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError, kind_of, known
from pyharness.model.keywords import with_hints
from pyharness.model.principal import PrincipalScene, in_double
from pyharness.model.progress import bar_of_bodies, expect_bodies
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.model.values import Number, Numbers, boolean, checked_effort, number_list

# Kinds of scenes under torque laws: about principal axes, and with an inertia matrix.
_LAWS = _PLAIN, _TILTED = -2, -1
_NO_DETAILS: dict[str, Any] = dict.fromkeys(("t_events", "y_events", "sensitivities"))


@with_hints
def solve_many(
    scene: Scene | Sequence[Scene],
    t_end: Any = None,
    *,
    times: Numbers | None = None,
    omega: Any = None,
    attitude: Any = None,
    moments: Any = None,
    coefficients: Any = None,
    inertia: Any = None,
    torque_constant: Any = None,
    torque_rate: Any = None,
    sines: Any = None,
    cosines: Any = None,
    parameters: Mapping[str, Any] | None = None,
    states: Mapping[str, Any] | None = None,
    method: str = "auto",
    tolerance: Number | None = None,
    step: Number | None = None,
    effort: float = 1.0,
    estimates: bool = False,
    compiled: bool = False,
    events: object = None,
    sensitivities: Iterable[str] | None = None,
    threads: int = 1,
    out: "Ensemble | Array | None" = None,
    progress: bool = False,
) -> Ensemble:
    """Solve many scenes in one call, each to its own final time.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        One scene, whose values apply where no array is given; or a scene for each body, without
        arrays.
    t_end : float, or array of shape (n,)
        Final times, s; positive, negative or 0.
    times : float or iterable of float, shape (m,)
        Strictly monotonic times (s) of the results for all bodies, instead of `t_end`. The arrays
        of the result then have a second axis, of length m.
    omega : array, shape (n, 3) or (3,)
        Initial angular velocities, rad/s. A single row, here and below, applies to all bodies.
    attitude : array, shape (n, 4) or (4,), or scipy.spatial.transform.Rotation
        Quaternions at time 0, from body to space, scalar first. The default is the scene's
        attitude; without one, no attitudes are returned.
    moments, coefficients : array, shape (n, 3) or (3,)
        Principal moments (kg m2), or the coefficients A, B, C of Euler's equations; not both.
    inertia : array, shape (n, 3, 3) or (3, 3)
        Inertia matrices (kg m2), instead of moments, about the same body axes as all vectors and
        attitudes.
    torque_constant, torque_rate : array, shape (n, 3) or (3,)
        Constant parts of the torques (N m), and their rates of change (N m/s). For bodies given by
        coefficients, these are torques over moments (rad/s2, rad/s3).
    sines, cosines : array, shape (n, k, 4) or (k, 4)
        The k waves of each torque, sines or cosines of time: three amplitudes (in the unit of
        `torque_constant`) and a frequency (rad/s).
    parameters : dict of arrays, shape (n,), or of float
        Values of keyword arguments of the torque's function, or of constants of its expressions, by
        name.
    states : dict of arrays, shape (n,), or of float
        Initial values of the scene's own states (`Scene.states`), by name; the default is the
        scene's values. With own states, `compiled`, `events`, `sensitivities` and
        `out` are refused.
    method : str
        A name in `pyharness.engine.prepared.solver.PREPARED`. `auto` uses a closed form if there
        is one, else the Taylor series.
    tolerance : float
        Largest allowed error: for a component of omega, relative to the largest |omega| from time 0
        to the end; for the attitude, an angle (rad). The default depends on the method.
    step : float, optional
        Step size of Gauss collocation and fixed-step methods, s; by default the scene's.
    effort : float
        Factor on the work limit of a body; beyond it the status is `gave up`.
    estimates : bool
        Whether to return estimated errors and error amplifications.
    compiled : bool
        Whether a C compiler translates a torque that depends on the state, as in `prepare`, for
        bodies solved side by side. `Ensemble.leaves` says whether it did.
    events : callable, Event, or list of these
        Functions whose roots are computed, as in `solve`; none may be terminal. The method must be
        `auto`, `taylor` or `closed-form`.
    sensitivities : iterable of str
        Names of parameters, as in `solve`, with respect to which the final states are
        differentiated; the methods are as for `events`.
    threads : int
        Number of threads.
    out : Ensemble, or array of shape (n, 3), optional
        An earlier result for n bodies, or an array for omega, to be overwritten; not with `times`.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    Ensemble
        The states at the final times or at `times`. For a body that can't be solved they are NaN,
        and its status has the reason.

    Raises
    ------
    InputError
        If the arrays differ in their numbers of rows, the method can't solve the bodies, the
        tolerance or effort is out of range, events or sensitivities can't be computed, or not
        exactly one of `t_end` and `times` is given.
    NotBuiltError
        If the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, solve_many
    >>> starts = np.array([[0.0, 1.0, 10.0], [0.0, 2.0, 5.0]])
    >>> np.round(solve_many(case_scene(2), 1.0, omega=starts).omega, 6) + 0.0
    array([[-0.958924,  0.283662, 10.      ],
           [ 1.196944, -1.602287,  5.      ]])
    """
    arrays = {
        "omega": omega, "attitude": scalar_first(attitude), "moments": moments,
        "coefficients": coefficients, "inertia": inertia, "torque_constant": torque_constant,
        "torque_rate": torque_rate, "sines": sines, "cosines": cosines,
    }  # fmt: skip
    details = None
    method = known("method", method, PREPARED)
    if not isinstance(scene, Scene):
        scenes: Any = number_list("scene", scene, "allowed: a Scene, or a list of scenes")
        scene = list(scenes)
    if starts_later(scene):
        again = partial(
            solve_many, **arrays, parameters=parameters, states=states, method=method,
            tolerance=tolerance, step=step, effort=effort, estimates=estimates, compiled=compiled,
            sensitivities=sensitivities, threads=threads, out=out, progress=progress,
        )  # fmt: skip
        return solve_many_from_zero(scene, t_end, times, events, again)
    if not only_one({"t_end": t_end, "times": times}):
        raise InputError("neither t_end nor times is given; give one of them")
    rows = None
    if times is not None:
        if out is not None:
            raise InputError("out is given beside times; allowed: only one of the two")
        values, turned = ascending_times(times)
        rows = np.array(values[::-1] if turned else values)
    if parameters is not None:
        if not isinstance(scene, Scene):
            raise InputError("parameters: given beside many scenes; allowed: with one scene")
        if not isinstance(parameters, Mapping):
            found = kind_of(parameters)
            raise InputError(f"parameters: {found}; allowed: a dict of names and arrays")
        check_values(scene, parameters)
        # A torque that depends on time alone is a law without parameter names.
        if (named := getattr(scene.torque, "named", None)) is not None:
            scene = replace(scene, torque=named)
        arrays |= {f"{PARAMETER}{name}": value for name, value in parameters.items()}
    settings: Any = {"method": method, "tolerance": tolerance, "effort": effort}
    compiled = boolean("compiled", compiled)
    if isinstance(scene, Scene) and scene.states:
        refused = {"events": events, "sensitivities": sensitivities, "out": out}
        refused["compiled"] = compiled or None
        for name, value in refused.items():
            if value is not None:
                raise InputError(f"{name}: the scene has states of its own; allowed: solve")
    elif states is not None:
        raise InputError("states: the scene has no states of its own; allowed: a scene with some")
    if scene and (events is not None or sensitivities is not None):
        details = prepare_details(
            scene, t_end if rows is None else rows, arrays, events=events,
            sensitivities=sensitivities, has_rows=rows is not None, **settings,
        )  # fmt: skip
    settings |= {"estimates": boolean("estimates", estimates), "compiled": compiled}
    with bar_of_bodies(boolean("progress", progress)):
        solved = _solve(scene, t_end, rows, arrays, states, out, step, threads=threads, **settings)
    if rows is None:
        ends = np.broadcast_to(rows_of("t_end", t_end), len(solved.omega))
        object.__setattr__(solved, "t_end", ends)  # `out` remains the same object
    reasons = reasons_of(solved, scene, arrays, states, t_end, method)
    if details is None:
        # `out` may have the details of an earlier call.
        no_details = {**_NO_DETAILS, "refusals": reasons}
        is_new = any(getattr(solved, name) != value for name, value in no_details.items())
        return replace(solved, **no_details) if is_new else solved
    with bar_of_bodies(progress):
        found = details(solved)
    return replace(found, refusals={**(reasons or {}), **(found.refusals or {})})


def _solve(
    scene: Scene | Sequence[Scene], t_end: Any, times: Array | None, arrays: dict[str, Any],
    states: object, out: "Ensemble | Array | None", step: Number | None, **settings: Any,
) -> Ensemble:  # fmt: skip
    own = {name: value for name, value in arrays.items() if value is not None}
    if isinstance(scene, Scene):
        if only_one({name: own[name] for name in BODIES if name in own}):
            # The arrays give other bodies.
            if scene.changing is not None:
                scene = replace(scene, changing=None, moments=ONES)
            scene = in_double(scene)
        if needs_equations(scene, {name: own[name] for name in TORQUES if name in own}):
            settings["tolerance"] = choose_kernel(settings["method"], settings["tolerance"])[1]
            settings["effort"] = checked_effort(settings["effort"])
            return solve_recorded(scene, t_end, times, arrays, states, out, **settings)
    else:
        for name in own:
            raise InputError(
                f"{name} is given beside many scenes; allowed: arrays with one scene, or many "
                "scenes without arrays"
            )
        kinds = [_kind_of(each, row) for row, each in enumerate(scene)]
        if len(set(kinds)) > 1 or any(each not in _LAWS for each in kinds):
            return _solve_groups(scene, kinds, t_end, times, step, out, **settings)
    return solve_laws(scene, t_end, times, arrays, out, step, **settings)


def _kind_of(scene: Scene, row: int) -> object:
    """Return a value that scenes share if one kernel call can solve them."""
    try:
        checked_scene(scene, any_axes=True, any_torque=True, any_state=True, changing=True)
    except InputError as mistake:
        raise InputError(f"scene {row}: {mistake}") from None
    if isinstance(scene, PrincipalScene):
        return row
    if not needs_equations(scene, {}):
        return _PLAIN if scene.inertia is None else _TILTED
    body = next((name for name in BODIES if getattr(scene, name) is not None), scene.changing)
    torque: object = scene.torque
    if isinstance(torque, TorqueLaw):
        torque = torque.frame, len(torque.sines), len(torque.cosines), any(torque.rate)
    return body, torque


def _solve_groups(
    scenes: Sequence[Scene], kinds: Sequence[object], t_end: Any, times: Array | None,
    step: Number | None, out: "Ensemble | Array | None", **settings: Any,
) -> Ensemble:  # fmt: skip
    check_alike(scenes)
    if scenes[0].attitude is None and any(each.torque.needs_attitude for each in scenes):
        raise InputError(NO_ATTITUDE)
    n = len(scenes)
    ends = rows_of("t_end", t_end) if times is None else np.zeros(1)
    check_rows("t_end", ends, n)
    ends = spread(ends, n)
    with_attitude, estimates = scenes[0].attitude is not None, settings["estimates"]
    if times is None:
        found = place_for(out, n, with_attitude, estimates)
    else:
        found = place_for(None, n * len(times), with_attitude, estimates).with_times(times)
    leaves: set[str | None] = set()
    expect_bodies(n)
    groups: dict[object, list[int]] = {}
    for row, kind in enumerate(kinds):
        groups.setdefault(kind, []).append(row)
    for kind, rows in groups.items():
        own: Any = [scenes[row] for row in rows]
        arrays = dict.fromkeys((*BODIES, *TORQUES, "omega", "attitude"))
        if kind not in _LAWS:
            own, arrays = rows_of_alike(own)
        try:
            part = _solve(own, ends[rows], times, arrays, None, None, step, **settings)
        except InputError as mistake:
            raise InputError(f"scene {rows[0]}: {mistake}") from None
        leaves.add(part.leaves)
        for name in ("omega", "status", "attitude", "estimates"):
            array = getattr(found, name)
            if array is not None:
                array[rows] = getattr(part, name)
    texts = "; ".join(sorted(filter(None, leaves))) or None
    return found if found.leaves == texts else replace(found, leaves=texts)

"""The registry of all methods that solve a scene."""

import importlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from pyharness.engine.methods.scipy_ivp import FINEST, scipy_method
from pyharness.engine.system.kernel_input import rows_trajectory
from pyharness.engine.system.recorded import is_recorded
from pyharness.model.codes import Methods, Series
from pyharness.model.effort import Integrator
from pyharness.model.errors import InputError
from pyharness.model.fixed_steps import FIXED_STEPS, FixedStep
from pyharness.model.principal import PrincipalScene
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, is_opaque
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import Number, boolean, tolerance_of

# Smallest tolerances of Gauss collocation with 1 to 8 stages; below, low orders would need too many
# steps.
_GAUSS_FINEST = (1e-8, 1e-11, 1e-12, 1e-13, 1e-14, 1e-14, 1e-14, 1e-14)
# At this tolerance 5 of 1000 ordinary motions are sensitive to rounding errors; at 1e-12, 303 are:
# `python -m tests.campaigns.default_campaign 1000 2026-11-26`.
_DEFAULT = 1e-9
_ONE_STAGE_DEFAULT = 1e-6
# Within the work limit, SciPy's methods meet no smaller tolerance over a hundred radians with
# attitude, or if perturbations grow a thousandfold.
_SCIPY_DEFAULT = 1e-8


@dataclass(frozen=True)
class Method:
    name: str
    title: str
    source: str
    finest: float  # smallest tolerance that the method claims to meet; 1 if it takes none
    solve: Integrator  # called with checked times on one side of 0, in order away from 0
    # Default tolerance: 1e-9, or the smallest met in ordinary scenes within a fraction of the work
    # limit; 1 if the method takes none.
    default: float = _DEFAULT
    gives_rows: bool = True  # false if only a prepared solver has it, without intermediate output
    # Takes a fifth argument, whether `sol` has the steps.
    gives_steps: bool = False
    order: int = 0  # of the global error in the step size; 0 if it varies
    orders: str = ""  # in documents, if not `order` or "adapted"
    evaluations: int = 0  # right-hand sides per step; 0 if the number varies
    any_scale: bool = False  # rescales the scene itself, or forms no products in binary64
    attitude: bool = False  # propagates the attitude together with omega
    space_torque: bool = False  # takes a torque about the axes of space, together with attitude
    # Takes a torque that depends on the state, and propagates the attitude under it.
    state_torque: bool = False
    # Takes only weak torques, also recorded ones of time and omega; computes no attitude.
    weak_torque: bool = False
    scipy: str = ""  # SciPy's name; empty for our own methods
    is_fixed_step: bool = False  # uses the scene's step size, and takes no tolerance
    code: int | None = None  # of its prepared solver
    # Has a prepared solver for torques that depend on the state, and integrates own states.
    own_states: bool = False


def _reference(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.truth.reference import reference

    result = reference(scene, times, effort=effort)
    finite = np.isfinite(result.omega).all(axis=1)
    if not finite.all():
        return rows_trajectory([], result.omega[:0], 0, len(times), "overflow")
    ended = "complete" if len(result.time) == len(times) else "overflow"
    largest = max(*map(abs, scene.omega), float(np.abs(result.omega).max(initial=0.0)))
    # A body at rest has no scale for an error; the rounding errors of a transformation to principal
    # axes are not estimated.
    error = result.error / largest if largest and not isinstance(scene, PrincipalScene) else None
    if error is not None and result.attitude is not None:
        error = max(error, result.angle_error)
    return rows_trajectory(
        result.time.tolist(), result.omega, 0, len(times), ended, attitude=result.attitude,
        error=error,
    )  # fmt: skip


def _no_rows(*given: object) -> Trajectory:
    raise InputError(
        "method 'quick' returns the state at one time only; use it with prepare, or give auto"
    )


def _from(room: str, name: str, *arguments: str | int) -> Integrator:
    """Return a function that imports solver `name` when called, and passes it `arguments` first."""

    @cache
    def module() -> Any:
        return importlib.import_module(f"pyharness.engine.{room}")

    def solve(*given: Any) -> Trajectory:
        found: Trajectory = getattr(module(), name)(*arguments, *given)
        return found

    return solve


def _scipy(scipy: str, title: str, orders: str, source: str) -> Method:
    source, solve = f"scipy.integrate.solve_ivp; {source}", scipy_method(scipy)
    return Method(
        scipy.lower(), title, source, FINEST[scipy], solve, _SCIPY_DEFAULT, scipy=scipy,
        gives_steps=True, orders=orders, attitude=True, state_torque=True,
    )  # fmt: skip


def _gauss(stages: int) -> Method:
    return Method(
        f"gauss-{stages}",
        f"Gauss collocation of order {2 * stages}, steps halved until two agree",
        "fortran/modern/gauss_collocation.f90; Hairer, McLachlan and Razakarivony 2008",
        _GAUSS_FINEST[stages - 1],
        _from("methods.gauss", "gauss", stages),
        _DEFAULT if stages > 1 else _ONE_STAGE_DEFAULT,
        order=2 * stages,
        code=Methods.GAUSS + stages,
    )


def _fixed_step(code: int, chosen: FixedStep) -> Method:
    return Method(
        chosen.name, f"{chosen.title} in the scene's steps",
        f"fortran/modern/fixed_step.fypp; {chosen.source}", 1.0,
        _from("methods.gauss", "fixed_step", chosen.name, code), 1.0, order=chosen.order,
        evaluations=chosen.evaluations, is_fixed_step=True, code=code,
    )  # fmt: skip


_SERIES: Any = dict.fromkeys(
    ("gives_steps", "attitude", "space_torque", "state_torque", "own_states"), True
)
REGISTRY = {
    method.name: method
    for method in (
        Method(
            "auto",
            "closed form where there is one, else Taylor series",
            "pyharness.engine.plan.plan",
            1e-15,
            _from("plan.plan", "by_plan"),
            **_SERIES,
        ),
        _scipy("DOP853", "Runge-Kutta 8(5,3)", "8", "Hairer, Norsett and Wanner 1993, II.5"),
        _scipy("RK45", "Runge-Kutta 5(4)", "5", "Dormand and Prince 1980"),
        _scipy("LSODA", "Adams and BDF with switching", "1 to 12", "Petzold 1983"),
        _scipy("Radau", "implicit Runge-Kutta of order 5", "5", "Hairer and Wanner 1996, IV.8"),
        Method(
            "taylor",
            "Taylor series by recurrence, step and order adapted",
            "ours; Jorba and Zou 2005, Experimental Mathematics 14",
            1e-15,
            _from("methods.taylor", "taylor"),
            orders=f"{Series.LEAST_ORDER} to {Series.MOST_ORDER}",
            code=Methods.TAYLOR,
            **_SERIES,
        ),
        Method(
            "reference",
            "known solution, or Taylor series in decimal arithmetic",
            "pyharness.truth.reference",
            2.0**-52,
            _reference,
            any_scale=True,
            attitude=True,
            state_torque=True,
        ),
        Method(
            "closed-form",
            "known solution: sphere, or any body without torque by elliptic functions",
            "fortran/modern/torque_free.f90, sphere.f90; Jacobi 1849",
            1e-14,
            _from("methods.closed_form", "known_solution"),
            orders="exact",
            any_scale=True,
            attitude=True,
            code=Methods.CLOSED_FORM,
        ),
        Method(
            "averaged",
            "two-scale averaging, for weak torques over very many revolutions",
            "ours; Calvo, Chartier, Murua and Sanz-Serna 2011, Applied Numerical Mathematics 61",
            1e-13,
            _from("methods.averaged", "averaged"),
            weak_torque=True,
        ),
        *map(_gauss, range(1, 9)),
        *(_fixed_step(code, each) for code, each in enumerate(FIXED_STEPS, Methods.FIXED + 1)),
        Method(
            "quick",
            "Runge-Kutta in scaled unknowns, for few digits at the end",
            "fortran/modern/scaled_runge_kutta.f90",
            # Below this tolerance, rounding errors of many steps would matter.
            1e-12,
            _no_rows,
            gives_rows=False,
            code=Methods.QUICK,
        ),
    )
}
METHODS = {name: method for name, method in REGISTRY.items() if method.gives_rows}
FIXED_STEP = tuple(name for name, method in REGISTRY.items() if method.is_fixed_step)
GAUSS = tuple(name for name in REGISTRY if name.startswith("gauss-"))
PREPARED_FOR_STATE = tuple(name for name, method in REGISTRY.items() if method.own_states)
PREPARED = tuple(name for name, each in REGISTRY.items() if each.code is not None or name == "auto")
SCIPY_METHODS = {name: method.scipy for name, method in REGISTRY.items() if method.scipy}
WITH_ATTITUDE = tuple(name for name, method in REGISTRY.items() if method.attitude)
PREPARED_WITH_ATTITUDE = tuple(
    name for name in WITH_ATTITUDE if name not in (*SCIPY_METHODS, "reference")
)


def requested_tolerance(method: str, tolerance: Number | None) -> float:
    """Return the tolerance, by default the method's, without a check of its range."""
    chosen = REGISTRY[method]
    return chosen.default if tolerance is None else tolerance_of(tolerance, chosen.finest)


def computes_attitude(
    scene: Scene, method: str, requested: bool | None, able: Iterable[str] = WITH_ATTITUDE
) -> bool:
    """Return whether to compute the attitude; by default if given or needed, and computable."""
    if requested is None:
        is_able = method in able
        if method == "closed-form":
            is_able = scene.coefficients is None and scene.torque.is_zero
        return scene.has_attitude and is_able
    if boolean("attitude", requested):
        check_attitude(method, able)
    return bool(requested)


def check_attitude(method: str, able: Iterable[str] = WITH_ATTITUDE) -> None:
    if method not in able:
        allowed = ", ".join(able)
        raise InputError(f"method {method} does not compute attitudes; allowed: {allowed}")


def check_prepared(scene: Scene, method: str) -> None:
    if is_opaque(scene.torque):
        raise InputError(
            "an opaque torque has no prepared solver; allowed: a torque that can be recorded, or "
            "the function solve"
        )
    if is_recorded(scene) and method not in PREPARED_FOR_STATE:
        what = "an inertia that changes" if scene.changing else "a torque that depends on the state"
        raise InputError(
            f"method {method} has no prepared solver for {what}; "
            f"allowed: {', '.join(PREPARED_FOR_STATE)}, or the function solve"
        )


def check_torque(scene: Scene, method: str, attitude: bool) -> None:
    torque, chosen = scene.torque, REGISTRY[method]
    if scene.states and method not in PREPARED_FOR_STATE:
        raise InputError(
            f"method {method} can't solve a scene with states of its own; "
            f"allowed: {', '.join(PREPARED_FOR_STATE)}"
        )
    kind, needed = "a torque about the axes of space", ""
    if isinstance(torque, StateTorque):
        kind = "a recorded torque, which is no TorqueLaw"
        if torque.needs_attitude:
            kind = "a torque that depends on the attitude"
        if torque.tape is None and not chosen.scipy:
            kind, needed = "an opaque torque", "scipy"
        elif chosen.weak_torque and scene.changing is not None:
            kind, needed = "an inertia that changes with time", "state_torque"
        elif not (chosen.state_torque or (chosen.weak_torque and not torque.needs_attitude)):
            needed = "state_torque"
    elif scene.changing is not None and not chosen.state_torque:
        kind, needed = "an inertia that changes with time", "state_torque"
    elif torque.in_space and not chosen.space_torque and scene.changing is None:
        needed = "space_torque"
    if needed:
        able = ", ".join(each.name for each in REGISTRY.values() if getattr(each, needed))
        raise InputError(f"method {method} can't solve a scene with {kind}; allowed: {able}")
    if torque.needs_attitude and not attitude:
        raise InputError(f"{kind} needs the attitude; give attitude=True, or --attitude FORM")

"""The table of tolerances: every entry point solves every kind of scene to what it promises.

The scenes are in `tests/engine/tolerance_scenes.py`. The reference gives their true motions, with
which `tests/within.py` compares.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, Stepper, Taylor, TorqueLaw, prepare, principal, solve, solve_many
from pyharness.engine.plan.registry import GAUSS, METHODS, REGISTRY, SCIPY_METHODS
from pyharness.engine.system.kernel_input import closed_form
from pyharness.engine.system.recorded import is_recorded
from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.state_torque import of_law, torque_of
from pyharness.model.trajectory import Array
from tests.engine.tolerance_scenes import KINDS, motions
from tests.within import Motion, check_error

TOLERANCES = (1e-4, 1e-12)
# By method, if others: `auto` chooses by the tolerance, SciPy's methods claim less.
_OTHER = {
    "auto": (1e-4, 1e-8, 1e-12), "dop853": (1e-4, 1e-8), "rk45": (1e-5,), "lsoda": (1e-5,),
    "radau": (1e-4,), "gauss-1": (1e-4, 1e-8), "gauss-2": (1e-4, 1e-8),
    "quick": (1e-4, 1e-8, 1e-12),
}  # fmt: skip
_FEW = 2  # of the scenes of a kind, for SciPy's methods, which take long
_ENDED = ("complete", "sensitive")


def takes(method: str, scene: Scene, attitude: bool) -> bool:
    """Return whether a method solves scenes of this kind."""
    chosen = REGISTRY[method]
    if attitude and not chosen.attitude:
        return False
    if attitude and method == "closed-form" and (scene.coefficients or not scene.torque.is_zero):
        return False
    if scene.torque.needs_attitude and not attitude:
        return False
    if is_recorded(scene):
        return chosen.state_torque
    if scene.torque.in_space:
        return chosen.space_torque
    bare = principal(scene)[0]
    if method == "quick":
        return all(bare.euler_coefficients)
    return method != "closed-form" or closed_form(bare) is not None


def by_solve(method: str, motion: Motion, tolerance: float, attitude: bool, what: str) -> None:
    """Check the rows of `solve`."""
    found = solve(motion.scene, motion.times, method, tolerance, attitude=attitude)
    assert found.ended in _ENDED, what
    check_error(
        motion, found.omega, found.attitude, tolerance, what, steps=found.steps,
        estimate=found.error,
    )  # fmt: skip


def by_dense_output(
    method: str, motion: Motion, tolerance: float, attitude: bool, what: str
) -> None:
    """Check the dense output at a time that is no row, and at many against a fine series."""
    found: Any = solve(
        motion.scene, motion.times[-1], method, tolerance, attitude=attitude, dense_output=True
    )
    state = found.sol(motion.times).T
    turns = state[:, 3:] if attitude else None
    check_error(motion, state[:, :3], turns, tolerance, what, steps=found.steps)
    times, fine = fine_series(motion, attitude)
    apart = np.abs(found.sol(times).T - fine)
    sizes = np.array([motion.largest] * 3 + [0.5] * 4 * attitude)
    assert (apart <= sizes * (2.0 * tolerance + 8e-15 * motion.growth)).all(), what


@cache
def fine_series(motion: Motion, attitude: bool) -> tuple[Array, Array]:
    """Return times within the span of a motion, and the states there."""
    times = motion.times[-1] * np.random.default_rng(5).uniform(0.0, 1.0, 60)
    times = times[np.argsort(abs(times))]
    return times, solve(motion.scene, times, "taylor", 1e-13, attitude=attitude).y.T


def by_call(method: str, motion: Motion, tolerance: float, attitude: bool, what: str) -> None:
    """Check a prepared solver, from another start than the scene's."""
    start, end = motion.scene.omega, motion.times[-1]
    scene = replace(motion.scene, omega=(1.0, 2.0, 3.0))
    starts = np.tile(start, (9, 1))
    if attitude:
        turning = prepare(replace(scene, attitude=None), method, tolerance, attitude=True)
        turned = motion.scene.attitude or IDENTITY
        omega, turns = turning(start, end, turned)
        assert turning.status in _ENDED, what
        check_error(motion, omega, turns, tolerance, what, estimate=turning.error)
        many, turns, _ = turning.many(starts, end, np.tile(turned, (9, 1)))
        check_error(motion, many[8], turns[8], tolerance, f"{what}, many")
        return
    solver = prepare(scene, method, tolerance, attitude=False)
    omega = solver(start, end)
    assert solver.status in _ENDED, what
    steps = abs(solver.steps)
    check_error(motion, omega, None, tolerance, what, steps=steps, estimate=solver.error)
    many = solver.many(starts, end)[0]
    check_error(motion, many[8], None, tolerance, f"{what}, many", steps=steps)
    if method in METHODS:
        rows = solver.trajectory(start, motion.times)
        check_error(motion, rows.omega, None, tolerance, what, steps=steps, estimate=rows.error)


def by_stepper(method: str, motion: Motion, tolerance: float, attitude: bool, what: str) -> None:
    """Check the stepper, whose tolerance applies to each step."""
    stepper = Stepper(motion.scene, tolerance, attitude=attitude)
    rows, turns = [], []
    for time in motion.times:
        stepper.until(time)
        rows.append(stepper.omega)
        turns.append(stepper.attitude)
    allowed = tolerance * max(1.0, motion.growth) * stepper.steps
    check_error(motion, np.array(rows), np.array(turns) if attitude else None, allowed, what)


def equations(scene: Scene) -> Callable[[Any, Any], Any]:
    """Return the equations of motion of omega and attitude as a function for `solve_ivp`."""
    torque: Any = scene.torque
    tape: Any = (of_law(torque) if isinstance(torque, TorqueLaw) else torque).tape

    def rates(t: Any, y: Any) -> Any:
        omega, q = y[:3], list(y[3:])
        push = np.array(torque_of(tape, t, omega, q))
        if scene.inertia is not None or scene.changing is not None:
            inertia: Any = np.array(scene.inertia or scene.changing.matrix(t))  # type: ignore[union-attr]
            if scene.changing is not None:
                push = push - scene.changing.matrix_rate(t) @ omega
            turned: Any = np.linalg.inv(inertia) @ (push - np.cross(omega, inertia @ omega))
        else:
            products = np.array([omega[1] * omega[2], omega[2] * omega[0], omega[0] * omega[1]])
            turned = np.array(scene.euler_coefficients) * products
            turned = turned + push / np.array(scene.moments or (1.0, 1.0, 1.0))
        return [*turned, *quaternion_rates(omega, q)]

    return rates


def by_solve_ivp(method: str, motion: Motion, tolerance: float, attitude: bool, what: str) -> None:
    """Check the method for SciPy's function, whose tolerances apply to each step."""
    start = [*motion.scene.omega, *(motion.scene.attitude or IDENTITY)]
    found = solve_ivp(
        equations(motion.scene), (0.0, motion.times[-1]), start, method=Taylor,
        t_eval=motion.times, rtol=tolerance,
        atol=[tolerance * motion.largest] * 3 + [tolerance] * 4,
    )  # fmt: skip
    assert found.success, what
    y = found.y.T
    turns = y[:, 3:] / np.linalg.norm(y[:, 3:], axis=1)[:, None]
    allowed = 2.0 * tolerance * max(1.0, motion.growth) * (1.0 + found.nfev)
    check_error(motion, y[:, :3], turns, allowed, what)


Entry = Callable[[str, Motion, float, bool, str], None]
OURS = ("auto", "taylor", "closed-form")
ENTRIES: dict[str, tuple[Entry, tuple[str, ...], tuple[bool, ...]]] = {
    "solve": (by_solve, OURS, (False, True)),
    "Gauss collocation": (by_solve, GAUSS, (False,)),
    "methods of SciPy": (by_solve, tuple(SCIPY_METHODS), (True,)),
    "dense output": (by_dense_output, OURS, (False, True)),
    "prepare": (by_call, (*OURS, "quick"), (False, True)),
    "Stepper": (by_stepper, ("taylor",), (False, True)),
    "solve_ivp": (by_solve_ivp, ("taylor",), (True,)),
}


# Kinds of which an entry point takes no scene.
_NONE = {
    "Gauss collocation": {
        "changing inertia", "ready torques", "steady", "sudden", "torque in space", "turning",
    },
    "Stepper": {"cancelling", "changing inertia"},
    "methods of SciPy": {"torque in space"},
    "solve_ivp": {"cancelling", "changing inertia"},
}  # fmt: skip


def is_for(entry: str, kind: str, scene: Scene) -> bool:
    """Return whether an entry point takes a scene that its method takes."""
    if entry in ("Stepper", "solve_ivp"):
        breaks = getattr(getattr(scene.torque, "tape", None), "breaks", ())
        # Neither adds waves of one frequency before it solves them.
        is_able = scene.changing is None and kind != "cancelling"
        return is_able and not (entry == "solve_ivp" and breaks)
    return True


# SciPy's methods are slow; of their kinds of scenes three are enough for every edit.
_OF_SCIPY = ("steady", "turning", "timed")
_ROWS = [
    pytest.param(
        entry, kind,
        marks=[pytest.mark.campaign] * (entry == "methods of SciPy" and kind not in _OF_SCIPY),
    )
    for entry in ENTRIES
    for kind in KINDS
]  # fmt: skip


@pytest.mark.parametrize(("entry", "kind"), _ROWS)
def test_errors_are_within_the_tolerance(entry: str, kind: str) -> None:
    check, methods, attitudes = ENTRIES[entry]
    checked = 0
    for name, motion in islice(
        motions(kind).items(), _FEW if entry == "methods of SciPy" else None
    ):
        for method in methods:
            for attitude in attitudes:
                if not (
                    takes(method, motion.scene, attitude) and is_for(entry, kind, motion.scene)
                ):
                    continue
                for tolerance in _OTHER.get(method, TOLERANCES):
                    if tolerance >= REGISTRY[method].finest:
                        what = f"{entry}, {method}, {name}" + ", attitude" * attitude
                        check(method, motion, tolerance, attitude, what)
                        checked += 1
    assert (checked == 0) == (kind in _NONE.get(entry, set()))


@pytest.mark.parametrize("kind", KINDS)
def test_every_instruction_set(kind: str, level: int) -> None:
    for name, motion in motions(kind).items():
        for tolerance in (1e-4, 1e-12):
            by_solve("taylor", motion, tolerance, True, name)
        if takes("quick", motion.scene, False):
            by_call("quick", motion, 1e-6, False, f"{name}, quick")


def alone(scene: Scene) -> bool:
    """Return whether a scene of a list is solved without the others."""
    return is_recorded(scene) or scene.torque.in_space


# The kinds whose scenes share a call.
LAWS = [kind for kind in KINDS if not any(alone(drawn()[0]) for drawn in KINDS[kind].values())]


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("by_moments", [False, True])
def test_many_bodies_side_by_side(
    by_moments: bool, attitude: bool, tolerance: float, level: int
) -> None:
    rows = [
        (name, motion)
        for kind in KINDS
        for name, motion in motions(kind).items()
        # A list takes no torque in space together with an inertia that changes.
        if not (motion.scene.changing and motion.scene.torque.in_space)
        and (motion.scene.coefficients is None) == by_moments
        and (attitude or not motion.scene.torque.needs_attitude)
    ]
    scenes = [
        replace(
            motion.scene,
            attitude=motion.scene.attitude or IDENTITY if attitude else None,
            step_size=0.01,
        )
        for _, motion in rows
    ]
    times = [motion.times[-1] for _, motion in rows]
    found: Any = solve_many(scenes, times, tolerance=tolerance, estimates=True)
    for row, (name, motion) in enumerate(rows):
        assert found.ended[row] in _ENDED, name
        turns = None if found.attitude is None else found.attitude[row]
        estimate = float(found.error[row])
        check_error(motion, found.omega[row], turns, tolerance, name, estimate=estimate)
    if by_moments and not attitude:
        # One by one the bodies would have the bits of a prepared solver.
        laws = [(n, row) for n, row in enumerate(scenes) if not alone(row)]
        bits = [
            np.array_equal(
                prepare(scene, tolerance=tolerance)(scene.omega, times[n]), found.omega[n]
            )
            for n, scene in laws
        ]
        assert np.count_nonzero(bits) < 0.7 * len(laws)


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in LAWS])
def test_many_bodies_under_one_torque(kind: str, tolerance: float, level: int) -> None:
    for name, motion in motions(kind).items():
        scene = replace(motion.scene, attitude=motion.scene.attitude or IDENTITY)
        starts = np.tile(scene.omega, (9, 1))
        found: Any = solve_many(scene, motion.times[-1], omega=starts, tolerance=tolerance)
        assert found.ended[8] in _ENDED, name
        check_error(motion, found.omega[8], found.attitude[8], tolerance, name)

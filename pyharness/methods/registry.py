"""The one registry: every way to turn a scene into a trajectory, by name."""

import importlib
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pyharness.methods.scipy_ivp import FINEST, finest_tolerance, rows_trajectory, scipy_method
from pyharness.model.effort import Solver, check_steps, checked_effort
from pyharness.model.errors import InputError, TimedError, unknown
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.same_motion import factor_near_one, is_ordinary, scaled, unscaled
from pyharness.model.scene import Scene, checked_scene, most_steps
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import Number, Numbers, number, several, tolerance_of

IMPLEMENTATIONS = ("fortran", "python")

# Of 1 to 8 stages: low orders would need more steps than anyone waits for.
_GAUSS_FINEST = (1e-8, 1e-11, 1e-12, 1e-13, 1e-14, 1e-14, 1e-14, 1e-14)

# They bring the scene near 1 themselves, or form no products in binary64.
_ANY_SCALE = ("closed-form", "reference")


@dataclass(frozen=True)
class Program:
    """A program of the appendix.

    Attributes
    ----------
    name : str
        As in `pyharness.model.listing.PROGRAMS`.
    order : int
        The power of the step with which the error of the mended program falls.
    source : str
        Where it stands.
    """

    name: str
    order: int
    source: str

    def run(
        self,
        scene: Scene,
        listing: Listing,
        implementation: str = "fortran",
        lipschitz: float = 500.0,
        may_stop: bool = True,
        velocity: bool = True,
        effort: float = 1.0,
    ) -> Trajectory:
        """Run the program.

        Parameters
        ----------
        scene : Scene
            What to integrate.
        listing : Listing
            Its active defects and readings.
        implementation : {"fortran", "python"}
            The compiled program or its twin; both give the same bits.
        lipschitz : float
            Constant of the stop test (1/s).
        may_stop : bool
            Whether the stop test may end the run.
        velocity : bool
            Whether the velocity is wanted; the compiled program then computes it only if its
            stop test needs it.
        effort : float
            Factor on the steps, times waves, that are run without being asked for.

        Raises
        ------
        InputError
            For what is no scene, a listing of another program, an unknown implementation, or more
            steps than `effort` allows.
        NotBuiltError
            Where the compiled program is asked for and not built.
        """
        from pyharness.methods import kernels

        lipschitz, may_stop, velocity = kernels.checked_run(
            scene, listing, lipschitz, may_stop, velocity
        )
        if listing.program != self.name:
            raise InputError(f"program {self.name}: the listing is that of {listing.program}")
        if not isinstance(implementation, str) or implementation not in IMPLEMENTATIONS:
            raise unknown("implementation", implementation, IMPLEMENTATIONS)
        check_steps(scene, self.name, implementation, effort)
        if implementation == "fortran":
            return kernels.run(scene, listing, lipschitz, may_stop, velocity)
        twin = importlib.import_module(f"pyharness.original.{self.name.replace('-', '_')}")
        trajectory: Trajectory = twin.run(scene, listing, lipschitz, may_stop)
        return trajectory


@dataclass(frozen=True)
class Method:
    """Anything else that turns a scene into a trajectory at requested times.

    Attributes
    ----------
    name, title, source : str
        What it is called, what it is, where it comes from.
    finest : float
        The smallest tolerance that it claims to meet.
    solve : callable
        ``solve(scene, times, tolerance, effort)``; times are checked, of one side, and run away
        from 0.
    """

    name: str
    title: str
    source: str
    finest: float
    solve: Solver


def solve(
    scene: Scene,
    times: Number | Numbers,
    method: str,
    tolerance: Number,
    effort: float = 1.0,
) -> Trajectory:
    """Solve a scene by a method of the registry.

    Parameters
    ----------
    scene : Scene
        What to integrate; its step size plays a part only for the fixed-step methods.
    times : float or iterable of float, shape (n,)
        Where the result is wanted (s): strictly monotonic. On both sides of 0 the scene is solved
        twice, from 0 backward and from 0 forward.
    method : str
        A name in `METHODS`.
    tolerance : float
        Largest error of any component at `times`, relative to the largest from 0 to the last of
        them.
    effort : float
        Factor on the work after which the method gives up.

    Returns
    -------
    Trajectory
        One row per time, in the order of `times`, fewer where the solution overflows: then those
        between 0 and the overflow, on either side. Steps and evaluations are of both sides.

    Raises
    ------
    InputError
        For an unknown method, times out of order, a tolerance that the method can't meet, or one
        that takes more work than `effort` allows.
    """
    checked_scene(scene)
    if not isinstance(method, str) or method not in METHODS:
        raise unknown("method", method, METHODS)
    chosen = METHODS[method]
    tolerance = tolerance_of(tolerance, chosen.finest)
    if chosen.finest == 1.0 and tolerance != 1.0:
        raise InputError(
            f"tolerance is {tolerance:g}; {method} takes none: it goes in the scene's steps, "
            "whatever their error; give no tolerance, or 1"
        )
    if not chosen.finest <= tolerance <= 1.0:
        raise InputError(
            f"tolerance is {tolerance:g}; allowed for {method}: {chosen.finest:.2g} to 1"
        )
    effort = checked_effort(effort)
    values, turned = _ascending(times)
    below = [t for t in values if t < 0.0]
    rest = values[len(below) :]
    # On either side away from 0.
    marches = [
        _march(chosen, scene, each, tolerance, effort) for each in (below[::-1], rest) if each
    ]
    if below:
        marches[0] = _reversed(marches[0])
    found = marches[0] if len(marches) == 1 else _joined(*marches)
    return _reversed(found) if turned else found


def finest(method: str, scene: Scene, time: float) -> float:
    """Return the smallest tolerance that a method of the registry can meet in a scene.

    The one that it claims; more for `solve_ivp`, whose steps can't be told to err less than by
    some 2e-14, where many add up or the motion multiplies them.

    Raises
    ------
    InputError
        Where `solve_ivp` would need too many steps even to see that.
    """
    claimed = METHODS[method].finest
    if method not in SCIPY_METHODS or time == 0.0:
        return claimed
    factor = factor_near_one(scene, time)
    met = finest_tolerance(SCIPY_METHODS[method], scaled(scene, factor), time / factor)
    return max(claimed, met)


def _march(
    chosen: Method, scene: Scene, times: list[float], tolerance: float, effort: float
) -> Trajectory:
    """Solve at times away from 0, in units in which the method can form its products."""
    if chosen.finest < 1.0 and not is_ordinary(scene):
        # The step plays no part; in other units it might be no number.
        scene = replace(scene, step_size=abs(times[-1]) or 1.0, steps=1)
    factor = 1.0 if chosen.name in _ANY_SCALE else factor_near_one(scene, times[-1])
    if factor == 1.0:
        return chosen.solve(scene, times, tolerance, effort)
    faster = [t / factor for t in times]
    try:
        found = chosen.solve(scaled(scene, factor), faster, tolerance, effort)
    except TimedError as refusal:
        raise refusal.slower(factor) from None
    return unscaled(found, times, factor)


def _reversed(found: Trajectory) -> Trajectory:
    return replace(
        found,
        time=found.time[::-1],
        recorded_time=found.recorded_time[::-1],
        omega=found.omega[::-1],
    )


def _joined(before: Trajectory, after: Trajectory) -> Trajectory:
    """Return the rows of two marches from 0; what overflows is missing at the ends."""
    return replace(
        after,
        time=np.concatenate([before.time, after.time]),
        recorded_time=np.concatenate([before.recorded_time, after.recorded_time]),
        omega=np.concatenate([before.omega, after.omega]),
        steps=before.steps + after.steps,
        evaluations=before.evaluations + after.evaluations,
        ended=after.ended if before.ended == "complete" else before.ended,
    )


def _ascending(times: object) -> tuple[list[float], bool]:
    """Return the times in ascending order, and whether that turned them round."""
    if not isinstance(times, Iterable) or getattr(times, "shape", None) == ():
        times = (times,)
    if isinstance(times, np.ndarray) and times.dtype.kind in "iuf":
        times = times.tolist()
    entries = several("times", times, "allowed: a number, or numbers in order")
    most = most_steps()
    values = [number("times", each) for each in itertools.islice(entries, most + 1)]
    if not values:
        raise InputError("times: none given; give at least one")
    if len(values) > most:
        raise InputError(f"times: more than {most}, what fits in this machine's memory")
    if not all(map(math.isfinite, values)):
        raise InputError("times: one is not finite; allowed: finite numbers")
    turned = values[0] > values[-1]
    if turned:
        values.reverse()
    if not all(t1 < t2 for t1, t2 in itertools.pairwise(values)):
        raise InputError("times: not strictly monotonic; each must differ from the one before")
    return values, turned


def _auto(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.methods.plan import closed_form

    if closed_form(scene):
        form = METHODS["closed-form"]
        try:
            # As good as rounding lets it be, whatever is asked.
            return form.solve(scene, times, max(tolerance, form.finest), effort)
        except InputError as refusal:
            # A disturbance of the middle axis may be too faint for it, but not for a series.
            try:
                return METHODS["taylor"].solve(scene, times, tolerance, effort)
            except InputError:
                raise refusal from None
    return METHODS["taylor"].solve(scene, times, tolerance, effort)


def _taylor(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.methods import kernels

    return kernels.taylor(scene, times, tolerance, effort)


def _reference(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.truth.reference import reference

    result = reference(scene, times, effort=effort)
    ended = "complete" if len(result.time) == len(times) else "overflow"
    return rows_trajectory(result.time.tolist(), result.omega, 0, len(times), ended)


def _modern(factory: str, argument: str | int | None = None) -> Solver:
    """Return a solver of `pyharness.methods.gauss`, which is imported when it is first used."""

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        solver = getattr(importlib.import_module("pyharness.methods.gauss"), factory)
        if argument is not None:
            solver = solver(argument)
        trajectory: Trajectory = solver(scene, times, tolerance, effort)
        return trajectory

    return solve


PROGRAM_REGISTRY = {
    "two-term": Program("two-term", 2, "Jacobs 1982, IV.2 and appendix"),
    "four-term": Program("four-term", 2, "Jacobs 1982, IV.2 and appendix"),
    "runge-kutta": Program("runge-kutta", 4, "Jacobs 1982, eq. 31, IV.3 and appendix"),
}
assert tuple(PROGRAM_REGISTRY) == PROGRAMS

METHODS = {
    method.name: method
    for method in (
        Method(
            "auto",
            "closed form where there is one, else Taylor series",
            "pyharness.methods.plan",
            1e-15,
            _auto,
        ),
        Method(
            "dop853",
            "Runge-Kutta 8(5,3)",
            "scipy.integrate.solve_ivp; Hairer, Norsett and Wanner 1993, II.5",
            FINEST["DOP853"],
            scipy_method("DOP853"),
        ),
        Method(
            "rk45",
            "Runge-Kutta 5(4)",
            "scipy.integrate.solve_ivp; Dormand and Prince 1980",
            FINEST["RK45"],
            scipy_method("RK45"),
        ),
        Method(
            "lsoda",
            "Adams and BDF with switching",
            "scipy.integrate.solve_ivp; Petzold 1983",
            FINEST["LSODA"],
            scipy_method("LSODA"),
        ),
        Method(
            "radau",
            "implicit Runge-Kutta of order 5",
            "scipy.integrate.solve_ivp; Hairer and Wanner 1996, IV.8",
            FINEST["Radau"],
            scipy_method("Radau"),
        ),
        Method(
            "taylor",
            "Taylor series by recurrence, step and order adapted",
            "ours; Jorba and Zou 2005, Experimental Mathematics 14",
            1e-15,
            _taylor,
        ),
        Method(
            "reference",
            "known solution, or Taylor series in decimal arithmetic",
            "pyharness.truth.reference",
            2.0**-52,
            _reference,
        ),
        Method(
            "closed-form",
            "known solution: sphere, or any body without torque by elliptic functions",
            "fortran/modern/torque_free.f90, sphere.f90; Jacobi 1849",
            1e-14,
            _modern("closed_form"),
        ),
        *(
            Method(
                f"gauss-{stages}",
                f"Gauss collocation of order {2 * stages}, steps halved until two agree",
                "fortran/modern/gauss_collocation.f90; Hairer, McLachlan and Razakarivony 2008",
                _GAUSS_FINEST[stages - 1],
                _modern("gauss", stages),
            )
            for stages in range(1, 9)
        ),
        *(
            # In the scene's own steps, whatever their error: the only tolerance that they claim
            # to meet is none.
            Method(name, title, f"fortran/modern/fixed_step.f90; {source}", 1.0, solver)
            for name, title, source, solver in (
                (
                    "improved-euler",
                    "improved Euler in the scene's steps",
                    "Jacobs 1982, eq. 29",
                    _modern("fixed_step", "improved-euler"),
                ),
                (
                    "taylor-3",
                    "three terms of the Taylor series in the scene's steps",
                    "Jacobs 1982, eq. 30",
                    _modern("fixed_step", "taylor-3"),
                ),
                (
                    "rk4",
                    "classical Runge-Kutta in the scene's steps",
                    "Jacobs 1982, eq. 31",
                    _modern("fixed_step", "rk4"),
                ),
            )
        ),
    )
}
# With the names that SciPy has for them.
SCIPY_METHODS = {"dop853": "DOP853", "rk45": "RK45", "lsoda": "LSODA", "radau": "Radau"}

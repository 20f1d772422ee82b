"""The one registry: every way to turn a scene into a trajectory, by name."""

import importlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from pyharness.effort import Solver, check_steps, checked_effort
from pyharness.errors import InputError, TimedError, unknown
from pyharness.listing import PROGRAMS, Listing
from pyharness.scaling import factor_near_one, scaled, unscaled
from pyharness.scene import Scene
from pyharness.scipy_methods import rows_trajectory, scipy_method
from pyharness.trajectory import Trajectory

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
        As in `pyharness.listing.PROGRAMS`.
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
            For more steps than that.
        NotBuiltError
            Where the compiled program is asked for and not built.
        """
        check_steps(scene, self.name, implementation, effort)
        if implementation == "fortran":
            from pyharness import kernels

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
        ``solve(scene, times, tolerance, effort)``; times are checked, and run away from 0.
    """

    name: str
    title: str
    source: str
    finest: float
    solve: Solver


def solve(
    scene: Scene, times: Sequence[float], method: str, tolerance: float, effort: float = 1.0
) -> Trajectory:
    """Solve a scene by a method of the registry.

    Parameters
    ----------
    scene : Scene
        What to integrate; its step size plays a part only for the fixed-step methods.
    times : sequence of float, shape (n,)
        Where the result is wanted (s): strictly monotonic, on one side of 0.
    method : str
        A name in `METHODS`.
    tolerance : float
        Largest error at `times`, relative to the largest initial angular velocity.
    effort : float
        Factor on the work after which the method gives up.

    Returns
    -------
    Trajectory
        One row per time, fewer where the solution overflows.

    Raises
    ------
    InputError
        For an unknown method, times out of order, a tolerance that the method can't meet, or one
        that takes more work than `effort` allows.
    """
    if method not in METHODS:
        raise unknown("method", method, METHODS)
    chosen = METHODS[method]
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
    ordered, turned = _outward(times)
    factor = 1.0 if method in _ANY_SCALE else factor_near_one(scene, ordered[-1])
    if factor == 1.0:
        trajectory = chosen.solve(scene, ordered, tolerance, effort)
    else:
        faster = [t / factor for t in ordered]
        try:
            found = chosen.solve(scaled(scene, factor), faster, tolerance, effort)
        except TimedError as refusal:
            raise refusal.slower(factor) from None
        trajectory = unscaled(found, ordered, factor)
    if not turned:
        return trajectory
    return Trajectory(
        time=trajectory.time[::-1],
        recorded_time=trajectory.recorded_time[::-1],
        omega=trajectory.omega[::-1],
        velocity=None,
        steps=trajectory.steps,
        evaluations=trajectory.evaluations,
        ended=trajectory.ended,
    )


def _outward(times: Sequence[float]) -> tuple[list[float], bool]:
    """Return the times in the order away from 0, and whether that turned them round."""
    values = [float(t) for t in times]
    if not values:
        raise InputError("times: none given; give at least one")
    if not all(map(math.isfinite, values)):
        raise InputError("times: one is not finite; allowed: finite numbers")
    if min(values) < 0.0 < max(values):
        raise InputError("times: on both sides of 0; allowed: one side")
    turned = abs(values[0]) > abs(values[-1])
    if turned:
        values.reverse()
    if not all(abs(t1) < abs(t2) for t1, t2 in itertools.pairwise(values)):
        raise InputError("times: not strictly monotonic; each must differ from the one before")
    return values, turned


def _auto(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.plan import closed_form

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
    from pyharness import kernels

    return kernels.taylor(scene, times, tolerance, effort)


def _reference(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    from pyharness.reference import reference

    result = reference(scene, times, effort=effort)
    ended = "complete" if len(result.time) == len(times) else "overflow"
    return rows_trajectory(result.time.tolist(), result.omega, 0, len(times), ended)


def _modern(factory: str, argument: str | int | None = None) -> Solver:
    """Return a solver of `pyharness.modern`, which is imported when it is first used."""

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        solver = getattr(importlib.import_module("pyharness.modern"), factory)
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
            "pyharness.plan",
            1e-15,
            _auto,
        ),
        Method(
            "dop853",
            "Runge-Kutta 8(5,3)",
            "scipy.integrate.solve_ivp; Hairer, Norsett and Wanner 1993, II.5",
            7e-13,
            scipy_method("DOP853"),
        ),
        Method(
            "rk45",
            "Runge-Kutta 5(4)",
            "scipy.integrate.solve_ivp; Dormand and Prince 1980",
            7e-13,
            scipy_method("RK45"),
        ),
        Method(
            "lsoda",
            "Adams and BDF with switching",
            "scipy.integrate.solve_ivp; Petzold 1983",
            7e-13,
            scipy_method("LSODA"),
        ),
        Method(
            "radau",
            "implicit Runge-Kutta of order 5",
            "scipy.integrate.solve_ivp; Hairer and Wanner 1996, IV.8",
            7e-13,
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
            "pyharness.reference",
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
SCIPY_METHODS = ("dop853", "rk45", "lsoda", "radau")

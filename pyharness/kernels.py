"""The compiled programs: scenes in, trajectories out."""

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from pyharness.codes import Statuses
from pyharness.effort import advice
from pyharness.errors import InputError, NotBuiltError, TimedError
from pyharness.listing import PROGRAMS, Listing, checked_listing
from pyharness.scene import Scene, Wave, checked_scene
from pyharness.trajectory import STOP_VARIABLES, Array, Stop, Trajectory
from pyharness.values import number, truth

COMPLETE, STOPPED, OVERFLOW = Statuses.COMPLETE, Statuses.STOPPED, Statuses.OVERFLOW
REFUSED, GAVE_UP, INTERRUPTED = Statuses.REFUSED, Statuses.GAVE_UP, Statuses.INTERRUPTED
# What a user reads.
ENDS = tuple(name.lower().replace("_", " ") for name in vars(Statuses) if name.isupper())


def extension() -> ModuleType:
    """Return the compiled extension; NotBuiltError where there is none."""
    try:
        from pyharness import _kernels
    except ImportError as error:
        raise NotBuiltError(
            "the Fortran extension is not built; run 'make compare' in the checkout, or "
            "'pip install .' with a Fortran compiler (meanwhile: --implementation python)"
        ) from error
    module: ModuleType = _kernels
    return module


def run(
    scene: Scene,
    listing: Listing,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
) -> Trajectory:
    """Run a program in Fortran.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    listing : Listing
        The program and its active defects.
    lipschitz : float
        The constant of the stop test (1/s); only the Runge-Kutta program has one.
    may_stop : bool
        Whether the stop test may end the run.
    velocity : bool
        Whether the velocity is wanted; where it is not, the translational block is computed
        only if the stop test reads it. No other bit depends on this.

    Returns
    -------
    Trajectory
        As `pyharness.original.<program>.run` returns it, to the last bit.

    Raises
    ------
    InputError
        For what is no scene, no listing, or no limit.
    NotBuiltError
        Where the extension is not built.
    """
    lipschitz, may_stop, velocity = checked_run(scene, listing, lipschitz, may_stop, velocity)
    rows, ier, n_rows, status, evaluations, variable, quotient = extension().run_program(
        *program_arguments(scene, listing, lipschitz, may_stop, velocity)
    )
    results = rows.T[:n_rows]
    return Trajectory(
        time=results[:, 0],
        recorded_time=results[:, 1],
        omega=results[:, 2:5],
        velocity=results[:, 5:8] if velocity else None,
        steps=n_rows,
        evaluations=evaluations,
        ended=ENDS[status],
        stop=Stop(n_rows, STOP_VARIABLES[variable - 1], quotient) if variable else None,
        ier=None if listing.program == "runge-kutta" else ier[:n_rows],
    )


def checked_run(
    scene: object, listing: object, lipschitz: object, may_stop: object, velocity: object
) -> tuple[float, bool, bool]:
    """Return the last three of what `run` takes; InputError where one of the five is no such."""
    checked_scene(scene)
    checked_listing(listing)
    limit = number("lipschitz", lipschitz)
    if not limit >= 0.0:
        raise InputError(f"lipschitz is {limit:g}; allowed: a number from 0")
    return limit, truth("may_stop", may_stop), truth("velocity", velocity)


def program_arguments(
    scene: Scene,
    listing: Listing,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
) -> tuple[Any, ...]:
    """Return what the compiled `run_program` takes."""
    return (
        PROGRAMS.index(listing.program) + 1,
        listing.flags,
        scene.moments is not None,
        scene.moments or scene.coefficients,
        scene.omega,
        scene.masses,
        scene.forces,
        scene.torque.constant,
        scene.torque.rate,
        scene.torque.varies,
        columns(scene.torque.sines),
        columns(scene.torque.cosines),
        scene.step_size,
        scene.steps,
        lipschitz,
        may_stop,
        velocity or stop_reads_velocity(listing, may_stop),
    )


def taylor(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    """Solve a scene by Taylor series.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    times : sequence of float, shape (n,)
        Strictly monotonic away from 0, on one side of it (s); not checked.
    tolerance : float
        Largest error of any component at `times`, relative to the largest from 0 to the last of
        them.
    effort : float
        Factor on the work after which it gives up.

    Returns
    -------
    Trajectory
        Fewer rows than times where the solution overflows; a series counts as one evaluation.

    Raises
    ------
    InputError
        Where the method gave up: the time is long for so fast a motion.
    NotBuiltError
        Where the extension is not built.
    """
    work = np.array([effort, 0.0])
    rows, n_rows, status, steps = extension().taylor_rows(
        *normalized(scene), scene.omega, times, tolerance, effort=work
    )
    if status == GAVE_UP:
        count = "1 step" if steps == 1 else f"{steps} steps"
        raise TimedError(
            f"taylor gave up before t = {{time}} s after {count}; "
            + advice("take a shorter time or a larger tolerance", effort, work[1]),
            times[n_rows],
        )
    time = np.array(times[:n_rows], dtype=float)
    ended = "overflow" if status else "complete"
    return Trajectory(time, time, rows.T[:n_rows], None, steps, steps, ended)


def normalized(scene: Scene) -> tuple[Array, Array, Array, Array, Array]:
    """Return what the modern kernels take: everything divided by the moments.

    Returns
    -------
    coefficients, m_constant, m_rate : ndarray, shape (3,)
        A, B, C; torque over moment (1/s2) and its rate (1/s3).
    sines, cosines : ndarray, shape (4, n)
        Columns of amplitude (1/s2) and frequency (rad/s).

    Raises
    ------
    InputError
        Where one of them is too large for binary64.
    """
    law = scene.torque
    moments = np.array(scene.moments or (1.0, 1.0, 1.0))
    # A wave without amplitude has no effect, and would cost its sine and cosine.
    sines, cosines = (
        columns(tuple(wave for wave in waves if any(wave[0]))) for waves in (law.sines, law.cosines)
    )
    with np.errstate(over="ignore"):
        sines[:3] /= moments[:, None]
        cosines[:3] /= moments[:, None]
        found = (
            np.array(scene.euler_coefficients),
            np.array(law.constant) / moments,
            np.array(law.rate) / moments,
            sines,
            cosines,
        )
    if not all(np.isfinite(each).all() for each in found):
        raise InputError(
            "A, B, C or torque over moment is not finite; take moments nearer to each other, or "
            "smaller torques"
        )
    return found


def stop_reads_velocity(listing: Listing, may_stop: bool) -> bool:
    """Whether the stop test of a listing looks at the translational velocity."""
    return may_stop and listing.has("lipschitz-tests-velocity")


def columns(waves: tuple[Wave, ...]) -> Array:
    """Return amplitudes and frequencies as the kernels take them, shape (4, n)."""
    columns = np.empty((4, len(waves)), order="F")
    for index, (amplitude, frequency) in enumerate(waves):
        columns[:3, index] = amplitude
        columns[3, index] = frequency
    return columns

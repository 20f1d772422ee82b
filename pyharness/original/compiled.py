"""The compiled programs of the appendix: scenes in, trajectories out."""

from typing import Any

from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, columns, extension
from pyharness.model.listing import PROGRAMS, Listing, checked_listing
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import STOP_VARIABLES, Stop, Trajectory
from pyharness.model.values import number, truth


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


def stop_reads_velocity(listing: Listing, may_stop: bool) -> bool:
    """Whether the stop test of a listing looks at the translational velocity."""
    return may_stop and listing.has("lipschitz-tests-velocity")

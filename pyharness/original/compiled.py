"""The compiled programs of the appendix: scenes in, trajectories out."""

from dataclasses import replace
from typing import Any, NamedTuple

from pyharness.model.extension import ENDS, columns, extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, Stop, Trajectory
from pyharness.original.equations import initial_torque


def run(
    scene: Scene,
    listing: Listing,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
) -> Trajectory:
    """Run a program in Fortran: what `run_program` takes, but for the checks, and returns.

    NotBuiltError where the extension is not built.
    """
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


class Arguments(NamedTuple):
    """What the compiled `run_program` takes, in its order."""

    program: int
    flags: int
    by_moments: bool
    body: Any
    omega: Any
    masses: Any
    forces: Any
    torque_constant: Any
    torque_rate: Any
    torque_first: Any
    torque_varies: bool
    sines: Any
    cosines: Any
    step_size: float
    n_steps: int
    lipschitz: float
    may_stop: bool
    with_velocity: bool


def program_arguments(
    scene: Scene, listing: Listing, lipschitz: float, may_stop: bool, velocity: bool
) -> Arguments:
    """Return what the compiled `run_program` takes."""
    first = initial_torque(scene) if listing.has("initial-torque") else None
    if first is None and listing.has("initial-torque"):
        conjectures = listing.conjectures - {"initial-torque"}
        listing = replace(listing, conjectures=conjectures)
    law = scene.body_torque
    return Arguments(
        PROGRAMS.index(listing.program) + 1,
        listing.flags,
        scene.moments is not None,
        scene.moments or scene.coefficients,
        scene.omega,
        scene.masses,
        scene.forces,
        law.constant,
        law.rate,
        first or (0.0, 0.0, 0.0),
        law.varies,
        columns(law.sines),
        columns(law.cosines),
        scene.step_size,
        scene.steps,
        lipschitz,
        may_stop,
        velocity or stop_reads_velocity(listing, may_stop),
    )


def stop_reads_velocity(listing: Listing, may_stop: bool) -> bool:
    """Whether a run without velocity would end elsewhere."""
    return may_stop and listing.has("lipschitz-tests-velocity")

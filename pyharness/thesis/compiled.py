"""Runs of the thesis's programs compiled from the Fortran ports."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.extension import ENDS, columns, extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, Array, Stop, Trajectory
from pyharness.thesis.equations import initial_torque, trajectory_of


def run(
    scene: Scene,
    listing: Listing,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
) -> Trajectory:
    """Run a listing's compiled program; arguments are as in `run_program`, but not checked."""
    given = program_arguments(scene, listing, lipschitz, may_stop, velocity)
    rows, ier, n_rows, *ended = extension().run_program(*given)
    found = read_rows(listing, rows.T[:n_rows], ier, *ended)
    return found if velocity else replace(found, velocity=None)


def read_rows(
    listing: Listing, rows: Array, ier: NDArray[np.int32], status: int, evaluations: int,
    stop_variable: int, stop_quotient: float,
) -> Trajectory:  # fmt: skip
    """Return a compiled program's output as a trajectory; `rows` are as in `trajectory_of`."""
    n = len(rows)
    return trajectory_of(
        rows,
        evaluations=evaluations,
        ended=ENDS[status],
        stop=Stop(n, STOP_VARIABLES[stop_variable - 1], stop_quotient) if stop_variable else None,
        ier=None if listing.program == "runge-kutta" else ier[:n],
    )


def program_arguments(
    scene: Scene, listing: Listing, lipschitz: float, may_stop: bool, velocity: bool
) -> tuple[Any, ...]:
    """Return the arguments of the compiled function `run_program`."""
    first = initial_torque(scene) if listing.has("initial-torque") else None
    if first is None and listing.has("initial-torque"):
        conjectures = listing.conjectures - {"initial-torque"}
        listing = replace(listing, conjectures=conjectures)
    law = scene.body_torque
    return (
        PROGRAMS.index(listing.program) + 1,
        listing.flags,  # bit mask of defects, readings and conjectures
        scene.moments is not None,
        scene.moments or scene.coefficients,
        scene.omega,
        scene.masses,
        scene.forces,
        law.constant,
        law.rate,
        first or (0.0, 0.0, 0.0),  # initial torque over moments, rad/s2
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
    return may_stop and listing.has("lipschitz-tests-velocity")

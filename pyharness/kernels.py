"""The compiled programs: scenes in, trajectories out."""

from types import ModuleType

import numpy as np

from pyharness.errors import NotBuiltError
from pyharness.listing import PROGRAMS, Listing
from pyharness.scene import Scene, Wave
from pyharness.trajectory import STOP_VARIABLES, Array, Stop, Trajectory

_ENDED = ("complete", "stopped", "overflow")


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
    scene: Scene, listing: Listing, lipschitz: float = 500.0, may_stop: bool = True
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

    Returns
    -------
    Trajectory
        As `pyharness.original.<program>.run` returns it, to the last bit.

    Raises
    ------
    NotBuiltError
        Where the extension is not built.
    """
    rows, ier, n_rows, status, evaluations, variable, quotient = extension().run_program(
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
        _columns(scene.torque.sines),
        _columns(scene.torque.cosines),
        scene.step_size,
        scene.steps,
        lipschitz,
        may_stop,
    )
    results = rows.T[:n_rows]
    return Trajectory(
        time=results[:, 0],
        recorded_time=results[:, 1],
        omega=results[:, 2:5],
        velocity=results[:, 5:8],
        steps=n_rows,
        evaluations=evaluations,
        ended=_ENDED[status],
        stop=Stop(n_rows, STOP_VARIABLES[variable - 1], quotient) if variable else None,
        ier=None if listing.program == "runge-kutta" else ier[:n_rows],
    )


def _columns(waves: tuple[Wave, ...]) -> Array:
    columns = np.empty((4, len(waves)), order="F")
    for index, (amplitude, frequency) in enumerate(waves):
        columns[:3, index] = amplitude
        columns[3, index] = frequency
    return columns

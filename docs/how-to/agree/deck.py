"""The Runge-Kutta program of the thesis (Case 3) in Python: our twin of the deck."""

from pyharness import Listing, case_scene, run_program


def rows():
    run = run_program(
        case_scene(3), Listing.original("runge-kutta"), implementation="python", lipschitz=500.0
    )
    columns = zip(run.recorded_time, run.omega, run.velocity, strict=True)
    return [[time, *omega, *velocity] for time, omega, velocity in columns]

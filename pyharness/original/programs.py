"""The programs of the appendix, compiled or as twins, by name."""

import importlib
from dataclasses import dataclass
from typing import Any

from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS, Listing, checked_listing
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import number, truth
from pyharness.original import compiled

IMPLEMENTATIONS = ("fortran", "python")


@dataclass(frozen=True)
class Program:
    """A program of the appendix; its corrected error falls with `order` of the step."""

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
        """Run the program: what `run_program` takes and raises, for its own listings alone."""
        checked_scene(scene)
        checked_listing(listing)
        lipschitz = number("lipschitz", lipschitz)
        if not lipschitz >= 0.0:
            raise InputError(f"lipschitz is {lipschitz:g}; allowed: a number from 0")
        may_stop, velocity = truth("may_stop", may_stop), truth("velocity", velocity)
        if listing.program != self.name:
            raise InputError(f"program {self.name}: the listing is that of {listing.program}")
        if not isinstance(implementation, str) or implementation not in IMPLEMENTATIONS:
            raise unknown("implementation", implementation, IMPLEMENTATIONS)
        check_steps(scene, self.name, implementation, effort)
        return self._computed(scene, listing, implementation, lipschitz, may_stop, velocity)

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        """Compute what was checked; the options are those of `run`, but for the effort."""
        if implementation == "fortran":
            return compiled.run(scene, listing, *options)
        lipschitz, may_stop, _ = options
        twin = importlib.import_module(f"pyharness.original.{self.name.replace('-', '_')}")
        trajectory: Trajectory = twin.run(scene, listing, lipschitz, may_stop)
        return trajectory


PROGRAM_REGISTRY = {
    "two-term": Program("two-term", 2, "Jacobs 1982, IV.2 and appendix"),
    "four-term": Program("four-term", 2, "Jacobs 1982, IV.2 and appendix"),
    "runge-kutta": Program("runge-kutta", 4, "Jacobs 1982, eq. 31, IV.3 and appendix"),
}
assert tuple(PROGRAM_REGISTRY) == PROGRAMS


def run_program(
    scene: Scene,
    listing: Listing,
    implementation: str = "fortran",
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
    effort: float = 1.0,
) -> Trajectory:
    """Run the program of a listing.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    listing : Listing
        The program, its active defects and readings.
    implementation : {"fortran", "python"}
        The compiled program or its twin; both give the same bits.
    lipschitz : float
        Constant of the stop test (1/s), which only the Runge-Kutta program has.
    may_stop : bool
        Whether the stop test may end the run.
    velocity : bool
        Whether the velocity is wanted; the compiled program then computes it only if its
        stop test needs it. No other bit depends on this.
    effort : float
        Factor on the steps, times waves, that are run without being asked for.

    Raises
    ------
    InputError
        For what is no scene or listing, an unknown implementation, or more steps than `effort`
        allows.
    NotBuiltError
        Where the compiled program is asked for and not built.
    """
    program = PROGRAM_REGISTRY[checked_listing(listing).program]
    return program.run(scene, listing, implementation, lipschitz, may_stop, velocity, effort)

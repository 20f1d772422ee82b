"""The programs of the appendix, compiled or as twins, by name."""

import importlib
from dataclasses import dataclass
from typing import Any

from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS, Listing, checked_listing
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import boolean, number
from pyharness.original import compiled

IMPLEMENTATIONS = ("fortran", "python")
BINARY64 = "binary64"
COMPILED_WORDS = (BINARY64, "binary32", "binary128")
WORD_NAMES = (*COMPILED_WORDS, "cdc48", "cdc48-rounded")


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
        word: str = BINARY64,
    ) -> Trajectory:
        """Run the program: what `run_program` takes and raises, for its own listings alone."""
        checked_scene(scene)
        checked_listing(listing)
        lipschitz = number("lipschitz", lipschitz)
        if not lipschitz >= 0.0:
            raise InputError(f"lipschitz is {lipschitz:g}; allowed: a number from 0")
        may_stop, velocity = boolean("may_stop", may_stop), boolean("velocity", velocity)
        if listing.program != self.name:
            raise InputError(f"program {self.name}: the listing is that of {listing.program}")
        if not isinstance(implementation, str) or implementation not in IMPLEMENTATIONS:
            raise unknown("implementation", implementation, IMPLEMENTATIONS)
        if checked_word(word, implementation) != BINARY64:
            from pyharness.original import compiled_in_word, in_word

            check_steps(scene, self.name, work_of(word, implementation), effort)
            run = in_word.run if implementation == "python" else compiled_in_word.run
            return run(scene, listing, in_word.WORDS[word], lipschitz, may_stop)
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


def work_of(word: str, implementation: str) -> str:
    """Return what `check_steps` calls the way that a program is run in."""
    if word == BINARY64:
        return implementation
    return "another word" if implementation == "python" else word


def checked_word(word: object, implementation: str) -> str:
    """Return the name of a word; InputError for an unknown one, or one that Fortran has not."""
    if not isinstance(word, str) or word not in WORD_NAMES:
        raise unknown("word", word, WORD_NAMES, "--word")
    if word not in COMPILED_WORDS and implementation == "fortran":
        raise InputError(
            f"--word {word}: the compiled programs run in {', '.join(COMPILED_WORDS)} alone; "
            "allowed: implementation python"
        )
    return word


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
    word: str = BINARY64,
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
    word : str
        The arithmetic, one of `WORD_NAMES`; those not in `COMPILED_WORDS` with
        `implementation="python"` alone.

    Raises
    ------
    InputError
        For what is no scene or listing, an unknown implementation or word, a word that the
        compiled programs have not, or more steps than `effort` allows.
    NotBuiltError
        Where the compiled program is asked for and not built.
    """
    program = PROGRAM_REGISTRY[checked_listing(listing).program]
    options = lipschitz, may_stop, velocity, effort, word
    return program.run(scene, listing, implementation, *options)

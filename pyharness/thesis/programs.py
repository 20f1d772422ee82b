"""The three programs of the appendix, compiled or as Python ports."""

import importlib
from dataclasses import dataclass
from typing import Any

from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS, Listing, checked_listing
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import boolean, number
from pyharness.thesis import compiled

IMPLEMENTATIONS = ("fortran", "python")
BINARY64 = "binary64"
COMPILED_WORDS = (BINARY64, "binary32", "binary128")
WORD_NAMES = (*COMPILED_WORDS, "cdc48", "cdc48-rounded")


@dataclass(frozen=True)
class Program:
    """A program of the appendix."""

    name: str
    order: int  # order of convergence of the corrected version
    source: str  # where the thesis describes the program

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
        """Run the program; see `run_program`."""
        checked_scene(scene)
        checked_listing(listing)
        lipschitz = number("lipschitz", lipschitz)
        if not lipschitz >= 0.0:
            raise InputError(f"lipschitz is {lipschitz:g}; allowed: a number from 0")
        may_stop, velocity = boolean("may_stop", may_stop), boolean("velocity", velocity)
        if listing.program != self.name:
            raise InputError(
                f"program {self.name}: the listing belongs to program {listing.program}; give "
                f"the listing of {self.name}"
            )
        if not isinstance(implementation, str) or implementation not in IMPLEMENTATIONS:
            raise unknown("implementation", implementation, IMPLEMENTATIONS)
        if checked_word(word, implementation) != BINARY64:
            from pyharness.thesis import in_word

            check_steps(scene, self.name, work_of(word, implementation), effort)
            run = in_word.run if implementation == "python" else in_word.run_compiled
            return run(scene, listing, in_word.WORDS[word], lipschitz, may_stop)
        check_steps(scene, self.name, implementation, effort)
        return self._computed(scene, listing, implementation, lipschitz, may_stop, velocity)

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        if implementation == "fortran":
            return compiled.run(scene, listing, *options)
        lipschitz, may_stop, _ = options
        twin = importlib.import_module(f"pyharness.thesis.{self.name.replace('-', '_')}")
        trajectory: Trajectory = twin.run(scene, listing, lipschitz, may_stop)
        return trajectory


def work_of(word: str, implementation: str) -> str:
    """Return the key for the work limit of an arithmetic and implementation in `check_steps`."""
    if word == BINARY64:
        return implementation
    return "another word" if implementation == "python" else word


def checked_word(word: object, implementation: str) -> str:
    if not isinstance(word, str) or word not in WORD_NAMES:
        raise unknown("word", word, WORD_NAMES, "--word")
    if word not in COMPILED_WORDS and implementation == "fortran":
        raise InputError(
            f"--word {word}: the compiled programs run in {', '.join(COMPILED_WORDS)} only; "
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
    *,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    velocity: bool = True,
    effort: float = 1.0,
    word: str = BINARY64,
) -> Trajectory:
    """Run a program of the thesis, with a choice of its defects, on a scene.

    Parameters
    ----------
    scene : Scene
        Body, initial condition, torque, step size and number of steps.
    listing : Listing
        The program with its active defects, readings and conjectures.
    implementation : {"fortran", "python"}
        The compiled program or its Python port; the results are bit-for-bit identical.
    lipschitz : float
        Lipschitz constant of the stop test (1/s), which only the Runge-Kutta program has.
    may_stop : bool
        Whether the stop test may end the run.
    velocity : bool
        Whether to return the translational velocity. False affects only the compiled program in
        binary64, and no other results.
    effort : float
        Factor on the work limit. The work is the number of steps, increased for each sine or cosine
        of the torque.
    word : str
        The floating-point arithmetic: binary64, binary32, binary128, cdc48 or cdc48-rounded. The
        last two need `implementation="python"`.

    Returns
    -------
    Trajectory
        One row for each step, up to a stop or an overflow. In an arithmetic other than binary64,
        the attribute `exact` has the results as numbers of that arithmetic.

    Raises
    ------
    InputError
        If an argument has a wrong type or an unknown value, the compiled programs do not support
        the word, or the run exceeds the work limit.
    NotBuiltError
        If the compiled program is requested and the extension is not built.

    Examples
    --------
    >>> from pyharness import case_scene, run_program, subset
    >>> run = run_program(case_scene(2), subset("runge-kutta", "original"))
    >>> run.ended, run.stop.step, run.stop.variable
    ('stopped', 25, 'V2')
    """
    program = PROGRAM_REGISTRY[checked_listing(listing).program]
    options = lipschitz, may_stop, velocity, effort, word
    return program.run(scene, listing, implementation, *options)

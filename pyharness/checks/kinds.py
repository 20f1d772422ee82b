"""The kinds of checks of `verify`; a check's id begins with its kind."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain

from pyharness.checks.cells import cells, decks, random_programs, words
from pyharness.checks.check import Attempts, Check, Selection, run_suites, selected
from pyharness.checks.external import external_checks
from pyharness.checks.external_file import problems
from pyharness.checks.golden import golden
from pyharness.checks.methods import attitudes, methods, orders, prepared
from pyharness.checks.random_methods import random_attitudes, random_methods, random_torques
from pyharness.checks.schemes import schemes, stops


def _external(chosen: Selection) -> Iterator[Check]:
    asked = problems() if chosen.problems is None else chosen.problems
    found = external_checks(asked, _THIN_EXTERNAL if chosen.thin else chosen.only)
    return (check for check in found if selected(check.id, chosen.only))


_THIN_EXTERNAL = [
    f"external/detest-b5/20/{name}" for name in ("reference", "taylor", "gauss-4", "runge-kutta")
]

_RANDOM = (random_programs, random_methods, random_attitudes, random_torques)
KINDS: dict[str, Callable[[Selection], Attempts]] = {
    # Fortran against the Python twin for every cell: all bits of the trajectory, the counters, and
    # the stop.
    "cells": cells,
    # Our arithmetic of machine words: test vectors of the CDC, binary64 against the processor, and
    # the compiled programs against the Python twins in other words.
    "words": words,
    # The decks, compiled from the author's cards, against the Fortran port: TAPE5 and the page.
    "decks": decks,
    # Every step of the corrected programs against its scheme, within rounding.
    "schemes": schemes,
    # The step and the reason of the Runge-Kutta program's stop, against the formula of its test.
    "stops": stops,
    # Methods against the reference, within the requested tolerance.
    "methods": methods,
    "prepared": prepared,
    # Attitudes against the reference, in the cases and by prepared solvers.
    "attitudes": attitudes,
    # The power with which the error decreases as the step is halved: of corrected programs against
    # `solve_ivp`, of methods with a fixed step against the reference.
    "orders": orders,
    # Programs, methods and attitudes in scenes drawn from a seed, half of them of the difficult
    # kinds in `NASTY`; methods under torques that depend on omega or attitude.
    "random": lambda chosen: chain.from_iterable(each(chosen) for each in _RANDOM),
    # Methods and programs against published results that were not computed here.
    "external": _external,
    # Trajectories against the golden record of an earlier run.
    "golden": golden,
}
# These kinds read files that the user may specify.
_OF_THE_USER = ("external", "golden")


def verify(chosen: Selection) -> Iterator[Check]:
    """Yield the results of the requested checks, each computed when it is reached."""
    suites = {kind: partial(attempts, chosen) for kind, attempts in KINDS.items()}
    return run_suites(suites, chosen.only, "verify", _OF_THE_USER)

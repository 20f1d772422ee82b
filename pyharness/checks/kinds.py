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
    # Fortran against Python: all bits of the trajectory, the counts, and the stop.
    "cells": cells,
    # Simulated machine arithmetic: CDC test vectors, our binary64 against the processor's, and
    # compiled programs against Python.
    "words": words,
    # Decks, compiled from the author's cards, against the Fortran port: TAPE5 and printed page.
    "decks": decks,
    # Each step of the corrected programs against its scheme, within rounding.
    "schemes": schemes,
    # Step and reason of the Runge-Kutta program's stop, against the formula of its test.
    "stops": stops,
    # Omega against the reference, within the requested tolerance.
    "methods": methods,
    "prepared": prepared,
    # The attitude against the reference, by `solve` and by prepared solvers.
    "attitudes": attitudes,
    # Orders of convergence, as the step size is halved.
    "orders": orders,
    # Programs and methods in random scenes, half of them of the difficult kinds in `NASTY`.
    "random": lambda chosen: chain.from_iterable(each(chosen) for each in _RANDOM),
    # Programs and methods against published results.
    "external": _external,
    # Programs and methods against trajectories of an earlier run.
    "golden": golden,
}
# Kinds that read files which the user may specify.
_OF_THE_USER = ("external", "golden")


def verify(chosen: Selection) -> Iterator[Check]:
    suites = {kind: partial(attempts, chosen) for kind, attempts in KINDS.items()}
    return run_suites(suites, chosen.only, "verify", _OF_THE_USER)

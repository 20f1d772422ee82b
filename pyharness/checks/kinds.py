"""Verify: bits between languages, error against the truth, and what changed since it was recorded.

The first part of a check's name is its kind.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain

from pyharness.checks.cells import cells, random_programs
from pyharness.checks.check import Attempts, Check, run_suites
from pyharness.checks.decks import decks
from pyharness.checks.external import external_checks
from pyharness.checks.external_file import problems
from pyharness.checks.golden import golden
from pyharness.checks.methods import attitudes, methods, prepared
from pyharness.checks.orders import orders
from pyharness.checks.random_methods import random_attitudes, random_methods
from pyharness.checks.schemes import schemes
from pyharness.checks.selection import Selection
from pyharness.checks.stops import stops
from pyharness.checks.words import words


def _external(chosen: Selection) -> Iterator[Check]:
    asked = problems() if chosen.problems is None else chosen.problems
    for check in external_checks(asked, _THIN_EXTERNAL if chosen.thin else chosen.only):
        if chosen.asks(check.id):
            yield check


_THIN_EXTERNAL = [
    f"external/detest-b5/20/{name}" for name in ("reference", "taylor", "gauss-4", "runge-kutta")
]

KINDS: dict[str, Callable[[Selection], Attempts]] = {
    # Program x case x listing x reading: Fortran against twin, bit for bit over the whole
    # trajectory, counters and stop.
    "cells": cells,
    # Binary64 by our own arithmetic against the processor's, and the CDC's vectors.
    "words": words,
    # The decks, compiled from the author's own cards, against the port: TAPE5 and the page.
    "decks": decks,
    # Every step of the corrected programs against its scheme, to rounding.
    "schemes": schemes,
    # Where and why the Runge-Kutta program stops, against the formula of its test.
    "stops": stops,
    # Modern methods against the reference, within the tolerance that they were given.
    "methods": methods,
    "prepared": prepared,
    # Where the body points, against the reference: cases, prepared solvers, random scenes.
    "attitudes": attitudes,
    # Corrected programs against `solve_ivp`, fixed-step methods against the reference: the power
    # with which the error falls as the step is halved.
    "orders": orders,
    # All of these in scenes drawn from a seed, half of them nasty.
    "random": lambda chosen: chain(
        random_programs(chosen), random_methods(chosen), random_attitudes(chosen)
    ),
    # Published figures that nobody here computed.
    "external": _external,
    # Trajectories as they were recorded.
    "golden": golden,
}
# What these read is the user's.
_OF_THE_USER = ("external", "golden")


def verify(chosen: Selection) -> Iterator[Check]:
    """Make the checks requested, one after another."""
    suites = {kind: partial(attempts, chosen) for kind, attempts in KINDS.items()}
    return run_suites(suites, chosen.only, "verify", _OF_THE_USER)

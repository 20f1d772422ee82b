"""The effects of apparatus entries, such as defects, on the errors of the programs."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pyharness.checks.compare.agreement import accuracy
from pyharness.model.effort import check_steps
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import Listing, names_of, subset, switches
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import Stop
from pyharness.thesis.cells import subsets
from pyharness.thesis.programs import run_program
from pyharness.truth.reference import Reference, reference


@dataclass(frozen=True)
class Effect:
    """The outcome of one listing on one scene.

    `omega` (rad/s) and `velocity` (m/s) are the largest errors over the completed `steps`.
    """

    listing: Listing
    omega: float
    velocity: float
    steps: int
    ended: str
    stop: Stop | None


@dataclass(frozen=True)
class CaseEffects:
    """The outcomes of four listings in one program and case, which show the effect of one entry.

    In `corrected_alone` only this entry is corrected; in `kept_alone` only this one is kept.
    """

    program: str
    case: int
    original: Effect
    corrected_alone: Effect
    kept_alone: Effect
    corrected: Effect


def entries(kind: str | None = None) -> list[dict[str, Any]]:
    """Return the apparatus entries of one kind, or all; raise InputError for an unknown kind."""
    everything: list[dict[str, Any]] = facts("apparatus")["entry"]
    kinds = sorted({entry["kind"] for entry in everything})
    if kind is not None and kind not in kinds:
        raise unknown("kind", kind, kinds, "--kind")
    return [entry for entry in everything if kind in (None, entry["kind"])]


def entry(name: str) -> dict[str, Any]:
    """Return the apparatus entry `name`; raise InputError if there is none."""
    by_name = {each["id"]: each for each in entries()}
    if name not in by_name:
        raise unknown("entry", name, list(by_name))
    return by_name[name]


def effect(scene: Scene, listing: Listing, truth: Reference, effort: float = 1.0) -> Effect:
    """Return the outcome of a listing on a scene, with errors against `truth`."""
    run = run_program(scene, listing, effort=effort)
    found = accuracy(scene, run, truth)
    velocity = math.nan if found.velocity is None else found.velocity
    return Effect(listing, max(found.omega), velocity, run.steps, run.ended, run.stop)


@cache
def case_truth(case: int) -> Reference:
    """Return the reference solution of a case at its steps, with translational velocity."""
    scene = case_scene(case)
    return reference(scene, scene.times(), velocity=True)


def effects_of(name: str) -> Iterator[CaseEffects]:
    """Yield the effect of an apparatus entry in each of its programs and every case.

    For a reading or a conjecture, `original` and `corrected_alone` are the original listing with
    and without it; `kept_alone` and `corrected` are the corrected listing with and without it.
    """
    known = entry(name)
    for program in known["programs"]:
        first, last = Listing.original(program), Listing.corrected(program)
        if known["kind"] == "reading":
            listings = Listing.original(program, [name]), first, Listing(program, [name]), last
        elif known["kind"] == "conjecture":
            with_it, without = first.conjectures | {name}, first.conjectures - {name}
            listings = (
                replace(first, conjectures=with_it),
                replace(first, conjectures=without),
                Listing(program, [name]),
                last,
            )
        else:
            fixed = subset(program, "original", fix=[name])
            listings = first, fixed, subset(program, "corrected", keep=[name]), last
        for case in case_numbers():
            scene, truth = case_scene(case), case_truth(case)
            yield CaseEffects(program, case, *(effect(scene, each, truth) for each in listings))


def lattice(
    scene: Scene, program: str, readings: tuple[str, ...] = (), effort: float = 1.0
) -> list[Effect]:
    """Return a program's outcomes with every subset of its defects, largest error first.

    The `readings` and, under a varying torque, the conjectures vary too. A reading has no effect if
    a defect in the same statement is corrected.
    """
    check_steps(scene, program, "fortran", effort)
    truth = reference(scene, scene.times(), velocity=True, effort=effort)
    listings = [Listing(program, each) for each in subsets((*switched(scene, program), *readings))]
    found = [effect(scene, listing, truth, effort=effort) for listing in listings]
    return sorted(found, key=_size, reverse=True)


def switched(scene: Scene, program: str) -> tuple[str, ...]:
    """Return a program's defects and, under a varying torque, its conjectures."""
    return switches(program) if scene.torque.varies else names_of("defect", program)


def _size(found: Effect) -> tuple[float, float]:
    # An overflow is worse than any finite error.
    worst = math.inf if found.ended == "overflow" else found.omega
    # Rounded to three digits, so that rounding errors do not affect the order.
    return float(f"{worst:.2e}"), float(f"{found.velocity:.2e}")

"""What each defect does: alone corrected, alone kept, and in every company."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pyharness.compare.agreement import accuracy
from pyharness.model.effort import check_steps
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import Listing, corrected, names_of, original, subset, switches
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import Stop
from pyharness.original.cells import subsets
from pyharness.original.programs import run_program
from pyharness.truth.reference import Reference, reference


@dataclass(frozen=True)
class Effect:
    """What one listing makes of a scene: largest errors (rad/s, m/s) at the steps that were run."""

    listing: Listing
    omega: float
    velocity: float
    steps: int
    ended: str
    stop: Stop | None


@dataclass(frozen=True)
class CaseEffects:
    """A defect or reading in one program and case, alone corrected and alone kept."""

    program: str
    case: int
    original: Effect
    corrected_alone: Effect
    kept_alone: Effect
    corrected: Effect


def entries(kind: str | None = None) -> list[dict[str, Any]]:
    """Return the entries of the apparatus, of one kind or of all; InputError for no such kind."""
    everything: list[dict[str, Any]] = facts("apparatus")["entry"]
    kinds = sorted({entry["kind"] for entry in everything})
    if kind is not None and kind not in kinds:
        raise unknown("kind", kind, kinds, "--kind")
    return [entry for entry in everything if kind in (None, entry["kind"])]


def entry(name: str) -> dict[str, Any]:
    """Return an entry of the apparatus; InputError where there is none of that name."""
    by_name = {each["id"]: each for each in entries()}
    if name not in by_name:
        raise unknown("entry", name, list(by_name))
    return by_name[name]


def effect(scene: Scene, listing: Listing, truth: Reference, effort: float = 1.0) -> Effect:
    """Run a listing and hold it against the truth (with velocity) at the scene's times."""
    run = run_program(scene, listing, effort=effort)
    found = accuracy(scene, run, truth)
    velocity = math.nan if found.velocity is None else found.velocity
    return Effect(listing, max(found.omega), velocity, run.steps, run.ended, run.stop)


@cache
def case_truth(case: int) -> Reference:
    """Return the truth of a case with velocity, computed once."""
    scene = case_scene(case)
    return reference(scene, scene.times(), velocity=True)


def effects_of(name: str) -> Iterator[CaseEffects]:
    """Yield what a flagged defect or reading does in each of its programs, case by case.

    For a reading, which no listing has by default, *original* has it and *corrected alone* has not.
    """
    known = entry(name)
    for program in known["programs"]:
        first, last = original(program), corrected(program)
        if known["kind"] == "reading":
            listings = original(program, [name]), first, Listing(program, [name]), last
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
    """Return the effect of every subset of a program's defects, largest error of omega first.

    The readings are in the subsets like defects: the corrected program has none.
    """
    check_steps(scene, program, "fortran", effort)
    truth = reference(scene, scene.times(), velocity=True, effort=effort)
    listings = [Listing(program, each) for each in subsets((*switched(scene, program), *readings))]
    found = [effect(scene, listing, truth, effort=effort) for listing in listings]
    return sorted(found, key=_size, reverse=True)


def switched(scene: Scene, program: str) -> tuple[str, ...]:
    """Return what can be switched off to an effect: of a constant torque nothing is assumed."""
    return switches(program) if scene.torque.varies else names_of("defect", program)


def _size(found: Effect) -> tuple[float, float]:
    # What overflowed is worse than anything that did not.
    worst = math.inf if found.ended == "overflow" else found.omega
    # Three digits: what differs by rounding alone is a tie.
    return float(f"{worst:.2e}"), float(f"{found.velocity:.2e}")

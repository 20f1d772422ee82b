"""Linear stability of each program: its own steps against the amplification matrix derived."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.compare.checks import bounded, described, may_hold, selected
from pyharness.model.listing import PROGRAMS, Listing, corrected, original, subset
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene
from pyharness.stress.disturbances import (
    Probe,
    complex_step,
    eigenvalues,
    first_step,
    held_steady,
    later_steps,
    moving_step,
    observed_boundary,
)
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory.amplification import amplification, weight_of_squares

NAME = "regions"
# A, B, C and a steady omega, with few binary digits: eigenvalues of all kinds on both sides.
_STEADY: dict[str, tuple[Triple, Triple]] = {
    "spin": ((0.5, -0.5, 0.25), (0.0, 0.0, 1.0)),
    "middle-axis": ((0.5, 0.5, 0.25), (0.0, 0.0, 1.0)),
    "spiral-out": ((1.0, -0.5, 0.25), (1.0, 1.0, 1.0)),
    "spiral-in": ((1.0, -0.5, 0.25), (1.0, 1.0, -1.0)),
    "fast-spiral": ((2.0, -1.5, 0.5), (1.0, 1.0, 1.0)),
    "saddle": ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0)),
    "tilted": ((1.5, 0.5, -0.75), (1.0, -1.0, 1.0)),
}
_STEPS = (0.25, 0.5, 1.0, 2.0)
_TOPS = {"imaginary": (1.0, -1.0, 0.0), "real": (1.0, 1.0, 0.0)}
_COUNTS = (1, 10, 100)
_COMPLEX = (-1.0 + 1.0j, -2.0 + 0.0j, 2.0j, 0.1j, -0.5 - 1.5j, 0.3 + 2.8j)
_DIRECTIONS = {"real": -1.0 + 0.0j, "imaginary": 1.0j}


def listings() -> dict[str, list[Listing]]:
    """Return each original program and corrected; Runge-Kutta with either defect too."""
    found = {program: [original(program), corrected(program)] for program in PROGRAMS}
    for name in ("stage-base", "base-not-restored"):
        found["runge-kutta"].append(subset("runge-kutta", keep=[name]))
    return found


def label(listing: Listing) -> str:
    """Return `original`, `corrected`, or the defects that are kept."""
    return "-".join(sorted(listing.defects)) if listing.label == "custom" else listing.label


def run(only: Sequence[str]) -> Iterator[Outcome]:
    """Hold the steps of every program against its matrix."""
    for program, members in listings().items():
        for listing in members:
            prefix = f"{NAME}/{program}/{label(listing)}"
            if may_hold(prefix, only):
                yield from _listing(prefix, listing, only)


def _listing(prefix: str, listing: Listing, only: Sequence[str]) -> Iterator[Outcome]:
    id = f"{prefix}/polynomial"
    if selected(id, only):
        yield Outcome(described(id, None, replay(id), amplification(listing).text()))
    for name, (coefficients, omega) in _STEADY.items():
        for step in _STEPS:
            scene = held_steady(coefficients, omega, step)
            yield from _probed(
                f"{prefix}/first-step-{name}-{step:g}",
                only,
                partial(first_step, scene, listing),
                scene,
                "z = " + ", ".join(f"{z:.3g}" for z in eigenvalues(scene)),
            )
    for name, coefficients in _TOPS.items():
        for step in (0.125, 0.5, 2.0):
            for count in _COUNTS:
                scene = Scene(
                    f"top, {name} eigenvalues", (1.0, 0.0, 1.0), coefficients=coefficients,
                    step_size=step, steps=count,
                )  # fmt: skip
                yield from _probed(
                    f"{prefix}/{count}-steps-{name}-{step:g}",
                    only,
                    partial(later_steps, scene, listing),
                    scene,
                )
    if listing.program == "runge-kutta":
        if label(listing) == "base-not-restored":
            return  # two eigenvalues of like size: no one growth to look for
    else:
        yield from _collocation(prefix, listing, only)
    for name, direction in _DIRECTIONS.items():
        yield from _probed(
            f"{prefix}/boundary-{name}",
            only,
            partial(observed_boundary, listing, direction),
        )
    for case in (2, 3, 4):
        id = f"{prefix}/spin-case-{case}"
        if selected(id, only):
            yield _spin(id, listing, case)


def _collocation(prefix: str, listing: Listing, only: Sequence[str]) -> Iterator[Outcome]:
    for count in _COUNTS:
        for z in _COMPLEX:
            yield from _probed(
                f"{prefix}/step-{count}-at-{z:.2g}".replace("+0j", ""),
                only,
                partial(complex_step, listing, count, z),
            )
        for case in (5, 6):
            scene = case_scene(case)
            yield from _probed(
                f"{prefix}/step-{count}-case-{case}",
                only,
                partial(moving_step, scene, listing, count),
                scene,
                f"weight of s^2: {weight_of_squares(listing, count)}, 1/3 is true",
            )


def _probed(
    id: str,
    only: Sequence[str],
    probe: Callable[[], Probe],
    scene: Scene | None = None,
    note: str = "",
) -> Iterator[Outcome]:
    if not selected(id, only):
        return
    found = probe()
    if not note and found.found.size == 1:
        note = f"{found.found.item():.6g}"
    yield Outcome(bounded(id, found.difference, found.limit, replay(id), note), scene)


def _spin(id: str, listing: Listing, case: int) -> Outcome:
    """Say by what factor the wobble of a case's spin about axis 3 grows in a step."""
    scene = case_scene(case)
    z = eigenvalues(replace(scene, omega=(0.0, 0.0, scene.omega[2])))
    spin = z[np.argmax(np.abs(z))]
    growth = float(amplification(listing).radius(np.array(spin))) - 1.0
    note = f"z = {abs(spin):.3g} i at {scene.step_size:g} s: 1 + {growth:.2g} a step"
    return Outcome(described(id, growth, replay(id), note), scene)


TRIAL = Trial(
    NAME,
    "linear stability of each program, from its own amplification matrix",
    "rounding alone: the derived matrix is exact, differences of a step, a polynomial of known "
    "degree, are exact, and every rounding is one of a term no larger than with all signs "
    "positive (Higham 2002, theorem 9.4, for the systems)",
    run,
)

"""Trial of linear stability: each program's steps against its amplification matrix."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.disturbances import (
    ROUNDED,
    Probe,
    complex_step,
    eigenvalues,
    first_step,
    later_steps,
    moving_step,
    observed_boundary,
    steady_scene,
)
from pyharness.checks.hold import scene_of
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.theory.amplification import amplification, weight_of_squares
from pyharness.model.listing import Listing, subset
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene

# A, B, C and a steady omega (rad/s), with few binary digits, whose eigenvalues are real, imaginary
# and complex, in both half-planes.
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


def _attempts() -> Iterator[Attempt]:
    halves = [subset("runge-kutta", keep=[name]) for name in ("stage-base", "base-not-restored")]
    for listing in (*LISTINGS, *halves):
        label = "-".join(sorted(listing.defects)) if listing in halves else listing.label
        yield Attempt(named("regions", listing.program, label), partial(_attempt, listing))


def _attempt(listing: Listing, name: Name) -> Iterator[Check | Attempt]:
    told = amplification(listing).text()
    yield replace(name, setting="polynomial").described(None, told)
    for kind, (coefficients, omega) in _STEADY.items():
        for step in _STEPS:
            scene = steady_scene(coefficients, omega, step)
            note = "z = " + ", ".join(f"{z:.3g}" for z in eigenvalues(scene))
            probe = partial(first_step, scene, listing)
            yield _probed(name, f"first-step-{kind}-{step:g}", probe, scene, note)
    for kind, coefficients in _TOPS.items():
        for step in (0.125, 0.5, 2.0):
            top = Scene(f"top, {kind} eigenvalues", (1.0, 0.0, 1.0), coefficients=coefficients)
            for count in _COUNTS:
                scene = replace(top, step_size=step, steps=count)
                probe = partial(later_steps, scene, listing)
                yield _probed(name, f"{count}-steps-{kind}-{step:g}", probe, scene)
    if listing.program != "runge-kutta":
        for count in _COUNTS:
            for z in _COMPLEX:
                setting = f"step-{count}-at-{z:.2g}".replace("+0j", "")
                yield _probed(name, setting, partial(complex_step, listing, count, z))
            note = f"weight of s^2: {weight_of_squares(listing, count)}, 1/3 is true"
            for case in (5, 6):
                scene = case_scene(case)
                probe = partial(moving_step, scene, listing, count)
                yield _probed(name, f"step-{count}-case-{case}", probe, scene, note)
    elif listing.defects == {"base-not-restored"}:
        return  # two eigenvalues have similar magnitudes, so that there is no single growth rate
    for kind, direction in _DIRECTIONS.items():
        yield _probed(name, f"boundary-{kind}", partial(observed_boundary, listing, direction))
    for case in (2, 3, 4):
        own = replace(name, setting=f"spin-case-{case}", scene=case_scene(case))
        yield Attempt(own, partial(_spin, listing))


def _probed(
    name: Name, setting: str, probe: Callable[[], Probe], scene: Scene | None = None, note: str = ""
) -> Attempt:
    def make(name: Name) -> Check:
        found = probe()
        seen = f"{found.found.item():.6g}" if not note and found.found.size == 1 else note
        return name.bounded(found.difference, found.limit, ROUNDED, seen)

    return Attempt(replace(name, setting=setting, scene=scene), make)


def _spin(listing: Listing, name: Name) -> Check:
    """Return the growth per step of a wobble about axis 3, as a check without a limit."""
    scene = scene_of(name)
    z = eigenvalues(replace(scene, omega=(0.0, 0.0, scene.omega[2])))
    spin = z[np.argmax(np.abs(z))]
    growth = float(amplification(listing).radius(np.array(spin))) - 1.0
    note = f"z = {abs(spin):.3g} i at {scene.step_size:g} s: 1 + {growth:.2g} a step"
    return name.described(growth, note)


TRIAL = Trial(
    "regions",
    "linear stability of each program, compared with its derived amplification matrix",
    "Rounding errors alone, since the derived matrix is exact and the result of a step is a "
    "polynomial of known degree, whose differences have no truncation error. Each rounding error "
    "is at most that of the same sum with all signs positive; for linear systems Higham 2002, "
    "theorem 9.4.",
    lambda only: _attempts(),
)

"""Methods and programs against the truth on one scene, each within a bound derived beforehand."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.checks import Check, bounded, described, may_hold, selected
from pyharness.conditioning import Conditioning, conditioning
from pyharness.errors import InputError
from pyharness.listing import PROGRAMS, corrected, original
from pyharness.methods import METHODS, PROGRAM_REGISTRY, solve
from pyharness.reference import Reference, reference
from pyharness.scene import Scene
from pyharness.stress import Outcome, replay

# Ours at two tolerances: near the finest, where rounding shows, and a middling one.
OURS = ("closed-form", "taylor", "gauss-2", "gauss-4", "gauss-8")
SCIPY = ("dop853", "lsoda")
_MIDDLING = 1e-6


@dataclass(frozen=True, eq=False)
class Truth:
    """The solution of a scene at one time, and what the flow makes of small errors until then."""

    time: float
    omega: np.ndarray
    error: float
    flow: Conditioning


def truth_of(scene: Scene, time: float) -> Truth:
    """Return the truth at `time` (s)."""
    flow = conditioning(scene, time)
    # The reference's steps have 1e-22 each: where the flow amplifies more, more digits.
    known: Reference = reference(scene, [time], precise=flow.amplification > 1e3)
    return Truth(time, known.omega[-1], known.error, flow)


def hold_methods(
    trial: str,
    circumstance: str,
    scene: Scene,
    time: float,
    only: Sequence[str] = (),
    methods: Sequence[str] = (*OURS, *SCIPY),
) -> Iterator[Outcome]:
    """Hold each method against the truth at `time`, at its finest tolerance and at 1e-6.

    The limit is the tolerance amplified by the flow, rounding amplified likewise, and what the
    truth itself may be wrong by. A method that refuses the scene says so: that is described.
    """
    names = [m for m in methods if may_hold(f"{trial}/{m}", only)]
    if not names:
        return
    truth = truth_of(scene, time)
    for name in names:
        finest = METHODS[name].finest
        for tolerance in sorted({finest, max(finest, _MIDDLING)}):
            id = f"{trial}/{name}/{circumstance}/{tolerance:.0e}"
            if selected(id, only):
                yield Outcome(_held(id, scene, truth, name, tolerance), scene)


def _held(id: str, scene: Scene, truth: Truth, name: str, tolerance: float) -> Check:
    try:
        run = solve(scene, [truth.time], name, tolerance)
    except InputError as refusal:
        return described(id, None, replay(id), f"refused: {refusal}")
    error = math.inf
    if run.ended == "complete":
        error = float(np.abs(run.omega[-1] - truth.omega).max()) / truth.flow.largest
    limit = truth.flow.limit(tolerance) + truth.error / truth.flow.largest
    return bounded(id, error, limit, replay(id), "" if run.ended == "complete" else run.ended)


def describe_programs(
    trial: str, circumstance: str, scene: Scene, only: Sequence[str] = ()
) -> Iterator[Outcome]:
    """Say how far the programs, as punched and as mended, are from the truth over their steps."""
    asked = [p for p in PROGRAMS if may_hold(f"{trial}/{p}", only)]
    if not asked:
        return
    truth = reference(scene, scene.times())
    scale = float(np.abs(truth.omega).max(initial=max(map(abs, scene.omega)))) or 1.0
    for program in asked:
        for listing in (original(program), corrected(program)):
            id = f"{trial}/{program}/{circumstance}/{listing.label}"
            if not selected(id, only):
                continue
            run = PROGRAM_REGISTRY[program].run(scene, listing, may_stop=False, velocity=False)
            n = min(len(run.omega), len(truth.omega))
            error = float(np.abs(run.omega[:n] - truth.omega[:n]).max(initial=0.0)) / scale
            note = "" if run.ended == "complete" else f"{run.ended} after {run.steps} steps"
            yield Outcome(described(id, error, replay(id), note), scene)

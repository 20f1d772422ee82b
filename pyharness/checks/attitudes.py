"""Attitude against the reference: in the cases, and in scenes drawn from a seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import REFUSED, Check, Sample, bounded
from pyharness.checks.selection import Selection, replay
from pyharness.methods.prepared import prepare
from pyharness.methods.problem import closed_form
from pyharness.methods.registry import METHODS, SCIPY_METHODS
from pyharness.methods.solve import finest, solve
from pyharness.model.attitude import Quaternion, angle_between
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.scenes.random_scenes import draw
from pyharness.theory.conditioning import Conditioning, conditioning
from pyharness.truth.reference import Reference, reference

_START: Quaternion = (0.5, -0.1, 0.7, 0.5)
_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
_SCIPY_TOLERANCES = (1e-6, 1e-9)
_LATER = 3.0
_RANDOM = ("auto", "taylor", "prepared")
_ENDS = (1.0, 3.0, -1.0)
# Draws that are tried: the truth costs more than the methods do.
_EVERY = 20
_EFFORT = 0.05
_EARLIER = 0.4  # of the last time


@dataclass(frozen=True, eq=False)
class Standard:
    """The truth at some times, and what the flow makes of small errors until then."""

    truth: Reference
    flow: Conditioning

    def limit(self, tolerance: float) -> float:
        """Return the largest error of an angle that a method may have (rad)."""
        return self.flow.angle_limit(tolerance, self.truth.time[-1]) + self.truth.angle_error


def attitudes(chosen: Selection) -> Iterator[Check]:
    """Hold every method that carries the attitude to the reference."""
    for case in (4, 5) if chosen.thin else case_numbers():
        scene = replace(case_scene(case), attitude=_START)
        standard = cache(partial(_standard, scene, (*scene.times()[9::10], _LATER)))
        for name, method in METHODS.items():
            if method.attitude and name != "reference":
                for tolerance in _tolerances(name, method.finest, chosen.thin):
                    if chosen.asks(id := f"attitudes/{name}/case-{case}/{tolerance:.1e}"):
                        yield _held(id, scene, name, tolerance, standard())
        for t_end in _ENDS:
            end = cache(partial(_standard, scene, (t_end,)))
            for name in ("auto", "taylor"):
                for tolerance in (1e-6,) if chosen.thin else _TOLERANCES:
                    id = f"attitudes/prepared-{name}/case-{case}/{t_end:g}/{tolerance:.1e}"
                    if chosen.asks(id):
                        yield _held_prepared(id, scene, name, tolerance, end())


def random_attitudes(chosen: Selection) -> Iterator[Check]:
    """Hold the choice of a method and the series to the reference in scenes drawn from the seed."""
    for number in range(0, chosen.draws, _EVERY):
        ids = {name: f"random/{number}/attitude-{name}" for name in _RANDOM}
        asked = {name: id for name, id in ids.items() if chosen.asks(id)}
        if asked:
            yield from _drawn(chosen, number, asked)


def _drawn(chosen: Selection, number: int, asked: Mapping[str, str]) -> Iterator[Check]:
    drawn = draw(chosen.seed, number)
    scene = replace(drawn.scene, attitude=_START)
    try:
        standard = _standard(scene, (_EARLIER * drawn.time, drawn.time), _EFFORT)
    except InputError:
        # Too fast or too long a motion for any truth, or one that runs away.
        return
    if not standard.limit(0.0) < 1.0:
        return
    tolerance = drawn.tolerance(METHODS["taylor"].finest)
    for name, id in asked.items():
        if name == "prepared":
            made = _held_prepared(id, scene, "auto", tolerance, standard)
        else:
            made = _held(id, scene, name, tolerance, standard)
        growth = standard.flow.amplification
        told = f"{drawn.scene.name}, tolerance {tolerance:.2g}, growth {growth:.3g}"
        yield Sample(
            id, made.passed, made.value, made.limit, chosen.replay_of_draw(id),
            f"{told}: {made.note}" if made.note else told, f"attitude-{name}", tolerance,
            growth,
        )  # fmt: skip


def _standard(scene: Scene, times: Sequence[float], effort: float | None = None) -> Standard:
    flow = conditioning(scene, times[-1])
    # The reference's steps are good to 1e-22: where the flow amplifies more, more is asked.
    truth = reference(scene, times, precise=flow.amplification > 1e3, effort=effort)
    if len(truth.time) < len(times):
        raise InputError("the solution leaves every bound")
    # In the cases a tolerance is meant as it stands.
    return Standard(truth, flow if effort else replace(flow, amplification=1.0))


def _held(id: str, scene: Scene, name: str, tolerance: float, standard: Standard) -> Check:
    """Return the check that a method keeps a tolerance on the angle at all times of the truth.

    A closed form has to refuse where there is none.
    """
    has_form = name != "closed-form" or closed_form(scene) is not None
    truth = standard.truth
    if name in SCIPY_METHODS:
        # Where the way is long it can't be told to err so little.
        tolerance = max(tolerance, 1.01 * finest(name, scene, float(truth.time[-1])))
    try:
        run = solve(scene, truth.time.tolist(), name, tolerance, attitude=True)
    except InputError as refusal:
        return Check(id, not has_form, None, None, replay(id), f"{REFUSED}{refusal}")
    if not has_form:
        return Check(id, False, None, None, replay(id), "solved what has no closed form")
    if not run.has_all_rows or run.attitude is None or truth.attitude is None:
        return Check(id, False, None, None, replay(id), f"{run.ended}, not every row")
    error = float(angle_between(run.attitude, truth.attitude).max())
    return bounded(id, error, standard.limit(tolerance), replay(id))


def _held_prepared(id: str, scene: Scene, name: str, tolerance: float, standard: Standard) -> Check:
    """Return the check that a prepared solver keeps a tolerance on the angle at the end."""
    truth = standard.truth
    assert truth.attitude is not None
    solver, start = prepare(scene, name, tolerance, attitude=True), np.array(scene.omega)
    # A call from another start, of which nothing may stay.
    solver(start[::-1].copy(), 0.5, (0.0, 0.0, 1.0, 0.0))
    _, found = solver(start, float(truth.time[-1]))
    error = float(angle_between(found[None, :], truth.attitude[-1:])[0])
    note = "" if solver.status == "complete" else solver.status
    return bounded(id, error, standard.limit(tolerance), replay(id), note)


def _tolerances(name: str, finest: float, thin: bool) -> list[float]:
    if name in SCIPY_METHODS:
        return [_SCIPY_TOLERANCES[0]] if thin else list(_SCIPY_TOLERANCES)
    return [1e-9] if thin else [*_TOLERANCES, finest]

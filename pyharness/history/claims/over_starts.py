"""Verdicts on claims from many initial omegas (starts) at once, by `rules`.

A sweep supplies starts, listing and number of steps. A start is used in all cases for which the
thesis gives none.
"""

from functools import cache, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch
from pyharness.engine.many.many import solve_many
from pyharness.engine.problem.rotated import restarted_at
from pyharness.history.claims import rules
from pyharness.history.claims.laboratory import Assumptions, Laboratory, integrate_models
from pyharness.history.claims.ledger import claim, claims
from pyharness.history.claims.rules import Runs
from pyharness.model.assumptions import open_starts
from pyharness.model.codes import Statuses
from pyharness.model.facts import facts
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array
from pyharness.thesis.many import run_many

FAILS, HOLDS, SILENT, IN_PART = 0, 1, 2, 3
_TOLERANCE = 1e-12
_EFFORT = 1e9  # no effective work limit, because a sweep reports its expected time beforehand


class Starts:
    """Runs for `rules` from n initial omegas `omega0` (rad/s), shape (n, 3).

    Results have no axis n in cases for which the thesis gives omega(0).
    """

    def __init__(self, one: Laboratory, omega0: Array) -> None:
        self._one, self._omega0 = one, omega0
        # With arguments as in `Laboratory`.
        self.scene = one.scene
        self.solution = cache(self._integrated)
        self.error = cache(partial(rules.largest_error, self))
        self.models = cache(self._modelled)
        self._kept = cache(self._run)

    def runs(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Runs:
        # Runs with divided steps are not cached, because they are needed only once.
        return (self._kept if parts == 1 else self._run)(program, case, may_stop, parts)

    def _starts(self, case: int) -> Array:
        is_open = case in open_starts()
        return self._omega0 if is_open else np.array([self.scene(case).omega])

    def _shaped(self, case: int, array: NDArray[Any]) -> NDArray[Any]:
        return array if case in open_starts() else array[0]

    def _run(self, program: str, case: int, may_stop: bool, parts: int) -> Runs:
        scene, omega0 = self.scene(case, parts), self._starts(case)
        listing, at = self._one.listing(program), range(parts, scene.steps + 1, parts)
        found = run_many(scene, listing, omega=omega0, may_stop=may_stop, at=at, effort=_EFFORT)
        ends = (found.status == each for each in (Statuses.COMPLETE, Statuses.OVERFLOW))
        arrays = (found.omega, found.n_rows // parts, *ends)
        return Runs(*(self._shaped(case, each) for each in arrays))

    def _integrated(self, case: int) -> Array:
        scene, state = self.scene(case), self._starts(case)
        rows = np.empty((len(state), scene.steps, 3))
        for step in range(scene.steps):
            later = restarted_at(scene, np.array(scene.omega), step * scene.step_size)
            state = solve_many(
                later, scene.step_size, omega=state, tolerance=_TOLERANCE, effort=_EFFORT
            ).omega
            rows[:, step] = state
        return self._shaped(case, rows)

    def _modelled(self, case: int, terms: int) -> Array:
        scene, omega0 = self.scene(case), self._starts(case)
        assert not scene.torque.varies
        h = scene.step_size
        growth = h if self._one.is_original and "dt-accumulates" not in self._one.fixed else 0.0
        bodies, torque = np.array(scene.euler_coefficients), np.array(scene.normalized_torque(0.0))
        rows = integrate_models(omega0, bodies, torque, terms, h, h, growth, scene.steps)
        return self._shaped(case, rows)


JUDGED = tuple(entry["id"] for entry in claims() if entry["test"] in vars(rules))
"""The claims with a rule for many initial omegas."""


def codes(identity: str, batch: Batch) -> NDArray[np.int8]:
    """Return a claim's verdict codes for a batch, shape (n,); SILENT if no claim concerns it."""
    bench = _bench(batch)
    if bench is None:
        return np.full(len(batch.omega0), SILENT, np.int8)
    return judged(claim(identity), bench, len(batch.omega0))


FUNCTIONS = {name: partial(codes, name) for name in JUDGED}
"""The functions of a batch that return verdict codes, by claim."""


def judged(entry: dict[str, Any], bench: Starts, n: int) -> NDArray[np.int8]:
    grade = vars(rules)[entry["test"]](bench, **entry["parameters"])
    found = np.where(grade.whole, HOLDS, np.where(grade.part, IN_PART, FAILS))
    return np.broadcast_to(found, (n,)).astype(np.int8)


# Cached, because all claims of a batch share its runs.
@lru_cache(maxsize=1)
def _bench(batch: Batch) -> Starts | None:
    # Claims concern only original or corrected programs, the thesis's bodies, torques and step
    # sizes, and the stop test as on the cards.
    if batch.listing is None or batch.arrays.keys() != {"omega"}:
        return None
    deck = facts("cases")["deck"]
    if batch.solver.lipschitz != deck["lipschitz"] or not batch.solver.may_stop:
        return None
    about = [_without_start(case_scene(case)) for case in range(1, 8)]
    if _without_start(batch.scene) not in about:
        return None
    assumptions = Assumptions(readings=batch.listing.readings, steps=batch.scene.steps)
    both = (Laboratory(is_original, assumptions) for is_original in (True, False))
    program = batch.listing.program
    ones = (Starts(one, batch.omega0) for one in both if one.listing(program) == batch.listing)
    return next(ones, None)


def _without_start(scene: Scene) -> tuple[Any, ...]:
    return scene.moments, scene.torque, scene.step_size

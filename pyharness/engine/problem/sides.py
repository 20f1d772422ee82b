"""Reversal of trajectories, and joining at time 0."""

from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.model.trajectory import Trajectory

_WORST_FIRST = ("singular", "stalled", "sliding", "overflow", "unchecked", "sensitive", "complete")


def in_reverse(found: Trajectory) -> Trajectory:
    return found.with_values(**{name: each[::-1] for name, each in found.with_rows().items()})


def joined(before: Trajectory, after: Trajectory) -> Trajectory:
    both = before, after
    ended = min((x.ended for x in both), key=_WORST_FIRST.index)
    rows: dict[str, Any] = {
        name: np.concatenate([getattr(before, name), each])
        for name, each in after.with_rows().items()
    }
    return replace(
        after,
        **rows,
        ended=ended,
        error=_larger(before.error, after.error),
        reason=next((x.reason for x in both if x.ended == ended and x.reason), None),
        growth=_larger(before.growth, after.growth),
        steps=before.steps + after.steps,
        evaluations=before.evaluations + after.evaluations,
        sol=None if before.sol is None or after.sol is None else before.sol.followed_by(after.sol),
    )


def _larger(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else max(first, second)

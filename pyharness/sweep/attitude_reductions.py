"""Quantities that a sweep computes from the attitudes of a batch of n scenes.

The parameter `samples` is the number of times at which attitudes are read; `of` names a principal
axis by the rank of its moment.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch
from pyharness.model.attitude import product
from pyharness.model.trajectory import Array

Given = Mapping[str, Any]

# Principal axes in ascending order of their moments.
RANKS = ("least", "middle", "largest")


def end_attitude(batch: Batch, _: Given) -> Array:
    """Return the attitudes at the end, shape (n, 4)."""
    return _in_space(batch)


def largest_tilt(batch: Batch, given: Given) -> Array:
    """Return the largest angles (rad) between an axis and its initial direction, shape (n,)."""
    along, across = _tilt_squares(batch, given)
    found: Array = 2.0 * np.arctan2(np.sqrt(across), np.sqrt(along)).max(axis=1)
    return found


def tilted_time(batch: Batch, given: Given) -> Array:
    """Return how long (s) an axis is tilted by more than `above` (rad), shape (n,).

    Each sample counts for the time since the sample before.
    """
    along, across = _tilt_squares(batch, given)
    angles = 2.0 * np.arctan2(np.sqrt(across), np.sqrt(along))
    share = (angles > given["above"]).mean(axis=1)
    found: Array = np.where(np.isfinite(angles).all(axis=1), share * np.abs(batch.t_end), np.nan)
    return found


def axis_flips(batch: Batch, given: Given) -> NDArray[np.int64]:
    """Return how often an axis's tilt passes a right angle between samples, shape (n,)."""
    along, across = _tilt_squares(batch, given)
    is_over = np.concatenate([np.zeros((len(along), 1), bool), across > along], axis=1)
    count: NDArray[np.int64] = (is_over[:, 1:] != is_over[:, :-1]).sum(axis=1)
    return count


def pointing_error(batch: Batch, given: Given) -> Array:
    """Return the final angles (rad) between an axis and a direction in space, shape (n,).

    The direction is `towards` or, if empty, the axis's initial one.
    """
    if not given["towards"]:
        return largest_tilt(batch, {**given, "samples": 1})
    target = np.array(given["towards"])
    target = target / np.abs(target).max()
    target = target / np.linalg.norm(target)
    attitudes = _in_space(batch)
    unit = _is_own(batch, given, len(attitudes)).astype(float)
    w, x, y, z = attitudes.T
    _, *vector = product(product((w, x, y, z), (0.0, *unit.T)), (w, -x, -y, -z))
    axis = np.stack(vector, axis=1)
    # The arc cosine of the scalar product would lose half of the digits of a small angle.
    found: Array = 2.0 * np.arctan2(
        np.linalg.norm(axis - target, axis=1), np.linalg.norm(axis + target, axis=1)
    )
    return found


def _in_space(batch: Batch) -> Array:
    turn = batch.attitudes(1)[:, 0]
    return np.stack(np.broadcast_arrays(*product(batch.first_attitudes.T, turn.T)), axis=1)


def _tilt_squares(batch: Batch, given: Given) -> tuple[Array, Array]:
    """Return the squared cosine and sine of half an axis's angle from its initial direction."""
    squares = batch.attitudes(given["samples"]) ** 2
    is_own = _is_own(batch, given, len(squares))[:, None, :]
    along = squares[:, :, 0] + np.where(is_own, squares[:, :, 1:], 0.0).sum(axis=2)
    across = np.where(is_own, 0.0, squares[:, :, 1:]).sum(axis=2)
    return along, across


def _is_own(batch: Batch, given: Given, n: int) -> NDArray[np.bool_]:
    """Return whether each principal axis of n bodies has the rank `of`, shape (n, 3)."""
    axis = np.argsort(batch.bodies, axis=1, kind="stable")[:, RANKS.index(given["of"])]
    found: NDArray[np.bool_] = np.arange(3) == np.broadcast_to(axis, (n,))[:, None]
    return found

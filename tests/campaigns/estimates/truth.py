"""The truth of the campaign: the motion in 30 digits, and the error amplification K."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pyharness import InputError, Scene, solve
from pyharness.engine.methods.linearised import jacobians, transitions
from pyharness.model.attitude import matrices
from pyharness.model.trajectory import Array, Trajectory
from tests.campaigns import entries

_NODES_PER_RADIAN = 8.0
_FEWEST_NODES, _MOST_NODES = 50, 200_000


@dataclass(frozen=True, eq=False)
class Truth:
    """Measures of a motion up to the last of some times, and the errors of results."""

    scene: Scene
    times: tuple[float, ...]
    largest: float  # largest abs of any component of omega (rad/s)
    turns: float
    # Largest norm of the state-transition matrix from any earlier time to a requested one. With the
    # attitude the state has a small rotation too, and omega in units of `largest`.
    growth: float

    @cached_property
    def exact(self) -> entries.Truth:
        """The motion; it takes longer than all else."""
        return entries.truth_of(self.scene, self.times, growth=self.growth)

    def error(self, omega: Array, attitude: Array | None = None) -> float:
        """Return the largest error; of one row, at the last time."""
        rows = np.reshape(omega, (-1, 3))
        return self.exact.error(rows, attitude, last_only=len(rows) < len(self.times))


def truth_of(scene: Scene, until: float | Sequence[float], attitude: bool = False) -> Truth:
    """Return the truth of a scene at times (s) of one sign, in the order of their distance from 0.

    Raise InputError if omega grows without bound, or the body rotates too much, before the end.
    """
    joint = attitude or scene.law.in_space
    times: list[float] = np.atleast_1d(until).tolist()
    count = _FEWEST_NODES
    while True:
        parts = [
            np.linspace(a, b, count + 1)[1:] for a, b in zip((0.0, *times), times, strict=False)
        ]
        nodes = np.concatenate([[0.0], *parts])
        path = solve(scene, nodes, "auto", 1e-13, attitude=joint)
        if not path.has_all_rows:
            known = entries.truth_of(scene, times).omega
            assert len(known) < len(times), f"{path.ended}, and the motion is bounded"
            raise InputError("the solution grows without bound")
        slopes = _slopes(scene, path, joint)
        wanted = _NODES_PER_RADIAN * np.abs(slopes).sum(axis=2).max() * abs(times[-1])
        if not wanted <= _MOST_NODES:
            raise InputError("the motion is too fast for so long a time")
        if count >= wanted:
            break
        count = math.ceil(wanted)
    largest = float(np.abs(path.omega).max())
    turns = float(np.abs(np.trapezoid(np.linalg.norm(path.omega, axis=1), nodes))) / (2.0 * math.pi)
    units = np.array([largest or 1.0] * 3 + [1.0] * 3)[: slopes.shape[1]]
    slopes = slopes * units / units[:, None]
    growth = 1.0
    for row in range(len(times)):
        last = (row + 1) * count
        growth = max(growth, _norm(transitions(nodes[: last + 1], slopes[:last])))
    return Truth(scene, tuple(times), largest, turns, growth)


def _norm(flow: Array) -> float:
    """Return the largest 2-norm of matrices, which is near their Frobenius norm."""
    sizes = np.linalg.norm(flow, axis=(1, 2))
    most = flow[sizes >= sizes.max() / flow.shape[1] ** 0.5]
    return float(np.linalg.norm(most[:: len(most) // 2000 + 1], 2, axis=(1, 2)).max())


def _slopes(scene: Scene, path: Trajectory, joint: bool) -> Array:
    """Return the Jacobians of (omega, small rotation about the body's axes) between the rows."""
    w = 0.5 * (path.omega[1:] + path.omega[:-1])
    if scene.inertia is None:
        top, inverse = jacobians(scene, w), np.diag(1.0 / np.array(scene.moments or (1.0,) * 3))
    else:
        inertia = np.array(scene.inertia)
        inverse = np.linalg.inv(inertia)
        # d(L x w) = L x dw - w x J dw
        top = inverse @ (_cross(w @ inertia) - _cross(w) @ inertia)
    if not joint:
        return top
    beside = np.zeros_like(top)
    if scene.law.in_space:
        assert path.attitude is not None
        turned = matrices(path.attitude)
        torque = np.array([scene.law.at(t) for t in path.time.tolist()])
        push = np.einsum("nji,nj->ni", turned, torque)
        beside = inverse @ _cross(0.5 * (push[1:] + push[:-1]))
    eye = np.broadcast_to(np.eye(3), top.shape)
    return np.concatenate(
        [np.concatenate([top, beside], axis=2), np.concatenate([eye, -_cross(w)], axis=2)], axis=1
    )


def _cross(a: Array) -> Array:
    """Return the matrices of cross products by vectors, shape (n, 3)."""
    return np.cross(a[:, None, :], np.eye(3)).transpose(0, 2, 1)

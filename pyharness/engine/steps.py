"""Dense output from the steps of an integration, and its transformations."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.engine.recorded import outputs_at, slopes_of, system_of
from pyharness.model.array_type import Array
from pyharness.model.attitude import product, quaternion_rates
from pyharness.model.constant_body import integrated, uses_principal_axes, with_constant_body
from pyharness.model.dense_output import POINTS, DenseOutput, Pieces, nodes
from pyharness.model.principal import axes_and_turn
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.torque_law import TorqueLaw

STEP_NODES = 0.5 + 0.5 * POINTS  # in parts of a step
MOST_STEPS = 20_000  # in `sol`, to limit its memory


def rates(scene: Scene, times: Array, state: Array) -> Array:
    """Return the time derivatives of n states, (n, m); not finite where the torque is singular."""
    turn = axes_and_turn(scene) if uses_principal_axes(scene) else None
    bare = with_constant_body(integrated(scene))
    torque = bare.torque
    if isinstance(torque, TorqueLaw):
        torque = of_law(torque)
        bare = replace(bare, torque=torque)
    end = state.shape[1] - len(scene.states)
    omega, attitude, own = state[:, :3], state[:, 3:end], state[:, end:]
    has_attitude, has_own = attitude.shape[1] > 0, own.shape[1] > 0
    inner = state
    if turn is not None:
        turned = product(attitude.T, turn[1]) if has_attitude else []
        inner = np.column_stack([omega @ turn[0], *turned, own])
    more = own
    if torque.tape is not None:
        tape = system_of(bare, has_attitude and has_own)
        found = outputs_at(tape, times, inner)
        found, more = found[:, :3], found[:, found.shape[1] - own.shape[1] :]
    else:
        slopes = slopes_of(bare)
        rows = zip(times.tolist(), inner.tolist(), strict=True)
        found = np.array([slopes(*row)[:3] for row in rows]).reshape(-1, 3)
    if turn is not None:
        found = found @ turn[0].T
    if has_attitude:
        found = np.column_stack([found, *quaternion_rates(omega.T, attitude.T)])
    return np.column_stack([found, more]) if has_own else found


def steps_output(scene: Scene, pieces: Pieces) -> DenseOutput:
    low, high = pieces.edges[[0, -1]].tolist()
    return DenseOutput(low, high, pieces, partial(rates, scene), len(scene.states))


def up_to(pieces: Pieces, last: float) -> Pieces:
    """Return the polynomials between time 0 and `last` (s), not 0."""
    low, high = sorted((0.0, last))
    kept = (pieces.edges[1:] > low) & (pieces.edges[:-1] < high)
    edges = np.clip(pieces.edges[np.append(kept, False) | np.append(False, kept)], low, high)
    values = pieces.values[kept]
    cut = 0 if last < 0.0 else len(values) - 1
    values[cut] = pieces(nodes(edges[cut : cut + 1], edges[cut + 1 : cut + 2], POINTS)[0])
    return Pieces(edges, values)


def transformed_steps(
    sol: DenseOutput | None, states: Callable[[Array], Array], factor: float = 1.0
) -> DenseOutput | None:
    if sol is None or not isinstance(sol.states, Pieces):
        return None
    edges, values = sol.states.edges * factor, sol.states.values
    changed = states(values.reshape(-1, values.shape[2])).reshape(values.shape)
    return replace(
        sol, t_min=float(edges[0]), t_max=float(edges[-1]), states=Pieces(edges, changed)
    )


def joined_steps(before: DenseOutput | None, after: DenseOutput | None) -> DenseOutput | None:
    if before is None or after is None:
        return None
    parts = before.states, after.states
    assert isinstance(parts[0], Pieces)
    assert isinstance(parts[1], Pieces)
    edges = np.concatenate([parts[0].edges, parts[1].edges[1:]])
    values = np.concatenate([parts[0].values, parts[1].values])
    return replace(after, t_min=before.t_min, states=Pieces(edges, values))

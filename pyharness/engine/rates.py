"""The right-hand side of any scene, for arrays of states."""

from dataclasses import replace

import numpy as np

from pyharness.engine.array_tape import outputs_at
from pyharness.engine.system import slopes_of, system_of, with_constant_body
from pyharness.model.array_type import Array
from pyharness.model.attitude import product, quaternion_of_axes, quaternion_rates
from pyharness.model.principal import principal
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.torque_law import TorqueLaw


def rates(scene: Scene, times: Array, state: Array) -> Array:
    """Return the time derivatives of n states: omega (rad/s), (n, 3), or with quaternion, (n, 7).

    A derivative is not finite where the torque is singular.
    """
    bare, axes = principal(scene)
    bare = with_constant_body(bare)
    torque = of_law(bare.torque) if isinstance(bare.torque, TorqueLaw) else bare.torque
    bare = replace(bare, torque=torque)
    omega, attitude = state[:, :3], state[:, 3:]
    inner = omega @ axes
    if attitude.size:
        turned = product(attitude.T, quaternion_of_axes(axes))
        inner = np.column_stack([inner, *turned])
    if torque.tape is not None:
        found = outputs_at(system_of(bare, False), times, inner)
    else:
        slopes = slopes_of(bare)
        rows = zip(times.tolist(), inner.tolist(), strict=True)
        found = np.array([slopes(*row)[:3] for row in rows]).reshape(-1, 3)
    found = found @ axes.T
    if attitude.size:
        found = np.column_stack([found, *quaternion_rates(omega.T, attitude.T)])
    return found

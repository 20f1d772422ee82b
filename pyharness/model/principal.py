"""Transformation of scenes to principal axes, and of results back."""

from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from pyharness.model.attitude import IDENTITY, Quaternion, product, quaternion_of_axes
from pyharness.model.fields import ROWS
from pyharness.model.inertia import Exact, PrincipalFrame, nearest_float, principal_frame
from pyharness.model.scene import Scene, Triple, any_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.values import triple
from pyharness.model.waves import exact_law

# By field, how it turns.
_TURNED = {name: each.turns for name, each in ROWS.items() if each.turns}


@dataclass(frozen=True)
class PrincipalScene(Scene):
    """A scene about principal axes, with moments in double-double precision.

    In double precision, differences of nearly equal moments would lose digits.
    """

    moments_low: Triple = (0.0, 0.0, 0.0)

    @property
    def exact_moments(self) -> Exact:
        pairs = zip(self.moments or (), self.moments_low, strict=True)
        return triple(Fraction(high) + Fraction(low) for high, low in pairs)

    @cached_property
    def euler_coefficients(self) -> Triple:
        i1, i2, i3 = self.exact_moments
        return triple(map(nearest_float, ((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3)))


def in_double(scene: Scene) -> Scene:
    if not isinstance(scene, PrincipalScene):
        return scene
    return Scene(**_fields(scene))


def principal(scene: Scene) -> tuple[Scene, Array]:
    """Return a scene in components about the principal axes of its body, and these axes.

    Parameters
    ----------
    scene : Scene
        A scene with a full inertia matrix. Any other scene is returned unchanged, with the identity
        matrix as axes.

    Returns
    -------
    scene : Scene
        The same problem with `moments`; its attitude, if any, describes the principal axes. A
        torque about the axes of space is unchanged; the result then always has an attitude.
    axes : ndarray, shape (3, 3)
        The principal axes as columns, in components about the body axes. They form a right-handed
        frame, in the order and directions nearest to the body axes.

    Raises
    ------
    InputError
        If the sum of the torque's amplitudes of one frequency is beyond the range of binary64.

    Examples
    --------
    >>> from pyharness import Scene, principal
    >>> inertia = [[3.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 5.0]]
    >>> scene, axes = principal(Scene("plate", (0.0, 1.0, 1.0), inertia=inertia))
    >>> scene.moments
    (2.0, 4.0, 5.0)
    >>> axes.round(3)
    array([[ 0.707,  0.707,  0.   ],
           [-0.707,  0.707,  0.   ],
           [ 0.   ,  0.   ,  1.   ]])
    """
    any_scene(scene)
    if scene.inertia is None:
        return scene, np.eye(3)
    frame = principal_frame(scene.inertia)
    attitude = scene.attitude
    if attitude is None and (scene.torque.in_space or scene.torque.needs_attitude):
        attitude = IDENTITY
    if attitude is not None:
        attitude = product(attitude, quaternion_of_axes(frame.axes))
    law = scene.torque
    if isinstance(law, StateTorque):
        law = law.rotated(frame.axes)
    elif not law.in_space:
        # Rounded after the transformation, because large components may cancel about an axis of
        # small moment.
        law = exact_law(law, frame.into)
    given = _fields(scene) | {"inertia": None, "torque": law, "attitude": attitude}
    given |= {"omega": _rotate(frame, scene.omega), "moments": frame.moments}
    return PrincipalScene(**given, moments_low=frame.moments_low), frame.axes.copy()


def _fields(scene: Scene) -> dict[str, Any]:
    return {each.name: getattr(scene, each.name) for each in fields(Scene) if each.init}


def in_scene_axes(found: Trajectory, axes: Array) -> Trajectory:
    """Return a trajectory transformed from principal `axes` (columns) to the body axes."""
    turned: dict[str, Any] = {}
    for name, kind in _TURNED.items():
        each = getattr(found, name)
        if each is not None:
            is_vector = kind == "vector"
            turned[name] = each @ axes.T if is_vector else _attitude_in_scene_axes(each, axes)
    return found.with_values(axes=axes.copy(), **turned)


def states_in_scene_axes(states: Array, axes: Array, own: int) -> Array:
    """Return n states, (n, m), transformed from principal `axes` (columns) to the body axes.

    Columns from `own` on are unchanged.
    """
    turned, rest = states[:, 3:own], states[:, own:]
    if own > 3:
        turned = _attitude_in_scene_axes(turned, axes)
    return np.column_stack([states[:, :3] @ axes.T, turned, rest])


def _attitude_in_scene_axes(attitude: Array, axes: Array) -> Array:
    w, x, y, z = quaternion_of_axes(axes)
    return np.array(product(tuple(attitude.T), (w, -x, -y, -z))).T


def _rotate(frame: PrincipalFrame, vector: Triple) -> Triple:
    return triple(map(float, frame.into(triple(map(Fraction, vector)))))


def axes_and_turn(scene: Scene) -> tuple[Array, Quaternion]:
    """Return the principal axes of a full inertia matrix, as columns and as a quaternion."""
    assert scene.inertia is not None
    axes = principal_frame(scene.inertia).axes
    return axes.copy(), quaternion_of_axes(axes)

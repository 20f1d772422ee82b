"""A scene about the principal axes of its body, and its results about the body's own again."""

from dataclasses import replace

import numpy as np

from pyharness.model.attitude import IDENTITY, product
from pyharness.model.inertia import principal_axes
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.turned_scenes import turned


def principal(scene: Scene) -> tuple[Scene, Array]:
    """Return a scene about principal axes, and those, columns of a (3, 3) array.

    Its attitude is that of the principal axes; a torque about the axes of space stays as it is. A
    scene without a full inertia matrix is returned as it is.
    """
    if scene.inertia is None:
        return scene, np.eye(3)
    moments, axes = principal_axes(scene.inertia)

    def turn(vector: Triple) -> Triple:
        first, second, third = (float(x) for x in axes.T @ np.array(vector))
        return first, second, third

    attitude = scene.attitude
    if attitude is None and scene.torque.in_space:
        attitude = IDENTITY
    if attitude is not None:
        attitude = product(attitude, _quaternion(axes))
    bare = replace(scene, inertia=None, moments=moments, attitude=attitude)
    return turned(bare, turn, body=False), axes


def given_back(found: Trajectory, axes: Array) -> Trajectory:
    """Return a trajectory about principal axes about the body's own ones."""
    attitude = found.attitude
    if attitude is not None:
        w, x, y, z = _quaternion(axes)
        attitude = np.array(product(tuple(attitude.T), (w, -x, -y, -z))).T
    return replace(found, omega=found.omega @ axes.T, attitude=attitude, axes=axes)


def _quaternion(axes: Array) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
    return w, x, y, z

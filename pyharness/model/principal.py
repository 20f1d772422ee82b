"""A scene about the principal axes of its body, and its results about the body's own again."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from pyharness.model.attitude import IDENTITY, product
from pyharness.model.inertia import Exact, PrincipalFrame, nearest_float, principal_frame
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Array, Trajectory
from pyharness.model.waves import exact_law


@dataclass(frozen=True)
class PrincipalScene(Scene):
    """A scene about principal axes whose moments are known to more digits than a float has.

    A, B, C come from those: where two moments are nearly equal, their rounding would be much of
    the difference. `moments_low` is what rounding took off `moments` (kg m2).
    """

    moments_low: Triple = (0.0, 0.0, 0.0)

    @property
    def exact_moments(self) -> Exact:
        """The principal moments to twice the digits of a float (kg m2)."""
        pairs = zip(self.moments or (), self.moments_low, strict=True)
        first, second, third = (Fraction(high) + Fraction(low) for high, low in pairs)
        return first, second, third

    @cached_property
    def euler_coefficients(self) -> Triple:
        """A, B, C of equations 13-15, without unit, rounded once."""
        i1, i2, i3 = self.exact_moments
        exact = (i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3
        a, b, c = map(nearest_float, exact)
        return a, b, c


def principal(scene: Scene) -> tuple[Scene, Array]:
    """Return a scene about principal axes, and those, columns of a (3, 3) array.

    Its attitude is that of the principal axes; a torque about the axes of space stays as it is. A
    scene without a full inertia matrix is returned as it is.
    """
    if scene.inertia is None:
        return scene, np.eye(3)
    frame = principal_frame(scene.inertia)
    attitude = scene.attitude
    if attitude is None and scene.torque.in_space:
        attitude = IDENTITY
    if attitude is not None:
        attitude = product(attitude, _quaternion(frame.axes))
    law = scene.torque
    if not law.in_space:
        # A torque about an axis of small moment may be what is left of large ones: it is rounded
        # when it is found, and no sooner.
        law = exact_law(law).turned(frame.into).rounded()
    bare = PrincipalScene(
        scene.name,
        _turned(frame, scene.omega),
        moments=frame.moments,
        torque=law,
        step_size=scene.step_size,
        steps=scene.steps,
        masses=scene.masses,
        forces=scene.forces,
        case=scene.case,
        attitude=attitude,
        moments_low=frame.moments_low,
    )
    return bare, frame.axes.copy()


def in_scene_axes(found: Trajectory, axes: Array) -> Trajectory:
    """Return a trajectory about principal axes about the body's own ones."""
    attitude = found.attitude
    if attitude is not None:
        w, x, y, z = _quaternion(axes)
        attitude = np.array(product(tuple(attitude.T), (w, -x, -y, -z))).T
    return replace(found, omega=found.omega @ axes.T, attitude=attitude, axes=axes)


def _turned(frame: PrincipalFrame, vector: Triple) -> Triple:
    first, second, third = map(Fraction, vector)
    x, y, z = map(float, frame.into((first, second, third)))
    return x, y, z


def _quaternion(axes: Array) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
    return w, x, y, z

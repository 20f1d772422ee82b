"""Mechanical quantities of a trajectory: angular momentum, energy, power and work.

A changing inertia is taken at the time of the row. Where moments of inertia are needed, a body with
coefficients raises InputError.
"""

from typing import TYPE_CHECKING

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.changing import Changing, ChangingInertia, ChangingMoments
from pyharness.model.errors import InputError, unknown
from pyharness.model.torque_law import FRAMES, TorqueLaw
from pyharness.model.values import Triple

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from pyharness.model.scene import Scene


class Mechanics:
    """A base class of trajectories: quantities that follow from omega and the body."""

    time: Array
    omega: Array
    attitude: Array | None
    moments: Triple | ChangingMoments | ChangingInertia | None
    axes: Array | None
    scene: "Scene | None"

    def rotation(self) -> "Rotation":
        """Return the attitudes as SciPy rotations, which rotate vectors from body to space.

        Returns
        -------
        scipy.spatial.transform.Rotation
            One rotation for each row.

        Raises
        ------
        InputError
            If the attitude was not requested.
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._attitudes()[:, [1, 2, 3, 0]])

    def angular_momentum(self, frame: str = "body") -> Array:
        """Return the angular momentum in each row.

        Parameters
        ----------
        frame : {"body", "space"}
            The axes of the components.

        Returns
        -------
        ndarray, shape (n, 3)
            The angular momentum, kg m2/s.

        Raises
        ------
        InputError
            If the body has no moments, the frame is unknown, or "space" is requested without an
            attitude.
        """
        if frame not in FRAMES:
            raise unknown("frame", str(frame), FRAMES)
        momentum = self._momentum(self.omega)
        return momentum if frame == "body" else turned_to_space(self._attitudes(), momentum)

    def energy(self) -> Array:
        """Return the kinetic energy of the rotation in each row.

        Returns
        -------
        ndarray, shape (n,)
            The energy, J.

        Raises
        ------
        InputError
            If the body has no moments.
        """
        energy: Array = 0.5 * (self.omega * self._momentum(self.omega)).sum(axis=1)
        return energy

    def power(self) -> Array:
        """Return the power of the torque, its scalar product with omega, in each row.

        Returns
        -------
        ndarray, shape (n,)
            The power, W; NaN where the torque is singular.

        Raises
        ------
        InputError
            If the body has no moments, or `solve` did not make the trajectory.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, section 5.3.

        Examples
        --------
        >>> from pyharness import Scene, solve
        >>> from pyharness.torques import damping
        >>> scene = Scene("damped", (0, 0, 2), moments=(3, 2, 1), torque=damping(0.5))
        >>> solve(scene, [0.0, 2.0]).power().round(6)
        array([-2.      , -0.270671])
        """
        self._checked_moments()
        torque, omega = self._scene_of_solve().torque, self.omega
        if isinstance(torque, TorqueLaw):
            values = [torque.at(time) for time in self.time.tolist()]
            if torque.in_space:
                omega = turned_to_space(self._attitudes(), omega)
        else:
            # A torque that does not depend on the attitude gets any.
            needed = torque.needs_attitude
            attitudes = self._attitudes() if needed else np.eye(4)[[0] * len(self.time)]
            rows = zip(self.time.tolist(), self.omega.tolist(), attitudes.tolist(), strict=True)
            values = [torque.at(*row) for row in rows]
        power: Array = (np.array(values).reshape(-1, 3) * omega).sum(axis=1)
        return power

    def work(self) -> Array:
        """Return the work of the torque on the body from time 0 to each row.

        It is the change of the kinetic energy, without the work of the motors of the ready term
        `wheels` on the wheels. The formula is (omega - omega0) . I (omega + omega0) / 2. Unlike a
        difference of energies, it loses no digits where omega has changed little. Its error is that
        of omega times the angular momentum.

        Returns
        -------
        ndarray, shape (n,)
            The work, J.

        Raises
        ------
        InputError
            If the body has no moments, the inertia changes with time, or `solve` did not make the
            trajectory.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, sections 1.1
        and 5.3.
        """
        if isinstance(self._checked_moments(), Changing):
            # The forces that change the inertia change the kinetic energy too.
            raise InputError(
                "work: the inertia changes with time; allowed: a constant inertia; `power` is "
                "available for both"
            )
        start = np.array(self._scene_of_solve().omega)
        work: Array = 0.5 * ((self.omega - start) * self._momentum(self.omega + start)).sum(axis=1)
        return work

    def _momentum(self, omega: Array) -> Array:
        moments = self._checked_moments()
        if isinstance(moments, Changing):
            return moments.momentum(self.time, omega)
        axes = np.eye(3) if self.axes is None else self.axes
        # The rounding of a matrix product may depend on the order of the elements in memory, which
        # a file does not preserve in full.
        ordered = np.ascontiguousarray(omega)
        momentum: Array = ((ordered @ axes) * np.array(moments)) @ axes.T
        return momentum

    def _checked_moments(self) -> Triple | ChangingMoments | ChangingInertia:
        if self.moments is None:
            raise InputError(
                "the body is given by coefficients, and the result needs its moments; give moments"
            )
        return self.moments

    def _scene_of_solve(self) -> "Scene":
        if self.scene is None:
            raise InputError(
                "the trajectory has no scene; allowed: a trajectory that solve has returned"
            )
        return self.scene

    def _attitudes(self) -> Array:
        if self.attitude is None:
            raise InputError("the trajectory has no attitude; request it with attitude=True")
        return self.attitude


def turned_to_space(attitude: Array, vectors: Array) -> Array:
    """Return vectors, (n, 3), rotated from body to space."""
    scalar, vector = attitude[:, :1], attitude[:, 1:]
    twice = 2.0 * np.cross(vector, vectors)
    return vectors + scalar * twice + np.cross(vector, twice)

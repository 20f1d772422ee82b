"""Right-hand sides, and the record of a run, for the three Python ports."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.facts import facts
from pyharness.model.functions import is_finite
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Stop, Trajectory

Vector = Sequence[float]


def omega_rate(coefficients: Vector, m: Vector, u: Vector) -> list[float]:
    """Return domega/dt (eqs. 16-18) from A, B, C, torque over moment (rad/s2) and omega (rad/s)."""
    a, b, c = coefficients
    return [m[0] + a * u[1] * u[2], m[1] + b * u[0] * u[2], m[2] + c * u[0] * u[1]]


def velocity_rate(acceleration: Vector, u: Vector, v: Vector) -> list[float]:
    """Return F/m - omega x V in body axes (m/s2), from F/m, omega `u` (rad/s) and V `v` (m/s)."""
    return [
        acceleration[0] + v[1] * u[2] - v[2] * u[1],
        acceleration[1] + v[2] * u[0] - v[0] * u[2],
        acceleration[2] + v[0] * u[1] - v[1] * u[0],
    ]


def accelerations(scene: Scene, listing: Listing) -> list[float]:
    """Return force over mass (m/s2); with the defect `three-masses`, each axis has its own mass."""
    masses = scene.masses if listing.has("three-masses") else scene.masses[:1] * 3
    return [force / mass for force, mass in zip(scene.forces, masses, strict=True)]


def initial_torque(scene: Scene) -> Vector | None:
    """Return the conjecture `initial-torque`'s torque divided by moments (rad/s2), or None."""
    given = card_torque(scene)
    if given is None or scene.moments is None:
        return None
    return [n / moment for n, moment in zip(given, scene.moments, strict=True)]


def card_torque(scene: Scene) -> Vector | None:
    """Return the initial torque (N m) in Table 1 of a case with a varying torque, else None."""
    if not scene.law.varies:
        return None
    given = {each["case"]: each["torque"] for each in facts("printer")["initial_torque"]}
    return given.get(scene.case)


def all_finite(values: Vector) -> bool:
    return all(map(is_finite, values))


def trajectory_of(rows: NDArray[np.float64], **others: Any) -> Trajectory:
    """Return a trajectory from rows of true time (s), TIME, omega (rad/s) and velocity (m/s)."""
    return Trajectory(rows[:, 0], rows[:, 1], rows[:, 2:5], rows[:, 5:], len(rows), **others)


class Record:
    """The results of a Python port's run, with a row for each step."""

    def __init__(self, scene: Scene, evaluations_per_step: int) -> None:
        self._step_size = scene.step_size
        self._per_step = evaluations_per_step
        self._rows: list[list[float]] = []
        self._ier: list[int] = []

    def add(self, recorded_time: float, omega: Vector, velocity: Vector, ier: int = 0) -> None:
        """Add a step: its TIME (s), omega (rad/s), velocity (m/s) and the solver's IER."""
        true_time = (len(self._rows) + 1) * self._step_size
        self._rows.append([true_time, recorded_time, *omega, *velocity])
        self._ier.append(ier)

    def trajectory(
        self, ended: str = "complete", stop: Stop | None = None, prints_ier: bool = True
    ) -> Trajectory:
        """Return the trajectory of all rows, with the solver's IER if `prints_ier`."""
        given = np.array(self._rows).reshape(-1, 8)
        rows = given.astype(np.float64)
        return trajectory_of(
            rows,
            # A step that overflows has no row, but its evaluations count too.
            evaluations=self._per_step * (len(rows) + (ended == "overflow")),
            ended=ended,
            stop=stop,
            ier=np.array(self._ier, dtype=np.int32) if prints_ier else None,
            exact=given if given.dtype == object else None,
        )

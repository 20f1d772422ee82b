"""Right-hand sides and the record of a run, for the Python twins of all three programs."""

from collections.abc import Sequence

import numpy as np

from pyharness.model.facts import facts
from pyharness.model.functions import is_finite
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Stop, Trajectory

Vector = Sequence[float]


def omega_rate(coefficients: Vector, m: Vector, u: Vector) -> list[float]:
    """Return F, G, H of the thesis's equations 16-18, the rates of change of omega (rad/s2).

    `coefficients` contains A, B, C of Euler's equations, `m` the torque divided by the moment of
    inertia about each axis (1/s2), and `u` the angular velocity omega (rad/s).
    """
    a, b, c = coefficients
    return [m[0] + a * u[1] * u[2], m[1] + b * u[0] * u[2], m[2] + c * u[0] * u[1]]


def velocity_rate(acceleration: Vector, u: Vector, v: Vector) -> list[float]:
    """Return F/m - omega x V, the rate of change of the translational velocity (m/s2).

    `acceleration` is the force divided by the mass, F/m, (m/s2), `u` the angular velocity omega
    (rad/s) and `v` the velocity V (m/s), all along the body axes.
    """
    return [
        acceleration[0] + v[1] * u[2] - v[2] * u[1],
        acceleration[1] + v[2] * u[0] - v[0] * u[2],
        acceleration[2] + v[0] * u[1] - v[1] * u[0],
    ]


def accelerations(scene: Scene, listing: Listing) -> list[float]:
    """Return the force divided by the mass along each body axis (m/s2).

    With the defect `three-masses` in `listing`, each axis has its own mass. Without the defect the
    first mass is used for all axes.
    """
    masses = scene.masses if listing.has("three-masses") else scene.masses[:1] * 3
    return [force / mass for force, mass in zip(scene.forces, masses, strict=True)]


def initial_torque(scene: Scene) -> Vector | None:
    """Return the initial torque of a scene divided by its moments of inertia (1/s2).

    The result is None if the scene has no moments, or is not a case of Table 1 of the thesis with
    an initial torque. By the conjecture (assumption) `initial-torque` this torque acts during the
    first step.
    """
    given = card_torque(scene)
    if given is None or scene.moments is None:
        return None
    return [n / moment for n, moment in zip(given, scene.moments, strict=True)]


def card_torque(scene: Scene) -> Vector | None:
    """Return the initial torque (N m) that the thesis specifies for a scene's case of Table 1.

    The result is None if the scene is not a case of Table 1, or if its case has no initial torque.
    """
    given = {each["case"]: each["torque"] for each in facts("printer")["initial_torque"]}
    return given.get(scene.case)


def all_finite(values: Vector) -> bool:
    """Return whether all values are finite, so that no value is NaN or infinite."""
    return all(map(is_finite, values))


class Record:
    """The results of a run of a program's Python version, from which a trajectory is made.

    A row of results is added for each step.
    """

    def __init__(self, scene: Scene, evaluations_per_step: int) -> None:
        """Create a record of a run without rows.

        `scene` supplies the step size. `evaluations_per_step` is the number of evaluations of the
        right-hand sides in a step.
        """
        self._step_size = scene.step_size
        self._per_step = evaluations_per_step
        self._rows: list[list[float]] = []
        self._ier: list[int] = []

    def add(self, recorded_time: float, omega: Vector, velocity: Vector, ier: int = 0) -> None:
        """Add the results of the next step to this record, as a row.

        `recorded_time` is TIME (s) as the program computes it. `omega` (rad/s) and `velocity` (m/s)
        are the results of the step. `ier` is the error code of the linear solver in the step.
        """
        true_time = (len(self._rows) + 1) * self._step_size
        self._rows.append([true_time, recorded_time, *omega, *velocity])
        self._ier.append(ier)

    def trajectory(
        self, ended: str = "complete", stop: Stop | None = None, prints_ier: bool = True
    ) -> Trajectory:
        """Return the trajectory of all rows that were added.

        `ended` says how the run ended, as in "complete". `stop` is the result of the stop test if
        this test ended the run. If `prints_ier`, the program prints the error code IER of its
        linear solver, and the trajectory contains it. A step that overflows has no row, but its
        evaluations of the right-hand sides are counted.
        """
        given = np.array(self._rows).reshape(-1, 8)
        rows = given.astype(np.float64)
        steps = len(self._rows)
        return Trajectory(
            time=rows[:, 0],
            recorded_time=rows[:, 1],
            omega=rows[:, 2:5],
            velocity=rows[:, 5:8],
            steps=steps,
            evaluations=self._per_step * (steps + (ended == "overflow")),
            ended=ended,
            stop=stop,
            ier=np.array(self._ier, dtype=np.int32) if prints_ier else None,
            exact=given if given.dtype == object else None,
        )

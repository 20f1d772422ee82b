"""Four-term collocation: the second program of the appendix, Jacobs 1982, IV.2.

Residual zero at .2, .4, .6 and .8 of the interval.
"""

from collections.abc import Sequence

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.collocation import interval
from pyharness.original.equations import (
    Record,
    Vector,
    accelerations,
    all_finite,
    omega_rate,
    velocity_rate,
)


def run(
    scene: Scene, listing: Listing, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run the program; it has no stop test, so `lipschitz` and `may_stop` do nothing."""
    coefficients = scene.euler_coefficients
    acceleration = accelerations(scene)
    h = scene.step_size
    dt = h
    time = 0.0
    state = [*scene.omega, 0.0, 0.0, 0.0]
    record = Record(scene, evaluations_per_step=5)

    for step in range(scene.steps):
        begin = step * h
        time = time + dt
        points = [dt * 0.2, dt * 0.4, dt * 0.6, dt * 0.8]
        if listing.has("torque-held"):
            torques = [scene.normalized_torque(time)] * 5
        else:
            torques = [scene.normalized_torque(begin + t) for t in (0.0, *points)]

        def rates(k: int, x: Vector, torques: Sequence[Vector] = torques) -> list[float]:
            u, v = x[:3], x[3:]
            return omega_rate(coefficients, torques[k], u) + velocity_rate(acceleration, u, v)

        state, ier = interval(state, points, h, rates)
        if not all_finite(state[:3]):
            return record.trajectory("overflow")
        record.add(time, state[:3], state[3:], ier)
        if listing.has("dt-accumulates"):
            dt = dt + h
    return record.trajectory()

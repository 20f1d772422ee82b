"""Four-term collocation: the second program of the appendix, Jacobs 1982, IV.2.

The collocation points are at .2, .4, .6 and .8 of each step.
"""

from collections.abc import Sequence

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.collocation import integrate
from pyharness.thesis.equations import Vector, accelerations, omega_rate, velocity_rate


def run(
    scene: Scene, listing: Listing, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run the program; it has no stop test, so `lipschitz` and `may_stop` have no effect."""
    coefficients = scene.euler_coefficients
    acceleration = accelerations(scene, listing)

    def rates(torques: Sequence[Vector], k: int, x: Vector) -> list[float]:
        u, v = x[:3], x[3:]
        return omega_rate(coefficients, torques[k], u) + velocity_rate(acceleration, u, v)

    return integrate(scene, listing, lambda dt: [dt * 0.2, dt * 0.4, dt * 0.6, dt * 0.8], rates)

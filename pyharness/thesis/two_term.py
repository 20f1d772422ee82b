"""Two-term collocation: the first program of the appendix, Jacobs 1982, IV.2.

The collocation points are at one third and two thirds of each step.
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
    a, b, c = scene.euler_coefficients
    unset_c1 = 0.0
    acceleration = accelerations(scene, listing)

    def rates(torques: Sequence[Vector], k: int, x: Vector) -> list[float]:
        coefficients = (a, b, c)
        forces = acceleration
        if k == 0 and listing.has("c1-for-c"):
            coefficients = (a, b, unset_c1)
        if k == 2 and listing.has("x3-reads-acl2"):
            forces = [acceleration[1], acceleration[1], acceleration[2]]
        u, v = x[:3], x[3:]
        return omega_rate(coefficients, torques[k], u) + velocity_rate(forces, u, v)

    return integrate(scene, listing, lambda dt: [dt / 3.0, 2.0 * dt / 3.0], rates)

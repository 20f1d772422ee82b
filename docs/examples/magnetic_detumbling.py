"""Coils slow the rotation of a small satellite in the magnetic field of the Earth."""

import numpy as np

from pyharness import Scene, TorqueLaw, solve
from pyharness.torques import magnetic_damping

orbit = 0.00108  # rad/s, the rate of the orbit
b = 3e-5  # T, the field above the equator
# The orbit is polar, in the plane of the axes 1 and 3; the Earth is a dipole along axis 1.
field = TorqueLaw(
    constant=(-0.5 * b, 0.0, 0.0),
    sines=[((0.0, 0.0, -1.5 * b), 2.0 * orbit)],
    cosines=[((-1.5 * b, 0.0, 0.0), 2.0 * orbit)],
    frame="space",
)
scene = Scene(
    "magnetic detumbling",
    omega=(0.1, -0.08, 0.06),
    attitude=(1.0, 0.0, 0.0, 0.0),
    moments=(0.04, 0.05, 0.03),
    torque=magnetic_damping(2e5, field),
)
time = np.linspace(0.0, 3.0 * 2.0 * np.pi / orbit, 301)
found = solve(scene, time, tolerance=1e-9, attitude=True)

rate = np.linalg.norm(found.omega, axis=1) / orbit
print(f"omega from {rate[0]:.0f} to {rate[-1]:.1f} times the rate of the orbit")

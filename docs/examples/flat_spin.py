"""Explorer 1: dissipation changes a spin about the long axis into a flat spin."""

import numpy as np

from pyharness import Scene, solve

moments = np.array([20.0, 20.0, 1.0])  # kg m2; axis 3 is the long axis
scene = Scene(
    "Explorer 1",
    omega=(0.05, 0.0, 5.0),
    moments=moments,
    # 0.001 h x (h x omega), where h is the momentum
    torque=lambda t, omega: 0.001 * np.cross(moments * omega, np.cross(moments * omega, omega)),
)
time = np.linspace(0.0, 400.0, 201)
found = solve(scene, time, tolerance=1e-9)

momentum = found.omega * moments
length = np.linalg.norm(momentum, axis=1)
energy = 0.5 * np.sum(momentum * found.omega, axis=1)
angle = np.degrees(np.arccos(momentum[:, 2] / length))
print(f"angle from {angle[0]:.1f} to {angle[-1]:.1f} deg")
print(f"energy from {energy[0]:.2f} to {energy[-1]:.2f} J")

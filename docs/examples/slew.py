"""A spring and a damper, simulated by a controller, turn a satellite by 120 degrees."""

import numpy as np

from pyharness import Scene, solve
from pyharness.torques import attitude_control

moments = np.array([40.0, 30.0, 20.0])  # kg m2
half = np.radians(120.0) / 2.0
target = np.array([np.cos(half), *(np.sin(half) * np.array([1.0, 2.0, 2.0]) / 3.0)])
scene = Scene(
    "slew",
    omega=(0.0, 0.0, 0.0),
    attitude=(1.0, 0.0, 0.0, 0.0),
    moments=moments,
    torque=attitude_control(0.05 * moments, 0.6 * moments, target),
)
time = np.linspace(0.0, 200.0, 201)
found = solve(scene, time, tolerance=1e-9, attitude=True)

# With the arcsine the small angles are accurate too. The two signs are one attitude.
distance = np.minimum(
    np.linalg.norm(found.attitude - target, axis=1), np.linalg.norm(found.attitude + target, axis=1)
)
error = np.degrees(4.0 * np.arcsin(distance / 2.0))
print(f"error from {error[0]:.0f} to {error[-1]:.0e} deg")

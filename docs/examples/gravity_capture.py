"""A satellite that tumbles in its orbit is captured by the gravity gradient and a damper."""

import numpy as np

from pyharness import Scene, solve
from pyharness.torques import gravity_gradient, rate_control

orbit = 0.00108  # rad/s, the rate of the orbit
moments = (10.0, 60.0, 70.0)  # kg m2; axis 1 is the long axis
scene = Scene(
    "gravity-gradient capture",
    omega=(0.0, 0.0, 3.0 * orbit),
    attitude=(np.cos(0.3), 0.0, 0.0, np.sin(0.3)),
    moments=moments,
    torque=gravity_gradient(moments, orbit) + rate_control(0.01, target=(0.0, 0.0, orbit)),
)
time = np.linspace(0.0, 10.0 * 2.0 * np.pi / orbit, 401)
found = solve(scene, time, tolerance=1e-9, attitude=True)

turned = 2.0 * np.unwrap(np.arctan2(found.attitude[:, 3], found.attitude[:, 0]))
angle = np.degrees(turned - orbit * time)  # from the vertical to the long axis
print(f"angle from {angle[0]:.1f} to {angle[-1]:.1f} deg")

"""The dual-spin turn: a wheel takes over the momentum, and the body turns by 90 degrees."""

import numpy as np

from pyharness import Scene, solve
from pyharness.torques import wheels

moments, spin, end = (30.0, 40.0, 50.0), 0.2, 2000.0  # kg m2, rad/s, s
momentum = moments[2] * spin
scene = Scene(
    "dual-spin turn",
    omega=(0.0, 0.001, spin),
    attitude=(1.0, 0.0, 0.0, 0.0),
    moments=moments,
    # The motor of the wheel along axis 1 brings it from rest to the momentum of the body.
    torque=wheels((0.0, 0.0, 0.0), motor=(momentum / end, 0.0, 0.0)),
)
time = np.linspace(0.0, end, 341)
found = solve(scene, time, tolerance=1e-9, attitude=True)

stored = np.outer(time, [momentum / end, 0.0, 0.0])
total = found.omega * moments + stored
angle = np.degrees(np.arccos(total[:, 0] / np.linalg.norm(total, axis=1)))
print(f"angle from {angle[0]:.1f} to {angle[-1]:.1f} deg")

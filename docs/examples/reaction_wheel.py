"""A reaction wheel turns a satellite by 90 degrees, from rest to rest, in one minute."""

import numpy as np

from pyharness import Scene, TorqueLaw, solve
from pyharness.torques import wheels

moments, end = (40.0, 30.0, 20.0), 60.0  # kg m2, s
frequency = 2.0 * np.pi / end
size = moments[2] * np.radians(90.0) * frequency / end  # N m
motor = TorqueLaw(sines=[((0.0, 0.0, -size), frequency)])
scene = Scene(
    "reaction wheel",
    omega=(0.0, 0.0, 0.0),
    attitude=(1.0, 0.0, 0.0, 0.0),
    moments=moments,
    torque=wheels((0.0, 0.0, 0.0), motor),
)
time = np.linspace(0.0, end, 121)
found = solve(scene, time, tolerance=1e-9, attitude=True)

stored = -size / frequency * (1.0 - np.cos(frequency * time))  # momentum of the wheel, N m s
angle = np.degrees(2.0 * np.arctan2(found.attitude[:, 3], found.attitude[:, 0]))
print(f"angle from {angle[0]:.0f} to {angle[-1]:.9f} deg")
print(f"omega at the end {found.omega[-1, 2]:.0e} rad/s")

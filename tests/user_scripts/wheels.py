"""Own states and a table of torques, from a trajectory to columns."""

from pathlib import Path

import numpy as np

from pyharness import InputError, Scene, load, solve
from pyharness.torques import damping, table

grid = np.linspace(0.0, 10.0, 6)
scene = Scene(
    "table",
    (0.1, 0.2, 1.0),
    moments=(1.0, 2.0, 3.0),
    torque=table(grid, np.outer(np.sin(grid), [0.1, 0.0, 0.2])) + damping(0.05),
)
found = solve(scene, grid, dense_output=True)
print(found.omega[:, 0].max(), found.tolerance < 1e-6, found.sol.t_max)
wheel = Scene(
    "wheel",
    (0.0, 0.1, 1.0),
    moments=(1.0, 2.0, 3.0),
    states={"h": (0.0, 1.0)},
    torque=lambda t, w, s: ([0.0, 0.0, -0.1 * s["h"]], {"h": w[2]}),
)
run = solve(wheel, [1.0, 5.0])
print(run.states["h"][-1], run.y.shape, run.nfev)
try:
    print(load(Path("missing.npz")).attitude[-1])
except InputError as error:
    print(error)

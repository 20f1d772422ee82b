"""Many bodies with estimates, and a prepared solver in a loop."""

import numpy as np

from pyharness import Scene, prepare, solve_many

scene = Scene("top", (0.0, 0.1, 1.0), moments=(2.0, 2.0, 1.0), attitude=(1, 0, 0, 0))
starts = np.random.default_rng(1).normal(size=(50, 3))
many = solve_many(scene, 10.0, omega=starts, estimates=True)
worst = many.error.max()
heading = many.attitude[:, 0]
print(many.omega.mean(axis=0), worst < 1e-8, heading.shape, many.ended[0])
rows = solve_many(scene, times=[1.0, 2.0], omega=starts)
print(rows.omega[0, -1], rows.times[-1])
solver = prepare(scene, attitude=True)
for start in starts[:3]:
    omega, attitude = solver(start, 10.0)
    print(omega[0], attitude[0], solver.error < 1e-9)
plain = prepare(scene, attitude=False)
print(plain(starts[0], 10.0)[2] + 1.0)

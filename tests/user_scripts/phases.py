"""A manoeuvre in phases: spin up until an event, then coast."""

from dataclasses import replace

import numpy as np

from pyharness import Scene, TorqueLaw, solve
from pyharness.events import crosses

scene = Scene("spin", (0.0, 0.0, 0.1), moments=(3.0, 2.5, 1.0), torque=(0.0, 0.001, 0.05))
burn = solve(scene, 100.0, events=crosses(3, 1.0, terminal=True), attitude=True)
assert burn.status == 1
assert burn.t_events[0].size == 1
coast = solve(
    replace(burn.scene_at(), torque=TorqueLaw()), np.linspace(40.0, 50.0, 11), attitude=True
)
print(burn.scene_at().t0, coast.omega[-1, 2], coast.attitude[-1, 0], coast.growth * 1.0)

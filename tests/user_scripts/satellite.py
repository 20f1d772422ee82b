"""A satellite with its attitude, dense output and events."""

import numpy as np

from pyharness import Scene, Trajectory, solve
from pyharness.events import crosses


def report(found: Trajectory) -> list[str]:
    lines = [f"{len(found.t)} rows, {found.message}"]
    if found.success and found.error < 1e-9:
        lines.append(f"{found.digits:.0f} digits")
    return lines


scene = Scene("satellite", (0.01, 1.0, 0.02), moments=(1.0, 2.0, 3.0), attitude=(1, 0, 0, 0))
found = solve(scene, np.linspace(0.0, 60.0, 121), dense_output=True, events=crosses(1))
last = found.attitude[-1]
angle = 2.0 * np.arccos(min(1.0, abs(last[0])))
first = found.t_events[0][0] if found.t_events[0].size else np.nan
omega = found.sol(0.5)[:3]
speed = float(np.linalg.norm(found.sol.derivative([1.0, 2.0]), axis=0).max())
print(*report(found), sep="\n")
print(angle, first, found.y_events[0].shape, omega.sum(), speed)
print(found.rotation().as_matrix()[-1] @ found.angular_momentum()[-1])

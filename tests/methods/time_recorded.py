"""Run time of the series for recorded torques.

The command is ``python -m tests.methods.time_recorded [TOLERANCE]``. For each torque the table has
the time of a prepared solver's call, and two ratios that are measured in the same run. The first is
SciPy's DOP853 over the series. The second is the series over the kernel for torque laws, for the
torque that is a law too.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pyharness import Scene, TorqueLaw, prepare, solve, torques
from pyharness.model.state_torque import replayed

MOMENTS = (1.0, 2.0, 2.5)
PUSH = (0.1, 0.2, -0.1)
TORQUES: dict[str, Any] = {
    "constant": replayed(lambda t, omega, q: list(PUSH)),
    "damping": torques.damping((0.1, 0.2, 0.3)),
    "cubic drag": torques.drag([0.0, 0.1]),
    "wheels": torques.wheels((0.1, 0.3, 0.2)),
    "gravity gradient": torques.gravity_gradient(MOMENTS, 0.5),
    "magnetic dipole": torques.magnetic_dipole((0.1, 0.2, 0.3), (1.0, 0.5, 0.2)),
    "attitude control": torques.attitude_control(0.5, 0.3),
}


def least(call: Callable[[], object], repeats: int) -> float:
    """Return the least time of several calls (s)."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    """Print the table for the tolerance on the command line, by default 1e-9."""
    tolerance = float(sys.argv[1]) if len(sys.argv) > 1 else 1e-9
    warm = Scene("warm", (1.0, 0.2, 0.5), moments=MOMENTS, torque=TORQUES["damping"])
    solve(warm, 0.1, "dop853")  # imports SciPy
    print(f"{'torque':18} {'T (s)':>6} {'us':>8} {'DOP853/series':>14} {'series/law':>11}")
    for name, torque in TORQUES.items():
        for end in (10.0, 100.0):
            scene = Scene(name, (1.0, 0.2, 0.5), moments=MOMENTS, torque=torque)
            with_attitude = torque.needs_attitude
            solver: Any = prepare(scene, "taylor", tolerance, attitude=with_attitude)
            own = least(lambda s=solver, t=end: s((1.0, 0.2, 0.5), t), 30)  # type: ignore[misc]
            other = least(
                lambda s=scene, t=end, a=with_attitude: solve(  # type: ignore[misc]
                    s, t, "dop853", tolerance, attitude=a
                ),
                1,
            )
            over_law = ""
            if name == "constant":
                law = prepare(replace(scene, torque=TorqueLaw(PUSH)), "taylor", tolerance)
                special = least(lambda s=law, t=end: s((1.0, 0.2, 0.5), t), 30)  # type: ignore[misc]
                over_law = f"{own / special:.1f}"
            print(f"{name:18} {end:6g} {own * 1e6:8.0f} {other / own:14.0f} {over_law:>11}")


if __name__ == "__main__":
    main()

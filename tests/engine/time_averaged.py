"""Time of the method `averaged` beside the Taylor series, under weak torques.

The command is ``python -m tests.engine.time_averaged``. Each row of the table has a scene and
a number of rotations. Times are processor times at a tolerance of 1e-9, of `averaged` the least of
ten calls. The first rows are for one scene whose torque is 1e-6 of the gyroscopic terms. The last
row has the medians of the random scenes with this ratio that `averaged` solves.
"""

import time
from collections.abc import Callable
from functools import partial
from random import Random

import numpy as np

from pyharness import InputError, Scene, TorqueLaw, solve

_TOLERANCE = 1e-9
_EFFORT = 1000.0
_CALLS = range(10)
_RANDOM = 12
_EXAMPLE = Scene(
    "example", (0.3, 0.2, 1.1), moments=(3.0, 2.0, 1.2), torque=TorqueLaw((1e-6, 2e-6, 1e-6))
)


def _time_of(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def _row(scene: Scene, rotations: float) -> tuple[int, float, float]:
    """Return the number of macro-steps, and the times of `averaged` and of the series (ms)."""
    end = rotations * 2.0 * np.pi / float(np.linalg.norm(scene.omega))
    steps = solve(scene, end, "averaged", _TOLERANCE).steps
    own = min(_time_of(partial(solve, scene, end, "averaged", _TOLERANCE)) for _ in _CALLS)
    series = _time_of(partial(solve, scene, end, "taylor", _TOLERANCE, effort=_EFFORT))
    return steps, 1e3 * own, 1e3 * series


def _random(source: Random) -> Scene:
    while True:
        first, second, third = (10 ** source.uniform(-0.5, 0.5) for _ in range(3))
        if 2.0 * max(first, second, third) < first + second + third:
            break
    x, y, z = (source.choice((-1, 1)) * 10 ** source.uniform(-1.0, 0.0) for _ in range(3))
    size = 1e-6 * max(first, second, third) * max(abs(x), abs(y), abs(z)) ** 2
    push = [size * source.uniform(-1.0, 1.0) for _ in range(3)]
    return Scene("random", (x, y, z), moments=(first, second, third), torque=TorqueLaw(push))


def _print(name: str, rotations: float, row: tuple[float, float, float]) -> None:
    steps, own, series = row
    cells = [name, f"{rotations:.0e}", f"{steps:.0f}", f"{own:.2f}", f"{series:.0f}"]
    print(f"| {' | '.join(cells)} | {series / own:.0f} |", flush=True)


def main() -> None:
    print("| scene | rotations | macro-steps | ms, averaged | ms, taylor | quotient |")
    print("| --- | --- | --- | --- | --- | --- |")
    for rotations in (1e4, 1e5, 1e6):
        _print("example", rotations, _row(_EXAMPLE, rotations))
    source = Random("averaged")
    rows: list[tuple[float, float, float]] = []
    refused = 0
    while len(rows) < _RANDOM:
        try:
            rows.append(_row(_random(source), 1e5))
        except InputError:
            refused += 1
    steps, own, series = np.median(rows, axis=0)
    _print(f"{_RANDOM} random, {refused} refused", 1e5, (steps, own, series))


if __name__ == "__main__":
    main()

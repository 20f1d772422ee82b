"""A user's script: the types accept everything that runs (see tests/test_packaging.py)."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np

from pyharness import (
    InputError,
    Listing,
    NotBuiltError,
    Scene,
    Solver,
    TorqueLaw,
    Trajectory,
    __version__,
    case_scene,
    load,
    prepare,
    read_scene,
    solve,
    subset,
)

law = TorqueLaw([1, 2, 3], np.zeros(3), [((0, 0, 1), 2.0)], ((np.ones(3), np.float64(2)),))
law = TorqueLaw(sines=(([x, 0.0, 0.0], 2 * x) for x in (1.0, 2.0)))
scenes = [
    Scene("tuples", (0.0, 1.0, 1.0), moments=(40.0, 30.0, 20.0)),
    Scene("lists", [0, 1, 1], moments=[40, 30, 20], torque=law, step_size=0.5, steps=2),
    Scene("arrays", np.array([0.0, 1.0, 1.0]), coefficients=np.array([1.0, -1.0, 0.5], dtype="f4")),
    Scene("scalars", [np.float32(1), 2, Fraction(1, 3)], [np.int64(3), Decimal(2), 1.0],
          step_size=np.float32(0.5), steps=np.int64(2), masses=[1, 2, 3], forces=range(3)),
    case_scene(3),
    case_scene(np.int64(5)),
]  # fmt: skip
first, second, third = scenes[0].omega
found: list[Trajectory] = [
    solve(scenes[0], 1.0),
    solve(scenes[0], [-1, 0, 1]),
    solve(scenes[0], (1.0, np.float64(2.0))),
    solve(scenes[0], np.linspace(0.0, 1.0, 5), "taylor", 1e-9),
    solve(scenes[0], range(5), tolerance=np.float32(1e-6)),
    solve(scenes[0], (0.1 * n for n in range(5))),
]
solver: Solver = prepare(scenes[1], "auto", tolerance=np.float64(1e-9))
found.append(solver.trajectory([0, 1, 1], np.array([1.0, 2.0])))
last: float = found[-1].omega[-1, 0]
columns: int = found[-1].y.shape[1]
ending: tuple[bool, int, str, int] = (
    found[-1].success, found[-1].status, found[-1].message, found[-1].nfev,
)  # fmt: skip
steps: int = found[-1].steps + solver.steps
listing: Listing = subset("runge-kutta", fix=["base-not-restored"], keep=("stage-base",))
try:
    loaded: Trajectory = load(Path("no such file.npz"))
    read_scene(Path("no such file.toml"))
    read_scene("no such file.toml")
except (InputError, NotBuiltError) as error:
    print(__version__, error, solver.status, found[0].ended, listing.label)

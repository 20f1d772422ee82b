"""Runge-Kutta methods that numba compiles, for `bench`.

For speed, the source of each right-hand side contains the scene's numbers, and loops over stages
are unrolled.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pyharness.bench.contenders import Maker
from pyharness.checks.compare.candidates import End, Ready, copied_result
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

MOST_STEPS = 10_000_000
Formula = tuple[Sequence[Sequence[float]], Sequence[float], Sequence[float]]
# Classical Runge-Kutta method: the stage coefficients below the diagonal, the weights, the nodes.
RK4 = [[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], [0.0, 0.5, 0.5, 1.0]


def numba_fixed(method: str, scene: Scene) -> Maker:
    """Return a maker of a numba kernel for "rk4", or "dop8" (the method of order 8 in DOP853)."""
    import numba

    formula: Formula = RK4
    if method != "rk4":
        # A private module is imported, because no public module of SciPy has these coefficients.
        from scipy.integrate._ivp import dop853_coefficients as table  # noqa: PLC2701

        count = table.N_STAGES
        stages = [table.A[i, :i].tolist() for i in range(count)]
        formula = stages, table.B.tolist(), table.C[:count].tolist()
    kernel = numba.njit(fastmath=False)(compiled_function(steps_source(scene, formula)))
    omega0, omega = np.array(scene.omega), np.empty(3)

    def make(horizon: float, setting: float) -> Ready:
        steps = int(setting)

        def run() -> Any:
            kernel(omega0, horizon, steps, omega)
            return omega

        return Ready(
            run, lambda result: End(copied_result(result), evaluations=steps * len(formula[1]))
        )

    return make


def compiled_function(source: str) -> Any:
    """Return the function named `function` that a Python source defines."""
    names: dict[str, Any] = {}
    exec(compile(source, "<bench>", "exec"), {"sin": np.sin, "cos": np.cos}, names)
    return names["function"]


def rates(
    scene: Scene, time: str, state: Sequence[str], coefficients: Sequence[float] = ()
) -> list[str]:
    """Return the right-hand side of each unknown as Python source.

    `time` and `state` are names in the source. Three unknowns are omega; seven also have the
    quaternion q, with q' = q (0, omega)/2. `coefficients` are A, B, C, by default the scene's.
    """
    x, y, z, *attitude = state
    moments = scene.moments or (1.0, 1.0, 1.0)
    law = scene.body_torque
    found = []
    for axis, product in enumerate((f"{y} * {z}", f"{x} * {z}", f"{x} * {y}")):
        terms = []
        coefficient = (coefficients or scene.euler_coefficients)[axis]
        if coefficient:
            terms.append(f"{coefficient!r} * {product}")
        if law.constant[axis]:
            terms.append(repr(law.constant[axis] / moments[axis]))
        if law.rate[axis]:
            terms.append(f"{law.rate[axis] / moments[axis]!r} * ({time})")
        for waves, function in ((law.sines, "sin"), (law.cosines, "cos")):
            for amplitude, frequency in waves:
                if amplitude[axis]:
                    wave = f"{function}({frequency!r} * ({time}))"
                    terms.append(f"{amplitude[axis] / moments[axis]!r} * {wave}")
        found.append(" + ".join(terms) or "0.0")
    if attitude:
        a, b, c, d = attitude
        found += [
            f"-0.5 * ({b} * {x} + {c} * {y} + {d} * {z})",
            f"0.5 * ({a} * {x} + {c} * {z} - {d} * {y})",
            f"0.5 * ({a} * {y} + {d} * {x} - {b} * {z})",
            f"0.5 * ({a} * {z} + {b} * {y} - {c} * {x})",
        ]
    return found


def state_names(scene: Scene) -> str:
    """Return the names of omega and any quaternion in the source, a letter each."""
    return "xyz" if scene.attitude is None else "xyzabcd"


def end_of(state: Array, evaluations: int | None = None) -> End:
    """Return the state at the end time as an `End`."""
    found = copied_result(state)
    attitude = found[3:] if len(found) > 3 else None
    return End(found[:3], evaluations=evaluations, attitude=attitude)


def steps_source(scene: Scene, formula: Formula) -> str:
    """Return the Python source of a Runge-Kutta integration with unrolled stages.

    Its function takes the initial omega, the end time (s), the number of steps, and the array for
    omega at the end.
    """
    stages, weights, nodes = formula
    lines = [
        "def function(omega0, t_end, steps, omega):",
        "    h = t_end / steps",
        "    x, y, z = omega0[0], omega0[1], omega0[2]",
        "    for step in range(steps):",
        "        t = step * h",
    ]
    for i, row in enumerate(stages):
        for name in "xyz":
            lines.append(f"        {name}s = {name}{_increment(row, name)}")
        time = f"t + {nodes[i]!r} * h" if nodes[i] else "t"
        for name, rate in zip("xyz", rates(scene, time, ("xs", "ys", "zs")), strict=True):
            lines.append(f"        k{name}{i} = {rate}")
    for name in "xyz":
        lines.append(f"        {name} = {name}{_increment(weights, name)}")
    lines.append("    omega[0], omega[1], omega[2] = x, y, z")
    return "\n".join(lines) + "\n"


def _increment(factors: Sequence[float], name: str) -> str:
    terms = [f"{factor!r} * k{name}{j}" for j, factor in enumerate(factors) if factor]
    return f" + h * ({' + '.join(terms)})" if terms else ""

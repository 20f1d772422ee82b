"""Error and run time of `solve_ivp` with the method Taylor and with DOP853.

The command is ``python -m tests.methods.time_ivp``. For ten textbook problems, each at the
tolerances 1e-6, 1e-9 and 1e-12 (rtol and atol), the table has the largest error of a component at
the end over the largest component, and the run time, which is the least of several calls of both
methods in turn.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from pyharness import Taylor
from tests.methods.textbook import PROBLEMS, Problem, solution

METHODS: tuple[Any, ...] = (Taylor, "DOP853")
TOLERANCES = (1e-6, 1e-9, 1e-12)


def main(repeats: int = 5) -> None:
    """Print the table."""
    print("| problem | tolerance | error, Taylor | DOP853 | ms, Taylor | DOP853 | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    ratios = []
    for problem in PROBLEMS:
        for tolerance in TOLERANCES:
            errors = [error(problem, method, tolerance) for method in METHODS]
            times = run_times(problem, tolerance, repeats)
            ratios.append(times[1] / times[0])
            row = [f"{each:.1e}" for each in errors] + [f"{1e3 * each:.1f}" for each in times]
            print("| " + " | ".join([problem.name, f"{tolerance:.0e}", *row]), end="")
            print(f" | {ratios[-1]:.1f} |", flush=True)
    print(f"geometric mean of the ratios: {np.exp(np.mean(np.log(ratios))):.1f}")


def error(problem: Problem, method: Any, tolerance: float) -> float:
    """Return the largest error at the end over the largest component."""
    found = solve_ivp(
        problem.fun, (0.0, problem.end), problem.y0, method=method, rtol=tolerance, atol=tolerance
    )
    assert found.success, found.message
    truth = np.array(solution(problem))
    return float(np.abs(found.y[:, -1] - truth).max() / np.abs(truth).max())


def run_times(problem: Problem, tolerance: float, repeats: int) -> Sequence[float]:
    """Return the least run time with each method (s)."""
    least = [np.inf] * len(METHODS)
    for _ in range(repeats):
        for place, method in enumerate(METHODS):
            begin = time.perf_counter()
            error(problem, method, tolerance)
            least[place] = min(least[place], time.perf_counter() - begin)
    return least


if __name__ == "__main__":
    main()

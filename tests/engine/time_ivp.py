"""Error and run time of `solve_ivp` with the method Taylor and with DOP853, and of heyoka.

The command is ``python -m tests.engine.time_ivp``. For ten textbook problems, each at the
tolerances 1e-6, 1e-9 and 1e-12 (rtol and atol), the table has the largest error of a component at
the end, divided by the largest component, and the shortest run time of several interleaved calls.
If heyoka is installed, its integrators get the same operations, compiled before the run time is
measured. The last column has the time of compilation if heyoka's cache on the disk is empty.
"""

import importlib.util
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from pyharness import Taylor
from pyharness.bench.peers import heyoka_functions
from pyharness.engine.steps.taylor_ivp import recorded_equation
from pyharness.model.tape import evaluate
from tests.engine.textbook import PROBLEMS, Problem, solution

METHODS: tuple[Any, ...] = (Taylor, "DOP853")
HAS_HEYOKA = importlib.util.find_spec("heyoka") is not None
TOLERANCES = (1e-6, 1e-9, 1e-12)


def main(repeats: int = 5) -> None:
    names = ["Taylor", "DOP853"] + ["heyoka"] * HAS_HEYOKA
    columns = ["problem", "tolerance", *(f"error, {each}" for each in names)]
    columns += [*(f"ms, {each}" for each in names), *(["ms to compile"] * HAS_HEYOKA)]
    print(_row(columns))
    print(_row(["---"] * len(columns)))
    ratios = []
    for problem in PROBLEMS:
        for tolerance in TOLERANCES:
            solvers = [partial(by_scipy, problem, each, tolerance) for each in METHODS]
            compiled = []
            if HAS_HEYOKA:
                begin = time.perf_counter()
                solvers.append(partial(by_heyoka, problem, integrator(problem, tolerance)))
                compiled.append(time.perf_counter() - begin)
            times = run_times(solvers, repeats)
            ratios.append([each / times[0] for each in times[1:]])
            row = [f"{relative(problem, each()):.1e}" for each in solvers]
            row += [f"{1e3 * each:.2f}" for each in times + compiled]
            print(_row([problem.name, f"{tolerance:.0e}", *row]), flush=True)
    for name, each in zip(names[1:], np.array(ratios).T, strict=True):
        print(
            f"time of {name} over that of Taylor: {each.min():.2g} to {each.max():.2g}, "
            f"geometric mean {np.exp(np.mean(np.log(each))):.2g}"
        )


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def error(problem: Problem, method: Any, tolerance: float) -> float:
    """Return the largest error at the end over the largest component."""
    return relative(problem, by_scipy(problem, method, tolerance))


def relative(problem: Problem, found: Any) -> float:
    """Return the largest error of a state at the end over the largest component."""
    truth = np.array(solution(problem))
    return float(np.abs(found - truth).max() / np.abs(truth).max())


def by_scipy(problem: Problem, method: Any, tolerance: float) -> Any:
    found = solve_ivp(
        problem.fun, (0.0, problem.end), problem.y0, method=method, rtol=tolerance, atol=tolerance
    )
    assert found.success, found.message
    return found.y[:, -1]


def integrator(problem: Problem, tolerance: float) -> Any:
    """Return a compiled integrator of heyoka."""
    import heyoka

    n = len(problem.y0)
    unknowns = [heyoka.expression(f"y{k}") for k in range(n)]
    tape = recorded_equation(problem.fun, n)
    rates = evaluate(tape, [heyoka.time, *unknowns], heyoka_functions())
    pairs = [(x, heyoka.expression(y)) for x, y in zip(unknowns, rates, strict=True)]
    return heyoka.taylor_adaptive(pairs, list(problem.y0), tol=tolerance)


def by_heyoka(problem: Problem, compiled: Any) -> Any:
    compiled.time = 0.0
    compiled.state[:] = problem.y0
    compiled.propagate_until(problem.end)
    return compiled.state.copy()


def run_times(solvers: Sequence[Callable[[], Any]], repeats: int) -> list[float]:
    """Return the least run time of each solver (s)."""
    least = [np.inf] * len(solvers)
    for _ in range(repeats):
        for place, solve in enumerate(solvers):
            begin = time.perf_counter()
            solve()
            least[place] = min(least[place], time.perf_counter() - begin)
    return least


if __name__ == "__main__":
    main()

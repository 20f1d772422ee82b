"""Run `pyharness verify --integrator` on integrators of other packages, and print a table.

python table.py PYTHON [SEED]: PYTHON has the packages scipy, heyoka and mujoco.
"""

import json
import shlex
import statistics
import subprocess
import sys
from pathlib import Path

# Expected results, from the documents or the source of each package.
KNOWN = {
    "scipy_ivp.py RK45 fixed": "order 5",
    "scipy_ivp.py DOP853 fixed": "order 8",
    "scipy_ivp.py RK45": "error near the tolerance",
    "scipy_ivp.py DOP853": "error near the tolerance",
    "scipy_ivp.py Radau": "error near the tolerance",
    "scipy_ivp.py LSODA": "error near the tolerance",
    "heyoka_taylor.py": "error near the tolerance",
    "mujoco_body.py Euler": "order 1",
    "mujoco_body.py implicitfast": "order 1",
    "mujoco_body.py RK4": "order 4",
}


def judged(python: str, script: str, seed: str) -> list[str]:
    """Return the cells of an integrator's row in the table."""
    command = f"{shlex.quote(python)} {Path(__file__).parent.name}/{script}"
    verb = [sys.executable, "-m", "pyharness", "verify", "--integrator", command]
    run = subprocess.run(
        [*verb, "--cell", "free,constant,wave", "--seed", seed, "--format", "json"],
        stdout=subprocess.PIPE, check=False, cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    found = json.loads(run.stdout)
    cells = [f"`{script}`", KNOWN[script]]
    for part in ("omega", "attitude"):
        curves = [each for each in found["convergence"] if each["part"] == part]
        orders = [each["order"] for each in curves if each["order"] is not None]
        cells.append(f"{statistics.median(orders):.2f}" if orders else "-")
    cells.append(f"{max(each['errors'][-1] for each in found['convergence']):.0e}")
    drifts = {
        each["id"].split("/")[1]: each["value"]
        for each in found["checks"] if each["id"].endswith("drift")
    }  # fmt: skip
    cells += [f"{drifts[name]:.0e}" for name in ("energy", "direction")]
    cells.append(", ".join(each["name"] for each in found["findings"]) or "none")
    return cells


def main() -> None:
    """Print the table."""
    python, seed = sys.argv[1], (sys.argv[2:] or ["table"])[0]
    heads = (
        "integrator", "known", "order of omega", "of attitude", "error",
        "drift of energy", "of direction (rad)", "recognised",
    )  # fmt: skip
    print(f"| {' | '.join(heads)} |\n| {' | '.join(['---'] * len(heads))} |")
    for script in KNOWN:
        print(f"| {' | '.join(judged(python, script, seed))} |", flush=True)


main()

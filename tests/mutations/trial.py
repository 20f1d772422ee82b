"""One row on trial: the check that caught it before, those near to it, then everything."""

import json
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath

from tests.mutations.table import ROOT, Row
from tests.mutations.tree import Tree

# Random draws of `verify` follow a seed; the week's would give another score each week.
SEED = "mutations"
# Not these: they look whether the text still stands, or plant faults in the text themselves.
NOT_HERE = ("tests/test_mutations.py",)
OF_ONE_CHECK = 180.0  # s
OF_ALL = 2400.0  # s
# By the beginning of a file: the tests that are most likely to see a change, the cheapest first.
NEAR = {
    "fortran/modern/taylor.f90": ("taylor", "slow_waves", "solver", "effort", "methods"),
    "fortran/modern/taylor_series.f90": ("taylor", "slow_waves", "solver"),
    "fortran/modern/taylor_plan.f90": ("taylor", "slow_waves", "solver"),
    "fortran/modern/euler_equations.f90": ("taylor", "slow_waves", "solver"),
    "fortran/modern/levels.c": ("taylor", "quick", "solver", "build"),
    "fortran/modern/levels.f90": ("taylor", "quick", "solver"),
    "fortran/modern/scaled_motion.f90": ("slow_waves", "quick", "solver"),
    "fortran/modern/scaled_march.f90": ("quick", "slow_waves", "solver"),
    "fortran/modern/scaled_runge_kutta.f90": ("quick", "slow_waves", "solver"),
    "fortran/modern/prepared.f90": ("scaling", "solver", "fixed_step", "quick"),
    "fortran/modern/solver.c": ("values", "solver"),
    "fortran/modern/torque_free.f90": ("closed_form", "solver"),
    "fortran/modern/two_words.f90": ("closed_form", "scaling"),
    "fortran/modern/sphere.f90": ("closed_form", "solver"),
    "fortran/modern/gauss_collocation.f90": ("gauss", "solver", "effort"),
    "fortran/make_gauss.py": ("gauss", "family"),
    "fortran/modern/fixed_step.f90": ("fixed_step", "effort", "solver"),
    "fortran/modern/torque_law.f90": ("fixed_step", "gauss"),
    "fortran/original/linear_solver.f90": ("linear_solver", "programs"),
    "fortran/original/": ("programs", "listing", "stress_steps"),
    "fortran/api.f90": ("programs", "solver", "closed_form", "gauss", "fixed_step", "taylor"),
    "pyharness/verify_": ("slack", "verify", "plants"),
    "pyharness/verify": ("verify", "plants"),
    "pyharness/checks": ("slack", "verify", "stress"),
    "pyharness/random_scenes": ("integer_series", "verify", "slack"),
    "pyharness/integer_series": ("integer_series", "slow_waves"),
    "pyharness/golden": ("slack", "verify"),
    "pyharness/agreement": ("compare", "programs", "verify"),
    "pyharness/conditioning": ("conditioning", "slack", "orders"),
    "pyharness/linearised": ("conditioning", "slow_waves", "methods"),
    "pyharness/values": ("values", "scene", "solver"),
    "pyharness/effort": ("effort", "limits", "cli"),
    "pyharness/claim": ("claims",),
    "pyharness/laboratory": ("claims",),
    "pyharness/counting": ("claims",),
    "pyharness/family": ("family",),
    "pyharness/stress": ("slack", "stress"),
    "pyharness/trials/step_size": ("slack", "stress_steps"),
    "pyharness/trials/matrices": ("slack", "stress_steps"),
    "pyharness/trials/truth": ("slack", "stress", "stress_motions"),
    "pyharness/trials/": ("slack", "stress", "stress_motions", "stress_steps"),
    "pyharness/stability/elliptic": ("elliptic", "stress_motions"),
    "pyharness/stability/axial_top": ("stress_motions",),
    "pyharness/stability/brouwer": ("slack", "stress_motions"),
    "pyharness/stability/turned_scenes": ("stress_motions",),
    "pyharness/stability/": ("slack", "stress_steps"),
    "pyharness/growth": ("bench",),
    "pyharness/original/linear_solver": ("linear_solver",),
    "pyharness/original/": ("programs",),
    "pyharness/scipy_methods": ("slow_waves", "effort", "scaling", "methods"),
    "pyharness/methods": ("methods", "solver", "cli"),
    "pyharness/modern": ("gauss", "fixed_step", "closed_form", "effort", "methods"),
    "pyharness/kernels": ("programs", "taylor", "solver"),
    "pyharness/reference": ("reference", "slow_waves", "effort"),
    "pyharness/scene.py": ("scene", "values", "programs"),
    "pyharness/scene_file": ("scene", "fuzz", "cli"),
    "pyharness/decimal_functions": ("reference",),
    "pyharness/external": ("external", "slack"),
    "pyharness/errors": ("scene", "solver", "cli"),
    "pyharness/records": ("compare", "cli"),
    "pyharness/tables": ("compare", "cli"),
    "pyharness/output": ("output", "cli", "figures"),
    "pyharness/options": ("cli",),
    "pyharness/verbs/verify": ("verify",),
    "pyharness/verbs/": ("cli",),
    "pyharness/trajectory": ("programs",),
    "pyharness/ablation": ("apparatus",),
    "pyharness/tape5": ("tape5",),
}
# What `verify` sees of these sooner than the whole suite would.
SEEN_BY_VERIFY = "random,methods,prepared"
JUDGES = (
    "fortran/modern/", "pyharness/verify_", "pyharness/methods", "pyharness/reference",
    "pyharness/scipy_methods", "pyharness/conditioning", "pyharness/linearised",
    "pyharness/modern", "pyharness/solver", "pyharness/random_scenes",
)  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """What became of a row.

    Attributes
    ----------
    killer : str or None
        What caught it, as in `Row`; None where it lives.
    """

    row: Row
    killer: str | None
    seconds: float = 0.0


def near(row: Row) -> list[str]:
    """Return the test files that are most likely to catch a change."""
    for begin, names in NEAR.items():
        if row.file.startswith(begin):
            paths = [f"tests/test_{name}.py" for name in names]
            return [path for path in paths if (ROOT / path).exists()]
    module = ".".join(PurePosixPath(row.file).with_suffix("").parts)
    package, _, name = module.rpartition(".")
    uses = re.compile(rf"\b(from|import) {re.escape(module)}\b|from {re.escape(package)} import"
                      rf" [^\n]*\b{name}\b|tests\.test_{name}\b")  # fmt: skip
    own = {f"test_{name}", f"test_{package.rpartition('.')[2]}"}
    found = [path for path in sorted((ROOT / "tests").glob("test_*.py"))
             if path.stem in own or uses.search(path.read_text())]  # fmt: skip
    found.sort(key=lambda path: path.stem not in own)
    return [f"tests/{path.name}" for path in found if f"tests/{path.name}" not in NOT_HERE]


def failing(tree: Tree, names: list[str], limit: float) -> str | None:
    """Run tests until one fails; return its name, or None."""
    ignored = [f"--ignore={path}" for path in NOT_HERE]
    endless = ["-o", f"faulthandler_timeout={OF_ONE_CHECK}",
               "-o", "faulthandler_exit_on_timeout=true"]  # fmt: skip
    command = [sys.executable, "-m", "pytest", "-v", "-x", "--no-header", "--tb=no", "-p",
               "no:cacheprovider", *endless, *ignored, *names]  # fmt: skip
    code, said = tree.run(command, limit)
    if code == 0:
        return None
    late = code is None or "Timeout (" in said
    if late or (code is not None and code < 0):
        begun = re.findall(r"^(tests/\S+::.*?)(?: (?:PASSED|SKIPPED|XFAIL).*)?$", said, re.M)
        last = re.split(r" (?=Fatal|Timeout|$)", begun[-1])[0].strip() if begun else "tests"
        return f"time-out {last}" if late else last
    failed = re.search(r"^(?:FAILED|ERROR) (tests/\S.*?)(?: - .*)?$", said, re.M)
    if failed:
        return failed[1].strip()
    # A name that is no more; or, where none was given, nothing at all could be collected.
    return None if names and code in (4, 5) else "tests"


def verification(tree: Tree, name: str | None = None, limit: float = OF_ALL) -> str | None:
    """Run `verify`, one check or all; return the first that failed, or None."""
    command = [sys.executable, "-m", "pyharness", "verify", "--format", "json"]
    if name:
        command += ["--only", name]
    if not name or "random" in name:
        command += ["--seed", SEED]
    code, said = tree.run(command, limit)
    if code == 0:
        return None
    if code is None:
        return f"time-out verify {name or ''}".strip()
    try:
        found = json.loads(said[said.index("{") :])["checks"]
        first: str = next(each["id"] for each in found if not each["passed"])
        return f"verify {first}"
    except (ValueError, KeyError, StopIteration):
        # A name that is no more; or a fault that let nothing be said.
        return None if name and code == 2 else f"verify {name or ''}".strip()


def check(tree: Tree, killer: str) -> str | None:
    """Run the check of that name; return its name where it fails."""
    name = killer.removeprefix("time-out ")
    kind, _, id = name.partition(" ")
    # What never ended is given less time to.
    limit = OF_ONE_CHECK / 3.0 if name != killer else OF_ONE_CHECK
    if kind == "verify":
        found = verification(tree, id or None, limit)
    else:
        found = failing(tree, [] if name == "tests" else [name], limit)
    return killer if found else None


def attempt(tree: Tree, unchanged: Tree, row: Row, reach: str, remember: bool = True) -> str | None:
    """Return what catches a row; `reach` is "killer", "near" or "all".

    What fails in a copy that is `unchanged` too says nothing.
    """
    said = tree.change(row)
    try:
        if said is not None:
            return "build"
        if row.killer and remember and row.killer != "build" and (found := check(tree, row.killer)):
            return found
        steps: list[Callable[[], str | None]] = []
        if reach in ("near", "all") and (names := near(row)):
            steps.append(lambda: failing(tree, names, OF_ALL))
        if reach in ("near", "all") and row.file.startswith(JUDGES):
            steps.append(lambda: verification(tree, SEEN_BY_VERIFY))
        if reach == "all":
            steps += [lambda: failing(tree, [], OF_ALL), lambda: verification(tree)]
        for step in steps:
            if (found := step()) and _is_new(unchanged, row, found):
                return found
        return None
    finally:
        tree.restore(row)


def _is_new(unchanged: Tree, row: Row, found: str) -> bool:
    """Whether what failed passes without the change: else it says nothing."""
    if check(unchanged, found) is None:
        return True
    print(f"{row.id}: {found} fails without the change too", file=sys.stderr)
    return False


def false_killers(tree: Tree, killers: list[str]) -> list[str]:
    """Return the checks that fail though nothing is changed."""
    names = sorted({each.removeprefix("time-out ") for each in killers} - {"build", "tests"})
    nodes = [each for each in names if not each.startswith("verify")]
    ids = [each.partition(" ")[2] for each in names if each.startswith("verify ")]
    found = []
    while nodes and (failed := failing(tree, nodes, OF_ALL)):
        found.append(failed)
        nodes = [each for each in nodes if each != failed and not failed.startswith(f"{each}[")]
    if ids and (failed := verification(tree, ",".join(ids))):
        found.append(failed)
    return found

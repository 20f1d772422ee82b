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
NOT_HERE = ("tests/mutations/test_mutations.py",)
OF_ONE_CHECK = 180.0  # s
OF_ALL = 2400.0  # s
# By the beginning of a file: the tests that are most likely to see a change, the cheapest first.
NEAR = {
    "fortran/modern/taylor.f90": (
        "methods/taylor",
        "methods/slow_waves",
        "methods/prepared",
        "model/effort",
        "methods/registry",
    ),
    "fortran/modern/taylor_series.f90": ("methods/taylor", "methods/slow_waves"),
    "fortran/modern/scaled_march.f90": ("methods/quick", "methods/slow_waves"),
    "fortran/modern/taylor_plan.f90": (
        "methods/taylor", "methods/slow_waves", "methods/prepared",
    ),
    "fortran/modern/euler_equations.f90": (
        "methods/taylor",
        "methods/slow_waves",
        "methods/prepared",
    ),
    "fortran/modern/levels.c": (
        "methods/taylor",
        "methods/quick",
        "methods/prepared",
        "model/build",
    ),
    "fortran/modern/levels.f90": ("methods/taylor", "methods/quick", "methods/prepared"),
    "fortran/modern/scaled_motion.f90": (
        "methods/slow_waves", "methods/quick", "methods/prepared",
    ),
    "fortran/modern/scaled_runge_kutta.f90": (
        "methods/quick",
        "methods/slow_waves",
        "methods/prepared",
    ),
    "fortran/modern/prepared.f90": (
        "model/same_motion",
        "methods/prepared",
        "methods/fixed_step",
        "methods/quick",
    ),
    "fortran/modern/solver.c": ("model/values", "methods/prepared"),
    "fortran/modern/torque_free.f90": ("methods/closed_form", "methods/prepared"),
    "fortran/modern/two_words.f90": ("methods/closed_form", "model/same_motion"),
    "fortran/modern/sphere.f90": ("methods/closed_form", "methods/prepared"),
    "fortran/modern/gauss_collocation.f90": ("methods/gauss", "methods/prepared", "model/effort"),
    "fortran/make_gauss.py": ("methods/gauss", "history/family"),
    "fortran/modern/fixed_step.f90": ("methods/fixed_step", "model/effort", "methods/prepared"),
    "fortran/modern/torque_law.f90": ("methods/fixed_step", "methods/gauss"),
    "fortran/original/linear_solver.f90": ("original/linear_solver", "original/programs"),
    "fortran/original/": ("original/programs", "model/listing", "stress/steps"),
    "fortran/api.f90": (
        "original/programs",
        "methods/prepared",
        "methods/closed_form",
        "methods/gauss",
        "methods/fixed_step",
        "methods/taylor",
    ),
    "pyharness/verify/kinds": ("verify/kinds", "verify/plants"),
    "pyharness/compare/checks": ("slack/slack", "verify/kinds", "stress/run"),
    "pyharness/compare/random_scenes": ("truth/integer_series", "verify/kinds", "slack/slack"),
    "pyharness/truth/integer_series": ("truth/integer_series", "methods/slow_waves"),
    "pyharness/verify/golden": ("slack/slack", "verify/kinds"),
    "pyharness/compare/agreement": ("compare/comparison", "original/programs", "verify/kinds"),
    "pyharness/theory/conditioning": ("theory/conditioning", "slack/slack", "compare/orders"),
    "pyharness/methods/linearised": (
        "theory/conditioning",
        "methods/slow_waves",
        "methods/registry",
    ),
    "pyharness/model/values": ("model/values", "model/scene", "methods/prepared"),
    "pyharness/model/effort": ("model/effort", "history/limits", "cli/main"),
    "pyharness/history/claims/": ("history/claims",),
    "pyharness/history/claims/laboratory": ("history/claims",),
    "pyharness/original/counting": ("history/claims",),
    "pyharness/history/family/members": ("history/family",),
    "pyharness/stress/run": ("slack/slack", "stress/run"),
    "pyharness/stress/trials/step_size": ("slack/slack", "stress/steps"),
    "pyharness/stress/trials/matrices": ("slack/slack", "stress/steps"),
    "pyharness/stress/hold": ("slack/slack", "stress/run", "stress/motions"),
    "pyharness/stress/trials/": ("slack/slack", "stress/run", "stress/motions", "stress/steps"),
    "pyharness/truth/elliptic": ("truth/elliptic", "stress/motions"),
    "pyharness/truth/axial_top": ("stress/motions",),
    "pyharness/theory/brouwer": ("slack/slack", "stress/motions"),
    "pyharness/model/turned_scenes": ("stress/motions",),
    "pyharness/theory/promises": ("slack/slack", "stress/run"),
    "pyharness/theory/": ("slack/slack", "stress/steps"),
    "pyharness/bench/growth": ("bench/measure",),
    "pyharness/original/linear_solver": ("original/linear_solver",),
    "pyharness/original/": ("original/programs",),
    "pyharness/methods/scipy_ivp": (
        "methods/slow_waves",
        "model/effort",
        "model/same_motion",
        "methods/registry",
    ),
    "pyharness/methods/registry": ("methods/registry", "methods/prepared", "cli/main"),
    "pyharness/methods/solve": ("methods/registry", "methods/prepared", "cli/main"),
    "pyharness/model/extension": ("original/programs", "methods/prepared"),
    "pyharness/methods/gauss": (
        "methods/gauss",
        "methods/fixed_step",
        "methods/closed_form",
        "model/effort",
        "methods/registry",
    ),
    "pyharness/methods/taylor": ("methods/taylor", "methods/prepared"),
    "pyharness/methods/problem": ("methods/taylor", "methods/prepared", "methods/gauss"),
    "pyharness/methods/closed_form": ("methods/closed_form", "methods/prepared"),
    "pyharness/methods/fixed_step": ("methods/fixed_step", "model/effort"),
    "pyharness/truth/reference": ("truth/reference", "methods/slow_waves", "model/effort"),
    "pyharness/model/scene.py": ("model/scene", "model/values", "original/programs"),
    "pyharness/model/scene_file": ("model/scene", "fuzz/fuzz", "cli/main"),
    "pyharness/truth/decimal": ("truth/reference",),
    "pyharness/verify/external": ("verify/external", "slack/slack"),
    "pyharness/verify/": ("slack/slack", "verify/kinds", "verify/plants"),
    "pyharness/model/errors": ("model/scene", "methods/prepared", "cli/main"),
    "pyharness/views/": ("compare/comparison", "cli/main"),
    "pyharness/model/report": ("cli/main",),
    "pyharness/model/records": ("cli/main",),
    "pyharness/compare/report": ("cli/main",),
    "pyharness/methods/report": ("compare/comparison", "cli/main"),
    "pyharness/cli/output": ("cli/output", "cli/main", "history/figures"),
    "pyharness/cli/options": ("cli/main",),
    "pyharness/cli/verbs/verify": ("verify/kinds",),
    "pyharness/cli/verbs/": ("cli/main",),
    "pyharness/model/trajectory": ("original/programs",),
    "pyharness/history/ablation": ("history/ablation",),
    "pyharness/history/tape5": ("history/tape5",),
}  # fmt: skip
# What `verify` sees of these sooner than the whole suite would.
SEEN_BY_VERIFY = "random,methods,prepared"
JUDGES = (
    "fortran/modern/", "pyharness/verify/", "pyharness/methods/", "pyharness/truth/reference",
    "pyharness/theory/conditioning", "pyharness/compare/random_scenes",
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
            rooms = [name.rpartition("/") for name in names]
            paths = [f"tests/{room}/test_{name}.py" for room, _, name in rooms]
            return [path for path in paths if (ROOT / path).exists()]
    module = ".".join(PurePosixPath(row.file).with_suffix("").parts)
    package, _, name = module.rpartition(".")
    uses = re.compile(rf"\b(from|import) {re.escape(module)}\b|from {re.escape(package)} import"
                      rf" [^\n]*\b{name}\b|tests\.test_{name}\b")  # fmt: skip
    own = {f"test_{name}", f"test_{package.rpartition('.')[2]}"}
    found = [path for path in sorted((ROOT / "tests").rglob("test_*.py"))
             if path.stem in own or uses.search(path.read_text())]  # fmt: skip
    found.sort(key=lambda path: path.stem not in own)
    paths = [str(path.relative_to(ROOT)) for path in found]
    return [path for path in paths if path not in NOT_HERE]


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

"""`make cross-check`: make builds, compare bits, run their tests; exit status 1 on faults.

Without arguments, it makes the build with run-time checks, and a build by another compiler or, if
there is none, by other options. It runs few tests, unless the kernels differ from the commit at
which all tests passed. `--all` makes every build, and those with planted faults.
"""

import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from pyharness.checks.check import Check, Name
from pyharness.checks.report import checks_report, summary
from pyharness.model.facts import facts
from pyharness.thesis.in_word import compiled_words
from pyharness.views.render import render
from tests.changed import PASSED, changed
from tests.cross.builds import ROOT, Build, environment, false_claims, make, native_flag
from tests.cross.comparison import CHECKOUT, compared, inside
from tests.instruction_sets import fuses_here
from tests.tiers import FAST

FOLDER = ROOT / "build" / "cross"
# Tests of the kernels that are compared with the truth, not bit for bit.
MODERN = (
    "tests/thesis/test_linear_solver.py",
    *(
        f"tests/engine/test_{name}.py"
        for name in ("closed_form", "fixed_step", "gauss", "quick", "prepared", "taylor")
    ),
)
# Tests that call the kernels, each in its own way. What the other tests do with the results is the
# same in every build.
CALLING = (
    "tests/engine",
    *(f"tests/model/test_{name}.py" for name in ("attitude", "conversions", "effort", "values")),
    "tests/thesis",
    "tests/checks/compare/test_candidates.py",
    "tests/checks/test_motions.py::test_bounds_hold",
    "tests/checks/test_stress.py::test_bounds_hold",
    # The build with traps calls its kernels through Python, so that they have no address.
    "--ignore=tests/engine/test_compiled_call.py",
    # These tests enter no kernel, but SciPy, the reference, or Python's words, cards and stages.
    *(
        f"--ignore=tests/{name}.py"
        for name in (
            "engine/test_scipy_state", "thesis/test_cards", "thesis/test_deck_collation",
            "thesis/test_operations", "thesis/test_words",
        )
    ),
)  # fmt: skip
# Tests that together enter every compiled procedure that any test enters, as `make mutate` records.
ENTERING = (
    *(
        f"tests/engine/test_{name}.py"
        for name in (
            "attitude_error", "closed_form", "estimates", "many_alone", "many_details", "prepared",
            "quick", "quick_growth", "saturation", "stepper", "tape_lanes", "term_motions", "work",
        )
    ),
    *(f"tests/engine/test_within_tolerance.py::{name}" for name in (
        "test_every_instruction_set", "test_many_bodies_side_by_side",
        "test_many_bodies_under_one_torque",
    )),
    *(f"tests/model/test_{name}.py" for name in ("conversions", "effort", "shown")),
    *(f"tests/thesis/test_{name}.py" for name in ("compiled_words", "linear_solver", "many")),
)  # fmt: skip
# Recursion is not checked: the entries release the lock, so that two threads may be in one entry.
# An array temporary is no fault, and 400 000 lines report them.
# An optimising compiler would compute with signalling NaN itself, and no trap would tell of it.
CHECKED = (
    "-fcheck=all,no-recursion,no-array-temps", "-finit-real=snan", "-fsignaling-nans",
    "-finit-integer=-2147483647", "-finit-logical=true", "-finit-derived",
)  # fmt: skip
# The tests outside the cross-check use the best instruction set of the machine.
TRAPS = {"PYHARNESS_TRAPS": "1", "PYHARNESS_INSTRUCTIONS": "avx2"}
ORIGINAL = "fortran/original/"
# Faults that need not change bits: program, (file, passage, faulty passage), expected message.
FAULTS = {
    "index": ("two-term", ("two_term.fypp", "M1(3) + A1*U2(3)*U3(3)",
                           "M1(3) + A1*U2(3)*U3(3) + 0.0_wp*U3(2 + I)"), "above upper bound"),
    "uninitialised": ("four-term", ("four_term.fypp", "V1(1) = 0.0_wp", "continue"), "invalid"),
    "zero": ("runge-kutta", ("runge_kutta.fypp", "begin = real(L - 1, wp)*scene%step_size",
                             "begin = scene%step_size/real(L - 1, wp)"), "divide by zero"),
}  # fmt: skip


def main() -> int:
    """Run the builds named on the command line."""
    builds, skipped = _builds()
    names = [CHECKOUT, *(build.name for build in builds)]
    other = [name for name in ("flang-O2", "gfortran-O3-native") if name in names]
    chosen = sys.argv[1:] or [CHECKOUT, "debug", *other[:1]]
    if chosen == ["--all"]:
        chosen = names
    elif not sys.argv[1:]:
        paths = changed(PASSED.read_text().strip())
        is_same = paths is not None and not any(path.startswith("fortran/") for path in paths)
        builds = [
            replace(each, tests=ENTERING if is_same and each.checked else each.tests)
            for each in builds
        ]
        builds = [replace(each, tests=each.tests and (*each.tests, "-m", FAST)) for each in builds]
    for name in chosen:
        if name not in names:
            print(f"cross-check: no build '{name}'; skipped: {skipped}", file=sys.stderr)
            return 2
    if left := [name for name in names if name not in chosen]:
        skipped.append(f"left out: {', '.join(left)}; with --all they are made too")
    FOLDER.mkdir(parents=True, exist_ok=True)
    environment(FOLDER / "environment")
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        wanted = [build for build in builds if build.name in chosen]
        wanted.sort(key=lambda build: not build.checked)  # the slowest first
        twin = pool.submit(_digests_here, "python")
        found = pool.map(lambda build: list(_checked(build, twin.result())), wanted)
        checks = [check for each in found for check in each]
    if CHECKOUT in chosen:
        due = _due(twin.result(), compiled_words())
        checks += compared(CHECKOUT, _digests_here("fortran"), due, _listed())
    print(render(checks_report("cross", checks, summary(skipped, checks, 2)), "table"), end="")
    return 0 if all(check.passed for check in checks) else 1


def _builds() -> tuple[list[Build], list[str]]:
    """Return the builds that can be made here, and the reasons for those that can't."""
    gfortran = os.environ.get("FC", "gfortran")
    faults = tuple((ORIGINAL + file, old, new) for _, (file, old, new), _ in FAULTS.values())
    debug = Build(
        "debug", gfortran, "gcc", "1", CHECKED, checked=True, tests=CALLING, instruction_sets="all"
    )
    faulty = replace(
        debug, name="faulty", plants=faults, faulty=True, tests=(), instruction_sets="plain"
    )
    builds = [debug, faulty]
    skipped = []
    native = native_flag(gfortran)
    if native is None:
        skipped.append(f"skipped: gfortran -O3 for this processor: {gfortran} has no such option")
    else:
        builds.append(Build("gfortran-O3-native", gfortran, "gcc", "3", (native,), tests=MODERN))
        fused = (
            "meson.build",
            "'-nostdinc', '-ffp-contract=off'",
            "'-nostdinc', '-ffp-contract=fast'",
        )
        contracted = Build("contracted", gfortran, "gcc", "2", (native,), "fast", plants=(fused,))
        if fuses_here():
            builds.append(contracted)
        else:
            skipped.append("skipped: contracted: this processor has no fused multiply-add")
    # Nobody who compares builds expects that a compiler is installed.
    found = subprocess.run(
        [str(ROOT / ".ci" / "flang")], env=os.environ | {"INSTALL": "no"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if found.returncode:
        skipped.append(f"skipped: flang: {(found.stderr.splitlines() or ['?'])[-1]}")
    else:
        builds.append(Build("flang-O2", found.stdout.strip(), "llvm-flang", "2", tests=MODERN))
    return builds, skipped


def _digests_here(language: str) -> dict[str, str]:
    """Return the digests of the programs in Python or in Fortran, computed in this checkout."""
    file = FOLDER / f"{language}.json"
    command = [sys.executable, "-m", "tests.cross.digests", language, str(file)]
    subprocess.run(command, cwd=ROOT, check=True)
    digests: dict[str, str] = json.loads(file.read_text())["digests"]
    return digests


def _listed() -> set[tuple[str, str]]:
    """Return build and cell of each known divergence from the twin."""
    entries = facts("divergences")["divergence"]
    return {(each["build"], each["cell"]) for each in entries if each["kind"] == "cross-build"}


def _due(twin: dict[str, str], words: Collection[str]) -> dict[str, str]:
    """Return the digests that a build must have whose compiler supports these formats."""
    return {
        cell: each
        for cell, each in twin.items()
        if not cell.startswith("words/") or cell.split("/")[1] in words
    }


def _checked(build: Build, twin: dict[str, str]) -> Iterator[Check]:
    name = build.name
    replay = f"make cross-check ARGS={name}"
    begin = time.monotonic()
    try:
        tree = make(build, FOLDER)
    except RuntimeError as error:
        yield Check(Name("build", name), False, None, None, None, str(error), replay)
        return
    built = time.monotonic()
    if build.faulty:
        yield from _faults(tree)
        _tell(name, begin, built, built)
        return
    done = _run(tree, ["-m", "tests.cross.digests", "fortran", "digests.json"], traps=build.checked)
    if done.returncode:
        yield Check(Name("build", name), False, None, None, None, done.stdout[-1000:], replay)
        return
    record = json.loads((tree / "digests.json").read_text())
    wrong = false_claims(build, tree, record)
    yield Check(Name("build", name), not wrong, None, None, None, "; ".join(wrong), replay)
    bits = list(compared(name, record["digests"], _due(twin, record["words"]), _listed()))
    if build.contract != "off":
        seen = sum(not check.passed for check in bits)
        note = f"{seen} of {len(bits)} cells differ" if seen else "the comparison sees no fault"
        yield Check(Name("fault", "contraction"), seen > 0, None, None, None, note, replay)
    else:
        yield from bits
    compared_at = time.monotonic()
    if build.tests:
        yield _suite(build, tree)
    _tell(name, begin, built, compared_at)


def _tell(name: str, begin: float, built: float, compared_at: float) -> None:
    print(
        f"cross-check: {name}: built in {built - begin:.0f} s, compared in "
        f"{compared_at - built:.0f} s, tested in {time.monotonic() - compared_at:.0f} s",
        file=sys.stderr,
    )


def _suite(build: Build, tree: Path) -> Check:
    """Run tests in the tree of a build, with floating-point traps if it has run-time checks."""
    name = build.name
    # With -s, the last output of a process that a test ends is not lost.
    processes = ["-n", "2", "--dist", "worksteal"] if build.checked else []
    arguments = ["pytest", "-sq", *processes, "-p", "no:cacheprovider", *build.tests]
    done = _run(tree, ["-m", *arguments], traps=build.checked)
    log = FOLDER / f"{name}.log"
    log.write_text(done.stdout)
    traps = "".join(f"{key}={x} " for key, x in TRAPS.items()) if build.checked else ""
    replay = inside(name, shlex.join(arguments), traps)
    note = ""
    if done.returncode:
        lines = done.stdout.splitlines()
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        died = [line for line in lines if "Fortran runtime error" in line or ", untold" in line]
        words = [*failed, *died] or lines[-3:]
        note = "; ".join([*(each[:300] for each in words), f"see {log.relative_to(ROOT)}"])
    return Check(Name("tests", name), done.returncode == 0, None, None, None, note, replay)


def _faults(tree: Path) -> Iterator[Check]:
    """Check that each planted fault ends the process with the expected message."""
    for name, (program, _, words) in FAULTS.items():
        code = (
            "import tests.conftest; from pyharness.cli.main import main; "
            f"main(['run', '--case', '3', '--program', '{program}', '--listing', 'original'])"
        )
        done = _run(tree, ["-c", code], traps=True)
        seen = done.returncode != 0 and words in done.stdout
        note = "" if seen else f"not seen: {words}\n{done.stdout[-2000:]}"
        replay = "make cross-check ARGS=faulty"
        yield Check(Name("fault", name), seen, None, None, None, note, replay)


def _run(tree: Path, arguments: list[str], traps: bool = False) -> subprocess.CompletedProcess[str]:
    # Tests start processes in other folders, and these must find the tree of the build.
    variables = {"PYTHONPATH": str(tree)} | (TRAPS if traps else {})
    return subprocess.run(
        [str(FOLDER / "environment" / "bin" / "python"), *arguments], cwd=tree, check=False,
        env=os.environ | variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())

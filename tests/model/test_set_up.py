"""The build as installers see it: metadata without compiling, and progress."""

import os
import re
import runpy
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest

from pyharness.model.distribution import DISTRIBUTION

ROOT = Path(__file__).parent.parent.parent
CI = ROOT / ".ci"
PROGRESS = runpy.run_path(str(CI / "build_progress.py")) if CI.exists() else {}
pytestmark = pytest.mark.skipif(not CI.exists(), reason="needs a checkout")


@pytest.mark.parametrize("kind", ["wheel", "editable"])
def test_metadata_are_written_without_compiling(kind: str, tmp_path: Path) -> None:
    """They are those that meson-python wrote for this installation."""
    code = (
        f"import sys, build_backend as b; print(b.prepare_metadata_for_build_{kind}(sys.argv[1]))"
    )
    environment = os.environ | {"PYTHONPATH": str(CI), "CC": "no-compiler", "FC": "no-compiler"}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, env=environment,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    installed = distribution(DISTRIBUTION)
    folder = tmp_path / done.stdout.strip()
    assert folder.name == f"{DISTRIBUTION.replace('-', '_')}-{installed.version}.dist-info"
    assert sorted(file.name for file in folder.iterdir()) == ["METADATA", "entry_points.txt"]
    for file in folder.iterdir():
        assert file.read_text() == installed.read_text(file.name)


def _build(folder: Path, costs: dict[str, float], n_done: int, pace: float) -> None:
    """Write what ninja leaves of a build: steps with a cost (s), the first of them finished."""
    lines, log = ["build all: phony a.o", "build build.ninja: REGENERATE_BUILD"], ["# ninja log v7"]
    now = 0.0
    for number, (name, seconds) in enumerate(costs.items()):
        lines.append(f"build {name}.o | {name}.mod: fortran_COMPILER {name}.f90 || x.dd")
        if number < n_done:
            begin, now = now, now + pace * seconds
            for each in (f"{name}.o", f"{name}.mod"):
                log.append(f"{begin * 1000:.0f}\t{now * 1000:.0f}\t0\t{each}\tabc")
    (folder / "build.ninja").write_text("\n".join(lines) + "\n")
    (folder / ".ninja_log").write_text("\n".join(log) + "\n")


@pytest.mark.parametrize(("pace", "jobs"), [(1.0, 1), (3.0, 2), (0.5, 4)])
def test_the_estimate_is_measured(pace: float, jobs: int, tmp_path: Path) -> None:
    """The time left follows from the steps that this machine has finished."""
    costs = {f"small-{n}": PROGRESS["OTHERS"] for n in range(40)}
    costs |= {
        f"lib{part}{n}": PROGRESS["COSTS"][part] for n in (1, 2) for part in PROGRESS["COSTS"]
    }
    whole = sum(costs.values()) * pace / jobs
    for n_done in (0, 30, 43, 50, len(costs)):
        _build(tmp_path, costs, n_done, pace)
        elapsed = sum([*costs.values()][:n_done]) * pace / jobs
        line = PROGRESS["describe"](tmp_path, jobs, elapsed)
        counted = f"compiling {n_done} of {len(costs)}"
        if n_done == 0:
            assert line == counted
        else:
            found = re.fullmatch(f"{counted}, about (\\d+) s left", line)
            assert found is not None
            assert int(found[1]) == pytest.approx(max(1.0, whole - elapsed), abs=1.0)


def test_costs_are_those_of_objects_that_are_built() -> None:
    builds = [path.parent for path in ROOT.glob("build/cp*/build.ninja")]
    if not builds:
        pytest.skip("needs a build in the checkout")
    names = {*PROGRESS["edges"](builds[0]).values()}
    assert len(names) > 90
    assert {each for each in names if each.endswith((".f90", ".c", ".h", ".o", ".a", ".so"))}
    for part in PROGRESS["COSTS"]:
        assert any(PROGRESS["cost"](each) == PROGRESS["COSTS"][part] for each in names), part

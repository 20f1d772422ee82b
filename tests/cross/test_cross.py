"""Parts of the cross-check: digests, their comparison, claims, floating-point guards."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from pyharness import Listing, Stop, case_scene
from pyharness.model.codes import Methods, Operations, Statuses
from pyharness.model.extension import COMPLETE, GAVE_UP, OVERFLOW
from pyharness.thesis import compiled
from tests import traps
from tests.cross.builds import ROOT, Build, false_claims
from tests.cross.comparison import CHECKOUT, compared
from tests.cross.digests import count_of_runs, digest, replay
from tests.traps import DIVIDE, INVALID, TOO_LARGE, UntoldException, guarded


def test_contributing_has_the_number_of_runs_that_are_compared() -> None:
    told = f"compares every bit of {count_of_runs()} runs"
    assert told in " ".join((ROOT / "CONTRIBUTING.md").read_text().split())


def test_digest_sees_every_bit_and_every_counter() -> None:
    run: Any = compiled.run(case_scene(3), Listing.original("two-term"))
    changed = [
        replace(run, steps=run.steps - 1), replace(run, evaluations=run.evaluations + 1),
        replace(run, ended="overflow"), replace(run, stop=Stop(25, "V2", 501.0)),
        replace(run, stop=Stop(25, "V2", 502.0)), replace(run, ier=run.ier + 129),
        replace(run, omega=_next(run.omega)), replace(run, velocity=_next(run.velocity)),
        replace(run, recorded_time=_next(run.recorded_time)), replace(run, time=_next(run.time)),
        replace(run, velocity=np.where(np.arange(3) == 0, -0.0, run.velocity)),
        replace(run, velocity=np.where(np.arange(3) == 0, 0.0, run.velocity)),
    ]  # fmt: skip
    words = [digest(each) for each in (run, *changed)]
    assert len(set(words)) == len(words)
    assert digest(compiled.run(case_scene(3), Listing.original("two-term"))) == words[0]
    nan = np.full_like(run.velocity, np.nan)
    assert digest(replace(run, velocity=nan)) == digest(replace(run, velocity=-nan))


def _next(array: np.ndarray) -> np.ndarray:
    """Return a copy whose last number is larger by one unit in the last place."""
    changed = array.copy()
    changed.flat[-1] = np.nextafter(changed.flat[-1], np.inf)
    return changed


CELL = "cells/two-term/case-3/original"
NASTY = "nasty/two-term/at rest/original"


def test_comparison_names_build_cell_and_replay() -> None:
    twin = {CELL: "a", NASTY: "b"}
    assert all(check.passed for check in compared("flang-O2", twin, twin))
    first, second = compared("flang-O2", {CELL: "x"}, twin)
    assert (first.passed, second.passed) == (False, False)
    assert first.id == f"bits/flang-O2/{CELL}"
    assert first.replay.startswith("cd build/cross/flang-O2 && ")
    assert first.replay.endswith(f"verify --only {CELL}")
    assert "PYHARNESS_ALL_LISTINGS=1 " in second.replay
    assert "PYHARNESS_ALL_LISTINGS" not in first.replay
    here, _ = compared(CHECKOUT, {CELL: "x"}, twin)
    assert not here.passed
    assert here.replay == f"python -m pyharness verify --only {CELL}"
    assert replay(NASTY).endswith("[two-term-at rest]'")


@pytest.mark.parametrize(
    ("build", "word", "passed"),
    [("flang-O2", "x", True), ("flang-O2", "a", False), ("gfortran-O2", "x", False)],
)
def test_listed_divergence_passes_and_one_that_no_longer_occurs_fails(
    build: str, word: str, passed: bool
) -> None:
    (found,) = compared(build, {CELL: word}, {CELL: "a"}, {("flang-O2", CELL)})
    assert found.passed == passed


@pytest.mark.parametrize(("command", "record", "words"), [
    ("gfortran -O2 -O3 -ffp-contract=off", {}, None),
    ("gfortran -O3 -O2 -ffp-contract=off", {}, "with ['-O2'], not -O3"),
    ("gfortran -O3 -ffp-contract=off -ffp-contract=fast", {}, "not -ffp-contract=off"),
    ("flang -O3 -ffp-contract=off", {}, "meson ran flang"),
    ("gfortran -O3 -ffp-contract=off", {"extension": "/elsewhere/_kernels.so"}, "loaded from"),
    ("gfortran -O3 -ffp-contract=off", {"compiler": "llvm-flang 19"}, "not by gcc"),
    ("gfortran -O3 -ffp-contract=off", {"flags": "-O3"}, "does not tell of -ffp-contract=off"),
])  # fmt: skip
def test_build_that_is_not_what_it_claims_is_named(
    command: str, record: dict[str, str], words: str | None, tmp_path: Path
) -> None:
    (tmp_path / "build").mkdir()
    entry = f'[{{"command": "{command}", "file": "deck_binary64.f90"}}]'
    (tmp_path / "build" / "compile_commands.json").write_text(entry)
    said = {
        "extension": str(tmp_path / "pyharness" / "_kernels.so"),
        "compiler": "gcc 12.2.0",
        "flags": "-O3 -ffp-contract=off",
    }
    found = false_claims(Build("x", "gfortran", "gcc", "3"), tmp_path, said | record)
    assert ("; ".join(found) == "") if words is None else (words in "; ".join(found))


Guarded = Callable[..., Callable[..., Any]]


@pytest.fixture
def guarded_entry(monkeypatch: pytest.MonkeyPatch) -> Guarded:
    """Return a factory of guarded entries, which raise flags and return a status and a quotient."""

    def make(raised: int, status: int, quotient: float = 0.0, name: str = "entry") -> Any:
        # A library without traps, as on macOS.
        library = Mock(spec=["feclearexcept", "fetestexcept"])
        library.fetestexcept = lambda mask: raised & mask
        monkeypatch.setattr(traps, "_mathematics", lambda: library)
        entry = Mock(return_value=(status, quotient), __doc__="status,stop_quotient = entry()\n")
        return guarded(name, entry)

    return make


def _untold(call: Callable[..., Any], *given: Any) -> bool:
    try:
        call(*given)
    except UntoldException:
        return True
    return False


@pytest.mark.parametrize(("raised", "status", "quotient", "is_told"), [
    (0, COMPLETE, 0.0, True),
    (TOO_LARGE, OVERFLOW, 0.0, True),
    (TOO_LARGE | INVALID, OVERFLOW, 0.0, True),
    (TOO_LARGE | INVALID, GAVE_UP, 0.0, True),
    (DIVIDE, COMPLETE, np.inf, True),
    (TOO_LARGE, COMPLETE, 0.0, False),
    (INVALID, COMPLETE, 0.0, False),
    (INVALID, OVERFLOW, 0.0, False),
    (DIVIDE, COMPLETE, 0.0, False),
    (DIVIDE, OVERFLOW, 0.0, False),
    (DIVIDE | TOO_LARGE, OVERFLOW, 0.0, True),
    (TOO_LARGE, COMPLETE, np.inf, False),
])  # fmt: skip
def test_guard_lets_through_what_the_answer_tells_of(
    raised: int, status: int, quotient: float, is_told: bool, guarded_entry: Guarded
) -> None:
    call = guarded_entry(raised, status, quotient)
    assert _untold(call) != is_told
    assert not is_told or call() == (status, quotient)


@pytest.mark.parametrize(
    ("code", "is_told"),
    [(Methods.QUICK_OR_TAYLOR, True), (Methods.QUICK, True), (Methods.TAYLOR, False)],
)
def test_guard_knows_an_attempt_that_is_refused(
    code: int, is_told: bool, guarded_entry: Guarded
) -> None:
    """Only the prepared method `quick` retries, so that it may overflow and still be complete."""
    packed = np.zeros(20)
    packed[0] = code
    assert _untold(guarded_entry(TOO_LARGE, COMPLETE, name="solve_packed"), packed) != is_told


@pytest.mark.parametrize(("raised", "status", "operation", "is_told"), [
    (DIVIDE, OVERFLOW, Operations.PRODUCT, True),
    (INVALID, OVERFLOW, Operations.PRODUCT, True),
    (INVALID, Statuses.STALLED, Operations.PRODUCT, True),
    (TOO_LARGE, COMPLETE, Operations.PRODUCT, True),
    (DIVIDE, COMPLETE, Operations.PRODUCT, False),
    (INVALID, COMPLETE, Operations.PRODUCT, False),
    (INVALID, COMPLETE, Operations.SQRT, True),
    (DIVIDE, COMPLETE, Operations.QUOTIENT, True),
])  # fmt: skip
def test_guard_knows_that_a_users_torque_may_be_singular(
    raised: int, status: int, operation: int, is_told: bool, guarded_entry: Guarded
) -> None:
    tape = np.zeros(10)
    tape[2] = 1.0
    tape[8:].view(np.int32)[0] = operation
    assert _untold(guarded_entry(raised, status, name="tape_rows"), tape) != is_told


def test_guard_knows_an_infinity_that_was_given(guarded_entry: Guarded) -> None:
    call = guarded_entry(INVALID, OVERFLOW)
    assert not _untold(call, np.array([np.inf, 1.0]), 2)
    assert _untold(call, np.array([1.0, 1.0]), 2)


@pytest.mark.external
@pytest.mark.skipif(not (ROOT / ".ci/flang").exists(), reason="needs a checkout")
@pytest.mark.parametrize(
    ("named", "words"), [("", "no 'flang', and none was installed"), ("none", "no 'none'")]
)
def test_flang_that_can_not_be_had_is_one_line(named: str, words: str, tmp_path: Path) -> None:
    """The cross-check shows the line and continues."""
    for tool in ("sh", "id"):
        (tmp_path / tool).symlink_to(shutil.which(tool) or "")
    environment = {"PATH": str(tmp_path), "INSTALL": "no", "FLANG": named}
    done = subprocess.run(
        [str(ROOT / ".ci/flang")], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1

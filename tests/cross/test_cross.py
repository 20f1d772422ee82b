"""The cross-check's own parts: digests, their comparison, claims, floating-point guards."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.model.extension import COMPLETE, GAVE_UP, OVERFLOW
from pyharness.model.listing import original
from pyharness.model.trajectory import Stop
from pyharness.original import compiled
from tests import traps
from tests.cross.builds import ROOT, Build, false_claims
from tests.cross.comparison import compared
from tests.cross.digests import digest, replay
from tests.traps import DIVIDE, INVALID, TOO_LARGE, UntoldException, guarded


def test_digest_sees_every_bit_and_every_counter() -> None:
    run = compiled.run(case_scene(3), original("two-term"))
    assert run.velocity is not None
    assert run.ier is not None
    changed = [
        replace(run, steps=run.steps - 1),
        replace(run, evaluations=run.evaluations + 1),
        replace(run, ended="overflow"),
        replace(run, stop=Stop(25, "V2", 501.0)),
        replace(run, stop=Stop(25, "V2", 502.0)),
        replace(run, ier=run.ier + 129),
        replace(run, omega=_next(run.omega)),
        replace(run, velocity=_next(run.velocity)),
        replace(run, recorded_time=_next(run.recorded_time)),
        replace(run, time=_next(run.time)),
        replace(run, velocity=np.where(np.arange(3) == 0, -0.0, run.velocity)),
        replace(run, velocity=np.where(np.arange(3) == 0, 0.0, run.velocity)),
    ]
    words = [digest(each) for each in (run, *changed)]
    assert len(set(words)) == len(words)
    assert digest(compiled.run(case_scene(3), original("two-term"))) == words[0]
    nan = np.full_like(run.velocity, np.nan)
    assert digest(replace(run, velocity=nan)) == digest(replace(run, velocity=-nan))


def _next(array: np.ndarray) -> np.ndarray:
    """One unit in the last place in the last number."""
    changed = array.copy()
    changed.flat[-1] = np.nextafter(changed.flat[-1], np.inf)
    return changed


def test_comparison_names_build_cell_and_replay() -> None:
    twin = {"cells/two-term/case-3/original": "a", "nasty/two-term/at rest/original": "b"}
    assert all(check.passed for check in compared("flang-O2", twin, twin))
    other = {"cells/two-term/case-3/original": "x"}
    first, second = compared("flang-O2", other, twin)
    assert (first.passed, second.passed) == (False, False)
    assert first.id == "bits/flang-O2/cells/two-term/case-3/original"
    assert first.replay.startswith("cd build/cross/flang-O2 && ")
    assert first.replay.endswith("verify --only cells/two-term/case-3/original")
    assert replay("nasty/two-term/at rest/original").endswith("[two-term-at rest]'")


def test_listed_divergence_passes_and_one_that_no_longer_occurs_fails() -> None:
    cell = "cells/two-term/case-3/original"
    listed = {("flang-O2", cell)}
    assert [c.passed for c in compared("flang-O2", {cell: "x"}, {cell: "a"}, listed)] == [True]
    assert [c.passed for c in compared("flang-O2", {cell: "a"}, {cell: "a"}, listed)] == [False]
    assert [c.passed for c in compared("gfortran-O2", {cell: "x"}, {cell: "a"}, listed)] == [False]
    assert [c.passed for c in compared("flang-O2", {}, {}, listed)] == [False]


@pytest.mark.parametrize(
    ("command", "record", "words"),
    [
        ("gfortran -O2 -O3 -ffp-contract=off", {}, None),
        ("gfortran -O3 -O2 -ffp-contract=off", {}, "with ['-O2'], not -O3"),
        ("gfortran -O3 -ffp-contract=off -ffp-contract=fast", {}, "not -ffp-contract=off"),
        ("flang -O3 -ffp-contract=off", {}, "meson ran flang"),
        ("gfortran -O3 -ffp-contract=off", {"extension": "/elsewhere/_kernels.so"}, "loaded from"),
        ("gfortran -O3 -ffp-contract=off", {"compiler": "llvm-flang 19"}, "not by gcc"),
        ("gfortran -O3 -ffp-contract=off", {"flags": "-O3"}, "does not tell of -ffp-contract=off"),
    ],
)
def test_build_that_is_not_what_it_claims_is_named(
    command: str, record: dict[str, str], words: str | None, tmp_path: Path
) -> None:
    (tmp_path / "build").mkdir()
    entry = f'[{{"command": "{command}", "output": "liboriginal.a.p/deck.o"}}]'
    (tmp_path / "build" / "compile_commands.json").write_text(entry)
    said = {
        "extension": str(tmp_path / "pyharness" / "_kernels.so"),
        "compiler": "gcc 12.2.0",
        "flags": "-O3 -ffp-contract=off",
    }
    found = false_claims(Build("x", "gfortran", "gcc", "3"), tmp_path, said | record)
    assert ("; ".join(found) == "") if words is None else (words in "; ".join(found))


class _Flags:
    """A mathematics library whose flags are what a test says; without traps, as on macOS."""

    def __init__(self, raised: int) -> None:
        self.raised = raised

    def feclearexcept(self, _: int) -> None: ...

    def fetestexcept(self, mask: int) -> int:
        return self.raised & mask


def _entry(status: int, quotient: float) -> Callable[..., Any]:
    def entry(*_: Any) -> Any:
        return status, quotient

    entry.__doc__ = "status,stop_quotient = entry()\n"
    return entry


@pytest.mark.parametrize(
    ("raised", "status", "quotient", "is_told"),
    [
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
    ],
)
def test_guard_lets_through_what_the_answer_tells_of(
    raised: int, status: int, quotient: float, is_told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(traps, "_mathematics", lambda: _Flags(raised))
    call = guarded("entry", _entry(status, quotient))
    if is_told:
        assert call() == (status, quotient)
    else:
        with pytest.raises(UntoldException, match="entry: "):
            call()


@pytest.mark.parametrize(("code", "is_told"), [(8, True), (7, True), (3, False)])
def test_guard_knows_an_attempt_that_is_refused(
    code: int, is_told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the prepared methods only `quick` tries again, and may overflow and be complete."""
    monkeypatch.setattr(traps, "_mathematics", lambda: _Flags(TOO_LARGE))
    packed = np.zeros(20)
    packed[0] = code
    call = guarded("solve_packed", _entry(COMPLETE, 0.0))
    if is_told:
        assert call(packed) == (COMPLETE, 0.0)
    else:
        with pytest.raises(UntoldException, match="overflow"):
            call(packed)


def test_guard_knows_an_infinity_that_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traps, "_mathematics", lambda: _Flags(INVALID))
    call = guarded("entry", _entry(OVERFLOW, 0.0))
    assert call(np.array([np.inf, 1.0]), 2) == (OVERFLOW, 0.0)
    with pytest.raises(UntoldException):
        call(np.array([1.0, 1.0]), 2)


@pytest.mark.external
@pytest.mark.skipif(not (ROOT / ".ci/flang").exists(), reason="needs a checkout")
@pytest.mark.parametrize(
    ("named", "words"), [("", "no flang, and none could be installed"), ("none", "no 'none'")]
)
def test_flang_that_can_not_be_had_is_one_line(named: str, words: str, tmp_path: Path) -> None:
    """The cross-check shows it and goes on."""
    for tool in ("sh", "id"):
        (tmp_path / tool).symlink_to(shutil.which(tool) or "")
    environment = {"PATH": str(tmp_path), "INSTALL": "no", "FLANG": named}
    done = subprocess.run(
        [str(ROOT / ".ci/flang")], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1

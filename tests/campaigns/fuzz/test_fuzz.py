"""Random input of every kind: no traceback, no hang, no crash."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pyharness import Scene, Trajectory
from tests.campaigns.fuzz import campaign as fuzz
from tests.campaigns.fuzz.checks import KINDS, tried

# The campaign (`python -m tests.campaigns.fuzz`) tries more.
EXAMPLES = {
    "scene-file": 50, "program": 50, "method": 0, "prepared": 20, "listing": 50, "command": 20,
    "process": 1,
}  # fmt: skip
BODY = "[body]\nmoments=[3,2,1]\n[initial]\nomega=[1,2,3]\n"


@pytest.mark.campaign
@pytest.mark.property
@pytest.mark.parametrize("kind", [kind for kind, count in EXAMPLES.items() if count])
def test_random_input_is_solved_or_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]

    # The same examples each time, so that a failure can be repeated; the campaign varies them.
    @settings(
        max_examples=EXAMPLES[kind], deadline=None, database=None, derandomize=True,
        suppress_health_check=checks,
    )  # fmt: skip
    @given(st.randoms(use_true_random=False))
    def every(random: Random) -> None:
        tried(kind, KINDS[kind].make(random), tmp_path)

    every()


def test_every_kind_is_in_the_suite_and_in_the_campaign() -> None:
    assert set(EXAMPLES) == set(fuzz.SHARES) == set(KINDS)
    assert sum(fuzz.SHARES.values()) == 1000


def test_input_is_the_same_for_the_same_seed_and_number() -> None:
    for kind in KINDS:
        first, again, other = (repr(fuzz.made(kind, seed, 2)) for seed in (1, 1, 2))
        assert first == again != other


CHECKS = "tests.campaigns.fuzz.checks"
FAULTS: dict[str, tuple[str, str, Callable[..., object]]] = {
    "traceback": ("listing", f"{CHECKS}.subset", lambda *_: _raised(KeyError())),
    "lines": (
        "scene-file",
        "tests.campaigns.fuzz.checks.read_scene",
        lambda _: _raised(ValueError("a\nb")),
    ),
    "nan": ("method", f"{CHECKS}.solve", lambda s, t, *_: _not_a_number(s, t)),
    "bits": ("program", f"{CHECKS}.differences", lambda *_: ["omega"]),
    "code": ("command", "tests.campaigns.fuzz.checks.main", lambda _: 3),
    "silence": ("command", "tests.campaigns.fuzz.checks.main", lambda _: 2),
}


def _raised(error: Exception) -> None:
    raise error


def _not_a_number(scene: Scene, times: tuple[float, ...]) -> Trajectory:
    time = np.array(times)
    return Trajectory(time, time, np.full((len(times), 3), math.nan), None, 0, 0)


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_seen(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every check fails if its subject is wrong."""
    kind, name, planted = FAULTS[fault]
    monkeypatch.setattr(name, planted)
    given_input = next(
        found for n in range(99) if getattr(found := fuzz.made(kind, 1, n), "times", True)
    )
    with pytest.raises(AssertionError, match="input: "):
        tried(kind, given_input, tmp_path)


_HANGS = (
    "from tests.campaigns.fuzz import campaign; campaign.PATIENCE = 1.0; "
    "campaign.tried = lambda kind, given, folder: given == 6 or __import__('time').sleep(60); "
    "campaign.made = lambda kind, seed, number: number; campaign._work('listing', 1, 6, 9)"
)


@pytest.mark.parametrize(("code", "words"), [
    ("import os; print('at 7', flush=True); os.kill(os.getpid(), 11)", "ended with -11"),
    pytest.param(_HANGS, "no end within", marks=pytest.mark.campaign),
])  # fmt: skip
def test_worker_that_dies_or_hangs_is_a_fault_of_its_input(
    code: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Replace the campaign's worker by one that does not return."""
    worker = tmp_path / "python"
    worker.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}"\n')
    worker.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(worker))
    go_on, faults = fuzz._watched("listing", 1, 5, 9)
    assert go_on == 8
    assert len(faults) == 1
    assert "--number 7" in faults[0]
    assert words in faults[0]

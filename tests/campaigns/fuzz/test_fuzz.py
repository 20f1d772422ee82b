"""Random input of every kind, and faults found by it: no traceback, no hang, no crash."""

import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pyharness import InputError, Scene, TorqueLaw, prepare, solve
from pyharness.cli.main import main
from pyharness.engine.registry import FIXED_STEP
from pyharness.engine.solver import PREPARED
from pyharness.history.limits import limit
from pyharness.model.errors import printable
from pyharness.model.trajectory import Trajectory
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


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import os; print('at 7', flush=True); os.kill(os.getpid(), 11)", "ended with -11"),
        pytest.param(_HANGS, "no end within", marks=pytest.mark.campaign),
    ],
)
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


# Faults found by the campaign, or by reading the code before it.


def test_message_is_one_line_that_a_terminal_can_show() -> None:
    """Regression test: names with line feeds, escapes and 4000 letters were printed unchanged."""
    assert str(InputError("a\nb\x1b[1m\udcff")) == "a b\\x1b[1m\\udcff"
    assert len(str(InputError("where: " + "x" * 5000 + "; allowed: y"))) < 1000
    assert str(InputError("x" * 5000 + "; allowed: y")).endswith("; allowed: y")
    assert printable("ü 日本") == "ü 日本"


def test_pipe_without_another_end_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression test: a scene from an unwritten pipe, and a result to an unread one, hung."""
    monkeypatch.setattr("pyharness.model.pipes.PATIENCE", 0.05)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert main(["plan", "--scene", str(pipe)]) == 2
    assert "nothing came within 0.05 s" in capsys.readouterr().err
    assert main(["doctor", "--out", str(pipe)]) == 2
    assert "no one read it within 0.05 s" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_scene_comes_through_a_pipe() -> None:
    command = f"printf '{BODY}' | {sys.executable} -m pyharness plan --scene /dev/stdin"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert "I = (3, 2, 1) kg m2" in done.stdout


@pytest.mark.campaign
def test_name_that_the_terminal_or_the_picture_can_not_write(tmp_path: Path) -> None:
    """Regression test: UnicodeEncodeError; the picture read a name with dollars as a formula."""
    path = tmp_path / "\udcff ü.toml"
    path.write_text(BODY + "[run]\nsteps=3\n")
    command = [sys.executable, "-m", "pyharness", "run", "--program", "two-term", "--scene"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([*command, str(path)], capture_output=True, env=environment, check=True)
    assert done.stdout.startswith(b"\\udcff \\xfc\n")
    assert done.stderr == b""
    path.write_text('name = "$\\\\frac$ \\u0007"\n' + BODY + "[run]\nsteps=3\n")
    picture = tmp_path / "x.svg"
    arguments = ["run", "--scene", str(path), "--program", "two-term", "--plot", str(picture)]
    assert main([*arguments, "--out", str(tmp_path / "x.txt")]) == 0
    assert picture.exists()


@pytest.mark.parametrize("method", PREPARED)
def test_start_that_is_not_finite_is_not_complete(method: str) -> None:
    """Regression test: the start was returned unchanged at time 0, with the status `complete`."""
    law = TorqueLaw() if method == "closed-form" else TorqueLaw((0.0, 0.0, 1.0))
    solver = prepare(Scene("", (1.0, 2.0, 3.0), moments=(0.5, 0.7, 1.0), torque=law), method, 1e-3)
    for start in (math.nan, math.inf):
        assert np.isnan(solver(np.array([start, 1.0, 2.0]), 0.0)).all()
        assert solver.status != "complete"


def test_many_steps_are_given_up_before_they_are_taken() -> None:
    """Regression test: a minute and more, because the limits ignored the cost of a wave."""
    law = TorqueLaw(sines=[((1.0, 2.0, 3.0), 17.0 + 0.01 * n) for n in range(40)])
    scene = Scene("", (1.0, 2.0, 3.0), moments=(4.0, 3.0, 2.0), torque=law, step_size=1e-6)
    for method in (*FIXED_STEP, "gauss-2"):
        solver = prepare(scene, method)
        solver(np.array(scene.omega), 6.0)
        assert (solver.status, solver.steps) == ("gave up", 0)


REST, SPHERE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
RUNAWAY = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))  # infinite at t = 1
GROWING = Scene("", REST, coefficients=(-1.67, -1.2, 3.0), torque=TorqueLaw((-0.5, 6.0, -9.8)))
BEYOND = Scene("", (1e300, -3e16, 1e16), coefficients=(1e100, -1e100, 1.0))
STEEP = Scene(
    "", (7e-63, 5e-242, -3e-86), coefficients=(1.2e5, 1.5e183, 2.5e297),
    torque=TorqueLaw((1.0, 1.0, 2e-308), (1.7976931348623157e308, 2e5, -8e-147)),
)  # fmt: skip
PUSHED = Scene("", REST, SPHERE, torque=TorqueLaw((-4.8e-92, -7.5e113, 2.2e165)))
RAMPED = Scene(
    "", (0.0, 0.0, 9.0), coefficients=(-3.0, -4.0, -7.0),
    torque=TorqueLaw(REST, (-10.0, -76.0, 4.6e272)),
)  # fmt: skip
LIGHT = Scene("", (1.0, 2.0, 3.0), (1.0, 5e-324, 1.0), torque=TorqueLaw((1.0, 1.0, 1.0)))
LONG = Scene("", (0.01, 7.0, -9.7), (9.85, 2.99, 1800.0))


@pytest.mark.parametrize(
    ("scene", "times", "method", "tolerance", "end"),
    [
        # ValueError: the maximum of no rows.
        *((RUNAWAY, [2.0, 3.0], f"gauss-{stages}", 1e-6, "overflow") for stages in (1, 3, 5)),
        # The time is too long for the method, and there is no blow-up; it reported one.
        (GROWING, [3000.0], "gauss-1", 1e-2, "refused"),
        # ZeroDivisionError: no step is small enough.
        (BEYOND, [0.0], "gauss-1", 1e-6, "complete"),
        (BEYOND, [1.0], "gauss-1", 1e-6, "refused"),
        # An intermediate row was not finite.
        (STEEP, [-0.0, -10.0], "taylor", 1e-10, "overflow"),
        # Radau: ValueError from a matrix of infinities; LSODA: a warning on stderr.
        (PUSHED, [0.09], "radau", 1e-7, "complete"),
        (PUSHED, [1e200], "radau", 1e-7, "overflow"),
        (RAMPED, [-0.48, -2353.0], "lsoda", 5e-7, "overflow"),
        # NumPy printed a warning of an overflow on stderr.
        (LIGHT, [1.0], "gauss-4", 1e-12, "refused"),
        (LIGHT, [1.0], "taylor", 1e-12, "refused"),
        # It took minutes; callers of `pyharness.truth.reference` may still wait as long.
        (LONG, [1000.0], "reference", 1e-10, "refused"),
    ],
)
def test_extreme_motion_ends_in_time_and_says_how(
    scene: Scene, times: list[float], method: str, tolerance: float, end: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("pyharness.engine.gauss._MOST_EVALUATIONS", 1_000_000)
    if end == "refused":
        with pytest.raises(InputError):
            solve(scene, times, method, tolerance)
        return
    found = solve(scene, times, method, tolerance)
    assert found.ended == end
    assert np.isfinite(found.omega).all()
    if scene is RUNAWAY:
        assert len(found.time) == 0
    elif end == "complete":
        wanted = np.array(scene.omega) + times[0] * np.array(scene.law.constant)
        np.testing.assert_allclose(found.omega[0], wanted, rtol=1e-7, atol=1e157)


def test_scipy_gives_up_by_what_it_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression test: Radau took half a minute and more, since its right-hand sides cost more."""
    monkeypatch.setattr("pyharness.engine.scipy_ivp._MOST_EVALUATIONS", 3_000)
    waves = [((1.0, 2.0, 3.0), 1e4 + n) for n in range(8)]
    for law, method, most in (
        (TorqueLaw((1e42, 0.0, 0.0)), "dop853", 3000),
        (TorqueLaw((1e42, 0.0, 0.0)), "radau", 1500),
        (TorqueLaw((1e42, 0.0, 0.0), sines=waves), "dop853", 1500),
    ):
        scene = Scene("", (1.0, 1.0, 9.0), moments=(4.0, 7.0, 8.5), torque=law)
        with pytest.raises(InputError, match=f"after {most} "):
            solve(scene, [0.7], method, 1e-9)


@pytest.mark.campaign
def test_limits_of_a_scene_that_its_solver_can_not_begin() -> None:
    """Regression test: AttributeError, because no rows are a list, not an array."""
    coefficients = (1.1e-16, 1.1e-16, 4.4e17)
    scene = Scene("", (0.005, -5.0, -1.6), coefficients=coefficients, step_size=0.6, steps=4)
    assert limit("two-term", scene, 1).order is None

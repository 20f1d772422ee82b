"""The progress bar of calls for many bodies: it counts bodies, and changes no bit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, run_many, solve_many, subset
from pyharness.sweep.sweep_file import read_sweep
from pyharness.torques import damping
from tests.conftest import Capture
from tests.refused import refused
from tests.sweep.sweeps import SQUARE, run_sweep, text, written

BRICK = Scene("brick", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2))
STARTS = np.random.default_rng(5).uniform(-1.0, 1.0, (700, 3))


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("torque", [TorqueLaw(), TorqueLaw((0.1, 0.0, 0.2)), damping(0.1)])
def test_bar_counts_bodies_and_changes_no_bit(torque: Any, threads: int, capsys: Capture) -> None:
    scene = replace(BRICK, torque=torque)
    given: dict[str, Any] = {"omega": STARTS, "threads": threads}
    plain = solve_many(scene, 2.0, **given)
    assert capsys.readouterr().err == ""
    found = solve_many(scene, 2.0, **given, progress=True)
    assert found.omega.tobytes() == plain.omega.tobytes()
    assert found.status.tobytes() == plain.status.tobytes()
    shown = capsys.readouterr().err
    assert "100%" in shown
    assert "700/700" in shown
    # Later calls show nothing.
    solve_many(scene, 2.0, **given)
    assert capsys.readouterr().err == ""


def test_scenes_of_different_kinds_have_one_bar(capsys: Capture) -> None:
    full = Scene("full", (1.0, 0.0, 0.5), inertia=((3.0, 0.1, 0.0), (0.1, 2.0, 0.0), (0, 0, 1.5)))
    scenes = [BRICK, full, replace(BRICK, torque=damping(0.1)), BRICK]
    plain = solve_many(scenes, 1.0)
    assert solve_many(scenes, 1.0, progress=True).omega.tobytes() == plain.omega.tobytes()
    assert "4.00/4.00" in capsys.readouterr().err


def test_programs(capsys: Capture) -> None:
    listing = subset("two-term")
    scene = replace(BRICK, steps=20)
    plain = run_many(scene, listing, omega=STARTS)
    found = run_many(scene, listing, omega=STARTS, progress=True)
    assert found.omega.tobytes() == plain.omega.tobytes()
    assert "700/700" in capsys.readouterr().err


def test_a_call_that_fails_leaves_no_bar(capsys: Capture) -> None:
    refused("threads", solve_many, BRICK, 1.0, omega=STARTS, threads=0, progress=True)
    capsys.readouterr()
    solve_many(BRICK, 1.0, omega=STARTS)
    assert capsys.readouterr().err == ""


@pytest.mark.campaign
def test_sweep(tmp_path: Path, capsys: Capture) -> None:
    file = written(tmp_path, text(SQUARE, top='chunk = 2\nreductions = ["end"]'))
    run_sweep(read_sweep(file), str(tmp_path / "store"), progress=True)
    assert "3/3" in capsys.readouterr().err
    refused("progress", run_sweep, read_sweep(file), str(tmp_path / "other"), progress=1)

"""Animations show the trajectory itself: dense output, or else its rows."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pyharness import Scene, Trajectory, solve
from pyharness.model import attitude_picture
from pyharness.model.attitude import matrices
from tests.conftest import Printed

NUT = Scene("a $nut$ <1>", (0.02, 6.0, 0.0), moments=(0.9, 1.6, 2.3), attitude=(1, 0, 0, 0))
TIMES = np.linspace(0.0, 2.0, 5)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return a list, to which each animation adds its motion; a frame lasts 0.5 s."""
    found: list[Any] = []
    draw = attitude_picture._scene_of_brick

    def noted(figure: Any, motion: Any, rate: float) -> Any:
        found.append(motion)
        return draw(figure, motion, rate)

    monkeypatch.setattr(attitude_picture, "_PAUSE", 0.5)
    monkeypatch.setattr(attitude_picture, "_scene_of_brick", noted)
    return found


def test_gif_and_page_of_dense_output_have_equal_frames(tmp_path: Path, drawn: list[Any]) -> None:
    found = solve(NUT, 2.0, dense_output=True)
    found.animate(tmp_path / "nut.gif")
    found.animate(str(tmp_path / "nut.HTML"))
    picture: Any
    with Image.open(tmp_path / "nut.gif") as picture:
        assert picture.n_frames == 5
        assert picture.info["duration"] == 500
    page = (tmp_path / "nut.HTML").read_text()
    assert "<title>a $nut$ &lt;1&gt;</title>" in page
    assert len(re.findall(r"frames\[\d+\] = ", page)) == 5
    true = solve(NUT, TIMES)
    for motion in drawn:
        assert motion.time.tolist() == TIMES.tolist()
        assert np.abs(motion.turned - true.rotation().as_matrix()).max() < 1e-8
        difference = motion.omega - true.rotation().apply(true.omega)
        assert np.abs(difference).max() < 1e-8


@pytest.mark.parametrize("times", [[0.0, 0.9, 1.2, 2.0], [2.0, 1.2, 0.9, 0.0], [-0.1, -0.9, -2.1]])
def test_frames_without_dense_output_are_rows(
    times: list[float], tmp_path: Path, drawn: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = solve(NUT, times)
    monkeypatch.delattr("pyharness.engine.solve.solve")
    found.animate(tmp_path / "nut.gif")
    (motion,) = drawn
    attitude: Any = found.attitude
    even = np.linspace(times[0], times[-1], len(motion.time))
    rows = np.abs(even[:, None] - found.time).argmin(axis=1)
    assert motion.time.tolist() == found.time[rows].tolist()
    assert np.array_equal(motion.turned, matrices(attitude[rows]))


def test_dense_output_before_0_is_drawn_backwards(tmp_path: Path, drawn: list[Any]) -> None:
    solve(NUT, -1.0, dense_output=True).animate(tmp_path / "nut.gif")
    assert drawn[0].time.tolist() == [0.0, -0.25, -0.5, -0.75, -1.0]


def test_brick_is_along_the_principal_axes(tmp_path: Path, drawn: list[Any]) -> None:
    inertia = np.array([[3.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 5.0]])
    solve(Scene("plate", (0, 1, 1), inertia=inertia), TIMES, attitude=True).animate(
        tmp_path / "plate.gif"
    )
    corners = drawn[0].corners
    spread = corners.T @ corners
    # Moments of the corners have the principal axes of the inertia.
    assert np.abs(inertia @ spread - spread @ inertia).max() < 1e-12
    assert abs(spread[0, 1]) > 0.1


def test_command_draws_the_trajectory_that_it_prints(
    tmp_path: Path, drawn: list[Any], printed: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn_of: list[Trajectory] = []
    animate = Trajectory.animate

    def noted(found: Trajectory, path: str) -> None:
        drawn_of.append(found)
        animate(found, path)

    monkeypatch.setattr(Trajectory, "animate", noted)
    command = "run --case 3 --method auto --times 1,2 --attitude"
    assert printed(f"{command} --animate {tmp_path / 'a.gif'}") == printed(command)
    (found,) = drawn_of
    assert found.time.tolist() == [1.0, 2.0]
    assert drawn[0].time[-1] == 2.0

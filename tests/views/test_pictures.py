"""The pictures of `run` and `compare`: nothing is cut off, nothing that was computed is missing."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from pyharness import read_scene, solve
from pyharness.views import pictures as plots
from tests.conftest import Printed

pytest.importorskip("matplotlib")

if TYPE_CHECKING:
    from matplotlib.figure import Figure


BODY = "[body]\nmoments=[3,2,1]\n[initial]\nomega=[0.1,1,0.2]\n"


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> "list[Figure]":
    """Return the list to which every saved figure will be appended."""
    figures = []
    real = plots._image

    def keep(figure: "Figure", form: str) -> bytes:
        figures.append(figure)
        return real(figure, form)

    monkeypatch.setattr(plots, "_image", keep)
    monkeypatch.chdir(tmp_path)
    return figures


def _ends(figure: "Figure") -> list[tuple[int, float, float]]:
    """Return panel, time and place of every marked end."""
    return [
        (panel, float(np.asarray(line.get_xdata())[0]), float(np.asarray(line.get_ydata())[0]))
        for panel, axes in enumerate(figure.axes)
        for line in axes.lines
        if line.get_marker() == "x"
    ]


@pytest.mark.campaign
def test_title_is_within_the_picture(drawn: "list[Figure]", printed: Printed) -> None:
    Path("long.toml").write_text(f'name = "{"very " * 2000}"\n{BODY}')
    for options in (
        "--case 5 --method auto", "--case 5 --method taylor --times 1",
        "--case 2 --program runge-kutta", "--case 6 --program two-term",
        "--scene long.toml --method auto",
    ):  # fmt: skip
        printed(f"run {options} --plot x.png --out x.txt")
        box = drawn[-1].texts[0].get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= drawn[-1].bbox.x1
        assert max(axes.bbox.y1 for axes in drawn[-1].axes) <= box.y0
        assert drawn[-1].axes[0].bbox.height > 100.0


def test_end_of_a_program_is_marked(drawn: "list[Figure]", printed: Printed) -> None:
    printed("run --case 2 --program runge-kutta --plot x.png --out x.txt")
    ends = [(panel, time) for panel, time, _ in _ends(drawn[0])]
    assert ends == [(panel, 0.25) for panel in range(3)]
    title = drawn[0].texts[0].get_text()
    assert "x: stopped at step 25 by V2" in title
    assert title.startswith("Case 2: symmetric top without torque")


def test_curves_are_dense_and_own_states_are_shown(
    drawn: "list[Figure]", printed: Printed, tmp_path: Path
) -> None:
    law = "[torque]\nexpression = ['-h', '0', '0']\n[states.h]\nstart = 0.0\nrate = 'w1'\n"
    (tmp_path / "own.toml").write_text(f"{BODY}{law}")
    printed("run --scene own.toml --times 1,8 --plot x.png --out x.txt")
    assert [axes.get_ylabel()[-1:] for axes in drawn[0].axes] == [")", ")", ")", "h"]
    found = solve(read_scene("own.toml"), np.linspace(0.0, 8.0, 2001))
    for axes, wanted in zip(drawn[0].axes, found.y, strict=True):
        curve, rows = axes.lines
        assert np.asarray(curve.get_ydata()) == pytest.approx(wanted, abs=1e-7)
        assert np.asarray(rows.get_xdata()).tolist() == [1.0, 8.0]


@pytest.mark.campaign
def test_end_out_of_view_is_marked_at_the_edge(drawn: "list[Figure]", printed: Printed) -> None:
    """Case 6: two-term original overflows at step 57, at 1e111."""
    printed("compare --case 6 --plot x.png --out x.txt")
    ends = _ends(drawn[0])
    assert sorted(panel for panel, _, _ in ends) == [0, 2, 3, 5, 6, 8]
    for panel, time, place in ends:
        bottom, top = drawn[0].axes[panel].get_ylim()
        assert bottom <= place <= top
        assert time == pytest.approx(0.56 if panel % 3 == 0 else 0.24)


@pytest.mark.campaign
def test_one_row_is_a_mark(drawn: "list[Figure]", printed: Printed) -> None:
    for command in (
        "run --case 5 --method auto --times 1", "run --case 3 --program four-term --steps 1",
        "compare --case 3 --steps 1",
    ):  # fmt: skip
        printed(f"{command} --plot x.png --out x.txt")
    assert len(drawn) == 3
    for axes in (axes for figure in drawn for axes in figure.axes):
        lines = [line for line in axes.lines if len(np.asarray(line.get_xdata())) == 1]
        assert lines
        assert all(line.get_marker() not in ("None", "", None) for line in lines)


@pytest.mark.parametrize("ending", plots.FORMATS)
def test_letter_that_the_font_lacks_is_no_warning(
    ending: str, tmp_path: Path, recwarn: pytest.WarningsRecorder, printed: Printed
) -> None:
    path = tmp_path / "rigid.toml"
    path.write_text(f'name = "\u56de\u8ee2"\n{BODY}', encoding="utf-8")
    printed(f"run --scene {path} --method auto --plot {tmp_path}/x.{ending}")
    assert [str(each.message) for each in recwarn] == []

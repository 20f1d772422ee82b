"""Impossible bodies: one warning, at the line of the user who makes one."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pyharness import ImpossibleBodyWarning, Scene, compare_programs, read_scene, solve, subset
from pyharness.cli.main import main
from pyharness.model.scene import breaks_triangle
from pyharness.model.scene_file import case_scene
from pyharness.thesis.programs import run_program

IMPOSSIBLE = (200.0, 10.0, 20.0)


def _file(folder: Path) -> Path:
    path = folder / "scene.toml"
    path.write_text("body.moments = [200.0, 10.0, 20.0]\ninitial.omega = [1.0, 2.0, 3.0]\n")
    return path


@pytest.mark.parametrize("make", [
    lambda _: Scene("", (1.0, 2.0, 3.0), IMPOSSIBLE),
    lambda _: Scene("", (1.0, 2.0, 3.0), inertia=np.diag(IMPOSSIBLE)),
    lambda _: replace(Scene("", (1.0, 2.0, 3.0), (3.0, 2.0, 2.0)), moments=IMPOSSIBLE),
    lambda _: case_scene(6),
    lambda folder: read_scene(_file(folder)),
], ids=["moments", "inertia", "replaced", "case", "file"])  # fmt: skip
def test_one_warning_at_the_line_of_the_user(make: Callable[[Path], Scene], tmp_path: Path) -> None:
    with pytest.warns(ImpossibleBodyWarning, match="no rigid body has these moments") as found:
        assert make(tmp_path).is_impossible
    (warning,) = found
    assert warning.filename == __file__
    assert issubclass(ImpossibleBodyWarning, UserWarning)


def test_a_body_that_can_exist_and_what_is_made_of_a_scene_warn_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = replace(case_scene(6), steps=10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # A flat body is the limit of the possible ones.
        Scene("", (1.0, 2.0, 3.0), (5.0, 3.0, 2.0))
        Scene("", (1.0, 2.0, 3.0), coefficients=(9.0, 1.0, 1.0))
        solve(scene, [1.0])
        solve(scene, [-1e-3, 3.0], attitude=True)
        run_program(scene, subset("runge-kutta"))
        compare_programs(scene)


def test_plates_in_decimals_are_possible_as_moments_and_as_inertia() -> None:
    plates = [(i / 100, j / 100, (i + j) / 100) for i in range(1, 100) for j in range(i, 100)]
    assert not any(map(breaks_triangle, plates))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for first, middle, last in plates[1::41]:
            for factor, is_impossible in ((1.0, False), (1.0 + 3e-15, True)):
                moments = first, middle, last * factor
                for given in ({"moments": moments}, {"inertia": np.diag(moments)}):
                    assert Scene("", (1.0, 2.0, 3.0), **given).is_impossible is is_impossible, given


def test_the_command_line_says_it_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for where in (["--case", "6"], ["--scene", str(_file(tmp_path))]):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert main(["run", *where, "--method", "taylor", "--times", "1"]) == 0
        assert capsys.readouterr().err.count("no rigid body has these moments") == 1

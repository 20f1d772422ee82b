"""Representations of results: short whatever the size, and useful."""

import numpy as np
import pytest

from pyharness import case_scene, compare_programs, run_many, run_program, solve, solve_many, subset
from pyharness.model.report import format_duration
from pyharness.model.trajectory import Trajectory


def _lines(result: object) -> list[str]:
    lines = repr(result).splitlines()
    assert len(lines) <= 10
    assert max(map(len, lines)) <= 100
    return lines


@pytest.mark.parametrize("rows", [1, 3, 100_000])
def test_a_trajectory_of_any_size(rows: int) -> None:
    (first, *_) = lines = _lines(solve(case_scene(5), np.linspace(0.5, 1.0, rows), attitude=True))
    assert first.startswith("Trajectory(time=<float64 ")
    text = " ".join(lines)
    assert f"omega=<float64 ({rows}, 3)>" in text
    assert "ended='complete'" in text
    assert "velocity" not in text  # this run has none


@pytest.mark.campaign
def test_a_comparison() -> None:
    text = " ".join(_lines(comparison := compare_programs(case_scene(3))))
    assert text.startswith("Comparison(scene=<Scene 'Case 2, slightly perturbed'>")
    assert "programs=<6 ProgramFinding>" in text
    _lines(comparison.programs[0])
    _lines(comparison.methods[0])


def test_other_results() -> None:
    scene = case_scene(2)
    starts = np.ones((1000, 3))
    assert "omega=<float64 (1000, 3)>" in repr(solve_many(scene, 1.0, omega=starts))
    _lines(run_many(scene, subset("two-term"), omega=starts))
    _lines(run_program(scene, subset("two-term")))


def test_durations_have_a_unit_in_which_they_are_short() -> None:
    shown = [format_duration(each) for each in (0.0123, 99.4, 99.9, 119.9, 3600.0, 1e6)]
    assert shown == ["0.012 s", "99 s", "100 s", "120 s", "60 min", "12 days"]


def test_a_field_of_any_length_is_cut() -> None:
    rows = np.zeros((2, 3))
    assert len(repr(Trajectory(rows[:, 0], rows[:, 0], rows, None, 1, 1, ended="x" * 10_000))) < 400

"""The campaign's truth against the reference, and the campaign at a small scale."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, solve
from pyharness.model.report import short
from pyharness.model.trajectory import Trajectory
from pyharness.model.turned_scenes import shifted
from pyharness.truth.reference import reference
from pyharness.views.table import write
from tests.estimates import campaign
from tests.estimates.campaign import COLUMNS, ENTRANCES, SENSITIVE, Answer, answers, main
from tests.estimates.report import report
from tests.estimates.scenes import COARSEST, FINEST, KINDS, Draw, drawn
from tests.estimates.truth import Truth, compiler_here, truth_of
from tests.random_scenes import triple

pytestmark = [
    pytest.mark.external,
    pytest.mark.skipif(not compiler_here(), reason="no compiler"),
]
BODY = (1.0, 2.0, 2.7)
# Torque of every kind at once, two waves of one frequency among them.
LAW = TorqueLaw(
    (0.3, -0.2, 0.1),
    (0.01, 0.02, -0.03),
    [((0.5, 0.1, -0.4), 3.0), ((0.2, 0.0, 0.1), -0.7)],
    [((-0.3, 0.6, 0.2), 3.0), ((0.1, 0.1, 0.1), 0.0)],
)
SCENES = {
    "all torques": (Scene("", (1.0, -2.0, 0.5), BODY, torque=LAW), 4.0),
    "backward": (Scene("", (1.0, -2.0, 0.5), BODY, torque=LAW), -4.0),
    "no torque": (Scene("", (0.3, 2.0, 0.5), BODY), 9.7),
    "middle axis": (Scene("", (1e-5, 2.0, 1e-6), BODY), 14.1),
    "from rest": (Scene("", (0.0, 0.0, 0.0), BODY, torque=LAW), 3.0),
    "no body": (Scene("", (1.0, 0.2, -0.4), None, (0.7, -1.2, 0.3), LAW), 2.0),
}


def _apart(one: Truth, other: Truth) -> np.ndarray:
    return np.asarray((one.omega - other.omega) + (one.remainder - other.remainder))


@pytest.mark.parametrize("name", SCENES)
def test_truth_is_that_of_the_reference(name: str) -> None:
    scene, time = SCENES[name]
    found = truth_of(scene, time)
    known = reference(scene, [time], precise=True)
    assert known.remainder is not None
    apart = (found.omega - known.omega[0]) + (found.remainder - known.remainder[0])
    assert np.abs(apart).max() <= found.doubt * found.largest + known.estimate
    assert found.doubt < 1e-20
    assert found.largest >= np.abs(found.omega).max()


@pytest.mark.parametrize("name", SCENES)
def test_growth_is_that_of_small_differences(name: str) -> None:
    """Of starts on the way, each a little beside the path in three directions."""
    scene, time = SCENES[name]
    found = 1.0
    small = 2.0**-36
    for part in np.linspace(0.0, 0.98, 50):
        begin = float(part * time)
        omega = truth_of(scene, begin).omega if part else np.array(scene.omega)
        later = shifted(scene, omega, begin)
        end = truth_of(later, time - begin)
        columns = []
        for axis in range(3):
            beside = omega.copy()
            beside[axis] += small
            ended = truth_of(replace(later, omega=triple(beside)), time - begin)
            columns.append(_apart(ended, end) / (beside[axis] - omega[axis]))
        found = max(found, float(np.linalg.norm(columns, 2)))
    assert truth_of(scene, time).growth == pytest.approx(found, rel=0.01)


def test_truth_says_what_it_cannot_know() -> None:
    runaway = Scene("", (1.0, 1.0, 1.0), None, (1.0, 1.0, 1.0))
    with pytest.raises(InputError, match="leaves every bound"):
        truth_of(runaway, 2.0)
    with pytest.raises(InputError, match="too many steps"):
        truth_of(*SCENES["no torque"], most_steps=10)


def test_turns_of_a_spin() -> None:
    spin = Scene("", (0.0, 0.0, 2.0 * np.pi), BODY)
    found = truth_of(spin, 7.0)
    assert (found.turns, found.largest) == pytest.approx((7.0, 2.0 * np.pi))


def test_number_of_a_seed_is_one_scene() -> None:
    first, again, other = drawn("1", 8), drawn("1", 8, (1e-5,)), drawn("2", 8)
    assert first.scene == again.scene != other.scene
    assert again.tolerance == 1e-5
    assert FINEST <= first.tolerance <= COARSEST


def test_few_dozen_scenes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    asked = ["--scenes", "60", "--seed", "test", "--out", str(tmp_path / "answers.csv")]
    code = main(asked)
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 100
    with (tmp_path / "answers.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [int(row["number"]) for row in rows[:: len(ENTRANCES)]] == list(range(60))
    assert all(set(row["kinds"].split(", ")) <= set(KINDS) for row in rows)
    assert "exceeds" not in printed
    if any(row["estimated_growth"] for row in rows):
        # A kernel that knows how differences grow says where nothing is left.
        assert code == 0


def test_one_scene_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--only", "3", "--seed", "test", "--tolerances", "1e-6,1e-6"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("complete") == len(ENTRANCES)
    assert "tolerance         1e-06" in printed


def _answer(of: Draw, growth: float, ended: str, error: float) -> Answer:
    truth = replace(of.truth, growth=growth)
    return Answer(replace(of, truth=truth, tolerance=1e-9), "solve taylor", "taylor", ended, error)


@pytest.mark.parametrize(
    ("growth", "ended", "error", "faults"),
    [
        (1.0, "complete", 1e-9, ""),
        (1.0, "complete", 1.1e-9, "exceeds"),
        (1.0, "overflow", float("inf"), "exceeds"),
        (9e5, "complete", 4e-9, ""),
        (9e5, "complete", 5e-9, "exceeds"),
        (2e6, "complete", 1.0, ""),
        (1e7, "complete", 1e-9, ""),
        (1e7, SENSITIVE, 1e-9, ""),
        (1e8, "complete", 1e-9, "silent"),
        (1e8, SENSITIVE, 1e-9, ""),
        (float("inf"), "complete", 1.0, "silent"),
        (1e5, SENSITIVE, 1e-9, "false alarm"),
    ],
)
def test_faults(growth: float, ended: str, error: float, faults: str) -> None:
    found = _answer(drawn("test", 0), growth, ended, error)
    flags = {
        "exceeds": found.exceeds,
        "silent": found.is_silent,
        "false alarm": found.is_false_alarm,
    }
    assert [name for name, flag in flags.items() if flag] == [*filter(None, [faults])]


def test_what_an_answer_says_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    def said(scene: Scene, times: list[float], *given: Any) -> Trajectory:
        found = solve(scene, times, *given)
        return replace(found, error=1e-11, growth=7.0, evaluations=found.steps + 1)

    monkeypatch.setattr(campaign, "solve", said)
    of = drawn("test", 0)
    found = [next(answers(replace(of, truth=replace(of.truth, growth=3.5))))]
    assert (found[0].estimate, found[0].growth, found[0].runs) == (1e-11, 7.0, 2)
    ratio = 1e-11 / max(found[0].error, 2.0**-53)
    lines = [line.split() for line in write(report(found, "test")).splitlines()]
    assert ["solve", "taylor", "1", "1", "0"] in [line[:5] for line in lines]
    assert "100.00" in {line[-1] for line in lines if line}
    said_of_it = [str(1), *[short(ratio)] * 3, str(1), *[short(2.0)] * 5]
    assert ["all", *said_of_it] in lines

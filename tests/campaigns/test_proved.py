"""The campaign against proved solutions: a few of its scenes, planted faults, and its tally."""

import math
import shlex
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.campaign import page as promises
from docs.campaign.tally import Row, Tally, merged, read
from pyharness import Trajectory, solve
from pyharness.truth.enclosed import Balls
from pyharness.truth.reference import Reference, reference
from tests.campaigns import proved
from tests.conftest import Patch
from tests.refused import refused

COMMAND = "python -m tests.campaigns.proved"

SHORT = ("short",)


def _omega(found: Trajectory) -> Trajectory:
    found.omega[-1, 1] += 1e-10 * np.abs(found.omega).max()
    return found


def _turned(found: Trajectory) -> Trajectory:
    if found.attitude is None:
        return found
    return replace(found, attitude=found.attitude + 1e-10 * found.attitude[:, [1, 0, 3, 2]])


def _negative(found: Trajectory) -> Trajectory:
    return replace(found, attitude=None if found.attitude is None else -found.attitude)


def _sure(found: Trajectory) -> Trajectory:
    return replace(found, error=None if found.error is None else found.error / 1e6)


def _reference(known: Reference) -> Reference:
    known.omega[0, 2] *= 1.0 + 1e-14
    return known


def _precise(known: Reference) -> Reference:
    assert known.remainder is not None
    return replace(known, remainder=known.remainder + 1e-24)


@pytest.mark.campaign
def test_no_promise_is_broken_in_a_few_scenes() -> None:
    pytest.importorskip("flint")
    tally = proved.campaign(8, "a few")
    assert not tally.broken
    assert tally.counts == dict.fromkeys(proved.GROUPS, 2)
    assert {"law auto", "state auto", "law reference", "law precise"} <= tally.rows.keys()
    assert {"short auto angle", "short reference angle", "free enclosure"} <= tally.rows.keys()
    assert "0 promises broken" in tally.text()


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "fault", "result"), [
    ("solve", _omega, "short auto estimate"),
    ("solve", _turned, "short closed-form angle estimate"),
    ("solve", _negative, "short auto angle"),
    ("solve", _sure, "short taylor estimate"),
    ("reference", _reference, "short reference"),
    ("reference", _precise, "short precise"),
])  # fmt: skip
def test_a_planted_fault_is_found(
    name: str, fault: Callable[[Any], Any], result: str, monkeypatch: Patch
) -> None:
    pytest.importorskip("flint")
    right: Any = {"solve": solve, "reference": reference}[name]

    def wrong(*arguments: Any, **options: Any) -> Any:
        return fault(right(*arguments, **options))

    monkeypatch.setattr(proved, name, wrong)
    tally = proved.campaign(12, "faults", groups=SHORT)
    assert result in {each["result"] for each in tally.broken}
    # The command that is printed repeats the same scene alone.
    again = shlex.split(tally.broken[0]["command"])
    assert again[:3] == ["python", "-m", "tests.campaigns.proved"]
    alone = proved.campaign(int(again[3]), again[4], int(again[5]), again[7].split(","))
    same = [each for each in tally.broken if each["command"] == tally.broken[0]["command"]]
    assert alone.broken == same


def test_no_promise_is_broken_without_a_fault() -> None:
    pytest.importorskip("flint")
    assert not proved.campaign(12, "faults", groups=SHORT).broken


def test_distance_is_rounded_up() -> None:
    balls = Balls((Fraction(1), Fraction(2)), Fraction(1, 8))
    assert proved.distance([1.0, 2.5], balls) == 0.625
    assert proved.distance([1.0, math.pi], balls) >= math.pi - 2.0 + 0.125


def test_angle_of_a_small_rotation_and_of_the_opposite_quaternion() -> None:
    balls = Balls((Fraction(1), Fraction(0), Fraction(0), Fraction(0)), Fraction(0))
    turned = [math.cos(1e-9), 0.0, math.sin(1e-9), 0.0]
    assert proved.angle(turned, balls) == pytest.approx(2e-9)
    assert proved.angle([-x for x in turned], balls) == pytest.approx(math.tau)
    assert proved.angle(turned, balls._replace(radius=Fraction(1))) > 8.0


def test_parts_of_a_campaign_make_the_whole(tmp_path: Path) -> None:
    pytest.importorskip("flint")
    paths = [tmp_path / name for name in ("first.json", "second.json", "both.json")]
    for (count, first), path in zip([(6, 0), (4, 6)], paths, strict=False):
        proved.campaign(count, "parts", first, SHORT).write(path)
    both = merged(paths[:2])
    both.write(paths[2])
    whole = proved.campaign(10, "parts", 0, SHORT)
    assert read(paths[2]).rows == both.rows == whole.rows
    assert both.counts == whole.counts
    assert [run.done for run in both.runs] == [6, 4]
    refused("common scenes", merged, [paths[2], paths[0]])
    paths[0].write_text("{}")
    refused(r"first\.json: no tally", read, paths[0])


def test_an_interrupt_leaves_the_finished_scenes(tmp_path: Path, monkeypatch: Patch) -> None:
    def scene(tally: Tally, seed: str, number: int, *rest: object) -> None:
        if number == 3:
            raise KeyboardInterrupt
        tally.counts["short"] += 1

    monkeypatch.setattr(proved, "try_scene", scene)
    path = tmp_path / "tally.json"
    assert proved.main(["100", "any", "--groups", "short", "--out", str(path)]) == 0
    found = read(path)
    assert found.counts == {"short": 3}
    assert [run.command for run in found.runs] == [
        "python -m tests.campaigns.proved 3 any 0 --groups short"
    ]


def test_quantiles_of_the_histogram_are_those_of_the_numbers() -> None:
    row, source = Row(), np.random.default_rng(1)
    numbers = 10 ** source.normal(-2.0, 1.0, 5000)
    for x in numbers:
        row.add_ratio(float(x))
    for share in (0.5, 0.9, 0.99):
        assert row.quantile(share) == pytest.approx(np.quantile(numbers, share), rel=0.03)
    assert row.factor == numbers.max()
    assert row.below == (numbers > 1.0).sum()


def test_a_broken_promise_is_on_the_page_with_its_explanation(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    tally = Tally()
    tally.judge("python -m tests.campaigns.proved 1 x 5", "free taylor", 3.0, 1.0)
    tally.judge("python -m tests.campaigns.proved 1 x 6", "free rk45", 2.0, 1.0)
    assert tally.row("free taylor").broken == 1
    tally.write(tmp_path / "tally.json")
    entry = '[[exception]]\nresults = ["free taylor"]\ntext = """It\ndrifts."""\n'
    (tmp_path / "exceptions.toml").write_text(entry)
    template = promises.HERE / "promises.md.in"
    (tmp_path / "promises.md.in").write_text(template.read_text())
    monkeypatch.setattr(promises, "HERE", tmp_path)
    monkeypatch.setattr(promises, "DATA", tmp_path / "tally.json")
    page = promises.promises_page()
    assert f"| free taylor | 1 | 3 | 1 | `{COMMAND} 1 x 5` | It drifts. |" in page
    assert f"| free rk45 | 1 | 2 | 1 | `{COMMAND} 1 x 6` | not explained yet |" in page

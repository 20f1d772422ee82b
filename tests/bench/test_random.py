"""`bench --draws`: scenes are of the kinds they claim, and time ratios have known values."""

import csv
import json
import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from pyharness.bench import measure as bench
from pyharness.bench.measure import TARGETS, Finding, Row, Workload
from pyharness.bench.random_loads import KINDS, LAWS, MOST_GROWTH, random_load
from pyharness.bench.report import bench_report
from pyharness.bench.scores import Spread, spreads
from pyharness.checks.theory.conditioning import conditioning
from pyharness.cli.main import main
from pyharness.model.scene_file import case_scene
from pyharness.truth.reference import reference
from pyharness.views.render import render

Capture = pytest.CaptureFixture[str]
SEED = "f"  # seed of scenes that the reference solves fast


@pytest.fixture(scope="module")
def loads() -> list[Workload]:
    return [random_load(SEED, number) for number in range(1, 25)]


@pytest.mark.campaign
def test_every_kind_comes_in_turn_with_every_body_and_speed(loads: list[Workload]) -> None:
    assert [load.kinds[1] for load in loads] == list(LAWS) * 4
    seen = {pair for load in loads for pair in product(load.kinds, load.kinds)}
    waves, speeds, bodies = KINDS[4:7], KINDS[7:10], KINDS[10:14]
    for some in (product(waves, speeds), product(LAWS, bodies)):
        assert seen >= set(some)
    assert {load.kinds[-1] for load in loads} == set(KINDS[14:])


@pytest.mark.campaign
def test_scenes_are_what_their_kinds_say(loads: list[Workload]) -> None:
    for load in loads:
        scene, law = load.scene, load.scene.law
        assert scene.moments is not None
        assert not scene.is_impossible
        least, middle, most = sorted(scene.moments)
        known = {
            "compact": most / least <= 1.5, "flat": 0.95 <= most / (least + middle) <= 1.0,
            "needle-like": least <= 0.1 * middle,
            "nearly symmetric": min(middle / least, most / middle) <= 1.01,
            "no torque": law.is_zero, "constant torque": all(law.constant) and not law.varies,
            "ramp": all(law.rate) and not any(law.constant),
        }  # fmt: skip
        waves = law.sines + law.cosines
        known |= {name: len(waves) == n for name, n in zip(LAWS[3:], (1, 3, 10), strict=True)}
        ratios = [frequency / math.hypot(*scene.omega) for _, frequency in waves]
        for name, low, high in (("slow", 0.01, 0.1), ("matched", 0.3, 3.0), ("fast", 3.0, 10.0)):
            known[f"{name} waves"] = all(low <= each <= high * 1.0001 for each in ratios)
        known |= {"all": load.kinds[0] == "all"}
        known |= {"1 to 10 turns": 1.0 <= load.turns <= 10.0}
        known |= {"10 to 100 turns": 10.0 < load.turns <= 100.0}
        known |= {"100 to 300 turns": 100.0 < load.turns <= 300.0}
        assert all(known[kind] for kind in load.kinds), scene.name
        assert 1.0 <= load.growth < MOST_GROWTH


def test_a_number_of_a_seed_is_one_scene_whatever_else_is_drawn() -> None:
    first, other, again = (random_load(seed, 6) for seed in (SEED, "other", SEED))
    assert replace(again, truth=None) == replace(first, truth=None)
    assert other.scene != again.scene
    assert first.scene.name == "6: ten waves, slow, compact"


@pytest.mark.sampled
@pytest.mark.parametrize("number", [2, 3, 10, 12])
def test_truth_and_growth_are_those_of_others(number: int) -> None:
    load: Any = random_load(SEED, number)
    wanted = reference(load.scene, [load.horizon])
    assert np.abs(load.truth.omega - wanted.omega).max() <= 2.0 * wanted.error
    assert load.growth == pytest.approx(
        conditioning(load.scene, load.horizon).amplification, rel=1e-2
    )


def _row(load: Workload, method: str, seconds: float, error: float) -> Row:
    return Row(load, method, "tolerance", 1e-6, seconds, error, 7)


def _finding() -> Finding:
    scenes = [
        Workload(str(n), replace(case_scene(5), case=None), 3.0, ("all", kind))
        for n, kind in enumerate(("ramp", "ramp", "flat", "flat"), 1)
    ]
    rows = [_row(load, "heyoka", 8e-6, 1e-14) for load in scenes]
    times = zip(scenes, (1e-6, 2e-6, 4e-6, 8e-6), (1e-13, 1e-13, 1e-13, 1e-7), strict=True)
    rows += [_row(load, "auto", seconds, error) for load, seconds, error in times]
    return Finding(scenes, rows, [], {("1", "heyoka"): 0.5, ("2", "heyoka"): 0.7}, {})


def test_spreads_are_of_the_scenes_in_which_the_error_is_reached() -> None:
    found = {(each.target, each.kind): each for each in spreads(_finding(), KINDS)}
    assert len(found) == len(TARGETS) * 3
    first = found[1e-6, "all"]
    # The ratios are 8, 4, 2 and 1.
    assert (first.method, first.scenes, first.reached, first.smallest) == ("auto", 4, 4, 1.0)
    assert first.mean == pytest.approx(math.sqrt(8.0))
    assert first.quartiles == pytest.approx((1.75, 3.0, 5.0))
    assert found[1e-9, "flat"] == Spread("auto", "flat", 1e-9, 2, 1, 2.0, 2.0, (2.0, 2.0, 2.0))
    none = Finding(_finding().workloads, [*_finding().rows[:4], _row(SPHERE, "slow", 1.0, 0.5)],
                   [], {}, {})  # fmt: skip
    assert {each.reached for each in spreads(none, KINDS)} <= {0}


SPHERE = _finding().workloads[0]


def test_every_form_has_the_spreads() -> None:
    report = bench_report(_finding(), [], "pyharness bench --draws 4 --seed x")
    text = render(report, "table")
    title = "heyoka time / time of auto, at errors of 1e-6"
    assert title in text.splitlines()
    assert "all   4 of 4  2.83      1.00  1.75    3.00  5.00" in text
    assert "s a scene: heyoka 0.70" in text
    page = render(report, "markdown")
    assert f"## {title}" in page
    assert "| ramp | 2 of 2 | 5.66 | 4.00 | 5.00 | 6.00 | 7.00 |" in page
    head, first, *_ = csv.reader(render(report, "csv").splitlines())
    assert dict(zip(head, first, strict=True)) | {"mean": ""} == {
        "method": "auto", "kind": "all", "target": "0.001", "scenes": "4", "reached": "4",
        "mean": "", "smallest": "1.0", "lower_quartile": "1.75", "median": "3.0",
        "upper_quartile": "5.0",
    }  # fmt: skip


@pytest.mark.usefixtures("hurried")
def test_verb_gives_rows_and_spreads(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "_LARGEST_STEPS", 256)
    few = ["--method", "auto,rk4", "--peers", "none"]
    command = ["bench", "--draws", "2", "--seed", SEED, *few]
    assert main([*command, "--format", "json"]) == 0
    record: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    contract = ["case", "scene", "horizon", "method", "setting", "seconds", "error", "evaluations"]
    assert list(record["rows"][0])[:8] == contract
    assert {row["case"] for row in record["rows"]} == {None}
    assert {row["scene"] for row in record["rows"]} == {
        "1: no torque, compact",
        "2: constant torque, compact",
    }
    # If the reference belonged to another scene, no digit would agree.
    assert (
        max(
            row["error"] / row["setting"]
            for row in record["rows"]
            if row["method"] == "auto" and row["setting"] > 1e-12
        )
        < 1.0
    )
    assert [each["growth"] < MOST_GROWTH for each in record["scenes"]] == [True, True]
    assert {each["method"] for each in record["spreads"]} == {"rk4"}
    assert main([*command, "--format", "markdown"]) == 0
    told = f"`pyharness bench --draws 2 --seed {SEED} --method auto,rk4 --peers none"
    assert told in capsys.readouterr().out

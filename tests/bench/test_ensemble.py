"""`bench --ensemble`: all contenders reach the truth, and the report has all its parts."""

import csv
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness.bench import ensemble_measure as measuring
from pyharness.bench.contenders import Contender
from pyharness.bench.ensemble_contenders import (
    EnsembleContender,
    EnsembleLoad,
    draw,
    own_ensembles,
    with_attitudes,
)
from pyharness.bench.ensemble_measure import Rate, Rates, memory
from pyharness.bench.ensemble_peers import ensemble_peers
from pyharness.bench.ensemble_report import Ensembles, ensemble_report, ours_over
from pyharness.cli.main import main
from pyharness.model.trajectory import Array
from pyharness.views.render import render

Capture = pytest.CaptureFixture[str]
# Settings that give an error of 1e-8.
SETTINGS = {"tolerance": 1e-9, "steps": 400.0, "none": 1.0}
BODIES = 70  # more than a block, and not a multiple of its size


ALL = (*own_ensembles(), *ensemble_peers())


@pytest.mark.parametrize("contender", ALL, ids=lambda each: each.name)
@pytest.mark.filterwarnings("ignore")
def test_contender_comes_to_the_truth(contender: EnsembleContender) -> None:
    if not contender.is_installed:
        pytest.skip(f"{contender.package} is not installed")
    for load in draw("truth", BODIES):
        if contender.torque_free and load.torque is not None:
            continue
        rows = [0, 1, 63, 64, 69]
        wanted = load.part(rows).ends()
        for threads, prepare in product(contender.threads, contender.ways.values()):
            run = prepare(load, SETTINGS[contender.setting], threads)
            run()  # the second call must start from the initial conditions again
            np.testing.assert_allclose(run()[rows], wanted, rtol=0.0, atol=2e-8)


@pytest.mark.parametrize("contender", own_ensembles(), ids=lambda each: each.name)
def test_contender_comes_to_the_true_attitudes(contender: EnsembleContender) -> None:
    for load in with_attitudes(draw("truth", BODIES), "truth"):
        if not contender.attitude or (contender.torque_free and load.torque is not None):
            continue
        wanted = load.part([0, 1, 69]).ends()
        run = contender.prepare(load, SETTINGS[contender.setting], 1)
        np.testing.assert_allclose(run()[[0, 1, 69]], wanted, rtol=0.0, atol=2e-8)


def test_a_seed_says_which_bodies() -> None:
    (free, pushed), (again, _), (other, _) = draw("a", 9), draw("a", 9), draw("b", 9)
    assert free.torque is None
    assert pushed.torque is not None
    assert np.array_equal(free.omega0, again.omega0)
    assert np.array_equal(free.omega0, pushed.omega0)
    assert not np.array_equal(free.omega0, other.omega0)
    # The torque changes the result noticeably.
    assert np.abs(pushed.ends() - free.ends()).max() > 0.5


def some_rate(method: str, threads: int, seconds: float) -> Rate:
    return Rate("load", 1e-6, method, threads, None, 100, seconds, 1e-7)


def test_ratio_is_of_ours_on_as_many_cores() -> None:
    rows = [
        some_rate("taylor", 1, 2.0), some_rate("rk4", 1, 1.0), some_rate("taylor", 2, 0.5),
        some_rate("heyoka-batch", 1, 5.0),
    ]  # fmt: skip
    assert [ours_over(rows, row) for row in rows] == [2.0, 1.0, 1.0, 5.0]
    assert ours_over(rows[3:], rows[3]) is None


@pytest.mark.usefixtures("hurried")
def test_the_fastest_variant_counts() -> None:
    taylor = next(each for each in own_ensembles() if each.name == "taylor")

    def slowly(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
        run = taylor.prepare(load, setting, threads)
        return lambda: (sum(range(200_000)), run())[1]

    both = {"of 4": slowly, "of 8": taylor.prepare, "of 16": slowly}
    contender = replace(taylor, threads=(1,), variants=both)
    rows = measuring.measure_ensembles(draw("a", 9)[:1], [contender], "a").rows
    assert [(row.target, row.note) for row in rows] == [(1e-6, "of 8"), (1e-12, "of 8")]
    # The report says which it is.
    shown = render(ensemble_report(Ensembles(Rates("a", 9, rows), [], []), [], "bench"), "table")
    assert shown.count("taylor, of 8 ") == 2


COMMAND = ["bench", "--ensemble", "--bodies", "10", "--seed", "1", "--peers", "numpy,scipy"]


@pytest.mark.campaign
@pytest.mark.usefixtures("hurried")
def test_table_has_every_part(capsys: Capture) -> None:
    assert main(COMMAND) == 0
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 100
    for title in ("No torque, T = 3 s, to 1e-6", "Constant torque, each its own, T = 3 s, to 1e-12",
                  "300 steps of RK4", "Growth with the number", "Memory"):  # fmt: skip
        assert title in shown
    for name in ("closed-form", "taylor", "rk4", "numpy-rk4", "scipy-dop853-loop"):
        assert re.search(rf"^{name} ", shown, flags=re.MULTILINE)
    assert re.search(r"^ +1000 ", shown, flags=re.MULTILINE)  # a hundred times as many bodies


@pytest.mark.campaign
@pytest.mark.usefixtures("hurried")
def test_json_csv_and_picture(tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "growth.svg"
    one = [*COMMAND[:-1], "none", "--method", "taylor"]
    assert main([*one, "--plot", str(picture), "--format", "json"]) == 0
    record: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert b"<svg" in picture.read_bytes()
    assert {(row["method"], row["target"], row["threads"]) for row in record["rows"]} == {
        ("taylor", target, threads) for target in (1e-6, 1e-12) for threads in (1, 2)
    }
    assert all(row["error"] <= row["target"] for row in record["rows"])
    assert [each["bodies"] for each in record["growth"]] == [1, 10, 100, 1000]
    assert {each["method"] for each in record["memory"]} == {"closed-form", "taylor", "rk4"}
    assert main([*one, "--format", "csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert len(rows) == 16
    assert {"load", "target", "method", "cores", "error", "bodies_a_second"} <= set(rows[0])


@pytest.mark.campaign
def test_memory_is_at_most_twice_the_arrays() -> None:
    for each in memory(300_000):
        assert each.ratio is None or 0.5 < each.ratio < 2.0


@pytest.mark.campaign
@pytest.mark.usefixtures("hurried")
def test_missing_peer_is_said(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    there = property(lambda each: each.package in ("", "numpy"))
    monkeypatch.setattr(Contender, "is_installed", there)
    assert main([*COMMAND[:-1], "heyoka", "--method", "closed-form"]) == 2
    assert "heyoka-batch" in capsys.readouterr().err
    assert main([*COMMAND[:-2], "--method", "closed-form"]) == 0
    assert "heyoka-batch, heyoka-ensemble, " in capsys.readouterr().out

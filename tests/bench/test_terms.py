"""`bench --terms`: the problems are what their formulas say, and the ratios have known values."""

import csv
import io
import json
import math
from collections import Counter
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, opaque
from pyharness.bench import ensemble_measure as measuring
from pyharness.bench import measure as bench
from pyharness.bench import term_loads
from pyharness.bench.contenders import Contender
from pyharness.bench.ensemble_measure import Rate, Rates
from pyharness.bench.measure import Finding, Row, Workload, relative_error
from pyharness.bench.peers import heyoka_equations
from pyharness.bench.term_loads import (
    EXPRESSION,
    READY,
    TermScene,
    body_contenders,
    term_bodies,
    term_leaves,
    term_methods,
    term_peers,
    term_scenes,
)
from pyharness.bench.term_report import Terms, summaries, term_report
from pyharness.cli.main import main
from pyharness.engine.system.recorded import slopes_of
from pyharness.engine.torques.term_file import KINDS
from pyharness.truth.reference import Reference
from pyharness.views.render import render

Capture = pytest.CaptureFixture[str]
SCENES = term_scenes()
IDS = [each.scene.name for each in SCENES]
TWO = [each for each in SCENES if each.scene.name in ("damping", "spring")]


def some_state(number: int) -> tuple[float, list[float], list[float]]:
    """Return a time (s), omega (rad/s) and a unit quaternion."""
    source = Random(f"terms {number}")
    attitude = np.array([source.gauss(0.0, 1.0) for _ in range(4)])
    omega = [source.uniform(-1.0, 1.0) for _ in range(3)]
    return source.uniform(0.0, 10.0), omega, (attitude / np.linalg.norm(attitude)).tolist()


def test_every_ready_term_and_some_expressions_are_there() -> None:
    kinds = [each.kind for each in SCENES]
    built = [name for name, each in KINDS.items() if each.leaves]
    assert (kinds.count(READY), kinds.count(EXPRESSION)) == (len(built), 10)
    assert len(built) >= 9
    assert len(set(IDS)) == len(IDS)
    for each in SCENES:
        assert (each.formula is not None) == (each.kind == READY)
        assert each.scene.torque.needs_attitude == (each.scene.attitude is not None)


@pytest.mark.parametrize("each", [x for x in SCENES if x.kind == READY], ids=lambda x: x.scene.name)
def test_a_ready_term_has_the_torque_of_its_formula(each: TermScene) -> None:
    assert each.formula is not None
    for number in range(5):
        time, omega, attitude = some_state(number)
        found: Any = each.scene.torque
        wanted = each.formula(time, omega, attitude, math.sin, math.cos)
        assert found.at(time, omega, attitude) == pytest.approx(wanted, rel=1e-12, abs=1e-14)
        assert np.abs(wanted).max() > 1e-3


@pytest.mark.external
@pytest.mark.parametrize("each", SCENES, ids=IDS)
def test_the_equations_for_heyoka_are_those_of_the_scene(each: TermScene) -> None:
    heyoka = pytest.importorskip("heyoka")
    for formula in (None, each.formula):
        pairs = heyoka_equations(each.scene, formula)
        function = heyoka.cfunc([rate for _, rate in pairs], [unknown for unknown, _ in pairs])
        for number in range(3):
            time, omega, attitude = some_state(number)
            state = [*omega, *attitude][: len(pairs)]
            found = function(np.array(state), time=time)
            assert found == pytest.approx(slopes_of(each.scene)(time, state), abs=1e-13)


@pytest.mark.external
def test_heyoka_refuses_what_it_cannot_evaluate() -> None:
    pytest.importorskip("heyoka")
    scene = Scene("", (1.0, 0.0, 0.0), (1.0, 2.0, 2.5), torque=opaque(lambda t, omega: omega))
    with pytest.raises(InputError, match="opaque"):
        heyoka_equations(scene)


CONTENDERS = [*term_methods(), *term_peers(SCENES)]


@pytest.mark.campaign
@pytest.mark.parametrize("contender", CONTENDERS, ids=lambda each: each.name)
def test_contender_comes_to_the_truth(contender: Any) -> None:
    if not contender.is_installed:
        pytest.skip(f"{contender.package} is not installed")
    for load in term_loads.term_loads(TWO)[::2]:
        ready = contender.prepare(load.scene)(load.horizon, 1e-9)
        ready.run()  # the second call must start from the initial conditions again
        assert load.truth is not None
        error: Any = bench.error_of(ready.read(ready.run()), load.truth, load.scale)
        assert error < 1e-7


@pytest.mark.parametrize("contender", body_contenders(), ids=lambda each: each.name)
def test_many_bodies_come_to_the_truth(contender: Any) -> None:
    if not contender.is_installed:
        pytest.skip(f"{contender.package} is not installed")
    for load in term_bodies(TWO, "truth", 11):
        run = contender.prepare(load, 1e-9, 1)
        run()
        part = load.part([0, 7, 10])
        np.testing.assert_allclose(run()[[0, 7, 10]], part.ends(), rtol=0.0, atol=1e-8)


def test_an_error_is_relative_to_the_scale_of_the_workload() -> None:
    truth = Reference(np.array([1.0]), np.array([[0.5, 0.0, 0.0]]), None, "", 0.0)
    omega = np.array([0.5, 0.25, 0.0])
    assert relative_error(omega, truth) == 0.5
    assert relative_error(omega, truth, 1.0) == 0.25
    assert relative_error(omega, truth, 0.1) == 0.5


def _terms(with_heyoka: bool = True) -> Terms:
    """Return results in which heyoka takes 4 and 1 times our time, and 2 times for many bodies."""
    loads = [
        Workload("damping", SCENES[0].scene, 10.0, (READY,)),
        Workload("damping", SCENES[0].scene, 100.0, (READY,)),
        Workload("spring", TWO[1].scene, 10.0, (EXPRESSION,)),
    ]
    rows, rates = [], []
    for load, factor in zip(loads, (4.0, 1.0, 9.0), strict=True):
        rows += [
            Row(load, "auto", "tolerance", 1e-9, 2e-6, 1e-9, None, "", 1e-3),
            Row(load, "auto", "tolerance", 1e-12, 4e-6, 1e-13, None, "", 2e-3),
            Row(load, "solve_ivp-dop853", "tolerance", 1e-9, 1e-3, 1e-8, 99, "", 0.0),
        ]
        if with_heyoka:
            rows += [
                Row(load, "heyoka", "tolerance", 1e-7, factor * 2e-6, 1e-8, None, "", 0.03),
                Row(load, "heyoka", "tolerance", 1e-9, factor * 2e-6, 1e-10, None, "", 0.05),
                Row(load, "heyoka", "tolerance", 1e-16, factor * 4e-6, 1e-15, None, "", 0.04),
                Row(load, "heyoka-variational", "tolerance", 1e-9, 3e-5, 1e-9, None, "", 1.0),
            ]
    for method, seconds, note in (("taylor", 1.0, ""), ("heyoka-batch", 2.0, "batches of 8"))[
        : 1 + with_heyoka
    ]:
        rates.append(Rate("damping", 1e-6, method, 1, 1e-6, 1000, seconds, 1e-7, note))
    leaves = Counter({"built": 2, "interpreter": 1})
    return Terms(Finding(loads, rows, [], {}, {}), Rates("seed", 1000, rates), leaves)


def test_means_and_smallest_ratios_are_those_of_the_scenes() -> None:
    found = {(each.kind, each.bodies, each.target): each for each in summaries(_terms())}
    ready = found[READY, 1, 1e-8]
    assert (ready.scenes, ready.smallest) == (2, 1.0)
    assert ready.mean == pytest.approx(2.0)
    # At 1e-10 our fastest setting is the finer one, which takes twice the time.
    assert found[READY, 1, 1e-10].mean == pytest.approx(1.0)
    assert found[READY, 1, None].scenes == 8
    assert found[READY, 1, None].mean == pytest.approx(2.0**0.75)
    assert found[EXPRESSION, 1, 1e-12].mean == pytest.approx(9.0)
    many = found[READY, 1000, None]
    assert many.scenes == 1
    assert many.mean == pytest.approx(2.0)
    assert (EXPRESSION, 1000, None) not in found
    assert summaries(_terms(with_heyoka=False)) == []


def test_the_report_has_times_ratios_and_preparation() -> None:
    shown = render(term_report(_terms(), ["heyoka"], "pyharness bench --terms"), "table")
    assert max(map(len, shown.splitlines())) <= 100
    line = next(line for line in shown.splitlines() if line.startswith("damping"))
    # Times in microseconds and ratios, ms to prepare and to compile, DOP853, heyoka's derivatives.
    wanted = ["damping", "10", "2.00", "4.00", "2.00", "4.00", "4.00", "2.00", "4.00", "4.00"]
    assert line.split() == [*wanted, "1", "40", "500", "15.0"]
    assert "Ready terms: 1000 bodies, T = 10 s" in shown
    assert "heyoka's fastest: batches of 8 (1 of 1)." in " ".join(shown.split())
    told = "Taylor terms of single bodies: built (2 of 3), interpreter (1 of 3)."
    assert told in " ".join(shown.split())
    without = render(term_report(_terms(False), ["heyoka"], "pyharness bench --terms"), "table")
    assert "ratio" not in without.replace("Geometric", "")
    assert "compile" not in without


def test_compiled_torques_are_measured() -> None:
    (contender,) = term_methods(compiled=True)
    ready: Any = contender.prepare(SCENES[-1].scene)(1.0, 1e-9)
    wanted: Any = term_methods()[0].prepare(SCENES[-1].scene)(1.0, 1e-9)
    found, interpreted = ready.run(), wanted.run()
    assert np.hstack(found) == pytest.approx(np.hstack(interpreted), rel=0.0, abs=1e-12)
    assert ready.run.func.leaves == "compiled"
    assert wanted.run.func.leaves == "interpreter"
    assert term_leaves(SCENES[:1], compiled=True) == {"compiled": 1}
    assert term_leaves(SCENES[:1], compiled=False) == {"built": 1}


@pytest.fixture
def few_scenes(hurried: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "SAMPLE", 5)
    monkeypatch.setattr(term_loads, "HORIZONS", (2.0, 4.0))
    monkeypatch.setattr(term_loads, "term_scenes", lambda: TWO)


COMMAND = ["bench", "--terms", "--bodies", "9", "--seed", "1", "--peers"]


@pytest.mark.usefixtures("few_scenes")
def test_json_and_csv(capsys: Capture) -> None:
    assert main([*COMMAND, "scipy", "--format", "json"]) == 0
    record: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    rows = record["rows"]
    assert {row["torque"] for row in rows} == {"damping", "spring"}
    assert {row["method"] for row in rows} == {"auto", "solve_ivp-dop853", "taylor"}
    assert {row["bodies"] for row in rows} == {1, 9}
    assert record["means"] == []
    assert max(record["reference_error"].values()) < 1e-15
    fine = [row["error"] for row in rows if row["method"] == "auto" and row["setting"] == 1e-12]
    assert len(fine) == 4
    assert max(fine) < 1e-12
    assert main([*COMMAND, "none", "--format", "csv"]) == 0
    written = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert {row["kind"] for row in written} == {READY, EXPRESSION}
    assert {row["method"] for row in written} == {"auto", "taylor"}


@pytest.mark.usefixtures("few_scenes")
def test_missing_peer_is_said(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(Contender, "is_installed", property(lambda each: not each.package))
    assert main([*COMMAND, "heyoka"]) == 2
    assert "heyoka" in capsys.readouterr().err
    assert main(COMMAND[:-1]) == 0
    assert "heyoka, heyoka-variational, solve_ivp-dop853: not installed" in capsys.readouterr().out

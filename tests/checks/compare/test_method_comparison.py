"""Comparisons of methods, also on scenes whose torque depends on omega or attitude."""

import csv
import io
import json
import math
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pyharness import Comparison, Scene, case_scene, compare_methods, read_scene, solve, torques
from pyharness.checks.compare.agreement import accuracy
from pyharness.checks.compare.picture import comparison_picture
from pyharness.checks.compare.report import comparison_report, verdict
from pyharness.cli.main import main
from pyharness.engine.plan.registry import SCIPY_METHODS
from pyharness.model.expressions import parsed
from pyharness.truth.reference import reference
from pyharness.views.pictures import saved
from pyharness.views.render import render
from tests.conftest import Capture, ResultOf

DAMPED = "docs/damped.toml"
DECAY = parsed(["-0.2*w1", "-0.2*w2", "-0.2*w3"], {})


def sphere() -> Scene:
    """Return a damped sphere, whose omega decays exponentially."""
    return Scene("sphere", (1.0, 2.0, 3.0), moments=(2, 2, 2), torque=DECAY, step_size=0.5, steps=4)


@pytest.fixture(scope="module")
def damped() -> Comparison:
    return compare_methods(read_scene(DAMPED))


@pytest.mark.campaign
def test_methods_agree_with_the_reference_and_the_known_solution(damped: Comparison) -> None:
    assert [each.method for each in damped.methods] == ["auto", *SCIPY_METHODS]
    assert damped.unexpected == ()
    assert not damped.programs
    assert damped.reference.attitude is not None  # the torque depends on the attitude
    for each in damped.methods:
        assert each.accuracy is not None
        assert each.accuracy.angle is not None
        assert max(*each.accuracy.omega, each.accuracy.angle) <= 1e-8
    found = compare_methods(sphere(), ["taylor", "rk45"], tolerance=1e-7)
    known = np.outer(np.exp(-0.05 * np.arange(1, 5)), [1.0, 2.0, 3.0])
    assert np.abs(found.reference.omega - known).max() < 1e-14
    for each in found.methods:
        assert each.tolerance == 1e-7
        assert each.trajectory is not None
        assert np.abs(each.trajectory.omega - known).max() <= 3e-7


@pytest.mark.campaign
def test_views_have_the_same_numbers(damped: Comparison) -> None:
    report = comparison_report(damped)
    text, record = render(report, "table"), json.loads(render(report, "json"))
    assert record["programs"] == []
    assert record["lipschitz"] is None
    rows = list(csv.DictReader(io.StringIO(render(report, "csv"))))
    assert [row["method"] for row in rows] == [each["method"] for each in record["methods"]]
    assert [float(row["error_w1"]) for row in rows] == [x["error"][0] for x in record["methods"]]
    assert verdict(damped)[0] in text
    assert "solve_ivp" not in text
    assert max(map(len, text.splitlines())) <= 100
    assert saved(comparison_picture(damped), "x.png")["x.png"].startswith(b"\x89PNG")


def test_error_above_the_limit_is_unexpected() -> None:
    found = compare_methods(sphere(), ["taylor"], tolerance=1e-12)
    (one,) = found.methods
    assert one.trajectory is not None
    off = replace(one.trajectory, omega=one.trajectory.omega * (1.0 + 1e-10))
    wrong = replace(one, accuracy=accuracy(found.scene, off, found.reference), trajectory=off)
    (told,) = replace(found, methods=(wrong,)).unexpected
    assert told.startswith("taylor: error of omega 2.9e-10, limit 3.0e-12")
    short = replace(off, time=off.time[:2], omega=one.trajectory.omega[:2], ended="overflow")
    wrong = replace(one, accuracy=accuracy(found.scene, short, found.reference), trajectory=short)
    assert replace(found, methods=(wrong,)).unexpected == (
        "taylor: ends after 2 of 4 times, overflow",
    )


@pytest.mark.parametrize("with_attitude", [False, True])
def test_error_without_a_row_to_compare_is_not_zero(with_attitude: bool) -> None:
    scene = replace(case_scene(2), attitude=(1.0, 0.0, 0.0, 0.0) if with_attitude else None)
    found = compare_methods(scene, ["taylor"], attitude=with_attitude)
    run = found.methods[0].trajectory
    assert run is not None
    attitude = None if run.attitude is None else run.attitude[:0]
    none = replace(run, time=run.time[:0], omega=run.omega[:0], attitude=attitude)
    errors = accuracy(found.scene, none, found.reference)
    assert errors.omega == (math.inf,) * 3
    assert errors.angle == (math.inf if with_attitude else None)
    assert errors.energy is errors.momentum is errors.momentum_in_space is None
    truth = reference(scene, scene.times()[:1])
    empty = replace(truth, time=truth.time[:0], omega=truth.omega[:0], attitude=attitude)
    assert max(accuracy(found.scene, run, empty).omega) == math.inf


def test_ready_terms_are_compared() -> None:
    moments = (4.0, 3.0, 2.0)
    torque = torques.gravity_gradient(moments, 0.7) + torques.damping(0.1)
    scene = Scene("satellite", (0.1, 1.0, 0.2), moments=moments, torque=torque, steps=20)
    found = compare_methods(scene, ["auto", "taylor", "radau", "reference"])
    assert found.unexpected == ()
    assert found.growth is not None


def test_verb_compares_methods(result_of: ResultOf, tmp_path: Path) -> None:
    command = f"compare --scene {DAMPED} --method auto,dop853"
    assert "as expected: no error exceeds the limit" in result_of(shlex.split(command)).out
    out = tmp_path / "x.json"
    assert main(shlex.split(f"{command} --format json --out {out}")) == 0
    assert [each["method"] for each in json.loads(out.read_text())["methods"]] == ["auto", "dop853"]


def test_fixed_step_has_no_tolerance() -> None:
    found = compare_methods(case_scene(3), ["rk4", "auto"], tolerance=1e-9)
    assert [each.tolerance for each in found.methods] == [None, 1e-9]
    assert found.tolerance == 1e-9
    assert compare_methods(case_scene(3), ["rk4"]).tolerance == 1.0
    report = comparison_report(found)
    assert re.search(r"(?m)^rk4 +- ", render(report, "table"))
    assert json.loads(render(report, "json"))["methods"][0]["tolerance"] is None


@pytest.mark.campaign
def test_methods_without_rows_are_not_as_expected(capsys: Capture, tmp_path: Path) -> None:
    """No method solves the first scene; in the second, method and reference end early."""
    found = compare_methods(case_scene(5), ["closed-form"])
    assert (found.unexpected, found.is_complete) == (("no method has a result",), False)
    path = tmp_path / "fast.toml"
    path.write_text(
        "body.moments = [1, 2, 3]\ninitial.omega = [1, 0.1, 1]\n"
        "torque.expression = ['w1*w1', '0', '0']\nrun = {step_size = 0.3, steps = 10}\n"
    )
    command = ["compare", "--scene", str(path), "--method", "auto"]
    assert (main(command), main([*command, "--strict"])) == (0, 1)
    told = capsys.readouterr().out
    assert "as expected" not in told
    scene = read_scene(path)
    rows = str(len(solve(scene, scene.times()).time))
    assert set(re.findall("only (.*) of 10|after (.*) of 10", told)) == {(rows, ""), ("", rows)}

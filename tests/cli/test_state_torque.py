"""Verbs with a scene whose torque depends on the state, or whose moments change with time."""

import json
import re
import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from pyharness import ChangingMoments, Scene, StateTorque, prepare, principal, solve_many
from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.solve import solve
from pyharness.engine.torques.scene_reader import read_scene
from pyharness.model.errors import InputError
from pyharness.model.expressions import parsed
from pyharness.model.scene_file import case_scene
from tests.conftest import Printed
from tests.json_reference import schema_of
from tests.refusals.test_refusals import COMMANDS

DAMPED = """\
name = "damped"
[body]
moments = [40.0, 30.0, 20.0]
[initial]
omega = [0.1, 1.0, 1.0]
[torque]
expression = ["-k*w1", "-k*w2 + 0.1*w1*w3", "-k*w3"]
constants = { k = 0.1 }
[run]
step_size = 0.01
steps = 5
"""
BOOMS = """\
name = "booms"
body.moments = [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]
initial.omega = [0.1, 1.0, 1.0]
initial.attitude = [1.0, 0.0, 0.0, 0.0]
run = { step_size = 0.5, steps = 4 }
"""
MOMENTS = ChangingMoments([[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]])
# What a run shows of each scene.
SHOWN = {
    "damped": "-k*w2 + 0.1*w1*w3",
    "booms": "I = (40 + 1.5 t - 0.25 t^2, 30 + 0.5 t, 20) kg m2",
}
TERMS = """\
[[torque.terms]]
kind = "wheels"
momentum = [0.0, 1.0, 0.0]
motor = { rate = [0.0, 0.0, 0.5] }
[run]
"""


@pytest.fixture(autouse=True)
def _scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("damped.toml").write_text(DAMPED)
    Path("booms.toml").write_text(BOOMS)


@pytest.mark.parametrize(
    ("scene", "takers"),
    [("damped.toml", {"plan", "prove", "stress"}), ("booms.toml", {"plan", "prove"})],
)
def test_every_verb_with_a_scene_is_tried(scene: str, takers: set[str]) -> None:
    """The rows of refusals have all verbs but those that take such a scene."""
    with_scene = {verb for verb in VERBS if "--scene FILE" in Parser(verb).module.OPTIONS}
    assert with_scene - takers <= {each.split()[0] for each in COMMANDS if scene in each}


@pytest.mark.campaign
def test_stress_takes_a_torque_that_depends_on_the_state(printed: Printed) -> None:
    assert "all well" in printed("stress --scene damped.toml --only threads,length/auto")


def test_plan_names_the_reason_of_an_integration(printed: Printed) -> None:
    assert "its torque depends on the state" in printed("plan --scene damped.toml")
    record = json.loads(printed("plan --scene booms.toml --format json"))
    Draft202012Validator(schema_of("plan")).validate(record)
    text = printed("plan --scene booms.toml --tolerance 1e-3")
    assert re.search(r"integration +yes +its inertia changes with time", text)
    assert "method: taylor" in text


def test_json_has_the_polynomials(printed: Printed) -> None:
    record = json.loads(printed("run --scene booms.toml --method auto --times 2 --format json"))
    Draft202012Validator(schema_of("run")).validate(record)
    assert record["scene"]["body"] == {"moments": [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]}
    found = solve(Scene("booms", (0.1, 1.0, 1.0), moments=MOMENTS), 2.0, attitude=True)
    assert record["trajectory"]["omega"] == found.omega.tolist()


def test_law_in_expressions_gives_the_output_of_the_law(printed: Printed) -> None:
    head, _, rest = DAMPED.partition("expression")
    tail = rest[rest.index("[run]") :]
    names = "law.toml", "text.toml"
    Path(names[0]).write_text(f"{head}constant = [1.0, 0.0, 0.0]\nrate = [0.0, 2.0, 0.0]\n{tail}")
    Path(names[1]).write_text(f'{head}expression = ["sqrt(1)", "2*t", "w1 - w1"]\n{tail}')
    for command in (
        "run --program two-term", "run --method auto", "plan", "compare --program four-term",
    ):  # fmt: skip
        shown = [printed(f"{command} --scene {name} --format json") for name in names]
        law, text = ([x for x in each.splitlines() if '"seconds' not in x] for each in shown)
        assert law == text


def _solved(method: str, scene: Scene) -> Any:
    return solve(scene, 1.0, method).omega[-1]


SOLVERS: dict[str, Callable[[Scene], Any]] = {
    "solve": lambda scene: solve(scene, 1.0).omega[-1],
    "attitude": lambda scene: solve(scene, 1.0, attitude=True).omega[-1],
    "prepare": lambda scene: prepare(scene)(scene.omega, 1.0),
    "prepare taylor": lambda scene: prepare(scene, "taylor")(scene.omega, 1.0),
    "prepare attitude": lambda scene: prepare(scene, attitude=True)(scene.omega, 1.0)[0],
    "solve_many": lambda scene: solve_many(scene, 1.0, omega=[scene.omega]).omega[0],
    "solve_many scenes": lambda scene: solve_many([case_scene(5), scene], 1.0).omega[1],
    **{name: partial(_solved, name) for name in METHODS},
}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("body", ["moments", "inertia", "coefficients"])
def test_method_solves_a_damped_sphere_or_refuses_it(solver: str, body: str) -> None:
    """A sphere has a closed form under a torque law; it must not be taken for one here."""
    bodies: dict[str, Any] = {
        "moments": (2, 2, 2), "inertia": np.diag([2.0, 2.0, 2.0]), "coefficients": (0, 0, 0),
    }  # fmt: skip
    k = 0.1 if body == "coefficients" else 0.2
    torque = parsed(["-k*w1", "-k*w2", "-k*w3"], {"k": k})
    scene = Scene("sphere", (1.0, 2.0, 3.0), torque=torque, **{body: bodies[body]})
    start = np.array(scene.omega)
    try:
        found = SOLVERS[solver](scene)
    except InputError as error:
        message = str(error)
    else:
        assert np.ravel(found) == pytest.approx(np.exp(-0.1) * start, rel=1e-5)
        return
    assert re.search("torque|principal axes", message)


# The method `averaged` needs a motion that oscillates.
@pytest.mark.parametrize("solver", [name for name in SOLVERS if name != "averaged"])
def test_the_same_calls_solve_a_sphere_without_torque(solver: str) -> None:
    scene = Scene("sphere", (1.0, 2.0, 3.0), moments=(2, 2, 2))
    assert np.ravel(SOLVERS[solver](scene)) == pytest.approx(np.array(scene.omega))


@pytest.mark.parametrize("scene", SHOWN)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 1,2"])
def test_run_with_a_method_shows_the_scene_or_refuses_it(
    scene: str, method: str, options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(shlex.split(f"run --scene {scene}.toml --method {method} {options}"))
    captured, chosen = capsys.readouterr(), METHODS[method]
    if chosen.state_torque and (chosen.attitude or "attitude" not in options):
        assert status == 0
        assert SHOWN[scene] in captured.out
    else:
        assert (status, captured.out) == (2, "")
        assert re.match(f"pyharness: .*{method}[: ]", captured.err)
        assert captured.err.count("\n") == 1


@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 0.05 --format json"])
def test_run_with_ready_terms_shows_them(options: str, printed: Printed) -> None:
    Path("terms.toml").write_text(DAMPED.replace("[run]\n", TERMS))
    names = "damped.toml", "terms.toml"
    rows = [printed(f"run --scene {name} --method auto {options}") for name in names]
    assert ('"kind": "wheels"' in rows[1]) if "json" in options else ("+ wheels;" in rows[1])
    assert "wheels" not in rows[0]
    ends = [solve(read_scene(name), 0.05).omega[-1] for name in names]
    assert np.abs(ends[0] - ends[1]).max() > 1e-6


def test_principal_scene_has_the_torque_in_principal_axes() -> None:
    matrix = [[3.0, 0.1, 0.0], [0.1, 4.0, 0.2], [0.0, 0.2, 5.0]]
    torque = parsed(["-0.1*w1 + q1", "w1*w3", "0.5*q0*q0"], {})
    scene: Any = Scene("full", (1, 2, 3), inertia=matrix, torque=torque, attitude=(0.8, 0, 0.6, 0))
    turned, axes = principal(scene)
    assert turned.attitude is not None
    assert isinstance(scene.torque, StateTorque)
    assert isinstance(turned.torque, StateTorque)
    old = scene.torque.at(0.5, scene.omega, scene.attitude)
    new = turned.torque.at(0.5, turned.omega, turned.attitude)
    assert axes @ np.array(new) == pytest.approx(np.array(old), abs=1e-14)


def test_sweep_solves_by_a_method(printed: Printed) -> None:
    Path("sweep.toml").write_text(
        'reductions = ["end"]\nscene.file = "damped.toml"\nsolve.t_end = 1.0\n'
        'axis = [{ field = "omega.1", values = [0.1, 2.0] }]\n'
    )
    shown = json.loads(printed("sweep sweep.toml --out store --format json"))["reductions"]
    ends = [solve(replace(read_scene("damped.toml"), omega=(x, 1, 1)), 1.0) for x in (0.1, 2.0)]
    lower, upper = np.sort([each.omega[0] for each in ends], axis=0)
    assert [each["least"] for each in shown] == pytest.approx(lower.tolist(), abs=1e-11)
    assert [each["largest"] for each in shown] == pytest.approx(upper.tolist(), abs=1e-11)

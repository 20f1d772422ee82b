"""Every verb with a scene whose torque depends on the state: it works, or is refused."""

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

from pyharness import (
    InputError,
    Scene,
    StateTorque,
    case_scene,
    prepare,
    principal,
    read_scene,
    solve,
    solve_many,
)
from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.methods.registry import METHODS
from pyharness.model.expressions import parsed
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
TERMS = """\
[[torque.terms]]
kind = "wheels"
momentum = [0.0, 1.0, 0.0]
motor = { rate = [0.0, 0.0, 0.5] }
[run]
"""


@pytest.fixture
def damped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scene:
    monkeypatch.chdir(tmp_path)
    Path("damped.toml").write_text(DAMPED)
    return read_scene("damped.toml")


@pytest.mark.parametrize(
    ("scene", "takers"),
    [("damped.toml", {"plan", "prove", "stress"}), ("booms.toml", {"plan", "prove"})],
)
def test_every_verb_with_a_scene_is_tried(scene: str, takers: set[str]) -> None:
    """The rows of refusals have all verbs but those that take such a scene."""
    with_scene = {verb for verb in VERBS if "--scene FILE" in Parser(verb).module.OPTIONS}
    assert with_scene - takers <= {each.split()[0] for each in COMMANDS if scene in each}


@pytest.mark.campaign
@pytest.mark.usefixtures("damped")
def test_methods_and_their_plan_take_a_torque_that_depends_on_the_state(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for method in ("auto", "taylor", "dop853", "reference"):
        assert main(["run", "--scene", "damped.toml", "--method", method]) == 0
        assert "complete" in capsys.readouterr().out
    assert main(shlex.split("stress --scene damped.toml --only threads,length/auto")) == 0
    assert "all well" in capsys.readouterr().out
    assert main(["plan", "--scene", "damped.toml"]) == 0
    assert "its torque depends on the state" in capsys.readouterr().out


@pytest.mark.usefixtures("damped")
def test_law_in_expressions_gives_the_output_of_the_law(capsys: pytest.CaptureFixture[str]) -> None:
    head, _, rest = DAMPED.partition("expression")
    tail = rest[rest.index("[run]") :]
    Path("law.toml").write_text(f"{head}constant = [1.0, 0.0, 0.0]\nrate = [0.0, 2.0, 0.0]\n{tail}")
    Path("text.toml").write_text(f'{head}expression = ["sqrt(1)", "2*t", "w1 - w1"]\n{tail}')
    for command in (
        "run --program two-term",
        "run --method auto",
        "plan",
        "compare --program four-term",
    ):
        verb, _, options = command.partition(" ")
        shown = []
        for name in ("law", "text"):
            status = main(shlex.split(f"{verb} --scene {name}.toml {options} --format json"))
            assert status == 0
            shown.append(capsys.readouterr().out)
        assert _without_times(shown[0]) == _without_times(shown[1])


def _without_times(text: str) -> list[str]:
    return [line for line in text.splitlines() if '"seconds' not in line]


def _solved(method: str, scene: Scene) -> Any:
    return solve(scene, 1.0, method).omega[-1]


DECAY = ["-0.2*w1", "-0.2*w2", "-0.2*w3"]
SOLVERS: dict[str, Callable[[Scene], Any]] = {
    "solve": lambda scene: solve(scene, 1.0).omega[-1],
    "attitude": lambda scene: solve(scene, 1.0, attitude=True).omega[-1],
    "prepare": lambda scene: prepare(scene)(scene.omega, 1.0),
    "prepare taylor": lambda scene: prepare(scene, "taylor")(scene.omega, 1.0),
    "prepare attitude": lambda scene: prepare(scene, attitude=True)(scene.omega, 1.0)[0],
    "solve_many": lambda scene: solve_many(scene, 1.0, omega0=[scene.omega]).omega[0],
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
    texts = DECAY if body != "coefficients" else [text.replace("0.2", "0.1") for text in DECAY]
    torque = parsed(texts, {})
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


@pytest.mark.usefixtures("damped")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 1,2 --format json"])
def test_run_with_a_method_shows_the_torque_or_refuses_it(
    method: str, options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(shlex.split(f"run --scene damped.toml --method {method} {options}"))
    captured = capsys.readouterr()
    if status == 0:
        assert "-k*w2 + 0.1*w1*w3" in captured.out
    else:
        assert status == 2
        assert captured.out == ""
        assert captured.err.startswith("pyharness: ")
        assert captured.err.count("\n") == 1


@pytest.mark.usefixtures("damped")
@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 0.05 --format json"])
def test_run_with_ready_terms_shows_them(options: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("terms.toml").write_text(DAMPED.replace("[run]\n", TERMS))
    rows = []
    for name in ("damped", "terms"):
        assert main(shlex.split(f"run --scene {name}.toml --method auto {options}")) == 0
        rows.append(capsys.readouterr().out)
    assert ('"kind": "wheels"' in rows[1]) if "json" in options else ("+ wheels;" in rows[1])
    assert "wheels" not in rows[0]
    ends = [solve(read_scene(f"{name}.toml"), 0.05).omega[-1] for name in ("damped", "terms")]
    assert np.abs(ends[0] - ends[1]).max() > 1e-6


def test_principal_scene_has_the_torque_in_principal_axes() -> None:
    """A point of the motion has the same torque in space in both scenes."""
    matrix = [[3.0, 0.1, 0.0], [0.1, 4.0, 0.2], [0.0, 0.2, 5.0]]
    torque = parsed(["-0.1*w1 + q1", "w1*w3", "0.5*q0*q0"], {})
    scene = Scene("full", (1, 2, 3), inertia=matrix, torque=torque, attitude=(0.8, 0, 0.6, 0))
    turned, axes = principal(scene)
    assert turned.attitude is not None
    assert scene.attitude is not None
    assert isinstance(scene.torque, StateTorque)
    assert isinstance(turned.torque, StateTorque)
    old = scene.torque.at(0.5, scene.omega, scene.attitude)
    new = turned.torque.at(0.5, turned.omega, turned.attitude)
    assert axes @ np.array(new) == pytest.approx(np.array(old), abs=1e-14)


@pytest.mark.usefixtures("damped")
def test_sweep_solves_by_a_method(
    capsys: pytest.CaptureFixture[str],
) -> None:
    axis = '[[axis]]\nfield = "omega.1"\nvalues = [0.1, 2.0]\n'
    scene = '[scene]\nfile = "damped.toml"\n'
    sweep = f'reductions = ["end"]\n{scene}[solve]\nt_end = 1.0\n{axis}'
    Path("sweep.toml").write_text(sweep)
    assert main(["sweep", "sweep.toml", "--out", "store", "--format", "json"]) == 0
    shown = json.loads(capsys.readouterr().out)["reductions"]
    ends = [solve(replace(read_scene("damped.toml"), omega=(x, 1, 1)), 1.0) for x in (0.1, 2.0)]
    lower, upper = np.sort([each.omega[0] for each in ends], axis=0)
    assert [each["least"] for each in shown] == pytest.approx(lower.tolist(), abs=1e-11)
    assert [each["largest"] for each in shown] == pytest.approx(upper.tolist(), abs=1e-11)

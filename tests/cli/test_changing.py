"""Every verb with a scene whose moments change with time: it works, or refuses in one line."""

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from pyharness import (
    ChangingMoments,
    InputError,
    Scene,
    compare_programs,
    run_many,
    run_program,
    solve,
    subset,
    torques,
)
from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.ensembles.sweep_file import read_sweep
from pyharness.methods.registry import METHODS
from pyharness.model.scene import CHANGING
from pyharness.scenes.perturbed import perturbed
from pyharness.scenes.rescaled import scaled
from pyharness.scenes.rotated import rotated
from pyharness.theory.conditioning import conditioning
from pyharness.theory.rotations import steady_rotations
from pyharness.truth.elliptic import torque_free
from tests.json_reference import schema_of

BODY = "moments = [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]"
FILE = f"""\
name = "booms"
[body]
{BODY}
[initial]
omega = [0.1, 1.0, 1.0]
attitude = [1.0, 0.0, 0.0, 0.0]
[run]
step_size = 0.5
steps = 4
"""

# The verbs with a scene whose moments must be constant, each with some of its options.
REFUSED = (
    "stress",
    "compare", "compare --ablate", "compare --word cdc48",
    "compare --program two-term --format json", "limits", "family",
    "family --terms 1 --weighting galerkin", "rotations", "rotations --format json",
    "run --program two-term", "run --program four-term --implementation python",
    "run --program runge-kutta --word cdc48", "run --program two-term --attitude quaternion",
    "run --program two-term --format printer", "run --program two-term --format tape5",
)  # fmt: skip
MOMENTS = ChangingMoments([[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]])
LISTING = subset("two-term")


@pytest.fixture
def booms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("booms.toml").write_text(FILE)


@pytest.mark.usefixtures("booms")
@pytest.mark.parametrize("command", REFUSED)
def test_verb_refuses_moments_that_change(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    verb, _, options = command.partition(" ")
    assert main(shlex.split(f"{verb} --scene booms.toml {options}")) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"pyharness: {CHANGING}\n"
    assert [path.name for path in Path().iterdir()] == ["booms.toml"]


def test_every_verb_with_a_scene_is_tried() -> None:
    """The verbs `plan` and `prove`, and `run` with a method, take such a scene."""
    with_scene = {verb for verb in VERBS if "--scene FILE" in Parser(verb).module.OPTIONS}
    assert with_scene == {command.split()[0] for command in REFUSED} | {"plan", "prove"}


@pytest.mark.usefixtures("booms")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("options", ["", "--attitude quaternion", "--times 1,2"])
def test_run_with_a_method_shows_the_moments_or_refuses_them(
    method: str, options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(shlex.split(f"run --scene booms.toml --method {method} {options}"))
    captured = capsys.readouterr()
    chosen = METHODS[method]
    if chosen.state_torque and (chosen.attitude or "attitude" not in options):
        assert status == 0
        assert "I = (40 + 1.5 t - 0.25 t^2, 30 + 0.5 t, 20) kg m2" in captured.out
    else:
        assert status == 2
        refused = "can't solve a scene with an inertia that changes with time; allowed: auto,"
        without = "does not compute attitudes"
        assert f"method {method} {without if chosen.state_torque else refused}" in captured.err
        assert captured.err.count("\n") == 1


@pytest.mark.usefixtures("booms")
def test_json_has_the_polynomials(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shlex.split("run --scene booms.toml --method auto --times 2 --format json")) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("run")).validate(record)
    assert record["scene"]["body"] == {"moments": [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]}
    found = solve(Scene("booms", (0.1, 1.0, 1.0), moments=MOMENTS), 2.0)
    assert record["trajectory"]["omega"] == found.omega.tolist()


@pytest.mark.usefixtures("booms")
def test_plan_names_the_moments_as_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--scene", "booms.toml", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(schema_of("plan")).validate(record)
    assert main(["plan", "--scene", "booms.toml", "--tolerance", "1e-3"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"integration +yes +its inertia changes with time", text)
    assert "method: taylor" in text
    assert main(["plan", "--scene", "booms.toml", "--method", "closed-form"]) == 2
    assert "an inertia that changes with time" in capsys.readouterr().err


@pytest.mark.usefixtures("booms")
def test_time_beyond_a_zero_of_a_moment_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--scene", "booms.toml", "--method", "auto", "--times", "1,16"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        "pyharness: [body] moments: a principal moment reaches 0 at t = 16 s, and the time 16 s "
        "is not before it; allowed: times between 0 and 16 s\n"
    )


@pytest.mark.usefixtures("booms")
def test_animation_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    command = "run --scene booms.toml --method auto --attitude quaternion --animate out.gif"
    assert main(shlex.split(command)) == 2
    assert "the scene's inertia changes with time" in capsys.readouterr().err


@pytest.mark.usefixtures("booms")
@pytest.mark.parametrize("scene", ['file = "booms.toml"', "tables"])
def test_sweep_refuses_moments_that_change(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    table = f"[scene]\n{scene}\n"
    if scene == "tables":
        table = f"[scene.body]\n{BODY}\n[scene.initial]\nomega = [1, 2, 3]\n"
    axis = '[[axis]]\nfield = "omega.1"\nvalues = [1.0, 2.0]\n'
    Path("sweep.toml").write_text(f'reductions = ["end"]\n{table}[solve]\nt_end = 1.0\n{axis}')
    with pytest.raises(InputError, match="the scene's inertia changes with time"):
        read_sweep("sweep.toml")
    assert main(["sweep", "sweep.toml", "--out", "store"]) == 2
    assert CHANGING in capsys.readouterr().err


CALLS: dict[str, Callable[[Scene], Any]] = {
    "run_program": lambda scene: run_program(scene, LISTING),
    "run_program, twin": lambda scene: run_program(scene, LISTING, implementation="python"),
    "run_many": lambda scene: run_many(scene, LISTING, omega0=np.ones((4, 3))),
    "run_many, moments": lambda scene: run_many(scene, LISTING, moments=np.ones((4, 3))),
    "compare_programs": compare_programs,
    "steady_rotations": lambda scene: steady_rotations(scene, 1e-3),
    "conditioning": lambda scene: conditioning(scene, 1.0),
    "right_hand_side": lambda scene: scene.right_hand_side(),
    "normalized_torque": lambda scene: scene.normalized_torque(0.0),
    "torque_free": lambda scene: torque_free(scene, 1.0),
    "scaled": lambda scene: scaled(scene, 2.0),
    "rotated": lambda scene: rotated(scene, lambda vector: vector, True),
    "perturbed": lambda scene: list(perturbed(scene, 1e-9)),
}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("damped", [False, True])
def test_function_refuses_moments_that_change(call: str, damped: bool) -> None:
    torque: dict[str, Any] = {"torque": torques.damping(1.0)} if damped else {}
    scene = Scene("booms", (0.1, 1.0, 1.0), moments=MOMENTS, **torque)
    with pytest.raises(InputError, match="the scene's inertia changes with time") as caught:
        CALLS[call](scene)
    assert "\n" not in str(caught.value)

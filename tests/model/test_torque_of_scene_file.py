"""Expressions in scene files: read, written, and shown in records and headings."""

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pyharness import ChangingMoments, Scene, StateTorque, TorqueLaw, case_scene, opaque, read_scene
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.model.expressions import FUNCTIONS, INPUTS
from pyharness.model.records import scene_record
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading
from pyharness.torques import gravity_gradient
from tests.engine.test_term_file import is_documented, restored

ROOT = Path(__file__).parent.parent.parent
BODY: dict[str, Any] = {
    "body": {"moments": [3.0, 2.0, 1.0]},
    "initial": {"omega": [1.0, 2.0, 3.0], "attitude": [1.0, 0.0, 0.0, 0.0]},
}
TEXTS = ["-k*w1 + sin(2*t)*q0", "-k*w2", "0"]


@pytest.mark.parametrize(
    "constants", [{"k": 0.1}, {"k": -0.0, "unused": 5e-324}, {"k": 1 / 3, "_A9": 1e300}]
)
def test_scene_with_expressions_is_restored_from_its_text(
    constants: dict[str, float], tmp_path: Path
) -> None:
    scene = scene_of(BODY | {"torque": {"expression": TEXTS, "constants": constants}}, "damped")
    again = restored(scene, tmp_path)
    assert again == scene
    assert repr(again) == repr(scene)
    both: list[Any] = [again.torque, scene.torque]
    first, second = (repr(each.at(0.5, (1.0, 2.0, 3.0), (0.8, 0.0, 0.6, 0.0))) for each in both)
    assert first == second
    assert scene_text(again) == scene_text(scene)


def test_expressions_that_form_a_law_are_that_law(tmp_path: Path) -> None:
    table = {"expression": ["1 - t", "a*sin(2*t)", "0"], "constants": {"a": 4.0}}
    scene = scene_of(BODY | {"torque": table}, "law")
    assert scene.torque == TorqueLaw((1, 0, 0), (-1, 0, 0), [((0, 4, 0), 2)])
    assert restored(scene, tmp_path) == scene
    assert "constant" in scene_record(scene)["torque"]


def test_expression_may_have_several_lines(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        "[body]\ncoefficients = [1, 2, 3]\n[initial]\nomega = [1, 2, 3]\n"
        '[torque]\nexpression = ["""\n  -0.5*w1\n  - 0.25*w1**3\n""", "0", "0"]\n'
    )
    scene = read_scene(path)
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.expression == ("-0.5*w1 - 0.25*w1**3", "0", "0")
    assert scene.torque.at(0.0, (2.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) == (-3.0, 0.0, 0.0)
    assert restored(scene, tmp_path) == scene
    assert "N = (-0.5*w1 - 0.25*w1**3, 0, 0) rad/s2; omega(0)" in heading(scene)[1]


@pytest.mark.parametrize(("torque", "record", "shown"), [
    (lambda t, omega: -0.1 * omega, {"recorded": 0}, "N is a recorded function of omega, in"),
    (lambda t, omega, q: t * q[0] * omega, {"recorded": 4},
     "N is a recorded function of t, omega and attitude, in N m"),
    (opaque(lambda t, omega: omega), {"opaque": True},
     "N is an opaque function of t and omega, in N m"),
    (opaque(lambda t, omega, q: omega), {"opaque": True},
     "N is an opaque function of t, omega and attitude, in N m"),
])  # fmt: skip
def test_torque_that_is_a_function_is_shown(
    torque: StateTorque | Callable[..., Any], record: dict[str, Any], shown: str
) -> None:
    scene = Scene("function", (1, 2, 3), moments=(1, 2, 3), torque=torque)
    assert scene_record(scene)["torque"] == record
    assert is_documented(scene_record(scene))
    assert shown in heading(scene)[1]


def test_record_has_no_function_where_a_term_has_a_changing_inertia() -> None:
    moments = ChangingMoments([[8.0, 1.0], [9.0], [10.0]])
    scene = Scene("", (1, 2, 3), moments=moments, torque=gravity_gradient(moments, rate=0.1))
    term = {"kind": "gravity_gradient", "inertia": "recorded", "rate": 0.1}
    assert json.loads(json.dumps(scene_record(scene)))["torque"] == {"terms": [term]}
    assert is_documented(scene_record(scene))


def test_record_and_heading_have_the_expressions() -> None:
    table = {"expression": TEXTS, "constants": {"k": 0.1, "unused": 2}}
    scene = scene_of(BODY | {"torque": table}, "damped")
    record = scene_record(scene)
    assert record["torque"] == {"expression": TEXTS, "constants": {"k": 0.1, "unused": 2.0}}
    assert scene_of({"torque": record["torque"], **BODY}, "damped") == scene
    shown = "N = (-k*w1 + sin(2*t)*q0, -k*w2, 0) N m with k = 0.1, unused = 2; omega(0)"
    assert shown in heading(scene)[1]
    long = {"expression": [" + ".join(["w1"] * 400), "0", "0"]}
    assert len(heading(scene_of(BODY | {"torque": long}, "long"))[1]) < 200


def test_schema_of_the_record_has_one_form_of_torque() -> None:
    record = scene_record(case_scene(1))
    assert is_documented(record)
    for torque in (
        {"expression": TEXTS},
        {"expression": TEXTS, "constants": {}, "recorded": 3},
        {"recorded": 3, "opaque": True},
        {**record["torque"], "expression": TEXTS, "constants": {}},
        {},
    ):
        assert not is_documented(record | {"torque": torque})


def test_expressions_in_the_documents_are_read() -> None:
    reference = (ROOT / "docs/reference/scene-files.md").read_text()
    table, with_states = re.findall(r"```\n(\[torque\].*?)```", reference, re.DOTALL)
    assert scene_of(BODY | tomllib.loads(with_states), "reference").states[0].start == 1.5
    scene = scene_of(BODY | tomllib.loads(table), "reference")
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.constants == (("k", 0.1),)
    names = set(re.findall(r"`(\w+)`", reference.partition("## Expressions")[2]))
    assert {*INPUTS, *FUNCTIONS, "pi"} <= names
    assert read_scene(ROOT / "docs/damped.toml").torque.needs_attitude

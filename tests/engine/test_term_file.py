"""Ready terms in scene files: read, written, and shown in records and headings."""

import json
import re
import tomllib
import warnings
from collections.abc import Callable
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from pyharness import Scene, StateTorque, TorqueLaw, read_scene, torques
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.records import scene_record
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading
from pyharness.model.state_torque import recorded
from tests.engine.test_terms import samples, states
from tests.json_reference import SCHEMA

ROOT = Path(__file__).parent.parent.parent
MOMENTS = [3.0, 2.0, 1.5]
MATRIX = [[3.0, 0.1, 0.2], [0.1, 2.0, -0.3], [0.2, -0.3, 1.5]]
INITIAL = {"omega": [1.0, 2.0, 3.0], "attitude": [0.5, 0.5, -0.5, 0.5]}
BODY: dict[str, Any] = {"body": {"moments": MOMENTS}, "initial": INITIAL}
WAVES: dict[str, Any] = {
    "constant": [1.0, 2.0, 3.0], "rate": [0.1, 0.0, -0.2],
    "sines": [{"amplitude": [0.5, 0.0, 1.0], "frequency": 2.0}],
    "cosines": [{"amplitude": [0.0, 0.25, 0.0], "frequency": 0.1}],
}  # fmt: skip
LAW = TorqueLaw(
    (1.0, 2.0, 3.0), (0.1, 0.0, -0.2), [((0.5, 0.0, 1.0), 2.0)], [((0.0, 0.25, 0.0), 0.1)]
)
SPACE = TorqueLaw(LAW.constant, LAW.rate, LAW.sines, LAW.cosines, "space")


def written(value: Any) -> Any:
    """Return an argument as in a scene file."""
    if not isinstance(value, TorqueLaw):
        return list(value) if isinstance(value, tuple) else value
    waves = {
        key: [{"amplitude": list(a), "frequency": f} for a, f in getattr(value, key)]
        for key in ("sines", "cosines")
    }
    return {"constant": list(value.constant), "rate": list(value.rate), **waves}


# Each term as a table of a scene file, and the torque that it must be.
TERMS: list[tuple[dict[str, Any], Callable[[], StateTorque]]] = [
    *(
        ({"kind": name, **{key: written(x) for key, x in given.items()}},
         partial(KINDS[name].function, **given))
        for name, given in samples()
    ),
    ({"kind": "drag", "coefficients": [0, [1, 2, 3], MATRIX]},
     lambda: torques.drag([0, [1, 2, 3], MATRIX])),
    ({"kind": "gravity_gradient", "rate": 0.5}, lambda: torques.gravity_gradient(MOMENTS, 0.5)),
    ({"kind": "wheels", "motor": WAVES, "momentum": [1, 2, 3]},
     lambda: torques.wheels((1, 2, 3), LAW)),
    ({"kind": "in_space", "torque": {"constant": [1, 0, 0]}},
     lambda: torques.in_space((1, 0, 0))),
]  # fmt: skip
DAMPING = {"kind": "damping", "matrix": 0.1}


def scene_with(**torque: Any) -> Scene:
    """Return the scene with a table [torque]."""
    return scene_of(BODY | {"torque": torque}, "terms")


def restored(scene: Scene, folder: Path) -> Scene:
    """Return the scene that is read from the text of `scene`."""
    path = folder / "again.toml"
    path.write_text(scene_text(scene))
    return read_scene(path)


def is_documented(record: dict[str, Any]) -> bool:
    """Return whether the record of a scene has the form in the schema of the output."""
    schema = {"$ref": "#/$defs/scene", "$defs": SCHEMA["$defs"]}
    return bool(Draft202012Validator(schema).is_valid(json.loads(json.dumps(record))))


def check_forms(scene: Scene, folder: Path) -> None:
    """Check that the text and the record of a scene restore it."""
    assert isinstance(scene.torque, StateTorque)
    again = restored(scene, folder)
    assert again == scene
    assert repr(again) == repr(scene)
    assert again.torque.tape == scene.torque.tape  # type: ignore[union-attr]
    record = scene_record(scene)
    assert is_documented(record)
    again = scene_of({**BODY, "torque": json.loads(json.dumps(record["torque"]))}, scene.name)
    assert again.torque == scene.torque


def test_every_ready_term_is_a_kind_and_is_tried() -> None:
    found = {name: getattr(torques, name) for name in torques.__all__}
    declared = {name: each.function for name, each in KINDS.items()}
    assert found == declared | {"opaque": torques.opaque, "recorded": torques.recorded}
    given = {(table["kind"], key) for table, _ in TERMS for key in table if key != "kind"}
    wanted = {(kind, key) for kind, f in declared.items() for key in signature(f).parameters}
    assert given == wanted


@pytest.mark.parametrize(("table", "torque"), TERMS, ids=[table["kind"] for table, _ in TERMS])
def test_term_is_the_function_of_its_name(
    table: dict[str, Any], torque: Callable[[], StateTorque], tmp_path: Path
) -> None:
    scene = scene_with(terms=[table])
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.tape == torque().tape
    assert scene.torque.needs_attitude == torque().needs_attitude
    check_forms(scene, tmp_path)
    assert f"N = {table['kind'].replace('_', ' ')}; omega(0)" in heading(scene)[1]
    assert table["kind"] in repr(scene.torque)


FIRST: dict[str, tuple[dict[str, Any], Any, str]] = {
    "nothing": ({}, torques.damping(0.0), "N = damping"),
    "zero": ({"constant": [0, 0, 0], "frame": "space"}, torques.damping(0.0), "N = damping"),
    "body": (WAVES, LAW, "t + (0.5, 0, 1) sin 2t + (0, 0.25, 0) cos 0.1t N m + damping"),
    "space": (WAVES | {"frame": "space"}, torques.in_space(SPACE),
              "N m about the axes of space + damping"),
    "expression": ({"expression": ["-k*w1**3", "q0", "0"], "constants": {"k": 0.1}},
                   recorded(lambda t, w, q: [-0.1 * w[0] ** 3, q[0], 0.0]),
                   "N = (-k*w1**3, q0, 0) N m with k = 0.1 + damping"),
    "law in text": ({"expression": ["1", "2*t", "0"]}, TorqueLaw((1, 0, 0), (0, 2, 0)),
                    "N = (1, 0, 0) + (0, 2, 0) t N m + damping"),
}  # fmt: skip


@pytest.mark.parametrize("first", FIRST)
def test_terms_are_added_to_the_rest_of_the_torque(first: str, tmp_path: Path) -> None:
    given, torque, shown = FIRST[first]
    scene = scene_with(**given, terms=[DAMPING, *[table for table, _ in TERMS[::3]]])
    assert isinstance(scene.torque, StateTorque)
    wanted = sum((make() for _, make in TERMS[::3]), torques.damping(0.1)) + torque
    for t, omega, attitude in states(5):
        found = scene.torque.at(t, omega, attitude)
        assert found == pytest.approx(wanted.at(t, omega, attitude), rel=1e-12, abs=1e-12)
    check_forms(scene, tmp_path)
    assert shown in heading(scene)[1]


def test_empty_list_of_terms_changes_nothing() -> None:
    assert scene_with(terms=[]) == scene_with()
    assert scene_with(terms=[], **WAVES).torque == LAW


@pytest.mark.parametrize("key", ["moments", "inertia"])
def test_gravity_gradient_takes_the_body_of_the_file(key: str, tmp_path: Path) -> None:
    body = {"moments": MOMENTS, "inertia": MATRIX}[key]
    table = {"kind": "gravity_gradient", "rate": 0.5}
    data = {"body": {key: body}, "initial": INITIAL, "torque": {"terms": [table]}}
    scene = scene_of(data, "satellite")
    assert isinstance(scene.torque, StateTorque)
    assert scene.torque.tape == torques.gravity_gradient(body, 0.5).tape  # type: ignore[arg-type]
    assert restored(scene, tmp_path) == scene
    # The text has the inertia of the torque, which remains if the scene's body is replaced.
    assert f"inertia = {body}" in scene_text(scene).partition("[[torque.terms]]")[2]


def test_text_of_a_scene_has_its_law_and_terms() -> None:
    wheels = {"kind": "wheels", "momentum": [1, 2, 3], "motor": {"rate": [0, 0, 1]}}
    text = scene_text(scene_with(constant=[1, 0, 0], terms=[DAMPING, wheels]))
    _, _, torque = text.partition("[torque]\n")
    assert torque.startswith(
        "constant = [1.0, 0.0, 0.0]\nrate = [0.0, 0.0, 0.0]\nsines = []\ncosines = []\n"
        '[[torque.terms]]\nkind = "damping"\nmatrix = 0.1\n'
        '[[torque.terms]]\nkind = "wheels"\nmomentum = [1.0, 2.0, 3.0]\n'
        "motor = { constant = [0.0, 0.0, 0.0], rate = [0.0, 0.0, 1.0], sines = [], cosines = [] }\n"
        "[run]\n"
    )


def test_warning_of_an_impossible_body_names_the_caller(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(scene_with(terms=[DAMPING])).replace("[3.0, 2.0, 1.5]", "[9, 2, 1]"))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        read_scene(path)
    assert [each.filename for each in told] == [__file__]


def test_schema_of_the_record_has_one_form_of_torque() -> None:
    record = scene_record(scene_with(terms=[DAMPING]))
    assert record["torque"] == {"terms": [DAMPING]}
    wrong: list[dict[str, Any]] = [
        {"terms": []}, {"terms": [{"matrix": 0.1}]}, {"terms": [DAMPING], "opaque": True},
        {"terms": [DAMPING], "recorded": 1}, {"terms": [DAMPING], "frame": "space"},
        {**WAVES, "terms": [DAMPING], "expression": ["0"] * 3, "constants": {}},
    ]  # fmt: skip
    for torque in wrong:
        assert not is_documented(record | {"torque": torque})


def test_terms_in_the_documents_are_read() -> None:
    """The reference names every kind and key, and its example and that of the guide are read."""
    text = (ROOT / "docs/reference/scene-files.md").read_text().partition("## Ready terms")[2]
    (example,) = re.findall(r"```\n(\[\[torque.terms\]\].*?)```", text, re.DOTALL)
    assert isinstance(scene_of(BODY | tomllib.loads(example), "reference").torque, StateTorque)
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", text, re.MULTILINE))
    assert rows.pop("kind") == "keys"
    keys = {kind: set(re.findall(r"`(\w+)`", row)) for kind, row in rows.items()}
    assert keys == {kind: set(signature(x.function).parameters) for kind, x in KINDS.items()}
    satellite = read_scene(ROOT / "docs/satellite.toml")
    assert isinstance(satellite.torque, StateTorque)
    assert np.isfinite(satellite.torque.at(0.0, satellite.omega, (1.0, 0.0, 0.0, 0.0))).all()

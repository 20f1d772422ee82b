"""The verb `scene`, and the JSON Schema of scene files."""

import copy
import json
import tomllib
from inspect import Parameter, signature
from pathlib import Path
from random import Random
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from pyharness import InputError, case_scene, read_scene
from pyharness.engine.torques.scene_reader import SCENE_TABLES as TABLES
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.facts import facts_folder
from tests.conftest import Printed, ResultOf

ROOT = Path(__file__).parent.parent.parent
SCHEMA = json.loads((facts_folder() / "scene.schema.json").read_text())
FILES = [
    path
    for path in sorted(ROOT.glob("docs/**/*.toml"))
    if {"body", "initial"} <= tomllib.loads(path.read_text()).keys()
]
VALIDATOR = Draft202012Validator(SCHEMA)


def test_a_new_scene_file_is_read(tmp_path: Path, printed: Printed) -> None:
    path = tmp_path / "brick.toml"
    printed(f"scene new --out {path}")
    assert read_scene(path).moments == (40.0, 30.0, 20.0)
    assert VALIDATOR.is_valid(tomllib.loads(path.read_text()))
    # The line of comment shows an expression that may replace the law.
    lines = path.read_text().splitlines()
    kept = [line for line in lines if not line.startswith(("constant =", "sines ="))]
    other = "\n".join(kept).replace("# expression", "expression")
    assert "q0" in other
    assert VALIDATOR.is_valid(tomllib.loads(other))
    assert scene_of(tomllib.loads(other), "x").torque.needs_attitude
    path = tmp_path / "case-3.toml"
    printed(f"scene new --case 3 --out {path}")
    assert read_scene(path).omega == case_scene(3).omega


def test_check_describes_a_scene(tmp_path: Path, printed: Printed, result_of: ResultOf) -> None:
    found = printed(f"scene check {ROOT}/docs/satellite.toml")
    assert "gravity gradient + wheels + damping" in found
    assert max(map(len, found.splitlines())) <= 100
    record = json.loads(printed(f"scene check {FILES[0]} --format json"))
    assert record["scene"]["name"] == read_scene(FILES[0]).name
    path = tmp_path / "long.toml"
    path.write_text(
        "body.moments = [1, 2, 3]\ninitial = { omega = [1, 2, 3], attitude = [2, 0, 0, 0] }\n"
    )
    assert "the attitude has the norm 2" in result_of(["scene", "check", str(path)]).err


def test_the_schema_is_printed_and_is_one(printed: Printed) -> None:
    assert json.loads(printed("scene schema")) == SCHEMA
    VALIDATOR.check_schema(SCHEMA)


def test_the_schema_has_the_keys_of_the_reader() -> None:
    mend = "add it to data/scene.schema.json"
    assert SCHEMA["properties"].keys() == {"schema", "name", "states", *TABLES}, mend
    for table, keys in TABLES.items():
        assert SCHEMA["properties"][table]["properties"].keys() == set(keys), f"{table}: {mend}"
    kinds = SCHEMA["properties"]["torque"]["properties"]["terms"]["items"]["oneOf"]
    assert {each["properties"]["kind"]["const"] for each in kinds} == KINDS.keys(), mend
    for each in kinds:
        name = each["properties"]["kind"]["const"]
        parameters = signature(KINDS[name].function).parameters
        assert each["properties"].keys() == {"kind", *parameters}, f"{name}: {mend}"
        required = {key for key, own in parameters.items() if own.default is Parameter.empty} - (
            {"inertia"} if "inertia" in parameters else set()
        )
        assert set(each["required"]) == {"kind", *required}, f"required of {name}: {mend}"
    documented = (ROOT / "docs" / "reference" / "scene-files.md").read_text()
    missing = [key for key in KINDS if f"`{key}`" not in documented]
    assert missing == [], "describe it in docs/reference/scene-files.md"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_of_the_documents_have_the_schema(path: Path) -> None:
    assert [error.message for error in VALIDATOR.iter_errors(tomllib.loads(path.read_text()))] == []


def places(value: Any, found: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all values in nested dictionaries and lists."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    return [found, *(
        place
        for key, each in pairs
        for place in (
            places(each, (*found, key)) if isinstance(each, (dict, list)) else [(*found, key)]
        )
    )]  # fmt: skip


WRONG: tuple[Any, ...] = (
    *("text", "", True, 0, 1, -1.5, 1e400, [], {}, [1.0, 2.0, 3.0], [1, 2], [0.0] * 4),
    *(["a", "b", "c"], [[1.0, 2.0]], {"x": 1}, 3),
)


@pytest.mark.campaign
def test_what_the_schema_refuses_the_reader_refuses() -> None:
    source = Random("schema 2611")
    scenes = [tomllib.loads(path.read_text()) for path in FILES]
    refused = 0
    for _ in range(4000):
        data = copy.deepcopy(source.choice(scenes))
        *above, key = source.choice(places(data)[1:])
        parent = data
        for each in above:
            parent = parent[each]
        action = source.randrange(3)
        if action == 0:
            del parent[key]
        elif action == 1 or isinstance(parent, list):
            parent[key] = copy.deepcopy(source.choice(WRONG))
        else:
            parent[source.choice(["moments", "attitude", "frame", "kind", "x", "sequence"])] = (
                copy.deepcopy(source.choice(WRONG))
            )
        if not VALIDATOR.is_valid(data):
            refused += 1
            with pytest.raises(InputError):
                scene_of(data, "name")
    assert refused > 2000

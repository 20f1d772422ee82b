"""JSON of other programs and of files: no key twice, no NaN, no value chosen silently."""

import json
import random
from pathlib import Path
from typing import Any

import pytest

import pyharness
from pyharness.model.json_text import parse_json, unique

# Files that read only JSON of our own, or that must work without the package.
_OURS = {
    "checks/agree/caller.py", "checks/integrators/plants.py", "checks/plants/port_plants.py",
    "cli/json_help.py", "edition/citation.py", "model/json_text.py", "truth/certificate_checker.py",
}  # fmt: skip


def _drawn(draw: random.Random, depth: int = 0) -> Any:
    """Return a random value, whose keys all differ."""
    kind = draw.randrange(5 if depth < 4 else 3)
    if kind == 3:
        return [_drawn(draw, depth + 1) for _ in range(draw.randrange(4))]
    if kind == 4:
        keys = draw.sample(range(1000), draw.randrange(1, 4))
        return {f"key {key}": _drawn(draw, depth + 1) for key in keys}
    return draw.choice([None, True, "nan", 0.1, -0.0, 3, 1e300])


def test_a_key_that_is_written_twice_anywhere_is_named() -> None:
    draw = random.Random(1)
    tried = 0
    while tried < 300:
        value = {"outer": _drawn(draw)}
        text = json.dumps(value)
        assert parse_json(text) == value
        places = [n for n in range(len(text)) if text.startswith('"key ', n)]
        if not places:
            continue
        place = draw.choice(places)
        key, end = json.JSONDecoder().raw_decode(text, place)
        more = draw.choice([text[place:end], json.dumps(key).replace("k", "\\u006b")])
        with pytest.raises(ValueError, match=f'^the key "{key}" occurs twice$'):
            parse_json(f"{text[:place]}{more}: 1, {text[place:]}")
        tried += 1


@pytest.mark.parametrize("name", ["NaN", "Infinity", "-Infinity"])
def test_what_json_lacks_is_refused_where_it_is_no_part_of_the_format(name: str) -> None:
    with pytest.raises(ValueError, match=f'^{name} is not JSON; write text, as in "nan"$'):
        parse_json(f'{{"x": [1, {name}]}}')
    assert repr(parse_json(name, only_finite=False)) == repr(float(name))
    with pytest.raises(ValueError, match='"x" occurs twice'):
        parse_json(f'{{"x": {name}, "x": 1}}', only_finite=False)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "9" * 5000, b"\xff\x00", ""])
def test_every_error_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        parse_json(text)


def test_pairs_become_a_dictionary_in_their_order() -> None:
    assert list(unique(zip("cab", range(3), strict=True)).items()) == [("c", 0), ("a", 1), ("b", 2)]
    with pytest.raises(ValueError, match="the key 7 occurs twice"):
        unique([(7, 1), (7, 1)])


def test_only_this_reader_is_used_for_json_from_outside() -> None:
    folder = Path(pyharness.__file__).parent
    users = {
        path.relative_to(folder).as_posix() for path in folder.rglob("*.py")
        if "json.load" in path.read_text(encoding="utf-8")
    }  # fmt: skip
    assert users == _OURS

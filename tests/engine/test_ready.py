"""Declarations of ready torques and events: what is made of them, and what they may not omit."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.optimize import brentq

from pyharness import Scene, events, solve
from pyharness.engine.events.ready_events import EVENTS
from pyharness.engine.torques.ready import LAW, TORQUES, Ready, number, ready_event, ready_torque
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.facts import facts_folder
from pyharness.model.trajectory import Array
from pyharness.torques import damping
from tests.engine.test_term_file import written
from tests.engine.test_terms import FORMULAS, matrix

ROOT = Path(__file__).parent.parent.parent
gain = number("Gain", "N m s", 0.3)


def twice(gain: float, power: int = 1) -> Any:
    return gain * power


def when(gain: float, *, terminal: bool = False, direction: int = 0) -> Any:
    return gain, terminal, direction


DECLARED: dict[str, tuple[Callable[[], Any], str]] = {
    "no argument": (
        lambda: ready_torque("", "", dict)(twice), "twice: gain is a parameter, but not declared"
    ),
    "an argument too few": (
        lambda: ready_torque("", "", dict, gain=gain)(twice),
        "twice: power is a parameter, but not declared",
    ),
    "an argument too many": (
        lambda: ready_torque("", "", dict, gain=gain, power=gain, more=gain)(twice),
        "twice: more is declared, but no parameter",
    ),
    "no argument of an event": (
        lambda: ready_event("")(when), "when: gain is a parameter, but not declared"
    ),
    "a common argument of events": (
        lambda: ready_event("", gain=gain, direction=gain)(when),
        "when: direction is declared, but no parameter",
    ),
    "no sample": (
        lambda: number("Gain", "N m s"),  # type: ignore[call-arg]
        "missing 1 required positional argument: 'sample'"
    ),
    "no random arguments": (
        lambda: ready_torque("", "", gain=gain)(twice),  # type: ignore[call-arg]
        "missing 1 required positional argument: 'draw'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DECLARED)
def test_a_declaration_that_is_not_complete_is_refused(case: str) -> None:
    declare, message = DECLARED[case]
    names = TORQUES.keys() | EVENTS.keys()
    with pytest.raises(TypeError, match=message):
        declare()
    assert TORQUES.keys() | EVENTS.keys() == names


@pytest.mark.parametrize("ready", [*KINDS.values(), *EVENTS.values()], ids=[*KINDS, *EVENTS])
def test_samples_and_formulas_are_there(ready: Ready) -> None:
    """Each sample has the form that its schema states."""
    name = ready.function.__name__
    assert name in FORMULAS.keys() | EVENT_FORMULAS.keys()
    file = json.loads((facts_folder() / "scene.schema.json").read_text())
    validator = Draft202012Validator({**ready.schema(), "$defs": file["$defs"]})
    given = json.loads(json.dumps({key: written(x) for key, x in ready.sample.items()}))
    assert [each.message for each in validator.iter_errors({"kind": name, **given})] == []
    for each in ready.arguments.values():
        assert (each.form == LAW) == (each.frame is not None)
    assert ready.about[0].isupper()
    assert not ready.about.endswith(".")


# Events: functions of omega, the matrix from body to space, omega's derivative, and arguments.
EVENT_FORMULAS: dict[str, Callable[..., float]] = {
    "crosses": lambda w, r, rate, axis, value: w[axis - 1] - value,
    "flip": lambda w, r, rate, axis: w[axis - 1],
    "extremum": lambda w, r, rate, axis: rate[axis - 1],
    "rest": lambda w, r, rate, value: np.linalg.norm(w) - value,
    "tilt": lambda w, r, rate, axis, toward, angle: (
        np.arccos(r[:, axis - 1] @ toward / np.linalg.norm(toward)) - angle
    ),
}


@pytest.mark.parametrize("name", EVENTS)
def test_an_event_is_a_root_of_its_formula(name: str) -> None:
    ready = EVENTS[name]
    scene = Scene("slowed", (0.1, 2.0, 0.9), moments=(1.0, 2.0, 3.0), torque=damping(0.1))
    event = ready.function(**ready.sample)
    found: Any = solve(scene, 20.0, attitude=True, dense_output=True, events=event)

    def formula(t: float) -> float:
        state: Array = found.sol(t)
        rate = found.sol.derivative(t)[:3]
        return EVENT_FORMULAS[name](state[:3], matrix(state[3:]), rate, **ready.sample)

    grid = np.linspace(0.0, 20.0, 801)
    values = np.array([formula(t) for t in grid])
    changes = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    roots = [brentq(formula, grid[n], grid[n + 1], xtol=1e-12) for n in changes
             if event.direction in (0, np.sign(values[n + 1]))]  # fmt: skip
    assert len(roots) >= 1
    assert found.t_events[0] == pytest.approx(roots, abs=1e-8)


def test_every_ready_event_is_public() -> None:
    assert {name: getattr(events, name) for name in events.__all__ if name != "Event"} == {
        name: each.function for name, each in EVENTS.items()
    }


# What a developer adds to a file of ready torques and to that of ready events.
TORQUE = '''
__all__.append("stirring")

@ready_torque(
    "Torque -k (w1 w2, w2 w3, w3 w1)",
    "$-k p$",
    lambda sizes: {"strength": sizes.part / sizes.speed},
    convention="its strength is positive",
    strength=number("k", "N m s2", 0.2, "$k$"),
)
def stirring(strength: Number) -> StateTorque:
    """Return a torque."""
    k = finite("[torque] stirring strength", strength)
    return ready_term(
        "stirring",
        lambda t, w, q: [-k * w[0] * w[1], -k * w[1] * w[2], -k * w[2] * w[0]],
        strength=k,
    )
'''
EVENT = '''
__all__.append("spin")

@ready_event("Component 3 of omega equals a value", value=number("Value", "rad/s", 0.7))
def spin(value: Number, *, terminal: bool | int = False, direction: int = 0) -> Event:
    """Return an event."""
    level = finite("events: spin value", value)
    return Event("spin", lambda t, w, q, rates: w[2] - level, terminal, direction)
'''
SCRIPT = '''
import json, sys
from importlib.util import find_spec, module_from_spec

for name, more in json.loads(sys.argv[1]).items():
    spec = find_spec(name)
    module = sys.modules[name] = module_from_spec(spec)
    text = spec.loader.get_source(name) + more
    exec(compile(text, spec.origin, "exec"), vars(module))
    package, _, own = name.rpartition(".")
    setattr(sys.modules[package], own, module)

from random import Random
from pyharness import Scene, events, prepare, solve, torques
from pyharness.bench.term_loads import term_scenes
from pyharness.checks.scenes.state_scenes import READY, ready
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.engine.torques.term_file import KINDS
from pyharness.model.scene_file import scene_text
from docs.reference.made_tables import pages

sys.path.insert(0, "fortran")
import make_leaves

def read(**table):
    initial = {"omega": [1.0, 2.0, 3.0]}
    torque = {"terms": [{"kind": "stirring", **table}]}
    return scene_of({"body": {"moments": [3, 2, 1.5]}, "initial": initial, "torque": torque}, "x")

scene = read(strength=0.5)
try:
    read()
except ValueError as error:
    refused = str(error)
keys = [make_leaves.texts()["ready_keys.h"].count("INT64_C")]
kept = KINDS.pop("stirring")
keys.append(make_leaves.texts()["ready_keys.h"].count("INT64_C"))
KINDS["stirring"] = kept
print(json.dumps({
    "names": [torques.__all__, events.__all__],
    "torque": scene.torque.at(0.0, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)),
    "text": scene_text(scene),
    "refused": refused,
    "event": len(solve(scene, 5.0, events=events.spin(0.7)).t_events[0]),
    "bench": [each.scene.name for each in term_scenes()],
    "drawn": [READY, ready(Random(1), "stirring", [1.0, 2.0, 2.5], 1.0).terms],
    "pages": dict(pages()),
    "keys": keys,
}))
'''  # fmt: skip


@pytest.fixture(scope="module")
def added() -> dict[str, Any]:
    """Return what a process shows in which a ready torque and event were added."""
    more = {
        "pyharness.engine.torques.field_terms": TORQUE,
        "pyharness.engine.events.ready_events": EVENT,
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(more)], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_an_added_torque_is_everywhere(added: dict[str, Any]) -> None:
    assert "stirring" in added["names"][0]
    assert added["torque"] == [-1.0, -3.0, -1.5]
    assert 'kind = "stirring"\nstrength = 0.5\n' in added["text"]
    assert added["refused"] == "[[torque.terms]] 1, stirring: strength is missing; keys: strength"
    assert "stirring" in added["bench"]
    assert sorted(added["drawn"][0]) == sorted([*KINDS, "stirring"])
    assert added["drawn"][1][0][0] == ["kind", "stirring"]
    schema = json.loads(added["pages"]["pyharness/data/scene.schema.json"])
    kinds = schema["properties"]["torque"]["properties"]["terms"]["items"]["oneOf"]
    (own,) = [each for each in kinds if each["properties"]["kind"]["const"] == "stirring"]
    assert own == {
        "type": "object",
        "description": "Torque -k (w1 w2, w2 w3, w3 w1).",
        "properties": {
            "kind": {"const": "stirring"},
            "strength": {"type": "number", "description": "k, N m s2."},
        },
        "required": ["kind", "strength"],
        "additionalProperties": False,
    }
    for page, row in {
        "docs/reference/scene-files.md": "| `stirring` | `strength` | N m s2 |",
        "docs/how-to/torques.md": "| `stirring(strength)` | $-k p$ | `strength`: $k$, N m s2 |",
        "docs/reference/conventions.md": "| `stirring(strength)` | its strength is positive |",
    }.items():
        assert f"{row}\n" in added["pages"][page]


def test_an_added_torque_has_leaves(added: dict[str, Any]) -> None:
    # One without and one with the attitude.
    after, before = added["keys"]
    assert after == before + 2


def test_an_added_event_is_everywhere(added: dict[str, Any]) -> None:
    assert "spin" in added["names"][1]
    assert added["event"] >= 1
    row = "| `spin(value)` | component 3 of omega equals a value | `value`: rad/s |\n"
    assert row in added["pages"]["docs/how-to/results.md"]

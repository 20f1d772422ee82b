"""The data of the page that runs the programs in the browser."""

import re
from typing import Any

import numpy as np

from pyharness.checks.port_protocol import requested_scene
from pyharness.edition.ledger import assumption
from pyharness.model.assumptions import MARK, assumed
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, flagged, switches
from pyharness.model.report import short
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.scene_report import ending, heading
from pyharness.thesis.cards import deck, numbers
from pyharness.thesis.decks import alterations
from pyharness.thesis.printer import formats_of, page
from pyharness.thesis.programs import run_program
from pyharness.truth.reference import reference

DEFAULTS: dict[str, Any] = {"case": 2, "program": "runge-kutta", "listing": "original"}
"""Run that the page shows if its address specifies none."""
MOST_STEPS = 3000
"""Largest number of steps that the page draws without noticeable delay."""
_KINDS = {
    "defect": "Faults left in",
    "reading": "Other readings of doubtful cards",
    "conjecture": "Assumed, because no card exists",
}
_SHOWN = 3


def context() -> dict[str, Any]:
    """Return the values for the page's template.

    `switches` has defects, readings and conjectures by heading; `first` is the run with `DEFAULTS`.
    """
    titles, flags = {n: case_scene(n).name for n in case_numbers()}, data()["flags"]
    by_kind = {kind: [flag for flag in flags if flag["kind"] == kind] for kind in _KINDS}
    shown = [(head, by_kind[kind]) for kind, head in _KINDS.items()]
    found = {"titles": titles, "programs": PROGRAMS, "switches": shown, "first": _first()}
    return found | {"experiments": facts("experiments")["experiment"]}


def data() -> dict[str, Any]:
    cases = {number: case_scene(number) for number in case_numbers()}
    return {
        "scenes": list(map(requested_scene, cases.values())),
        "assumed": {number: assumption(number) for number in cases},
        "assumedInRuns": {number: _assumed_in(scene) for number, scene in cases.items()},
        "headings": {number: _described(scene) for number, scene in cases.items()},
        "programs": list(PROGRAMS),
        "flags": [
            {name: entry[name] for name in ("id", "kind", "programs", "summary")}
            | {"in_original": any(entry["id"] in switches(name) for name in entry["programs"])}
            for entry in flagged()
        ],
        "deck": _deck_data(),
        "lipschitz": facts("cases")["deck"]["lipschitz"],
        "most_steps": MOST_STEPS,
        "printer": {name: _printed_parts(name) for name in PROGRAMS},
        "defaults": DEFAULTS,
    }


def _assumed_in(scene: Scene) -> dict[str, list[dict[str, Any]]]:
    found, names = {}, ("entry", "active", "what")
    for program in PROGRAMS:
        each_on = assumed(scene, [Listing.original(program)])
        on_cards = (each for each in each_on if each["on"] == "listing")
        found[program] = [{name: each[name] for name in names} for each in on_cards]
    return found


def _printed_parts(program: str) -> dict[str, Any]:
    return {part: formats_of(program)[part] for part in ("header", "heads", "rows")}


def _deck_data() -> dict[str, Any]:
    """Return the cards that are executed in a step, and alterations by corrections."""
    order = facts("cards/passes")
    found: dict[str, Any] = {}
    for program in PROGRAMS:
        # A pass is a part of a step that is executed once with constant subscripts.
        passes = []
        for each in order[program]["pass"]:
            first, last = map(int, each["cards"].split("-"))
            passes.append({**each, "from": first, "to": last, "set": each.get("set", {})})
        cards = _statements(program, passes[0]["from"], passes[-1]["to"])
        found[program] = {"torque": order[program]["torque"], "passes": passes, "cards": cards}
    altered = [x for x in alterations() if "dialect" not in x]
    deleted = [{"delete": numbers(each["delete"])} if "delete" in each else {} for each in altered]
    found["alterations"] = [x | more for x, more in zip(altered, deleted, strict=True)]
    return found


def _statements(program: str, first: int, last: int) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    for number, card in deck(program).cards.items():
        text = card.text.rstrip()
        if not first <= number <= last or card.is_comment:
            continue
        if card.continues:
            if number - 10 == found[-1][0]:
                found[-1] = (found[-1][0], found[-1][1] + text[6:])
        elif not re.match(r"DO |CONTINUE|FORMAT", text[6:]):
            found.append((number, text))
    return found


def _described(scene: Scene) -> list[str]:
    lines = heading(scene)
    body, torque, *_ = lines[1].split("; ")
    return [f"{body}; {torque}", *(each for each in lines[2:] if not each.startswith(MARK))]


def _first() -> dict[str, Any]:
    scene = case_scene(DEFAULTS["case"])
    program = DEFAULTS["program"]
    run = run_program(scene, Listing.original(program), "python")
    truth = reference(scene, scene.times()).omega
    error = np.abs(run.omega - truth[: run.steps]).max(axis=1)
    told = ending(run)
    options = " ".join(f"--{word} {value}" for word, value in DEFAULTS.items())
    assert run.velocity is not None
    values = np.column_stack([run.time, run.omega, run.velocity, run.recorded_time]).tolist()
    numbers = [*range(_SHOWN), *range(run.steps - _SHOWN, run.steps)]
    # The empty text is for IER, which the Runge-Kutta program lacks.
    rows = [[str(n + 1), *map(repr, values[n]), "", short(float(error[n]))] for n in numbers]
    fragment = "&".join(f"{word}={value}" for word, value in DEFAULTS.items())
    found = {"state": DEFAULTS, "fragment": fragment, "command": f"pyharness run {options}"}
    found |= {"ending": told[0].upper() + told[1:], "error": short(float(error.max()))}
    return found | {"rows": rows, "page": page(scene, program, run)}

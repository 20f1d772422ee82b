"""Values that we assume where the thesis has none or is ambiguous."""

from collections.abc import Iterable, Sequence
from typing import Any

from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene

MARK = "*"
"""The sign of an assumed number in outputs and pages; every terminal can show it."""

ASSUMED = f"{MARK} assumed"
"""The sign and its meaning."""

Runs = Iterable[tuple[Scene, Iterable[Listing]]]
"""Scenes, each with the listings that ran in it."""


def assumptions() -> list[dict[str, Any]]:
    entries = facts("apparatus")["entry"]
    found = [
        {"id": each["id"], "on": "listing", "entry": each["id"]} | each["assumption"]
        for each in sorted(entries, key=lambda each: str(each["kind"]))
        if "assumption" in each
    ]
    given = facts("assumptions")["assumption"]
    after = [each for each in given if each["on"] == "claim"]
    return [*(each for each in given if each not in after), *found, *after]


def open_starts() -> dict[int, str]:
    """Return the source of omega(0), by case number, for cases whose omega(0) the thesis lacks."""
    cases = facts("cases")["case"]
    return {each["number"]: each["assumed_omega"] for each in cases if "assumed_omega" in each}


def assumed(scene: Scene, listings: Iterable[Listing] = ()) -> list[dict[str, Any]]:
    """Return the assumptions on which `scene` and its runs of `listings` (programs) depend."""
    among = list(listings)
    return [each for each in assumptions() if _is_made(each, scene, among)]


def _is_made(each: dict[str, Any], scene: Scene, listings: Sequence[Listing]) -> bool:
    if scene.case is None or scene.case not in each.get("cases", [scene.case]):
        return False
    match each["on"]:
        case "omega":
            (case,) = (c for c in facts("cases")["case"] if c["number"] == scene.case)
            return scene.case in open_starts() and list(scene.omega) == case["omega"]
        case "steps":
            return bool(scene.steps == facts("cases")["deck"]["steps"])
        case "listing":
            return any(_is_in(each, listing) for listing in listings)
    return bool(each["on"] == "units")


def _is_in(each: dict[str, Any], listing: Listing) -> bool:
    (entry,) = (e for e in facts("apparatus")["entry"] if e["id"] == each["entry"])
    # Readings and conjectures have no effect in a corrected program.
    has_it = listing.program in entry["programs"] and bool(listing.active)
    return has_it and listing.has(each["entry"]) == each["active"]


def mark(scene: Scene, listing: Listing) -> str:
    return MARK if any(each["on"] == "listing" for each in assumed(scene, [listing])) else ""


def case_mark(case: int) -> str:
    return MARK if case in open_starts() else ""


def assumption_records(runs: Runs) -> list[dict[str, Any]]:
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for scene, listings in runs:
        for each in assumed(scene, listings):
            what = each["what"].format(start=open_starts().get(scene.case or 0, ""))
            cases = found.setdefault((each["id"], what), _record(each, what))["cases"]
            if scene.case not in cases:
                cases.append(scene.case)
    order = [each["id"] for each in assumptions()]
    return sorted(found.values(), key=lambda each: order.index(each["id"]))


def claim_records() -> list[dict[str, Any]]:
    """Return the assumptions that affect only the verdicts on claims."""
    return [_record(each, each["what"]) for each in assumptions() if each["on"] == "claim"]


def _record(each: dict[str, Any], what: str) -> dict[str, Any]:
    return {"id": each["id"], "what": what, "cases": [], "source": each["source"]}


def legend(runs: Sequence[tuple[Scene, Iterable[Listing]]]) -> list[str]:
    """Return, as a list, the line that explains the marks of `runs`; empty without marks."""
    every = {scene.case for scene, _ in runs}
    told = []
    for each in assumption_records(runs):
        cases = each["cases"]
        named = f" (Case{'s' * (len(cases) > 1)} {', '.join(map(str, cases))})"
        told.append(each["what"] + named * (set(cases) != every))
    return [f"{ASSUMED}: {'; '.join(told)}"] if told else []

"""Entries of the apparatus (notes on programs), such as defects, and their effects on errors."""

import math
import string
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

from pyharness.checks.compare.agreement import accuracy
from pyharness.history.cards_report import HALF, beside
from pyharness.model.assumptions import ASSUMED, assumption_records, case_mark
from pyharness.model.effort import check_steps
from pyharness.model.errors import unknown
from pyharness.model.facts import facts
from pyharness.model.listing import Listing, names_of, switches
from pyharness.model.records import listing_record, scene_record
from pyharness.model.report import Column, Field, Report, Section, Table, numbers, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Stop, Trajectory
from pyharness.thesis.cells import subsets
from pyharness.thesis.programs import run_program
from pyharness.truth.reference import Reference, reference

FIELDS = ("kind", "cards", "scan", "adopted", "certainty", "evidence", "grounds", "why")
_ENTRIES = (*words("name kind certainty flag"), Column("what it is", left=True, fit="wrap"))
_LISTINGS = ("original", "corrected_alone", "kept_alone", "corrected")
_EFFECTS = words("case")
for _a in "abcd":
    _EFFECTS += [Column(f"w.{_a}", short, unit="rad/s"), Column(f"V.{_a}", short, unit="m/s")]
    _EFFECTS += [Column(f"stop.{_a}")]


@dataclass(frozen=True)
class Effect:
    """The outcome of a program's version `listing` in a scene."""

    listing: Listing
    omega: float  # largest error (rad/s) over the completed `steps`
    velocity: float  # the same for velocity (m/s)
    steps: int
    ended: str
    stop: Stop | None
    # Largest errors of omega and velocity over the steps that all compared listings completed.
    common: tuple[float, float] = (math.nan, math.nan)


@dataclass(frozen=True)
class CaseEffects:
    """The outcomes of four program versions in a case, which show an entry's effect."""

    program: str
    case: int
    original: Effect
    corrected_alone: Effect  # original, but without the entry
    kept_alone: Effect  # corrected, but with the entry
    corrected: Effect


def entries(kind: str | None = None) -> list[dict[str, Any]]:
    everything = [
        {name: each for name, each in entry.items() if name not in ("alteration", "assumption")}
        for entry in facts("apparatus")["entry"]
    ]
    kinds = sorted({entry["kind"] for entry in everything})
    if kind is not None and kind not in kinds:
        raise unknown("kind", kind, kinds, "--kind")
    return [entry for entry in everything if kind in (None, entry["kind"])]


def entry(name: str) -> dict[str, Any]:
    by_name = {each["id"]: each for each in entries()}
    if name not in by_name:
        raise unknown("entry", name, list(by_name))
    return by_name[name]


def effect(scene: Scene, listing: Listing, truth: Reference, effort: float = 1.0) -> Effect:
    run = run_program(scene, listing, effort=effort)
    return Effect(listing, *_errors(scene, run, truth), run.steps, run.ended, run.stop)


def _errors(scene: Scene, run: Trajectory, truth: Reference) -> tuple[float, float]:
    found = accuracy(scene, run, truth)
    return max(found.omega), math.nan if found.velocity is None else found.velocity


@cache
def case_truth(case: int) -> Reference:
    scene = case_scene(case)
    return reference(scene, scene.times(), velocity=True)


def effects_of(name: str) -> Iterator[CaseEffects]:
    """Yield the effects of the entry `name` in each of its programs and each case."""
    known = entry(name)
    for program in known["programs"]:
        printed = Listing.original(program).active
        active = (printed | {name}, printed - {name}, {name}, ())
        listings = [Listing(program, names) for names in active]
        for case in case_numbers():
            scene, truth = case_scene(case), case_truth(case)
            yield CaseEffects(program, case, *(effect(scene, each, truth) for each in listings))


def lattice(
    scene: Scene, program: str, readings: tuple[str, ...] = (), effort: float = 1.0
) -> list[Effect]:
    """Return outcomes with each subset of defects and `readings`, largest `common` error first.

    Under a varying torque, the subsets include conjectures.
    """
    check_steps(scene, program, "fortran", effort)
    truth = reference(scene, scene.times(), velocity=True, effort=effort)
    listings = [Listing(program, each) for each in subsets((*switched(scene, program), *readings))]
    runs = [run_program(scene, listing, effort=effort) for listing in listings]
    n = min(each.steps for each in runs)
    assert truth.velocity is not None
    begin = replace(truth, time=truth.time[:n], omega=truth.omega[:n], velocity=truth.velocity[:n])
    found = []
    for listing, run in zip(listings, runs, strict=True):
        errors, common = (_errors(scene, run, each) for each in (truth, begin))
        found.append(Effect(listing, *errors, run.steps, run.ended, run.stop, common))
    return sorted(found, key=_size, reverse=True)


def switched(scene: Scene, program: str) -> tuple[str, ...]:
    return switches(program) if scene.torque.varies else names_of("defect", program)


def _size(found: Effect) -> list[float]:
    # Three digits, so that rounding errors do not affect the order.
    return [float(f"{each:.2e}") for each in (*found.common, found.omega, found.velocity)]


def apparatus_report(entries: Sequence[dict[str, Any]], are_all_shown: bool = True) -> Report:
    """Return a report with a line for each entry.

    Unless `are_all_shown`, its text has only the defects that change numbers.
    """
    shown = entries
    head = (
        "kind: defect (a fault of the author), reading (a card that can be read in two ways), "
        "conjecture (an assumption where no card exists), and others. flag: number of the switch "
        "in the programs; -: no switch. `defects NAME` shows statements, evidence and effect."
    )
    names = ["id", "kind", "certainty", "flag", "summary"]
    columns, end = _ENTRIES, []
    if not are_all_shown:
        shown = [each for each in entries if each["kind"] == "defect" and "flag" in each]
        names = ["id", "certainty", "summary"]
        columns = tuple(each for each in _ENTRIES if each.head not in ("kind", "flag"))
        head = (
            f"The {len(shown)} faults of the author that change numbers. "
            "`defects NAME` shows statements, evidence and effect of one."
        )
        kinds = Counter(each["kind"] for each in entries if each not in shown)
        told = ", ".join(f"{kind} {number}" for kind, number in kinds.items())
        end = [f"{kinds.total()} more entries: {told}. `defects --all` shows them, or --kind KIND."]
    rows = [[each.get(name, "-") for name in names] for each in shown]
    return Report("defects", [[head], [Table(columns, rows)], end], lambda: {"entries": entries})


def entry_report(
    entry: dict[str, Any], effects: Sequence[CaseEffects], names: Sequence[str] = FIELDS
) -> Report:
    cards = "; ".join(f"{program} {cards}" for program, cards in entry["cards"].items())
    what = {each["siglum"]: each["what"] for each in facts("cards/scan")["ground"]}
    grounds = "; ".join(f"{siglum}, {what[siglum]}" for siglum in entry["grounds"])
    values = {**entry, "cards": cards, "grounds": grounds}
    fields = [Field(f"{name:10s} ", values[name]) for name in names if values.get(name)]
    text: list[Section] = [[f"{entry['id']}: {entry['summary']}"], fields]
    if "original" in entry:
        heads = ("original", "corrected")
        left, right = ([x, "-" * HALF, *textwrap.wrap(entry[x], HALF)] for x in heads)
        text.append(beside(left, right))
    if effects:
        text += _effects(effects, entry["kind"] != "defect")

    def record() -> dict[str, Any]:
        records, runs = [], []
        for each in effects:
            found = {name: getattr(each, name) for name in _LISTINGS}
            runs.append((case_scene(each.case), [effect.listing for effect in found.values()]))
            told = {name: _effect_record(effect) for name, effect in found.items()}
            records.append({"program": each.program, "case": each.case} | told)
        return {"entry": entry, "effects": records, "assumptions": assumption_records(runs)}

    return Report("defects", text, record)


def _effects(effects: Sequence[CaseEffects], is_reading: bool) -> list[Section]:
    columns = ("original", "this alone corrected", "this alone kept", "all corrected")
    if is_reading:
        columns = ("original, with it", "original", "corrected, with it", "corrected")
    legend = (
        "Effect, measured now over 100 steps. w: largest error of the angular velocity (rad/s) up "
        "to the end of the run; V: of the velocity (m/s); stop: variable and step that ended the "
        f"run; {ASSUMED}: omega(0) of the case."
    )
    names = ", ".join(f"{a}: {text}" for a, text in zip("abcd", columns, strict=True))
    told: list[Section] = [[legend, names]]
    for program in dict.fromkeys(each.program for each in effects):
        rows = []
        for each in (each for each in effects if each.program == program):
            row: list[Any] = [f"{each.case}{case_mark(each.case)}"]
            for found in (getattr(each, name) for name in _LISTINGS):
                row += [found.omega, found.velocity, _stop(found)]
            rows.append(row)
        told.append([program, Table(_EFFECTS, rows)])
    return told


def lattice_report(scene: Scene, found: Mapping[str, Sequence[Effect]]) -> Report:
    text: list[Section] = []
    rows = []
    for program, effects in found.items():
        readings = sorted({name for each in effects for name in each.listing.readings})
        names = (*switched(scene, program), *readings)
        letters = dict(zip(names, string.ascii_lowercase, strict=False))
        n = min(each.steps for each in effects)
        title = (
            f"program {program}: every subset of its defects, largest error first. w, V: largest "
            f"error of the angular velocity (rad/s) and of the velocity (m/s) up to step {n}, "
            "which all runs reached, and up to the end of the run"
        )
        key = [f"  {letter}  {name}" for name, letter in letters.items()]
        subsets = []
        for each in effects:
            errors, active = (each.omega, each.velocity, each.steps), each.listing.active
            written = "".join(a if name in active else "." for name, a in letters.items())
            subsets.append([written, *each.common, *errors, _stop(each)])
            variable = each.stop.variable if each.stop else None
            row = [program, " ".join(sorted(active)), *errors, each.ended, variable]
            rows.append([*row, *each.common])
        columns = [*words("active")]
        for end in (f"to {n}", "to end"):
            columns += [Column(f"w {end}", short, unit="rad/s")]
            columns += [Column(f"V {end}", short, unit="m/s")]
        columns += [Column("steps"), Column("stop")]
        told = heading(scene, [Listing.original(program)])
        text += [[*told, title, *key], [Table(columns, subsets)]]

    def record() -> dict[str, Any]:
        listings = [effect.listing for each in found.values() for effect in each]
        lattice = {name: list(map(_subset_record, each)) for name, each in found.items()}
        assumptions = assumption_records([(scene, listings)])
        return {"scene": scene_record(scene), "lattice": lattice, "assumptions": assumptions}

    heads = "error_w error_v steps ended stop_variable common_error_w common_error_v"
    return Report("compare", text, record, numbers(f"program active {heads}", rows))


def _effect_record(effect: Effect) -> dict[str, Any]:
    errors = {"error": effect.omega, "velocity_error": effect.velocity}
    stop = effect.stop and asdict(effect.stop)
    end = {"steps": effect.steps, "ended": effect.ended, "stop": stop}
    return {"listing": listing_record(effect.listing), **errors, **end}


def _subset_record(effect: Effect) -> dict[str, Any]:
    common = dict(zip(("common_error", "common_velocity_error"), effect.common, strict=True))
    return _effect_record(effect) | common


def _stop(found: Effect) -> str:
    if found.stop is not None:
        return f"{found.stop.variable}@{found.stop.step}"
    return f"ovf@{found.steps}" if found.ended == "overflow" else "-"

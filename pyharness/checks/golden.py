"""The golden record: an earlier version's trajectories, in a file for each program or method.

An entry has the command that prints a trajectory, its ending, a digest of all rows, and four rows
of hexadecimal floats: the first, tenth and last, and the mean of all.
"""

import hashlib
import math
import platform
import shlex
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pyharness.checks.check import RECORD, Attempt, Check, Name, Selection
from pyharness.checks.compare.agreement import ulps
from pyharness.checks.compare.candidates import method_candidate, program_candidate
from pyharness.checks.theory.conditioning import FLOW, conditioning
from pyharness.engine.plan.registry import METHODS, SCIPY_METHODS
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.pipes import read_input
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene, toml_of
from pyharness.model.schema import SCHEMAS, check_schema
from pyharness.model.trajectory import Array, Trajectory

_ANEW = "verify --update writes it anew"
_MARK = "# Written by: python -m pyharness verify --update"
_STEPS = (1, 10)
_MEAN = "mean"
_RECORDED_METHODS = ("taylor", "closed-form", "gauss-4", "rk4", *SCIPY_METHODS)
_TOLERANCE = 1e-9
_LARGEST = 1 << 24  # largest size (bytes) of a file
_RECORD = Basis(
    "measured",
    "no bit of a recorded result may differ",
    "the run of an earlier version, by `pyharness verify --update`",
)
_TWICE = Basis(
    "derived",
    "difference of two results with a tolerance: twice the tolerance",
    "each result differs from the solution by at most its tolerance (`checks/golden.py`)",
)
_KEYS = ("command", "ended", "steps", "evaluations", "stop", "digest")


@dataclass(frozen=True)
class Recorded:
    source: str  # program or method, which is the name of the file
    name: str  # last parts of the check's id, as in ``case-3/original``
    command: str  # the command that prints it
    scene: Scene
    tolerance: float | None  # None if every bit is compared

    def run(self) -> Trajectory:
        if self.source in PROGRAMS:
            is_original = self.name.endswith("original")
            listing = (Listing.original if is_original else Listing.corrected)(self.source)
            return program_candidate(listing).rows(self.scene)
        return method_candidate(self.source, self.tolerance or 1.0).rows(self.scene)


def recorded() -> Iterator[Recorded]:
    for case in case_numbers():
        scene = case_scene(case)
        command = f"python -m pyharness run --case {case}"
        for program, label in product(PROGRAMS, ("original", "corrected")):
            printed = f"{command} --program {program} --listing {label}"
            yield Recorded(program, f"case-{case}/{label}", printed, scene, None)
        for name in _RECORDED_METHODS:
            if name == "closed-form" and closed_form(scene) is None:
                continue
            tolerance = max(METHODS[name].finest, _TOLERANCE)
            printed = f"{command} --method {name} --tolerance {tolerance:g}"
            stated = None if tolerance == 1.0 else tolerance
            yield Recorded(name, f"case-{case}", printed, scene, stated)


def golden(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks against the golden record, if its folder exists."""
    if not chosen.record.is_dir():
        return
    known = read_record(chosen.record)
    entries = {entry["command"]: entry for file in known.values() for entry in file["trajectory"]}
    libraries = {file["mathematics"] for file in known.values()}
    due = list(recorded())
    options = "" if chosen.record == RECORD else f" --record {shlex.quote(str(chosen.record))}"
    same_library = libraries == {mathematics()}
    for each in due:
        name = Name("golden", each.source, each.name, options=options)
        yield Attempt(name, partial(_compared, each, entries.get(each.command), same_library))
    told = "is recorded and no longer produced; verify --update forgets it"
    for command in sorted(set(entries) - {each.command for each in due}):
        rest = command.partition(" run ")[2].replace("--", "").replace(" ", "-")
        source = next(s for s, file in known.items() if entries[command] in file["trajectory"])
        gone = Name("golden", source, rest, options=options)
        yield Attempt(gone, lambda name: name.judged(False, told))


def _compared(
    each: Recorded, entry: dict[str, Any] | None, same_library: bool, name: Name
) -> Check:
    if entry is None:
        return name.judged(False, "is not recorded; verify --update records it")
    run = each.run()
    now = _entry(each, run)
    if now == entry:
        return name.judged(True, "", 0.0, 0.0, _RECORD)
    moved = _moved(entry, now)
    waves = each.scene.law.sines + each.scene.law.cosines
    if each.tolerance is not None:  # processors and compilers round differently
        limit, basis = 2.0 * each.tolerance, _TWICE
    elif waves and not same_library:
        limit, basis = conditioning(each.scene, each.scene.times()[-1]).rounding, FLOW
    else:
        return name.judged(False, moved, limit=0.0, basis=_RECORD)
    old, new = _rows(entry), _rows(now)
    away = math.inf
    same_times = old.shape == new.shape and np.array_equal(old[:, :3], new[:, :3])
    if same_times and entry["ended"] == now["ended"]:
        scale = float(np.abs(run.omega).max(initial=0.0)) or 1.0
        away = float(np.abs(old[:, 3:6] - new[:, 3:6]).max(initial=0.0)) / scale
    return name.bounded(away, limit, basis, f"within its error: {moved}")


def read_record(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the record's parsed files by program or method; raise InputError if one is invalid."""
    found = {}
    places: dict[str, str] = {}
    for path in sorted(folder.glob("*.toml")):
        try:
            file = toml_of(read_input(path, "file", _LARGEST, "a record"), "file")
        except InputError as error:
            raise InputError(f"'{path}': is not a golden record ({error}); {_ANEW}") from None
        check_schema(f"'{path}'", "golden record", file.get("schema"), _ANEW)
        try:
            for entry in file["trajectory"]:
                _rows(entry)
                _ = [entry[key] for key in _KEYS]
                if place := places.get(entry["command"]):
                    raise ValueError(f"'{entry['command']}' is in '{place}' too")
                places[entry["command"]] = path.name
            _ = file["mathematics"]
            found[path.stem] = file
        except (OSError, ValueError, KeyError, TypeError) as error:
            told = " ".join(str(error).split()) or "empty"
            raise InputError(f"'{path}': is not a golden record ({told}); {_ANEW}") from None
    return found


def files_made(folder: Path) -> set[str]:
    """Return the names of the files in `folder` that `verify --update` made.

    Damaged files are included if at least one is intact.
    """
    found = set()
    for path in folder.glob("*.toml"):
        with suppress(InputError):
            if _MARK.encode() in read_input(path, "file", _LARGEST, "a record"):
                found.add(path.name)
    return found | {f"{each.source}.toml" for each in recorded()} if found else found


def update(folder: Path) -> tuple[dict[str, bytes], list[str]]:
    """Return a new golden record's files by name, and its differences from the old one."""
    known: dict[str, dict[str, Any]] = {}
    # If the old record is damaged, every trajectory counts as new.
    with suppress(InputError):
        known = read_record(folder) if folder.is_dir() else {}
    entries = {entry["command"]: entry for file in known.values() for entry in file["trajectory"]}
    files: dict[str, list[dict[str, Any]]] = {}
    news = []
    for each in recorded():
        now = _entry(each, each.run())
        files.setdefault(each.source, []).append(now)
        before = entries.pop(each.command, None)
        if before is None:
            news.append(f"new: {each.command}")
        elif before != now:
            news.append(f"moved: {each.command}: {_moved(before, now)}")
    news += [f"gone: {command}" for command in entries]
    return {f"{name}.toml": _text(name, rows).encode() for name, rows in files.items()}, news


def mathematics() -> str:
    """Return names and versions of the C library and the machine, on which sines depend."""
    return " ".join([*platform.libc_ver(), platform.system(), platform.machine()]).strip()


def _entry(each: Recorded, run: Trajectory) -> dict[str, Any]:
    columns = [run.time, run.recorded_time, run.omega, run.velocity]
    rows = np.column_stack([column for column in columns if column is not None])
    n = len(rows)
    shown = sorted({step for step in (*_STEPS, n) if 1 <= step <= n})
    stop = run.stop
    # Cumulative sums, so that the mean has the same bits on every processor.
    means = np.cumsum(rows / max(1, n), axis=0)[-1:]
    digest = hashlib.sha256(np.where(np.isnan(rows), np.nan, rows).astype("<f8").tobytes())
    if run.ier is not None:
        digest.update(run.ier.astype("<i4").tobytes())
    return {
        "command": each.command,
        "ended": run.ended,
        "steps": run.steps,
        "evaluations": run.evaluations,
        "stop": "" if stop is None else f"{stop.step} {stop.variable} {stop.quotient.hex()}",
        "digest": digest.hexdigest()[:32],
        "rows": [
            *([str(step), *map(float.hex, rows[step - 1].tolist())] for step in shown),
            *([_MEAN, *map(float.hex, mean)] for mean in means.tolist()),
        ],
    }


def _rows(entry: dict[str, Any]) -> Array:
    """Return an entry's rows: step, time, printed time, omega and, for programs, velocity."""
    return np.array(
        [
            [0.0 if row[0] == _MEAN else float(row[0]), *map(float.fromhex, row[1:])]
            for row in entry["rows"]
        ]
    )


def _moved(old: dict[str, Any], new: dict[str, Any]) -> str:
    changed = [key for key in ("ended", "steps", "evaluations", "stop") if old[key] != new[key]]
    parts = [f"{key} {old[key] or 'none'} -> {new[key] or 'none'}" for key in changed]
    before, after = _rows(old), _rows(new)
    if before.shape == after.shape:
        names = ("time", "TIME", "omega", "velocity")
        for name, first, last in zip(names, (1, 2, 3, 6), (2, 3, 6, 9), strict=True):
            away = ulps(before[:, first:last], after[:, first:last])
            if away:
                parts.append(f"{name} by {away:.4g} ulp")
    return ", ".join(parts) or "between the rows that are shown"


def _text(name: str, entries: list[dict[str, Any]]) -> str:
    kind = "program" if name in PROGRAMS else "method"
    lines = [
        f"# The {kind} {name}: step, time, TIME, omega, velocity (programs); mean.",
        _MARK,
        f"schema = {SCHEMAS['golden record']}",
        f'mathematics = "{mathematics()}"',
    ]
    for entry in entries:
        lines += ["", "[[trajectory]]"]
        for key in _KEYS:
            value = entry[key]
            lines.append(f"{key} = {value}" if isinstance(value, int) else f'{key} = "{value}"')
        rows = ["  [" + ", ".join(f'"{x}"' for x in row) + "]," for row in entry["rows"]]
        lines += ["rows = [", *rows, "]"]
    return "\n".join(lines) + "\n"

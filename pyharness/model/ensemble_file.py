"""Files of ensembles: archives with an array for each attribute."""

import json
import os
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.archive import archive_of, checked_file, checked_path, read_archive
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.fields import ENSEMBLE_ROWS
from pyharness.model.json_text import unique
from pyharness.model.output_files import write_files
from pyharness.model.schema import SCHEMAS
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from pyharness.model.ensemble import Ensemble

_KIND = "pyharness ensemble"
_FILE = "ensemble file"
_WRITTEN = "a file that Ensemble.save wrote"
_ARRAYS = (*ENSEMBLE_ROWS, "own", "status", "times", "t_end")
# Counts of events, shape (functions, bodies), -1 for a body without a result; times and states of
# all events, one after the other.
_EVENTS = ("event_counts", "t_events", "y_events")
_SENSITIVITY = "sensitivity_"


def save_ensemble(found: "Ensemble", path: str | os.PathLike[str]) -> None:
    arrays = {name: getattr(found, name) for name in _ARRAYS if getattr(found, name) is not None}
    names = list(found.sensitivities or ())
    for number, name in enumerate(names):
        arrays[f"{_SENSITIVITY}{number}"] = (found.sensitivities or {})[name]
    if found.t_events is not None and found.y_events is not None:
        rows = [[-1 if each is None else len(each) for each in row] for row in found.t_events]
        arrays[_EVENTS[0]] = np.array(rows, "i8").reshape(-1, len(found.omega))
        width = 3 if found.attitude is None else 7
        for name, empty in (("t_events", np.zeros(0)), ("y_events", np.zeros((0, width)))):
            parts = [each for row in getattr(found, name) for each in row if each is not None]
            arrays[name] = np.concatenate([empty, *parts])
    header = {
        "kind": _KIND,
        "schema": SCHEMAS[_FILE],
        "refusals": None if found.refusals is None else list(found.refusals.items()),
        "sensitivities": None if found.sensitivities is None else names,
        "names": found.names,
        "leaves": found.leaves,
    }
    name = checked_file(_FILE, path)
    write_files({name: archive_of({**arrays, "header": json.dumps(header)})}, _FILE)


def load_ensemble(path: str | os.PathLike[str]) -> dict[str, Any]:
    name = checked_path(_FILE, path)
    where = f"{_FILE} '{name}'"
    known = {*_ARRAYS, *_EVENTS, *(f"{_SENSITIVITY}{number}" for number in range(1000))}
    arrays, header = read_archive(where, name, (_KIND, "ensemble"), known, _WRITTEN)
    try:
        return _attributes(arrays, header)
    except Exception:  # of many types, from damaged values
        raise InputError(f"{where}: a value is missing or damaged; give {_WRITTEN}") from None


def _attributes(arrays: dict[str, Any], header: dict[str, Any]) -> dict[str, Any]:
    given: dict[str, Any] = {name: arrays.get(name) for name in _ARRAYS}
    rows = given["status"].shape
    given["names"] = tuple(unique((str(name), None) for name in header["names"]))
    leaves = header.get("leaves")  # files of earlier versions have none
    given["leaves"] = None if leaves is None else str(leaves)
    widths = {name: len(each.columns) for name, each in ENSEMBLE_ROWS.items()}
    for name, width in {**widths, "own": len(given["names"])}.items():
        array = given[name]
        if array is not None and (array.dtype, array.shape) != ("f8", (*rows, width)):
            raise ValueError("an array of another type or shape")
    status, times = given["status"], given["times"]
    if status.dtype != "i1" or not ((status >= 0) & (status < len(ENDS))).all():
        raise ValueError("an unknown status")
    if rows[1:] != (() if times is None else times.shape) or not len(rows) <= 2:
        raise ValueError("another number of times")
    if (ends := given["t_end"]) is not None and (ends.dtype, ends.shape) != ("f8", rows[:1]):
        raise ValueError("another number of final times")
    if header["refusals"] is not None:
        given["refusals"] = unique((body, str(reason)) for body, reason in header["refusals"])
        if not all(type(body) is int and 0 <= body < rows[0] for body in given["refusals"]):
            raise ValueError("refusals of unknown bodies")
    width = 3 if given["attitude"] is None else 7
    if header["sensitivities"] is not None:
        found = unique(
            (str(name), arrays[f"{_SENSITIVITY}{number}"])
            for number, name in enumerate(header["sensitivities"])
        )
        if any(each.dtype != "f8" or each.shape[:-1] != (*rows, width) for each in found.values()):
            raise ValueError("sensitivities of another shape")
        given["sensitivities"] = found
    if _EVENTS[0] in arrays:
        counts, times, states = (arrays[name] for name in _EVENTS)
        if counts.dtype != "i8" or counts.ndim != 2 or counts.shape[1] != rows[0]:
            raise ValueError("other numbers of events")
        given["t_events"] = _divided(times, counts, ())
        given["y_events"] = _divided(states, counts, (width,))
    return given


def _divided(array: Array, counts: Any, shape: tuple[int, ...]) -> list[list[Array | None]]:
    lengths = np.maximum(counts.ravel(), 0)
    ends = [0, *np.cumsum(lengths).tolist()]
    if array.dtype != "f8" or array.shape != (ends[-1], *shape) or counts.min(initial=0) < -1:
        raise ValueError("events of another type or shape")
    parts = [array[first:last] for first, last in pairwise(ends)]
    found = [None if n < 0 else part for n, part in zip(counts.flat, parts, strict=True)]
    functions, bodies = counts.shape
    return [found[k * bodies : (k + 1) * bodies] for k in range(functions)]

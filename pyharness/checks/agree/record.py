"""The record of the original's results, by which ports are compared where it can't run."""

import hashlib
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyharness.checks.agree.comparing import are_same, compare
from pyharness.checks.agree.plan import Plan
from pyharness.checks.agree.programs import digests
from pyharness.checks.agree.reading import Rows
from pyharness.model.errors import InputError
from pyharness.model.json_text import parse_json
from pyharness.model.output_files import write_files
from pyharness.model.pipes import read_input
from pyharness.model.schema import SCHEMAS, check_schema

_LARGEST = 1 << 28  # most bytes of a record
_ANEW = "--update REASON writes it anew"


def digest_of_inputs(plan: Plan) -> str:
    told: list[Any] = [plan.outputs.columns, plan.input_file]
    told += [[run.name, run.text, [*run.values.items()]] for run in plan.runs]
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def read_record(plan: Plan) -> list[Rows]:
    """Return the recorded rows; raise InputError if they are of other inputs."""
    data = _read(plan)
    if data["inputs"] != digest_of_inputs(plan):
        raise InputError(f"'{plan.record}': recorded with other inputs or columns; {_ANEW}")
    try:
        rows = [[[_value(x) for x in row] for row in each] for each in data["rows"]]
    except (AttributeError, TypeError, ValueError):
        rows = []
    width = len(plan.outputs.columns)
    if len(rows) != len(plan.runs) or any(len(row) != width for each in rows for row in each):
        raise InputError(f"'{plan.record}': no record of results; {_ANEW}")
    return rows


def update_record(plan: Plan, rows: Sequence[Rows], reason: str) -> list[str]:
    """Write the record, and return lines on what changed."""
    assert plan.record is not None
    changes: list[dict[str, Any]] = []
    told = "first record"
    if plan.record.exists():
        data = _read(plan)
        changes = data["changes"]
        told = "other inputs or columns"
        if data["inputs"] == digest_of_inputs(plan):
            old = read_record(plan)
            if are_same(old, rows):
                return ["nothing changed; the record is as it was"]
            found = compare(plan, old, rows)
            cells = sum(each.differ for each in found.columns)
            told = f"{cells} cells changed; first {found.first_difference}"
    changes.append({"reason": reason, "change": told})
    program = plan.original
    build = {"compiler": _version(program.compiler), "flags": [*program.flags]}
    data = {
        "schema": SCHEMAS["result record"], "original": program.name, "build": build,
        "digests": digests(program), "inputs": digest_of_inputs(plan), "changes": changes,
        "rows": [[[_text(x) for x in row] for row in each] for each in rows],
    }  # fmt: skip
    write_files({str(plan.record): (json.dumps(data, indent=1) + "\n").encode()}, "record")
    return [f"recorded: {told} ({reason})"]


def _read(plan: Plan) -> Any:
    where = f"'{plan.record}'"
    assert plan.record is not None
    try:
        data = parse_json(read_input(plan.record, where, _LARGEST, "a record"))
        check_schema(where, "result record", data.get("schema"), _ANEW)
        if {"inputs", "rows", "changes"} <= data.keys():
            return data
    except (ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
    raise InputError(f"{where}: no record of results; {_ANEW}")


def _text(value: float | str) -> str:
    return value.hex() if isinstance(value, float) else f"={value}"


def _value(text: str) -> float | str:
    return text[1:] if text.startswith("=") else float.fromhex(text)


def _version(compiler: str) -> str:
    if not compiler:
        return ""
    try:
        done = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return compiler
    return (done.stdout.splitlines() or [compiler])[0]


def is_recorded(plan: Plan) -> bool:
    return plan.record is not None and Path(plan.record).exists()

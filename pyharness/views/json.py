"""The data of a report as strict JSON."""

import json
import math
from typing import Any

from pyharness.model.report import Report

SCHEMA = 1


def write(report: Report) -> str:
    """Return a report's data as one line of JSON, with the schema number."""
    return json_text({"schema": SCHEMA, **report.record()})


def json_text(record: dict[str, Any], indent: int | None = None) -> str:
    """Return strict JSON, in one line or indented.

    Floats can be read back exactly; NaN and infinity become null.
    """
    try:
        return json.dumps(record, allow_nan=False, indent=indent) + "\n"
    except ValueError:
        return json.dumps(_finite(record), allow_nan=False, indent=indent) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value

"""The data of a report as strict JSON, in which all numbers are finite."""

import json
import math
from typing import Any

from pyharness.model.report import Report

SCHEMA = 1


def write(report: Report) -> str:
    """Return the data of a command's report as one line of JSON, with the number of its schema.

    This number identifies the version of the JSON schema.
    """
    return json_text({"schema": SCHEMA, **report.record()})


def json_text(record: dict[str, Any], indent: int | None = None) -> str:
    """Return a dictionary as strict JSON, in one line or with `indent` blanks for each level.

    Floats are written so that they can be read back exactly. A number that is not finite becomes
    null, because strict JSON can't represent it.
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

"""Reading and checking of the reductions that a sweep file requests."""

import math
from collections.abc import Mapping

from pyharness.engine.registry import METHODS
from pyharness.model.errors import InputError, unknown
from pyharness.model.values import integer, number, three
from pyharness.sweep.attitude_reductions import RANKS
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.sweep import ReductionSpec

_MOST_SAMPLES = 10_000


def reduction_spec_of(entry: object, claims: Mapping[str, str]) -> ReductionSpec:
    """Return the reduction of an entry, a name or a table; raise InputError if it is invalid.

    `claims` maps each claim to the function that checks it, as in ``package.module:name``.
    """
    table = {"name": entry} if isinstance(entry, str) else entry
    if not isinstance(table, dict) or "name" not in table:
        raise InputError("reductions: allowed: names, and tables with name and parameters")
    name = table["name"]
    if not isinstance(name, str) or name not in REDUCTIONS:
        raise unknown("reduction", name, REDUCTIONS, "reductions")
    where, defaults = f"reductions: {name}", REDUCTIONS[name].parameters
    for key in table:
        if key not in ("name", "as", *defaults):
            raise unknown("parameter", key, ("as", *defaults), where)
    given = {key: table.get(key, default) for key, default in defaults.items()}
    if (
        "samples" in given
        and not 1 <= integer(f"{where} samples", given["samples"]) <= _MOST_SAMPLES
    ):
        raise InputError(f"{where} samples {given['samples']}; allowed: 1 to {_MOST_SAMPLES}")
    if "offset" in given and not 0.0 < number(f"{where} offset", given["offset"]) <= 1.0:
        raise InputError(f"{where} offset {given['offset']:g}; allowed: above 0, to 1")
    if "of" in given and given["of"] not in RANKS:
        raise unknown("axis", given["of"], RANKS, f"{where} of")
    if "above" in given and not 0.0 <= number(f"{where} above", given["above"]) <= math.pi:
        raise InputError(f"{where} above {given['above']:g}; allowed: 0 to pi, rad")
    if "towards" in table:
        given["towards"] = three(f"{where} towards", table["towards"])
        if not any(given["towards"]):
            raise InputError(f"{where} towards: allowed: three finite numbers, not all 0")
    if "against" in given:
        if not isinstance(given["against"], str) or given["against"] not in METHODS:
            raise unknown("method", given["against"], METHODS, f"{where} against")
        if not 0.0 < number(f"{where} tolerance", given["tolerance"]) <= 1.0:
            raise InputError(f"{where} tolerance {given['tolerance']:g}; allowed: above 0, to 1")
    function, title = "", name
    if "id" in given:
        if not isinstance(given["id"], str) or given["id"] not in claims:
            raise unknown("claim", given["id"], claims or ["none"], f"{where} id")
        function, title = claims[given["id"]], f"claim-{given['id']}"
    title = table.get("as", title)
    if not isinstance(title, str) or not title.replace("-", "").replace("_", "").isalnum():
        raise InputError(f"{where} as: allowed: a name of letters, digits and '-'")
    return ReductionSpec(title, name, tuple(given.items()), function)

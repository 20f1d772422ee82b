"""Write the cases of the interpreter of recorded operations.

The cases are macros, from the table in pyharness/model/recurrences.py. The letters o, p and q stand
for results, x and y for operands: pointers to terms in TERM_CASES, numbers of slots elsewhere.
"""

import re
from typing import Any

from pyharness.model.codes import Operations
from pyharness.model.recurrences import OPERATIONS, WAVE


def terms(operation: Any) -> list[str]:
    """Return the statements that compute term k of the results."""
    found = []
    for line in operation.series:
        text = re.sub(r"(\w+) \? 0\.0 : (.*)", r"UNLESS(\1, \2)", line)
        for number, (x, y) in enumerate(operation.pairs):
            text = text.replace(f"s{number}", f"SUM({x}, {y})")
        for letter, place in {"t": "k", "b": "k - 1", "z": "0", "f": "1"}.items():
            text = re.sub(rf"\b{letter}_(\w)\b", rf"\1[{place}]", text)
        found.append(re.sub(r"\bi\*", "per_k*", re.sub(r"\bk\*", "whole*", text)))
    return found


def slopes(operation: Any) -> list[str]:
    """Return the statements that compute the value and the slopes at a node."""
    texts = zip(("m_o", "by_x", "by_y"), (operation.value, *operation.slopes), strict=False)
    found = [f"{name} = {text}" for name, text in texts if text]
    if operation.second:
        found.append(f"second_by_x = {operation.second}")
    return [re.sub(r"\bm_(\w)\b", r"m[\1]", each) for each in found]


def roundings(operation: Any, is_exact: bool) -> list[str]:
    """Return the statements that bound the rounding errors of the results."""
    by_slot = {"o": operation.slopes, "p": (operation.second,) * bool(operation.second)}
    found = []
    for slot, texts in by_slot.items():
        if slot == "o" or texts:
            parts = [operation.rounding.replace("z_o", f"z_{slot}")]
            if not is_exact:
                pairs = zip(texts, "xy", strict=False)
                parts += [f"size({text.replace('m_', 'z_')})*e[{x}]" for text, x in pairs]
            text = " + ".join(parts).replace("slope_of_root", "slope_at_root")
            found.append(f"e[{slot}] = zero + " + re.sub(r"\bz_(\w)\b", r"a[\1][0]", text))
    return found


def texts() -> dict[str, str]:
    """Return the text of the header by its file."""
    names = {value: name for name, value in vars(Operations).items() if name.isupper()}
    table = {(names | {WAVE: "WAVE"})[kind]: each for kind, each in OPERATIONS.items()}
    # Products are computed together, and tables before.
    others = {name: each for name, each in table.items() if name not in ("PRODUCT", "TABLE")}
    statements = {
        "PAIR_CASES": {
            name: [f"add_pair(work, {pair[0]}, {pair[1]})" for pair in each.pairs]
            for name, each in others.items()
        },
        "TERM_CASES": {name: terms(each) for name, each in others.items()},
        "SLOPE_CASES": {name: slopes(each) for name, each in table.items()},
        "SLOPE_SERIES_CASES": {
            name: [f"slope = {each.slopes[0][2:]}"]
            for name, each in table.items()
            if name != "WAVE" and len(each.slopes) == 1 and each.slopes[0].startswith("m_")
        },
        "ROUNDING_CASES": {name: roundings(each, name == "WAVE") for name, each in table.items()},
        "FUNCTION_CASES": {
            name: [f"return {each.function}"] * bool(each.function) for name, each in table.items()
        },
    }
    kinds = {
        "HAS_OWN_VALUE": [name for name, each in table.items() if each.value],
        "READS_SECOND": [name for name, each in table.items() if "m_p" in each.slopes],
    }
    lines = [f"/* Written by fortran/make_cases.py. */\nenum {{ WAVE = {WAVE} }};"]
    for name, some in kinds.items():
        lines.append(f"#define {name}(kind) ({' || '.join(f'kind == {each}' for each in some)})")
    for name, cases in statements.items():
        labels: dict[str, list[str]] = {}
        for kind, found in cases.items():
            labels.setdefault("; ".join(found), []).append(f"case {kind}:")
        each = [f"{' '.join(of)} {text}; break;" for text, of in labels.items() if text]
        lines.append(" \\\n  ".join([f"#define {name}", *each]))
    return {"cases.h": "\n".join(lines) + "\n"}

"""Short representations of results."""

import textwrap
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

_WIDTH, _LINES = 100, 10
_LONGEST = 60  # most characters of one value


def short_repr(result: Any) -> str:
    """Return a result as at most ten lines, with arrays by type and shape."""
    shown = [
        f"{each.name}={_short(value)}"
        for each in fields(result)
        if each.repr and (value := getattr(result, each.name)) is not None
    ]
    text = f"{type(result).__name__}({', '.join(shown)})"
    lines = textwrap.wrap(
        text, _WIDTH, subsequent_indent="  ", max_lines=_LINES, placeholder=" ...)",
        break_on_hyphens=False,
    )  # fmt: skip
    return "\n".join(lines)


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<{value.dtype} {value.shape}>"
    if isinstance(value, (tuple, list)) and value and is_dataclass(value[0]):
        return f"<{len(value)} {type(value[0]).__name__}>"
    name = getattr(value, "name", None)
    if is_dataclass(value):
        return f"<{type(value).__name__}{f' {name!r}' if isinstance(name, str) else ''}>"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."

"""The facts of `pyharness/data`, read once each; every file names its source."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent.parent / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of ``data/<name>.toml``; callers must not change it."""
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)

"""Facts about the thesis, with sources, from `pyharness/data`."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

SHIPPED = ("web", "fortran", "codemeta.json", "CITATION.cff", "LICENSE")
"""Names in the folder `data` of an installed package; in a checkout, beside the package."""

_PACKAGE = Path(__file__).parent.parent
_FOLDER = _PACKAGE / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of ``data/<name>.toml``, which callers must not change."""
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def facts_folder() -> Path:
    return _FOLDER


def shipped(name: str) -> Path:
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

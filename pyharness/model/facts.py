"""Facts about the thesis from the TOML files in `pyharness/data`.

Each file is read once, and names the source of its facts.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent.parent
_FOLDER = _PACKAGE / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of ``data/<name>.toml``, which callers must not change."""
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def shipped(name: str) -> Path:
    """Return the path of a project folder without Python code, as in ``fortran/original``.

    `name` is ``docs``, ``web`` or a folder in ``fortran``. An installed package contains all of
    these but ``docs``. A checkout has them beside the package.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

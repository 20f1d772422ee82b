"""Facts about the thesis from the TOML files in `pyharness/data`.

Each file names the sources of its facts, and is read at most once in a process.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent.parent
_FOLDER = _PACKAGE / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of ``data/<name>.toml`` as a dictionary.

    The dictionary is cached, so callers must not change it.
    """
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def shipped(name: str) -> Path:
    """Return the path of a folder of the project outside the package, as in ``fortran/original``.

    `name` is ``docs``, ``web`` or a folder in ``fortran``. An installed package contains these
    folders in its folder ``data``, except ``docs``. In a checkout they are beside the package.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

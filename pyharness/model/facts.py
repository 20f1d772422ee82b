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
    """Return the content of the file ``data/<name>.toml`` of this package as a dictionary.

    The dictionary is cached, so callers must not change it.
    """
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def data_text(name: str) -> str:
    """Return the content of the text file ``data/<name>`` of this package."""
    return (_FOLDER / name).read_text(encoding="utf-8")


def shipped(name: str) -> Path:
    """Return the path of a project folder that a checkout has beside the Python package.

    `name` is ``docs``, ``web`` or a folder in ``fortran``, as in ``fortran/original``. An installed
    package contains these folders, except ``docs``, in its folder ``data``.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

"""Facts about the thesis from the TOML files in `pyharness/data`.

Each file names the sources of its facts, and is read at most once in a process.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

SHIPPED = ("web", "fortran", "codemeta.json", "CITATION.cff", "LICENSE")
"""What an installed package has in its folder `data`, and a checkout beside the Python package."""

_PACKAGE = Path(__file__).parent.parent
_FOLDER = _PACKAGE / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of the file ``data/<name>.toml`` of this package as a dictionary.

    The dictionary is cached, so callers must not change it.
    """
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def facts_folder() -> Path:
    """Return the path of the folder `data` of this package, which has the facts.

    In an installed package the folder also contains the files and folders `SHIPPED`.
    """
    return _FOLDER


def shipped(name: str) -> Path:
    """Return the path of a file or folder that a checkout has beside the Python package.

    `name` is ``docs``, one of `SHIPPED`, or a folder in one of them, as in ``fortran/original``. An
    installed package contains these files and folders, except ``docs``, in its folder ``data``.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

"""The facts of `pyharness/data`, read once each; every file names its source."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent.parent
_FOLDER = _PACKAGE / "data"


@cache
def facts(name: str) -> dict[str, Any]:
    """Return the content of ``data/<name>.toml``; callers must not change it."""
    with open(_FOLDER / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def shipped(name: str) -> Path:
    """Return a folder of the project that is no package: ``docs``, ``fortran/original``, ``web``.

    An installed package brings along all but ``docs``; a checkout has them beside the package.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

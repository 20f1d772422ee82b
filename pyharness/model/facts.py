"""Facts from the TOML files in `pyharness/data`; each file is read once and names its source."""

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
    """Return a project folder that is no package: ``docs``, ``fortran/original`` or ``web``.

    An installed package contains all of these but ``docs``. A checkout has them beside the package.
    """
    installed = _FOLDER / name
    return installed if installed.exists() else _PACKAGE.parent / name

"""The build backend: meson-python's, but it refuses an editable install that no import survives.

An editable install runs ninja at each import, with the NumPy that it was configured with. Both are
of the isolated environment that pip, or uv, removes when the installation is done.
"""

import subprocess
import sys
from pathlib import Path
from typing import Any

import mesonpy
from mesonpy import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
)

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable",
    "get_requires_for_build_sdist", "get_requires_for_build_wheel",
]  # fmt: skip


def get_requires_for_build_editable(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Return what an editable install needs; SystemExit, with one line, in isolation."""
    if _isolated():
        print(
            "an editable install needs its build tools at each import, and build isolation removes "
            "them: run 'make .venv/ready', or 'pip install --group build && "
            "pip install --no-build-isolation --editable .'"
        )
        raise SystemExit(1)
    needed: list[str] = mesonpy.get_requires_for_build_editable(config_settings)
    return needed


def _isolated() -> bool:
    """Whether the build tools are in an environment that is removed after the build."""
    # uv makes an environment of its own; pip adds a folder to the path of this process alone.
    if Path(sys.prefix).parent.name.startswith("builds-v"):
        return True
    command = [sys.executable, "-E", "-c", "import mesonpy; print(mesonpy.__file__)"]
    later = subprocess.run(command, capture_output=True, text=True, check=False)
    return later.stdout.strip() != mesonpy.__file__

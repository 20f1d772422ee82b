"""The build backend: meson-python's, but it refuses an editable install in build isolation.

At each import such an install runs ninja and NumPy of an environment that has been removed by then.
"""

import subprocess
import sys
from pathlib import Path
from typing import Any

import mesonpy


def __getattr__(name: str) -> Any:
    return getattr(mesonpy, name)


def get_requires_for_build_editable(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Return what an editable install needs; SystemExit, with one line, in isolation."""
    # uv makes an environment of its own; pip adds a folder to the path of this process alone.
    isolated = Path(sys.prefix).parent.name.startswith("builds-v")
    command = [sys.executable, "-E", "-c", "import mesonpy; print(mesonpy.__file__)"]
    later = subprocess.run(command, capture_output=True, text=True, check=False)
    if isolated or later.stdout.strip() != mesonpy.__file__:
        sys.exit(
            "an editable install needs its build tools at each import, and build isolation removes "
            "them: run 'make .venv/ready', or 'pip install --group build && "
            "pip install --no-build-isolation --editable .'"
        )
    return mesonpy.get_requires_for_build_editable(config_settings)

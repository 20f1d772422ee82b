"""The build backend: meson-python's, with metadata and a progress of its own.

meson-python compiles to answer what the metadata are, so that pip seems to hang. An editable
install in build isolation is refused: at each import it runs ninja and NumPy of an environment that
has been removed by then.
"""

import os
import re
import subprocess
import sys
import threading
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TextIO
from zipfile import ZipFile

import mesonpy
from build_progress import watch
from packaging.version import Version

_SECONDS = 10.0  # between two lines of progress


def __getattr__(name: str) -> Any:
    return getattr(mesonpy, name)


def prepare_metadata_for_build_wheel(
    metadata_directory: str, config_settings: dict[str, Any] | None = None
) -> str:
    """Write the metadata that the wheel will have, without compiling; return their folder."""
    project = tomllib.loads(Path("pyproject.toml").read_text())
    metadata = mesonpy.Metadata.from_pyproject(project, Path.cwd())
    version = re.search(r"^  version: '(.*)'", Path("meson.build").read_text(), re.MULTILINE)
    assert version is not None
    metadata.version = Version(version[1])
    folder = Path(metadata_directory, f"{metadata.distribution_name}-{version[1]}.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_bytes(bytes(metadata.as_rfc822()))
    scripts = (f"{name} = {place}\n" for name, place in metadata.scripts.items())
    (folder / "entry_points.txt").write_text(f"[console_scripts]\n{''.join(scripts)}\n")
    return folder.name


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_wheel(
    wheel_directory: str,
    config_settings: dict[str, Any] | None = None,
    metadata_directory: str | None = None,
) -> str:
    """Build a wheel; where pip runs at a terminal, print the progress there."""
    settings = dict(config_settings or {})
    with TemporaryDirectory(prefix=".mesonpy-", dir=os.curdir) as folder:
        place = settings.setdefault("build-dir", settings.pop("builddir", folder))
        if terminal := _terminal_of_pip():
            threading.Thread(target=_tell, args=(terminal, place), daemon=True).start()
        name = str(mesonpy.build_wheel(wheel_directory, settings, metadata_directory))
    _compress(Path(wheel_directory, name))
    return name


def _compress(wheel: Path) -> None:
    """Write a wheel again at the highest level of compression."""
    with ZipFile(wheel) as archive:
        files = [(entry, archive.read(entry)) for entry in archive.infolist()]
    with ZipFile(wheel, "w") as archive:
        for entry, content in files:
            archive.writestr(entry, content, compresslevel=9)


def _terminal_of_pip() -> TextIO | None:
    """Return the terminal to which pip prints errors, if it runs this process and has one."""
    if "PIP_BUILD_TRACKER" not in os.environ:
        return None
    try:
        file = open(f"/proc/{os.getppid()}/fd/2", "w")  # noqa: SIM115
    except OSError:
        return None
    return file if file.isatty() else None


def _tell(terminal: TextIO, place: str) -> None:
    for line in watch(place, _SECONDS):
        # pip's spinner takes back the last character.
        terminal.write(f"\n    {line}  ")
        terminal.flush()


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

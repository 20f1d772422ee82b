"""How this installation was built, and what it stands on."""

import importlib.util
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass

OPTIONAL = {"matplotlib": "pictures: --plot"}


@dataclass(frozen=True)
class Build:
    """Versions and flags; `compiler` and `flags` are None where the extension is not built."""

    version: str
    compiler: str | None
    flags: str | None
    extension: str | None
    python: str
    numpy: str | None
    scipy: str | None
    platform: str


def build() -> Build:
    """Return how this installation was built."""
    compiler = flags = extension = None
    try:
        from pyharness import _build, _kernels

        compiler = f"{_build.COMPILER} {_build.COMPILER_VERSION}"
        flags = _build.FLAGS
        extension = os.path.relpath(_kernels.__file__)
    except ImportError:
        pass
    return Build(
        version=_version("pyharness") or "not installed",
        compiler=compiler,
        flags=flags,
        extension=extension,
        python=".".join(map(str, sys.version_info[:3])),
        numpy=_version("numpy"),
        scipy=_version("scipy"),
        platform=f"{sys.platform} {os.uname().machine}",
    )


def missing(packages: Iterable[str] = OPTIONAL) -> list[str]:
    """Return those of the optional packages that are not installed."""
    return [name for name in packages if importlib.util.find_spec(name) is None]


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None

"""Versions and build options of this installation, and the packages that it depends on."""

import importlib.util
import os
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass

from pyharness.model.distribution import DISTRIBUTION
from pyharness.model.report import Line, Report

OPTIONAL = {
    "matplotlib": "pictures: --plot",
    "zarr": "stores: sweep",
    "distributed": "clusters: sweep --executor dask",
}


@dataclass(frozen=True)
class Build:
    """The versions, the Fortran compiler and the compiler flags of one installation.

    `extension` is the path of the compiled extension module. If the extension is not built,
    `extension`, `compiler` and `flags` are None. `numpy` and `scipy` are None if the package is
    missing.
    """

    version: str
    compiler: str | None
    flags: str | None
    extension: str | None
    python: str
    numpy: str | None
    scipy: str | None
    platform: str


def build() -> Build:
    """Return the versions, the Fortran compiler and the compiler flags of this installation.

    A value is None if the extension, which records the compiler, or a package is missing.
    """
    compiler = flags = extension = None
    try:
        from pyharness import _build, _kernels

        compiler = f"{_build.COMPILER} {_build.COMPILER_VERSION}"
        flags = _build.FLAGS
        extension = os.path.relpath(_kernels.__file__)
    except ImportError:
        pass
    return Build(
        version=_version(DISTRIBUTION) or "not installed",
        compiler=compiler,
        flags=flags,
        extension=extension,
        python=".".join(map(str, sys.version_info[:3])),
        numpy=_version("numpy"),
        scipy=_version("scipy"),
        platform=f"{sys.platform} {os.uname().machine}",
    )


def machine(packages: Iterable[str]) -> dict[str, str]:
    """Return a description of this machine: processor, number of cores, and installed packages.

    The result is a dictionary with the keys "processor" and "cores". For each installed package
    among `packages` it also has the name of the package as a key, with the version as its value.
    """
    found = {"processor": _processor(), "cores": str(os.cpu_count())}
    return found | {name: text for name in packages if (text := _version(name)) is not None}


def _processor() -> str:
    import platform

    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


def doctor_report(build: Build) -> Report:
    """Return the report of the subcommand `doctor` about this installation.

    It shows the versions, the compiler and the compiler flags in `build`. For each optional package
    it shows whether the package is installed, and what it is needed for.
    """
    rows = {
        "pyharness": build.version,
        "extension": build.extension or "not built: 'make compare', or 'pip install .'",
        "Fortran compiler": build.compiler or "unknown, for nothing is built",
        "Fortran flags": build.flags or "unknown, for nothing is built",
        "Python": build.python,
        "NumPy": build.numpy or "missing",
        "SciPy": build.scipy or "missing",
        "platform": build.platform,
    }
    missing = [name for name in OPTIONAL if importlib.util.find_spec(name) is None]
    for package, purpose in OPTIONAL.items():
        state = f"missing: 'pip install {package}'" if package in missing else "installed"
        rows[package] = f"{state} ({purpose})"
    return Report(
        "doctor",
        text=[[Line(f"{name:18s}{told}") for name, told in rows.items()]],
        record=lambda: {"missing": missing, "build": asdict(build)},
    )

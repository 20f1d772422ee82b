"""Versions and build options of this installation."""

import os
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from pyharness.model.distribution import DISTRIBUTION
from pyharness.model.report import Line, Report

REQUIRED = ("mpmath", "fortranformat", "tqdm")
OPTIONAL = {
    "matplotlib": "pictures: --plot",
    "jinja2": "web pages: edition",
    "xarray": "results with names: sweep",
    "zarr": "stores: sweep",
    "distributed": "clusters: sweep --executor dask",
    "python-flint": "faster proofs: prove",
    "argcomplete": "completion in the shell",
}
"""Optional distributions, each with the part of the package that needs it."""

INFLUENCES = (
    "CC", "CFLAGS", "COLUMNS", "CPPFLAGS", "DASK_CONFIG", "FC", "FFLAGS", "GOTO_NUM_THREADS",
    "LANG", "LC_ALL", "LDFLAGS", "LD_LIBRARY_PATH", "LD_PRELOAD", "MKL_NUM_THREADS", "MPLBACKEND",
    "NO_COLOR", "NPY_DISABLE_CPU_FEATURES", "OMP_NUM_THREADS", "OPENBLAS_CORETYPE",
    "OPENBLAS_L2_SIZE", "PYTHONHASHSEED", "PYTHONHOME", "PYTHONOPTIMIZE", "PYTHONPATH",
    "PYTHONUTF8",
)  # fmt: skip
"""Environment variables that may change results, output, imports or builds."""

AS_WRITTEN = "as written"
"""The value of "arithmetic" in `installation` if nothing changes the kernels' arithmetic."""

_LEVELS = ("plain", "avx2", "avx512")


@dataclass(frozen=True)
class Build:
    version: str
    compiler: str | None
    flags: str | None
    extension: str | None
    python: str
    numpy: str | None
    scipy: str | None
    platform: str


def build() -> Build:
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


def installation() -> dict[str, Any]:
    """Return data on installation and machine for a bug report; unknown values are None."""
    has_affinity = hasattr(os, "sched_getaffinity")
    return {
        "folder": os.path.dirname(os.path.dirname(os.path.abspath(__file__))),
        "installer": _installer(),
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1,
        **_ask_kernels(),
        "packages": {name: _version(name) for name in (*REQUIRED, *OPTIONAL)},
        "environment": {name: os.environ[name] for name in INFLUENCES if name in os.environ},
    }


def _installer() -> str:
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        found = distribution(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"
    name = (found.read_text("INSTALLER") or "unknown").strip()
    is_editable = any(file.name.endswith("_editable_loader.py") for file in found.files or ())
    return f"{name}, editable" if is_editable else name


def _ask_kernels() -> dict[str, str | None]:
    try:
        from pyharness._kernels import arithmetic_faults, choose_instructions
    except ImportError:
        return {"instructions": None, "arithmetic": None}
    level = int(choose_instructions(-1))
    instructions = _LEVELS[level] if level >= 0 else "none that this processor has"
    is_changed, is_flushed = arithmetic_faults((5.0, 0.0, float("nan"), sys.float_info.min))
    faults = []
    if is_changed:
        faults.append("results may be wrong: built with an option such as -Ofast; build without")
    if is_flushed:
        faults.append("subnormal numbers become 0: a library was linked with -ffast-math")
    return {"instructions": instructions, "arithmetic": "; ".join(faults) or AS_WRITTEN}


def machine(packages: Iterable[str]) -> dict[str, str]:
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


def doctor_report(build: Build, here: dict[str, Any]) -> Report:
    rows = {
        "pyharness": build.version,
        "installed by": here["installer"],
        "folder": here["folder"],
        "extension": build.extension or "not built: 'make compare', or 'pip install .'",
        "Fortran compiler": build.compiler or "unknown, for nothing is built",
        "Fortran flags": build.flags or "unknown, for nothing is built",
        "Python": build.python,
        "NumPy": build.numpy or "missing",
        "SciPy": build.scipy or "missing",
        "platform": build.platform,
        "processor": f"{here['processor']}, {here['cores']} cores",
        "instructions": here["instructions"] or "unknown, for nothing is built",
        "arithmetic": here["arithmetic"] or "unknown, for nothing is built",
        "compiled torques": "{bytes} bytes in {folder}; compiler: {compiler}".format(
            **here["leaves"]
        ),
    }
    for name in REQUIRED:
        rows[name] = here["packages"][name] or f"missing: 'pip install {name}'"
    missing = [name for name in OPTIONAL if here["packages"][name] is None]
    for name, purpose in OPTIONAL.items():
        state = here["packages"][name] or f"missing: 'pip install {name}'"
        rows[name] = f"{state} ({purpose})"
    variables = (f"{name}={value}" for name, value in here["environment"].items())
    rows["environment"] = " ".join(variables) or "no variable that may change results"
    return Report(
        "doctor",
        text=[[Line(f"{name:18s}{value}") for name, value in rows.items()]],
        record=lambda: {"missing": missing, "build": asdict(build), "installation": here},
    )

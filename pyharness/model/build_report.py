"""The report of `doctor`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from pyharness.model.build import Build
from pyharness.model.report import Line, Report


def doctor_report(build: Build, optional: Mapping[str, str], missing: Sequence[str]) -> Report:
    """Report what is built, with what, and which of the optional packages are missing."""
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
    for package, purpose in optional.items():
        state = f"missing: 'pip install {package}'" if package in missing else "installed"
        rows[package] = f"{state} ({purpose})"
    return Report(
        "doctor",
        text=[[Line(f"{name:18s}{told}") for name, told in rows.items()]],
        record=lambda: {"missing": list(missing), "build": asdict(build)},
    )

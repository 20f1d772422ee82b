"""Builds of the cross-check, and checks that each build is what it claims to be."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
NOT_COPIED = shutil.ignore_patterns(".*_cache", ".git", ".venv", "build", "dist", "__pycache__")


@dataclass(frozen=True)
class Build:
    """One way to compile the project, and the tests to run after its bits have been compared."""

    name: str  # also the name of its folder
    compiler: str  # the compiler's command
    family: str  # meson's name for such a compiler
    optimization: str  # meson's level: 0, 2, 3
    flags: tuple[str, ...] = ()
    # For the original programs; ``fast`` shows that the comparison detects a compiler's fault.
    contract: str = "off"
    checked: bool = False  # with run-time checks, which need the compiler's library
    plants: tuple[tuple[str, str, str], ...] = ()  # file, passage, faulty passage
    faulty: bool = False  # made only to check that its faults are caught
    # Kernels for each instruction set have flags of their own, which override those of the build.
    instruction_sets: str = "plain"
    tests: tuple[str, ...] = ()


def make(build: Build, folder: Path) -> Path:
    """Copy the checkout into `folder`, build there, and put the extensions into its package.

    Raise RuntimeError with the end of the build's output if it fails.
    """
    tree = folder / build.name
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=NOT_COPIED)
    for file, old, new in build.plants:
        text = (tree / file).read_text()
        if text.count(old) != 1:
            raise RuntimeError(f"{old!r} stands {text.count(old)} times in {file}")
        (tree / file).write_text(text.replace(old, new))
    if build.checked:
        _fill_results_with_nan(tree)
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "FC": build.compiler,
        "FFLAGS": " ".join(build.flags),
    }
    options = [
        f"-Doptimization={build.optimization}",
        f"-Ddebug={str(build.checked).lower()}",
        f"-Dinstruction_sets={build.instruction_sets}",
    ]
    for command in (["meson", "setup", "build", *options], ["meson", "compile", "-C", "build"]):
        done = subprocess.run(
            command, cwd=tree, env=environment, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        if done.returncode:
            end = "\n".join(done.stdout.splitlines()[-20:])
            raise RuntimeError(f"{build.name}: {shlex.join(command)} failed\n{end}")
    for name in ("_kernels", "_many", "_solver"):
        (module,) = (
            path for path in (tree / "build").glob(f"{name}.*") if path.suffix in (".so", ".pyd")
        )
        shutil.copy2(module, tree / "pyharness")
    shutil.copy2(tree / "build" / "_build.py", tree / "pyharness")
    return tree


def _fill_results_with_nan(tree: Path) -> None:
    """Fill new results of f2py with NaN, and integers with -1, instead of zeros."""
    import numpy.f2py

    text = (Path(numpy.f2py.get_include()) / "fortranobject.c").read_text()
    zeros = "PyArray_FILLWBYTE(arr, 0);"
    # Fill those results too that f2py leaves uninitialised.
    unless = "if (!(intent & F2PY_INTENT_CACHE)) {"
    meson = (tree / "meson.build").read_text()
    place = "f2py_folder / 'fortranobject.c'"
    if zeros not in text or unless not in text or place not in meson:
        raise RuntimeError("numpy's fortranobject.c or meson.build is not as expected")
    text = text.replace(unless, "if (1) {").replace(zeros, zeros.replace("0)", "0xFF)"))
    (tree / "fortranobject.c").write_text(text)
    (tree / "meson.build").write_text(meson.replace(place, "'fortranobject.c'"))


def false_claims(build: Build, tree: Path, record: dict[str, str]) -> list[str]:
    """Return the ways in which a build is not what it claims.

    It compares the claims with the commands that meson ran and with the loaded extension's
    description of itself in `record`.
    """
    found = []
    if not Path(record["extension"]).resolve().is_relative_to(tree.resolve()):
        found.append(f"the extension was loaded from {record['extension']}")
    if record["compiler"].split()[0] != build.family:
        found.append(f"compiled by {record['compiler']}, not by {build.family}")
    said = record["flags"].split()
    expected = [f"-O{build.optimization}", *build.flags, f"-ffp-contract={build.contract}"]
    found += [f"_build.py does not tell of {flag}" for flag in expected if flag not in said]
    stems = tuple(f"{file.stem}_binary" for file in (ROOT / "fortran/original").glob("*.fypp"))
    commands = [
        each["command"].split()
        for each in json.loads((tree / "build" / "compile_commands.json").read_text())
        if Path(each["file"]).name.startswith(stems)
    ]
    if not commands:
        found.append("no file of the original programs was compiled")
    for words in commands:
        found += _wrong_words(build, words)
    return sorted(set(found))


def _wrong_words(build: Build, words: Sequence[str]) -> list[str]:
    found = []
    if Path(words[0]).name != Path(build.compiler).name:
        found.append(f"meson ran {words[0]}, not {build.compiler}")
    contract = ("-ffp-contract", f"-ffp-contract={build.contract}")
    # If there are several, compilers use the last one.
    for beginning, expected in (("-O", f"-O{build.optimization}"), contract):
        last = [word for word in words if word.startswith(beginning)][-1:]
        if last != [expected]:
            found.append(f"the original programs were compiled with {last}, not {expected}")
    found += [f"meson ran without {flag}" for flag in build.flags if flag not in words]
    return found


def environment(folder: Path) -> Path:
    """Make an environment with all packages of this one except the project; return its Python.

    An editable install puts its own finder before all folders. The second environment reads the
    first one's packages as a plain folder, and so has no such finder.
    """
    import sysconfig

    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    packages = Path(sysconfig.get_path("purelib"))
    target = folder / packages.relative_to(sys.prefix)
    (target / "packages.pth").write_text(f"{packages}\n")
    return folder / "bin" / "python"


def native_flag(compiler: str) -> str | None:
    """Return the option that compiles for this very processor, or None if there is none."""
    for flag in ("-march=native", "-mcpu=native"):
        command = [compiler, flag, "-fsyntax-only", "-x", "f95", os.devnull]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            return flag
    return None

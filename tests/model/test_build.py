"""The build: the parts of the binary, the types that f2py may not guess, the set-up's messages."""

import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import PathDistribution
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from pyharness import (
    NotBuiltError,
    _build,  # noqa: PLC2701
    case_scene,
    solve,
)
from pyharness.model import arithmetic, extension
from pyharness.model.arithmetic import check_compiler, check_options
from pyharness.model.build import build, installation
from tests.as_written import COMPILER
from tests.conftest import Patch, ResultOf
from tests.instruction_sets import LEVELS, level_of_processor

ROOT = Path(__file__).parent.parent.parent
LIBRARIES = ("gfortran", "quadmath", "flang", "FortranRuntime", "ifcore", "imf")


def _run(*command: str | Path, **more: Any) -> "subprocess.CompletedProcess[str]":
    words = [str(each) for each in command]
    return subprocess.run(words, capture_output=True, text=True, check=False, **more)


@pytest.mark.external
@pytest.mark.skipif("-fcheck" in (build().flags or ""), reason="run-time checks have messages")
def test_extension_needs_no_fortran_library_at_run_time() -> None:
    on_mac = sys.platform == "darwin"
    command = ("otool", "-L") if on_mac else ("readelf", "-d")
    lines = _run(*command, extension.extension().__file__ or "").stdout.splitlines()[1:]
    needed = "\n".join(line for line in lines if on_mac or "NEEDED" in line)
    assert "lib" in needed
    for library in LIBRARIES:
        assert library not in needed


def test_hot_kernels_are_built_for_this_processor_or_for_all() -> None:
    on_x86 = platform.machine().lower() in ("x86_64", "amd64")
    has_levels = on_x86 and _build.COMPILER == "gcc"
    native = LEVELS[level_of_processor() if has_levels else 0]
    built = sorted(_build.INSTRUCTION_SETS, key=LEVELS.index)
    assert built in ([native], [*LEVELS] if has_levels else ["plain"])


def test_a_build_for_another_processor_is_refused(monkeypatch: Patch, result_of: ResultOf) -> None:
    monkeypatch.setattr("pyharness._kernels.choose_instructions", lambda highest: -1)
    monkeypatch.setattr(_build, "INSTRUCTION_SETS", ("avx512",))
    extension._check_processor.cache_clear()
    try:
        with pytest.raises(NotBuiltError, match="built for avx512, which this processor lacks"):
            solve(case_scene(3), 1.0)
        assert "instructions      none that this processor has" in result_of(["doctor"]).out
    finally:
        extension._check_processor.cache_clear()


def test_an_extension_that_cannot_be_loaded_says_why(monkeypatch: Patch) -> None:
    monkeypatch.setattr(extension, "import_module", Mock(side_effect=ImportError("no symbol: f")))
    with pytest.raises(NotBuiltError, match=r"^the Fortran extension can't be loaded: no"):
        solve(case_scene(3), 1.0)


def test_flags_are_the_ones_that_keep_the_bits() -> None:
    flags: Any = build().flags
    assert "-ffp-contract=off" in flags or "-fp-model=strict" in flags
    assert "fast" not in flags


@pytest.mark.campaign
@pytest.mark.external
def test_kind_that_f2py_would_guess_fails_the_build(tmp_path: Path) -> None:
    """F2py maps an unknown kind to C float without an error; the build must not."""
    script = ROOT / "fortran/run_f2py.py"
    good = "subroutine s(x)\n  real(8), intent(in) :: x\nend subroutine s\n"
    bad = "subroutine s(x)\n  use k, only: dp\n  real(dp), intent(in) :: x\nend subroutine s\n"
    for text, code in ((good, 0), (bad, 1)):
        source = tmp_path / "x.f90"
        source.write_text(text)
        done = _run(sys.executable, script, "m", tmp_path, source)
        assert done.returncode == code, done.stderr
        assert ("is mapped to C" in done.stderr) == bool(code)


def _hook(*folders: Path) -> "subprocess.CompletedProcess[str]":
    """Run the build backend's hook for an editable install, with these folders on the path."""
    code = "import build_backend as b; print(b.get_requires_for_build_editable())"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
    return _run(sys.executable, "-c", code, env=environment)


@pytest.mark.campaign
def test_an_editable_install_in_build_isolation_is_refused(tmp_path: Path) -> None:
    """Pip puts the build tools into a folder on the path of the build alone, and removes it."""
    backend = ROOT / ".ci"
    kept = _hook(backend)
    assert kept.returncode == 0, kept.stderr
    assert kept.stdout.startswith("[")
    spec: Any = importlib.util.find_spec("mesonpy")
    (tmp_path / "mesonpy").symlink_to(Path(spec.origin or "").parent)
    refused = _hook(backend, tmp_path)
    assert refused.returncode == 1
    assert refused.stdout == ""
    (line,) = refused.stderr.splitlines()
    assert "'make .venv/ready'" in line
    assert "pip install --no-build-isolation --editable ." in line


CHANGING = (
    "-Ofast", "-ffast-math", "-funsafe-math-optimizations", "-ffinite-math-only",
    "-freciprocal-math", "-fno-signed-zeros", "-fcx-limited-range",
    "-fassociative-math -fno-signed-zeros -fno-trapping-math",
)  # fmt: skip
CHANGING_X86 = ("-mfpmath=387",)
CHANGING_C = ("-fsingle-precision-constant",)
CHANGING_FORTRAN = (
    "-fdefault-real-8", "-fdefault-real-8 -fdefault-double-8", "-fdefault-integer-8",
    "-freal-4-real-8", "-freal-8-real-4", "-freal-8-real-16", "-finteger-4-integer-8",
)  # fmt: skip
HARMLESS = ("", "-O3 -ffp-contract=fast -fno-trapping-math", "-frounding-math -fno-math-errno")


def _check(language: str, flags: str) -> str | None:
    of_fortran = language == "fortran"
    source = ROOT / "fortran/arithmetic.f90" if of_fortran else None
    return check_compiler([COMPILER if of_fortran else "cc", "-O2", *flags.split()], source)


def _changing() -> Iterator[tuple[str, str]]:
    x86 = CHANGING_X86 if platform.machine().lower() in ("x86_64", "amd64") else ()
    for language, own in (("c", CHANGING_C), ("fortran", CHANGING_FORTRAN)):
        yield from ((language, flags) for flags in (*CHANGING, *x86, *own))


@pytest.mark.external
@pytest.mark.skipif(_build.COMPILER != "gcc", reason="the options are those of gcc")
@pytest.mark.parametrize(("language", "flags"), [*_changing()])
def test_flags_that_change_the_arithmetic_are_refused(
    language: str, flags: str, monkeypatch: Patch
) -> None:
    """By name, and by what they do if a compiler's wrapper adds them."""
    named = flags.split()[-1] if "default-double" in flags else flags.split()[0]
    fault: Any = _check(language, flags)
    assert named in fault.partition(" changes the arithmetic: leave out ")[2]
    monkeypatch.setattr(arithmetic, "REFUSED", ("unnamed",) * 7)
    fault = _check(language, flags)
    assert fault.endswith(f"{flags}' changes the arithmetic: leave out options such as "
                          + ", ".join(arithmetic.REFUSED))  # fmt: skip


@pytest.mark.external
@pytest.mark.skipif(_build.COMPILER != "gcc", reason="the options are those of gcc")
@pytest.mark.parametrize("language", ["c", "fortran"])
@pytest.mark.parametrize("flags", HARMLESS)
def test_flags_that_keep_the_arithmetic_are_accepted(language: str, flags: str) -> None:
    assert _check(language, flags) is None


@pytest.mark.parametrize(
    ("installer", "files", "expected"),
    [("pip", ["_x_editable_loader.py", "x.pth"], "pip, editable"),
     ("uv", ["x.py", "_y_editable_loader.py"], "uv, editable"), ("uv", ["x.py"], "uv"),
     (None, [], "unknown")],
)  # fmt: skip
def test_an_editable_installation_is_one_that_loads_from_the_build(
    installer: str | None, files: list[str], expected: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    """The installer may be any, and the files those of the checkout or of what was built there."""
    facts = tmp_path / "x.dist-info"
    facts.mkdir()
    for each in files:
        (tmp_path / each).touch()
    (facts / "RECORD").write_text("".join(f"{each},,\n" for each in files))
    if installer:
        (facts / "INSTALLER").write_text(f"{installer}\n")
    monkeypatch.setattr("importlib.metadata.distribution", lambda _: PathDistribution(facts))
    assert installation()["installer"] == expected


@pytest.mark.parametrize(
    "flag", ["-mrecip", "-mrecip=all", "-fdefault-real-16", "-mfpmath=sse+387", "-mdaz-ftz",
             "-fp-model=fast=2", "-fdenormal-fp-math=preserve-sign,preserve-sign"],
)  # fmt: skip
def test_flags_that_change_it_elsewhere_are_refused_by_name(flag: str) -> None:
    """With other options, on other processors, or by other compilers."""
    fault: Any = check_options(["cc", "-g", flag, "-mfpmath=sse", "-fp-model=strict"])
    assert fault.endswith(f" changes the arithmetic: leave out {flag}")


@pytest.mark.external
def test_arithmetic_that_can_not_be_tested_is_no_fault(tmp_path: Path) -> None:
    """The check may lack a library of the compiler that the kernels do not need."""
    check = ROOT / "fortran/check_arithmetic.py"
    made = ROOT / "pyharness/model/arithmetic.py"
    source = tmp_path / "other.c"
    for text, status, words in (
        ("int absent(void); int arithmetic_faults(void) { return absent(); }", 0,
         "the arithmetic is not checked: what 'cc' compiles can't be loaded: "),
        ("int main(", 1, "'cc' does not compile other.c: "),
    ):  # fmt: skip
        source.write_text(text)
        done = _run(
            sys.executable, check, made, source, "cc", env=os.environ | {"LD_BIND_NOW": "1"}
        )
        assert (done.returncode, done.stderr) == (status, "")
        (line,) = done.stdout.splitlines()
        assert line.startswith(words)


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.skipif(_build.COMPILER != "gcc", reason="the options are those of gcc")
@pytest.mark.parametrize(
    ("variable", "flag"),
    [("CFLAGS", "-Ofast"), ("FFLAGS", "-Ofast"), ("LDFLAGS", "-ffast-math"), ("CC", "-mrecip"),
     ("FFLAGS", "-fdefault-real-8"), ("FC", "-freal-4-real-8")],
)  # fmt: skip
def test_a_build_with_such_flags_is_refused_in_one_line(
    variable: str, flag: str, tmp_path: Path
) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    compiler = {"CC": "cc ", "FC": f"{COMPILER} "}.get(variable, "")
    environment = os.environ | {"PATH": path, variable: compiler + flag}
    done = _run("meson", "setup", tmp_path / "build", ROOT, cwd=tmp_path, env=environment)
    assert done.returncode == 1
    (line,) = (each for each in done.stdout.splitlines() if "ERROR" in each)
    assert line.endswith(f" changes the arithmetic: leave out {flag}")


@pytest.mark.campaign
@pytest.mark.external
def test_a_build_without_a_fortran_compiler_says_so_in_one_line(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for tool in ("sh", "env", "cc", "gcc", "clang", "ld", "as", "ar", "uname"):
        if found := shutil.which(tool):
            (tools / tool).symlink_to(found)
    here = Path(sys.executable).parent
    environment = {"PATH": f"{here}{os.pathsep}{tools}", "HOME": os.environ.get("HOME", "/")}
    done = _run("meson", "setup", tmp_path / "build", ROOT, cwd=tmp_path, env=environment)
    assert done.returncode == 1
    (line,) = (each for each in done.stdout.splitlines() if "ERROR" in each)
    assert "no Fortran compiler is found: install one" in line
    assert "apt-get install gfortran" in line


@pytest.mark.campaign
@pytest.mark.external
def test_a_build_for_free_threads_is_refused_in_one_line(tmp_path: Path) -> None:
    """With a Python that says what a free-threaded one would say of itself."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sysconfig; sysconfig.get_config_vars()['Py_GIL_DISABLED'] = 1\n"
    )
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(tmp_path)}
    done = _run("meson", "setup", tmp_path / "build", ROOT, cwd=tmp_path, env=environment)
    assert done.returncode == 1
    (line,) = (each for each in done.stdout.splitlines() if "ERROR" in each)
    assert line.endswith("free-threaded Python is not tested here: take the one with a global "
                         "interpreter lock")  # fmt: skip


@pytest.mark.external
@pytest.mark.parametrize(
    ("statement", "missing"),
    [
        ("x(1) = 2*x(1)", ""),
        ("print *, x(1)", "_gfortran_st_write"),
        ("call elsewhere(x)", "_gfortran_internal_"),
        ("call elsewhere(x(1))", "elsewhere"),
    ],
)
def test_an_extension_that_cannot_be_loaded_fails_the_build(
    statement: str, missing: str, tmp_path: Path
) -> None:
    """Kernels are linked without libgfortran, which the linker does not say."""
    kernel, module, done = (tmp_path / name for name in ("kernel.f90", "kernel.so", "loads"))
    kernel.write_text(f"subroutine planted(x)\nreal(8) :: x(:)\n{statement}\nend subroutine\n")
    _run("gfortran", "-O0", "-fPIC", "-c", kernel, "-o", tmp_path / "kernel.o", cwd=tmp_path)
    _run("gcc", "-shared", tmp_path / "kernel.o", "-o", module, cwd=tmp_path)
    built = _run(sys.executable, ROOT / "fortran/check_loads.py", done, module, cwd=tmp_path)
    assert (built.returncode, done.exists()) == ((1, False) if missing else (0, True))
    assert missing in built.stderr
    assert ("the extension can't be loaded" in built.stderr) == bool(missing)


def test_the_build_loads_every_extension() -> None:
    text = (ROOT / "meson.build").read_text()
    modules = re.findall(r"(?:^(\w+) = )?py\.extension_module\(", text, re.MULTILINE)
    (command,) = re.findall(r"command: \[py, files\('fortran/check_loads.py'\), (.*)\]", text)
    assert modules == command.split(", ")[1:]


@pytest.mark.external
@pytest.mark.skipif(not (ROOT / ".ci/setup").exists(), reason="needs a checkout")
@pytest.mark.parametrize(
    ("python", "compiler", "words"),
    [(sys.executable, "gfortran", "apt-get install gfortran"),
     (sys.executable, "no-such-fortran", "no Fortran compiler 'no-such-fortran'"),
     ("no-such-python", "gfortran", "there is no 'no-such-python'")],
)  # fmt: skip
def test_setup_that_can_not_go_on_says_what_to_do(
    python: str, compiler: str, words: str, tmp_path: Path
) -> None:
    """Without a compiler, and if none may be installed, print a message with four commands only."""
    # A PATH with the tools that the script needs, and no compiler.
    tools = tmp_path / "bin"
    tools.mkdir()
    for tool in ("sh", "id", "mkdir", "rm", "grep", "tail", "env"):
        (tools / tool).symlink_to(shutil.which(tool) or "")
    environment = {"PATH": str(tools), "INSTALL": "no", "HOME": os.environ.get("HOME", "/")}
    done = _run(ROOT / ".ci/setup", python, compiler, cwd=tmp_path, env=environment)
    assert done.returncode == 1
    assert words in done.stderr
    assert "meson" not in done.stderr
    assert len(done.stderr.splitlines()) <= 4
    if python == sys.executable:
        for manager in ("apt-get", "dnf", "brew", "conda"):
            assert manager in done.stderr
    assert not (tmp_path / ".venv").exists()

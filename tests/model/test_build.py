"""The build: the parts of the binary, the types that f2py may not guess, the set-up's messages."""

import importlib.util
import os
import platform
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pyharness import _build  # noqa: PLC2701
from pyharness.model import extension
from pyharness.model.build import build
from tests.as_written import COMPILER
from tests.instruction_sets import LEVELS

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
    done = _run(*command, extension.extension().__file__ or "")
    lines = done.stdout.splitlines()[1:]
    needed = "\n".join(line for line in lines if on_mac or "NEEDED" in line)
    assert "lib" in needed
    for library in LIBRARIES:
        assert library not in needed


def test_hot_kernels_are_built_for_every_instruction_set() -> None:
    on_x86 = platform.machine().lower() in ("x86_64", "amd64")
    wanted = LEVELS if on_x86 and _build.COMPILER == "gcc" else LEVELS[:1]
    assert sorted(_build.INSTRUCTION_SETS) == sorted(wanted)


def test_flags_are_the_ones_that_keep_the_bits() -> None:
    flags = build().flags
    assert flags is not None
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
    spec = importlib.util.find_spec("mesonpy")
    assert spec is not None
    (tmp_path / "mesonpy").symlink_to(Path(spec.origin or "").parent)
    refused = _hook(backend, tmp_path)
    assert refused.returncode == 1
    assert refused.stdout == ""
    (line,) = refused.stderr.splitlines()
    assert "'make .venv/ready'" in line
    assert "pip install --no-build-isolation --editable ." in line


@pytest.mark.external
@pytest.mark.skipif(_build.COMPILER != "gcc", reason="the options are those of gcc")
@pytest.mark.parametrize("source", ["arithmetic.c", "arithmetic.f90"])
@pytest.mark.parametrize(
    "flags",
    ["-O3 -ffp-contract=fast -fno-trapping-math", "-Ofast", "-ffinite-math-only",
     "-freciprocal-math", "-fno-signed-zeros"],
)  # fmt: skip
def test_flags_that_change_the_arithmetic_are_found(source: str, flags: str) -> None:
    fault = runpy.run_path(str(ROOT / "fortran/check_arithmetic.py"))["fault"]
    compiler = "cc" if source.endswith("c") else COMPILER
    found = fault(str(ROOT / "fortran" / source), [compiler, "-O2", *flags.split()])
    assert (found is None) == ("-ffp-contract" in flags), found
    assert found is None or f"{flags}' removes or reorders operations" in found


@pytest.mark.external
def test_arithmetic_that_can_not_be_tested_is_no_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The test program may lack a library of the compiler that the kernels do not need."""
    fault = runpy.run_path(str(ROOT / "fortran/check_arithmetic.py"))["fault"]
    source = tmp_path / "fails.c"
    source.write_text("int main(void) { return 127; }\n")
    assert fault(str(source), ["cc"]) is None
    assert "its arithmetic is not tested" in capsys.readouterr().out
    source.write_text("int main(\n")
    assert "'cc' does not compile" in fault(str(source), ["cc"])


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.skipif(_build.COMPILER != "gcc", reason="the options are those of gcc")
@pytest.mark.parametrize("variable", ["CFLAGS", "FFLAGS"])
def test_a_build_with_such_flags_is_refused_in_one_line(variable: str, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, variable: "-Ofast"}
    done = _run("meson", "setup", tmp_path / "build", ROOT, cwd=tmp_path, env=environment)
    assert done.returncode == 1
    (line,) = (each for each in done.stdout.splitlines() if "ERROR" in each)
    assert "-Ofast" in line.partition("' removes or reorders operations")[0]
    assert "leave out options such as -Ofast, -ffast-math" in line


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

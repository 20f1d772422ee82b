"""The files that are compiled anew after a change, and vector code in those compiled."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pyharness.model import codes

ROOT = Path(__file__).parent.parent.parent
BUILDS = [path.parent for path in ROOT.glob("build/cp*/build.ninja")]
CODES = Path("pyharness/model/codes.py")
SERIES = ROOT / "fortran/modern/taylor_series.f90"
CLASSES = {name.lower() for name, each in vars(codes).items() if isinstance(each, type)}
NEEDED = re.compile(r'^ *(?:use +(\w+)|#include "(?:.*/)?(\w+\.h)")', re.MULTILINE)
PROVIDED = re.compile(r"^ *module (\w+)$", re.MULTILINE)


def _link(folder: Path, origin: Path, without: Path) -> None:
    """Fill a new folder with links to the entries of another, but for one file below it."""
    folder.mkdir(parents=True)
    for entry in origin.iterdir():
        if entry.name != without.parts[0]:
            (folder / entry.name).symlink_to(entry)
        elif len(without.parts) > 1:
            _link(folder / entry.name, entry, Path(*without.parts[1:]))


def _compiled_after_a_change(tree: Path, build: Path) -> set[str]:
    """Return the objects that ninja would compile in a tree of links with a changed constant."""
    _link(tree, ROOT, CODES)
    (tree / CODES).write_text(f"{(ROOT / CODES).read_text()}# changed\n")
    (tree / "build").unlink()
    there = tree / build.relative_to(ROOT)
    _link(there, build, Path(".ninja_log"))
    shutil.copy2(build / ".ninja_log", there)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = [shutil.which("ninja", path=path) or "ninja", "-n", "-C", str(there)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(re.findall(r" object (\S+\.o)$", done.stdout, re.MULTILINE))


@pytest.mark.skipif(not BUILDS, reason="needs a build in the checkout")
def test_every_object_that_uses_a_constant_is_compiled_again(tmp_path: Path) -> None:
    build = BUILDS[0]
    compiled = _compiled_after_a_change(tmp_path / "tree", build)
    objects: dict[Path, list[str]] = {path: [] for path in ROOT.glob("fortran/*/*.h")}
    for each in json.loads((build / "compile_commands.json").read_text()):
        objects.setdefault((build / each["file"]).resolve(), []).append(each["output"])
    texts = {path: path.read_text() for path in objects}
    needed = {path: {m or h for m, h in NEEDED.findall(text)} for path, text in texts.items()}
    for changed in (*CLASSES, "codes.h"):
        names, users = {changed}, set[Path]()
        while found := {path for path in texts if path not in users and names & needed[path]}:
            users |= found
            for path in found:
                names |= {path.name, *PROVIDED.findall(texts[path])}
        stale = {each for path in users for each in objects[path]} - compiled
        assert users, f"nothing uses {changed}"
        assert not stale, f"{changed}: {sorted(stale)}"


def test_a_changed_constant_changes_one_module(tmp_path: Path) -> None:
    """A file that is not written anew keeps its users."""
    write = runpy.run_path(str(ROOT / "fortran/make_codes.py"))["main"]
    text = (ROOT / CODES).read_text()
    source = tmp_path / "codes.py"
    for each in (text, text.replace("SLACK = 16.0", "SLACK = 17.0")):
        source.write_text(each)
        write(str(source), str(tmp_path))
        written = {path.name for path in tmp_path.iterdir()}
        changed = {name for name in written if (tmp_path / name).stat().st_mtime > 1}
        for name in written:
            os.utime(tmp_path / name, (1, 1))
    assert written == {*(f"{name}.f90" for name in CLASSES), "codes.h", "codes.py"}
    assert changed == {"series.f90", "codes.py"}


def test_c_code_follows_the_type_of_the_series(monkeypatch: pytest.MonkeyPatch) -> None:
    """Offsets come from the declaration; what C could not load is refused."""
    monkeypatch.syspath_prepend(str(SERIES.parent))
    offsets = runpy.run_path(str(SERIES.with_name("layout.py")))["offsets"]
    text = SERIES.read_text()
    first = "    real(c_double) :: terms("
    assert text.count(first) == 1
    before = offsets(text)
    after = offsets(text.replace(first, f"    real(c_double) :: more(4, 0:2)\n{first}"))
    assert after == {"more": 0} | {name: place + 12 for name, place in before.items()}
    for member in ("integer(c_int) :: more(8)", "real(c_double) :: more(3)"):
        with pytest.raises(SystemExit, match=r"series_t: .* allowed is real\(c_double\)"):
            offsets(text.replace(first, f"    {member}\n{first}"))


@pytest.mark.campaign
@pytest.mark.skipif(not BUILDS, reason="needs a build in the checkout")
def test_loops_over_bodies_are_vector_code() -> None:
    """One comparison too many in a loop doubled the run time of all bodies without torque."""
    build, name = BUILDS[0], "bodies_avx512.f90"
    entries = json.loads((build / "compile_commands.json").read_text())
    commands = [each["command"].split() for each in entries if each["file"] == name]
    if not commands or not commands[0][0].endswith("gfortran"):
        pytest.skip("needs gfortran and AVX-512 kernels")
    (command,) = commands
    command[command.index("-o") + 1] = os.devnull
    done = subprocess.run(
        [*command, "-fopt-info-vec-optimized"],
        cwd=build,
        capture_output=True,
        text=True,
        check=True,
    )
    there = {int(n) for n in re.findall(rf"{name}:(\d+):\d+: optimized: loop vec", done.stderr)}
    scalar, loops, place = set(), 0, ""
    for number, line in enumerate((build / name).read_text().splitlines(), 1):
        if found := re.match(r" *(?:pure )?(?:subroutine|function) (\w+)", line):
            place = found[1]
        elif line.strip() in {"do i = 1, m", "do i = 1, n"}:
            loops += 1
            scalar |= set() if number in there else {place}
    assert loops > 20
    assert scalar <= {"put_attitudes", "advance_each"}  # they copy, and step body by body

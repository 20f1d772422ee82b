"""The files that are compiled anew after a change, and vector code in those compiled."""

import json
import os
import platform
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pyharness import _build  # noqa: PLC2701
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
    write = runpy.run_path(str(ROOT / "fortran/generate.py"))["write"]
    texts = runpy.run_path(str(ROOT / "fortran/make_codes.py"))["texts"]
    text = (ROOT / CODES).read_text()
    source = tmp_path / "codes.py"
    for each in (text, text.replace("SLACK = 16.0", "SLACK = 17.0")):
        source.write_text(each)
        write(tmp_path, texts(source))
        written = {path.name for path in tmp_path.iterdir()}
        changed = {name for name in written if (tmp_path / name).stat().st_mtime > 1}
        for name in written:
            os.utime(tmp_path / name, (1, 1))
    assert written == {*(f"{name}.f90" for name in CLASSES), "listing.f90", "codes.h", "codes.py"}
    assert changed == {"series.f90", "codes.py"}


def _generators() -> dict[str, list[str]]:
    """Return the command of each generator in the checkout's build, by kind."""
    text = (BUILDS[0] / "build.ninja").read_text()
    commands = re.findall(r"^ COMMAND = (.*generate\.py .*)$", text, re.MULTILINE)
    return {words[2]: words for words in map(shlex.split, commands)}


@pytest.mark.campaign
@pytest.mark.skipif(not BUILDS, reason="needs a build in the checkout")
def test_generators_depend_on_all_that_they_load(tmp_path: Path) -> None:
    """According to Python's own list of imports."""
    generators = _generators()
    assert sorted(generators) == ["hot", "tables", "words"]
    for kind, (python, script, _, _, _, target, *rest) in generators.items():
        command = [python, "-X", "importtime", script, kind, str(tmp_path / "d"), str(tmp_path)]
        done = subprocess.run(
            [*command, target, *rest], cwd=BUILDS[0], capture_output=True, text=True, check=True
        )
        names = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
        folders = (ROOT, ROOT / "fortran", ROOT / "fortran/modern")
        places = [folder / name.replace(".", "/") for name in names for folder in folders]
        loaded = {path.with_suffix(".py") for path in places if path.with_suffix(".py").is_file()}
        loaded |= {path / "__init__.py" for path in places if (path / "__init__.py").is_file()}
        given = (BUILDS[0] / each for each in rest if each.endswith((".f90", ".fypp")))
        first, *needed = (tmp_path / "d").read_text().split()
        assert first == f"{target}:"
        found = {(BUILDS[0] / each).resolve() for each in needed}
        assert found >= loaded | {path.resolve() for path in given}, kind
        assert (len(loaded) > 30) == (kind == "tables")
        assert ROOT / CODES in found or kind == "words"


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.skipif(not BUILDS, reason="needs the build tools")
def test_a_changed_module_is_generated_from_once(tmp_path: Path) -> None:
    """Each change of a module that generators load is seen, and a second run finds nothing."""
    tree, build = tmp_path / "tree", tmp_path / "tree/build/new"
    ignored = shutil.ignore_patterns(".*", "build", "dist", "docs", "tests", "__pycache__")
    shutil.copytree(ROOT, tree, ignore=ignored)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

    def run(*command: str) -> str:
        environment = os.environ | {"PATH": path}
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout

    run("meson", "setup", str(build), "-Dinstruction_sets=plain")
    ninja = ("ninja", "-C", str(build), "codes.h", "hot_plain.f90", "words.f90")
    assert "[3/3]" in run(*ninja)
    assert "no work to do" in run(*ninja)
    written = {each: each.stat().st_mtime_ns for each in build.glob("*.[cfh]*")}
    for kind, names in {
        "codes.h": ("pyharness/__init__.py", "pyharness/data/cases.toml",
                    "pyharness/model/attitude.py", "pyharness/model/tape.py",
                    "pyharness/model/recurrences.py", "pyharness/engine/system/leaves.py",
                    "pyharness/engine/system/leaf_text.py", "pyharness/engine/torques/ready.py",
                    "pyharness/engine/torques/terms.py", "fortran/make_leaves.py",
                    "fortran/make_gauss.py"),
        "hot_plain.f90": ("fortran/modern/unroll.py", "fortran/modern/unroll_many.py",
                          "fortran/modern/layout.py"),
        "words.f90": ("fortran/make_words.py",),
    }.items():  # fmt: skip
        for name in names:
            with (tree / name).open("a") as file:
                file.write("\n# changed\n")
            for _ in range(2):
                said = run(*ninja)
                assert f"Generating {kind}" in said, name
                (tree / name).touch()
            run(*ninja)
            assert "no work to do" in run(*ninja), name
    assert written == {each: each.stat().st_mtime_ns for each in written}
    for name in ("fortran/generate.py", "pyharness/model/codes.py"):
        (tree / name).touch()
        said = run(*ninja)
        assert "Generating codes.h" in said
        assert "Generating hot_plain.f90" in said
    code = tree / CODES
    code.write_text(code.read_text().replace("SLACK = 16.0", "SLACK = 17.0"))
    run(*ninja)
    changed = {each.name for each in written if each.stat().st_mtime_ns > written[each]}
    assert changed == {"series.f90"}


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
def test_loops_over_bodies_are_vector_code(tmp_path: Path) -> None:
    """One comparison too many in a loop doubled the run time of all bodies without torque."""
    build, name = BUILDS[0], "bodies_avx512.f90"
    entries = json.loads((build / "compile_commands.json").read_text())
    commands = [each for each in entries if re.fullmatch(r"bodies_\w+\.f90", each["file"])]
    if _build.COMPILER != "gcc" or platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("needs gfortran for x86-64")
    python, script, kind, _, _, target, _, *sources = _generators()["hot"]
    generate = [python, script, kind, str(tmp_path / "d"), str(tmp_path), target, "avx512"]
    subprocess.run([*generate, *sources], cwd=build, check=True)
    command = [
        each for each in commands[0]["command"].split()
        if not each.startswith(("-march=", "-mprefer", "-J", "-M"))
    ]  # fmt: skip
    command[command.index("-o") + 1] = os.devnull
    command[command.index("-c") + 1] = str(tmp_path / name)
    wide = ["-march=x86-64-v4", "-mprefer-vector-width=512", f"-J{tmp_path}"]
    done = subprocess.run(
        [*command, *wide, "-fopt-info-vec-optimized"], cwd=build, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    there = {int(n) for n in re.findall(rf"{name}:(\d+):\d+: optimized: loop vec", done.stderr)}
    scalar, loops, place = set(), 0, ""
    for number, line in enumerate((tmp_path / name).read_text().splitlines(), 1):
        if found := re.match(r" *(?:pure )?(?:subroutine|function) (\w+)", line):
            place = found[1]
        elif line.strip() in {"do i = 1, m", "do i = 1, n"}:
            loops += 1
            scalar |= set() if number in there else {place}
    assert loops > 20
    assert scalar <= {"put_attitudes", "advance_each"}  # they copy, and step body by body

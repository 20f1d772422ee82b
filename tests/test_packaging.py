"""The package as its users see it: types that accept valid calls, public names, citation."""

import inspect
import json
import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import pyharness
from pyharness.model import build
from pyharness.model.distribution import DISTRIBUTION
from pyharness.model.facts import facts

ROOT = Path(__file__).parent.parent
SCRIPT = ROOT / "tests/user_script.py"
SCRIPTS = sorted((ROOT / "tests/user_scripts").glob("[a-z]*.py"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

# Each line is refused when it runs, and a type checker finds the mistake before.
MISTAKES = """
Scene("x", "abc", (3, 2, 1))
Scene("x", 3.0, (3, 2, 1))
Scene("x", [1, 2, "3"], (3, 2, 1))
Scene("x", [1j, 2, 3], (3, 2, 1))
Scene("x", None, (3, 2, 1))
Scene(3, (1, 2, 3), (3, 2, 1))
Scene("x", (1, 2, 3), (3, 2, 1), steps=2.5)
Scene("x", (1, 2, 3), (3, 2, 1), steps="3")
Scene("x", (1, 2, 3), (3, 2, 1), step_size="0.1")
Scene("x", (1, 2, 3), (3, 2, 1), torque="1")
Scene("x", (1, 2, 3), (3, 2, 1), stpes=3)
TorqueLaw((1, 2, "3"))
TorqueLaw(sines=[(1, 2, 3)])
TorqueLaw(sines=3.0)
solve(case_scene(3), "1")
solve(case_scene(3), None)
solve(case_scene(3), 1j)
solve("case 3", [1.0])
solve(case_scene(3), [1.0], method=3)
solve(case_scene(3), [1.0], tolerance="1e-9")
prepare(3)
prepare(case_scene(3), tolerance=[1e-9])
prepare(case_scene(3)).trajectory("abc", 1.0)
case_scene("3")
case_scene(3.0)
read_scene(3)
subset(3)
subset("two-term", fix=3)
Listing("two-term", None)
pyharness.sovle
"""


def _mypy(folder: Path, *scripts: Path) -> tuple[set[tuple[str, int]], str]:
    """Check scripts as a user of the installed package would; return the errors and the output."""
    venv.create(folder / "env", with_pip=False, symlinks=True)
    # The environment has the packages of this one, and the package as a wheel would install it.
    (folder / "lib").mkdir()
    (folder / "lib/pyharness").symlink_to(ROOT / "pyharness")
    paths = {"base": str(folder / "env"), "platbase": str(folder / "env")}
    packages = Path(sysconfig.get_path("purelib", vars=paths))
    others = Path(np.__file__).parent.parent
    (packages / "here.pth").write_text(f"{folder / 'lib'}\n{others}\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", "cache"]
    command += ["--python-executable", "env/bin/python", *map(str, scripts)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    found = re.findall(r"^([^:\n]+):(\d+): error", done.stdout, re.MULTILINE)
    return {(Path(name).name, int(line)) for name, line in found}, done.stdout


@pytest.mark.campaign
def test_types_accept_what_runs_and_refuse_what_does_not(tmp_path: Path) -> None:
    mistakes = tmp_path / "mistakes.py"
    names = "Listing, Scene, TorqueLaw, case_scene, prepare, read_scene, solve, subset"
    mistakes.write_text(f"import pyharness; from pyharness import {names}{MISTAKES}")
    scripts = [Path(shutil.copy(each, tmp_path)) for each in (SCRIPT, *SCRIPTS)]
    found, text = _mypy(tmp_path, *scripts, mistakes)
    lines = mistakes.read_text().splitlines()
    assert found == {("mistakes.py", n) for n in range(2, len(lines) + 1)}, text


@pytest.mark.parametrize("mistake", MISTAKES.split("\n")[1:-1])
def test_what_has_a_wrong_type_is_refused_when_it_runs(mistake: str) -> None:
    names = {name: getattr(pyharness, name) for name in pyharness.__all__}
    wrong = TypeError if "stpes" in mistake else AttributeError if "sovle" in mistake else None
    with pytest.raises(wrong or pyharness.InputError):
        eval(mistake, {"pyharness": pyharness, **names})


def test_the_script_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(SCRIPT.read_text(), str(SCRIPT), "exec"), {})
    assert "complete complete custom" in capsys.readouterr().out


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_scripts_of_users_run(script: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script))


def test_what_the_package_shows() -> None:
    assert dir(pyharness) == sorted(
        [*pyharness.__all__, "Taylor", "events", "torques", "__version__"]
    )
    for name in dir(pyharness):
        assert getattr(pyharness, name) is not None


def test_star_import_does_not_import_scipy() -> None:
    code = "import sys; from pyharness import *; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_doctor_covers_what_the_package_needs() -> None:
    names = {re.split("[^A-Za-z_-]", each)[0] for each in PROJECT["dependencies"]}
    assert names == {"numpy", "scipy", *build.REQUIRED}
    for extra, needed in PROJECT["optional-dependencies"].items():
        if extra != "peers":
            assert {re.split("[^A-Za-z_-]", each)[0] for each in needed} & set(build.OPTIONAL), (
                extra
            )


def test_issue_template_requests_the_output_of_doctor() -> None:
    text = (ROOT / ".github/ISSUE_TEMPLATE/wrong-result.md").read_text()
    assert "The output of `pyharness doctor`" in text


def test_each_dependency_has_one_bound_that_is_tested() -> None:
    """A session of `.ci/noxfile.py` installs the lowest versions that the bounds allow."""
    extras = PROJECT["optional-dependencies"]
    for each in [*PROJECT["dependencies"], *extras["plots"], *extras["edition"]]:
        assert re.fullmatch(r"[\w-]+>=[\d.]+", each)


def test_signatures_can_be_read() -> None:
    for name in ("solve", "solve_many", "prepare", "run_program", "run_many", "compare_programs"):
        parameters = inspect.signature(getattr(pyharness, name)).parameters.values()
        assert max(len(str(each)) for each in parameters) <= 130, name
        assert "numpy._typing" not in str(parameters)


def test_the_licences_of_others_are_declared() -> None:
    declared = [file for glob in PROJECT["license-files"] for file in ROOT.glob(glob)]
    assert ROOT / "LICENSE" in declared
    assert ROOT / "THIRD-PARTY.md" in declared
    notice = (ROOT / "THIRD-PARTY.md").read_text()
    for each in tomllib.loads((ROOT / "web/vendor/vendor.toml").read_text())["package"]:
        assert ROOT / "web/vendor" / each["name"] / "LICENSE" in declared
        row = re.search(rf"^.*\b{each['name']} {each['version']} .*$", notice, re.MULTILINE | re.I)
        assert row is not None, each["name"]
        assert f"| {each['licence']}," in row[0]
    for library in ("libgcc", "libgfortran"):
        assert re.search(rf"^\| .*{library}.* WITH GCC-exception-3\.1", notice, re.MULTILINE)


def test_nothing_tells_users_to_install_the_package_of_others() -> None:
    """The index has another package with the name of our import; our package has another name."""
    assert PROJECT["name"] == DISTRIBUTION != "pyharness"
    other = re.compile(r"pip install\b[^\n]*?['\" ]pyharness\b(?![-/._])|\bpyharness\[")
    assert other.search("pip install 'pyharness[sweep]'")
    assert other.search("pip install pyharness")
    folders = ("docs", "pyharness", ".ci", ".github", "web/laboratory")
    files = [each for folder in folders for each in (ROOT / folder).rglob("*") if each.is_file()]
    texts = (".md", ".py", ".yml", ".js", ".html", "")
    for file in [ROOT / "README.md", *(each for each in files if each.suffix in texts)]:
        found = other.search(file.read_text())
        assert found is None, f"{file}: {found and found[0]}"


def test_the_citation_is_that_of_the_project() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    version = re.search(r"^  version: '(.*)'", (ROOT / "meson.build").read_text(), re.MULTILINE)
    assert version is not None
    assert citation["cff-version"] == "1.2.0"
    edition = facts("account")["edition"]["name"]
    assert citation["title"] == f"{PROJECT['name']}. {edition}"
    assert citation["version"] == version.group(1)
    assert citation["license"] == PROJECT["license"]
    assert citation["abstract"].split() == PROJECT["description"].split()
    assert citation["keywords"] == PROJECT["keywords"]
    assert citation["authors"] == [{"name": each["name"]} for each in PROJECT["authors"]]
    (thesis,) = citation["references"]
    assert f"*{thesis['title']}*" in " ".join((ROOT / "README.md").read_text().split())
    assert thesis["year"] == 1982


def test_codemeta_agrees_with_the_project_and_the_citation() -> None:
    codemeta = json.loads((ROOT / "codemeta.json").read_text())
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert codemeta["@context"] == "https://w3id.org/codemeta/3.0"
    assert codemeta["@type"] == "SoftwareSourceCode"
    assert codemeta["identifier"] == PROJECT["name"]
    assert codemeta["name"] == citation["title"]
    assert codemeta["version"] == citation["version"]
    assert codemeta["license"] == f"https://spdx.org/licenses/{PROJECT['license']}"
    assert codemeta["description"] == PROJECT["description"]
    assert codemeta["keywords"] == PROJECT["keywords"]
    assert [each["name"] for each in codemeta["author"]] == [
        each["name"] for each in PROJECT["authors"]
    ]
    assert f"(c) {codemeta['copyrightYear']} " in (ROOT / "LICENSE").read_text()
    assert codemeta["runtimePlatform"] == f"Python {PROJECT['requires-python']}"
    assert [each["name"] + each["version"] for each in codemeta["softwareRequirements"]] == (
        PROJECT["dependencies"]
    )
    systems = [each for each in PROJECT["classifiers"] if each.startswith("Operating System")]
    assert {each.rpartition(":: ")[2] for each in systems} == {*codemeta["operatingSystem"]}
    # A date and an address are in both files or in neither.
    for name, other in (("datePublished", "date-released"), ("codeRepository", "repository-code")):
        assert (name in codemeta) == (other in citation)
        assert codemeta.get(name, "") == str(citation.get(other, ""))
    thesis, (cited,) = codemeta["referencePublication"], citation["references"]
    assert thesis["name"] == cited["title"]
    assert thesis["datePublished"] == f"{cited['year']}-{cited['month']:02d}"
    assert thesis["@type"] == f"schema:{cited['type'].capitalize()}" == "schema:Report"
    assert thesis["publisher"]["name"] == cited["institution"]["name"]
    assert thesis["description"] == cited["notes"]
    (author,), (other_author,) = thesis["author"], cited["authors"]
    assert author["familyName"] == other_author["family-names"]
    assert author["givenName"] == other_author["given-names"]

"""The data package is complete, the same in every run, and sufficient to repeat results."""

import contextlib
import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from pyharness.edition.citation import CRATE, KEPT, MANIFEST, PACKAGE_MARK
from pyharness.edition.data_package import data_package, outcomes_table
from pyharness.edition.decks import TITLES
from pyharness.edition.report import package_report
from pyharness.history import identifiers
from pyharness.history.ablation import entries
from pyharness.history.claims.ledger import KINDS
from pyharness.history.figures import plans
from pyharness.history.identifiers import content_identifier, directory_identifier, text_digest
from pyharness.history.listing_output import fits, read_page
from pyharness.history.printed_page import main as judge
from pyharness.history.printed_page import stored_fits
from pyharness.history.tei import tei_document
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.programs import WORD_NAMES
from pyharness.views.render import render
from tests.conftest import Capture, Patch, Printed, ResultOf
from tests.json_reference import schema_of
from tests.test_packaging import ROOT

pytestmark = pytest.mark.campaign
Package = dict[str, bytes]
GUIDE = ROOT / "docs/how-to/data-package.md"
ARTICLE = ROOT / "docs/article/article.md"
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@pytest.fixture(scope="module")
def package() -> Package:
    return data_package()


def _write(package: Package, folder: Path) -> None:
    for path, content in package.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


def _json(package: Package, path: str) -> Any:
    return json.loads(package[path])


def _rows(package: Package, path: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(package[path].decode())))


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_deck_is_made_of_its_table(package: Package, program: str, printed: Printed) -> None:
    rows = _rows(package, f"cards/{program}.csv")
    lines = [f"{row['text']:72} {int(row['card']):7d}\n" for row in rows]
    assert printed(f"deck --program {program}") == "".join(lines)


def test_verdicts_are_counted_from_the_package_alone(package: Package, printed: Printed) -> None:
    found = _json(package, "claims.json")["claims"]
    table = printed("claims").partition("Number of verdicts by kind")[2].splitlines()
    verdicts = [
        "reproduced", "reproduced in part", "not reproduced", "false", "not testable", "undecided",
    ]  # fmt: skip
    states = ("original", "corrected")
    assert {each[state] for each in found for state in states} <= {*verdicts}
    for kind in KINDS:
        of_kind = [each for each in found if each["kind"] == kind]
        pairs = [
            [sum(each[state] == verdict for each in of_kind) for state in states]
            for verdict in verdicts
        ]
        told = ["{} / {}".format(*pair) if any(pair) else "-" for pair in pairs]
        (row,) = (line for line in table if line.startswith(kind))
        assert row.split() == " ".join([kind, str(len(of_kind)), *told]).split()


def test_outputs_of_verbs_are_in_the_package(package: Package, printed: Printed) -> None:
    assert package["claims.json"].decode() == printed("claims --format json")
    assert package["apparatus.json"].decode() == printed("defects --format json")
    assert package["edition.xml"] == tei_document()
    assert len(_json(package, "apparatus.json")["entries"]) == len(entries())
    for path in ("CITATION.cff", "codemeta.json", "LICENSE"):
        assert package[path] == (ROOT / path).read_bytes()


def test_figures_and_pages_are_those_of_the_documents(package: Package) -> None:
    figures = {path for path in package if path.startswith("figures/")}
    assert figures == {f"figures/{each.stem}.csv" for each in plans()}
    for name in ("figure-07", "figure-09", "figure-11-corrected"):
        assert package[f"figures/{name}.csv"] == (ROOT / f"docs/figures/{name}.csv").read_bytes()
    machine = list((ROOT / "docs/machine").iterdir())
    assert len(machine) == 6
    for file in machine:
        assert package[f"machine/{file.name}"] == file.read_bytes()


def test_identifiers_are_those_of_the_files(package: Package) -> None:
    mark = _json(package, PACKAGE_MARK)
    assert (mark["text"], mark["data"]) == (text_digest(), identifiers.data_identifier())
    assert {*mark["files"]} == {*package} - {PACKAGE_MARK}
    for path, identifier in mark["files"].items():
        assert identifier == (None if path == MANIFEST else content_identifier(package[path]))
    sources = {row["path"]: row["swhid"] for row in _rows(package, "sources.csv")}
    files = identifiers.source_files()
    assert sources == {path: content_identifier(each) for path, each in files.items()}
    for program in PROGRAMS:
        of_file = sources[f"pyharness/data/cards/{program}.toml"]
        cards = _rows(package, f"cards/{program}.csv")
        assert all(row["swhid"].startswith(f"{of_file};lines=") for row in cards)
        assert len({row["swhid"] for row in cards}) == len(cards)
    record = json.loads(render(package_report("there", package), "json"))
    Draft202012Validator(schema_of("edition")).validate(record)
    assert record["identifiers"]["package"] == directory_identifier(package)
    assert sum(map(len, package.values())) < 3e6
    listed = re.findall(r"^\| (\S+\.\S+|LICENSE) \|", package["README.md"].decode(), re.MULTILINE)
    assert sorted(listed) == sorted({*package} - {"README.md"})


def test_manifest_has_the_checksums(package: Package, tmp_path: Path) -> None:
    lines = [line.split("  ", 1) for line in package[MANIFEST].decode().splitlines()]
    assert {path for _, path in lines} == {*package} - {MANIFEST}
    for checksum, path in lines:
        assert checksum == sha256(package[path]).hexdigest()
    if shutil.which("sha256sum") is None:
        return
    _write(package, tmp_path)
    check = ["sha256sum", "-c", "--strict", "--quiet", MANIFEST]
    subprocess.run(check, cwd=tmp_path, check=True)
    (tmp_path / "claims.json").write_text("{}")
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, check=False).returncode != 0


def test_the_crate_describes_every_file(package: Package) -> None:
    crate = _json(package, CRATE)
    assert crate["@context"] == "https://w3id.org/ro/crate/1.1/context"
    graph = {each["@id"]: each for each in crate["@graph"]}
    assert len(graph) == len(crate["@graph"])
    assert graph[CRATE]["conformsTo"] == {"@id": "https://w3id.org/ro/crate/1.1"}
    assert graph[CRATE]["about"] == {"@id": "./"}
    root = graph["./"]
    assert root["@type"] == "Dataset"
    assert re.fullmatch(r"\d{4}(-\d\d-\d\d)?", root["datePublished"])
    assert all(root[name] for name in ("name", "description", "license", "author", "citation"))
    parts = [each["@id"] for each in root["hasPart"]]
    assert sorted(parts) == sorted({*package} - {CRATE})
    for path in parts:
        assert graph[path]["@type"] == "File"
        assert graph[path]["name"]
        if path not in {each.path for each in KEPT}:
            assert graph[path]["contentSize"] == str(len(package[path]))
            assert graph[path]["identifier"] == content_identifier(package[path])

    def check(value: Any) -> None:
        """Check that a value has no nested entity, and refers to entities of the list only."""
        if isinstance(value, list):
            for each in value:
                check(each)
        elif isinstance(value, dict):
            assert list(value) == ["@id"]
            assert value["@id"] in graph or value["@id"].startswith("https://w3id.org/ro/crate/")

    for each in graph.values():
        for value in each.values():
            check(value)


def test_nothing_depends_on_the_time_or_on_settings(package: Package) -> None:
    """Another process with other settings writes the same bytes, and without optional packages."""
    script = (
        "import os, sys, time; from hashlib import sha256\n"
        "for name in ('jinja2', 'markdown_it', 'markupsafe', 'matplotlib', 'latex2mathml'):\n"
        "    sys.modules[name] = None\n"
        "from pyharness.edition.data_package import data_package\n"
        "for path, each in data_package().items(): print(sha256(each).hexdigest(), path)\n"
    )
    # Other kernels of OpenBLAS round differently.
    kernels = {name: x for name, x in os.environ.items() if name.startswith("OPENBLAS_")}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**kernels, "PYTHONPATH": ":".join(filter(None, sys.path)), "TZ": "Asia/Tokyo",
             "PYTHONHASHSEED": "7", "LC_ALL": "C"},
        cwd="/", capture_output=True, text=True, check=True,
    )  # fmt: skip
    told = [f"{sha256(each).hexdigest()} {path}" for path, each in package.items()]
    assert done.stdout.splitlines() == told
    for path, content in package.items():
        assert str(ROOT).encode() not in content, path
        assert b"\r" not in content, path
        content.decode()


def _judged(package: Package, folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run the script of the package on a printed page, with Python's standard library alone."""
    _write({path: each for path, each in package.items() if path.startswith("machine/")}, folder)
    # As a printer prints it: with a banner, carriage control and a job log.
    printed = "1JACOBS\n\n" + text.replace("\n", "  \n") + "\n 12.30.07.LGO.\n"
    (folder / "printed.txt").write_text(printed)
    return subprocess.run(
        [sys.executable, "-I", "-S", "machine/judge.py", "printed.txt"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.sampled
@pytest.mark.parametrize("altered", [False, True])
@pytest.mark.parametrize("program", PROGRAMS)
def test_the_script_judges(package: Package, tmp_path: Path, program: str, altered: bool) -> None:
    case = facts("cases")["published"][program]
    text = package[f"machine/{program}-case-{case}-cdc48.txt"].decode()
    if altered:
        *lines, last = text.splitlines()
        text = "\n".join([*lines, last.replace("10.0000", "10.0001").replace("9.0005", "9.0006")])
    done = _judged(package, tmp_path, text)
    lines_of_page = read_page(str(tmp_path / "printed.txt"))
    stored = stored_fits(lines_of_page, tmp_path / "machine")
    by_the_verb = fits(lines_of_page, PROGRAMS, [case])
    assert {*stored} == {*by_the_verb}
    counts = sorted(len(each.differences) for each in by_the_verb)
    assert [len(each.differences) for each in stored] == counts
    assert stored[0].is_whole != altered
    assert done.returncode == int(altered), done.stderr
    for each in stored:
        assert f"{len(each.differences):6d} {each.fields:5d} {each.name}\n" in done.stdout
    assert ("by none; the nearest is" in done.stdout) == altered
    assert (f"printed so by {program}, case {case}, original, in cdc48\n" in done.stdout) != altered


def test_the_script_refuses_what_is_no_page(
    package: Package, tmp_path: Path, capsys: Capture
) -> None:
    done = _judged(package, tmp_path, "")
    assert (done.returncode, done.stdout) == (2, "")
    told = "it has no page with the moments, torques and columns"
    assert told in done.stderr
    for text in ("1.0 2.0\n", "1 2 3 4 5 6 7 8\n"):
        (tmp_path / "printed.txt").write_text(text)
        assert judge([str(tmp_path / "printed.txt")], tmp_path / "machine") == 2
        assert told in capsys.readouterr().err
    assert judge([], tmp_path) == 2
    assert "usage: python judge.py FILE" in capsys.readouterr().err
    assert judge([str(tmp_path / "missing.txt")], tmp_path) == 2
    assert "missing.txt: it can't be read (No such file" in capsys.readouterr().err


def test_jobs_are_those_of_the_command(package: Package, printed: Printed) -> None:
    jobs = {path for path in package if path.startswith("machine/jobs/")}
    assert len(jobs) == 10
    for program in PROGRAMS:
        for system in ("nos", "nosbe"):
            command = f"deck --program {program} --dialect ftn --system {system}"
            path = f"machine/jobs/{program}-{system}"
            assert package[f"{path}.job"].decode() == printed(command)
            rounded = f"{path}-rounded.job"
            assert (rounded in jobs) == (program != "runge-kutta")
            if rounded in jobs:
                assert package[rounded].decode() == printed(f"{command} --round")


def test_every_page_is_listed_with_its_runs(package: Package) -> None:
    rows = _rows(package, "machine/pages.csv")
    named = {f"machine/{row['page']}" for row in rows}
    pages = {path for path in package if re.fullmatch(r"machine/.*\.txt", path)}
    assert named == pages
    assert {row["word"] for row in rows} == {*WORD_NAMES}
    assert {row["listing"] for row in rows if row["program"] == "runge-kutta"} == {
        "original", "corrected", "original with do-variable",
    }  # fmt: skip
    readme = package["machine/README.md"].decode()
    for path in (*pages, *(path for path in package if path.endswith(".job"))):
        assert f"| `{path.removeprefix('machine/')}` |" in readme
    assert outcomes_table() in readme


def _replace(monkeypatch: Patch, made: Callable[..., Any]) -> None:
    """Replace the function that makes the package, where the verb finds it."""
    monkeypatch.setattr(sys.modules[data_package.__module__], "data_package", made)


def test_the_command_writes_the_package(
    package: Package, tmp_path: Path, result_of: ResultOf, monkeypatch: Patch
) -> None:
    _replace(monkeypatch, lambda progress: package)
    folder = tmp_path / "package"
    for _ in range(2):  # an earlier package is replaced
        told = result_of(["edition", "--data", str(folder)]).out
        assert directory_identifier(package) in told
        assert f"sha256sum -c {MANIFEST}" in told
        files = [each for each in folder.rglob("*") if each.is_file()]
        assert {each.relative_to(folder).as_posix(): each.read_bytes() for each in files} == package
        assert [each.name for each in tmp_path.iterdir()] == ["package"]
    (folder / "notes.txt").write_text("mine")
    assert "'notes.txt'" in result_of(["edition", "--data", str(folder)], 2).err
    assert (folder / "notes.txt").read_text() == "mine"


def test_the_examples_of_the_guide_run(
    package: Package, tmp_path: Path, printed: Printed, monkeypatch: Patch
) -> None:
    pytest.importorskip("pandas")
    text = GUIDE.read_text()
    section = text.partition("## Read the tables\n")[2].partition("\n## ")[0]
    _write(package, tmp_path / "package")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    told = []
    for block in re.findall(r"```py\n(.*?)```", section, re.DOTALL):
        buffer = io.StringIO()
        with contextlib.redirect_stdout(buffer):
            exec(block, names)
        told.append(buffer.getvalue())
    listed, counted, made = told
    assert "entries" in listed.splitlines()[0]
    (row,) = (each for each in printed("claims").splitlines() if re.match(r"result +\d", each))
    reproduced = row.split()[2]
    assert re.search(rf"^reproduced +{reproduced}$", counted, re.MULTILINE)
    assert made == printed("deck --program two-term")
    # The table of the guide names every file.
    table = re.findall(r"^\| (`.*?`) \|", text, re.MULTILINE)
    patterns = [each.strip("`") for row in table for each in row.split(", ")]
    patterns = [re.sub("PROGRAM|N(?=[.])", "*", each) for each in patterns] + ["README.md", CRATE]
    for path in package:
        assert any(PurePath(path).match(each) for each in patterns), path


def _in_the_article(letter: str) -> list[list[str]]:
    """Return the cells of a table of the article, with its numbers as Python writes them."""
    before = ARTICLE.read_text().partition(f"*Table {letter}.")[0].rstrip().split("\n\n")[-1]
    rows = [line.strip("| ").split(" | ") for line in before.splitlines()[2:]]
    names = {title: program for program, title in TITLES.items()}
    return [[_plain(names.get(cell, cell)) for cell in row] for row in rows]


def _plain(cell: str) -> str:
    """Return a cell with every number in the shortest form of a float."""
    cell = re.sub(r"\s\u00d7\s10(\S+)", lambda found: "e" + found[1].translate(SUPERSCRIPTS), cell)
    number = r"(?<![\w.])\d+(\.\d+)?(e[-+]?\d+)?(?!\w)"
    return re.sub(number, lambda found: repr(float(found[0])), cell.strip("`"))


def _computed(package: Package, folder: Path) -> dict[str, list[list[str]]]:
    """Return the tables, by letter, that the code of the guide computes with Python alone."""
    _write(package, folder / "package")
    code = (GUIDE.parent / "article_tables.py").read_text()
    code += "import sys\nassert not {'pyharness', 'numpy', 'pandas'} & {*sys.modules}\n"
    # -S leaves site-packages out of the path, -I the settings of the user and PYTHONPATH.
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found: dict[str, list[list[str]]] = {}
    for line in done.stdout.splitlines():
        letter, *cells = line.split(" | ")
        found.setdefault(letter, []).append([_plain(cell) for cell in cells])
    return found


_ALTERED = (
    ("runs/runs.csv", "stage-base,100,complete,,", "stage-base,9,stopped,9,U1", "B"),
    ("runs/case-5.csv", "e-kutta,stage-base,50,0.5,", "e-kutta,stage-base,50,0.5,1", "B"),
    ("runs/case-3.csv", "reference,,50,0.5,", "reference,,50,0.5,9", "C"),
    ("runs/runs.csv", "stopped,25,V2", "stopped,26,V2", "C"),
    ("claims.json", '"original": "reproduced"', '"original": "undecided"', "D"),
)


def test_tables_of_the_article_follow_from_the_package(package: Package, tmp_path: Path) -> None:
    """The comparison can fail: a package with one changed number has another table."""
    found = _computed(package, tmp_path)
    assert [len(rows) for rows in found.values()] == [14, 7, 5]
    wanted = {letter: _in_the_article(letter) for letter in found}
    assert found == wanted
    for path, before, after, letter in _ALTERED:
        text = package[path].decode()
        assert before in text
        (tmp_path / "package" / path).write_text(text.replace(before, after, 1))
        altered = _computed({}, tmp_path)
        assert [each for each, rows in altered.items() if rows != wanted[each]] == [letter]
        (tmp_path / "package" / path).write_bytes(package[path])


@pytest.mark.parametrize("name", ["edition.json", "manifest-sha256.txt", "thesis.txt"])
def test_a_folder_that_is_no_package_is_refused_before_any_work(
    tmp_path: Path, result_of: ResultOf, monkeypatch: Patch, name: str
) -> None:
    _replace(monkeypatch, lambda progress: pytest.fail("worked"))
    (tmp_path / name).write_text(json.dumps({"schema": 1, "files": {}}))
    assert f"'{name}'" in result_of(["edition", "--data", str(tmp_path)], 2).err
    assert [each.name for each in tmp_path.iterdir()] == [name]

"""Names in workflows, scripts and the list of jobs exist, and documents cite what runs."""

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nox
import pytest
import yaml

from pyharness.checks.kinds import KINDS
from tests.changed import ROOT

WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
ACTION = ROOT / ".github/actions/set-up/action.yml"
SCRIPTS = [ROOT / ".ci" / name for name in ("run", "weekly", "job")]
TARGETS = re.findall(r"^([\w./-]+)(?::(?!=)| .*:(?!=))", (ROOT / "Makefile").read_text(), re.M)
FOLDERS = (".ci/", ".github/", "docs/", "fortran/", "pyharness/", "tests/", "web/")
# Campaigns of `docs/campaign/tally.json`: its runs add up to days.
SUMMED = "tests.campaigns.proved"


def _load() -> Any:
    spec = importlib.util.spec_from_file_location("noxfile", ROOT / ".ci/noxfile.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


JOBS = _load()
SESSIONS = {*nox.registry.get()}


def _steps(node: Any) -> Iterator[dict[str, Any]]:
    """Yield the steps of a workflow or an action."""
    for job in node["jobs"].values() if "jobs" in node else [node["runs"]]:
        yield from job["steps"]


def _commands() -> Iterator[tuple[str, str]]:
    """Yield the lines that are run, each with its place."""
    for place in (*WORKFLOWS, ACTION):
        for step in _steps(yaml.safe_load(place.read_text())):
            for line in step.get("run", "").splitlines():
                yield place.name, line
    for place in SCRIPTS:
        for line in place.read_text().splitlines():
            if not line.lstrip().startswith("#"):
                yield place.name, line
    for name, commands in {**JOBS.JOBS, **JOBS.WEEKLY}.items():
        yield from ((name, command) for command in commands)


def _missing(line: str) -> list[str]:
    """Return the names in a command line of which there is nothing."""
    try:
        parts = shlex.shlex(line, posix=True, punctuation_chars=True)
        parts.whitespace_split = True
        words = [*parts]
    except ValueError:  # a quotation of several lines
        return []
    wrong = [
        word
        for word in words
        if word.startswith(FOLDERS) and "$" not in word and not (ROOT / word).exists()
    ]
    for at, word in enumerate(words):
        rest = words[at + 1 :]
        ends = (k for k, each in enumerate(rest) if each in ("--", "&&", "||", "|", ">", ";", "&"))
        rest = rest[: next(ends, len(rest))]
        named = [each for each in rest if not each.startswith(("-", "$", "{")) and "=" not in each]
        if word == ".ci/job":
            wrong += [f"job {each}" for each in named if each not in SESSIONS]
        elif word == "make":
            wrong += [f"target {each}" for each in named if each not in TARGETS]
        elif word == "-m" and (module := rest[0]) not in ("pip", "cibuildwheel"):
            wrong += [] if importlib.util.find_spec(module) else [f"module {module}"]
        elif word == "--only" and "verify" in words:
            wrong += [f"kind {each}" for each in rest[0].split(",") if each not in KINDS]
        elif (
            word.startswith(".ci/") and (ROOT / word).exists() and (at == 0 or words[at - 1] == "|")
        ):
            wrong += [] if os.access(ROOT / word, os.X_OK) else [f"{word} is not executable"]
    return wrong


def test_the_names_in_the_lines_that_are_run_exist() -> None:
    commands = [*_commands()]
    assert len(commands) > 50
    assert [(place, wrong) for place, line in commands if (wrong := _missing(line))] == []


@pytest.mark.parametrize("line", [
    ".ci/job lint installs(pip)",
    "make tset ARGS=x",
    "make .venv/ready-to-tset && .ci/job build",
    "make .venv/ready-to-test && .ci/job biuld -- tests/engine",
    ".venv/bin/python -W ignore -m tests.campaigns.stat_campaign 1 2",
    ".venv/bin/python -m pyharness verify --only words,method",
    ".ci/fang",
    "python -m pytest tests/engin",
    "INSTALL=no .ci/job browsers >build/log 2>&1 &",
])  # fmt: skip
def test_a_name_that_does_not_exist_is_found(line: str) -> None:
    assert _missing(line)


def test_actions_of_the_repository_exist_with_the_inputs_that_they_get() -> None:
    used = [
        (place.name, step)
        for place in WORKFLOWS
        for step in _steps(yaml.safe_load(place.read_text()))
        if not re.fullmatch(r"[\w.-]+/[\w./-]+@[0-9a-f]{40}", step.get("uses", "a/b@" + "0" * 40))
    ]
    assert used
    for place, step in used:
        folder = re.fullmatch(r"\$/([\w./-]+)", step["uses"])
        assert folder is not None, (place, step)
        action = yaml.safe_load((ROOT / folder[1] / "action.yml").read_text())
        assert {*step.get("with", {})} <= {*action.get("inputs", {})}, (place, step)


def test_each_weekly_job_runs_in_one_part_of_the_workflow() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/weekly.yml").read_text())
    parts = workflow["jobs"]["weekly"]["strategy"]["matrix"]["trials"]
    assert sorted(" ".join(parts).split()) == sorted(JOBS.WEEKLY)


def test_jobs_run_with_the_lowest_and_the_newest_python() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    matrix = workflow["jobs"]["test"]["strategy"]["matrix"]["include"]
    assert {"3.x", JOBS.PYTHONS[0]} <= {each["python"] for each in matrix}


def test_documents_name_jobs_that_exist() -> None:
    for place in (ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")):
        for line in re.findall(r"^.*\.ci/job [a-z].*$", place.read_text(), re.M):
            assert _missing(line.strip(" `")) == [], place


def _sizes(text: str) -> Iterator[tuple[str, int]]:
    """Yield the campaigns that a text cites with their numbers of scenes, 0 for none."""
    places = r"tests\.campaigns\.[\w.]+|tests\.engine\.independent|pyharness verify --only random"
    for name, size in re.findall(rf"({places})(?: (?:--\w+ )?(\d+))?", text):
        yield name, int(size or 0)


def test_campaigns_that_documents_cite_run_weekly_at_the_size_that_they_state() -> None:
    weekly = [each.replace("words,methods,prepared,attitudes,", "") for each in _weekly()]
    run = dict(size for line in weekly for size in _sizes(line))
    cited = [
        (name, size)
        for place in (ROOT / "docs").rglob("*.md")
        for name, size in _sizes(place.read_text())
        if name != SUMMED
    ]
    assert len(cited) >= 7
    assert [each for each in cited if run.get(each[0], -1) < each[1]] == []


def test_each_campaign_runs_weekly() -> None:
    lines = " ".join(_weekly())
    folder = ROOT / "tests/campaigns"
    own = [
        *folder.glob("*_campaign.py"),
        folder / "proved.py",
        folder / "estimates",
        folder / "fuzz",
    ]
    own = [each for each in own if not each.name.startswith("test_")]
    assert len(own) > 10
    assert [each.stem for each in own if f"tests.campaigns.{each.stem} " not in f"{lines} "] == []


def _weekly() -> list[str]:
    return [command for commands in JOBS.WEEKLY.values() for command in commands]


_JOB = """#!/bin/sh
echo "$* browser: ${PYHARNESS_BROWSER:-}" >>calls
case " $* " in *" $FAILS "*) exit 1 ;; esac
"""


@pytest.mark.parametrize("fails", ["", "browser", "lint", "cross", "levels", "test", "changed"])
def test_the_gate_ends_with_what_failed_and_says_what_it_left_out(
    fails: str, tmp_path: Path
) -> None:
    """A machine without a browser, where none may be installed, leaves out pages alone."""
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci/run", tmp_path / ".ci/run")
    for name, text in (("job", _JOB), ("make", "#!/bin/sh\n")):
        (tmp_path / ".ci" / name).write_text(text)
        (tmp_path / ".ci" / name).chmod(0o755)
    path = f"{tmp_path / '.ci'}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [tmp_path / ".ci/run"], env={"PATH": path, "FAILS": fails or "none"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    calls = (tmp_path / "calls").read_text()
    assert done.returncode == (1 if fails not in ("", "browser") else 0)
    assert ("pages in a browser" in done.stdout) == (fails == "browser")
    assert ("== NOT RUN here" in done.stdout) == (done.returncode == 0)
    assert ("browser: required" in calls) == (fails != "browser")
    if not done.returncode:
        words = {*calls.replace("browser: required", "").split()}
        assert {"lint", "cross", "build", "levels", "kinds", "test", "changed"} <= words

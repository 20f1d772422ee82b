"""The lesson has the cards and commands of the project, and names no fault too early."""

import html
import re
import runpy
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import cos, sin
from pathlib import Path
from typing import Any

import pytest

from pyharness import case_scene, run_program
from pyharness.edition.documents import page_of
from pyharness.edition.laboratory import data
from pyharness.history.ablation import entries
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis.decks import compiler, deck_text, run_deck
from tests.conftest import Patch, Printed
from tests.ports import WEB, run_javascript

DOCS = Path(__file__).parents[2] / "docs"
LESSON = (DOCS / "tutorials/lesson.md").read_text()
NOTES = (DOCS / "tutorials/lesson-notes.md").read_text()
EXERCISES, HINTS, CHECKS = re.split(r"^## (?:Hints|Checks)$", LESSON, flags=re.MULTILINE)
GLOSSARY = re.findall(r"^\| (.*?) \|", (DOCS / "glossary.md").read_text(), re.MULTILINE)[2:]
TERMS = {term for row in GLOSSARY for term in row.split(", ")}


def _commands(text: str) -> list[str]:
    blocks = "\n".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    found = re.findall(r"^pyharness (.*)$", blocks, re.MULTILINE)
    return found + [" ".join(each.split()) for each in re.findall(r"`pyharness ([^`]*)`", prose)]


def test_notes_have_the_exercises_of_the_lesson() -> None:
    titles, again = (re.findall(r"^## (Exercise \d: .*)$", x, re.M) for x in (LESSON, NOTES))
    assert len(titles) == 6
    assert titles == again
    for number in range(1, 7):
        assert f"*Exercise {number}.*" in HINTS
        assert f"\n| {number} | `pyharness" in CHECKS
    parts = re.split(r"^## ", EXERCISES, flags=re.MULTILINE)[-6:]
    for each in parts:
        for head in ("**Cards**", "**Question.**", "**Run**", "**You have understood**"):
            assert head in each
    for each in re.split(r"^## ", NOTES, flags=re.MULTILINE)[1:7]:
        for head in ("**Solution.**", "**Where students go wrong.**", "**Today.**"):
            assert head in each


def test_plans_of_the_class_agree_with_the_times() -> None:
    minutes = [int(each) for each in re.findall(r"^\| \[\d\].*\| (\d+) min \|$", NOTES, re.M)]
    assert len(minutes) == 6
    assert f"exercises together take an estimated {sum(minutes)} minutes" in " ".join(NOTES.split())
    assert "take three to four hours" in " ".join(LESSON.split())
    assert 180 < sum(minutes) < 240
    assert minutes[2] + minutes[5] <= 90 - 10 - 20
    for first, second in ((4, 5), (1, 4), (2, 6)):
        assert minutes[first - 1] + minutes[second - 1] <= 120 - 10 - 20
    assert max(minutes) + 6 * 7 <= 120 - 10 - 20


def test_cards_are_those_of_the_decks() -> None:
    quoted = 0
    for part in re.split(r"(?=\*\*Cards\*\*)", EXERCISES)[1:]:
        (program,) = re.findall(r"^\*\*Cards\*\* of the `(\S+)` deck", part)
        assert program in PROGRAMS
        lines = deck_text(Listing.original(program)).splitlines()
        for block in re.findall(r"```fortran\n(.*?)```", part, re.DOTALL):
            for line in block.splitlines():
                assert line in lines, (program, line)
                quoted += 1
    assert quoted > 40


def test_no_fault_is_named_before_the_hints() -> None:
    """Neither are the commands of the exercises among those that name the faults."""
    for each in entries():
        assert each["id"] not in EXERCISES + HINTS, each["id"]
    told = ("cards", "defects", "claims", "limits", "--ablate")
    runs = _commands(EXERCISES)
    assert len(runs) > 10
    for command in runs:
        if command not in ("cards", "defects", "run"):  # the introduction advises against these
            assert not any(word in command.split() for word in told), command
            if command.startswith("run"):
                assert "--format" in command, command


def _marked(command: str) -> Any:
    # The references of all cases take seconds.
    slow = [pytest.mark.campaign] if command.startswith("claims --explain") else []
    return pytest.param(command, marks=slow)


@pytest.mark.parametrize("command", [_marked(x) for x in _commands(LESSON) + _commands(NOTES)])
def test_commands_run(command: str, printed: Printed, tmp_path: Path, monkeypatch: Patch) -> None:
    if command in ("cards", "defects", "run"):  # a verb, without its options
        return
    monkeypatch.chdir(tmp_path)
    words = command.replace("--case N", "--case 3")
    if not words.startswith("edition"):
        assert printed(words) or any(tmp_path.iterdir())


ORIGINAL = Listing.original("runge-kutta")
Changes = Sequence[tuple[str, str, str]]
MINUS_A = ("800", "R1+A", "R1-A")
U1_FOR_U3 = ("800", "U3(J)", "U1(J)")
FIFTHS = ("1180", "DT/6.", "DT/5.")
WEIGHTS = ("1180", "KF(1)+2.*(KF(2)+KF(3))+KF(4)", "2.*(KF(1)+KF(4))+KF(2)+KF(3)")
I2_30 = ("200", "40.", "30.")
I3_20 = ("210", "40.", "20.")
BASE, BASE_OF_V = (
    [(str(n + 10 * k), f"={x}{k + 1}(J)", f"={x * 2}{k + 1}") for n in cards for k in range(3)]
    for x, cards in (("U", (860, 1040)), ("V", (890, 1070)))
)
RESET = "\n".join(f"      {name}{k}(1)={name}{k}(4)" for name in "UV" for k in (1, 2, 3))


def _page(deck: str, changes: Changes, added: Mapping[str, str] = {}) -> list[list[str]]:
    """Change cards (old and new text), add text after cards, and return the words of each line."""
    lines = deck.splitlines()

    def index_of(card: str) -> int:
        (index,) = [n for n, line in enumerate(lines) if line.split()[-1] == card]
        return index

    for card, old, new in changes:
        index = index_of(card)
        assert old in lines[index]
        text = lines[index][:72].replace(old, new).rstrip()
        lines[index] = f"{text:72}{lines[index][72:]}"
    for card, text in added.items():
        lines.insert(index_of(card) + 1, text)
    return [line.split() for line in run_deck("\n".join(lines) + "\n").page.splitlines()]


def _last_line(case: int, *given: Any, listing: Listing = ORIGINAL) -> list[str]:
    return _page(deck_text(listing, case_scene(case), "gfortran"), *given)[-1]


@pytest.mark.sampled
@pytest.mark.skipif(compiler() is None, reason="no gfortran")
@pytest.mark.parametrize(("case", "changes", "end", "first", "step"), [
    (1, [], "", "3.5000", "100"), (1, [MINUS_A], "", "3.5000", "100"),
    (1, [U1_FOR_U3], "", "3.5000", "100"), (1, [FIFTHS], "", "4.0000", "100"),
    (1, [WEIGHTS], "", "3.5000", "100"), (1, [I2_30], "", "2.6210", "100"),
    (1, [I2_30, MINUS_A], "", "3.4844", "100"), (1, [I2_30, U1_FOR_U3], "", "2.6946", "100"),
    (1, [I2_30, FIFTHS], "", "2.9451", "100"), (1, [I2_30, WEIGHTS], "", "2.6184", "100"),
    (2, [], "", "1.1631", "25"), (2, BASE, "", "0.9538", "25"),
    (2, BASE, RESET, "0.6052", "13"), (2, [*BASE, *BASE_OF_V], RESET, "0.9996", "32"),
])  # fmt: skip
def test_changed_decks_are_told(
    case: int, changes: Changes, end: str, first: str, step: str
) -> None:
    found = _last_line(case, changes, {"1530": end} if end else {})
    assert (found[0], found[3]) == (first, step)
    told = {"0.9538": "be much closer", "0.9996": "stops at step 32"}.get(first, first)
    assert told in LESSON + NOTES


@pytest.mark.campaign
@pytest.mark.skipif(compiler() is None, reason="no gfortran")
def test_other_moments_in_case_1_have_the_effects_that_the_notes_say() -> None:
    corrected = Listing.corrected("runge-kutta")
    for changes in ([I2_30], [I2_30, WEIGHTS]):
        assert _last_line(1, changes, listing=corrected)[0] == "1.4609"
    assert "prints U1 = 1.4609 both with and without change 4" in " ".join(NOTES.split())
    assert _last_line(1, [I3_20])[3] == "57"
    assert "the stop test ends the run at step 57" in " ".join(NOTES.split())
    for change in (MINUS_A, U1_FOR_U3, WEIGHTS):
        other_i1 = [("190", "40.", "30.")]
        assert _last_line(1, [*other_i1, change]) == _last_line(1, other_i1)


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
def test_mended_deck_is_stopped_by_v2_as_the_notes_say() -> None:
    deck = deck_text(ORIGINAL, case_scene(2), "gfortran")
    quotient = "      WRITE(6,*)XL1/XL2,YL1/YL2,ZL1/ZL2,FL1/FL2,GL1/GL2"
    *_, last, quotients = _page(deck, BASE, {"1530": RESET, "1390": quotient})
    assert last[:4] == [*(f"{each:.4f}" for each in (sin(0.65), cos(0.65), 10)), "13"]
    assert [float(each) > 500 for each in quotients] == [False, True, False, False, False]
    assert round(float(quotients[1])) == 6694
    assert last[5] == "0.0116"
    later = _page(deck, [*BASE, ("1390", "500.", "1.E30")], {"1530": RESET})[-100:]
    assert max(float(each[5]) for each in later[:30]) == float(last[5])
    for told in ("its quotient was 6694", "right: 0.6052, 0.7961 and 10.0000", "0.0116 m/s"):
        assert told in " ".join(NOTES.split())


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
def test_two_term_deck_has_the_effects_that_lesson_and_notes_say() -> None:
    deck = deck_text(Listing.original("two-term"), case_scene(2), "gfortran")
    at_rest = [("310", "1.", "0."), ("320", "10.", "0.")]
    first = [_page(deck, [*at_rest, ("610", "20.", force)])[-100] for force in ("20.", "200.")]
    assert [each[5] for each in first] == ["0.0014", "0.0096"]
    assert "is 0.0096 instead of 0.0014 m/s" in " ".join(NOTES.split())
    deck = deck_text(Listing.original("two-term"), case_scene(5), "gfortran")
    cards = [line.split()[-1] for line in deck.splitlines() if ".01 " in line]
    assert cards == ["670", "730", "1660"]
    halved = [("690", "100,1", "200,1"), *((card, ".01", ".005") for card in cards)]
    scene = replace(case_scene(5), step_size=0.005, steps=200)
    omega = run_program(scene, Listing.original("two-term")).omega[-1]
    assert _page(deck, halved)[-1][:4] == [*(f"{each:.4f}" for each in omega), "200"]


def test_numbers_of_the_solutions_are_computed() -> None:
    runpy.run_path(str(DOCS / "tutorials/lesson_solutions.py"))


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
@pytest.mark.parametrize("program", ["runge-kutta", "two-term"])
def test_decks_are_compiled_and_run_as_the_lesson_says(
    program: str, printed: Printed, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```sh\n(.*?)```", EXERCISES, re.DOTALL)
    (block,) = (each for each in blocks if "gfortran -std" in each and program in each)
    for line in block.splitlines():
        if line.startswith("pyharness "):
            printed(line.removeprefix("pyharness "))
        else:
            subprocess.run(line, shell=True, check=True, stdout=subprocess.DEVNULL)
    (case,) = re.findall(r"--case (\d)", block)
    page = printed(f"run --case {case} --program {program} --format printer")
    assert Path("TAPE6").read_text().split()[-7:] == page.split()[-7:]


def test_addresses_of_the_laboratory_are_understood() -> None:
    words = re.findall(r"`laboratory\.html#([^`]*)`", CHECKS)
    assert len(words) == 6
    found = run_javascript(
        {"S": WEB / "laboratory/state.js"},
        "return given.map((each) => S.stateFrom(data, each));",
        data=data(), given=words,
    )  # fmt: skip
    assert [each["problems"] for each in found] == [[]] * 6
    kept = [each["state"]["active"] for each in found]
    assert kept[3] == ["stage-base"]
    assert kept[5] == ["lipschitz-per-component"]


def test_terms_that_documents_link_are_in_the_glossary() -> None:
    """A link to the glossary whose text is not the word "glossary" marks a term."""
    linked = 0
    for path in DOCS.rglob("*.md"):
        for text in re.findall(r"\[([^]]*)\]\([^)]*glossary\.md\)", path.read_text()):
            term = re.sub(r"(?<=\w)s$", "", " ".join(text.split()))
            assert {term, " ".join(text.split())} & (TERMS | {"glossary"}), (path.name, text)
            linked += term != "glossary"
    assert linked > 10
    assert [each.lower() for each in GLOSSARY] == sorted(each.lower() for each in GLOSSARY)


def test_lesson_is_linked_from_the_site(built_site: dict[str, bytes]) -> None:
    names = ("tutorials/lesson.md", "tutorials/lesson-notes.md", "explanation/about-the-text.md")
    for name in names:
        page = page_of(name)
        assert page in built_site
        assert f'href="{page}"' in html.unescape(built_site["about.html"].decode())
        assert f'"{page.removeprefix("docs/")}"' in built_site["docs/index.html"].decode()

"""Decks: the original text, the altered cards, and a few decks compiled."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from pyharness.checks.cells import decks
from pyharness.checks.check import Selection
from pyharness.cli.main import main
from pyharness.history.claims.laboratory import Laboratory
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.scene_file import case_scene
from pyharness.thesis import decks as punched
from pyharness.thesis.cards import deck
from pyharness.thesis.decks import alterations, compiler, deck_text, run_deck
from tests.conftest import Patch, ResultOf


def _cards(text: str) -> dict[int, str]:
    return {int(line[73:]): line[:72].rstrip() for line in text.splitlines()}


@pytest.mark.parametrize("program", PROGRAMS)
def test_text_of_1982_is_that_of_the_cards(program: str) -> None:
    text = deck_text(Listing.original(program))
    assert all(len(line) == 80 for line in text.splitlines())
    assert _cards(text) == {n: card.text.rstrip() for n, card in deck(program).cards.items()}


@pytest.mark.parametrize("program", PROGRAMS)
def test_corrected_deck_differs_by_the_alterations_alone(program: str) -> None:
    listings = (Listing.original(program), Listing.corrected(program))
    before, after = (_cards(deck_text(listing)) for listing in listings)
    altered = [
        each for each in alterations()
        if each["program"] == program and "dialect" not in each
        and ("corrects" in each or each.get("listing") == "corrected")
    ]  # fmt: skip
    corrects = {each["corrects"] for each in altered if "corrects" in each}
    assert corrects == set(names_of("defect", program))
    # No card has the torque of Case 7; the dialect inserts it.
    new = {n for each in altered if "keeps" not in each for key in ("replace", "insert")
           for n, _ in each.get(key, ())}  # fmt: skip
    assert {n for n, text in after.items() if before.get(n) != text} == new
    for n in set(after) - set(before):
        assert n % 10 != 0  # numbered between its neighbours


@pytest.mark.parametrize("case", [1, 2, 5, 7])
def test_case_stands_on_the_cards_of_the_deck(case: int) -> None:
    scene = case_scene(case)
    cards = _cards(deck_text(Listing.original("two-term"), scene))
    shown = [float(cards[n].partition("=")[2]) for n in (200, 210, 220, 300, 310, 320)]
    assert shown == [*(scene.moments or ()), *scene.omega]
    assert cards[690].split() == ["DO", "100", "I=1,100,1"]
    # Table 1 gives initial torques in Case 7.
    assert cards[250].strip() == ("N1=0." if case == 2 else "N1=100.")


@pytest.mark.parametrize("system", punched.SYSTEMS)
@pytest.mark.parametrize("rounds", [False, True])
@pytest.mark.parametrize("program", PROGRAMS)
def test_job_for_ftn_has_the_cards_as_they_are(program: str, rounds: bool, system: str) -> None:
    listing = Listing.original(program)
    job = punched.job_text(deck_text(listing, None, "ftn"), system, rounds)
    control, _, rest = job.partition("~eor\n")
    assert rest.startswith(deck_text(listing))
    after = rest.removeprefix(deck_text(listing))
    assert ("SUBROUTINE LEQT1F" in after) == (program != "runge-kutta") == bool(after)
    (compiles,) = (line for line in control.splitlines() if line.startswith("FTN"))
    assert ("ROUND=+-*/" in compiles) == rounds
    assert [line[:3] for line in control.splitlines()][-3:] == ["LGO", "REW", "COP"]
    # A card has 80 columns, and the machine has no lower-case letters.
    cards = [line for line in job.splitlines()[6:] if line[0] != "~"]
    assert all(len(line) <= 80 and line == line.upper() for line in cards)


def test_dialect_of_today_adds_marked_lines_alone() -> None:
    seven = deck_text(Listing.original("two-term"), case_scene(7), "ftn")
    assert "SIN(100.*TIME)" in seven
    assert "OPEN(" not in seven
    listing = Listing.original("runge-kutta")
    assert "I=2 " not in deck_text(listing, None, "ftn")
    old, new = (deck_text(listing, None, dialect).splitlines() for dialect in ("1982", "gfortran"))
    marked = [line for line in new if line[72] == "+"]
    assert [line for line in new if line[72] == " "] == old[1:]
    assert [line[6:72].strip() for line in marked] == [
        "PROGRAM RK", "OPEN(5,FILE='TAPE5',FORM='UNFORMATTED')", "OPEN(6,FILE='TAPE6')", "I=2",
    ]  # fmt: skip
    reading = subset("runge-kutta", readings=["do-variable"])
    assert "I=2  " not in deck_text(reading, None, "gfortran")
    # A corrected deck needs no rule for the variable of a DO, in any dialect.
    for dialect in punched.DIALECTS:
        text = deck_text(Listing.corrected("runge-kutta"), None, dialect)
        assert _cards(text)[930].strip() == "I=3"
        assert "I=2  " not in text


@pytest.mark.campaign
@pytest.mark.skipif(compiler() is None, reason="no gfortran")
def test_decks_and_port_agree(monkeypatch: Patch) -> None:
    found = list(decks(Selection(thin=True)))
    assert len(found) == 3
    assert all(check.passed and check.value == 0.0 for check in found)
    # A change of one card, and a stop that comes too late, are found.
    for wrong in ("T3=.02", "T3=.010000000000000002"):
        monkeypatch.setattr(
            "pyharness.checks.cells.deck_text",
            lambda *given, wrong=wrong: deck_text(*given).replace("T3=.01", wrong.ljust(6)),
        )
        failed = [check for check in decks(Selection(thin=True)) if not check.passed]
        assert [check.id for check in failed] == ["decks/two-term/case-3/original"]


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [("1HI", "1HJ", "the page differs"), ("GO TO 8 ", "J=3     ", "75 records more")],
)
def test_page_and_records(old: str, new: str, told: str, monkeypatch: Patch) -> None:
    changed = "pyharness.checks.cells.deck_text"
    monkeypatch.setattr(changed, lambda *given: deck_text(*given).replace(old, new))
    (check,) = decks(Selection(only=["decks/runge-kutta/case-2/original"]))
    assert not check.passed
    assert told in check.note


def test_without_a_compiler_verify_says_so(monkeypatch: Patch, result_of: ResultOf) -> None:
    for room in ("checks.cells", "cli.verbs.verify"):
        monkeypatch.setattr(f"pyharness.{room}.compiler", lambda: None)
    assert list(decks(Selection(only=["decks"]))) == []
    assert "gfortran" in result_of(["verify", "--only", "decks"], 2).err
    assert "decks: not run" in result_of(["verify", "--only", "decks,orders/rk4/case-5"]).out


def test_model_of_four_terms_is_the_deck_but_for_its_points() -> None:
    printed, made = deck("four-term").cards, punched.model_cards(4)
    assert set(printed) == set(made)
    points = {720: "T1=DT*1./5.", 730: "T2=DT*2./5.", 740: "T3=DT*3./5.", 750: "T4=DT*4./5."}
    sizes = (110, 120, 150, 190)
    for number, text in made.items():
        assert text.strip() == points.get(number, printed[number].text.strip()) or number in sizes


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
@pytest.mark.parametrize("terms", [3, 5])
@pytest.mark.parametrize("is_original", [True, False])
def test_models_of_case_6_are_those_of_the_claims(terms: int, is_original: bool) -> None:
    listing = (Listing.original if is_original else Listing.corrected)("four-term")
    run = run_deck(deck_text(listing, case_scene(6), "gfortran", terms))
    wanted = Laboratory(is_original).models(6, terms)
    np.testing.assert_allclose(run.tape5[:, 1:4], wanted, rtol=1e-11, atol=1e-11)


@pytest.mark.skipif(compiler() is None, reason="no gfortran")
@pytest.mark.parametrize("program", PROGRAMS)
def test_deck_for_gfortran_is_linked_without_other_files(program: str, tmp_path: Path) -> None:
    file = tmp_path / "deck.f"
    main(["deck", "--program", program, "--dialect", "gfortran", "--out", str(file)])
    command = ["gfortran", "-w", "deck.f", "-o", "deck"]
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0

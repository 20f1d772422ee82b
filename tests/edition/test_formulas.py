"""All formulas of the thesis are present as printed, with the cards that the port cites."""

import re
from pathlib import Path
from typing import Any

import pytest

from pyharness.edition.ledger import formulas
from pyharness.history.ablation import entries, entry
from pyharness.model.facts import facts, shipped
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import deck, numbers

FORMULAS: list[dict[str, Any]] = facts("formulas")["formula"]
THESIS = Path(__file__).parents[3] / "shared/thesis/thesis.txt"
VELOCITY = entry("translational-block")["cards"]  # the cards of the translational velocity


def _first_to_last(number: str) -> list[str]:
    first, _, last = number.partition("-")
    return [str(n) for n in range(int(first), int(last) + 1)] if last else [number]


BY_NUMBER = {n: each for each in FORMULAS for n in _first_to_last(each.get("number", "")) if n}


def _cards(formula: dict[str, Any], program: str) -> set[int]:
    return set(numbers(formula.get("cards", {}).get(program, "")))


def _omega(program: str, found: set[int]) -> set[int]:
    """Return the cards that are not about the translational velocity alone."""
    return found - set(numbers(VELOCITY[program]))


def test_equations_are_there_once_and_their_cards_are_no_comments() -> None:
    listed = [n for each in FORMULAS for n in _first_to_last(each.get("number", "")) if n]
    assert listed == [*map(str, range(5, 35)), "34a", "35", "36", "36a"]
    sections = [each["where"][: each["where"].index(".")] for each in FORMULAS]
    assert sections == sorted(sections, key=["II", "III", "IV"].index)
    assert list(formulas()) == ["II", "III", "IV"]
    for each in FORMULAS:
        assert set(each.get("cards", {})) <= set(PROGRAMS)
        for program in each.get("cards", {}):
            cards = deck(program).cards
            assert all(not cards[n].is_comment for n in _cards(each, program)), each["where"]
            # A formula of the rotation is on no card of the translational velocity, except that
            # the stop test reads the velocity too.
            cited = _cards(each, program)
            assert each.get("number") == "19" or _omega(program, cited) == cited, each["tex"]
    known = {each["id"] for each in entries()}
    assert {each["entry"] for each in FORMULAS if "entry" in each} <= known


@pytest.mark.parametrize(("number", "letter"), [("16", "F"), ("17", "G"), ("18", "H")])
@pytest.mark.parametrize("program", PROGRAMS)
def test_rates_are_all_the_cards_that_compute_them(number: str, letter: str, program: str) -> None:
    assigned = re.compile(rf"K?{letter}(\d|\([LI]\))=[MR]\d\+")
    computing = {n for n, card in deck(program).cards.items() if assigned.match(card.text[6:])}
    assert computing == _cards(BY_NUMBER[number], program) != set()


def _cited(text: str) -> list[str]:
    """Return the numbers of the equations that a text cites: `eq. 16-18` is three."""
    found = re.findall(r"\b(?:eq\.|equations?) (\d+a?(?:-\d+)?)", text)
    return [number for each in found for number in _first_to_last(each)]


def _of_the_port(program: str) -> dict[str, set[int]]:
    """Return, by equation, the cards in the margin of the port's lines under its citation.

    A citation is a comment on a line of its own; it ends with the next such comment, or where there
    is a blank line.
    """
    file = shipped("fortran/original") / f"{program.replace('-', '_')}.fypp"
    found: dict[str, set[int]] = {}
    cited: list[str] = []
    for line in file.read_text().splitlines():
        if comment := re.fullmatch(r"\s+! (.*)", line):
            cited = _cited(comment[1])
        elif not line.strip():
            cited = []
        elif margin := re.search(r"! (\d+(?:-\d+)?)$", line):
            for number in cited:
                found.setdefault(number, set()).update(numbers(margin[1]))
    return found


@pytest.mark.parametrize("program", PROGRAMS)
def test_cards_are_those_under_the_citation_of_the_port(program: str) -> None:
    cited = _of_the_port(program)
    expected = {"two-term": {"34", "36"}, "four-term": set(), "runge-kutta": {"19", "31"}}
    assert set(cited) == expected[program], "the port cites other equations: extend this list"
    for number, cards in cited.items():
        known = deck(program).cards
        assert cards <= set(known), "the margin of the port names a card that the deck lacks"
        cards = {n for n in cards if known[n].text[6:].lstrip()[:5] != "WRITE"}
        assert _omega(program, cards) <= _cards(BY_NUMBER[number], program), (
            f"the margin under the citation of equation {number} names a card that its cards in "
            "data/formulas.toml lack: add it, or end the citation by a blank line"
        )


def test_coefficients_are_on_the_cards_that_the_port_cites() -> None:
    text = (shipped("fortran/original") / "deck.fypp").read_text()
    ranges = r"Two-term (\S+), four-term (\S+), Runge-Kutta (\S+)\."
    (told,) = re.findall(rf"of equations 13-15\. {ranges}", text)
    for program, cards in zip(PROGRAMS, told, strict=True):
        assert set(numbers(cards)) <= _cards(BY_NUMBER["13"], program)


def test_cards_are_those_of_the_collation() -> None:
    steps = {each["where"]: each for each in FORMULAS if re.match(r"IV\.2 [a-i]$", each["where"])}
    known = BY_NUMBER | steps
    compared = 0
    for row in facts("cards/collation")["row"]:
        text = row.get("text", "")
        for place in {*_cited(text), *({*re.findall(r"IV\.2 [a-i]", text)} & steps.keys())}:
            # What the row says of the other method is about another formula of the same row.
            own = set(PROGRAMS)
            if place in ("19", "31"):
                own = {"runge-kutta"}
            elif place in steps or place.startswith("3"):
                own = {"two-term", "four-term"}
            for program in own:
                cards = _omega(program, set(numbers(row["cards"].get(program, ""))))
                alike = ("16", "17", "18") if place in ("16", "17", "18") else (place,)
                together = set().union(*(_cards(known[each], program) for each in alike))
                assert cards <= together, (row["what"], place, program)
                compared += len(cards)
    assert compared > 100


def _letters(tex: str) -> str:
    """Return a formula without blanks, braces, signs of layout and subscript marks."""
    tex = re.sub(r"\\(quad|begin|end)\b(\{\w+\})?|\{array\}|\{aligned\}", "", tex)
    return re.sub(r"[\s{}_$&]|\\\\", "", tex)


@pytest.mark.skipif(not THESIS.exists(), reason="the text of the thesis is not beside the project")
def test_formulas_are_those_of_the_thesis() -> None:
    text = THESIS.read_text()
    text = text[text.index("## SECTION II\n") : text.index("## SECTION V\n")]
    printed = _letters(text)
    for each in FORMULAS:
        for line in each["tex"].strip().split("\n"):
            assert _letters(line) in printed, line
    # No formula with a number is left out.
    tags = set(re.findall(r"\((\d+a?)\)[$\s]", re.sub(r"\\quad|\\tag", " ", text)))
    assert {n for n in tags if int(re.sub("a", "", n)) > 7} <= set(BY_NUMBER)


def test_formulas_are_on_the_page_with_their_cards(built_site: dict[str, bytes]) -> None:
    page = built_site["thesis.html"].decode()
    for number in (each["number"] for each in FORMULAS if "number" in each):
        assert f'id="equation-{number}"' in page
    _, _, after = page.partition('id="equation-36a"')
    block = after.partition("</li>")[0]
    assert "<mtable>" in block
    assert 'href="listing/two-term.html#820"' in block
    assert "lipschitz-per-component" in page.partition('id="equation-19"')[2].partition("</li>")[0]

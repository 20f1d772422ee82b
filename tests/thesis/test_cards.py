"""The text of the edition: explained to the last character, with its places in port and twin."""

import json
import re
from pathlib import Path

import pytest

from pyharness.cli.main import main
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis import collation
from pyharness.thesis.cards import Card, Difference, chosen, deck, numbers
from pyharness.thesis.collation import HEADING, expected_lines, undeclared, unexplained
from tests.conftest import Printed

_ABSENT = "absent of cards/places.toml"
SCAN = Path(__file__).parents[3] / "shared" / "thesis" / "thesis.txt"
# Forms that the port writes otherwise in every statement: kinds, spaces, powers, torques by point.
FORMS = (
    (r"_wp|\s|&$", ""), (r"(?<=\d)\.0(?!\d)", "."), (r"(?<![\d.])0\.(?=\d)", "."),
    (r"\b([MR][123])\(\w\)", r"\1"), (r"\bT([123])2\b", r"T\1**2"), (r"\bTL([234])\b", r"T(L)**\1"),
    (r"\((T\d)\*\1\*\1\)", r"\1**3"), (r"\((T\d)\*\1\)", r"\1**2"),
)  # fmt: skip


@pytest.fixture(scope="module")
def scan() -> str:
    """Return a scan that the tables explain, because it is made from them."""
    lines = [text for text, _ in expected_lines()]
    return "\n".join(["the thesis", HEADING, "", *lines[:40], "```", "", *lines[40:]])


def test_decks_are_whole() -> None:
    assert {each: len(deck(each).cards) for each in PROGRAMS} == facts("cases")["cards"]
    assert sum(card.scan is None for card in chosen(())) == 7
    # Cards that deviate in more than their number, for which an edition needs a reason.
    assert sum(bool(card.differences or card.lost) for card in chosen(())) == 202


def test_every_deviation_is_declared_by_an_entry_for_that_card() -> None:
    assert undeclared() == []
    names = {each["id"] for each in facts("apparatus")["entry"]}
    phantoms = [i for page in facts("cards/scan")["page"] for i in page["lines"] if "entry" in i]
    assert {each["entry"] for each in phantoms if isinstance(each, dict)} <= names


@pytest.mark.parametrize("change", ["pair", "card", "printed"])
def test_what_is_not_declared_is_found(change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [dict(each) for each in facts("apparatus")["entry"]]
    for entry in entries:
        if entry["id"] == "noise-names" and change != "printed":
            pairs = [list(each) for each in entry["pairs"]]
            if change == "pair":
                pairs = pairs[1:]
            else:
                pairs[0] = [*pairs[0][:2], {**pairs[0][2], "two-term": "450-480, 630-650"}]
            entry["pairs"] = pairs
        if entry["id"] == "noise-numbers" and change == "printed":
            entry["printed"] = [[p, c, first + 10, step] for p, c, first, step in entry["printed"]]
    tables = {"apparatus": {"entry": entries}}
    monkeypatch.setattr(collation, "facts", lambda name: tables.get(name) or facts(name))
    assert undeclared()


@pytest.mark.campaign
@pytest.mark.parametrize("change", ["replaced", "removed", "added"])
def test_a_character_changed_anywhere_is_found(scan: str, change: str) -> None:
    """For every k, change the k-th characters of all lines at once; each line must be found."""
    head, heading, appendix = scan.partition(HEADING)
    lines = appendix.split("\n")
    kept = [n for n, line in enumerate(lines) if line not in ("", "```")]
    for k in range(max(map(len, lines)) + 1):
        changed = list(lines)
        for n in kept:
            line = lines[n]
            if change == "added" and k <= len(line):
                changed[n] = line[:k] + "7" + line[k:]
            elif change == "replaced" and k < len(line):
                changed[n] = line[:k] + ("8" if line[k] == "7" else "7") + line[k + 1 :]
            elif change == "removed" and k < len(line) and len(line) > 1:
                changed[n] = line[:k] + line[k + 1 :]
        touched = {n for n in kept if changed[n] != lines[n]}
        assert len(unexplained(head + heading + "\n".join(changed))) == len(touched), k
    for n, line in enumerate(lines[1:], 1):  # blank lines and fences
        if n not in kept:
            changed = [*lines[:n], line + "7", *lines[n + 1 :]]
            assert len(unexplained(head + heading + "\n".join(changed))) == 1


@pytest.mark.parametrize("change", ["lost", "twice", "swapped", "joined"])
def test_a_line_out_of_place_is_found(scan: str, change: str) -> None:
    lines = scan.split("\n")
    at = lines.index("300-U1(1)=0.")
    one, next_ = lines[at : at + 2]
    lines[at : at + 2] = {
        "lost": [next_], "twice": [one, one, next_], "swapped": [next_, one],
        "joined": [one + next_],
    }[change]  # fmt: skip
    assert unexplained("\n".join(lines))


@pytest.mark.skipif(not SCAN.exists(), reason="the text of the thesis is not beside the project")
def test_scan_of_the_thesis_is_explained() -> None:
    text = SCAN.read_text()
    assert unexplained(text) == []
    lines = [line.rstrip() for line in text.rpartition(HEADING)[2].splitlines()]
    kept = [line for line in lines if line.strip() not in ("", "```")]
    cards = [line for line, (_, name) in zip(kept, expected_lines(), strict=True) if ":" in name]
    assert list(collation.witness_lines().values()) == cards


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_executable_card_has_its_place(program: str) -> None:
    found = deck(program)
    port, absent, twin = set(found.port), set(found.absent), set(found.twin)
    assert port <= found.executable, "the margin of the port names a card that is not executable"
    assert absent <= found.executable, f"{_ABSENT} names a card that is not executable"
    assert port | absent >= found.executable, f"name it in the margin of the port or in {_ABSENT}"
    assert not port & absent, f"the margin of the port names a card that is in {_ABSENT}"
    assert twin <= found.executable, "twin of cards/places.toml names a card that is not executable"
    assert found.executable - twin <= absent, "name it in twin of cards/places.toml"


@pytest.mark.parametrize("program", PROGRAMS)
def test_statements_of_the_port_are_those_of_their_cards(program: str) -> None:
    def as_on_card(statement: str) -> str:
        for pattern, new in FORMS:
            statement = re.sub(pattern, new, statement)
        return {"endif": "", "enddo": ""}.get(statement, statement).upper().rstrip("+")

    found = deck(program)
    assert set(found.port) <= set(found.cards), (
        "the margin of the port names a card that the deck lacks"
    )
    for number, places in found.port.items():
        card = "".join(found.cards[number].text[6:].split()).rstrip("+").replace("T5**", "T(L)**")
        said = [as_on_card(place.text) for place in places]
        assert card in said or number in found.otherwise, (
            f"the margin of the port names card {number}, {card}, beside {said}: name another "
            "card, or this one in otherwise of cards/places.toml"
        )
        assert card not in said or number not in found.otherwise, (
            f"the port has card {number} as it is: remove it from otherwise of cards/places.toml"
        )


def test_cards_are_found() -> None:
    assert [card.name for card in chosen(["1660"])] == ["two-term:1660", "four-term:1660"]
    assert len(chosen(["two-term"])) == 159
    assert [card.number for card in chosen(["runge-kutta:1010-1030"])] == [1010, 1020, 1030]
    card = chosen(["two-term:1260"])[0]
    assert card.statement == "X3=ACL2+V2(3)*U3(3)-V3(3)*U2(3)"
    assert card.scan == "1260-X3=ACL2+U2(3)*U3(3)-U3(3)*U2(3)"
    assert set(card.entries) >= {"x3-reads-acl2", "noise-u-for-v"}
    assert numbers("750-770, 800") == [750, 760, 770, 800]
    assert numbers("") == []


def test_scan_is_told(scan: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scan.txt"
    path.write_text(scan)
    assert main(["cards", "--scan", str(path)]) == 0
    told = capsys.readouterr().out
    assert "nothing is unexplained" in told
    assert "it is another text" in told
    path.write_text(scan.replace("300-U1(1)=0.", "300-U1(1)=8.", 1))
    assert main(["cards", "--scan", str(path), "--format", "json"]) == 1
    (fault,) = json.loads(capsys.readouterr().out)["unexplained"]
    line = scan.split("\n").index("300-U1(1)=0.") + 1
    assert fault == f"line {line}, two-term:300: '300-U1(1)=8.', where the table has '300-U1(1)=0.'"


@pytest.mark.sampled
@pytest.mark.parametrize("asked", ["1260", "two-term:330-380", "runge-kutta:1010-1040", ""])
def test_cards_are_told_in_100_columns(asked: str, printed: Printed) -> None:
    assert max(map(len, printed(f"cards {asked}").splitlines())) <= 100


def test_cards_without_arguments_are_contents(printed: Printed) -> None:
    lines = printed("cards").splitlines()
    assert len(lines) < 40
    assert ["LIPSCHITZ", "CONDITIONS", "-", "-", "1270-1600"] in [line.split() for line in lines]
    for program in PROGRAMS:
        for number, card in deck(program).cards.items():
            if card.is_comment and " " in card.statement and number > 200:
                assert card.statement.partition(" ")[2] in "\n".join(lines), card.name
    assert len(json.loads(printed("cards --format json"))["cards"]) == 528


def test_record_of_a_card(printed: Printed) -> None:
    first, second = json.loads(printed("cards two-term:1650-1660 --format json"))["cards"]
    assert (first["card"], first["scan"]) == (1650, "1650-U3(1)=U3(4)")
    assert first["statement"] == "V3(1)=V3(4)"
    assert (second["scan"], second["entries"]) == (None, ["dt-accumulates", "step-literals"])
    for places in (second["fortran"], second["twin"]):
        assert places[0]["text"].upper().startswith("DT = DT +")
    assert second["parallels"] == ["four-term:2250"]
    assert "dt-accumulates: DT grows" in printed("defects two-term:1660")


def test_pieces_of_a_text_hold_their_blanks() -> None:
    why = Difference("BC", "X", "why")
    pieces = [(" A ", None), ("B C", why), ("D E", None)]
    assert list(Card("two-term", 100, " A B CD E", (why,)).passages()) == pieces
    # Each passage begins after the one before it.
    with pytest.raises(ValueError, match="'BC' does not stand in ' A B CD E'"):
        list(Card("two-term", 100, " A B CD E", (why, why)).passages())

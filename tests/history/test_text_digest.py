"""The digest of the text: only cards and apparatus change it."""

import copy
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pyharness.cli.main import main
from pyharness.history.tei import tei_document
from pyharness.history.text_digest import TABLES, text_digest
from pyharness.model.facts import facts, shipped
from pyharness.original import cards, port_lines


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a copy of the port with which the cards are compared."""
    folder = tmp_path / "original"
    shutil.copytree(shipped("fortran/original"), folder)
    monkeypatch.setattr(port_lines, "shipped", lambda _: folder)
    cards.deck.cache_clear()
    yield folder
    cards.deck.cache_clear()


def test_a_comment_in_the_port_moves_the_places_and_not_the_text(port: Path) -> None:
    before = tei_document(), text_digest()
    for file in port.glob("*.fypp"):
        file.write_text(f"! A comment.\n{file.read_text()}")
    for cached in (cards.deck, port_lines._lines):
        cached.cache_clear()
    after = tei_document(), text_digest()
    assert after[0] != before[0]
    assert after[1] == before[1]


def _changed(name: str, content: Any) -> Iterator[Any]:
    """Yield copies of a table, each with one change."""
    rows = content["entry"] if name == "apparatus" else list(content["cards"].values())
    for index in (0, len(rows) // 2, len(rows) - 1):
        for key, value in rows[index].items():
            again = copy.deepcopy(content)
            row = (again["entry"] if name == "apparatus" else list(again["cards"].values()))[index]
            row[key] = [*value, "x"] if isinstance(value, list) else f"{value}x"
            yield again
    again = copy.deepcopy(content)
    if name == "apparatus":
        del again["entry"][1]
    else:
        del again["cards"][next(iter(again["cards"]))]
    yield again


@pytest.mark.parametrize("name", TABLES)
def test_every_card_and_every_entry_moves_it(name: str) -> None:
    found = {text_digest()}
    count = 1
    for again in _changed(name, facts(name)):
        tables = {table: facts(table) for table in TABLES} | {name: again}
        found.add(text_digest(tables.__getitem__))
        count += 1
    assert len(found) == count >= 5


def test_nothing_else_has_a_part_in_it() -> None:
    asked: list[str] = []

    def table(name: str) -> Any:
        asked.append(name)
        return facts(name)

    assert text_digest(table) == text_digest()
    assert asked == [*TABLES]


def test_verb_cites_by_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cards", "--classes"]) == 0
    assert f"text {text_digest()}" in capsys.readouterr().out

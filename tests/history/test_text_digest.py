"""The digest of the text: only cards and apparatus change it."""

import copy
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from pyharness.history.identifiers import TABLES, text_digest
from pyharness.history.tei import tei_document
from pyharness.model.facts import facts, shipped
from pyharness.thesis import cards
from tests.conftest import Printed


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "original"
    shutil.copytree(shipped("fortran/original"), folder)
    monkeypatch.setattr(cards, "shipped", lambda _: folder)
    cards.deck.cache_clear()
    yield folder
    cards.deck.cache_clear()


def test_a_comment_in_the_port_moves_the_places_and_not_the_text(port: Path) -> None:
    before = tei_document(), text_digest()
    for file in port.glob("*.fypp"):
        file.write_text(f"! A comment.\n{file.read_text()}")
    for cached in (cards.deck, cards._lines):
        cached.cache_clear()
    after = tei_document(), text_digest()
    assert after[0] != before[0]
    assert after[1] == before[1]


def _rows(content: Any) -> list[Any]:
    return content["entry"] if "entry" in content else list(content["cards"].values())


def _changed(content: Any) -> Iterator[Any]:
    rows = _rows(content)
    for index in (0, len(rows) // 2, len(rows) - 1):
        for key, value in rows[index].items():
            again = copy.deepcopy(content)
            _rows(again)[index][key] = [*value, "x"] if isinstance(value, list) else f"{value}x"
            yield again
    again = copy.deepcopy(content)
    rows = again["entry"] if "entry" in again else again["cards"]
    del rows[1 if isinstance(rows, list) else next(iter(rows))]
    yield again


@pytest.mark.parametrize("name", TABLES)
def test_every_card_and_every_entry_moves_it(name: str) -> None:
    tables = {table: facts(table) for table in TABLES}
    changed = [tables | {name: again} for again in _changed(facts(name))]
    found = {text_digest(), *(text_digest(each.__getitem__) for each in changed)}
    assert len(found) == 1 + len(changed) >= 5


def test_nothing_else_has_a_part_in_it_and_the_verb_cites_by_it(printed: Printed) -> None:
    table = Mock(side_effect=facts)
    assert text_digest(table) == text_digest()
    assert [name for ((name,), _) in table.call_args_list] == [*TABLES]
    assert f"text {text_digest()}" in printed("cards --classes")

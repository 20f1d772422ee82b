"""The table of single changes: every row still applies, and nothing lives without a reason."""

import tomllib
from pathlib import Path

import pytest

from tests.mutations.__main__ import CI
from tests.mutations.table import CAUGHT, REASONS, ROOT, Row, chosen, page, rows, update

TABLE = rows()


def test_every_row_applies() -> None:
    """A changed source asks for a changed row: the message says which."""
    stale = []
    for row in TABLE:
        try:
            changed = row.applied((ROOT / row.file).read_text())
        except ValueError as error:
            stale.append(str(error))
        else:
            assert row.old != row.new, row.id
            if row.file.endswith(".py"):
                compile(changed, row.file, "exec")
    assert not stale, "\n".join(["rows that no longer apply:", *stale])


def test_what_lives_is_little_and_has_a_reason() -> None:
    assert len({row.id for row in TABLE}) == len(TABLE) >= 220
    for begin in ("fortran/", "pyharness/"):
        assert sum(row.file.startswith(begin) for row in TABLE) >= 100
    for row in TABLE:
        assert (row.lives or row.killer) is not None, row.id
        assert row.lives is None or row.lives.startswith(REASONS), row.id
    faults = [row for row in TABLE if not row.is_equivalent]
    assert sum(row.killer is not None for row in faults) >= 0.92 * len(faults)


def test_score_of_the_page_is_that_of_the_record() -> None:
    """`make mutate ARGS=--page` shows what belongs there."""
    assert page(TABLE) in (ROOT / "docs" / "stability.md").read_text()


def test_record_names_rows_and_checks_that_there_are() -> None:
    known = {row.id for row in TABLE}
    for id, killer in tomllib.loads(CAUGHT.read_text()).items():
        assert id in known, f"{id}: no such row"
        path, _, name = killer.removeprefix("time-out ").partition("::")
        if path.startswith("tests/"):
            function = name.partition("[")[0].rpartition("::")[2]
            assert f"def {function}(" in (ROOT / path).read_text(), f"{id}: {killer}"
        else:
            assert path == "build" or path.startswith("verify"), f"{id}: {killer}"


def test_rows_of_the_gate_are_of_both_languages_and_caught() -> None:
    found = [row for row in TABLE if row.id in CI]
    assert [row.compiled for row in found].count(True) == 2
    assert len(found) == 4
    assert all(row.killer for row in found)


def test_row_that_stands_twice_or_never_is_refused() -> None:
    row = Row("a/b", "a.py", "x = 1", "x = 2")
    assert row.applied("x = 1\n") == "x = 2\n"
    for text in ("x = 3\n", "x = 1\nx = 1\n"):
        with pytest.raises(ValueError, match=r"a/b: 'x = 1' stands [02] times in a\.py"):
            row.applied(text)


def test_rows_are_chosen_by_parts_of_their_names() -> None:
    assert chosen(TABLE, []) == TABLE
    found = chosen(TABLE, ["modern/taylor/", "*/cli/main/"])
    assert {row.file for row in found} == {"fortran/modern/taylor.f90", "pyharness/cli/main.py"}


def test_record_is_kept_and_forgets_what_nothing_caught(tmp_path: Path) -> None:
    path = tmp_path / "caught.toml"
    test = 'tests/test_x.py::test[a-"b"\\]'
    update({"a/b": test, "a/c": "build"}, path)
    update({"a/c": None, "a/d": "verify cells"}, path)
    assert tomllib.loads(path.read_text()) == {"a/b": test, "a/d": "verify cells"}

"""Every mistake: one line that names the argument, in words of `messages.txt`, nothing written.

`calls.toml` and `commands.toml` have a call or a command line, and what its message must name. A
value such as "TypeError: times" gives the type of the error, if it is not InputError. The text of a
file that a row mentions is in `files.toml`.
"""

import contextlib
import errno
import os
import re
import shlex
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from pyharness.cli.main import main
from tests.messages import CATALOGUE
from tests.refusals import names

HERE = Path(__file__).parent
# What Python's argparse and shlex, and the operating system, say.
_OTHERS = (
    "expected .* argument", "not allowed with argument", "No closing quotation",
    *(re.escape(os.strerror(each)) for each in errno.errorcode),
)  # fmt: skip


def table(name: str) -> dict[str, str]:
    return tomllib.loads((HERE / f"{name}.toml").read_text())


CALLS, COMMANDS, FILES = (table(name) for name in ("calls", "commands", "files"))


@cache
def _wordings() -> list[re.Pattern[str]]:
    """Return a pattern for each message with at least two words of its own."""
    messages = [line.partition(": ")[2] for line in CATALOGUE.read_text().splitlines()]
    parts = [re.split(r"\{(?:[^{}]|\{[^{}]*\})*\}", message) for message in messages]
    strong = [each for each in parts if len(re.findall(r"[a-z]{2,}", " ".join(each))) >= 2]
    return [
        *(re.compile(".*".join(map(re.escape, each))) for each in strong),
        *map(re.compile, _OTHERS),
    ]


def check(message: str, named: str) -> None:
    """Assert that a message is one line, names the argument, and is in the catalogue."""
    assert "\n" not in message
    assert message.isprintable()
    assert named in message
    assert any(each.search(message) for each in _wordings()), f"{message}: python -m tests.messages"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder of a row, which is empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@contextlib.contextmanager
def _unchanged(folder: Path, row: str) -> Iterator[None]:
    for name, text in FILES.items():
        if re.search(rf"(?<![\w.-]){re.escape(name)}(?![\w.-])", row):
            (folder / name).write_text(text)
    before = {path: path.read_bytes() for path in folder.iterdir()}
    yield
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("call", CALLS, ids=range(len(CALLS)))
def test_call_is_refused(call: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kind, _, named = CALLS[call].rpartition("Error: ")
    with _unchanged(folder, call), pytest.raises(Exception) as caught:  # noqa: PT011
        exec(call, vars(names).copy())
    assert type(caught.value).__name__ == f"{kind or 'Input'}Error" or (
        not kind and isinstance(caught.value, names.pyharness.InputError)
    )
    check(str(caught.value), named)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("command", COMMANDS, ids=range(len(COMMANDS)))
def test_command_is_refused(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with _unchanged(folder, command):
        assert main(shlex.split(command.replace("NINES", "9" * 5000))) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("pyharness: ")
    assert said.err.endswith("\n")
    check(said.err.removesuffix("\n"), COMMANDS[command])

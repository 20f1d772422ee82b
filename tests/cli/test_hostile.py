"""Hostile input: devices, pipes, endless counts, characters that control a terminal."""

import importlib
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pyharness import InputError
from pyharness.cli import options, progress, shown
from pyharness.cli.main import main
from pyharness.cli.options import warn
from pyharness.edition.report import MARK
from pyharness.model import pipes
from pyharness.model.errors import printable
from pyharness.model.output_files import check_writable
from pyharness.model.pipes import read_input
from tests.conftest import Capture, Patch, ResultOf
from tests.refused import refused
from tests.sweep.sweeps import axis

BODY = "[body]\nmoments = [3.0, 2.0, 1.0]\n[initial]\nomega = [0.0, 1.0, 1.0]\n"
SWEEP = "[scene]\ncase = 3\n[solve]\nt_end = 1.0\n" + axis("omega.1", [1.0, 2.0])
# Every option that reads a file, with FILE in place of its name.
READERS = (
    "run --method auto --scene FILE", "plan --scene FILE", "compare --scene FILE",
    "cards --scan FILE", "words --vectors FILE", "verify --external FILE",
    "verify --listing-output FILE", "sweep FILE --out store",
)  # fmt: skip
STEERING = "\x1b[31m\x07\u202e\x9b"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pipes, "PATIENCE", 0.05)


def _refusal(command: str, capsys: Capture) -> str:
    assert main(command.split()) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told[:-1].isprintable()
    return told


@pytest.mark.parametrize("command", READERS)
def test_what_is_no_file_is_refused(command: str, capsys: Capture) -> None:
    os.mkfifo("pipe")
    Path("folder").mkdir()
    begin = time.monotonic()
    for path in ("/dev/zero", "/dev/full", "pipe", "folder", "missing"):
        assert f"'{path}'" in _refusal(command.replace("FILE", path), capsys)
    assert time.monotonic() - begin < 5.0
    assert not Path("store").exists()


@pytest.mark.parametrize("command", READERS)
def test_file_without_end_is_refused(command: str, capsys: Capture) -> None:
    with open("large", "wb") as file:
        file.truncate(1 << 40)
    assert "'large'" in _refusal(command.replace("FILE", "large"), capsys)


def test_reader_takes_files_and_pipes_up_to_its_limit() -> None:
    Path("file").write_bytes(b"0123456789")
    assert read_input("file", "it", 10, "a file") == b"0123456789"
    refused("9 bytes", read_input, "file", "it", 9, "a file")
    assert read_input("/dev/null", "it", 9, "a file") == b""
    assert read_input(f"/dev/fd/{_piped('content')}", "it", 9, "a file") == b"content"
    refused("null", read_input, "a\0b", "it", 9, "a file")


def test_sweep_and_its_scene_come_through_pipes(capsys: Capture) -> None:
    """Regression test: the files were read twice, and the second read of a pipe never returned."""
    sweep = SWEEP.replace("case = 3", f"file = '/dev/fd/{_piped(BODY)}'")
    assert main(["sweep", f"/dev/fd/{_piped(sweep)}", "--out", "store"]) == 0
    assert "2 scenes in 1 chunk" in capsys.readouterr().err


def _piped(text: str) -> int:
    """Return the read end of a pipe that contains a text."""
    reader, writer = os.pipe()
    os.write(writer, text.encode())
    os.close(writer)
    return reader


def test_record_and_list_of_an_edition_are_read_with_a_limit(capsys: Capture) -> None:
    Path("record").mkdir()
    os.mkfifo("record/taylor.toml")
    assert "taylor.toml" in _refusal("verify --only golden --record record", capsys)
    Path("site").mkdir()
    os.mkfifo(f"site/{MARK}")
    # The list of pages can't be read, so every other file counts as one that `edition` did not
    # write.
    Path("site/mine.txt").write_text("mine")
    assert "'mine.txt'" in _refusal("edition --out site", capsys)


def test_draws_that_take_long_are_forecast(capsys: Capture) -> None:
    options.chosen_count("1000", "--draws", 0, 0, options.CHECKS)
    assert capsys.readouterr().err == ""
    options.chosen_count("100000", "--draws", 0, 0, options.CHECKS)
    told = capsys.readouterr().err
    assert told == "pyharness: 100000 random draws take about 58 min and 200 MB of memory\n"


def test_name_of_a_sweep_does_not_steer_the_terminal(result_of: ResultOf) -> None:
    name = 'name = "\\u001b[31mred\\u202e"\n'
    Path("sweep.toml").write_text(name + SWEEP)
    for form in ("table", "csv", "markdown", "json"):
        told = result_of(["sweep", "sweep.toml", "--out", "store", "--format", form])
        assert (told.out + told.err).replace("\n", "").isprintable()
    assert "\\x1b[31mred\\u202e" in result_of(["sweep", "sweep.toml", "--out", "store"]).out


@pytest.mark.parametrize("form", ["table", "json", "junit"])
def test_command_of_a_port_does_not_steer_the_terminal(form: str, capsys: Capture) -> None:
    command = f"/bin/sh -c 'exit 7' {STEERING}"
    arguments = ["verify", "--port", command, "--cell", "two-term/case-3", "--format", form]
    for more in ([], ["--out", "report"]):
        assert main([*arguments, *more]) == 1
    told = capsys.readouterr()
    for text in (told.out, told.err, Path("report").read_text()):
        assert text.replace("\n", "").isprintable()
    assert "exit code 7" in told.out


def test_output_layer_keeps_lines_and_letters(capsys: Capture) -> None:
    assert shown("a\tb\nü 日本 \f") == "a\tb\nü 日本 \f"
    assert shown(f"{STEERING}\r\0\udcff\n") == "\\x1b[31m\\x07\\u202e\\x9b\\r\\x00\\udcff\n"
    assert printable("a\nb") == "a\\nb"
    warn(STEERING)
    assert capsys.readouterr().err == "pyharness: warning: \\x1b[31m\\x07\\u202e\\x9b\n"
    progress(1, 2, STEERING)  # written to a terminal only
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["/proc/site", "x" * 256])
def test_folder_that_can_not_be_made_is_refused_before_any_work(
    name: str, capsys: Capture, monkeypatch: Patch
) -> None:
    """Permissions do not restrict a superuser, so the test tries to make the folder."""
    site = importlib.import_module("pyharness.edition.site")
    monkeypatch.setattr(site, "build_site", lambda *_: pytest.fail("worked"))
    assert name in _refusal(f"edition --out {name}", capsys)
    assert list(Path().iterdir()) == []


def test_file_that_can_not_be_written_is_refused_before_any_work(
    capsys: Capture, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("pyharness.engine.solve.solve", lambda *_: pytest.fail("worked"))
    for path in ("/proc/rows", "x" * 256):
        _refusal(f"run --case 3 --method auto --out {path}", capsys)
    assert list(Path().iterdir()) == []
    # The check leaves no new file, and leaves an existing file unchanged.
    Path("there").write_text("old")
    check_writable("there", "--out")
    check_writable("new", "--out")
    assert [(path.name, path.read_text()) for path in Path().iterdir()] == [("there", "old")]


def test_large_quaternion_is_normalised(result_of: ResultOf) -> None:
    numbers = "[1e308, 1e308, -1e308, 1e308]"
    Path("scene.toml").write_text(BODY + f"attitude = {numbers}\n[run]\nsteps = 2\n")
    command = "run --method auto --scene scene.toml --attitude quaternion"
    told = result_of(command.split())
    assert "attitude(0) = (0.5, 0.5, -0.5, 0.5)" in told.out
    told_so = "the attitude has a norm above 1.79769e+308; it was normalised"
    assert told.err == f"pyharness: warning: {told_so}\n"


def test_message_is_one_line_that_a_terminal_can_show() -> None:
    """Regression test: names with line feeds, escapes and 4000 letters were printed unchanged."""
    assert str(InputError("a\nb\x1b[1m\udcff")) == "a b\\x1b[1m\\udcff"
    assert len(str(InputError("where: " + "x" * 5000 + "; allowed: y"))) < 1000
    assert str(InputError("x" * 5000 + "; allowed: y")).endswith("; allowed: y")
    assert printable("ü 日本") == "ü 日本"


def test_pipe_without_another_end_is_not_waited_for(tmp_path: Path, result_of: ResultOf) -> None:
    """Regression test: a scene from an unwritten pipe, and a result to an unread one, hung."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert "nothing came within 0.05 s" in result_of(["plan", "--scene", str(pipe)], 2).err
    assert "no one read it within 0.05 s" in result_of(["doctor", "--out", str(pipe)], 2).err
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_scene_comes_through_a_pipe() -> None:
    command = f"printf '{BODY}' | {sys.executable} -m pyharness plan --scene /dev/stdin"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert "I = (3, 2, 1) kg m2" in done.stdout


@pytest.mark.campaign
def test_name_that_the_terminal_or_the_picture_can_not_write(tmp_path: Path) -> None:
    """Regression test: UnicodeEncodeError; the picture read a name with dollars as a formula."""
    path = tmp_path / "\udcff ü.toml"
    path.write_text(BODY + "[run]\nsteps=3\n")
    command = [sys.executable, "-m", "pyharness", "run", "--program", "two-term", "--scene"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([*command, str(path)], capture_output=True, env=environment, check=True)
    assert done.stdout.startswith(b"\\udcff \\xfc\n")
    assert done.stderr == b""
    path.write_text('name = "$\\\\frac$ \\u0007"\n' + BODY + "[run]\nsteps=3\n")
    picture = tmp_path / "x.svg"
    arguments = ["run", "--scene", str(path), "--program", "two-term", "--plot", str(picture)]
    assert main([*arguments, "--out", str(tmp_path / "x.txt")]) == 0
    assert picture.exists()


def test_a_closed_pipe_keeps_the_exit_status(monkeypatch: Patch) -> None:
    """Regression test: `verify ... | grep -q` ended with status 0 although a check had failed."""
    for form in ("table", "json"):
        reader, writer = os.pipe()
        os.close(reader)
        with open(writer, "w", buffering=1) as closed:
            monkeypatch.setattr("sys.stdout", closed)
            assert main(["verify", "--port", "false", "--case", "1", "--format", form]) == 1

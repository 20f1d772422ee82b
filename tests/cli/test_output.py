"""After any interruption, files are complete or missing; stderr changes no result."""

import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import Mock

import pytest

from pyharness import InputError
from pyharness.cli import end_progress, output, progress
from pyharness.cli.main import main
from pyharness.cli.options import warn
from pyharness.cli.output import write_folder
from pyharness.model import output_files
from pyharness.model.output_files import write_files
from tests.conftest import Patch, ResultOf

RUN = ["run", "--case", "3", "--program", "two-term", "--format", "csv"]


def _tree(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


OLD = {"a": b"old a", "c": b"old c"}
NEW = {"a": b"new a", "b": b"new b", "c": b"new c"}


def _files(folder: Path) -> None:
    write_files({str(folder / name): content for name, content in NEW.items()}, "--out")


# Functions that write, and the files that exist afterwards.
WRITERS: dict[str, tuple[Callable[[Path], None], dict[str, bytes | None]]] = {
    "three": (_files, {**NEW}),
    "one": (lambda at: write_files({str(at / "a"): NEW["a"]}, "--out"), {**OLD, "a": NEW["a"]}),
    "into": (lambda at: write_folder(str(at), NEW, "--out"), {**NEW}),
    "made": (
        lambda at: write_folder(str(at / "made"), NEW, "--out"),
        {**OLD, "made": None, **{f"made/{k}": v for k, v in NEW.items()}},
    ),
}


def _folder(tmp_path: Path) -> Path:
    """Return a new folder with the old files."""
    folder = Path(tempfile.mkdtemp(dir=tmp_path))
    for name, content in OLD.items():
        (folder / name).write_bytes(content)
    return folder


def test_file_has_the_mode_of_any_new_one(tmp_path: Path) -> None:
    folder = _folder(tmp_path)
    _files(folder)
    (folder / "ordinary").touch()
    assert (folder / "a").stat().st_mode == (folder / "ordinary").stat().st_mode


class _Failing:
    """A function that fails once: before it has done anything, or afterwards if `done`."""

    def __init__(self, real: Callable[..., Any], fails: int, done: bool, error: type) -> None:
        self.real, self.fails, self.done, self.error = real, fails, done, error
        self.calls = 0

    def __call__(self, *given: Any, **named: Any) -> Any:
        self.calls += 1
        if self.calls != self.fails:
            return self.real(*given, **named)
        if self.done and (result := self.real(*given, **named)) is not None:
            result.close()
        raise self.error(28, "No space left on device")

    def __get__(self, instance: object, _: object) -> Callable[..., Any]:
        return partial(self, instance) if isinstance(instance, Path) else self


# Each has the owner, and the function.
CALLS: dict[str, tuple[Any, Callable[..., Any]]] = {
    "open": (output_files, open), "link": (os, os.link), "replace": (os, os.replace),
    "mkdir": (Path, Path.mkdir),
}  # fmt: skip


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, OSError])
@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("writer", WRITERS)
def test_nothing_is_left_behind_by_a_call_that_fails(
    writer: str, call: str, error: type, tmp_path: Path, monkeypatch: Patch
) -> None:
    """Let each call fail in turn, before it has done anything and when it is done."""
    write, after = WRITERS[writer]
    owner, real = CALLS[call]
    for number, done in itertools.product(range(4), (False, True)):
        folder = _folder(tmp_path)
        failing = _Failing(real, number + 1, done, error)
        with monkeypatch.context() as patch:
            patch.setattr(owner, call, failing, raising=False)
            try:
                write(folder)
            except (KeyboardInterrupt, MemoryError, InputError):
                pass
            else:
                # The writer makes fewer calls than that, or can do without a hard link.
                assert failing.calls <= number or call == "link"
                assert _tree(folder) == after
                continue
        # For a single file, the rename is the last thing to be done.
        assert _tree(folder) in ((OLD, after) if writer == "one" else (OLD,))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt, which a shell's background job would ignore."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("writer", ["three", "one", "made"])
def test_a_ctrl_c_at_any_line_leaves_all_or_nothing(writer: str, tmp_path: Path) -> None:
    """Send the signal at each line of the modules that write, in turn."""
    write, after = WRITERS[writer]
    outcomes = []
    for number in range(400):
        folder = _folder(tmp_path)
        lines = 0

        def trace(frame: FrameType, event: str, _: object, number: int = number) -> Any:
            nonlocal lines
            if frame.f_code.co_filename not in (output.__file__, output_files.__file__):
                return None
            if event == "line":
                lines += 1
                if lines == number + 1:
                    signal.raise_signal(signal.SIGINT)
            return trace

        before, interrupted = sys.gettrace(), False
        sys.settrace(trace)
        try:
            write(folder)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            sys.settrace(before)
        found = _tree(folder)
        assert found in (OLD, after), number
        outcomes.append((interrupted, found == after))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if not interrupted:
            break
    assert outcomes[-1] == (False, True)
    assert outcomes.count((False, True)) == 1
    assert {(True, False), (True, True)} <= set(outcomes)


@pytest.mark.usefixtures("ctrl_c")
def test_a_ctrl_c_while_files_are_written_gives_up(tmp_path: Path, monkeypatch: Patch) -> None:
    def interrupted(*given: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return open(*given)

    monkeypatch.setattr(output_files, "open", interrupted, raising=False)
    for write, _ in WRITERS.values():
        folder = _folder(tmp_path)
        with pytest.raises(KeyboardInterrupt):
            write(folder)
        assert _tree(folder) == OLD


@pytest.fixture(params=["same", "other"])
def elsewhere(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    """Return a folder, either on the file system of `tmp_path` or on another one."""
    shared = tmp_path if request.param == "same" else Path("/dev/shm")
    other = request.param == "same" or (
        shared.exists() and shared.stat().st_dev != tmp_path.stat().st_dev
    )
    if not (other and os.access(shared, os.W_OK)):
        pytest.skip("no other file system here")
    folder = Path(tempfile.mkdtemp(dir=shared))
    yield folder
    shutil.rmtree(folder)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_followed_wherever_it_leads(there: bool, elsewhere: Path, tmp_path: Path) -> None:
    link, target = tmp_path / "link", elsewhere / "target"
    if there:
        target.write_text("old")
    link.symlink_to(target)
    assert main([*RUN, "--out", str(link)]) == 0
    assert link.is_symlink()
    assert target.read_text().startswith("time,")
    assert [path.name for path in elsewhere.iterdir()] == ["target"]
    assert set(tmp_path.iterdir()) <= {link, elsewhere}


def test_a_link_that_leads_nowhere_is_refused(result_of: ResultOf, tmp_path: Path) -> None:
    (tmp_path / "lost").symlink_to(tmp_path / "no folder" / "file")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "folder").symlink_to(tmp_path)
    for name in ("lost", "loop", "folder"):
        assert name in result_of([*RUN, "--out", str(tmp_path / name)], 2).err


IMPOSSIBLE = "[body]\nmoments=[200,10,20]\n[initial]\nomega=[0.1,1,0.2]\n"


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("arguments", "code"),
    [("run --case 99 --method auto", 2),
     ("run --scene impossible.toml --program two-term --steps 2 --out /dev/stdout", 0),
     ("doctor >/dev/full", 2), ("doctor >&-", 2)],
)  # fmt: skip
def test_a_stderr_that_is_full_or_closed_has_no_say(
    arguments: str, code: int, tmp_path: Path
) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    (tmp_path / "impossible.toml").write_text(IMPOSSIBLE)
    command = f"{sys.executable} -m pyharness {arguments}"
    wanted, *found = (
        subprocess.run(f"{command} {away}", shell=True, cwd=tmp_path, capture_output=True)
        for away in ("", "2>/dev/full", "2>&-")
    )
    assert wanted.returncode == code
    assert wanted.stderr.startswith(b"pyharness: ")
    assert wanted.stderr.count(b"\n") == 1
    for each in found:
        assert (each.returncode, each.stdout, each.stderr) == (code, wanted.stdout, b"")


def test_progress_falls_silent_where_the_terminal_goes_away(monkeypatch: Patch) -> None:
    write = Mock(side_effect=OSError(5, "Input/output error"))
    gone = Mock(encoding="ascii", isatty=lambda: True, write=write)
    monkeypatch.setattr(sys, "stderr", gone)
    progress(1, 2, "parts")
    end_progress()
    warn("what no one reads")
    assert gone.write.call_count > 2

"""Checks of random inputs: each tries one input, and raises AssertionError if it finds a fault."""

import contextlib
import io
import json
import math
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from pyharness import ImpossibleBodyWarning, InputError, prepare, read_scene, solve
from pyharness.checks.compare.agreement import differences
from pyharness.cli.main import main
from pyharness.model.extension import ENDS
from pyharness.model.listing import names_of, subset
from pyharness.model.trajectory import WITH_ALL_ROWS
from pyharness.thesis.programs import PROGRAM_REGISTRY
from tests.campaigns.fuzz import strategies
from tests.campaigns.fuzz.command_lines import CommandLine, command_line, furnish

LONGEST = 20.0  # s of processor time for one input: a longer run counts as endless


class Kind(NamedTuple):
    """A kind of input: how to generate it from random numbers, and how to try it in a folder."""

    make: Callable[[Random], Any]
    check: Callable[[Any, Path], None]


def tried(kind: str, given: object, folder: Path) -> None:
    """Try an input; raise AssertionError with the fault and the input if something is wrong."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ImpossibleBodyWarning)
            KINDS[kind].check(given, folder)
    except Exception as error:
        what = f"{type(error).__name__}: {str(error)[:600]}"
        raise AssertionError(f"{what}\n  input: {given!r}"[:4000]) from error
    seconds = time.process_time() - begin
    assert seconds < LONGEST, f"took {seconds:.1f} s\n  input: {given!r}"


def _one_line(error: InputError, place: str = "") -> None:
    text = str(error)
    assert text, "an error without words"
    assert place in text, f"an error that does not name {place}"
    assert "\n" not in text, "an error of more than a line"
    assert len(text) < 1200, f"an error of {len(text)} characters"


def _scene_file(content: bytes, folder: Path) -> None:
    path = folder / "scene.toml"
    path.write_bytes(content)
    try:
        found = read_scene(path)
    except InputError as error:
        _one_line(error, "scene.toml")
    else:
        assert all(map(math.isfinite, found.omega))


def _program(given: strategies.ProgramInput, folder: Path) -> None:
    program = PROGRAM_REGISTRY[given.listing.program]
    compiled, twin = (
        program.run(given.scene, given.listing, implementation, given.lipschitz, given.may_stop)
        for implementation in ("fortran", "python")
    )
    found = differences(compiled, twin)
    assert not found, f"Fortran and twin differ in {found}"
    assert np.isfinite(compiled.omega).all(), "omega is not finite"
    assert compiled.ended == "complete" or compiled.steps <= given.scene.steps
    assert compiled.ended != "complete" or compiled.steps == given.scene.steps


def _method(given: strategies.MethodInput, folder: Path) -> None:
    try:
        found = solve(
            given.scene, given.times, given.method, given.tolerance, attitude=given.attitude
        )
    except InputError as error:
        _one_line(error)
        return
    rows = len(found.time)
    assert found.omega.shape == (rows, 3)
    assert np.isfinite(found.omega).all(), f"{found.ended}, but omega is {found.omega.tolist()}"
    assert found.ended in (*WITH_ALL_ROWS, "overflow"), found.ended
    assert (rows == len(given.times)) == found.has_all_rows, f"{found.ended}, {rows} rows"
    assert found.error is None or found.error >= 0.0, found.error
    assert found.growth is None or found.growth >= 1.0, found.growth
    assert set(found.time.tolist()) <= set(given.times)
    assert (found.attitude is not None) == given.attitude
    if found.attitude is not None:
        assert found.attitude.shape == (rows, 4)
        lengths = np.linalg.norm(found.attitude, axis=1)
        assert (np.abs(lengths - 1.0) < 1e-14).all(), f"{found.ended}, of lengths {lengths}"


def _prepared(given: strategies.PreparedInput, folder: Path) -> None:
    try:
        ready: Any = partial(prepare, given.scene, given.method, given.tolerance)
        solver = ready(effort=given.effort, attitude=given.attitude)
    except InputError as error:
        _one_line(error)
        return
    found = solver(np.array(given.omega0), given.t_end)
    found = np.concatenate(found) if given.attitude else found
    assert solver.status in ENDS
    if solver.status in WITH_ALL_ROWS:
        assert np.isfinite(found).all(), f"{solver.status}, but omega is {found.tolist()}"
    else:
        assert np.isnan(found).all(), f"{solver.status}, but omega is {found.tolist()}"


def _listing(given: strategies.ListingInput, folder: Path) -> None:
    try:
        found = subset(
            given.program, given.base, given.fix, keep=given.keep, readings=given.readings
        )
    except InputError as error:
        _one_line(error)
    else:
        assert not set(given.fix) & found.active
        assert set(given.keep) <= found.active
        unsaid = "corrected" if given.keep and not given.fix else "original"
        chosen = set(given.readings) if (given.base or unsaid) == "original" else set()
        chosen |= set(given.keep) & set(names_of("reading"))
        assert found.readings == chosen - set(given.fix)
        assert 0 <= found.flags < 2**31


def _command(given: CommandLine, folder: Path) -> None:
    """Run a command in this process; judge its exit code and output, and allow no exception."""
    raw_out, raw_err = io.BytesIO(), io.BytesIO()
    out, err = (io.TextIOWrapper(each, "utf-8", newline="\n") for each in (raw_out, raw_err))
    with (
        _judged(given, folder) as found,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        patch("pyharness.model.pipes.PATIENCE", 0.05),
    ):
        try:
            code: object = main(given.arguments)
        except SystemExit as leave:
            asked = {"-h", "--help"} & {each.strip() for each in given.arguments}
            code = leave.code if asked else f"SystemExit({leave.code})"
        out.flush()
        err.flush()
        found += [code, raw_out.getvalue(), raw_err.getvalue()]


def _process(given: CommandLine, folder: Path) -> None:
    """Run a command in its own process, as a user does, with one of several encodings."""
    command = [sys.executable, "-m", "pyharness"]
    arguments = [each.encode("utf-8", "surrogateescape") for each in given.arguments]
    encoding = ("utf-8", "ascii", "latin-1")[len(given.scene) % 3]
    with _judged(given, folder) as found:
        done = subprocess.run(
            [*command, *(each.replace(b"\0", b"") for each in arguments)],
            cwd=folder, capture_output=True, timeout=2 * LONGEST, check=False,
            stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONIOENCODING": encoding},
        )  # fmt: skip
        assert done.returncode >= 0, f"ended by signal {-done.returncode}"
        found += [done.returncode, done.stdout, done.stderr]


@contextlib.contextmanager
def _judged(given: CommandLine, folder: Path) -> Iterator[list[Any]]:
    """Prepare the folder; judge the exit code, stdout and stderr that are put into the list."""
    furnish(folder, given.scene)
    before = _files(folder)
    found: list[Any] = []
    yield found
    code, out, err = found
    _judge(given, code, out, err, _files(folder) == before)
    (folder / "out.txt").unlink(missing_ok=True)


def _files(folder: Path) -> dict[str, int]:
    return {path.name: path.lstat().st_size for path in folder.iterdir()}


def _judge(given: CommandLine, code: object, out: bytes, err: bytes, same_files: bool) -> None:
    said = err.decode("utf-8", "replace")
    assert code in (0, 1, 2), f"exit code {code}: {said[-900:]}"
    assert code != 1 or given.arguments[0] in ("compare", "family"), "exit code 1"
    assert code == 2 or not given.mistaken, f"exit code {code} in spite of a mistake"
    lines = said.split("\n")
    assert lines.pop() == "", f"stderr ends within a line: {said[-300:]!r}"
    lines = [line for line in lines if not line.startswith("pyharness: warning: ")]
    if code != 2:
        assert not lines, f"exit code {code} with stderr {said[-900:]!r}"
        if out.startswith(b'{"schema"'):
            json.loads(out, parse_constant=_refuse_constant)
        return
    assert len(lines) == 1, f"stderr of {len(lines)} lines: {said[-900:]!r}"
    assert lines[0].startswith("pyharness: "), said
    assert len(lines[0]) < 4000, f"a line of {len(lines[0])} characters"
    assert not out, f"exit code 2 with stdout {out[:300]!r}"
    assert same_files, "exit code 2, but files changed"


def _refuse_constant(name: str) -> None:
    raise AssertionError(f"JSON with {name}")


KINDS = {
    "scene-file": Kind(strategies.scene_bytes, _scene_file),
    "program": Kind(strategies.program_input, _program),
    "method": Kind(strategies.method_input, _method),
    "prepared": Kind(strategies.prepared_input, _prepared),
    "listing": Kind(strategies.listing_input, _listing),
    "command": Kind(command_line, _command),
    "process": Kind(command_line, _process),
}

"""Runs of the programs of a plan, in limited time and with limited output."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from pyharness.checks.agree.plan import Plan, Program, Run, fill
from pyharness.checks.agree.reading import Rows, read_rows
from pyharness.checks.port_process import PortError, PortProcess

_CALLER = Path(__file__).with_name("caller.py")
_LARGEST = 1 << 26  # most bytes of a file that a program writes
_TO_COMPILE = 300.0  # s


def answers(
    plan: Plan, program: Program, said: Callable[[int, str], None] = lambda done, what: None
) -> list[Rows]:
    """Return the program's rows for each run, or raise PortError, which names the failed run."""
    found = []
    with _prepare(plan, program) as run:
        for number, each in enumerate(plan.runs):
            said(number, program.name)
            try:
                found.append(run(each))
            except PortError as error:
                raise PortError(f"{each.name}: {error}") from None
    return found


@contextmanager
def _prepare(plan: Plan, program: Program) -> Iterator[Callable[[Run], Rows]]:
    if program.function:
        words = [sys.executable, str(_CALLER), program.function]
        with (
            TemporaryDirectory() as place,
            PortProcess(words, plan.seconds, folder=Path(place)) as process,
        ):
            yield lambda run: _call(plan, process, run)
        return
    with TemporaryDirectory() as place:
        if program.source is not None:
            binary = compile_source(program, Path(place))
            program = replace(program, command=(str(binary),))
        yield lambda run: _commanded(plan, program, run)


def _call(plan: Plan, process: PortProcess, run: Run) -> Rows:
    answer = process.ask(json.dumps([*run.values.values()]).encode())
    return read_rows(answer, replace(plan.outputs, form="json", file=""))


def _commanded(plan: Plan, program: Program, run: Run) -> Rows:
    words = [fill(word, run.values.items()) for word in program.command]
    with TemporaryDirectory() as place:
        # An empty folder has no file of an earlier run.
        folder, content = Path(place), run.text.encode("utf-8", "surrogateescape")
        if plan.input_file:
            (folder / plan.input_file).write_bytes(content)
        with PortProcess(words, plan.seconds, folder=folder) as process:
            printed = process.read_all(b"" if plan.input_file else content)
        if not plan.outputs.file:
            return read_rows(printed, plan.outputs)
        written = folder / plan.outputs.file
        if not written.is_file():
            raise PortError(f"it did not write '{plan.outputs.file}'")
        if written.stat().st_size > _LARGEST:
            raise PortError(f"'{plan.outputs.file}' has more than {_LARGEST >> 20} MB")
        return read_rows(written.read_bytes(), plan.outputs)


def compile_source(program: Program, folder: Path, warnings: list[str] | None = None) -> Path:
    """Return the compiled program; `warnings` gets the compiler's lines."""
    assert program.source is not None
    found = folder / f"program-{len([*folder.iterdir()])}"
    words = [program.compiler, *program.flags, str(program.source), *program.libraries]
    words += ["-o", str(found), *(["-lm"] if program.source.suffix == ".c" else [])]
    if shutil.which(program.compiler) is None:
        raise PortError(f"there is no compiler '{program.compiler}' on the PATH")
    try:
        done = subprocess.run(
            words, cwd=folder, capture_output=True, text=True, timeout=_TO_COMPILE, check=False
        )
    except subprocess.TimeoutExpired:
        raise PortError(f"{program.compiler} did not end within {_TO_COMPILE:g} s") from None
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "rror" in line] or ["failed"]
        raise PortError(f"{program.compiler}: {lines[0].strip()[:200]}")
    if warnings is not None:
        warnings += done.stderr.splitlines()
    return found


def digests(program: Program) -> dict[str, str]:
    """Return digests of the program's files, by name."""
    words: Sequence[str] = [
        *program.command,
        *program.libraries,
        program.function.rpartition(":")[0],
    ]
    paths = [program.source, *map(Path, filter(None, words))]
    files = [path for path in paths if path is not None and path.is_absolute() and path.is_file()]
    return {path.name: sha256(path.read_bytes()).hexdigest() for path in files}

"""Compilation and cache of C code for recorded torques (leaves).

A file is loaded only if it and the folder belong to the user, nobody else may write them, and the
file's name has the hash of its content.
"""

import ctypes
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from ctypes import CDLL as CDLL
from functools import cache
from hashlib import sha256
from itertools import takewhile
from pathlib import Path

from pyharness.engine.system.lane_leaves import whole_source
from pyharness.engine.system.leaf_text import Structure, structure
from pyharness.engine.system.recorded import has_ready_leaves, listing, number_of_leaves, system_of
from pyharness.model.arithmetic import (
    PROBE,
    SHARED,
    UncheckedError,
    check_compiler,
    check_library,
    check_options,
    run,
)
from pyharness.model.array_type import Array
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.tape import Tape

MOST_BYTES = 20_000_000  # of all files; the oldest ones are deleted
_FORGOTTEN = 3600.0  # age (s) from which files of a killed compilation are deleted
_FLAGS = ("-O2", "-ffp-contract=fast", *SHARED)
_NATIVE = "-march=native"


class LeavesError(Exception):
    """A failure to compile or load code, with the reason in one line."""


# RuntimeError: no home folder is known.
_FAILURES = (LeavesError, UncheckedError, RuntimeError)


def folder() -> Path:
    home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (home if home.is_absolute() else Path("~/.cache").expanduser()) / "pyharness" / "leaves"


def size() -> int:
    return sum(info.st_size for _, info in _files())


def about_leaves() -> dict[str, str | int]:
    try:
        found = compiler()
        text = check_compiler((*found, *_FLAGS)) or " ".join(found)
        return {"folder": str(folder()), "bytes": size(), "compiler": text}
    except _FAILURES as error:
        return {"folder": "none", "bytes": 0, "compiler": str(error)}


def leaves_for(scene: Scene, compiled: bool) -> tuple[int, str]:
    """Return the address of a scene's compiled code, or 0, and the text of `Solver.leaves`."""
    tape = system_of(scene)
    address, found = leaves_of(tape) if compiled else (0, "interpreter")
    if not address and has_ready_leaves(tape):
        found = found.replace("interpreter", "built", 1)
    return address, found


def leaves_of(tape: Tape) -> tuple[int, str]:
    """Return the address of compiled code and ``compiled``, or 0 and the reason."""
    shape = structure(listing(tape))
    if shape is None:
        return 0, "interpreter: switches and torques of 500 operations are not compiled"
    try:
        return loaded(shape, str(folder())), "compiled"
    except _FAILURES as error:
        return 0, f"interpreter: {error}"


def leaves_of_many(packed: Array, leaves: str) -> str:
    """Return the text of `Ensemble.leaves` for a packed scene, from `Solver.leaves`."""
    if leaves == "compiled" and not extension().compiled_lanes(number_of_leaves(packed)):
        return "interpreter: the compiler does not use the registers of this processor"
    # Code built with the package is for single bodies.
    return leaves.replace("built", "interpreter", 1)


@cache  # kernels may use a loaded library as long as the process lives
def loaded(tape: Structure, place: str) -> int:
    """Return the address of the compiled functions (see tape.h)."""
    try:
        text = whole_source(tape) + PROBE
        library = CDLL(str(_found(Path(place), _key(text)) or compiled_file(Path(place), text)))
        return ctypes.addressof(ctypes.c_void_p.in_dll(library, "leaves"))
    except (OSError, AttributeError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise LeavesError(f"leaves can't be loaded from or stored in {place}: {reason}") from None


@cache
def compiler() -> tuple[str, ...]:
    import shlex
    from shutil import which

    for command in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
        try:
            program, *arguments = shlex.split(command) or [""]
        except ValueError as error:
            raise LeavesError(f"CC is {command!r}: {error}") from None
        if found := which(program):
            if fault := check_options((found, *arguments)):
                raise LeavesError(fault)
            return (found, *arguments)
    raise LeavesError("no C compiler is found: install one, or name it with CC=...")


@cache
def machine() -> str:
    import platform

    file = os.stat(os.path.realpath(compiler()[0]))
    names = ("vendor_id", "model name", "flags", "CPU implementer", "CPU part", "Features")
    about = platform.platform() + platform.processor()
    with suppress(OSError), open("/proc/cpuinfo") as lines:
        for line in takewhile(str.strip, lines):
            about += line if line.startswith(names) else ""
    return repr((compiler(), _FLAGS, file.st_size, file.st_mtime_ns, about))


def _key(text: str) -> str:
    return sha256((text + machine()).encode()).hexdigest()[:32]


def _is_safe(info: os.stat_result) -> bool:
    return info.st_uid == os.geteuid() and not info.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _files() -> Iterator[tuple[Path, os.stat_result]]:
    with suppress(OSError):
        for each in folder().iterdir():
            yield each, each.lstat()


def _found(place: Path, key: str) -> Path | None:
    try:
        info = place.lstat()
    except OSError:
        return None
    if not stat.S_ISDIR(info.st_mode) or not _is_safe(info):
        return None
    for path in place.glob(f"{key}-*.so"):
        info = path.lstat()
        if not stat.S_ISREG(info.st_mode) or not _is_safe(info):
            continue
        if path.name == f"{key}-{sha256(path.read_bytes()).hexdigest()}.so":
            return path
        path.unlink()
    return None


def compiled_file(place: Path, text: str) -> Path:
    """Compile C code; return the file, which enters the folder `place` only when complete."""
    from tempfile import TemporaryDirectory

    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    info = place.lstat()
    if not stat.S_ISDIR(info.st_mode) or not _is_safe(info):
        raise LeavesError(f"{place} is not the user's own folder, or others may write it")
    _clean(place)
    with TemporaryDirectory(dir=place, prefix="new-") as new:
        code, result = Path(new, "leaves.c"), Path(new, "leaves.so")
        code.write_text(text)
        command = [*compiler(), *_FLAGS, str(code), "-o", str(result)]
        if _run([*command, _NATIVE]) and (reason := _run(command)):
            raise LeavesError(f"{compiler()[0]} failed: {reason}")
        # Before this process loads it: code that a linker adds can change all its arithmetic.
        if fault := check_library((*compiler(), *_FLAGS), result):
            raise LeavesError(fault)
        result.chmod(0o700)
        target = place / f"{_key(text)}-{sha256(result.read_bytes()).hexdigest()}.so"
        result.replace(target)
    return target


def _run(command: list[str]) -> str:
    status, error = run(command)
    if status == 0:
        return ""
    lines = error.strip().splitlines() or [f"exit status {status}"]
    return next((line for line in lines if "error" in line), lines[0])


def _clean(place: Path) -> None:
    import time
    from shutil import rmtree

    room, now = MOST_BYTES, time.time()
    for path, info in sorted(_files(), key=lambda each: -each[1].st_mtime):
        if stat.S_ISDIR(info.st_mode):
            if path.name.startswith("new-") and now - info.st_mtime > _FORGOTTEN:
                rmtree(path, ignore_errors=True)
            continue
        room -= info.st_size
        if room < 0:
            with suppress(OSError):
                path.unlink()

"""A first TOML file for `agree`, from one run of a program."""

import json
import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from pyharness.checks.agree.plan import Outputs
from pyharness.checks.agree.reading import read_rows
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.model.errors import InputError

_MOST = 100  # columns


def first_file(command: Sequence[str]) -> str:
    """Return a TOML file with the command as original, and the columns that it prints."""
    words = [str(Path(x).resolve()) if Path(x).is_file() else x for x in command]
    try:
        with TemporaryDirectory() as place, PortProcess(words, PATIENCE, folder=Path(place)) as run:
            content = run.read_all(b"")
            written = sorted(x.name for x in Path(place).iterdir() if x.is_file())
            texts = {"": content} | {x: (Path(place) / x).read_bytes() for x in written}
    except PortError as error:
        raise InputError(f"--new: '{shlex.join(command)}': {error}") from None
    counts: dict[tuple[str, int], int] = Counter()
    for file, text in texts.items():
        for width in range(1, _MOST):
            try:
                rows = read_rows(text, Outputs(tuple(map(str, range(width)))))
            except PortError:
                continue
            counts[file, width] = len(rows) * width
    if not counts:
        raise InputError(
            f"--new: '{shlex.join(command)}' printed no row of numbers; give a command that prints "
            "some without input, or write the file by hand (docs/tutorials/own-fortran.md)"
        )
    (file, width), _ = max(counts.items(), key=lambda each: each[1])
    columns = json.dumps([f"x{n + 1}" for n in range(width)])
    lines = ["[programs.original]", f"command = {json.dumps(shlex.join(command))}", ""]
    lines += ["[programs.port]", 'command = "python3 port.py"  # your port', ""]
    lines += [
        "[outputs]",
        f"columns = {columns}",
        *([f"file = {json.dumps(file)}"] if file else []),
    ]
    lines += ["", "[limits.default]", "ulp = 0", ""]
    return "\n".join(lines)

"""Plans of two programs for tests of `agree`."""

import json
import shlex
import sys
from pathlib import Path

PLAN = """seconds = 1
[programs.original]
command = {original}
[programs.port]
command = {port}
[outputs]
columns = ["a", "b"]
[limits.b]
ulp = 0
"""


def command_of(code: str) -> str:
    return json.dumps(shlex.join([sys.executable, "-c", code]))


def written(folder: Path, port: str, original: str = "print('1 2\\n3 4')", text: str = PLAN) -> str:
    """Return the path of a plan that compares two programs in Python."""
    path = folder / "plan.toml"
    path.write_text(text.format(original=command_of(original), port=command_of(port)))
    return str(path)

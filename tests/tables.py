"""Tables of tests: lists and dictionaries in a TOML file beside the test file."""

import tomllib
from pathlib import Path
from typing import Any


def tables(path: str) -> dict[str, Any]:
    """Return the tables of `name.toml` for the file `test_name.py`."""
    file = Path(path)
    return tomllib.loads(file.with_name(f"{file.stem.removeprefix('test_')}.toml").read_text())

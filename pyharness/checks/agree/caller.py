"""`python caller.py TARGET`: call a function for each line of arguments, and print its results.

TARGET is module:name, file.py:name or library.so:name, whose function takes and returns doubles.
Lines are JSON lists. A result is a row; several rows are an array or a list of rows.
"""

import importlib
import importlib.util
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def load(target: str) -> Callable[..., Any]:
    place, _, name = target.rpartition(":")
    if ".so" in place or place.endswith((".dylib", ".dll")):
        import ctypes

        function = getattr(ctypes.CDLL(place), name)
        function.restype = ctypes.c_double
        return lambda *values: function(*map(ctypes.c_double, values))
    if place.endswith(".py"):
        sys.path.insert(0, str(Path(place).parent))
        spec = importlib.util.spec_from_file_location(Path(place).stem, place)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    else:
        module = importlib.import_module(place)
    found: Any = module
    for part in name.split("."):
        found = getattr(found, part)
    return found  # type: ignore[no-any-return]


def rows_of(result: Any) -> list[list[Any]]:
    """Return a result as rows: lists of rows as they are, anything else as one row."""
    plain = _plain(result)
    items = plain if isinstance(plain, list) else [plain]
    if items and all(isinstance(each, list) for each in items) and not isinstance(result, tuple):
        return items
    return [_flat(items)]


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return str(value) if isinstance(value, complex) else value


def _flat(items: list[Any]) -> list[Any]:
    return [x for each in items for x in (_flat(each) if isinstance(each, list) else [each])]


if __name__ == "__main__":
    answers, sys.stdout = sys.stdout, sys.stderr
    called = load(sys.argv[1])
    for line in sys.stdin:
        print(json.dumps(rows_of(called(*json.loads(line)))), file=answers, flush=True)

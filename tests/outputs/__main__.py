"""`python -m tests.outputs FOLDER` records; `python -m tests.outputs BEFORE AFTER` compares.

A record is one file for each command: its exit code, its output (JSON if the verb has it, with
sorted keys), and the digests of the files that it writes. It does not contain times, or the build
of the extension. A comparison lists every difference, and has exit status 1 if there is one.
"""

import hashlib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
# These differ from run to run: seconds and their consequences; the build and its folder.
_VARIES = (
    "seconds", "seconds_per_step", "build", "speed", "preparation", "time_ratio", "installation",
)  # fmt: skip
_FORECAST = re.compile(r"\babout \S+ s\b")  # the run time of a sweep, in its messages
_SCENE = """\
name = "forced"
[body]
moments = [4.0, 3.0, 2.0]
[initial]
omega = [0.3, -1.2, 2.0]
[torque]
constant = [0.1, 0.0, -0.2]
sines = [{ amplitude = [0.0, 0.5, 0.0], frequency = 3.0 }]
[run]
step_size = 0.01
steps = 200
"""
_SWEEP = """\
reductions = ["status", { name = "largest-tilt", samples = 50 }]
[scene]
file = "scene.toml"
[[axis]]
field = "omega.1"
from = 0.3
to = 3.0
count = 4
"""
# Files that the commands read, by name.
_GIVEN = {
    "scene.toml": _SCENE, "sweep.toml": _SWEEP,
    "vectors.json": (ROOT / "pyharness/data/words/cdc.json").read_text(),
}  # fmt: skip


def main() -> int:
    """Record or compare, by the number of folders."""
    folders = [Path(each) for each in sys.argv[1:] if not each.startswith("-")]
    if len(folders) == 1:
        return _record(folders[0])
    if len(folders) == 2:
        return _compare(*folders)
    print(__doc__, file=sys.stderr)
    return 2


def commands() -> dict[str, str]:
    """Return the commands by the name of their record."""
    found: dict[str, str] = tomllib.loads((HERE / "commands.toml").read_text())["commands"]
    return found


def _record(folder: Path) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        texts = pool.map(_run, commands().values())
        for name, text in zip(commands(), texts, strict=True):
            (folder / f"{name}.json").write_text(text)
            print(name, flush=True)
    return 0


def _run(command: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in _GIVEN.items():
            (Path(folder) / name).write_text(text)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "100", "NO_COLOR": "1"}
        done = subprocess.run(
            [sys.executable, "-m", "pyharness", *shlex.split(command)],
            cwd=folder, env=environment, capture_output=True, check=False,
        )  # fmt: skip
        written = {
            str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()[:16]
            for path in sorted(Path(folder).rglob("*"))
            if path.is_file() and path.name not in _GIVEN
        }
    said, output = (each.decode(errors="backslashreplace") for each in (done.stderr, done.stdout))
    try:
        printed = _steady(json.loads(output))
    except ValueError:
        printed = output.splitlines()
    record = {
        "command": command, "exit": done.returncode, "printed": printed,
        "said": _FORECAST.sub("about ... s", said).splitlines(), "written": written,
    }  # fmt: skip
    return json.dumps(record, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _steady(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _steady(each) for key, each in value.items() if key not in _VARIES}
    return [_steady(each) for each in value] if isinstance(value, list) else value


def _compare(before: Path, after: Path) -> int:
    wrong = []
    for name in sorted({path.stem for each in (before, after) for path in each.glob("*.json")}):
        old, new = (_leaves(each / f"{name}.json") for each in (before, after))
        for key in sorted(old.keys() | new.keys()):
            one, other = (each.get(key, "absent") for each in (old, new))
            if one != other:
                wrong.append(f"{name}: {key}: {one} -> {other}\n")
    print("".join(wrong), end=f"{len(wrong)} differences\n")
    return 1 if wrong else 0


def _leaves(path: Path) -> dict[str, str]:
    return dict(_walk("", json.loads(path.read_text()))) if path.exists() else {}


def _walk(place: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict | list) and value:
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for key, each in pairs:
            yield from _walk(f"{place}/{key}", each)
    else:
        yield place, json.dumps(value, ensure_ascii=False)


if __name__ == "__main__":
    sys.exit(main())

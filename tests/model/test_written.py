"""Files that an earlier version wrote are read, number by number.

`python -m tests.model.test_written` writes those of this version, which a release adds.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, case_scene, load, read_scene, solve, solve_many
from pyharness.events import crosses
from pyharness.model.distribution import version
from pyharness.model.scene_file import scene_text
from pyharness.torques import damping
from tests.refused import refused

FOLDER = Path(__file__).parent / "written"
VERSIONS = sorted(each.name for each in FOLDER.iterdir() if each.is_dir())
_BODY = Scene("nut", (0.02, 6.0, 0.1), moments=(0.9, 1.6, 2.3), attitude=(1.0, 0.0, 0.0, 0.0))
_DAMPED = Scene("damped", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5), torque=damping(0.1))


def _write(folder: Path) -> None:
    """Write a file of each kind, and what was in it."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [0.0, 0.5, 1.0, 2.0]
    made: dict[str, Any] = {
        "free": solve(_BODY, rows, attitude=True),
        "event": solve(_DAMPED, rows, events=crosses(1, 0.25, terminal=True)),
        "case": solve(case_scene(3), rows, "dop853"),
        "many": solve_many(_DAMPED, 1.0, omega=[[0.3, 0.2, 1.0], [1.0, 0.1, 0.2]]),
    }
    for name, found in made.items():
        found.save(folder / f"{name}.npz")
    for scene in (_BODY, _DAMPED):
        (folder / f"{scene.name}.toml").write_text(scene_text(scene))
    content = {name: _content(each) for name, each in made.items()}
    (folder / "content.json").write_text(json.dumps(content, indent=1) + "\n")


def _content(found: Any) -> dict[str, Any]:
    """Return the numbers of a result, in hexadecimal."""
    arrays = {name: getattr(found, name, None) for name in ("time", "omega", "attitude")}
    return {
        name: [float(number).hex() for number in np.ravel(each)]
        for name, each in arrays.items()
        if each is not None
    }


def test_this_version_or_the_last_has_its_files() -> None:
    assert version() in VERSIONS


@pytest.mark.parametrize("name", VERSIONS)
def test_files_of_a_version_are_read(name: str) -> None:
    content = json.loads((FOLDER / name / "content.json").read_text())
    assert len(content) >= 4
    for part, numbers in content.items():
        read: Any = Ensemble.load if part == "many" else load
        assert _content(read(FOLDER / name / f"{part}.npz")) == numbers
    for scene in (_BODY, _DAMPED):
        assert read_scene(FOLDER / name / f"{scene.name}.toml") == scene


@pytest.mark.parametrize("name", VERSIONS)
def test_a_file_of_a_version_that_was_changed_is_refused(name: str, tmp_path: Path) -> None:
    content = bytearray((FOLDER / name / "free.npz").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "free.npz").write_bytes(content)
    refused("free.npz", load, tmp_path / "free.npz")


if __name__ == "__main__":
    _write(FOLDER / version())

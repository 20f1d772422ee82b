"""A store of a module's own sweep, SWEEP, and a copy of it for each test."""

import shutil
from pathlib import Path

import pytest

from pyharness.sweep.sweep_file import read_sweep
from tests.sweep.sweeps import run_sweep, written


@pytest.fixture(scope="module")
def intact(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a sweep file, `sweep.toml`, and its store, `store`: 8 chunks."""
    folder = tmp_path_factory.mktemp("intact")
    run_sweep(read_sweep(written(folder, request.module.SWEEP)), str(folder / "store"))
    return folder


@pytest.fixture
def store(intact: Path, tmp_path: Path) -> Path:
    """Return a copy of the store."""
    return Path(shutil.copytree(intact / "store", tmp_path / "store"))

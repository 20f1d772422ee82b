"""The scripts for clusters in docs/how-to/cluster, with commands in place of Slurm's."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pyharness.sweep.sweep_file import read_sweep
from tests.sweep.sweeps import files, run_sweep

pytest.importorskip("distributed")
xarray = pytest.importorskip("xarray")
pytestmark = pytest.mark.campaign
ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "docs/how-to/cluster"
# Slurm starts a program once for each task. Here there are three.
SRUN = 'for task in 1 2 3; do "$@" & done; wait'


def run(folder: Path, text: str, **more: str) -> None:
    """Run the text of a script in a folder, in which the commands of a cluster are found."""
    commands = {
        "srun": SRUN, "hostname": "echo 127.0.0.1", "python": f'exec {sys.executable} "$@"',
        "pyharness": f'exec {sys.executable} -m pyharness "$@"',
        "dask": f'exec {sys.executable} -m dask "$@"',
    }  # fmt: skip
    places = folder / "bin"
    places.mkdir(exist_ok=True)
    for name, content in commands.items():
        (places / name).write_text(f"#!/bin/sh\n{content}\n")
        (places / name).chmod(0o755)
    path = f"{places}{os.pathsep}{os.environ['PATH']}"
    found = subprocess.run(
        ["sh", "-c", text],
        cwd=folder, env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), **more},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr


def test_parts_of_an_array_are_joined(tmp_path: Path) -> None:
    shutil.copy(SCRIPTS / "parts.toml.in", tmp_path)
    for part in range(2):
        run(tmp_path, (SCRIPTS / "array.sh").read_text(), SLURM_ARRAY_TASK_ID=str(part))
    parts = [xarray.open_zarr(tmp_path / f"part-{part}.zarr") for part in range(2)]
    found = xarray.concat(parts, dim="sample")
    assert found["pointing-error"].shape == (6000,)
    assert len(np.unique(found["omega.1"])) == 6000
    assert int((found["status"] != 0).sum()) == 0
    assert 0.0 < float(found["tilted-time"].mean()) < 30.0


def test_cluster_in_one_job_writes_the_bytes_of_this_process(tmp_path: Path) -> None:
    text = (SCRIPTS / "parts.toml.in").read_text().replace("PART", "7")
    (tmp_path / "sweep.toml").write_text(text)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    run(tmp_path, (SCRIPTS / "dask.sh").read_text().replace("8786", port))
    run_sweep(read_sweep(tmp_path / "sweep.toml"), str(tmp_path / "here"))
    assert files(tmp_path / "here") == files(tmp_path / "sweep.zarr")

"""Sweep files for the tests."""

import time
from pathlib import Path
from typing import Any

from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.run import Outcome, swept
from pyharness.sweep.sweep import Arrays, Sweep, points

BASE = """
[scene.body]
moments = [1.0, 2.0, 3.0]
[scene.initial]
omega = [0.0, 1.0, 0.0]
[scene.run]
step_size = 0.1
steps = 100
"""
TILT = '[[axis]]\nfield = "tilt"\nfrom = 0.001\nto = 1.0\nspacing = "log"\ncount = 6\n'
SQUARE = '[[axis]]\nfield = "body.square.1"\nfrom = 0.2\nto = 1.0\ncount = 5\n'
PROGRAM = Path(__file__).with_name("program.toml").read_text()


def every(sweep: Sweep) -> list[Any]:
    """Return the places of all scenes."""
    return points(tuple(slice(0, n) for n in sweep.shape))


def axis(field: str, values: object) -> str:
    """Return a table [[axis]] with these values."""
    return f'[[axis]]\nfield = "{field}"\nvalues = {values}\n'


def text(*axes: str, top: str = 'reductions = ["end", "status"]', scene: str = BASE) -> str:
    return "\n".join([top, scene, *axes])


def written(folder: Path, content: str, name: str = "sweep.toml") -> str:
    (folder / name).write_text(content)
    return str(folder / name)


def run_sweep(sweep: Sweep, path: str, *choices: Any, **more: Any) -> Outcome:
    """Compute the missing chunks of a sweep, and return the outcome."""
    with swept(sweep, path, *choices, **more) as (_, outcome):
        return outcome


def files(store: Path) -> dict[str, bytes]:
    """Return the content of every file of a store by its path."""
    found = (each for each in store.rglob("*") if each.is_file())
    return {str(each.relative_to(store)): each.read_bytes() for each in found}


def quick_and_slow(sweep: Sweep, chunk: int) -> Arrays:
    """Compute the first chunk at once, and all others after an hour."""
    time.sleep(3600.0 if chunk else 0.0)
    return solve_chunk(sweep, chunk)

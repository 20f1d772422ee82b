"""A scene of a sweep has the same bits in every chunk."""

from pathlib import Path

import pytest

from pyharness.sweep.batches import solve_points
from pyharness.sweep.sweep_file import read_sweep
from tests.sweep.sweeps import TILT, axis, every, text, written

TORQUE, RATE = axis("torque.constant.1", [0.0, 0.3, 0.7]), axis("torque.rate.2", [0.0, 0.1])
TIME = '[[axis]]\nfield = "t_end"\nfrom = 0.5\nto = 40.0\ncount = 4'


@pytest.mark.parametrize("method", ["auto", "rk4"])
@pytest.mark.parametrize("axes", [(TORQUE, TILT), (TILT, TORQUE, RATE, TIME)], ids=["two", "four"])
def test_chunks_change_no_bit(axes: tuple[str, ...], method: str, tmp_path: Path) -> None:
    """Some torques are zero, so that a chunk may have only zeros, or zeros among others."""
    if method == "rk4":
        axes = tuple(each for each in axes if each != TIME)
    sweep = read_sweep(written(tmp_path, text(*axes, f'[solve]\nmethod = "{method}"')))
    places = every(sweep)
    whole = solve_points(sweep, places)
    for size in (1, 2, 3, 7, 64):
        for first in range(0, sweep.n_scenes, size):
            part = solve_points(sweep, [each[first : first + size] for each in places])
            for name, values in part.items():
                assert values.tobytes() == whole[name][first : first + size].tobytes()

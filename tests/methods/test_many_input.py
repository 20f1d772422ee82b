"""What `solve_many` and a solver's `many` refuse, in one line each."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, prepare, solve_many

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))
READ_ONLY = np.zeros((2, 3))
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"omega0": [[1.0, 2.0]]}, "omega0: shape (1, 2); allowed: (3,) or (n, 3)"),
        ({"omega0": "abc"}, "omega0: an array of <U3; allowed: real numbers"),
        ({"omega0": [[1.0, 2.0, 3.0], [1.0]]}, "omega0: rows of different lengths"),
        ({"omega0": np.zeros((4, 3)), "moments": np.ones((3, 3))}, "moments: 3 rows; allowed: 1"),
        ({"t_end": [[1.0]]}, "t_end: shape (1, 1); allowed: one number, or shape (n,)"),
        ({"omega0": np.zeros((4, 3)), "t_end": [1.0, 2.0]}, "t_end: 2 rows"),
        ({"moments": [1.0, 1, 1], "coefficients": [1.0, 1, 1]}, "moments and coefficients are"),
        ({"sines": [1.0, 2.0]}, "sines: shape (2,); allowed: (k, 4) or (n, k, 4)"),
        ({"method": "rk5"}, "unknown method 'rk5'"),
        ({"method": "closed-form", "torque_constant": [1.0, 0, 0]}, "closed-form can't take"),
        ({"method": "rk4", "attitude0": [1.0, 0, 0, 0]}, "method rk4 carries no attitude"),
        ({"tolerance": 1e-17}, "tolerance is 1e-17; allowed: 1e-15 to 1"),
        ({"method": "quick", "tolerance": 1e-14}, "tolerance is 1e-14; allowed: 1e-12 to 1"),
        ({"threads": 0}, "threads is 0; allowed: 1 to 1024"),
        ({"threads": 1.5}, "threads is a number; it must be a whole number"),
        ({"step": 0.0, "method": "rk4"}, "step is 0; allowed: above 0"),
        ({"out": READ_ONLY, "omega0": np.zeros((2, 3))}, "out: allowed: a writable"),
        ({"out": np.zeros((5, 3)), "omega0": np.zeros((2, 3))}, "out: allowed: a writable array"),
        ({"out": "here"}, "out: allowed: an Ensemble, or an array of float64"),
    ],
)  # fmt: skip
def test_bad_input_is_said_in_one_line(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as raised:
        solve_many(TOP, **{"t_end": 1.0, **given})
    assert str(raised.value).startswith(said)
    assert "\n" not in str(raised.value)


def test_bad_starts_of_a_solver() -> None:
    solver = prepare(TOP)
    for omega0, t_end, said in (
        (np.zeros((2, 2)), 1.0, "omega0: shape (2, 2)"),
        (np.zeros((2, 3)), np.zeros(3), "t_end: shape (3,); allowed: one number, or shape (2,)"),
        (np.zeros((2, 3), complex), 1.0, "omega0: an array of complex128"),
    ):
        with pytest.raises(InputError, match="allowed") as raised:
            solver.many(omega0, t_end)
        assert str(raised.value).startswith(said)


def test_scenes_that_do_not_go_side_by_side() -> None:
    space = replace(TOP, torque=TorqueLaw((1.0, 0.0, 0.0), frame="space"))
    body = Scene("coefficients", (1.0, 1.0, 1.0), coefficients=(0.25, -0.5, 0.3))
    for scenes, said in (
        ([], "there is no scene"),
        ([TOP, body], "the scenes have more than one kind of body"),
        ([TOP, replace(TOP, step_size=0.5)], "the scenes have more than one step size"),
        ([TOP, replace(TOP, attitude=(1.0, 0.0, 0.0, 0.0))], "some scenes have an attitude"),
        (space, "the torque is about the axes of space"),
    ):
        with pytest.raises(InputError) as raised:
            solve_many(scenes, 1.0)
        assert str(raised.value).startswith(said)
    with pytest.raises(InputError, match="omega0 is given beside many scenes"):
        solve_many([TOP], 1.0, omega0=[1.0, 2.0, 3.0])

"""Arguments that `solve_many`, `run_many` and a solver's `many` refuse, in one line each."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, prepare, run_many, solve_many
from pyharness.model.listing import Listing

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))
LISTING = Listing.corrected("two-term")
READ_ONLY = np.zeros((2, 3))
READ_ONLY.flags.writeable = False


# The same mistake has the same message at every entry point.
ALIKE: list[tuple[dict[str, Any], str]] = [
    ({"omega0": np.ones((5, 2))}, "omega0: shape (5, 2); allowed: (3,) or (n, 3)"),
    ({"omega0": np.ones((5, 1, 3))}, "omega0: shape (5, 1, 3); allowed: (3,) or (n, 3)"),
    ({"omega0": 1.0}, "omega0: shape (); allowed: (3,) or (n, 3)"),
    ({"omega0": "abc"}, "omega0: text where a number belongs"),
    ({"omega0": ["1", "2", "3"]}, "omega0: text where a number belongs"),
    ({"omega0": [True, False, True]}, "omega0: true or false where a number belongs"),
    ({"omega0": np.ones(3) * 1j}, "omega0: a complex number where a number belongs"),
    ({"omega0": [None, 1.0, 2.0]}, "omega0: nothing where a number belongs"),
    ({"omega0": [10**400, 1, 1]}, "omega0: a number too large for binary64"),
    (
        {"omega0": [[1.0, 2.0, 3.0], [1.0]]},
        "omega0: a list that is not an array of numbers; allowed: rows of equal length",
    ),
    (
        {"omega0": np.ones((4, 3)), "moments": np.ones((3, 3))},
        "moments: 3 rows; allowed: 1, or 4, the number of bodies",
    ),
    (
        {"omega0": np.ones((4, 3)), "moments": np.ones((0, 3))},
        "omega0: 4 rows; allowed: 1, or 0, the number of bodies",
    ),
    (
        {"moments": [1.0, 1, 1], "coefficients": [1.0, 1, 1]},
        "moments and coefficients are both given; give one of them",
    ),
    ({"threads": 0}, "threads is 0; allowed: 1 to 1024"),
    ({"threads": 1.5}, "threads is a number; it must be a whole number"),
    ({"effort": 0.0}, "effort: 0; allowed: a finite number above 0"),
]


@pytest.mark.parametrize(("given", "said"), ALIKE)
def test_mistake_has_the_same_words_for_methods_and_programs(
    given: dict[str, Any], said: str
) -> None:
    for run in (lambda: solve_many(TOP, 1.0, **given), lambda: run_many(TOP, LISTING, **given)):
        with pytest.raises(InputError) as raised:
            run()
        assert said in str(raised.value).splitlines()
    if given.keys() == {"omega0"} and said.endswith("belongs"):
        with pytest.raises(InputError) as raised:
            prepare(TOP).many(given["omega0"], 1.0)
        assert str(raised.value) == said


def test_one_row_is_shared_and_fractions_are_numbers() -> None:
    starts = np.ones((4, 3))
    moments: Any = [[Fraction(5, 2), 3, 4]]
    times = np.full(4, 0.5)
    found = solve_many(TOP, times, omega0=starts[:1], moments=moments)
    wanted = solve_many(TOP, times, omega0=starts, moments=np.tile([2.5, 3.0, 4.0], (4, 1)))
    assert np.array_equal(found.omega, wanted.omega)
    sizes = np.full(4, 0.01)
    run = run_many(TOP, LISTING, omega0=starts[:1], moments=moments, step_size=sizes)
    alone = run_many(TOP, LISTING, omega0=starts[0], moments=[2.5, 3.0, 4.0], step_size=0.01)
    assert np.array_equal(run.omega, np.tile(alone.omega, (4, 1, 1)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"t_end": [[1.0]]}, "t_end: shape (1, 1); allowed: one number or (n,)"),
        ({"omega0": np.zeros((4, 3)), "t_end": [1.0, 2.0]}, "t_end: 2 rows"),
        ({"sines": [1.0, 2.0]}, "sines: shape (2,); allowed: (k, 4) or (n, k, 4)"),
        ({"method": "rk5"}, "unknown method 'rk5'"),
        ({"method": "closed-form", "torque_constant": [1.0, 0, 0]}, "closed-form can't solve"),
        ({"method": "rk4", "attitude0": [1.0, 0, 0, 0]}, "method rk4 does not compute attitudes"),
        ({"tolerance": 1e-17}, "tolerance is 1e-17; allowed: 1e-15 to 1"),
        ({"method": "quick", "tolerance": 1e-14}, "tolerance is 1e-14; allowed: 1e-12 to 1"),
        ({"step": 0.0, "method": "rk4"}, "step is 0; allowed: above 0"),
        ({"out": READ_ONLY, "omega0": np.zeros((2, 3))}, "out: allowed: a writable"),
        ({"out": np.zeros((5, 3)), "omega0": np.zeros((2, 3))}, "out: allowed: a writable array"),
        ({"out": "here"}, "out has the wrong type; allowed: an Ensemble, or an array of float64"),
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
        (np.zeros((2, 2)), 1.0, "omega0: shape (2, 2); allowed: (3,) or (n, 3)"),
        (np.zeros((2, 3)), np.zeros(3), "t_end: 3 rows; allowed: 1, or"),
        (np.zeros((2, 3), complex), 1.0, "omega0: a complex number where a number belongs"),
    ):
        with pytest.raises(InputError) as raised:
            solver.many(omega0, t_end)
        assert str(raised.value).startswith(said)


def test_scenes_that_do_not_go_side_by_side() -> None:
    space = replace(TOP, torque=TorqueLaw((1.0, 0.0, 0.0), frame="space"))
    body = Scene("coefficients", (1.0, 1.0, 1.0), coefficients=(0.25, -0.5, 0.3))
    for scenes, said in (
        ([], "the sequence of scenes is empty"),
        ([TOP, body], "some bodies are given by coefficients"),
        ([TOP, replace(TOP, step_size=0.5)], "the scenes have different step sizes"),
        ([TOP, replace(TOP, attitude=(1.0, 0.0, 0.0, 0.0))], "some of the scenes have an attitude"),
        (space, "the torque needs the initial attitude"),
    ):
        with pytest.raises(InputError) as raised:
            solve_many(scenes, 1.0)
        assert str(raised.value).startswith(said)


@pytest.mark.parametrize(
    "name", ["omega0", "moments", "coefficients", "torque_constant", "torque_rate"]
)
def test_arrays_beside_many_scenes_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"^{name} is given beside many scenes"):
        solve_many([TOP, TOP], 1.0, **{name: [1.0, 2.0, 3.0]})  # type: ignore[arg-type]

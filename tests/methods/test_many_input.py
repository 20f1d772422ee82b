"""Arguments of `solve_many`, `run_many` and a solver's `many`."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, prepare, run_many, solve_many
from pyharness.model.listing import Listing

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))
LISTING = Listing.corrected("two-term")


@pytest.mark.parametrize(
    "given",
    [
        {"omega0": np.ones((5, 2))},
        {"omega0": "abc"},
        {"omega0": [10**400, 1, 1]},
        {"omega0": [[1.0, 2.0, 3.0], [1.0]]},
        {"omega0": np.ones((4, 3)), "moments": np.ones((3, 3))},
        {"moments": [1.0, 1, 1], "coefficients": [1.0, 1, 1]},
        {"threads": 0},
        {"effort": 0.0},
    ],
)
def test_mistake_has_the_same_words_for_methods_and_programs(given: dict[str, Any]) -> None:
    with pytest.raises(InputError) as first:
        solve_many(TOP, 1.0, **given)
    with pytest.raises(InputError) as second:
        run_many(TOP, LISTING, **given)
    assert str(first.value) == str(second.value)
    if given.keys() == {"omega0"}:
        with pytest.raises(InputError) as third:
            prepare(TOP).many(given["omega0"], 1.0)
        assert str(first.value) == str(third.value)


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

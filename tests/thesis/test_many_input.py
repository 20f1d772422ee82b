"""Arguments of `run_many`: the accepted forms."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Listing, Scene, TorqueLaw, case_scene, run_many
from pyharness.thesis import compiled
from tests.thesis.single_runs import assert_same, same_bits


def test_numbers_of_any_type() -> None:
    scene, listing = case_scene(3), Listing.corrected("two-term")
    starts = [[0.5, 1.0, 2.0], [0.5, -1.0, 2.0]]
    wanted = run_many(scene, listing, omega=starts, moments=(4.0, 3.0, 2.0))
    kinds: list[tuple[Any, Any]] = [
        ([[Fraction(1, 2), 1, 2], [0.5, Fraction(-1), 2]], np.array([4, 3, 2])),
        (np.array(starts, dtype=np.float32), (4, 3, Fraction(2))),
        (np.asfortranarray(starts), np.array([4, 9, 3, 9, 2, 9.0])[::2]),
    ]
    for omega, moments in kinds:
        found = run_many(scene, listing, omega=omega, moments=moments, threads=np.int64(1))
        assert_same(found, wanted)


def test_arrays_stand_in_for_what_a_scene_lacks() -> None:
    """With arrays the scene may have a full inertia matrix (not read) and a zero space torque."""
    listing, space = Listing.corrected("two-term"), TorqueLaw(frame="space")
    scene = Scene("", (1.0, 2.0, 3.0), inertia=np.eye(3), torque=space)
    found = run_many(scene, listing, moments=(3.0, 2.0, 1.0))
    plain = Scene("", (1.0, 2.0, 3.0), (3.0, 2.0, 1.0))
    assert same_bits(found.omega[0, 0], compiled.run(plain, listing).omega[-1])
    # An effort lets more bodies run; `at` is a list.
    starts = np.ones((200, 3))
    found = run_many(case_scene(3), Listing.corrected("two-term"), omega=starts, effort=1e-4)
    assert found.n_rows.tolist() == [100] * 200
    with pytest.raises(InputError, match="at"):
        run_many(case_scene(3), Listing.corrected("two-term"), at=5)  # type: ignore[arg-type]

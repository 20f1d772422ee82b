"""Arguments of `run_many`: the accepted forms, and refusals that name the first bad row."""

import functools
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from pyharness.model.errors import InputError
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, most_steps
from pyharness.model.scene_file import case_scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.original import compiled
from pyharness.original.many import run_many
from tests.original.single_runs import Options, assert_same, same_bits


def test_numbers_of_any_type() -> None:
    scene, listing = case_scene(3), Listing.corrected("two-term")
    starts = [[0.5, 1.0, 2.0], [0.5, -1.0, 2.0]]
    wanted = run_many(scene, listing, omega0=starts, moments=(4.0, 3.0, 2.0))
    kinds: list[tuple[Any, Any]] = [
        ([[Fraction(1, 2), 1, 2], [0.5, Fraction(-1), 2]], np.array([4, 3, 2])),
        (np.array(starts, dtype=np.float32), (4, 3, Fraction(2))),
        (np.asfortranarray(starts), np.array([4, 9, 3, 9, 2, 9.0])[::2]),
    ]
    for omega, moments in kinds:
        found = run_many(scene, listing, omega0=omega, moments=moments, threads=np.int64(1))
        assert_same(found, wanted)


def _bad(row: int, value: float) -> np.ndarray:
    array = np.ones((20, 3))
    array[row, 1] = value
    return array


SPACE = TorqueLaw(frame="space")
BAD: dict[str, tuple[Options, str]] = {
    "moment": ({"moments": _bad(17, -1.0)}, r"moments\[17\]\[1\] is -1; allowed: a finite .* 0"),
    "no moment": ({"moments": [1.0, 0.0, 2.0]}, r"moments\[1\] is 0; allowed"),
    "endless moment": ({"moments": _bad(3, np.inf)}, r"moments\[3\]\[1\] is inf; allowed"),
    "coefficient": ({"coefficients": _bad(0, np.nan)}, r"coefficients\[0\]\[1\] is nan; allowed"),
    "omega": ({"omega0": _bad(19, np.inf)}, r"omega0\[19\]\[1\] is inf; allowed: finite numbers"),
    "torque": ({"torque_constant": _bad(2, np.nan)}, r"torque_constant\[2\]\[1\] is nan"),
    "step": ({"step_size": [0.1, 0.0]}, r"step_size\[1\] is 0; allowed: a finite number above 0"),
    "only step": ({"step_size": -1.0}, "step_size is -1; allowed"),
    "steps": ({"step_size": np.ones((3, 1))}, r"step_size: shape \(3, 1\); allowed: one"),
    "end": ({"step_size": [1.0, 1e307]}, r"step_size\[1\] times steps is not finite"),
    "lipschitz": ({"lipschitz": [1.0, np.nan]}, r"lipschitz\[1\] is nan; allowed: a number from 0"),
    "below 0": ({"lipschitz": -1.0}, "lipschitz is -1; allowed"),
    "stop": ({"may_stop": 1}, "may_stop is a whole number; allowed: True or False"),
    "velocity": ({"velocity": None}, "velocity is nothing; allowed"),
    "at": ({"at": [0]}, "at: 0; allowed: steps from 1 to 100"),
    "late": ({"at": [1, 101]}, "at: 101; allowed"),
    "fraction": ({"at": [1.5]}, "at is a number; it must be a whole number"),
    "no list": ({"at": 5}, "at: a whole number; allowed: a list of steps"),
    "work": (
        {"omega0": np.ones((200, 3)), "effort": 1e-5},
        r"100 steps of 200 bodies would take too long; use fewer, or allow .* --effort 2",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_is_refused(name: str) -> None:
    options, message = BAD[name]
    with pytest.raises(InputError, match=message):
        run_many(case_scene(3), Listing.corrected("runge-kutta"), **options)


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "no scene": (lambda: run_many("case 3", Listing.corrected("two-term")), "scene is text"),  # type: ignore[arg-type]
    "no listing": (lambda: run_many(case_scene(3), "original"), "listing is text"),  # type: ignore[arg-type]
    "inertia": (
        lambda: run_many(Scene("", (1, 2, 3), inertia=np.eye(3)), Listing.corrected("two-term")),
        "the scene has a full inertia matrix",
    ),
    "space": (
        lambda: run_many(replace(case_scene(3), torque=SPACE), Listing.corrected("two-term"),
                         torque_constant=[[0.0, 0.0, 1.0]]),
        "the torque is about the axes of space",
    ),
    "memory": (
        lambda: run_many(
            replace(case_scene(3), steps=1000), Listing.corrected("two-term"), at=range(1, 1001),
            omega0=np.ones((most_steps() // 1000 + 1, 3)), effort=1e9,
        ),
        "this machine's memory can hold",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_scenes_that_are_refused(name: str) -> None:
    run, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        run()


def test_arrays_stand_in_for_what_a_scene_lacks() -> None:
    """With arrays the scene may have a full inertia matrix (not read) and a zero space torque."""
    scene = Scene("", (1.0, 2.0, 3.0), inertia=np.eye(3), torque=SPACE)
    found = run_many(scene, Listing.corrected("two-term"), moments=(3.0, 2.0, 1.0))
    plain = Scene("", (1.0, 2.0, 3.0), (3.0, 2.0, 1.0))
    assert same_bits(
        found.omega[0, 0], compiled.run(plain, Listing.corrected("two-term")).omega[-1]
    )


def test_an_effort_lets_more_bodies_run() -> None:
    run = functools.partial(
        run_many, case_scene(3), Listing.corrected("two-term"), omega0=np.ones((200, 3))
    )
    assert run(effort=1e-4).n_rows.tolist() == [100] * 200

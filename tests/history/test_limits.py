"""Limits of the listings: each program approaches its own limit, and stays away from the truth."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from pyharness import Scene, case_scene
from pyharness.history.limits import NOTHING, Limit, invisible, limit
from tests.conftest import Printed


def _tends_elsewhere(found: Limit) -> bool:
    first, last = found.halvings[0], found.halvings[-1]
    return last.from_limit < first.from_limit / 8.0 and last.from_truth > first.from_truth / 2.0


@pytest.mark.parametrize(
    ("program", "case"),
    [*(("two-term", n) for n in (3, 4, 5)), *(("runge-kutta", n) for n in (2, 3, 4, 5, 7))],
)
def test_program_tends_elsewhere_with_first_order(program: str, case: int) -> None:
    found = limit(program, case_scene(case))
    assert _tends_elsewhere(found)
    assert found.order == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("case", [2, 3, 4, 5, 6])
def test_four_term_tends_to_the_truth(case: int) -> None:
    found = limit("four-term", case_scene(case))
    assert not _tends_elsewhere(found)
    assert found.order == pytest.approx(2.0, abs=0.1)


def test_two_term_in_case_6_follows_its_limit_into_the_blow_up() -> None:
    assert _tends_elsewhere(limit("two-term", replace(case_scene(6), steps=30)))
    found = limit("two-term", case_scene(6), 2)
    assert math.isinf(found.halvings[0].from_limit)
    for each in (found, limit("two-term", replace(case_scene(6), step_size=0.07, steps=14), 2)):
        assert each.blow_up == pytest.approx(0.4929, abs=1e-4)
        assert "grows without bound at t = 0.493 s" in each.approach


@pytest.mark.parametrize("program", ["two-term", "four-term"])
def test_collocation_in_case_7_tends_to_nothing(program: str) -> None:
    """The distance from the truth doubles with every halving of the step."""
    found = limit(program, case_scene(7), 3)
    assert found.tends_to == NOTHING
    distances = np.array([each.from_truth for each in found.halvings])
    np.testing.assert_allclose(distances[1:] / distances[:-1], 2.0, rtol=0.05)


def test_defects_that_the_known_solutions_hide() -> None:
    """Cases 1 and 2 can't show the two-term program's defects, or one of the third program's."""
    assert invisible(case_scene(2)) == {
        "two-term": ("dt-accumulates", "x3-reads-acl2", "three-masses"),
        "four-term": ("dt-accumulates", "three-masses"),
        "runge-kutta": ("lipschitz-mismatched-pairs",),
    }
    hidden = invisible(case_scene(1))
    assert hidden["two-term"] == ("dt-accumulates", "x3-reads-acl2", "three-masses")
    assert "stage-base" not in hidden["runge-kutta"]
    for case in (3, 4, 5, 6):  # four terms represent f at any points, two do not
        hidden = invisible(case_scene(case))
        assert "dt-accumulates" in hidden["four-term"]
        assert "dt-accumulates" not in hidden["two-term"]


def test_limits_in_every_form(printed: Printed) -> None:
    command = "limits --case 5 --halvings 2"
    text = printed(command)
    assert "2 y(t/2) - y(0)" in text
    assert all(len(line) <= 100 and not line.endswith("-") for line in text.splitlines())
    record = json.loads(printed(f"{command} --program two-term --format json"))
    assert np.all(np.diff([each["from_limit"] for each in record["limits"][0]["halvings"]]) < 0)
    assert printed(f"{command} --format csv").count("\n") == 1 + 3 * 3


@pytest.mark.campaign
def test_limits_of_a_scene_that_its_solver_can_not_begin() -> None:
    """Regression test: AttributeError, because no rows are a list, not an array."""
    coefficients = (1.1e-16, 1.1e-16, 4.4e17)
    scene = Scene("", (0.005, -5.0, -1.6), coefficients=coefficients, step_size=0.6, steps=4)
    assert limit("two-term", scene, 1).order is None

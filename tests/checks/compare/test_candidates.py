"""A comparison judges the program that was requested."""

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.checks.compare.candidates import (
    method_candidate,
    prepared_candidate,
    program_candidate,
)
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis.programs import IMPLEMENTATIONS

SCENE = case_scene(5)
END = SCENE.step_size * SCENE.steps


@pytest.mark.parametrize("implementation", IMPLEMENTATIONS)
@pytest.mark.parametrize("program", PROGRAMS)
def test_end_of_a_program_is_its_last_row(program: str, implementation: str) -> None:
    candidate = program_candidate(Listing.corrected(program), implementation, may_stop=False)
    rows, end = candidate.rows(SCENE), candidate.end(SCENE, END)
    np.testing.assert_array_equal(end.omega, rows.omega[-1])
    assert (end.ended, end.steps, end.evaluations) == ("complete", rows.steps, rows.evaluations)


def test_a_twin_enters_no_compiled_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bits are the same, so only the module that computed them distinguishes the two."""
    for room in ("checks.compare.candidates", "thesis.compiled"):
        monkeypatch.setattr(f"pyharness.{room}.extension", lambda: pytest.fail("compiled"))
    twin = program_candidate(Listing.original("two-term"), "python")
    assert twin.end(SCENE, END).ended == "complete"


def test_end_of_a_method_is_that_of_its_rows() -> None:
    method = method_candidate("taylor", 1e-12)
    np.testing.assert_array_equal(method.end(SCENE, END).omega, method.rows(SCENE, [END]).omega[-1])


def test_a_call_before_leaves_nothing_behind() -> None:
    plain, primed = (
        prepared_candidate("auto", 1e-6, primed).end(SCENE, END) for primed in (False, True)
    )
    np.testing.assert_array_equal(plain.omega, primed.omega)

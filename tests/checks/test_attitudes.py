"""Checks of the attitude: what a closed form has to refuse, and in which words."""

from pyharness import Scene, TorqueLaw
from pyharness.checks.attitudes import _held, _standard
from pyharness.checks.check import REFUSED

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0), attitude=(1.0, 0.0, 0.0, 0.0))
DRIVEN = Scene("driven", TOP.omega, moments=TOP.moments, torque=TorqueLaw((1.0, 2.0, 3.0)),
               attitude=TOP.attitude)  # fmt: skip


def test_a_closed_form_solves_what_has_one_and_says_why_it_refuses_the_rest() -> None:
    kept = _held("top", TOP, "closed-form", 1e-9, _standard(TOP, [1.0, 2.0]))
    assert kept.passed
    assert kept.value is not None
    assert kept.value <= 1e-9
    refused = _held("driven", DRIVEN, "closed-form", 1e-9, _standard(DRIVEN, [1.0, 2.0]))
    assert refused.passed
    assert (refused.value, refused.limit) == (None, None)
    assert refused.note.startswith(REFUSED)
    assert "torque" in refused.note


def test_a_method_that_refuses_what_it_should_solve_fails() -> None:
    check = _held("driven", DRIVEN, "no-such-method", 1e-9, _standard(DRIVEN, [1.0]))
    assert not check.passed
    assert "no-such-method" in check.note

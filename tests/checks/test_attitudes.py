"""Attitudes are judged: a closed form solves what it can, and gives the reason of a refusal."""

from pyharness import Scene, TorqueLaw
from pyharness.checks.check import REFUSED, Check, Name
from pyharness.checks.judge import AS_STATED, by_rows, judge, reference_truth

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0), attitude=(1.0, 0.0, 0.0, 0.0))
DRIVEN = Scene("driven", TOP.omega, moments=TOP.moments, torque=TorqueLaw((1.0, 2.0, 3.0)),
               attitude=TOP.attitude)  # fmt: skip


def judged(scene: Scene, method: str) -> Check:
    times = [1.0, 2.0]
    tried = by_rows(method, 1e-9, scene, times)
    return judge(Name("attitudes", method), tried, reference_truth(scene, times), AS_STATED)


def test_a_closed_form_solves_what_has_one_and_says_why_it_refuses_the_rest() -> None:
    kept = judged(TOP, "closed-form")
    assert kept.passed
    assert kept.value is not None
    assert kept.value <= 1e-9
    refused = judged(DRIVEN, "closed-form")
    assert refused.passed
    assert (refused.value, refused.limit) == (None, None)
    assert refused.note.startswith(REFUSED)
    assert "torque" in refused.note


def test_a_method_that_refuses_what_it_should_solve_fails() -> None:
    check = judged(DRIVEN, "no-such-method")
    assert not check.passed
    assert "no-such-method" in check.note

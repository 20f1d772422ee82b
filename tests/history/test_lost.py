"""The lost experiments: the weightings without a mistake, and what each mistake must show."""

import pytest

from pyharness.history import lost
from pyharness.history.lost import Ranked, halved, march, ranked
from pyharness.model.facts import facts
from pyharness.model.scene_file import case_scene


@pytest.fixture(scope="module")
def found() -> dict[str, Ranked]:
    return {each.mistake: each for each in ranked()}


def test_without_a_mistake_they_work(found: dict[str, Ranked]) -> None:
    assert not found["none"].in_either
    for weighting in lost.WEIGHTINGS:
        assert 3.5 < halved(case_scene(2), weighting) < 4.5


def test_mistake_in_the_products_cannot_fail_case_1(found: dict[str, Ranked]) -> None:
    """There A, B and C are 0, and all products with them."""
    assert case_scene(1).euler_coefficients == (0.0, 0.0, 0.0)
    for attempt in found["base-left-out"].attempts:
        assert attempt.failed == (2,)


def test_ranking_is_by_both_cases_then_by_either(found: dict[str, Ranked]) -> None:
    order = [(each.in_both, each.in_either) for each in found.values()]
    assert order == sorted(order, reverse=True)
    assert set(found) == {each["id"] for each in facts("lost")["mistake"]}
    assert found["torque-omitted"].attempts[0].failed == (1,)


def test_symmetric_matrix_does_not_mind_being_transposed() -> None:
    scene = case_scene(2)
    same = march(scene, "least-squares", "transposed") == march(scene, "least-squares")
    assert same.all()

"""The lost methods: their results without a mistake, and the effect of each mistake."""

from dataclasses import replace

import numpy as np
import pytest

from pyharness.history.lost import CASES, WEIGHTINGS, Ranked, integrate, ranked
from pyharness.model.facts import facts
from pyharness.model.scene_file import case_scene
from pyharness.thesis.in_word import WORDS, scene_in
from pyharness.truth.reference import reference


@pytest.fixture(scope="module")
def found() -> dict[str, Ranked]:
    return {each.mistake: each for each in ranked()}


@pytest.mark.campaign
def test_without_a_mistake_they_work(found: dict[str, Ranked]) -> None:
    assert not found["none"].in_either
    scene = case_scene(2)
    finer = replace(scene, step_size=scene.step_size / 2.0, steps=2 * scene.steps)
    for weighting in WEIGHTINGS:
        coarse, fine = (
            np.abs(integrate(each, weighting) - reference(each, each.times()).omega).max()
            for each in (scene, finer)
        )
        assert 3.5 < coarse / fine < 4.5


def test_ranking_is_by_both_cases_then_by_either(found: dict[str, Ranked]) -> None:
    order = [(each.in_both, each.in_either) for each in found.values()]
    assert order == sorted(order, reverse=True)
    assert set(found) == {each["id"] for each in facts("lost")["mistake"]}
    assert found["torque-omitted"].attempts[0].failed == (1,)
    # In Case 1, A, B and C are 0, and so are all products with them.
    assert case_scene(1).euler_coefficients == (0.0, 0.0, 0.0)
    for attempt in found["base-left-out"].attempts:
        assert attempt.failed == (2,)


@pytest.mark.campaign
def test_rounding_of_the_machine_makes_none_of_them_fail() -> None:
    """The claim iv2-computer-error is judged by all steps."""
    for weighting in WEIGHTINGS:
        for case in CASES:
            scene = replace(case_scene(case), steps=50)
            floats = integrate(scene, weighting)
            apart = {
                word: np.abs(integrate(scene_in(scene, WORDS[word]), weighting) - floats).max()
                for word in ("binary64", "cdc48", "cdc48-rounded", "binary32")
            }
            assert apart["binary64"] < 1e-14
            assert 1e-15 < apart["cdc48-rounded"] < apart["cdc48"] < 1e-12
            assert 1e-8 < apart["binary32"] < 1e-5


def test_mistakes_fail_in_a_word_where_they_fail() -> None:
    """One case is enough, because the effect of a mistake does not depend on rounding."""
    floats = replace(case_scene(2), steps=20)
    scene = scene_in(floats, WORDS["cdc48"])
    for mistake in ("matrix-used-up", "base-left-out", "unscaled-solver", "unit-interval"):
        for weighting in WEIGHTINGS:
            found, due = (integrate(each, weighting, mistake) for each in (scene, floats))
            assert np.allclose(found, due, rtol=1e-9, atol=1e-9)
    # A symmetric matrix may be transposed.
    one, other = (integrate(case_scene(2), "least-squares", *x) for x in ((), ("transposed",)))
    assert (one == other).all()

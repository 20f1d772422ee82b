"""Tests of the campaign of random batches with arrays of parameters."""

from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, InputError, solve_many
from pyharness.model.codes import Statuses
from tests.campaigns import driver, many_campaign
from tests.campaigns.many_batches import KINDS, draw
from tests.campaigns.many_campaign import MODULE, try_batch


@pytest.mark.campaign
@pytest.mark.parametrize("seed", ["1", "2"])
def test_bodies_of_batches_are_those_of_single_calls(seed: str) -> None:
    tally = driver.campaign(MODULE, try_batch, 300, seed)
    assert tally.faults == []
    assert tally.counts["batches"] >= 240
    # Functions of own states have no parameters.
    assert {name.partition(": ")[0] for name in tally.ratios} == {*KINDS} - {"wheels"}
    endings = {name for name in tally.counts if name.startswith("ended ")}
    assert endings >= {"ended complete", "ended overflow", "ended refused", "ended sliding"}


@pytest.mark.parametrize("kind", ["smooth", "switched", "pointed", "states"])
def test_each_kind_is_compared(kind: str) -> None:
    number = KINDS.index(kind)
    numbers = range(number, number + 20 * len(KINDS), len(KINDS))
    tally = driver.Tally(seed="test")
    for tally.number in numbers:
        if draw(Random(f"many test {tally.number}"), kind).n < 4:
            try_batch(tally)
        if tally.ratios:
            break
    assert tally.faults == []
    assert any(name.startswith(kind) for name in tally.ratios)


# A change of a result, and what the campaign reports.
WRONG: dict[str, tuple[Any, str]] = {
    "omega": (lambda found: replace(found, omega=1.001 * found.omega), "smooth: omega: error"),
    "status": (
        lambda found: replace(found, status=np.full_like(found.status, Statuses.GAVE_UP)),
        "smooth: ended gave up; alone: complete",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_result_is_reported(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    change, said = WRONG[kind]

    def wrong(*arguments: Any, **more: Any) -> Ensemble:
        found: Ensemble = change(solve_many(*arguments, **more))
        return found

    monkeypatch.setattr(many_campaign, "solve_many", wrong)
    tally = driver.campaign(MODULE, try_batch, 1, "test", KINDS.index("smooth"))
    assert any(said in fault for fault in tally.faults)


def test_an_unknown_refusal_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: Any, **more: Any) -> Ensemble:
        raise InputError("what nobody wrote down; allowed: nothing")

    monkeypatch.setattr(many_campaign, "solve_many", refused)
    assert "what nobody wrote down" in driver.campaign(MODULE, try_batch, 1, "test").faults[0]

"""Tests of the campaign of random scenes whose torque depends on the state."""

from random import Random
from typing import Any

import pytest

from pyharness import Scene
from pyharness.checks.scenes.state_scenes import draw, draw_ready
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference
from tests.campaigns import driver, entries
from tests.campaigns.driver import Tally
from tests.campaigns.entries import Result, truth_of
from tests.campaigns.state_campaign import MODULE, TOLERANCES, judge, main, try_scene
from tests.conftest import Capture, Patch

BLIND = "estimates below a hundredth of the error"


@pytest.mark.campaign
def test_no_result_exceeds_the_limit() -> None:
    tally = driver.campaign(MODULE, try_scene, 12, "test")
    assert tally.faults == []
    assert tally.counts["scenes"] == 12
    # Every scene has at least six entry points and eleven tolerances, unless it is singular.
    assert tally.counts["results"] >= 10 * 6 * len(TOLERANCES)
    assert tally.counts[BLIND] == 0
    assert 0.0 < max(map(max, tally.ratios.values())) <= 1.0


def test_the_reference_is_that_of_two_series_in_more_digits() -> None:
    for number in range(6):
        scene, time = (draw if number % 2 else draw_ready)(Random(f"truth {number}"))
        times = [0.05 * time, 0.1 * time]
        truth, wanted = truth_of(scene, times), reference(scene, times)
        assert truth.omega == pytest.approx(wanted.omega, rel=0.0, abs=2e-16 * truth.scale)
        assert truth.error(wanted.omega, wanted.attitude, False) < 1e-15


def test_a_wrong_result_is_reported(monkeypatch: Patch, capsys: Capture) -> None:
    right = entries._row

    def wrong(entry: str, omega: Array, *others: Any) -> Result:
        return right(entry, omega * (1.0 + 2e-4), *others)

    monkeypatch.setattr(entries, "_row", wrong)
    assert main(["1", "test", "3"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(
        "python -m tests.campaigns.state_campaign 1 test 3: prepare taylor: "
    )
    assert any("tolerance 0.0001" in line for line in lines)
    assert not any("tolerance 0.001," in line for line in lines)


def test_the_reference_ends_before_a_singularity() -> None:
    # Omega is 1/(1 - t).
    scene = Scene("singular", (1.0, 0.0, 0.0), moments=(1, 1, 1), torque=lambda t, omega: omega**2)
    assert truth_of(scene, [0.5, 2.0]).omega[:, 0].tolist() == [2.0]
    assert len(truth_of(scene, [3.0]).omega) == 0


def test_missing_rows_are_reported() -> None:
    scene, time = draw_ready(Random("rows"))
    truth = truth_of(scene, [0.1 * time])
    result = Result("solve", truth.omega[:0], None, "overflow", None, 1.0, False)
    tally = Tally("again {seed} {number}", "seed", 7)
    judge(tally, truth, result, 1e-6, scene)
    (fault,) = tally.faults
    assert fault.startswith("again seed 7: solve: 0 rows instead of 1, tolerance 1e-06,")
    assert fault.endswith("ended overflow")


@pytest.mark.campaign
@pytest.mark.parametrize(("seed", "number"), [
    # An exponential of omega is invisible at the beginning of a step, and large within it.
    ("20261123", 4847),
    ("20261123", 9583),
    # A power of a sine, whose error was a hundred times the estimate.
    ("20261124", 3787),
    # SciPy's Radau and RK45, whose errors are irregular where a table changes.
    ("20261124", 2250),
    ("20261125", 100),
])  # fmt: skip
def test_scenes_that_were_solved_wrongly(seed: str, number: int) -> None:
    tally = driver.campaign(MODULE, try_scene, 1, seed, number)
    assert tally.faults == []
    assert tally.counts[BLIND] == 0

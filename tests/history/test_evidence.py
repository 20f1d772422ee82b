"""Evidence: every combination is scored by the stated rule, and by nothing else."""

import json
from dataclasses import replace
from typing import Any

import pytest

from pyharness.history.claims import evidence as scored
from pyharness.history.claims.evidence import Combination, evidence
from pyharness.history.claims.laboratory import Assumptions, Laboratory
from pyharness.history.claims.ledger import claim, outcome
from pyharness.history.claims.verdicts import FALSE, IN_PART, NOT_REPRODUCED, REPRODUCED
from pyharness.model.scene import Triple
from tests.conftest import Printed

pytestmark = pytest.mark.claims


@pytest.fixture(scope="module", autouse=True)
def _judged() -> None:
    # Before the first test, whichever that is in this process: the cache then has all verdicts.
    list(evidence())


def _combination(*verdicts: str, steps: int = 100) -> Combination:
    return Combination(
        Assumptions((0.0, 1.0, 1.0), frozenset(), steps, frozenset()),
        {f"claim-{k}": each for k, each in enumerate(verdicts)},
    )


def test_what_discriminates_and_what_remains() -> None:
    best, equal, worse = (
        _combination(REPRODUCED, IN_PART),
        _combination(IN_PART, REPRODUCED, steps=300),
        _combination(IN_PART, FALSE),
    )
    assert scored.discriminating([best, equal, worse]) == ["claim-0", "claim-1"]
    assert scored.discriminating([best, best]) == []
    assert scored.undecided([worse, best, equal])["steps"] == ["100", "300"]
    assert scored.undecided([worse, best])["steps"] == ["100"]
    assert scored.undecided([_combination(FALSE, steps=300), best])["steps"] == ["100"]
    found = _combination(REPRODUCED, IN_PART, IN_PART, FALSE, NOT_REPRODUCED)
    assert (found.score, found.holding) == (2.0, 3)


@pytest.mark.parametrize("identity", ["v2-case-3-concur", "v2-case-7-concur", "v2-case-2-stopped"])
def test_verdict_of_a_combination_is_that_of_its_laboratory(identity: str) -> None:
    every = {each.assumptions: each.verdicts[identity] for each in evidence()}
    assert len(every) == len(scored.combinations())
    assert len(every) == 4 * 4 * 4 * 2, "a new reading or conjecture changes this number"
    for assumptions in list(every)[::17]:
        whole = outcome(claim(identity), Laboratory(True, assumptions)).verdict
        assert every[assumptions] == whole, assumptions


@pytest.mark.parametrize(("identity", "start", "readings", "verdict"), [
    ("v2-case-4-fails", (0.0, 1.0, 1.0), [], REPRODUCED),
    ("v2-case-3-diverging", (1.0, 1.0, 1.0), [], REPRODUCED),
    ("iv3-guard", (1.0, 1.0, 1.0), ["do-variable"], IN_PART),
])  # fmt: skip
def test_300_steps_change_verdicts_of_runs_that_stop_later(
    identity: str, start: Triple, readings: list[str], verdict: str
) -> None:
    few = Assumptions(start, frozenset(readings))
    many = replace(few, steps=300)
    case = claim(identity)["parameters"].get("case", 3)
    assert Laboratory(True, few).run("runge-kutta", case).ended == "complete"
    assert Laboratory(True, many).run("runge-kutta", case).ended == "stopped"
    entry = claim(identity)
    assert scored._verdict(identity, scored._relevant(entry, many)) == verdict
    assert scored._verdict(identity, scored._relevant(entry, few)) != verdict


def test_evidence_is_told(printed: Printed) -> None:
    missing = next(evidence()).choices().keys() - scored._SHORT.keys()
    assert not missing, f"add {sorted(missing)} to _SHORT of history/claims/evidence.py"
    assert max(map(len, printed("claims --evidence").splitlines())) <= 100
    record: dict[str, Any] = json.loads(printed("claims --evidence --format json"))
    scores = [each["score"] for each in record["combinations"]]
    assert scores == sorted(scores, reverse=True)
    assert set(record["discriminating"]) <= set(record["combinations"][0]["verdicts"])
    assert "Every combination" in record["rule"]


def test_what_the_report_says_of_each_choice() -> None:
    """Compare docs/article/article.md: each choice changes the score, with all others kept."""
    assert max(_effects("steps")) < 0.0
    held = _effects("conjecture torque-held")
    assert min(held) < max(held) == 0.0
    assert max(_effects("reading do-variable")) < 0.0
    c1 = _effects("reading c1-for-c")
    assert (min(c1), max(c1)) == (0.0, 0.5)


def _effects(axis: str) -> list[float]:
    scores: dict[tuple[tuple[str, str], ...], list[float]] = {}
    for each in evidence():
        choices = each.choices()
        del choices[axis]
        scores.setdefault(tuple(choices.items()), []).append(each.score)
    return [second - first for first, second in scores.values()]

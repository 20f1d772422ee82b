"""Claims over many starts have, start by start, the verdicts of the ledger."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Listing, case_scene, subset
from pyharness.checks.compare.batch import Batch, Solver
from pyharness.history.claims import over_starts
from pyharness.history.claims.laboratory import Assumptions, Laboratory, starts
from pyharness.history.claims.ledger import claim, outcome
from pyharness.history.claims.over_starts import FAILS, HOLDS, IN_PART, JUDGED, SILENT
from pyharness.history.claims.verdicts import IN_PART as PARTLY
from pyharness.history.claims.verdicts import REPRODUCED
from pyharness.model.scene import Triple
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.sweep_file import read_sweep

pytestmark = pytest.mark.claims
CODES = {REPRODUCED: HOLDS, PARTLY: IN_PART}


def _random(n: int) -> list[Triple]:
    source = np.random.default_rng(1982)
    omega = source.normal(size=(n, 3)) * 10.0 ** source.uniform(-1.0, 1.5, (n, 1))
    return [(float(a), float(b), float(c)) for a, b, c in omega]


STARTS = [*starts(), *_random(20)]
# On these starts each claim has every verdict that it has on the first 18 (V.3: the first 10).
FEW = [STARTS[k] for k in (0, 1, 2, 3, 8, 10, 11)]
FEWER = [STARTS[k] for k in (0, 5, 9)]


def _solved(omega0: list[Triple], listing: Listing | None, steps: int = 100, **more: Any) -> Batch:
    """Return a batch as a sweep passes it to a claim."""
    scene, ones = replace(case_scene(4), steps=steps), np.full(len(omega0), 1.0)
    return replace(Batch(scene, Solver(), listing, ones, {"omega": np.array(omega0)}), **more)


def _codes(identity: str, laboratory: Laboratory, omega0: list[Triple]) -> list[int]:
    chosen = laboratory.assumptions
    labs = (replace(laboratory, assumptions=replace(chosen, start=start)) for start in omega0)
    return [CODES.get(outcome(claim(identity), lab).verdict, FAILS) for lab in labs]


def test_claims_of_section_v_that_hang_on_starts_are_there() -> None:
    assert len(JUDGED) == 12
    for identity in JUDGED:
        assert {"omega0", "steps"} <= set(claim(identity)["assumptions"])
        assert claim(identity)["where"].startswith("V.")


@pytest.mark.sampled
@pytest.mark.parametrize("identity", JUDGED)
def test_verdicts_are_those_of_the_ledger(identity: str) -> None:
    few = FEWER if identity.startswith("v3") else FEW
    found = over_starts.FUNCTIONS[identity](_solved(few, Listing.original("two-term")))
    assert found.dtype == np.int8
    assert found.tolist() == _codes(identity, Laboratory(True), few)


@pytest.mark.sampled
@pytest.mark.parametrize("identity", [each for each in JUDGED if each.startswith("v2")])
def test_verdicts_are_those_of_the_ledger_elsewhere(identity: str) -> None:
    few = [FEW[0], *FEW[3:5]]
    for program, reading in (("runge-kutta", "do-variable"), ("two-term", "c1-for-c")):
        listing = subset(program, "original", readings=[reading])
        found = over_starts.codes(identity, _solved(few, listing))
        chosen = Assumptions(readings=frozenset([reading]))
        assert found.tolist() == _codes(identity, Laboratory(True, chosen), few)
    found = over_starts.codes(identity, _solved(few, Listing.corrected("four-term")))
    assert found.tolist() == _codes(identity, Laboratory(False), few)
    found = over_starts.codes(identity, _solved(few, Listing.original("four-term"), 200))
    assert found.tolist() == _codes(identity, Laboratory(True, Assumptions(steps=200)), few)


def test_silent_of_what_the_thesis_does_not_speak_of() -> None:
    listing = Listing.original("runge-kutta")
    starts = np.array(STARTS)
    others = [
        _solved(STARTS, listing, arrays={"omega": starts, "moments": np.ones((len(STARTS), 3))}),
        _solved(STARTS, listing, scene=replace(case_scene(4), step_size=0.02)),
        _solved(STARTS, listing, solver=Solver(lipschitz=600.0)),
        _solved(STARTS, subset("runge-kutta", fix=["stage-base"])),
        _solved(STARTS, None),
    ]
    for other in others:
        assert (over_starts.codes("v2-case-4-fails", other) == SILENT).all()


@pytest.mark.parametrize("axis", ["lipschitz = [1e9]", "step_size = [0.01, 0.05]"])
def test_silent_of_a_sweep_with_axes_of_which_the_thesis_does_not_speak(
    axis: str, tmp_path: Path
) -> None:
    field, _, values = axis.partition(" = ")
    path = tmp_path / "sweep.toml"
    path.write_text(
        'reductions = [{ name = "claim", id = "v2-case-4-fails" }]\n'
        '[scene]\ncase = 4\n[solve]\nprogram = "runge-kutta"\n'
        f'[[axis]]\nfield = "{field}"\nvalues = {values}\n'
        '[[axis]]\nfield = "omega.1"\nvalues = [0.0, 1.0]\n'
    )
    (found,) = solve_chunk(read_sweep(path, over_starts.FUNCTIONS), 0).values()
    assert (found == SILENT).all()


def test_solutions_are_those_of_the_reference() -> None:
    one = Laboratory(True)
    for case, start in ((1, 1), (7, 7), (5, 1)):
        bench = over_starts.Starts(one, np.array([one.scene(start).omega]))
        # Case 5 has its own start, whatever the others have.
        found = bench.solution(case) if case == 5 else bench.solution(case)[0]
        assert found.shape == (100, 3)
        assert np.abs(found - one.solution(case)).max() < 1e-11
    # Runs end by the stop test unless told otherwise.
    bench = over_starts.Starts(Laboratory(True), np.array(STARTS[:2]))
    stopped = bench.error("runge-kutta", 2)
    assert np.array_equal(stopped, bench.error("runge-kutta", 2, True))
    assert not np.array_equal(stopped, bench.error("runge-kutta", 2, False))

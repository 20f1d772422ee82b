"""Work limits count the work, and each message names the option that raises the limit."""

import copy
import pickle
import re
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pyharness import Listing, Scene, Trajectory, prepare, run_program, solve
from pyharness.cli.main import main
from pyharness.engine.plan.registry import FIXED_STEP, PREPARED
from pyharness.model.effort import ProofWork, suggested
from pyharness.model.errors import InputError, TimedError
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.truth.reference import reference
from tests.refused import refused

WAVES: tuple[Wave, ...] = (((1.0, 0.0, 2.0), 5.0), ((0.0, 2.0, 2.0), 3.0))
FREE = Scene("free", (0.3, 1.1, 2.7), moments=(40.0, 30.0, 20.0), steps=100)
# Its motion speeds up, so that the mean pace of the beginning predicts too little work.
PUSHED = replace(FREE, torque=TorqueLaw(constant=(1.0, 2.0, 3.0)))
DRIVEN = replace(FREE, torque=TorqueLaw(sines=WAVES))
SPHERE = replace(DRIVEN, moments=(40.0, 40.0, 40.0))
MANY = [0.001 * n for n in range(1, 1001)]

Run = Callable[[float], Trajectory]


def _method(
    scene: Scene, name: str, times: float | list[float], tolerance: float = 1e-9
) -> tuple[Run, str]:
    return lambda effort: solve(scene, times, name, tolerance, effort=effort), name


def _program(scene: Scene, name: str, implementation: str) -> tuple[Run, str]:
    def run(effort: float) -> Trajectory:
        return run_program(scene, Listing.corrected(name), implementation, effort=effort)

    return run, f"{name} \\({implementation}\\)"


# Runs that exceed a work limit, and an effort for which they do.
LIMITED: dict[str, tuple[tuple[Run, str], float]] = {
    "taylor": (_method(PUSHED, "taylor", 400.0), 1e-4),
    "taylor-waves": (_method(DRIVEN, "taylor", 400.0), 1.5e-4),
    "taylor-hopeless": (_method(DRIVEN, "taylor", 400.0), 2e-6),
    "auto": ((_method(DRIVEN, "auto", 400.0)[0], "taylor"), 1.5e-4),
    "rk4": (_method(FREE, "rk4", 400.0, 1.0), 5e-5),
    "taylor-3": (_method(DRIVEN, "taylor-3", 400.0, 1.0), 1e-4),
    "gauss-1": (_method(PUSHED, "gauss-1", 2.0, 1e-8), 1e-4),
    "gauss-4": (_method(DRIVEN, "gauss-4", 20.0), 5e-5),
    "closed-form": (_method(SPHERE, "closed-form", MANY), 1e-6),
    "dop853": (_method(FREE, "dop853", 20.0), 1e-3),
    "lsoda": (_method(DRIVEN, "lsoda", 20.0), 1e-3),
    "radau": (_method(DRIVEN, "radau", 2.0, 1e-6), 5e-4),
    "reference": (_method(PUSHED, "reference", 20.0), 2e-3),
    "reference-waves": (_method(DRIVEN, "reference", 20.0), 2e-3),
    "runge-kutta": (_program(FREE, "runge-kutta", "fortran"), 1e-7),
    "four-term-waves": (_program(DRIVEN, "four-term", "fortran"), 2e-6),
    "two-term-python": (_program(DRIVEN, "two-term", "python"), 1e-4),
}


def _refusal(run: Run, effort: float) -> str:
    with pytest.raises(InputError) as caught:
        run(effort)
    return str(caught.value)


def _advised(message: str) -> float:
    found = re.search(r"or allow more work: --effort (\S+) \(effort=(\S+) in Python\)$", message)
    assert found, message
    assert found[1] == found[2]
    return float(found[1])


@pytest.mark.sampled
@pytest.mark.parametrize("name", LIMITED)
def test_limit_is_lifted_as_far_as_it_says(name: str) -> None:
    """The advised effort suffices; without its slack of two it is at most three times too large."""
    (run, who), effort = LIMITED[name]
    message = _refusal(run, effort)
    assert re.match(f"(?i){who}[: ]", message)
    advised = _advised(message)
    assert run(advised).ended == "complete"
    assert _advised(_refusal(run, advised / 8.0)) == pytest.approx(advised, rel=1.0)


@pytest.mark.parametrize("name", ["radau", "four-term-waves"])
def test_refusal_names_what_exceeds_its_limit(name: str) -> None:
    (run, who), effort = LIMITED[name]
    message = _refusal(run, effort)
    assert re.match(f"(?i){who}[: ]", message)
    assert "None" not in message


@pytest.mark.parametrize(("count", "span"), [(0, 1000.0), (50, 50.0)])
def test_waves_count(count: int, span: float) -> None:
    """Sines of negligible size make each step more expensive, so that fewer steps are allowed."""
    # Sines of one frequency would be merged.
    waves = [((0.0, 0.0, 1e-30), 1.0 + 0.001 * n) for n in range(count)]
    scene = replace(FREE, torque=TorqueLaw(sines=waves))
    steps = {"taylor": 1e7 / (1.0 + 0.5 * count), "dop853": 5e5 * 8.0 / (8.0 + count)}
    for name, allowed in steps.items():
        found = re.search(r"after (\d+) ", _refusal(_method(scene, name, span)[0], 1e-4))
        assert found
        assert int(found[1]) == pytest.approx(1e-4 * allowed, abs=1.0)


@pytest.mark.parametrize("name", [name for name in PREPARED if name not in ("closed-form", "auto")])
def test_prepared_solver_has_the_limit_too(name: str) -> None:
    omega = np.array(DRIVEN.omega)
    short = prepare(DRIVEN, name, 1e-6, effort=1e-8)
    for solver in (short, copy.copy(short)):
        assert np.isnan(solver(omega, 20.0)).all()
        assert solver.status == "gave up"
    if name not in FIXED_STEP:
        refused("", short.trajectory, omega, [20.0])
    enough = prepare(DRIVEN, name, 1e-6)
    enough(omega, 20.0)
    assert enough.status == "complete"


def test_compare_refuses_at_once_what_takes_long(capsys: pytest.CaptureFixture[str]) -> None:
    """The pace of the reference's first steps shows it; the refusal once took a minute."""
    begin = time.process_time()
    command = "compare --case 5 --omega 0.3,1.1,2.7 --step-size 1 --steps 100000"
    assert main(command.split()) == 2
    assert time.process_time() - begin < 2.0
    said = capsys.readouterr().err
    assert "reference: more than " in said
    assert _advised(said.strip()) > 1.0


@pytest.mark.campaign
def test_forecast_of_the_reference_is_not_taken_in_by_a_blow_up() -> None:
    """Shrinking steps end soon, because the solution grows without bound."""
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = reference(scene, [0.5, 1000.0], effort=0.1)
    np.testing.assert_allclose(found.omega, [[2.0] * 3], rtol=1e-15)


@pytest.mark.parametrize(
    ("needed", "effort", "text"),
    [(3.0, 1.0, "6"), (1.06e-4, 1e-4, "0.00022"), (151.0, 1.0, "310"), (None, 0.5, "5")],
)
def test_advice_is_rounded_up(needed: float | None, effort: float, text: str) -> None:
    assert suggested(effort, needed) == text


def test_advice_where_an_attempt_has_not_advanced() -> None:
    """Regression test: the work of earlier attempts alone gave an effort that was too small."""
    work = ProofWork(10.0, 0.5)
    for done, share, effort in ((6.0, 0.5, "2.4"), (6.0, 0.0, "5"), (12.0, 0.5, "3.6")):
        work.done = done
        refused(rf"--effort {effort} ", work.check, share)
        if done == 6.0:
            work.begin()


def test_huge_advice_is_a_number() -> None:
    assert float(suggested(1.0, 1e305)) == 1e300


def test_refusal_comes_back_from_another_process() -> None:
    """An error that can't be unpickled leaves a pool waiting for ever."""
    known = TimedError("exceeded its work limit at t = {time} s", 2.5)
    back = pickle.loads(pickle.dumps(known))
    assert (str(back), back.time) == ("exceeded its work limit at t = 2.5 s", 2.5)
    assert str(back.slower(2.0)) == "exceeded its work limit at t = 5 s"

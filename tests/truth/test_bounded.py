"""The stated error of the reference, proved or estimated, and the warning of a wrong estimate."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from pyharness import Comparison, Scene, case_scene, solve
from pyharness.bench import measure as bench
from pyharness.checks import judge
from pyharness.checks.compare import comparison
from pyharness.engine.plan import registry
from pyharness.engine.plan.report import trajectory_bound
from pyharness.model.attitude import angle_between
from pyharness.truth import bounded, enclosure
from pyharness.truth import reference as reference_module
from pyharness.truth.bounded import ESTIMATED, PROVED, ErrorBound, at_most, bound_of, error_bound
from pyharness.truth.enclosed import Balls
from pyharness.truth.enclosure import enclose
from pyharness.truth.reference import Reference, reference
from tests.conftest import Printed
from tests.json_reference import schema_of

TURNED = (0.5, 0.5, -0.5, 0.5)
DAMPED = Scene("", (1, 2, 3), moments=(4, 3, 2), torque=lambda t, w: -0.1 * w, steps=5)
Hide = Callable[[], None]


@pytest.fixture
def hide(monkeypatch: pytest.MonkeyPatch) -> Hide:
    """Return a function that hides python-flint."""
    return lambda: monkeypatch.setattr(enclosure, "find_spec", lambda name: None)


@pytest.mark.sampled
@pytest.mark.parametrize("case", range(1, 8))
def test_proved_error_of_omega_needs_no_library(case: int, hide: Hide) -> None:
    scene = case_scene(case)
    known = reference(scene, scene.times(), velocity=True)
    found = bound_of(scene, known)
    assert (found.basis, found.angle, found.warning) == (PROVED, None, "")
    assert 0.0 < found.value <= known.error
    hide()
    assert bound_of(scene, known) == found


def test_bound_is_the_distance_to_the_farthest_point() -> None:
    scene = case_scene(5)
    known = reference(scene, scene.times())
    exact = enclose(scene, scene.times(), 40).omega
    apart = max(
        abs(Fraction(x) - y)
        for row, balls in zip(known.omega.tolist(), exact, strict=True)
        for x, y in zip(row, balls.middle, strict=True)
    )
    assert apart <= Fraction(bound_of(scene, known).value) <= apart * Fraction(51, 50)


def test_attitude_without_torque_is_proved_with_the_library(hide: Hide) -> None:
    pytest.importorskip("flint")
    scene = replace(case_scene(4), attitude=TURNED)
    known = reference(scene, scene.times()[9::10])
    found: Any = bound_of(scene, known)
    assert (found.basis, found.angle_basis) == (PROVED, PROVED)
    assert 0.0 < found.angle <= known.angle_error
    hide()
    assert bound_of(scene, known) == found._replace(angle=known.angle_error, angle_basis=ESTIMATED)


def test_any_torque_is_proved_if_it_is_requested(hide: Hide) -> None:
    pytest.importorskip("flint")
    known = reference(DAMPED, [0.05, 0.1])
    estimate = ErrorBound(known.error, ESTIMATED)
    assert bound_of(DAMPED, known) == estimate
    found = bound_of(DAMPED, known, any_torque=True)
    assert found.basis == PROVED
    assert found.value <= known.error
    hide()
    assert bound_of(DAMPED, known, any_torque=True) == estimate


@pytest.mark.parametrize("times", [[k / 4000 for k in range(1, 40)], [30.0]])
def test_a_proof_that_costs_too_much_is_not_made(times: Sequence[float]) -> None:
    pytest.importorskip("flint")
    assert bound_of(DAMPED, reference(DAMPED, times), any_torque=True).basis == ESTIMATED
    long = case_scene(5)
    assert bound_of(long, reference(long, [1.0]), effort=1e-3).basis == ESTIMATED


def _wrong(known: Reference, change: float) -> Reference:
    omega = known.omega.copy()
    omega[-1, 1] += change
    return replace(known, omega=omega)


def _wrong_by(change: float) -> Callable[..., Reference]:
    return lambda *given, **more: _wrong(reference(*given, **more), change)


def test_a_wrong_value_has_a_large_bound_and_a_warning() -> None:
    scene = case_scene(3)
    found = bound_of(scene, _wrong(reference(scene, [0.5, 1.0]), 1e-9))
    assert found.basis == PROVED
    assert found.value == pytest.approx(1e-9, rel=1e-5)
    assert found.warning.startswith("the estimate of the reference (1.2e-15 rad/s) is below its ")
    assert found.warning.endswith("proved error (1.1e-9 rad/s)")
    # The remainder has digits beyond binary64, in which errors are seen too.
    precise: Any = reference(scene, [1.0], precise=True)
    assert bound_of(scene, precise, before_rounding=True).warning == ""
    more = replace(precise, remainder=precise.remainder + 1e-24)
    assert "is below" in bound_of(scene, more, before_rounding=True).warning
    assert bound_of(scene, more).warning == ""


def test_a_wrong_attitude_has_a_warning() -> None:
    pytest.importorskip("flint")
    scene = replace(case_scene(4), attitude=TURNED)
    known: Any = reference(scene, [1.0])
    turned = known.attitude + np.array([[0.0, 1e-9, 0.0, 0.0]])
    found: Any = bound_of(scene, replace(known, attitude=turned))
    assert found.angle_basis == PROVED
    assert float(angle_between(turned, known.attitude)[0]) <= found.angle < 4e-9
    assert "rad) is below its proved error" in found.warning


def test_bounds_of_angles() -> None:
    middle = tuple(map(Fraction, (1, 0, 0, 0)))
    half = 1e-3
    row = [Fraction(math.cos(half)), Fraction(math.sin(half)), Fraction(0), Fraction(0)]
    for side in (row, [-x for x in row]):
        least, most = bounded._extreme_angles([side], [Balls(middle, Fraction(0))])
        assert 2 * half * 0.99999 < least <= 2 * half <= most < 2 * half * 1.00001
    least, most = bounded._extreme_angles([row], [Balls(middle, Fraction(1))])
    assert (least, most) == (0.0, math.pi)


def test_times_on_both_sides_have_one_bound() -> None:
    scene = case_scene(5)
    times = np.array([-1.0, -0.5, 0.0, 2.0])
    rows: Any = solve(scene, times, "reference")
    claimed = rows.error * float(np.abs(rows.omega).max())
    found = error_bound(scene, rows.time, rows.omega, claimed)
    sides = [error_bound(scene, times[k], rows.omega[k], claimed) for k in ([1, 0], [2, 3])]
    assert found.basis == PROVED
    assert found.value == max(each.value for each in sides)
    assert trajectory_bound(scene, rows) == found


def test_a_bound_for_some_sides_only_is_an_estimate() -> None:
    both = [ErrorBound(1.0, PROVED, 3.0, PROVED), ErrorBound(2.0, ESTIMATED, 1.0, PROVED, "wrong")]
    assert bounded.joined(both) == ErrorBound(2.0, ESTIMATED, 3.0, PROVED, "wrong")
    assert both[0].larger == ErrorBound(3.0, PROVED)
    assert both[0].over(2.0).value == 0.5
    assert both[0].over(0.0).value == 1.0


@pytest.mark.parametrize(
    ("x", "text"), [(8.81e-16, "8.9e-16"), (1.0, "1.0e0"), (9.91, "1.0e1"), (0.0, "0")]
)
def test_numbers_are_rounded_up(x: float, text: str) -> None:
    assert at_most(x) == text
    assert at_most(math.inf) == "inf"


def test_full_inertia_has_no_estimate(hide: Hide) -> None:
    """The rounding errors of the transformation to principal axes are not estimated."""
    pytest.importorskip("flint")
    scene = Scene("full", (1, 2, 3), inertia=[[3, 0.1, 0], [0.1, 4, 0], [0, 0, 5]])
    rows = solve(scene, [0.5], "reference")
    assert rows.error is None
    found: Any = trajectory_bound(scene, rows)
    assert found.basis == PROVED
    assert found.value < 1e-14
    hide()
    assert trajectory_bound(scene, rows) is None


def _without_bounds(record: Any) -> Any:
    """Return a record without stated errors, and without times, which vary."""
    left_out = ("reference_bound", "seconds", "seconds_per_step", "build", "compile_seconds")
    if isinstance(record, dict):
        return {k: _without_bounds(x) for k, x in record.items() if k not in left_out}
    return [_without_bounds(x) for x in record] if isinstance(record, list) else record


COMMANDS = {
    "compare --case 3 --attitude --program two-term": (PROVED, ESTIMATED),
    "compare --case 5 --program two-term": (PROVED, None),
    "compare --scene docs/damped.toml --method auto": (ESTIMATED, ESTIMATED),
    "run --case 5 --method reference --times=-1,1": (PROVED, None),
    "run --scene docs/damped.toml --method reference --times 0.1 --attitude quaternion": (
        ESTIMATED,
        ESTIMATED,
    ),
    "verify --only methods/taylor/case-5": (PROVED, None),
}


@pytest.mark.campaign
@pytest.mark.parametrize("command", COMMANDS)
def test_numbers_do_not_depend_on_the_library(command: str, printed: Printed, hide: Hide) -> None:
    before = json.loads(printed(f"{command} --format json"))
    hide()
    after = json.loads(printed(f"{command} --format json"))
    assert _without_bounds(before) == _without_bounds(after)
    holder = after["checks"][0] if "checks" in after else after
    stated = holder["reference_bound"]
    assert (stated["basis"], stated.get("angle_basis")) == COMMANDS[command]
    for record in (before, after):
        Draft202012Validator(schema_of(command.split()[0])).validate(record)


@pytest.mark.campaign
def test_verbs_print_the_bound_and_its_basis(printed: Printed, hide: Hide) -> None:
    hide()
    assert "error of any w at most 8.9e-16 rad/s (proved)" in printed("compare --case 3")
    text = printed("run --case 5 --method reference --times 1")
    assert "reference: error of any omega at most " in text
    assert "rad/s (proved)" in text
    text = printed("verify --only methods/taylor/case-5,attitudes/taylor/case-5")
    for words in ("relative or in rad, at most", "(proved) in ", "(estimated) in "):
        assert words in text
    assert "rad/s (estimated)" in printed("compare --scene docs/damped.toml --method auto")


MODULES = {
    "compare --case 3 --program two-term": comparison,
    "compare --case 3 --method auto": comparison,
    "run --case 3 --method reference": reference_module,
    "verify --only methods/taylor/case-3/1.0e-03": judge,
}


@pytest.mark.campaign
@pytest.mark.parametrize("command", MODULES)
def test_verbs_warn_of_a_wrong_reference(
    command: str, printed: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "WARNING" not in printed(command)
    monkeypatch.setattr(MODULES[command], "reference", _wrong_by(1e-7))
    if command.startswith("compare") and "--method" in command:
        monkeypatch.setattr(Comparison, "unexpected", ())
    text = printed(command)
    for words in ("WARNING: the estimate of the reference (", "is below its", "proved"):
        assert words in text


def test_benchmark_states_the_relative_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    load = bench.workloads(3, 1.0)[0]
    bound = bench.measure([load], []).bounds[load.label]
    assert bound.basis == PROVED
    assert bound.value < 1e-31
    assert bound.warning == ""
    monkeypatch.setattr(bench, "reference", _wrong_by(1e-12))
    wrong = bench.measure([load], []).bounds[load.label]
    assert wrong.value == pytest.approx(1e-12 / np.abs(reference(load.scene, [1.0]).omega).max())
    assert "is below" in wrong.warning


def test_method_reference_reports_its_estimate() -> None:
    assert registry.METHODS["reference"].attitude
    found = solve(case_scene(4), [1.0], "reference", attitude=True)
    known = reference(replace(case_scene(4), attitude=(1, 0, 0, 0)), [1.0])
    assert found.error == max(known.error / 10.0, known.angle_error)
    still = Scene("still", (0, 0, 0), moments=(3, 2, 1))
    rows = solve(still, [1.0], "reference", attitude=True)
    assert rows.error is None
    bound: Any = trajectory_bound(still, rows)
    assert bound.basis == PROVED
    assert bound.value < 1e-19

"""`bench --attitude` judges methods by omega and attitude; run times are not tested."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, case_scene
from pyharness.bench import peers
from pyharness.bench.contenders import SceneContender, list_own_contenders
from pyharness.bench.measure import Finding, error_of, workloads
from pyharness.bench.random_loads import random_load
from pyharness.bench.scores import groups
from pyharness.checks.compare.candidates import End
from pyharness.cli.main import main
from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.truth.reference import Reference, reference

Capture = pytest.CaptureFixture[str]
TURNED = (0.5, -0.1, 0.7, 0.5)
SCENE = replace(case_scene(5), attitude=TURNED)
FREE = replace(case_scene(4), attitude=TURNED)
ABLE = [each for each in (*list_own_contenders(), *peers.peers()) if each.attitude]


@pytest.fixture(scope="module")
def truths() -> dict[str, Reference]:
    return {scene.name: reference(scene, [2.0], precise=True) for scene in (SCENE, FREE)}


def _error(contender: SceneContender, scene: Scene, truth: Reference) -> Any:
    ready = contender.prepare(scene)(2.0, 1e-12)
    ready.run()
    # The second call must start from the initial condition again.
    return error_of(ready.read(ready.run()), truth)


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.parametrize("contender", ABLE, ids=lambda each: each.name)
@pytest.mark.filterwarnings("ignore")
def test_everyone_reaches_both(contender: SceneContender, truths: dict[str, Reference]) -> None:
    if not contender.is_installed:
        pytest.skip(f"{contender.package} is not installed")
    for scene in (FREE,) if contender.setting == "none" else (SCENE, FREE):
        assert _error(contender, scene, truths[scene.name]) < 1e-9


def _backward(right: Callable[..., Any]) -> Callable[..., Any]:
    """Return right-hand sides with a wrong sign in one component of the attitude."""

    def rates(*given: Any) -> Any:
        found = list(right(*given))
        found[-3] = -found[-3]
        return found

    return rates


@pytest.fixture
def _wrong_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = peers._problem
    monkeypatch.setattr(f"{peers.__name__}.quaternion_rates", _backward(quaternion_rates))

    def backward(scene: Scene) -> Any:
        slope, *rest = problem(scene)
        return _backward(slope), *rest

    monkeypatch.setattr(peers, "_problem", backward)


@pytest.mark.external
@pytest.mark.usefixtures("_wrong_sign")
@pytest.mark.parametrize("name", ["heyoka", "odeint", "solve_ivp-dop853"])
@pytest.mark.filterwarnings("ignore")
def test_a_wrong_sign_is_seen(name: str, truths: dict[str, Reference]) -> None:
    peer = next(each for each in ABLE if each.name == name)
    if not peer.is_installed:
        pytest.skip(f"{peer.package} is not installed")
    # Only omega is right.
    assert _error(peer, FREE, truths[FREE.name]) > 0.1


@pytest.mark.parametrize("name", ["auto", "taylor", "solve_ivp-dop853"])
def test_an_attitude_from_another_start_is_seen(name: str, truths: dict[str, Reference]) -> None:
    contender = next(each for each in ABLE if each.name == name)
    error = _error(contender, replace(SCENE, attitude=IDENTITY), truths[SCENE.name])
    assert error == pytest.approx(2.0 * np.arccos(0.5), rel=1e-6)


def test_the_larger_error_counts(truths: dict[str, Reference]) -> None:
    truth: Any = truths[SCENE.name]
    omega, (w, x, y, z) = truth.omega[0], truth.attitude[0]
    right = truth.attitude[0]
    tilt = np.sin(1e-5)
    tilted = np.array([w - tilt * x, x + tilt * w, y + tilt * z, z - tilt * y])
    off = omega * (1.0 + 1e-3)
    for end, error in (
        (End(omega, attitude=tilted), 2e-5),
        (End(off, attitude=right), 1e-3),
        (End(off, attitude=tilted), 1e-3),
        # The attitude depends on the direction of a quaternion, not on its length or sign.
        (End(omega, attitude=-1.01 * tilted), 2e-5),
    ):
        assert error_of(end, truth) == pytest.approx(error, rel=1e-4)
    assert (error_of(End(omega, attitude=right), truth) or 0.0) < 1e-15
    for lost in (None, np.full(4, np.nan), np.zeros(4)):
        assert error_of(End(omega, attitude=lost), truth) is None
    assert error_of(End(omega), replace(truth, attitude=None)) is not None


def test_loads_are_all_cases_from_the_axes_of_space() -> None:
    loads = workloads(attitude=True)
    assert {load.scene.attitude for load in loads} == {IDENTITY}
    found = groups(Finding(loads, [], [], {}, {}))
    assert {name: [load.label for load in group] for name, group in found.items()} == {
        "torque, T = 3": ["1", "5", "6", "7"], "torque-free, T = 3": ["2", "3", "4"],
        "torque, T = 100": ["1L", "5L", "7L"], "torque-free, T = 100": ["2L", "3L", "4L"],
    }  # fmt: skip
    assert [load.horizon for load in workloads(6, attitude=True)] == [3.0]
    drawn, bare = random_load("f", 2, attitude=True), random_load("f", 2)
    assert (drawn.truth, drawn.scene) == (None, replace(bare.scene, attitude=IDENTITY))
    assert (drawn.kinds, drawn.horizon, drawn.turns) == (bare.kinds, bare.horizon, bare.turns)


@pytest.mark.usefixtures("hurried")
@pytest.mark.parametrize("scene", ["--case 4 --horizon 1", "--draws 1 --seed f"])
def test_verb_judges_both_and_says_who_carries_none(scene: str, capsys: Capture) -> None:
    command = ["bench", "--attitude", *scene.split(), "--peers", "none"]
    assert main([*command, "--format", "json"]) == 0
    record: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert record["attitude"] is True
    assert {row["method"] for row in record["rows"]} == {"auto", "taylor", "closed-form"}
    assert all(row["error"] <= max(row["setting"] or 0.0, 5e-15) for row in record["rows"])
    reasons = {each["method"]: each["reason"] for each in record["refused"]}
    assert reasons["rk4"] == reasons["two-term-original"] == "does not compute attitudes"
    assert main([*command, "--method", "auto,taylor", "--format", "markdown"]) == 0
    page = capsys.readouterr().out
    assert "# Run time against error of omega and attitude\n" in page
    assert "--attitude --format markdown`" in page
    assert "the angle between the attitudes (rad)" in page

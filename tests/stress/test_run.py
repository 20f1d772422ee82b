"""The trials: their bounds hold, planted faults are caught, and what failed can be run again."""

import itertools
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from pyharness.cli.main import main
from pyharness.compare.candidates import End
from pyharness.compare.checks import Check
from pyharness.methods.registry import FIXED_STEP, METHODS
from pyharness.methods.solve import solve
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.scene_file import read_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY
from pyharness.stress import hold as truth
from pyharness.stress.hold import in_steps
from pyharness.stress.run import Outcome, stress, worst
from pyharness.theory import promises

TRIALS = ("separatrix", "near-symmetry", "shapes", "scales")


@pytest.mark.parametrize("name", TRIALS)
def test_bounds_hold(name: str) -> None:
    """In one of five circumstances; all of them are what `stress` is run for."""
    room = import_module(f"pyharness.stress.trials.{name.replace('-', '_')}")
    some = [circumstance for circumstance, *_ in room.circumstances()][::5]
    subjects = {*promises.METHODS, *PROGRAM_REGISTRY}
    outcomes = list(stress([f"{name}/{who}/{where}" for who in subjects for where in some]))
    checks = [outcome.check for outcome in outcomes]
    assert [check.id for check in checks if not check.passed] == []
    assert len({check.id for check in checks}) == len(checks)
    for check in checks:
        assert check.replay == f"python -m pyharness stress --only {check.id}"
    # Every method is tried, and the programs are described, never judged.
    assert subjects == {check.id.split("/")[1] for check in checks}
    for check in checks:
        if check.id.split("/")[1] in PROGRAM_REGISTRY:
            assert check.limit is None
    bounded = {check.id.split("/")[1] for check in checks if check.limit is not None}
    assert bounded == set(promises.METHODS)
    # Some bound of every method is worth the name, where it does not refuse.
    for method in promises.METHODS:
        limits = [
            check.limit
            for check in checks
            if check.id.split("/")[1] == method and check.limit is not None
        ]
        assert min(limits) < 1e-3, method


def test_one_check_alone_is_the_same() -> None:
    only = ["separatrix/taylor/flip-1e-05", "separatrix/rk4/none"]
    some = [outcome.check for outcome in stress(only)]
    assert {check.id.split("/")[2] for check in some} == {"flip-1e-05", "none"}
    for check in some:
        assert [outcome.check for outcome in stress([check.id])] == [check]


def _failed(*only: str) -> list[str]:
    return [outcome.check.id for outcome in stress(only) if not outcome.check.passed]


def _shifted(share: float) -> Callable[..., Trajectory]:
    """Return a solver whose time is wrong by a part: it conserves all that there is."""

    def shifted(scene: Scene, times: Sequence[float], *rest: Any) -> Trajectory:
        return solve(scene, [t * (1.0 + share) for t in times], *rest)

    return shifted


@pytest.mark.parametrize(
    "only",
    [
        "separatrix/closed-form/flip-1e-15",
        "separatrix/closed-form/flips-1e-03",
        "near-symmetry/closed-form/small-pair-1e-16",
        "shapes/closed-form/plate-123",
        "scales/closed-form/1e-300",
    ],
)
def test_a_phase_error_of_1e9_is_caught(monkeypatch: pytest.MonkeyPatch, only: str) -> None:
    assert not _failed(only)
    monkeypatch.setattr("pyharness.compare.candidates.solve", _shifted(1e-9))
    assert _failed(only) == [f"{only}/1e-14/error"]


@pytest.mark.parametrize("name", ["taylor", "gauss-4", "gauss-8", "dop853", "lsoda"])
def test_a_shift_of_time_is_caught_though_it_conserves_all(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("pyharness.compare.candidates.solve", _shifted(1e-5))
    only = f"separatrix/{name}/flip-1e-01"
    fine = min(float(o.check.id.split("/")[3]) for o in stress([only]) if "steps" not in o.check.id)
    failed = _failed(only)
    assert f"{only}/{fine:.0e}/error" in failed
    # Energy and momentum see nothing.
    assert all(id.endswith("/error") for id in failed)


def _changed(change: Callable[[End], End]) -> Callable[..., End]:
    right = truth.run_method

    def run(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
        return change(right(name, scene, time, tolerance))

    return run


@pytest.mark.parametrize("name", ["taylor", "quick", "gauss-6", "rk4", "dop853"])
def test_energy_that_drifts_is_caught_where_no_digit_is_left(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Five flips at 1e-12: of omega nothing can be asked, of energy everything."""
    only = f"separatrix/{name}/flips-1e-12"
    assert not _failed(only)
    wrong = _changed(lambda run: replace(run, omega=run.omega * 1.01))
    monkeypatch.setattr(truth, "run_method", wrong)
    failed = _failed(only)
    assert failed
    assert all(id.endswith("/drift") for id in failed)


def test_a_method_of_lower_order_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    right = truth.run_method

    def run(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
        return right("improved-euler", scene, time, tolerance)

    monkeypatch.setattr(truth, "run_method", run)
    assert _failed("near-symmetry/rk4/small-pair-1e-03")


@pytest.mark.parametrize("number", [math.inf, math.nan])
def test_an_overflow_reported_as_complete_is_caught(
    monkeypatch: pytest.MonkeyPatch, number: float
) -> None:
    wrong = _changed(lambda run: End(np.full(3, number), "complete", run.steps))
    monkeypatch.setattr(truth, "run_method", wrong)
    for name in ("closed-form", "taylor", "rk45", "rk4"):
        assert f"scales/{name}/1e150/" in _failed(f"scales/{name}/1e150")[0]
    monkeypatch.setattr("pyharness.stress.trials.scales.run_method", wrong)
    assert _failed("scales/taylor/beyond") == ["scales/taylor/beyond"]
    assert _failed("scales/taylor/same-2^100") == ["scales/taylor/same-2^100"]


@pytest.mark.parametrize("name", ["taylor", "gauss-3", "dop853", "lsoda"])
def test_products_that_underflow_are_caught(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Without other units omega stays as it was, which no status tells."""
    assert not _failed(f"scales/{name}/1e-200")
    monkeypatch.setattr("pyharness.methods.solve.factor_near_one", lambda *_: 1.0)
    assert _failed(f"scales/{name}/1e-200")


def test_leaving_the_axis_undisturbed_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(run: End) -> End:
        return replace(run, omega=run.omega + np.array([0.0, 0.0, 1e-30]))

    assert not _failed("separatrix/rk4/none", "separatrix/quick/none")
    monkeypatch.setattr("pyharness.stress.trials.separatrix.run_method", _changed(off))
    assert len(_failed("separatrix/rk4/none", "separatrix/quick/none")) == 2


def test_a_refusal_is_described() -> None:
    (outcome,) = stress(["shapes/closed-form/case-6"])
    assert outcome.check.passed
    assert outcome.check.limit is None
    assert outcome.check.note.startswith("refused: closed-form")


def test_sums_of_fixed_steps_bound_the_order() -> None:
    """Against y' = y**2, whose derivatives are the largest: y(0) = 1, one step."""
    for name in FIXED_STEP:
        order = METHODS[name].order
        for z in (0.01, 0.1):
            exact = 1.0 / (1.0 - z)
            own = sum(c * z**k for k, c in enumerate(promises._series(name)))
            assert abs(exact - own) <= promises.fixed_step_sum(name, z, 1) + 1e-15
        ratio = promises.fixed_step_sum(name, 2e-3, 1) / promises.fixed_step_sum(name, 1e-3, 1)
        assert ratio == pytest.approx(2.0 ** (order + 1), rel=0.02)
    rk4 = promises._series("rk4")
    np.testing.assert_allclose(rk4[:5], 1.0, rtol=1e-15)
    assert promises.fixed_step_sum("rk4", 0.7, 3) == math.inf


def test_what_is_conserved_is_read_as_an_error_of_omega() -> None:
    scene = Scene("", (0.3, 1.0, -0.6), moments=(6.0, 5.0, 2.0))
    omega = np.array(scene.omega)
    assert truth.conserved(scene, omega, 1.0) == 0.0
    assert truth.conserved(scene, -omega, 1.0) == 0.0
    for error in (1e-3, 1e-9):
        signs = np.sign(omega)
        found = truth.conserved(scene, omega + error * signs, 1.0)
        assert 0.99 * error < found <= error + 1e-15
    assert truth.conserved(scene, np.array([math.nan, 0.0, 0.0]), 1.0) == math.inf


def test_steps_end_at_the_end() -> None:
    scene = in_steps(Scene("", (0.3, 1.0, -0.6), moments=(6.0, 5.0, 2.0)), 7.0)
    assert scene.times()[-1] == pytest.approx(7.0, rel=1e-15)
    assert truth._steps(scene, 7.0) == scene.steps


def _outcome(id: str, value: float, limit: float | None, passed: bool = True) -> Outcome:
    return Outcome(Check(id, passed, value, limit, "replay"), Scene("", (1.0,) * 3, (1.0,) * 3))


def test_the_worst_is_the_nearest_to_its_limit_or_failed() -> None:
    outcomes = [
        _outcome("a/b/1", 1e-3, 1.0),
        _outcome("a/b/2", 1e-9, 1e-9),
        _outcome("a/b/3", 9.0, None),
        _outcome("a/c/1", math.nan, 1.0, passed=False),
        _outcome("a/c/2", 2.0, 1.0, passed=False),
    ]
    found = {name: outcome.check.id for name, outcome in worst(outcomes).items()}
    assert found == {"a/b": "a/b/2", "a/c": "a/c/1"}


def _run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = main(["stress", *arguments])
    return code, capsys.readouterr().out


def test_table_is_narrow_and_json_tells_all(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    only = "separatrix/closed-form,separatrix/rk4,shapes/two-term"
    code, text = _run(capsys, "--only", only)
    assert code == 0
    assert max(map(len, text.splitlines())) <= 100
    assert "all well" in text
    for row in ("closed-form ", "rk4 ", "two-term "):
        assert sum(line.startswith(row) for line in text.splitlines()) == 1
    # Nothing is written where a part of a trial is asked for.
    assert list(tmp_path.iterdir()) == []
    code, text = _run(capsys, "--only", only, "--format", "json")
    record = json.loads(text)
    assert code == 0
    assert record["schema"] == 1
    assert record["passed"] is True
    for check in record["checks"]:
        assert {"id", "passed", "value", "limit", "replay"} <= set(check)


def test_a_failure_is_told_in_every_form(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pyharness.compare.candidates.solve", _shifted(1e-9))
    only = "separatrix/closed-form/flip-1e-02"
    code, text = _run(capsys, "--only", only)
    assert code == 1
    assert f"FAILED {only}/1e-14/error" in text
    assert f"  python -m pyharness stress --only {only}/1e-14/error" in text
    code, text = _run(capsys, "--only", only, "--format", "json")
    assert code == 1
    assert json.loads(text)["passed"] is False
    file = tmp_path / "stress.xml"
    code, _ = _run(capsys, "--only", only, "--format", "junit", "--out", str(file))
    assert code == 1
    suite = xml.parse(file).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")


def test_the_worst_input_is_saved_and_its_command_gives_the_same(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "worst"
    only = "separatrix/lsoda,separatrix/quick"
    assert _run(capsys, "--only", only, "--save", str(folder))[0] == 0
    assert {path.name for path in folder.iterdir()} == {
        "separatrix-lsoda.toml",
        "separatrix-quick.toml",
    }
    for path in folder.iterdir():
        told, command = (line.removeprefix("# ") for line in path.read_text().splitlines()[:2])
        words = command.split()
        assert words[:4] == ["python", "-m", "pyharness", "stress"]
        code, text = _run(capsys, *words[4:], "--format", "json")
        (check,) = json.loads(text)["checks"]
        assert code == 0
        assert told == f"worst of {'/'.join(check['id'].split('/')[:2])}: " + (
            f"{check['value']}, limit {check['limit']}"
        )
        (outcome,) = stress([check["id"]])
        assert outcome.scene is not None
        saved = read_scene(path)
        assert (saved.omega, saved.moments) == (outcome.scene.omega, outcome.scene.moments)
        assert (saved.step_size, saved.steps) == (outcome.scene.step_size, outcome.scene.steps)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--only", "separatrx"], "did you mean 'separatrix'"),
        (["--only", "separatrix/nothing"], "unknown check"),
        (["--format", "csv"], "unknown format"),
        (["--only", "separatrix,shapes", "--plot", "a.svg"], "--plot draws one trial"),
        (["--only", "separatrix", "--plot", "a.gif"], "unknown picture format"),
        (["--only", "separatrix", "--save", "/dev/null"], "is not a folder"),
    ],
)
def test_wrong_usage_is_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    assert main(["stress", *arguments]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_picture_shows_what_its_numbers_say(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "trial.svg"
    arguments = ["--only", "separatrix/closed-form,separatrix/rk4", "--plot", str(path)]
    assert _run(capsys, *arguments)[0] == 0
    first = path.read_bytes()
    assert xml.fromstring(first).tag.endswith("svg")
    rows = (tmp_path / "trial.csv").read_text().splitlines()
    wanted: list[Any] = [
        o.check for o in stress(["separatrix/closed-form", "separatrix/rk4"]) if o.scene
    ]
    assert rows[0] == "id,value,limit,note"
    assert len(rows) == 1 + sum(check.value is not None for check in wanted)
    assert _run(capsys, *arguments)[0] == 0
    assert path.read_bytes() == first


def test_method_that_refuses_what_it_has_to_take_fails() -> None:
    def refuse(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        raise InputError("no")

    only = ["torque/taylor/huge-1e+06", "shapes/taylor/case-6", "invariance/taylor/signs-12/free"]
    known = METHODS["taylor"]
    for each in only:
        assert [o.check.passed for o in stress([each])].count(False) == 0
    with patch.dict(METHODS, {"taylor": replace(known, solve=refuse)}):
        for each in only:
            checks = [outcome.check for outcome in stress([each])]
            assert checks
            assert not any(check.passed for check in checks), each


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the figures that are saved from now on."""
    figure_module = pytest.importorskip("matplotlib.figure")
    saved: list[Any] = []
    real = figure_module.Figure.savefig

    def keep(figure: Any, *arguments: Any, **options: Any) -> None:
        real(figure, *arguments, **options)
        saved.append(figure)

    monkeypatch.setattr(figure_module.Figure, "savefig", keep)
    return saved


def test_every_mark_has_a_key_and_no_title_meets_another(
    figures: list[Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Programs have marks of their own, and a long name stands above the kinds of disturbance."""
    only = "separatrix/improved-euler,separatrix/gauss-1,separatrix/two-term"
    assert _run(capsys, "--only", only, "--plot", str(tmp_path / "x.png"))[0] == 0
    (figure,) = figures
    (key,) = figure.legends
    assert {each.get_text() for each in key.get_texts()} == {
        "coarse error", "coarse drift", "steps error", "steps drift", "original", "corrected",
        "no setting",
    }  # fmt: skip
    shown = [axes for axes in figure.axes if axes.get_visible()]
    for axes in shown:
        title = axes.get_title(loc="left")
        (name,) = (each for each in axes.get_children() if _says(each, title))
        kinds = [each.get_window_extent() for each in axes.texts]
        assert kinds
        assert all(not name.get_window_extent().overlaps(box) for box in kinds), title
        assert not any(x.overlaps(y) for x, y in itertools.combinations(kinds, 2)), title
        assert not key.get_window_extent().overlaps(name.get_window_extent())


def test_names_of_kinds_stand_apart(
    figures: list[Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Four bodies each, and names as long as impossible-three."""
    picture = str(tmp_path / "x.png")
    assert _run(capsys, "--only", "shapes/closed-form", "--plot", picture)[0] == 0
    (figure,) = figures
    boxes = [each.get_window_extent() for each in figure.axes[0].texts]
    assert len(boxes) > 10
    assert not any(x.overlaps(y) for x, y in itertools.combinations(boxes, 2))


def _says(artist: Any, text: str) -> bool:
    return hasattr(artist, "get_text") and artist.get_text() == text


def test_momentum_is_held_where_energy_does_not_change() -> None:
    scene = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0))
    assert truth.conserved(scene, np.array([0.0, math.sqrt(0.5), 0.0]), 1.0) > 0.1

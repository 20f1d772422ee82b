"""`stress`: the bounds of its trials hold, planted faults are caught, failures can be repeated."""

import itertools
import json
import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from pyharness import Scene, Trajectory, read_scene, solve
from pyharness.checks import hold as truth
from pyharness.checks.check import BITS, Check, Name
from pyharness.checks.compare.candidates import End
from pyharness.checks.scenes.extreme import EXTREMES, in_steps
from pyharness.checks.stress import named, stress, worst
from pyharness.cli.main import main
from pyharness.thesis.programs import PROGRAM_REGISTRY
from tests.checks.stressed import checks_of, failed
from tests.conftest import Capture, Patch


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["separatrix", "near-symmetry", "shapes", "scales"])
def test_bounds_hold(name: str) -> None:
    """Test one in five circumstances; `stress` itself tests all of them."""
    some = [each.name for each in EXTREMES[name]()][::5]
    subjects = {*truth.ALL, *PROGRAM_REGISTRY}
    checks = list(stress([f"{name}/{who}/{where}" for who in subjects for where in some]))
    assert [check.id for check in checks if not check.passed] == []
    assert len({check.id for check in checks}) == len(checks)
    least = dict.fromkeys(subjects, math.inf)
    for check in checks:
        assert check.replay == f"python -m pyharness stress --only {check.id}"
        subject = check.id.split("/")[1]
        if check.limit is not None:
            least[subject] = min(least[subject], check.limit)
    assert subjects == {check.id.split("/")[1] for check in checks}
    # Programs are described, not judged, so they have no limit. Every method has at least one
    # useful bound.
    assert all((least[each] < 1e-3) == (each in truth.ALL) for each in subjects), least
    assert all(least[program] == math.inf for program in PROGRAM_REGISTRY)


def test_one_check_alone_is_the_same() -> None:
    some = checks_of("separatrix/taylor/flip-1e-05", "separatrix/rk4/none")
    assert {id.split("/")[2] for id in some} == {"flip-1e-05", "none"}
    for id, check in some.items():
        assert checks_of(id) == {id: check}


@pytest.mark.parametrize("number", [math.inf, math.nan])
def test_an_overflow_reported_as_complete_is_caught(monkeypatch: Patch, number: float) -> None:
    def wrong(*_: object) -> End:
        return End(np.full(3, number), "complete", 1)

    for room in ("hold", "trials.scales"):
        monkeypatch.setattr(f"pyharness.checks.{room}.run_method", wrong)
    for name in ("1e150", "beyond", "same-2^100"):
        assert failed(f"scales/taylor/{name}"), name


def test_a_refusal_is_described() -> None:
    (check,) = checks_of("shapes/closed-form/case-6").values()
    assert (check.passed, check.limit) == (True, None)
    assert check.note.startswith("refused: closed-form")


def test_what_is_conserved_is_read_as_an_error_of_omega() -> None:
    scene = in_steps(Scene("", (0.3, 1.0, -0.6), moments=(6.0, 5.0, 2.0)), 7.0)
    assert scene.times()[-1] == pytest.approx(7.0, rel=1e-15)
    assert truth._steps(scene, 7.0) == scene.steps
    omega = np.array(scene.omega)
    assert truth.conserved(scene, omega, 1.0) == truth.conserved(scene, -omega, 1.0) == 0.0
    for error in (1e-3, 1e-9):
        found = truth.conserved(scene, omega + error * np.sign(omega), 1.0)
        assert 0.99 * error < found <= error + 1e-15
    assert truth.conserved(scene, np.array([math.nan, 0.0, 0.0]), 1.0) == math.inf
    # The angular momentum is checked even if the energy does not change.
    spin = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0))
    assert truth.conserved(spin, np.array([0.0, math.sqrt(0.5), 0.0]), 1.0) > 0.1


def test_the_worst_is_the_nearest_to_its_limit_or_failed() -> None:
    scene = Scene("", (1.0,) * 3, (1.0,) * 3)
    found = worst(
        Check(Name(*id.split("/"), scene=scene), passed, value, limit, BITS if limit else None)
        for id, value, limit, passed in (
            ("a/b/1", 1e-3, 1.0, True), ("a/b/2", 1e-9, 1e-9, True), ("a/b/3", 9.0, None, True),
            ("a/c/1", math.nan, 1.0, False), ("a/c/2", 2.0, 1.0, False),
        )
    )  # fmt: skip
    assert {name: each.id for name, each in found.items()} == {"a/b": "a/b/2", "a/c": "a/c/1"}


def _run(capsys: Capture, *arguments: str) -> tuple[int, str]:
    return main(["stress", *arguments]), capsys.readouterr().out


@pytest.mark.campaign
def test_table_is_narrow_and_json_tells_all(
    capsys: Capture, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    only = "separatrix/closed-form,separatrix/rk4/flip-1e-05,shapes/two-term/plate-123"
    code, text = _run(capsys, "--only", only)
    lines = text.splitlines()
    assert code == 0
    assert max(map(len, lines)) <= 100
    assert "all well" in text
    for row in ("closed-form ", "rk4 ", "two-term "):
        assert sum(line.startswith(row) for line in lines) == 1
    # No file is written if only a part of a trial is requested.
    assert list(tmp_path.iterdir()) == []
    code, text = _run(capsys, "--only", only, "--format", "json")
    record = json.loads(text)
    assert (code, record["schema"], record["passed"]) == (0, 1, True)
    for check in record["checks"]:
        assert {"id", "passed", "value", "limit", "basis", "replay"} <= set(check)


def test_a_failure_is_told_in_every_form(
    capsys: Capture, tmp_path: Path, monkeypatch: Patch
) -> None:
    def late(scene: Scene, times: Sequence[float], *rest: Any, **more: Any) -> Trajectory:
        return solve(scene, [t * (1.0 + 1e-9) for t in times], *rest, **more)

    monkeypatch.setattr("pyharness.checks.compare.candidates.solve", late)
    only = "separatrix/closed-form/flip-1e-02"
    code, text = _run(capsys, "--only", only)
    assert code == 1
    assert f"FAILED {only}/1e-14/error" in text
    assert f"  python -m pyharness stress --only {only}/1e-14/error" in text
    code, text = _run(capsys, "--only", only, "--format", "json")
    assert (code, json.loads(text)["passed"]) == (1, False)
    file = tmp_path / "stress.xml"
    assert _run(capsys, "--only", only, "--format", "junit", "--out", str(file))[0] == 1
    suite = xml.parse(file).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert float(suite.get("time", 0)) > 0.0


def test_an_exception_is_a_failure_of_the_requested_check(
    capsys: Capture, monkeypatch: Patch
) -> None:
    def broken(*arguments: Any, **more: Any) -> Trajectory:
        raise ArithmeticError("at all times")

    monkeypatch.setattr("pyharness.checks.compare.candidates.solve", broken)
    code, text = _run(capsys, "--only", "separatrix/closed-form/flip-1e-02/1e-14/error")
    assert code == 1
    assert "at all times" in text


def test_the_worst_input_is_saved_and_its_command_gives_the_same(
    capsys: Capture, tmp_path: Path
) -> None:
    folder = tmp_path / "worst"
    only = "separatrix/taylor/early-1e-01,separatrix/quick/early-1e-01"
    assert _run(capsys, "--only", only, "--save", str(folder))[0] == 0
    names = {path.name for path in folder.iterdir()}
    assert names == {"separatrix-taylor.toml", "separatrix-quick.toml"}
    for path in folder.iterdir():
        told, command = (line.removeprefix("# ") for line in path.read_text().splitlines()[:2])
        words = command.split()
        assert words[:5] == ["python", "-m", "pyharness", "stress", "--only"]
        (check,) = stress([words[5]])
        scene, saved = check.name.scene, read_scene(path)
        subject = "/".join(check.id.split("/")[:2])
        assert told == f"worst of {subject}: {check.value}, limit {check.limit}"
        assert scene is not None
        assert (saved.omega, saved.moments) == (scene.omega, scene.moments)
        assert (saved.step_size, saved.steps) == (scene.step_size, scene.steps)


def test_only_what_failed_is_saved_unless_a_folder_is_given(
    capsys: Capture, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "worst"
    scene = Scene("", (1.0, 2.0, 3.0), (3.0, 2.0, 1.5))
    good = named("separatrix", "taylor", "a", scene=scene).bounded(1.0, 2.0, BITS)
    bad = named("separatrix", "quick", "b", scene=scene).bounded(3.0, 2.0, BITS)
    for checks, code, names in (([good], 0, None), ([good, bad], 1, ["separatrix-quick.toml"])):
        monkeypatch.setattr("pyharness.cli.verbs.stress.stress", lambda _, found=checks: found)
        assert _run(capsys, "--only", "separatrix")[0] == code
        assert folder.exists() == (names is not None)
        assert names is None or [each.name for each in folder.iterdir()] == names
    # A failure to save the worst scene does not hide the failed check.
    shutil.rmtree(folder)
    folder.write_text("a file")
    assert main(["stress", "--only", "separatrix"]) == 1
    assert "the inputs of what failed are not saved: " in capsys.readouterr().err


@pytest.fixture
def figures(monkeypatch: Patch) -> list[Any]:
    """Return the list to which every saved figure will be appended."""
    figure_module = pytest.importorskip("matplotlib.figure")
    saved: list[Any] = []
    real = figure_module.Figure.savefig

    def keep(figure: Any, *arguments: Any, **options: Any) -> None:
        real(figure, *arguments, **options)
        saved.append(figure)

    monkeypatch.setattr(figure_module.Figure, "savefig", keep)
    return saved


@pytest.mark.campaign
@pytest.mark.parametrize(("only", "key"), [
    # Programs have their own markers, and a long name is placed above the kinds of disturbance.
    ("separatrix/improved-euler,separatrix/gauss-1,separatrix/two-term",
     "coarse error,coarse drift,steps error,steps drift,original,corrected,no setting"),
    # Four bodies each, with names as long as impossible-three.
    ("shapes/closed-form", "fine error,fine drift"),
])  # fmt: skip
def test_picture_shows_what_its_numbers_say_and_no_title_meets_another(
    only: str, key: str, figures: list[Any], capsys: Capture, tmp_path: Path
) -> None:
    assert _run(capsys, "--only", only, "--plot", str(tmp_path / "x.svg"))[0] == 0
    rows = (tmp_path / "x.csv").read_text().splitlines()
    assert rows[0] == "id,value,limit,note"
    shown = [check for check in checks_of(*only.split(",")).values() if check.value is not None]
    assert len(rows) == 1 + len(shown)
    (figure,) = figures
    (legend,) = figure.legends
    assert {each.get_text() for each in legend.get_texts()} == set(key.split(","))
    for axes in (axes for axes in figure.axes if axes.get_visible()):
        title = axes.get_title(loc="left")
        texts = (each for each in axes.get_children() if hasattr(each, "get_text"))
        (name,) = (each for each in texts if each.get_text() == title)
        boxes = [each.get_window_extent() for each in (name, *axes.texts)]
        assert len(boxes) > 1
        assert not any(x.overlaps(y) for x, y in itertools.combinations(boxes, 2)), title
        assert not legend.get_window_extent().overlaps(boxes[0])

"""Published figures: all methods agree with them, and faults are found."""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, Trajectory, solve
from pyharness.checks.check import Check
from pyharness.checks.external import external_checks
from pyharness.checks.external_file import Figure, Problem, figure, problems, read_problem
from pyharness.cli.main import main
from pyharness.engine.plan.registry import METHODS

Patch = pytest.MonkeyPatch
_REFUSALS = Path(__file__).parents[1] / "refusals/files.toml"
_GOOD = tomllib.loads(_REFUSALS.read_text())["published.toml"]


def _read(folder: Path, text: str, name: str = "mine.toml") -> Problem:
    path = folder / name
    path.write_text(text)
    return read_problem(path)


def _top(folder: Path, body: str, start: str, time: str, *prints: str) -> Problem:
    """Return the problem of the good file with another body, initial omega, time and figure."""
    text = _GOOD.replace("1.0, -1.0, -0.51", body).replace("0.0, 1.0, 1.0", start)
    omega = ", ".join(f'"{each}"' for each in prints)
    return _read(
        folder, text.replace('"20"', f'"{time}"').replace('"-0.93966", "", "7.4141e-01"', omega)
    )


def _checks(problem: Problem, *names: str) -> list[Check]:
    """Return the checks of a problem's first figure by the named methods."""
    prefix = f"external/{problem.name}/{problem.values[0].time}"
    return list(external_checks([problem], [f"{prefix}/{name}" for name in names]))


@pytest.mark.parametrize(
    ("text", "good_to", "accuracy"),
    [("0.606", 0.0, 5e-4), ("-9.39e-1", 0.0, 5e-4), ("-9.390E-01", 0.0, 5e-5), ("12", 0.0, 0.5),
     ("1e3", 0.0, 500.0), (".5", 0.0, 0.05), ("5.", 0.0, 0.5), ("+0.0", 0.0, 0.05),
     ("0e-9999", 0.0, 5e-324),
     # The source may state a larger error than the digits imply, but not a smaller one.
     ("0.9396570798729192", 5e-15, 5e-15), ("0.606", 5e-15, 5e-4)],
)  # fmt: skip
def test_accuracy_is_half_a_unit_of_the_last_digit(
    text: str, good_to: float, accuracy: float
) -> None:
    assert figure("", text, good_to).accuracy == pytest.approx(accuracy, rel=1e-15)


def test_the_print_is_kept_in_all_its_digits() -> None:
    digits = "0.246781405136141600483623741101255389743847413013817188632739"
    assert str(figure("", digits).value) == digits


def test_a_file_of_the_users_is_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="TOML"):
        _read(tmp_path, _GOOD.replace("[body]", "[body"))
    problem = _read(tmp_path, _GOOD)
    assert (problem.name, problem.unit, problem.title) == ("mine", "rad/s", "a top")
    assert [each and each.accuracy for each in problem.values[0].omega] == [5e-6, None, 5e-6]
    checks = _checks(problem, "reference", "auto")
    assert all(check.passed for check in checks)
    only = "--only external/mine/20/reference"
    assert checks[0].replay == f"python -m pyharness verify --external {problem.path} {only}"


@pytest.mark.campaign
def test_problems_of_the_package_agree_with_every_method() -> None:
    """Check some of the problems; `verify` checks all of them."""
    some = [f"external/{name}" for name in ("detest-b5", "fresnel", "jacobi-parameter-half")]
    checks = list(external_checks(problems(), some))
    assert [check for check in checks if not check.passed] == []
    ids = [check.id for check in checks]
    assert len(set(ids)) == len(ids)
    methods = {id.split("/")[3] for id in ids}
    not_checked = {"improved-euler", "taylor-3", "rk4", "averaged"}
    assert methods == (METHODS.keys() - not_checked) | {
        "quick", "two-term", "four-term", "runge-kutta",
    }  # fmt: skip
    assert {"detest-b5", "hairer-rigid-body"} <= {problem.name for problem in problems()}


@pytest.mark.campaign
def test_one_check_alone_is_the_same_check() -> None:
    wanted = "external/jacobi-half/1.25/gauss-4"
    (alone,) = external_checks(problems(), [wanted])
    assert alone.id == wanted
    assert alone in external_checks(problems(), ["external/jacobi-half/1.25"])
    assert list(external_checks(problems(), ["cells"])) == []


@pytest.mark.campaign
@pytest.mark.parametrize("problem", problems(), ids=lambda problem: problem.name)
def test_a_last_digit_that_counts_is_caught_in_every_problem(problem: Problem) -> None:
    value = problem.values[-1]
    only = [f"external/{problem.name}/{value.time}/{method}" for method in ("reference", "taylor")]
    for axis, printed in enumerate(value.omega):
        if printed is not None:
            alone: list[Figure | None] = [None, None, None]
            alone[axis] = printed
            one = replace(problem, values=(replace(value, omega=tuple(alone)),))
            checks = list(external_checks([one], only))
            assert all(check.passed for check in checks)
            limit = Decimal(max(check.limit or 0.0 for check in checks))
            alone[axis] = replace(printed, value=printed.value + Decimal("2.1") * limit)
            planted = replace(problem, values=(replace(value, omega=tuple(alone)),))
            assert not any(check.passed for check in external_checks([planted], only))


@pytest.mark.parametrize("axis", range(3))
def test_no_number_at_all_is_caught(axis: int, monkeypatch: Patch) -> None:
    honest = METHODS["taylor"]

    def spoiled(*given: Any) -> Trajectory:
        found = honest.solve(*given)
        found.omega[:, axis] = np.nan
        return found

    monkeypatch.setitem(METHODS, "taylor", replace(honest, solve=spoiled))
    (check,) = external_checks(problems(), ["external/detest-b5/20/taylor"])
    assert not check.passed


def test_what_gives_up_or_ends_early_fails_with_its_reason(tmp_path: Path) -> None:
    """The solution is 1 / (1 - t) on every axis, so that nothing can be compared at t = 2."""
    problem = _top(tmp_path, "1.0, 1.0, 1.0", "1.0, 1.0, 1.0", "2", "0.5", "", "")
    series, program = _checks(problem, "taylor", "closed-form", "runge-kutta")
    assert (series.passed, series.note) == (False, "ended before t = 2 s")
    # Even with its shortest steps, a program can't distinguish an unbounded solution from steps
    # that are too long.
    assert program.passed
    assert re.match(r"refused: runge-kutta in steps of .* s: overflow", program.note)


_LATER = f"""{_GOOD}\
[[value]]
time = "150"
omega = ["0.0", "0.0", "0.0"]
good_to = 2.0
"""


def _impatient(name: str, monkeypatch: Patch) -> None:
    """Make a method refuse times beyond 100 s."""
    honest = METHODS[name]

    def solve(scene: Scene, times: Sequence[float], *rest: float) -> Trajectory:
        if times[-1] > 100.0:
            raise InputError(f"exceeded its work limit at t = {times[-1]:g} s")
        return honest.solve(scene, times, *rest)

    monkeypatch.setitem(METHODS, name, replace(honest, solve=solve))


def test_what_gives_up_later_is_judged_earlier(tmp_path: Path, monkeypatch: Patch) -> None:
    """For a user's file the refusal is a note; the project's own problems, and `auto`, fail."""
    for name in ("gauss-8", "auto", "dop853"):
        _impatient(name, monkeypatch)
    problem = _read(tmp_path, _LATER)
    names = ("gauss-8", "auto", "dop853", "taylor", "runge-kutta")
    only = [f"external/mine/{time}/{name}" for time in ("20", "150") for name in names]
    checks = {check.id: check for check in external_checks([problem], only)}
    early, late = checks["external/mine/20/gauss-8"], checks["external/mine/150/gauss-8"]
    assert early.passed
    assert early.value is not None
    assert (late.passed, late.value) == (True, None)
    assert late.note == "refused: exceeded its work limit at t = 150 s"
    assert [id for id, check in checks.items() if not check.passed] == ["external/mine/150/auto"]
    own = external_checks([replace(problem, path=None)], [early.id, late.id])
    assert [check.id for check in own if not check.passed] == [late.id]
    assert list(external_checks([problem], [early.id])) == [early]


@pytest.mark.parametrize("time", ["-5", "20"])
def test_a_long_motion_gets_the_tolerance_that_is_claimed_for_it(time: str, tmp_path: Path) -> None:
    """The phase of a symmetric top grows by 5 rad/s, and a perturbation grows with time."""
    phase = 5 * float(time)
    prints = f"{np.sin(phase):.15f}", f"{np.cos(phase):.15f}", "10.0"
    problem = _top(tmp_path, "0.5, -0.5, 0.0", "0.0, 1.0, 10.0", time, *prints)
    for check in _checks(problem, "lsoda", "dop853"):
        assert check.passed
        # 4e-14 for each of 40 steps, amplified 100 times over 100 radians, relative to 10 rad/s.
        assert (check.limit or 1.0) < 3e-9


@pytest.mark.campaign
def test_a_far_time_leaves_the_excuse_of_a_near_one(tmp_path: Path, monkeypatch: Patch) -> None:
    """The limit for a near time is the same, whether or not the series reaches a later time."""
    only = ["external/mine/20/reference"]
    (alone,) = external_checks([_read(tmp_path, _GOOD)], only)
    for name in ("taylor", "auto"):
        _impatient(name, monkeypatch)
    (beside,) = external_checks([_read(tmp_path, _LATER)], only)
    assert beside.limit == alone.limit


def test_beyond_the_series_a_closed_form_tells_what_rounding_does(tmp_path: Path) -> None:
    """10.1 rad/s is not a binary number, which changes the angle after 1e9 s by 2e-7 rad."""
    with mpmath.workdps(40):
        sine = mpmath.nstr(mpmath.sin(mpmath.mpf("5.05e9")), 12)
    problem = _top(tmp_path, "0.5, -0.5, 0.0", "0.0, 1.0, 10.1", "1e9", sine, "", "10.1")
    checks = _checks(problem, "closed-form", "reference", "auto")
    assert [check.passed for check in checks] == [True] * 3
    assert all((check.value or 0.0) > 1e-8 and (check.limit or 1.0) < 1e-5 for check in checks)


@pytest.mark.campaign
def test_programs_in_steps_far_too_long_are_no_fault_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = _top(tmp_path, "1.0, -1.0, 0.0", "0.0, 1.0, 10.0", "1e5", "", "", "10.0")
    (check,) = _checks(problem, "runge-kutta")
    assert check.passed
    assert check.note.startswith("refused: ")
    assert main(["verify", "--external", str(problem.path), "--only", check.id]) == 0
    assert capsys.readouterr().out.startswith("1 of 1 checks have no verdict, ")


def _nasa_attitude(x: float, y: float, latitude: float, angles: Sequence[float]) -> Rotation:
    """Return the rotation from body to inertial axes, through local axes that turn with the Earth.

    The local axes point north, east and down at the start. `x` and `y` are the inertial position,
    and `angles` are yaw, pitch and roll from the local axes.
    """
    phi, turn = np.radians(latitude), np.arctan2(y, x)

    def local(phi: float, turn: float) -> np.ndarray:
        north = [-np.sin(phi) * np.cos(turn), -np.sin(phi) * np.sin(turn), np.cos(phi)]
        east = [-np.sin(turn), np.cos(turn), 0.0]
        down = [-np.cos(phi) * np.cos(turn), -np.cos(phi) * np.sin(turn), -np.sin(phi)]
        return np.array([north, east, down]).T

    axes = Rotation.from_matrix(local(0.0, 0.0).T @ local(phi, turn))
    return axes * Rotation.from_euler("ZYX", angles, degrees=True)


# Time, eiPosition_ft_X and _Y, latitude_deg, eulerAngle_deg_Yaw, _Pitch, _Roll of
# nasa/simupy-flight, Atmos_02_sim_04.csv, the source of data/external/nasa-brick.toml.
_NASA = (
    ("1", 2.09556302722e7, 1528.10943884, 2.12636454625e-9,
     (31.776473202, 18.689409988, 12.5899948471)),
    ("2", 2.09555821123e7, 3056.21653642, 1.70109592541e-8,
     (70.2258677851, 30.5106887852, 30.4648992127)),
    ("3", 2.09555018457e7, 4584.31895147, 5.74122286361e-8,
     (112.772149811, 29.8761193761, 47.8536430123)),
    ("4", 2.09553894721e7, 6112.41434265, 1.36089045574e-7,
     (150.274178232, 18.2316762214, 53.2136920977)),
)  # fmt: skip


def _with_attitudes(folder: Path, entries: Sequence[tuple[str, str]]) -> Problem:
    """Return NASA's brick with attitudes printed for the given times."""
    (brick,) = (each for each in problems() if each.name == "nasa-brick")
    head = _GOOD.partition("[body]")[0].replace('"as printed"', '"as printed"\nunit = "deg/s"')
    moments, omega = list(brick.scene.moments or ()), [10.0, 20.0, 30.0]
    text = f"{head}sequence = '3-1-3'\n[body]\nmoments = {moments}\n[initial]\nomega = {omega}\n"
    for time, entry in entries:
        text += f'[[value]]\ntime = "{time}"\n{entry}\n'
    return _read(folder, text, "brick.toml")


@pytest.mark.campaign
def test_published_attitudes_of_the_brick_agree(tmp_path: Path) -> None:
    (shipped,) = (each for each in problems() if each.name == "nasa-brick-attitude")
    entries = []
    for value, (time, x, y, latitude, angles) in zip(shipped.values, _NASA, strict=True):
        q = _nasa_attitude(x, y, latitude, angles).as_quat(scalar_first=True)
        assert value.time == time
        assert value.pointing is not None
        assert value.pointing.attitude == pytest.approx(q, abs=1e-11)
        # The quaternion with the other sign is the same attitude.
        printed = [f"{each:.9f}" for each in -q]
        entries.append((time, f"attitude = {printed}"))
    checks = list(external_checks([_with_attitudes(tmp_path, entries)]))
    assert len(checks) == 4 * 8
    assert all(check.passed for check in checks)
    assert all(check.id.endswith("/attitude") for check in checks)
    assert max(check.value or 0.0 for check in checks) < 4e-9
    assert max(check.limit or 0.0 for check in checks) < 1e-7
    # Without the Earth's rotation no attitude would agree.
    bare = Rotation.from_euler("ZYX", _NASA[3][4], degrees=True).as_quat(scalar_first=True)
    wrong = _with_attitudes(tmp_path, [("4", f"attitude = {[f'{each:.9f}' for each in bare]}")])
    assert not any(check.passed for check in external_checks([wrong]))


@pytest.mark.campaign
def test_attitudes_may_be_angles_and_stand_beside_omega(tmp_path: Path) -> None:
    scene = _with_attitudes(tmp_path, [("1", "attitude = ['1', '0', '0', '0']")]).scene
    found = solve(scene, [2.0], "reference", attitude=True)
    told = found.rotation().as_euler("ZXZ", degrees=True)[0]
    omega = [f"{np.degrees(w):.8f}" for w in found.omega[0]]
    for off, passes in ((0.0, True), (1e-5, False)):
        angles = [f"{told[0] + off:.6f}", *(f"{each:.6f}" for each in told[1:])]
        entry = f"omega = {omega}\nangles_deg = {angles}"
        checks = list(external_checks([_with_attitudes(tmp_path, [("2", entry)])]))
        turned = [check for check in checks if check.id.endswith("/attitude")]
        assert len(turned) == 8
        assert {check.passed for check in turned} == {passes}
        assert all(check.passed for check in checks if check not in turned)
        assert len(checks) > 20

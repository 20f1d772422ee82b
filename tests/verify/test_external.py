"""Published figures: their files are read strictly, all methods agree, and a fault shows."""

import re
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import mpmath
import numpy as np
import pytest

import pyharness
from pyharness import InputError, Scene
from pyharness.cli.main import main
from pyharness.compare.checks import Check
from pyharness.methods.registry import METHODS
from pyharness.verify.external import Problem, external_checks, problems, read_problem
from pyharness.verify.external_file import Figure, figure

_FILES = Path(pyharness.__file__).parent / "data" / "external"

_GOOD = """\
title = "a top"
source = "a book"
where = "page 1"
conditions = "as printed"
[body]
coefficients = [1.0, -1.0, -0.51]
[initial]
omega = [0.0, 1.0, 1.0]
[[value]]
time = "20"
omega = ["-0.93966", "", "7.4141e-01"]
"""


def _read(folder: Path, text: str, name: str = "mine.toml") -> Problem:
    path = folder / name
    path.write_text(text)
    return read_problem(path)


def _planted(folder: Path, name: str, old: str, new: str) -> Problem:
    """Return a problem of the package with one place of its file changed."""
    text = (_FILES / f"{name}.toml").read_text()
    assert text.count(old) == 1
    return _read(folder, text.replace(old, new))


def _failed(problem: Problem, *only: str) -> list[Check]:
    return [check for check in external_checks([problem], only) if not check.passed]


@pytest.mark.parametrize(
    ("text", "accuracy"),
    [
        ("0.606", 5e-4),
        ("-9.39e-1", 5e-4),
        ("-9.390E-01", 5e-5),
        ("12", 0.5),
        ("1e3", 500.0),
        (".5", 0.05),
        ("5.", 0.5),
        ("+0.0", 0.05),
        ("0e-9999", 5e-324),
    ],
)
def test_accuracy_is_half_a_unit_of_the_last_digit(text: str, accuracy: float) -> None:
    assert figure("", text).accuracy == pytest.approx(accuracy, rel=1e-15)


def test_the_source_may_admit_more_and_not_less() -> None:
    assert figure("", "0.9396570798729192", 5e-15).accuracy == 5e-15
    assert figure("", "0.606", 5e-15).accuracy == 5e-4


def test_the_print_is_kept_in_all_its_digits() -> None:
    digits = "0.246781405136141600483623741101255389743847413013817188632739"
    assert str(figure("", digits).value) == digits


def test_a_file_of_the_users_is_read(tmp_path: Path) -> None:
    problem = _read(tmp_path, _GOOD)
    assert (problem.name, problem.unit, problem.title) == ("mine", "rad/s", "a top")
    first, second, third = problem.values[0].omega
    assert second is None
    assert first is not None
    assert third is not None
    assert (first.accuracy, third.accuracy) == (5e-6, 5e-6)
    checks = list(external_checks([problem]))
    assert all(check.passed for check in checks)
    path = tmp_path / "mine.toml"
    wanted = f"python -m pyharness verify --external {path} --only external/mine/20/reference"
    assert wanted in {check.replay for check in checks}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('title = "a top"\n', "", "title is missing"),
        ('source = "a book"', "source = 3", "source is missing"),
        ('where = "page 1"', 'where = " "', "where is missing"),
        ("conditions", "condition", "unknown key 'condition'; did you mean 'conditions'"),
        ("[body]\ncoefficients = [1.0, -1.0, -0.51]\n", "", r"\[body\] is missing"),
        ("[initial]\nomega = [0.0, 1.0, 1.0]\n", "", r"\[initial\] is missing"),
        ("[0.0, 1.0, 1.0]", "[0.0, 1.0]", "three numbers"),
        ("[0.0, 1.0, 1.0]", "[0.0, 1.0, nan]", "not finite"),
        ("coefficients", "moments", "allowed: a finite number above 0"),
        ("[body]", "[run]\nsteps = 3\n[body]", "unknown key 'run'"),
        ("[body]", 'unit = "rpm"\n[body]', "unknown unit 'rpm'"),
        ("[body]", "unit = 3\n[body]", "unknown unit '3'"),
        ("[[value]]", "[value]", r"\[\[value\]\] is missing"),
        ('[[value]]\ntime = "20"', "[[values]]", "unknown key 'values'"),
        ('time = "20"', "", "time: ''"),
        ('time = "20"', "time = 20", "time: a whole number; allowed: the digits as text"),
        ('time = "20"', 'time = "0.0"', "time is 0"),
        ('time = "20"', 'time = "inf"', "allowed: a printed number"),
        ('time = "20"', 'time = "20"\nerror = 1.0', "unknown key 'error'"),
        ('time = "20"', 'time = "20"\ngood_to = "x"', "good_to: text where a number belongs"),
        ('time = "20"', 'time = "20"\ngood_to = -1.0', "good_to is -1"),
        ('time = "20"', 'time = "20"\ngood_to = inf', "good_to is inf"),
        (', "7.4141e-01"]', "]", "list of three texts"),
        ('["-0.93966", "", "7.4141e-01"]', '"-0.93966"', "list of three texts"),
        ('["-0.93966", "", "7.4141e-01"]', '["", "", ""]', "nothing printed"),
        ('"-0.93966"', "-0.93966", "omega: a number; allowed: the digits as text"),
        ('"-0.93966"', "true", "omega: true or false"),
        ('"-0.93966"', '"minus one"', "'minus one'; allowed: a printed number"),
        ('"-0.93966"', '"-0,93966"', "allowed: a printed number"),
        ('"-0.93966"', '"1_000"', "allowed: a printed number"),
        ('"-0.93966"', '"nan"', "allowed: a printed number"),
        ('"-0.93966"', '"9e999"', "too large for binary64"),
        ('"-0.93966"', f'"{"9" * 1000}"', "allowed: a printed number"),
        ('"20"\n', '"20"\nomega = ["1", "1", "1"]\n[[value]]\ntime = "20.0"\n', "given twice"),
        ("[body]", "[body", "not TOML"),
    ],
)
def test_a_mistake_in_a_file_is_told_in_one_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in _GOOD
    with pytest.raises(InputError, match=message) as caught:
        _read(tmp_path, _GOOD.replace(old, new))
    assert str(caught.value).startswith("external file '")
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_problem(tmp_path / "none.toml")
    (tmp_path / "huge.toml").write_text("#" * 1_000_001)
    with pytest.raises(InputError, match="larger than"):
        read_problem(tmp_path / "huge.toml")
    with pytest.raises(InputError, match="names its checks"):
        _read(tmp_path, _GOOD, "two words.toml")


def test_problems_of_the_package_agree_with_every_method() -> None:
    """Some of them; all are what `verify` is run for."""
    some = [f"external/{name}" for name in ("detest-b5", "fresnel", "jacobi-parameter-half")]
    checks = list(external_checks(problems(), some))
    assert [check for check in checks if not check.passed] == []
    ids = [check.id for check in checks]
    assert len(set(ids)) == len(ids)
    methods = {id.split("/")[3] for id in ids}
    fixed_step = {"improved-euler", "taylor-3", "rk4"}
    assert methods == (METHODS.keys() - fixed_step) | {
        "quick", "two-term", "four-term", "runge-kutta",
    }  # fmt: skip
    assert {"detest-b5", "hairer-rigid-body"} <= {problem.name for problem in problems()}


@pytest.mark.parametrize(
    ("id", "low", "high"),
    [
        ("detest-b5/20/taylor", 0.0, 2.1e-14),
        ("hairer-rigid-body/20/two-term", 0.0, 6e-4),
        ("nasa-brick/30/reference", 0.0, 2.01e-8),
        ("jacobi-half/25/reference", 0.0, 2e-14),
        ("jacobi-parameter-half/2.0/runge-kutta", 0.0, 1e-10),
        # Near the separatrix a rounding grows, and with it what can be asked.
        ("jacobi-near-separatrix/25/taylor", 1e-14, 1e-11),
    ],
)
def test_limits_are_near_the_print_where_the_method_is_finer(
    id: str, low: float, high: float
) -> None:
    """A limit that rounding or tolerance made wide would let anything pass."""
    (check,) = external_checks(problems(), [f"external/{id}"])
    assert check.limit is not None
    assert low < check.limit < high


def test_one_check_alone_is_the_same_check() -> None:
    wanted = "external/jacobi-half/1.25/gauss-4"
    alone = list(external_checks(problems(), [wanted]))
    assert [check.id for check in alone] == [wanted]
    among = external_checks(problems(), ["external/jacobi-half"])
    assert alone == [check for check in among if check.id == wanted]
    assert list(external_checks(problems(), ["cells"])) == []


def test_one_digit_of_a_print_changed_is_caught(tmp_path: Path) -> None:
    """By every method but those whose own error is larger."""
    planted = _planted(tmp_path, "detest-b5", "7.414126596199957", "7.414126596299957")
    caught = {check.id.split("/")[3] for check in _failed(planted)}
    assert caught >= {"reference", "auto", "taylor", "closed-form", "gauss-8", "dop853"}
    planted = _planted(tmp_path, "hairer-rigid-body", '"0.807"', '"0.808"')
    assert len(_failed(planted, "external/mine/20")) == 20
    assert _failed(planted, "external/mine/19.85") == []


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


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("detest-b5", "-0.51]", "0.51]"),
        ("hairer-rigid-body", "[-2.0, 1.25", "[2.0, -1.25"),
        ("nasa-brick", "[0.001894220, 0.006211019, 0.0", "[0.006211019, 0.001894220, 0.0"),
        ("fresnel", "[1.0, 0.0, 3.1", "[-1.0, 0.0, 3.1"),
        ("bessel-j2", "0.0, -5.0], frequency = 1.0", "0.0, 5.0], frequency = 1.0"),
        ("bessel-j0", "[0.15915494309189533577, 0.0, 0.0]", "[0.0, 0.15915494309189533577, 0.0]"),
    ],
)  # fmt: skip
def test_an_equation_changed_is_caught(tmp_path: Path, name: str, old: str, new: str) -> None:
    """By every method, the coarsest program too."""
    planted = _planted(tmp_path, name, old, new)
    checks = list(external_checks([planted]))
    late = [check for check in checks if check.id.split("/")[2] == planted.values[-1].time]
    assert late
    assert not any(check.passed for check in late)


def test_a_method_with_a_fault_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trajectory shifted in time conserves energy and momentum, and is wrong."""
    honest = METHODS["taylor"]

    def late(scene: Scene, times: list[float], *rest: float) -> object:
        return honest.solve(scene, [time * (1.0 + 1e-12) for time in times], *rest)

    monkeypatch.setitem(METHODS, "taylor", replace(honest, solve=late))  # type: ignore[arg-type]
    only = [f"external/detest-b5/20/{method}" for method in ("taylor", "gauss-8", "reference")]
    failed = [check.id for check in external_checks(problems(), only) if not check.passed]
    assert failed == only[:1]


def _spoiled(change: Callable[[np.ndarray], None]) -> Callable[..., object]:
    honest = METHODS["taylor"].solve

    def solve(scene: Scene, times: list[float], *rest: float) -> object:
        found = honest(scene, times, *rest)
        change(found.omega)
        return found

    return solve


@pytest.mark.parametrize("axis", range(3))
def test_no_number_at_all_is_caught(axis: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """NaN in one component must not hide behind two that are right."""

    def spoil(omega: np.ndarray) -> None:
        omega[:, axis] = np.nan

    changed = replace(METHODS["gauss-8"], solve=_spoiled(spoil))  # type: ignore[arg-type]
    monkeypatch.setitem(METHODS, "gauss-8", changed)
    only = ["external/detest-b5/20/gauss-8"]
    (check,) = external_checks(problems(), only)
    assert not check.passed


def test_what_gives_up_or_ends_early_fails_with_its_reason(tmp_path: Path) -> None:
    """The solution is 1 / (1 - t) on every axis: nothing is there to compare at t = 2."""
    text = _GOOD.replace("1.0, -1.0, -0.51", "1.0, 1.0, 1.0").replace(
        "0.0, 1.0, 1.0", "1.0, 1.0, 1.0"
    )
    checks = list(external_checks([_read(tmp_path, text.replace('"20"', '"2"'))]))
    assert checks
    # A program in its shortest steps can't tell a solution without bound from steps too long.
    passed = {check.id.split("/")[3] for check in checks if check.passed}
    assert passed == {"two-term", "four-term", "runge-kutta"}
    reasons = {check.id.split("/")[3]: check.note for check in checks}
    assert "closed-form" not in reasons
    assert reasons["taylor"] == "ended before t = 2 s"
    assert re.match(r"refused: runge-kutta in steps of .* s: overflow", reasons["runge-kutta"])


_LATER = (
    _GOOD
    + """\
[[value]]
time = "1e3"
omega = ["0.0", "0.0", "0.0"]
good_to = 2.0
"""
)


def _impatient(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a method give up where it is asked for more than 100 s."""
    honest = METHODS[name]

    def solve(scene: Scene, times: list[float], *rest: float) -> object:
        if times[-1] > 100.0:
            raise InputError(f"gave up at t = {times[-1]:g} s")
        return honest.solve(scene, times, *rest)

    monkeypatch.setitem(METHODS, name, replace(honest, solve=solve))  # type: ignore[arg-type]


def test_what_gives_up_later_is_judged_earlier(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There a file of the user's is told; the project's own problems, and `auto`, fail."""
    for name in ("gauss-8", "auto", "dop853"):
        _impatient(name, monkeypatch)
    problem = _read(tmp_path, _LATER)
    names = ("gauss-8", "auto", "dop853", "taylor", "runge-kutta")
    only = [f"external/mine/{time}/{name}" for time in ("20", "1e3") for name in names]
    checks = {check.id: check for check in external_checks([problem], only)}
    early, late = checks["external/mine/20/gauss-8"], checks["external/mine/1e3/gauss-8"]
    assert early.passed
    assert early.value is not None
    assert (late.passed, late.value) == (True, None)
    assert late.note == "refused: gave up at t = 1000 s"
    assert [id for id, check in checks.items() if not check.passed] == ["external/mine/1e3/auto"]
    own = _failed(replace(problem, path=None), "external/mine/20/gauss-8", late.id)
    assert [check.id for check in own] == [late.id]
    assert list(external_checks([problem], [early.id])) == [early]


@pytest.mark.parametrize("time", ["-5", "20"])
def test_a_long_motion_gets_the_tolerance_that_is_claimed_for_it(time: str, tmp_path: Path) -> None:
    """A symmetric top turns by 5 radians a second, and a difference grows as it goes."""
    text = _GOOD.replace("[0.0, 1.0, 1.0]", "[0.0, 1.0, 10.0]").replace("-0.51", "0.0")
    text = text.replace("[1.0, -1.0,", "[0.5, -0.5,").replace('"20"', f'"{time}"')
    phase = 5 * float(time)
    prints = f'"{np.sin(phase):.15f}", "{np.cos(phase):.15f}", "10.0"'
    text = text.replace('"-0.93966", "", "7.4141e-01"', prints)
    only = [f"external/mine/{time}/{name}" for name in ("lsoda", "dop853")]
    for check in external_checks([_read(tmp_path, text)], only):
        assert check.passed
        assert check.limit is not None
        # 4e-14 a step, 40 of them for 100 radians that grow as much, of 10 rad/s.
        assert check.limit < 3e-9


def test_a_far_time_leaves_the_excuse_of_a_near_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What rounding does to the problem is found where the series gets."""
    only = ["external/mine/20/reference"]
    (alone,) = external_checks([_read(tmp_path, _GOOD)], only)
    _impatient("taylor", monkeypatch)
    _impatient("auto", monkeypatch)
    (beside,) = external_checks([_read(tmp_path, _LATER)], only)
    assert beside.limit == alone.limit


def test_beyond_the_series_a_closed_form_tells_what_rounding_does(tmp_path: Path) -> None:
    """10.1 rad/s is no binary number: after 1e9 s that is 2e-7 radians."""
    text = _GOOD.replace("[0.0, 1.0, 1.0]", "[0.0, 1.0, 10.1]").replace("-0.51", "0.0")
    text = text.replace("[1.0, -1.0,", "[0.5, -0.5,").replace('"20"', '"1e9"')
    with mpmath.workdps(40):
        phase = mpmath.mpf("5.05e9")
        prints = f'"{mpmath.nstr(mpmath.sin(phase), 12)}", "", "10.1"'
    text = text.replace('"-0.93966", "", "7.4141e-01"', prints)
    only = [f"external/mine/1e9/{name}" for name in ("closed-form", "reference", "auto")]
    checks = list(external_checks([_read(tmp_path, text)], only))
    assert [check.passed for check in checks] == [True] * 3
    assert all((check.value or 0.0) > 1e-8 and (check.limit or 1.0) < 1e-5 for check in checks)


def test_programs_in_steps_far_too_long_are_no_fault_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = _GOOD.replace("[0.0, 1.0, 1.0]", "[0.0, 1.0, 10.0]").replace('"20"', '"1e5"')
    text = text.replace("[1.0, -1.0, -0.51]", "[1.0, -1.0, 0.0]").replace(
        '["-0.93966", "", "7.4141e-01"]', '["", "", "10.0"]'
    )
    only = [f"external/mine/1e5/{program}" for program in ("two-term", "runge-kutta")]
    checks = list(external_checks([_read(tmp_path, text)], only))
    assert [check.passed for check in checks] == [True, True]
    assert all(check.note.startswith("refused: ") for check in checks)
    command = ["verify", "--external", str(tmp_path / "mine.toml"), "--only", only[1]]
    assert main(command) == 0
    assert capsys.readouterr().out.startswith("1 of 1 judge nothing: ")


def test_gauss_collocation_from_rest_does_not_stumble() -> None:
    """Its first steps fail before any row, with nothing to compare their growth with."""
    fresnel = next(problem for problem in problems() if problem.name == "fresnel")
    found = METHODS["gauss-1"].solve(fresnel.scene, [3.0], 1e-6)
    assert found.ended == "complete"

"""The page of a tumbling body without a browser: closed form, digits, addresses, commands."""

import html
import json
import math
import random
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, case_scene, solve
from pyharness.checks.theory.flips import flip_times
from pyharness.edition.body import AGREEMENT, PROGRAM, SPEEDS, context, data, moments_of_box
from pyharness.edition.bundle import bundle
from pyharness.model.extension import extension
from pyharness.truth.free_attitude import free_attitude, is_steady, period_of
from tests.attitude_errors import largest_error
from tests.checks.scenes.free_motions import KINDS, Motion, draw
from tests.conftest import Printed
from tests.exact_attitude import exact
from tests.ports import WEB, run_javascript, with_fault
from tests.tables import tables

BODY = WEB / "body"
IDENTITY = [1.0, 0.0, 0.0, 0.0]
MOTIONS = """return given.map(([moments, omega, time]) => {
  const motion = C.torqueFree(moments, omega);
  const { flipTime } = motion;
  return { ...motion.at(time), flipTime: flipTime < Infinity ? flipTime : null };
});"""


def ask(body: str, given: Any, folder: Path = BODY) -> Any:
    """Return the value of the JavaScript `body`, which may use `given` and the page's modules."""
    files = {"C": "closed-form.js", "D": "digits.js", "S": "state.js"}
    modules = {name: folder / file for name, file in files.items()}
    return run_javascript(modules, body, data=data(), given=given)


def _drawn(count: int) -> list[Motion]:
    """Return random motions of every kind, which begin with the identity, at times up to 1e6 s."""
    found = []
    for kind in KINDS:
        source = random.Random(f"{kind} body page")
        for _ in range(count):
            moments, omega, _, time = draw(source, kind)
            found.append((moments, omega, IDENTITY, time))
    # No random motion is exactly on the separatrix, or closer to it than rounding allows. The
    # solutions of x**2 - 2 y**2 = 1 or -1 are: the distance is 1/x**2. The moments have 40 bits.
    found.append(([4.0, 6.5, 9.0], [3.0, 1.0, -2.0], IDENTITY, 3.0))
    x, y, part = 1, 1, 0x9E3779B97F / 2**40
    while x < 2**51:
        x, y = x + 2 * y, x + y
        unit = 2.0 ** -x.bit_length()
        moments = [2.0 * part, 3.0 * part, 4.0 * part]
        found.append((moments, [x * unit, 0.3, y * unit], IDENTITY, 150.0))
    return found


def _differences(motions: list[Motion], folder: Path = BODY) -> list[float]:
    """Return the largest difference of each motion; for omega, relative to the largest omega."""
    answers = ask(MOTIONS, [(moments, omega, time) for moments, omega, _, time in motions], folder)
    found = []
    for (moments, omega, attitude, time), answer in zip(motions, answers, strict=True):
        solution = extension().torque_free_attitude_solution(moments, omega, attitude, [time])
        rows, attitudes, n_rows, status = solution
        assert (n_rows, status) == (1, 0)
        largest = max(*map(abs, omega), *np.abs(rows[:, 0])) or 1.0
        turned = np.abs(np.array(answer["attitude"], float) - attitudes[:, 0]).max()
        moved = np.abs(np.array(answer["omega"], float) - rows[:, 0]).max() / largest
        found.append(float(max(turned, moved)))
    return found


def test_the_closed_form_is_that_of_fortran_to_a_few_units_in_the_last_place() -> None:
    """The bound depends neither on the time nor on the error amplification."""
    found = _differences(_drawn(60))
    assert len(found) > 600
    assert max(found) <= AGREEMENT
    assert np.median(found) <= 2.0**-53


@pytest.mark.campaign
def test_the_closed_form_is_true() -> None:
    """Compare with decimal and with integer arithmetic; neither uses a theta function."""
    source = random.Random(1982)
    motions = [draw(source, kind) for kind in KINDS if kind != "near symmetry"]
    asked = [(moments, omega, time) for moments, omega, _, time in motions]
    bodies = {each["id"]: each for each in data()["bodies"]}
    for name in ("case-4", "racket"):
        asked += [(bodies[name]["moments"], bodies[name]["omega"], t) for t in (1.0, 1e3, 1e6)]
    for (moments, omega, time), answer in zip(asked, ask(MOTIONS, asked), strict=True):
        true_omega, true_attitude = exact(moments, omega, IDENTITY, time)
        largest = max(map(abs, omega))
        assert largest_error(np.array(answer["omega"]), true_omega) <= AGREEMENT * largest
        assert largest_error(np.array(answer["attitude"]), true_attitude) <= AGREEMENT
        if abs(time) in (1.0, 1e3, 1e6):
            scene = Scene("", omega, moments=moments, attitude=tuple(IDENTITY))
            decimal = np.array([float(x) for x in free_attitude(scene, time)])
            assert np.abs(np.array(answer["attitude"]) - decimal).max() <= AGREEMENT


# Passages of the modules, and faults that are planted in them.
FAULTS = tables(__file__)["faults"]


@pytest.mark.sampled
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_closed_form_is_found(fault: str, tmp_path: Path) -> None:
    name, here, planted = FAULTS[fault]
    web = with_fault(tmp_path, f"body/{name}", here, planted)
    assert max(_differences(_drawn(40), web / "body")) > AGREEMENT


def test_flips_are_those_of_the_theory() -> None:
    motions = [(moments, omega, 0.0) for moments, omega, _, _ in _drawn(10)]
    answers = ask(MOTIONS, motions)
    seen = 0
    for (moments, omega, _), answer in zip(motions, answers, strict=True):
        scene = Scene("", omega, moments=moments)
        period = None if is_steady(scene) else period_of(scene)
        if period is None:
            assert answer["flipTime"] is None
            continue
        assert answer["flipTime"] == pytest.approx(float(period) / 2.0, rel=1e-14)
        seen += 1
    assert seen > 60
    body = """return given.map(({ moments, omega }) => {
      const motion = C.torqueFree(moments, omega);
      const first = motion.flipAfter(0);
      const times = [first, motion.flipAfter(first), motion.flipAfter(motion.flipAfter(first))];
      return [times, times.map((t) => motion.at(t).omega[motion.axes[1]]), motion.flipTime];
    });"""
    bodies = [each for each in data()["bodies"] if each["id"] in ("case-3", "case-4", "racket")]
    for each, (times, middle, flip) in zip(bodies, ask(body, bodies), strict=True):
        due = float(flip_times(each["moments"], each["omega"])[0])
        assert flip == pytest.approx(due, rel=1e-14)
        assert np.diff(times) == pytest.approx([flip, flip], rel=1e-12)
        assert np.abs(middle).max() < 1e-12 * max(map(abs, each["omega"]))


def test_digits_are_what_the_amplification_leaves() -> None:
    """That of `solve` is the largest from any earlier time, and the page has that from time 0."""
    body = """return given.map(([moments, omega, time]) =>
      D.amplification(moments, omega)(time));"""
    given = [(each["moments"], each["omega"]) for each in data()["bodies"]]
    motions = [(list(m), list(w), time) for m, w in given for time in (1.0, 1e2, 1e4, 1e6)]
    for (moments, omega, time), found in zip(motions, ask(body, motions), strict=True):
        rows, turned = [], []
        size = max(map(abs, omega))
        step = 2.0**-40 * size
        for axis in range(-1, 3):
            beside = [w + step * (axis == n) for n, w in enumerate(omega)]
            found_ = extension().torque_free_attitude_solution(moments, beside, IDENTITY, [time])
            rows.append(found_[0][:, 0])
            turned.append(found_[1][:, 0])
        growth = np.abs(np.array(rows[1:]) - rows[0]).sum(axis=0).max() / step
        angle = 2.0 * np.linalg.norm(np.array(turned[1:]) - turned[0], axis=1).sum() * size / step
        assert found["growth"] == pytest.approx(max(1.0, growth), rel=0.1)
        assert found["angle"] == pytest.approx(angle, rel=0.1)
        largest: Any = solve(Scene("", omega, moments=moments), [time], "closed-form").growth
        assert found["growth"] < 1.2 * largest
        digits = -np.log10(2.0**-53 * np.array([found["growth"], max(1.0, found["angle"])]))
        assert found["digits"] == pytest.approx(digits)
    rest = ask("return D.amplification([1, 1, 1], [0, 0, 0])(7);", None)
    assert rest["digits"] == pytest.approx([53 * math.log10(2.0)] * 2)


def test_an_address_restores_its_state() -> None:
    source = random.Random(29)
    states = [
        {"moments": [3.0, 2.0, source.uniform(1.0, 5.0)], "time": source.uniform(0.0, 1e6),
         "omega0": [source.gauss(0.0, 1.0), 0, -source.random()]}
        for _ in range(40)
    ]  # fmt: skip
    states += [
        {"moments": list(each["moments"]), "omega0": list(each["omega"]), "time": 0}
        for each in data()["bodies"]
    ]
    body = """return given.map((state) => {
      const words = S.fragmentOf(data, state);
      return [words, S.stateFrom(data, `#${words}`)];
    });"""
    for state, (words, again) in zip(states, ask(body, states), strict=True):
        assert again == {"state": state, "problems": []}
        assert words.startswith("moments=" if state["time"] else "body=")
    (default,) = ask("return [S.stateFrom(data, '').state];", None)
    assert default["moments"] == list(context()["first"].moments)


# What is wrong in an address, and the beginning of the line that says so.
_WRONG = {
    "body=brick": "body: unknown 'brick'; allowed: racket, cube, case-2, case-3, case-4",
    "body": "body: unknown ''; allowed: racket",
    "moments=1,2": "moments: 2 numbers; allowed: three, as in 40,30,20",
    "moments=1,2,x": "moments: 'x' where a number belongs",
    "moments=1,2,4": "moments: 1 + 2 is less than 4; each moment is at most the sum",
    "moments=0,1,1": "moments: 0; allowed: numbers from 0.000001 to 1000000",
    "moments=1,1,1e7": "moments: 10000000; allowed: numbers from",
    "moments=1,1,-1": "moments: -1; allowed: numbers from",
    "omega0=1,2,1e999": "omega0: '1e999' is not finite; allowed: finite numbers",
    "omega0=1,2,1e-12": "omega0: 1e-12; allowed: 0, or numbers from 1e-9 to 1000",
    "omega0=0x10,1,1": "omega0: '0x10' where a number belongs",
    "omega0=1;2;3": "omega0: 1 numbers; allowed: three",
    "time=-1": "time: -1; allowed: a number from 0 to 1000000",
    "time=1000001": "time: 1000001; allowed: a number from 0 to 1000000",
    "time=": "time: '' where a number belongs",
    "spin=3": "unknown word 'spin'; allowed: body, moments, omega0, time",
    "%zz=%": "unknown word '%zz'",
    "time=" + "9" * 500 + "x": "time: '99999",
}


def test_what_an_address_has_wrong_is_told_in_a_line() -> None:
    body = """return given.map((words) => {
      const { state, problems } = S.stateFrom(data, words);
      return [S.fragmentOf(data, state), problems];
    });"""
    for told, (fragment, (problem,)) in zip(_WRONG.values(), ask(body, list(_WRONG)), strict=True):
        assert problem.startswith(told)
        assert "\n" not in problem
        assert len(problem) < 240
        assert fragment == "body=racket"


def test_every_allowed_body_has_a_motion() -> None:
    """Nothing that the page accepts overflows, underflows or is refused."""
    source = random.Random(7)
    # 0.01 + 0.06 is less than 0.07 in floats.
    motions = [([0.01, 0.06, 0.07], [1.0, 2.0, 3.0], 1.0)]
    for _ in range(400):
        sizes = (10.0 ** source.choice((-6, -3, 0, 5.5)) for _ in range(3))
        moments = sorted(size * source.uniform(1, 1.1) for size in sizes)
        moments[0] = max(moments[0], 1e-6)
        moments[2] = min(moments[2], moments[0] + moments[1])
        omega = [source.choice((0.0, 1e-9, -1e-9, 1.0, 1000.0, -1000.0)) for _ in range(3)]
        source.shuffle(moments)
        motions.append((moments, omega, source.choice((1e-3, 1.0, 1e6))))
    allowed = ask("return given.map(([m]) => S.momentsFrom(String(m)));", motions)
    assert allowed == [moments for moments, _, _ in motions]
    for (moments, omega, time), answer in zip(motions, ask(MOTIONS, motions), strict=True):
        values = [*answer["omega"], *answer["attitude"]]
        assert all(isinstance(x, int | float) and math.isfinite(x) for x in values), (
            moments,
            omega,
        )
        assert sum(x * x for x in answer["attitude"]) == pytest.approx(1.0, abs=1e-14)
        energy = sum(i * w * w for i, w in zip(moments, omega, strict=True))
        after = sum(i * w * w for i, w in zip(moments, answer["omega"], strict=True))
        assert after == pytest.approx(energy, rel=1e-11), (moments, omega, time)


def test_command_agrees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, printed: Printed) -> None:
    monkeypatch.chdir(tmp_path)
    states = [
        "", "body=case-4&time=1000000", "body=case-3&time=0", "body=cube&time=12.5",
        "moments=40,30,20&omega0=-1,2e-3,0.1&time=7.25", "moments=5,4,3&omega0=-1,2,3&time=1e5",
    ]  # fmt: skip
    body = """return given.map((words) => {
      const { state } = S.stateFrom(data, words);
      return [S.commandOf(data, state), C.torqueFree(state.moments, state.omega0).at(state.time)];
    });"""
    for asked, shown in ask(body, states):
        (tmp_path / "body.toml").write_text(asked["file"])
        assert ("--scene body.toml" in asked["command"]) == (asked["file"] != "")
        command = asked["command"].removeprefix("pyharness ")
        trajectory = json.loads(printed(f"{command} --format json"))["trajectory"]
        assert np.abs(np.array(trajectory["omega"][0][-3:]) - shown["omega"]).max() < 1e-13
        assert np.abs(np.array(trajectory["attitude"][0]) - shown["attitude"]).max() <= AGREEMENT


def test_the_program_prints_what_the_page_has(built_site: dict[str, bytes]) -> None:
    page = html.unescape(built_site["body.html"].decode())
    program, output = (
        re.findall(f'<code id="{name}">(.*?)</code>', page, re.DOTALL)[0]
        for name in ("program", "output")
    )
    assert program == PROGRAM
    assert len([line for line in PROGRAM.splitlines() if line]) == 5
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert output == done.stdout.decode()


def test_the_data_are_those_of_the_cases() -> None:
    given = json.loads(json.dumps(data(), allow_nan=False))
    assert [each["case"] for each in given["bodies"] if each["case"]] == [2, 3, 4]
    for each in given["bodies"]:
        low, middle, high = sorted(each["moments"])
        assert high <= low + middle
        if each["case"]:
            assert tuple(each["omega"]) == case_scene(each["case"]).omega
            assert f"Case {each['case']}" in each["title"]
    assert moments_of_box([1.0, 2.0, 3.0], 12.0) == [13.0, 10.0, 5.0]
    # The plate is spun about its middle axis.
    racket = given["bodies"][0]
    assert np.argmax(np.abs(racket["omega"])) == np.argsort(racket["moments"])[1] == 1
    assert 1 in SPEEDS
    # The scripts are small: readers see them.
    assert len(bundle(BODY / "body.js")) < 42_000
    for file in (*BODY.glob("*.js"), *(WEB / "laboratory").glob("*.js")):
        assert len(file.read_text().splitlines()) < 300, file.name


def test_the_page_without_script_has_picture_and_numbers(built_site: dict[str, bytes]) -> None:
    page = " ".join(built_site["body.html"].decode().split())
    assert built_site["figures/body.svg"].startswith(b"<?xml")
    rows = built_site["figures/body.csv"].decode().splitlines()
    numbers = np.genfromtxt(rows, delimiter=",", skip_header=1)
    scene, flip = (context()[name] for name in ("first", "flip"))
    assert f"every {flip:.2f} s" in page
    assert f"every {float(flip_times((40, 30, 20), (0, 1, 10))[0]):.3f} s" in page
    assert f"less than {AGREEMENT} of" in page
    # Three flips: omega about axis 2 changes its sign three times.
    assert numbers[-1, 0] == pytest.approx(3.0 * flip)
    assert (np.diff(np.sign(numbers[:, 2])) != 0).sum() == 3
    found = solve(scene, [float(numbers[100, 0])], "closed-form")
    assert found.omega[0] == pytest.approx(numbers[100, 1:4], rel=1e-12)

"""The campaign's truth against the reference, and the campaign on a small scale."""

import csv
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, solve
from pyharness.model.attitude import product
from pyharness.model.report import short
from pyharness.model.trajectory import Trajectory
from pyharness.scenes.rotated import restarted_at
from pyharness.truth.free_attitude import free_attitude
from pyharness.truth.reference import reference
from pyharness.views.table import write
from tests.campaigns.estimates import campaign
from tests.campaigns.estimates.campaign import COLUMNS, ENTRANCES, SENSITIVE, Answer, answers, main
from tests.campaigns.estimates.report import report
from tests.campaigns.estimates.scenes import COARSEST, FINEST, KINDS, Draw, drawn
from tests.campaigns.estimates.truth import Truth, compiler_here, truth_of
from tests.scenes.timed_kinds import triple

pytestmark = [
    pytest.mark.external,
    pytest.mark.skipif(not compiler_here(), reason="no compiler"),
]
BODY = (1.0, 2.0, 2.7)
# Every kind of torque at once, including two waves of one frequency.
LAW = TorqueLaw(
    (0.3, -0.2, 0.1),
    (0.01, 0.02, -0.03),
    [((0.5, 0.1, -0.4), 3.0), ((0.2, 0.0, 0.1), -0.7)],
    [((-0.3, 0.6, 0.2), 3.0), ((0.1, 0.1, 0.1), 0.0)],
)
SCENES = {
    "all torques": (Scene("", (1.0, -2.0, 0.5), BODY, torque=LAW), 4.0),
    "backward": (Scene("", (1.0, -2.0, 0.5), BODY, torque=LAW), -4.0),
    "no torque": (Scene("", (0.3, 2.0, 0.5), BODY), 9.7),
    "middle axis": (Scene("", (1e-5, 2.0, 1e-6), BODY), 14.1),
    "from rest": (Scene("", (0.0, 0.0, 0.0), BODY, torque=LAW), 3.0),
    "no body": (Scene("", (1.0, 0.2, -0.4), None, (0.7, -1.2, 0.3), LAW), 2.0),
}


def _apart(one: Truth, other: Truth) -> np.ndarray:
    """Return the difference of the last rows: of omega, and of the attitude as a small rotation."""
    omega = (one.omega - other.omega) + (one.remainder - other.remainder)
    if one.attitude is None or other.attitude is None:
        return np.asarray(omega[-1])
    assert one.attitude_remainder is not None
    assert other.attitude_remainder is not None
    difference = (one.attitude - other.attitude) + (
        one.attitude_remainder - other.attitude_remainder
    )
    # Twice the vector part of the other's conjugate times the difference is a small rotation.
    (w, *v), (a, *b) = other.attitude[-1], difference[-1]
    small = 2.0 * (w * np.array(b) - a * np.array(v) - np.cross(v, b))
    return np.concatenate([omega[-1], small])


@pytest.mark.campaign
@pytest.mark.parametrize("name", SCENES)
def test_truth_is_that_of_the_reference(name: str) -> None:
    scene, time = SCENES[name]
    found = truth_of(scene, time)
    known = reference(scene, [time], precise=True)
    assert known.remainder is not None
    apart = (found.omega - known.omega[0]) + (found.remainder - known.remainder[0])
    assert np.abs(apart).max() <= found.doubt * found.largest + known.estimate
    assert found.doubt < 1e-20
    assert found.largest >= np.abs(found.omega).max()


TURNED = (0.3, -0.5, 0.2, 0.7)
MATRIX = ((2.0, 0.3, -0.1), (0.3, 1.5, 0.2), (-0.1, 0.2, 1.1))
JOINT = {
    "body": (Scene("", (1.0, -2.0, 0.5), BODY, torque=LAW, attitude=TURNED), 2.5),
    "space": (
        Scene("", (1.0, -2.0, 0.5), BODY, torque=replace(LAW, frame="space"), attitude=TURNED),
        -2.0,
    ),
    "full inertia": (
        Scene("", (1.0, -2.0, 0.5), inertia=MATRIX, torque=LAW, attitude=TURNED),
        2.0,
    ),
    "full inertia, space": (
        Scene("", (1.0, -2.0, 0.5), inertia=MATRIX, torque=replace(LAW, frame="space")),
        2.0,
    ),
}


@pytest.mark.parametrize("name", JOINT)
def test_truth_with_attitude_is_that_of_the_series(name: str) -> None:
    """Compare with a series of another order and with other steps, about principal axes."""
    scene, time = JOINT[name]
    times = [0.25 * time, time]
    found = truth_of(scene, times, attitude=True)
    known = solve(scene, times, "taylor", 1e-14, attitude=True)
    assert known.attitude is not None
    assert found.error(known.omega) < 2e-14
    assert found.angle(known.attitude) < 2e-14


def test_truth_of_the_attitude_without_torque() -> None:
    scene = Scene("", (0.3, 2.0, 0.5), BODY, attitude=TURNED)
    found = truth_of(scene, 9.7, attitude=True)
    assert found.attitude is not None
    assert found.attitude_remainder is not None
    known = np.array(free_attitude(scene, 9.7))
    apart = [
        abs(Decimal(x) + Decimal(y) - z)
        for x, y, z in zip(found.attitude[0], found.attitude_remainder[0], known, strict=True)
    ]
    assert max(apart) < 1e-27


def test_angle_between_attitudes() -> None:
    found = truth_of(*JOINT["body"], attitude=True)
    assert found.attitude is not None
    w, x, y, z = found.attitude[0]
    half = 5e-9
    turned = np.array([[w - half * z, x + half * y, y - half * x, z + half * w]])
    assert found.angle(turned) == pytest.approx(1e-8, rel=1e-6)
    assert found.angle(-turned) == pytest.approx(1e-8, rel=1e-6)
    assert found.angle(found.attitude) < 1e-15


def _beside(scene: Scene, small: np.ndarray) -> Scene:
    """Return the scene with omega perturbed and the attitude rotated by a small angle."""
    omega = triple(np.array(scene.omega) + small[:3])
    if len(small) == 3:
        return replace(scene, omega=omega)
    assert scene.attitude is not None
    x, y, z = (0.5 * small[3:]).tolist()
    return replace(scene, omega=omega, attitude=product(scene.attitude, (1.0, x, y, z)))


@pytest.mark.sampled
@pytest.mark.parametrize("name", [*SCENES, *JOINT])
def test_growth_is_the_norm_of_the_derivative(name: str) -> None:
    """Perturb the state in every direction at intermediate times."""
    joint = name in JOINT
    scene, time = {**SCENES, **JOINT}[name]
    scene = replace(scene, attitude=scene.attitude or (1.0, 0.0, 0.0, 0.0)) if joint else scene
    whole = truth_of(scene, time, attitude=joint)
    units = np.array([1.0] * 3 + [1.0 / whole.largest] * 3 * joint)
    found, small = 1.0, 2.0**-26
    for part in np.linspace(0.0, 0.98, 17):
        unit = 2.0**-44
        begin = round(float(part * time) / unit) * unit
        at = truth_of(scene, begin, attitude=joint) if part else None
        omega = np.array(scene.omega) if at is None else at.omega[0]
        turned = scene.attitude
        if at is not None and at.attitude is not None:
            a, b, c, d = at.attitude[0].tolist()
            turned = a, b, c, d
        later = replace(restarted_at(scene, omega, begin, turned), attitude=turned)
        columns = []
        for axis, size in enumerate(units):
            step = np.zeros(len(units))
            step[axis] = small * size
            ends = [
                truth_of(_beside(later, sign * step), time - begin, attitude=joint)
                for sign in (1.0, -1.0)
            ]
            columns.append(_apart(*ends) / (2.0 * small * size))
        matrix = np.array(columns).T * units[None, :] / units[:, None]
        found = max(found, float(np.linalg.norm(matrix, 2)))
    assert whole.growth == pytest.approx(found, rel=0.02)


def test_truth_says_what_it_cannot_know() -> None:
    runaway = Scene("", (1.0, 1.0, 1.0), None, (1.0, 1.0, 1.0))
    with pytest.raises(InputError, match="grows without bound"):
        truth_of(runaway, 2.0)
    with pytest.raises(InputError, match="too many steps"):
        truth_of(*SCENES["no torque"], most_steps=10)


def test_turns_of_a_spin() -> None:
    spin = Scene("", (0.0, 0.0, 2.0 * np.pi), BODY)
    found = truth_of(spin, 7.0)
    assert (found.turns, found.largest) == pytest.approx((7.0, 2.0 * np.pi))


def test_number_of_a_seed_is_one_scene() -> None:
    first, again, other = drawn("1", 8), drawn("1", 8, (1e-5,)), drawn("2", 8)
    assert first.scene == again.scene != other.scene
    assert again.tolerance == 1e-5
    assert FINEST <= first.tolerance <= COARSEST


@pytest.mark.campaign
def test_few_dozen_scenes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    asked = ["--scenes", "24", "--seed", "test", "--out", str(tmp_path / "answers.csv")]
    code = main(asked)
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 100
    with (tmp_path / "answers.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [int(row["number"]) for row in rows[:: len(ENTRANCES)]] == list(range(24))
    assert all(set(row["kinds"].split(", ")) <= set(KINDS) for row in rows)
    assert "no faults" in printed
    assert code == 0


_WERE_WRONG = [
    # Cancelling and weak torques in space, long waves, one long step near the middle axis.
    *(("20261", number) for number in (371, 421, 759, 1257, 4379, 5860, 7959, 8937)),
    # A remainder that is small by chance; rows before the last with a larger growth than the last.
    *(("20263", number) for number in (4773, 3755, 2359, 2555)),
    # A full inertia matrix with an attitude, by the closed form.
    *(("20271", number) for number in (34, 3970, 9474)),
]


@pytest.mark.parametrize(("seed", "number"), _WERE_WRONG)
def test_scenes_whose_reported_error_was_wrong(seed: str, number: int) -> None:
    for answer in answers(drawn(seed, number)):
        assert not answer.exceeds, answer
        assert not answer.is_low, answer
        # The other entry points answer for the last time only, where the amplification may be
        # smaller.
        assert not (answer.is_silent and answer.entrance.startswith("solve ")), answer


def test_one_scene_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--only", "3", "--seed", "test", "--tolerances", "1e-6,1e-6"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("complete") == len(ENTRANCES)
    assert "tolerance         1e-06" in printed


def _answer(of: Draw, growth: float, ended: str, error: float) -> Answer:
    truth = replace(of.truth, growth=growth)
    draw = replace(of, truth=truth, tolerance=1e-9, kinds=("all",))
    return Answer(draw, "solve taylor", "taylor", ended, error, growth=growth)


@pytest.mark.parametrize(
    ("growth", "ended", "error", "faults"),
    [
        (1.0, "complete", 1e-9, ""),
        (1.0, "complete", 1.1e-9, "exceeds"),
        (1.0, "overflow", float("inf"), "unfinished"),
        (1e7, "overflow", float("inf"), ""),
        (9e5, "complete", 4e-9, ""),
        (9e5, "complete", 5e-9, "exceeds"),
        (2e6, "complete", 1.0, ""),
        (1e7, "complete", 1e-9, ""),
        (1e7, SENSITIVE, 1e-9, ""),
        (1e8, "complete", 1e-9, "silent"),
        (1e8, SENSITIVE, 1e-9, ""),
        (float("inf"), "complete", 1.0, "silent"),
        (1e5, SENSITIVE, 1e-9, "false alarm"),
    ],
)
def test_faults(growth: float, ended: str, error: float, faults: str) -> None:
    assert campaign.faults(_answer(drawn("test", 0), growth, ended, error)) == [
        *filter(None, [faults])
    ]


@pytest.mark.parametrize(
    ("estimate", "error", "low", "blind"),
    [
        (None, 1e-10, False, False),
        (2e-12, 1e-10, True, False),
        (2e-11, 1e-10, False, False),
        (5e-13, 1e-10, True, True),
        (0.0, 1e-10, True, True),
        (0.0, 2e-16, False, False),
    ],
)
def test_estimates_that_are_too_small(
    estimate: float | None, error: float, low: bool, blind: bool
) -> None:
    found = replace(_answer(drawn("test", 0), 1.0, "complete", error), estimate=estimate)
    assert (found.is_low, found.is_blind) == (low, blind)
    assert campaign.faults(found) == (["blind"] if blind else [])


def test_what_an_answer_says_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    def said(scene: Scene, times: list[float], *given: Any, **more: Any) -> Trajectory:
        found = solve(scene, times, *given, **more)
        return replace(found, error=1e-11, growth=7.0, evaluations=found.steps + 1)

    monkeypatch.setattr(campaign, "solve", said)
    of = drawn("test", 0)
    found = [next(answers(replace(of, truth=replace(of.truth, growth=3.5))))]
    assert (found[0].estimate, found[0].growth, found[0].runs) == (1e-11, 7.0, 2)
    ratio = 1e-11 / max(found[0].error, 2.0**-53)
    lines = [line.split() for line in write(report(found, "test")).splitlines()]
    assert ["solve", "taylor", "1", "1", "0"] in [line[:5] for line in lines]
    assert "100.0" in {line[-1] for line in lines if line}
    said_of_it = [str(1), *[short(ratio)] * 3, str(1), *[short(2.0)] * 5]
    assert ["all", *said_of_it] in lines

"""`verify --integrator`: orders, drifts, known faults, invalid answers, and planted faults."""

import functools
import itertools
import json
import math
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness.checks.check import Name
from pyharness.checks.integrators.faults import FAULTS, motions, true_motion
from pyharness.checks.integrators.judging import Verdict
from pyharness.checks.integrators.plants import PLANTS, self_test
from pyharness.checks.integrators.problem import (
    LEVELS,
    Problem,
    convergence,
    growth_power,
    problems,
)
from pyharness.checks.integrators.protocol import read_motion, request
from pyharness.checks.integrators.recognition import FIRST_ORDER
from pyharness.checks.plants.outcome import CONTROL
from pyharness.checks.port_process import PortError
from pyharness.checks.scenes.random_scenes import MODERATE, draw_moderate
from pyharness.cli.main import main
from pyharness.model.attitude import angle_between
from tests.campaigns import integrator_campaign as campaign
from tests.campaigns.integrator_campaign import METHODS, Drawn, drawn, is_right, right, solve_of
from tests.checks.integrators import (
    FOLDER,
    RK4,
    ROOT,
    command_of,
    edited,
    json_of,
    written,
)  # fmt: skip
from tests.conftest import Capture
from tests.ports import documented_command
from tests.tables import tables


def _faults(record: Any) -> set[str]:
    return {each["name"] for each in record["findings"]}


def test_the_first_of_checks_made_together_has_their_time() -> None:
    found = Verdict("command")
    checks = [Name("integrator", x).judged(True, "") for x in "ab"]
    begin = found.begin
    for _ in range(2):
        found.add("", *checks)
    first, second, third, fourth = (check.took for check in found.checks)
    assert first
    assert third
    assert first + third == pytest.approx(found.begin - begin)
    assert second == fourth == 0.0


@pytest.mark.campaign
def test_a_right_integrator_has_its_order_and_no_fault(capsys: Capture) -> None:
    record = json_of(capsys, command_of(RK4), "--order", "4", "--seed", "right", "--draws", "1")
    assert record["findings"] == []
    names = [each["problem"] for each in record["convergence"][::2]]
    assert names == [f"{kind}-0" for kind in MODERATE]
    for each in record["convergence"]:
        assert each["order"] == pytest.approx(4.0, abs=0.2)
        assert each["control"] == "step_size"
        assert len(each["errors"]) == LEVELS
    checks = {check["id"]: check for check in record["checks"]}
    assert checks["integrator/repeated/free-0"]["value"] == 0.0
    assert checks["integrator/omega/free-0/order"]["reference_bound"]["basis"] == "proved"
    assert 0.0 < checks["integrator/energy/free-0/drift"]["value"] < 1e-4
    assert checks["integrator/return/free-0"]["note"] == "not reversible"
    replay = checks["integrator/norm/free-0"]["replay"]
    assert "--seed right --draws 1 --cell free-0 --order 4" in replay


@pytest.mark.campaign
def test_a_higher_order_than_it_has_is_refused(capsys: Capture) -> None:
    words = ("--order", "5", "--cell", "free-0", "--seed", "a b")
    record = json_of(capsys, command_of(RK4), *words, status=1)
    failed = [check for check in record["checks"] if not check["passed"]]
    assert [check["id"] for check in failed] == [
        "integrator/omega/free-0/order", "integrator/attitude/free-0/order",
    ]  # fmt: skip
    again = json_of(capsys, *shlex.split(failed[0]["replay"])[5:], status=1)["checks"]
    notes = [check["note"] for check in again if not check["passed"]]
    assert notes == [check["note"] for check in failed]


# Changes of a line of the example, and the fault that has to be named.
MISTAKES = tables(__file__)["mistakes"]


@pytest.mark.campaign
@pytest.mark.parametrize(("old", "new", "fault"), MISTAKES)
def test_a_mistake_in_the_source_is_named(
    old: str, new: str, fault: str, tmp_path: Path, capsys: Capture
) -> None:
    command = edited(tmp_path, *zip(old.split("|"), new.split("|"), strict=True))
    remark = fault in FIRST_ORDER
    # Without a scene without torque, the long motion is left out.
    words = (command, "--seed", "mistake", "--cell")
    assert _faults(json_of(capsys, *words, "constant-0,wave-0", status=int(not remark))) == {fault}
    if remark:
        json_of(capsys, *words, "wave-0", "--order", "4", status=1)


PROGRAM = """
import json, sys
from pyharness import Listing, Scene, TorqueLaw, run_program

for line in sys.stdin:
    asked = json.loads(line)
    law = {name: asked["torque"][name] for name in ("constant", "rate")}
    for name in ("sines", "cosines"):
        law[name] = [(wave["amplitude"], wave["frequency"]) for wave in asked["torque"][name]]
    h, times = asked["step_size"], asked["times"]
    scene = Scene("asked", asked["omega"], asked["moments"], torque=TorqueLaw(**law), step_size=h,
                  steps=round(times[-1] / h))
    run = run_program(scene, Listing.LABEL("runge-kutta"), may_stop=False)
    rows = [run.omega[round(t / h) - 1].tolist() for t in times]
    print(json.dumps({"omega": rows}), flush=True)
"""


@pytest.mark.campaign
@pytest.mark.parametrize(("label", "order"), [("original", "1"), ("corrected", "4")])
def test_the_program_of_the_thesis_is_an_integrator(
    label: str, order: str, tmp_path: Path, capsys: Capture
) -> None:
    command = written(tmp_path, PROGRAM.replace("LABEL", label))
    words = (command, "--order", order, "--draws", "1", "--seed", "1982")
    record = json_of(capsys, *words, status=int(label == "original"))
    assert _faults(record) == ({"thesis-runge-kutta"} if label == "original" else set())


@pytest.mark.campaign
def test_a_first_order_splitting_is_named_and_may_refuse_torques(capsys: Capture) -> None:
    command = command_of(Path(__file__).with_name("splitting.py"))
    record = json_of(capsys, command, "--seed", "s", "--draws", "1")
    assert _faults(record) == {"first-order-splitting"}
    checks = {check["id"]: check for check in record["checks"]}
    assert checks["integrator/constant-0"]["note"] == "refused: a torque"
    assert json_of(capsys, command, "--seed", "s", "--draws", "1", "--order", "2", status=1)


def test_rounding_errors_are_not_named_first_order() -> None:
    """Binary32 that an integrator does not declare had the order 1 in one pair by chance."""
    steps = [0.5 / 2.0**level for level in range(LEVELS)]
    noise = [1e-2, 6e-4, 4e-5, 2e-6, 6e-7, 4e-7, 1.2e-6, 6e-7]
    assert not convergence("omega", steps, noise, 1e-12, False).is_first
    assert convergence("omega", steps, steps, 1e-12, False).is_first


@pytest.mark.campaign
def test_two_faults_at_once_are_named(tmp_path: Path, capsys: Capture) -> None:
    command = edited(
        tmp_path, ("(i2 - i3)", "(i3 - i2)"), ("(i3 - i1)", "(i1 - i3)"),
        ("(i1 - i2)", "(i2 - i1)"), ("[y[3:] for", "[[y[3], -y[4], -y[5], -y[6]] for"),
    )  # fmt: skip
    record = json_of(capsys, command, "--draws", "1", "--seed", "two", status=1)
    assert _faults(record) == {"gyroscopic-sign", "quaternion-transposed"}


@pytest.mark.campaign
def test_every_planted_fault_is_named() -> None:
    found = list(self_test(command_of(RK4), problems("plants", 1), []))
    assert [each.name for each in found] == [CONTROL, *(plant.name for plant in PLANTS)]
    for each in found:
        assert each.has_effect
        assert each.passed, each
    known = {each.name for each in FAULTS} | FIRST_ORDER.keys()
    assert {each.name for each in PLANTS} <= known


@pytest.mark.campaign
def test_the_self_test_fails_for_a_faulty_integrator(tmp_path: Path, capsys: Capture) -> None:
    command = edited(tmp_path, ("0.5 * (-b", "0.6 * (-b"))
    words = ["verify", "--integrator", command, "--self-test", "--cell", "free-0"]
    assert main([*words, "--seed", "x"]) == 1
    assert "FAILED none" in capsys.readouterr().out


@pytest.mark.campaign
def test_drawn_integrators_have_the_right_verdict() -> None:
    chosen = problems("drawn", 1, ["free", "wave"])
    for each in [*right("drawn"), *(drawn(kind, "drawn", 0) for kind in campaign.KINDS)]:
        found = campaign.judged(each, chosen)
        assert is_right(each, found), (each.says, campaign.named(found))


@pytest.mark.sampled
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("last", "seconds", "failed"),
    [("nan", 100.0, "finite/long"), ("1e200", 100.0, "conserved/long"),
     ("0", 100.0, "conserved/long"), ("nan", 4.0, "finite/free-0")],
)  # fmt: skip
def test_a_late_failure_is_noticed(last: str, seconds: float, failed: str) -> None:
    solve = next(right("late")).solve

    def late(asked: dict[str, Any]) -> dict[str, Any]:
        answer = solve(asked)
        for row, time in enumerate(asked["times"]):
            if time > seconds:
                answer["omega"][row] = [last] * 3
        return answer

    found = campaign.judged(Drawn("late", late, "unknown"), problems("late", 1, ["free"]))
    assert f"integrator/{failed}" in {check.id for check in found.checks if not check.passed}
    assert campaign.named(found) == {"unknown"}


@pytest.mark.sampled
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("axis", [1, 2, 3])
def test_the_sign_of_one_gyroscopic_term_is_named_where_the_motion_is_finite(axis: int) -> None:
    """It was named gyroscopic-missing where the answer overflows, and moments-213 elsewhere."""
    wrong = Drawn("", solve_of((f"(n{axis} +", f"(n{axis} -")), f"gyroscopic-sign-{axis}")
    found = campaign.judged(wrong, problems("a", 1, ["free", "wave"]))
    assert campaign.named(found) == {wrong.fault}


LIMITS = tables(__file__)["limits"]


@functools.cache
def _short(kind: str) -> Problem:
    (drawn,) = problems("limits", 1, [kind])
    return Problem(replace(drawn.scene, steps=4))


@pytest.mark.parametrize(
    ("kind", "old", "new"), [x[1:] for x in LIMITS], ids=[x[0] for x in LIMITS]
)
def test_a_limit_of_an_engine_is_found(kind: str, old: str, new: str) -> None:
    wrong = Drawn("", solve_of((old, new)), "unknown")
    assert not all(check.passed for check in campaign.judged(wrong, [_short(kind)]).checks)


@pytest.mark.parametrize("kind", ["mixed", "fast", "slow"])
def test_a_right_integrator_passes_in_wide_ranges(kind: str) -> None:
    integrator = next(right("wide"))
    assert is_right(integrator, campaign.judged(integrator, [_short(kind)]))


def test_a_method_of_first_order_is_named() -> None:
    euler = Drawn("", solve_of((METHODS[0][1], METHODS[-1][1])), "first-order", 1.0)
    chosen = problems("named", 1, ["constant"])
    assert "first-order" in campaign.named(campaign.judged(euler, chosen))


@pytest.mark.campaign
def test_an_explicit_method_of_order_1_may_drift() -> None:
    """With steps of 1/32 s, it overflows in this scene within 512 s."""
    euler = Drawn("", solve_of((METHODS[0][1], METHODS[-1][1])), "", 1.0)
    found: Any = campaign.judged(euler, problems("1/26", 1, ["free"]))
    assert all(check.passed for check in found.checks)
    assert 1e-2 < found.drift.named["energy"][-1] < 10.0


def test_a_missing_attitude_in_some_answers_is_invalid() -> None:
    solve = next(right("some")).solve
    some = Drawn("", lambda asked: {
        **solve(asked), **({"attitude": None} if asked["step_size"] == 0.25 else {})
    }, "unknown")  # fmt: skip
    (check,) = campaign.judged(some, problems("some", 1, ["free"])).checks
    assert check.note == "only some of the answers in a scene have an attitude"


# A body of an answer in Python, and words of the one line that the checks report.
ANSWERS = tables(__file__)["answers"]


@pytest.mark.sampled
@pytest.mark.parametrize(("body", "message"), ANSWERS)
def test_an_invalid_answer_is_a_line(
    body: str, message: str, tmp_path: Path, capsys: Capture
) -> None:
    command = written(tmp_path, f"import json, math, sys\nfor line in sys.stdin:\n    {body}\n")
    (check,) = json_of(capsys, command, "--draws", "1", status=1)["checks"]
    assert check["id"] == "integrator/free-0"
    assert message in check["note"]
    assert "\n" not in check["note"]


def test_an_integrator_that_refuses_everything_does_not_pass(
    tmp_path: Path, capsys: Capture
) -> None:
    body = 'for _ in open(0):\n    print(\'{"refused": "never"}\', flush=True)\n'
    command = written(tmp_path, body)
    record = json_of(capsys, command, "--draws", "1", status=1)
    (failed,) = [check for check in record["checks"] if not check["passed"]]
    assert failed["note"] == "the integrator refused every scene"
    assert main(["verify", "--integrator", command, "--self-test", "--draws", "1"]) == 1


@pytest.mark.campaign
@pytest.mark.parametrize("more", [[], ["--self-test"]])
def test_a_port_is_sent_to_its_option(more: list[str], capsys: Capture) -> None:
    assert main(["verify", "--integrator", documented_command(), "--draws", "1", *more]) == 2
    assert "--port" in capsys.readouterr().err


def test_numbers_that_are_not_finite_are_an_error(tmp_path: Path, capsys: Capture) -> None:
    command = edited(tmp_path, ("[y[:3] for y in rows]", '[[float("nan")] * 3 for _ in rows]'))
    record = json_of(capsys, command, "--cell", "free-0", "--seed", "n", status=1)
    assert record["convergence"][0]["errors"] == [None] * LEVELS
    failed = {check["id"] for check in record["checks"] if not check["passed"]}
    assert "integrator/omega/free-0/order" in failed


def test_an_integrator_that_forgets_its_request_is_noticed(tmp_path: Path, capsys: Capture) -> None:
    command = edited(
        tmp_path, ("for line in sys.stdin:", "COUNT = 0\nfor line in sys.stdin:"),
        ("    print(json.dumps(answer), flush=True)",
         "    COUNT += 1\n    row = answer['omega'][0]\n"
         "    row[0] = float(row[0]) + COUNT * 1e-15\n"
         "    print(json.dumps(answer), flush=True)"),
    )  # fmt: skip
    record = json_of(capsys, command, "--cell", "free-0", "--seed", "r", status=1)
    checks = {check["id"]: check for check in record["checks"]}
    assert checks["integrator/repeated/free-0"]["value"] == 1.0


@pytest.mark.campaign
def test_single_precision_and_no_attitude(tmp_path: Path, capsys: Capture) -> None:
    single = (
        'return {"omega": [y[:3] for y in rows], "attitude": [y[3:] for y in rows]}',
        'import struct\n    single = lambda x: struct.unpack("f", struct.pack("f", x))[0]\n'
        '    return {"omega": [[single(x) for x in y[:3]] for y in rows]}',
    )
    named = ("json.dumps(answer)", 'json.dumps({**answer, "precision": "binary32"})')
    words = ("--draws", "1", "--seed", "single", "--order", "4")
    record = json_of(capsys, edited(tmp_path, single, named), *words)
    assert {each["part"] for each in record["convergence"]} == {"omega"}
    # In binary64 the same errors are those of a method that ceases to converge.
    json_of(capsys, edited(tmp_path, single), *words, status=1)


@pytest.mark.campaign
def test_pictures_and_reports_are_written(tmp_path: Path, capsys: Capture) -> None:
    picture, page = tmp_path / "i.svg", tmp_path / "page.md"
    words = ["verify", "--integrator", command_of(RK4), "--cell", "free-0", "--seed", "p"]
    assert main([*words, "--plot", str(picture), "--also", str(page)]) == 0
    assert picture.read_text().count("<path") > 10
    rows = picture.with_suffix(".csv").read_text().splitlines()
    assert rows[0] == "problem,quantity,setting_or_time,value"
    assert len(rows) == 1 + 2 * LEVELS + 3 * 64
    assert "no known fault was recognised" in page.read_text()
    assert "order of omega" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["free", "constant", "wave"])
def test_known_motions_differ_from_the_true_one_and_from_each_other(kind: str) -> None:
    """Faults whose motions are equal could not be told apart."""
    scene = draw_moderate("apart", kind, 0)
    times = np.arange(1.0, 7.0)
    true = true_motion(scene, times)
    found = [("true", true), *((f.name, s) for f, s in motions(scene, times, 0.25))]
    apart = {}
    for k, (name, one) in enumerate(found):
        for other, two in found[:k]:
            omega = float(np.abs(one.omega - two.omega).max())
            apart[other, name] = max(omega, float(angle_between(one.attitude, two.attitude).max()))
    close = {pair for pair, distance in apart.items() if distance < 1e-2}
    # A constant torque does not change.
    assert close == ({("true", "torque-frozen")} if kind == "constant" else set())
    names = {name for name, _ in found[1:]}
    missing = {each.name for each in FAULTS} - names
    parts = {f"torque-{part}-missing" for part in ("rate", "sines", "cosines")}
    torques = {each.name for each in FAULTS if each.name.startswith("torque")}
    assert missing == {"free": torques, "constant": parts, "wave": set()}[kind]


def test_scenes_are_bodies_that_can_be() -> None:
    for kind, number in itertools.product(MODERATE, range(20)):
        scene = draw_moderate("bodies", kind, number)
        assert not scene.is_impossible
        a, b, c = sorted(scene.moments or ())
        assert b > 1.05 * a
        assert c > (1.05 * b if kind in ("free", "constant", "wave") else b + 0.05 * a)
        assert scene.torque.is_zero == (kind == "free")


def test_orders_of_synthetic_errors() -> None:
    steps = [0.5**k for k in range(6)]
    third = convergence("omega", steps, [h**3 for h in steps], 1e-9, False)
    assert third.order == pytest.approx(3.0)
    assert convergence("omega", steps, [max(h**3, 1e-3) for h in steps], 1e-9, False).order == 0.0
    assert convergence("omega", steps, [1e-15] * 6, 1e-12, False).order is None
    assert convergence("omega", steps, [math.inf] * 6, 1e-12, False).order == 0.0
    late = convergence("omega", steps, [math.inf, math.inf, *[h**2 for h in steps[2:]]], 1e-9, True)
    assert late.order == pytest.approx(2.0)
    tolerances = [10.0**-k for k in range(3, 9)]
    even = convergence("omega", tolerances, [3 * x for x in tolerances], 1e-12, True)
    assert even.order == pytest.approx(1.0)
    floor = convergence("omega", tolerances, [max(x, 1e-6) for x in tolerances], 1e-12, True)
    assert floor.order == pytest.approx(1.0 / 3.0)


def test_growth_of_synthetic_drifts() -> None:
    times = np.arange(1.0, 65.0)
    assert growth_power(times, 1e-9 * times) == pytest.approx(1.0)
    assert growth_power(times, 1e-9 * np.ones(64)) == 0.0
    assert growth_power(times, np.zeros(64)) is None
    assert growth_power(times, np.where(times > 60.0, np.inf, times)) is None


def test_a_request_has_what_the_guide_says() -> None:
    asked = json.loads(request(draw_moderate("request", "wave", 0), [1.0, 2.0], 0.5, 1e-6))
    guide = (ROOT / "docs/how-to/integrators.md").read_text()
    for field in asked:
        assert f"| `{field}` |" in guide
    for each in FAULTS:
        assert f"`{each.name}`" in guide or each.name.startswith("moments-")
    for name in FIRST_ORDER:
        assert f"`{name}`" in guide
    with pytest.raises(PortError, match="2 times were requested"):
        read_motion(b'{"omega": [[1, 2, 3]]}', 2)


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.parametrize(("words", "order"), [("RK45 fixed", 5), ("DOP853 fixed", 8), ("LSODA", 1)])
def test_integrators_of_scipy_have_their_orders(words: str, order: int, capsys: Capture) -> None:
    command = f"{command_of(FOLDER / 'scipy_ivp.py')} {words}"
    record = json_of(capsys, command, "--draws", "1", "--seed", "scipy", "--order", str(order))
    assert record["findings"] == []
    assert any(each["order"] is not None for each in record["convergence"])


@pytest.mark.external
@pytest.mark.parametrize(
    ("package", "words", "faults"),
    [("heyoka", "heyoka_taylor.py", set()),
     ("mujoco", "mujoco_body.py Euler", {"first-order"}),
     ("mujoco", "mujoco_body.py RK4", set())],
)  # fmt: skip
def test_other_integrators(package: str, words: str, faults: set[str], capsys: Capture) -> None:
    pytest.importorskip(package)
    name, *rest = words.split()
    command = shlex.join([sys.executable, str(FOLDER / name), *rest])
    assert _faults(json_of(capsys, command, "--draws", "1", "--seed", "others")) == faults

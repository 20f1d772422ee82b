"""The certificates of the documents are checked without a library, and prove the page's results."""

import json
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.certificates import page
from docs.certificates.write import DIGITS, HERE, TIMES, Planned, planned
from pyharness.history.claims.laboratory import Laboratory, distance
from pyharness.history.limits import limit_solution
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.truth import certificate_checker
from pyharness.truth.enclosed import Balls
from pyharness.truth.reference import reference

PLANNED = planned()
LARGEST, TOGETHER = 200_000, 700_000  # bytes


def _check(*files: Path) -> "subprocess.CompletedProcess[str]":
    """Run the checker as a program that finds neither this package nor a library."""
    command = [sys.executable, "-I", "-S", certificate_checker.__file__, *map(str, files)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.campaign
def test_the_checker_verifies_all_certificates() -> None:
    files = sorted(HERE.glob("*.json"))
    assert {each.name for each in files} == {each.name for each in PLANNED}
    done = _check(*files)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count(": proved, ") == len(files)


def test_certificates_are_small() -> None:
    sizes = [each.stat().st_size for each in HERE.glob("*.json")]
    assert max(sizes) <= LARGEST
    assert sum(sizes) <= TOGETHER


def test_a_changed_certificate_fails(tmp_path: Path) -> None:
    certificate = json.loads((HERE / "case-3-from-0-1-1.json").read_text())
    certificate["rows"][0]["omega"][0] += "1"
    certificate["rows"][0]["radius"] = 1e-40
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(certificate))
    done = _check(path)
    assert done.returncode == 1
    assert "does not contain the solution" in done.stdout


@pytest.mark.parametrize("each", PLANNED, ids=lambda each: each.name)
def test_certificates_state_their_scenes_and_times(each: Planned) -> None:
    certificate = json.loads((HERE / each.name).read_text())
    record: dict[str, Any] = certificate["scene"]
    law = each.scene.law
    assert record["moments"] == list(each.scene.moments or ())
    assert record["omega"] == list(each.scene.omega)
    torque = {key: getattr(law, key) for key in ("constant", "rate", "sines", "cosines")}
    assert record["torque"] == json.loads(json.dumps(torque))
    assert [row["time"] for row in certificate["rows"]] == list(each.times)
    for row in certificate["rows"]:
        # The radius is relative to omega where that exceeds 1 rad/s.
        size = max(1.0, *(abs(float(x)) for x in row["omega"]))
        assert row["radius"] <= 1.01 * 10.0**-DIGITS * size


@pytest.mark.parametrize("name", ["case-2.json", "case-6-from-1-1-1.json"])
def test_the_command_makes_the_same_bytes(name: str) -> None:
    (each,) = (each for each in PLANNED if each.name == name)
    assert each.text() == (HERE / name).read_text()


@pytest.mark.sampled
@pytest.mark.parametrize("each", PLANNED, ids=lambda each: each.name)
def test_the_reference_is_within_its_error_of_proved_rows(each: Planned) -> None:
    found: Any = reference(each.scene, each.times, precise=True)
    proved = page.proved_rows(each.name)
    for n, time in enumerate(each.times):
        middle, radius = proved[time]
        for x, high, low in zip(middle, found.omega[n], found.remainder[n], strict=True):
            assert abs(Fraction(float(high)) - x) <= Fraction(found.error) + radius
            # The remainder is a binary64 number, too.
            rounding = Fraction(abs(float(low))) / 2**52
            whole = Fraction(float(high)) + Fraction(float(low))
            assert abs(whole - x) <= Fraction(found.estimate) + radius + rounding


@pytest.mark.campaign
def test_the_order_of_the_programs_is_proved() -> None:
    """As printed, both collocation errors are the smaller ones; as corrected, the larger ones."""
    original, corrected = page.errors(True), page.errors(False)
    for case in page.JUDGED:
        *collocation, third = original[case][1]
        assert all(high < third[0] for _, high in collocation)
        *collocation, third = corrected[case][1]
        assert all(low > third[1] for low, _ in collocation)


@pytest.mark.campaign
@pytest.mark.parametrize("original", [True, False])
def test_proved_errors_are_those_of_the_verdict(original: bool) -> None:
    """The verdict compares with the reference, whose rounding is the difference."""
    lab = Laboratory(original)
    for case, (common, bounds) in page.errors(original).items():
        runs = [lab.run(program, case) for program in PROGRAMS]
        assert common == min(run.steps for run in runs)
        truth = lab.truth(case)
        for run, (low, high) in zip(runs, bounds, strict=True):
            error = distance(run.omega[:common], truth.omega)
            # The subtraction has a rounding error, too.
            spare = truth.error + 2.0**-53 * error
            assert float(low) - spare <= error <= float(high) + spare


@pytest.mark.campaign
def test_proved_limits_are_those_of_the_original_program() -> None:
    rows = {(case, time): row for case, time, row in page.limit_rows()}
    assert {case for case, _ in rows} == set(case_numbers()) - {7}
    for case in sorted({case for case, _ in rows}):
        scene = case_scene(case)
        found, *_ = limit_solution("runge-kutta", scene, TIMES, reference(scene, TIMES))
        wanted = [[float(x) for x in rows[case, time].middle] for time in TIMES]
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("number", "low", "high"),
    [(Fraction(1, 3), "0.3333", "0.3334"), (Fraction(2, 30_000), "6.666e-5", "6.667e-5"),
     (Fraction(3, 2), "1.5", "1.5"), (Fraction(0), "0", "0")],
)  # fmt: skip
def test_bounds_are_rounded_outward(number: Fraction, low: str, high: str) -> None:
    assert (page.rounded(number, False), page.rounded(number, True)) == (low, high)


def test_an_error_has_bounds() -> None:
    """Case 1 has the solution 1 + 2.5 t; the radius of a proved row widens the interval."""
    run = Laboratory(False).run("runge-kutta", 1)
    last = run.steps - 1
    low, high = page.error_bounds(run, 1, [last])
    error = max(abs(Fraction(float(x)) - Fraction(7, 2)) for x in run.omega[last])
    balls: Balls = page.proved_rows("case-1.json")[1.0]
    assert low <= error <= high
    assert high - low <= 2 * balls.radius

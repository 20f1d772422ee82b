"""`verify`: the checks it makes, that each of them can fail, and the output that a user sees."""

import datetime
import json
import math
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, Trajectory, solve
from pyharness.checks import cells as verify_programs
from pyharness.checks.check import BITS, DRAWS, RECORD, Check, Name, Selection, selected
from pyharness.checks.compare.orders import Order, State
from pyharness.checks.golden import mathematics, read_record, recorded, update
from pyharness.checks.judge import Answer, MethodRun
from pyharness.checks.kinds import KINDS, verify
from pyharness.checks.methods import judged_order
from pyharness.checks.plants import plants
from pyharness.checks.plants.plants import PLANTS
from pyharness.checks.random_methods import may_refuse, truth_of
from pyharness.checks.scenes.random_scenes import draw, weekly_seed
from pyharness.cli.main import main
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.system import kernel_input as problem
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis import compiled
from pyharness.thesis.cells import all_cells, cell_name
from pyharness.thesis.programs import PROGRAM_REGISTRY, Program
from tests.conftest import Capture, ResultOf

BY_NAME = {plant.name: plant for plant in PLANTS}
ONE_BIT = BY_NAME["ulp-in-fortran"]


def test_every_cell_has_a_name_of_its_own() -> None:
    names = {cell_name(listing, case) for listing, case in all_cells()}
    assert len(names) == len(list(all_cells()))
    assert len(names) == (16 * 2 + 8 + 128 * 2) * 8, (
        "a new defect, reading or conjecture changes this number, and that in "
        "docs/contributing/testing.md"
    )


@pytest.mark.campaign
def test_checks_have_names_of_their_own_and_all_pass() -> None:
    """Make a part of the checks; `verify` itself makes all of them."""
    checks = list(verify(Selection(seed="fixed", draws=4, thin=True)))
    assert [check.id for check in checks if not check.passed] == []
    assert len({check.id for check in checks}) == len(checks)
    assert {check.suite for check in checks} == set(KINDS)


def test_limit_is_not_passed_by_nan() -> None:
    for value, limit, passed in ((math.nan, math.inf, False), (2.0, 1.0, False), (1.0, 1.0, True)):
        assert Name("").bounded(value, limit, BITS).passed == passed


def test_selection_is_by_whole_parts() -> None:
    assert selected("cells/two-term/case-3", ["cells/two-term"])
    assert not selected("cells/two-term/case-30", ["cells/two-term/case-3"])
    assert selected("cells", [])


@pytest.mark.campaign
def test_json_is_as_agreed(capsys: Capture) -> None:
    assert main(["verify", "--format", "json", "--only", "cells/two-term/case-3,orders/rk4"]) == 0
    record = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert (record["schema"], record["passed"], record["seed"]) == (1, True, weekly_seed())
    assert {"id", "passed", "value", "limit", "basis", "replay"} <= set(record["checks"][0])
    assert len(record["checks"]) == 32 + 7


@pytest.mark.campaign
def test_failure_is_told_with_the_command_that_repeats_it(result_of: ResultOf) -> None:
    only = ["verify", "--only", "cells/two-term/case-3"]
    with ONE_BIT.planted(ONE_BIT.size):
        suite = ElementTree.fromstring(result_of([*only, "--format", "junit"], 1).out.encode())
        assert suite.get("tests") == suite.get("failures") == "32"
        failure = suite.findtext("testcase/failure") or ""
        assert "python -m pyharness verify --only cells/" in failure
        lines = result_of(only, 1).out.splitlines()
        assert all(len(line) <= 100 for line in lines if not line.startswith("  python"))
        place = next(i for i, line in enumerate(lines) if line.startswith("FAILED"))
        assert "omega" in lines[place]
        command = shlex.split(lines[place + 1])
        assert command[:3] == ["python", "-m", "pyharness"]
        assert lines[place] in result_of(command[3:], 1).out
    assert "1 check, all well" in result_of(command[3:]).out


@pytest.mark.parametrize("listed", [0, 1])
@pytest.mark.parametrize("planted", [0, 1])
def test_divergence_unlisted_or_no_longer_needed_fails(
    listed: int, planted: int, capsys: Capture
) -> None:
    cell = "two-term/case-3/corrected"
    entry = {"id": "tried", "kind": "cross-language", "cell": cell}
    table = {"divergence": [*facts("divergences")["divergence"], *[entry] * listed]}
    plant = ONE_BIT.planted(ONE_BIT.size * planted)
    with patch.object(verify_programs, "facts", lambda name: table), plant:
        assert main(["verify", "--only", f"cells/{cell}"]) == int(listed != planted)
    assert ("no longer occurs" in capsys.readouterr().out) == (listed > planted)


def test_random_draws_can_be_had_again() -> None:
    assert draw("a", 3) == draw("a", 3)
    assert draw("a", 3) != draw("a", 4)
    assert draw("a", 3) != draw("b", 3)
    # Values drawn when this test was written: a replay must not depend on the version of Python.
    assert draw("2026-W47", 0).scene.omega[0].hex() == "-0x1.5f01c99996168p+0"


def test_half_of_the_draws_are_nasty_in_every_way() -> None:
    names = [draw("c", number).scene.name for number in range(200)]
    assert names[::2] == ["plain"] * 100
    assert set(names[1::2]) == {
        "near-symmetric", "near-separatrix", "violent torque", "from rest", "slow waves",
        "many speeds", "far scale", "sensitive", "long", "coefficients", "extreme",
    }  # fmt: skip


def test_seed_changes_weekly_and_is_printed(capsys: Capture) -> None:
    monday = datetime.date(2026, 11, 16)
    week = [weekly_seed(monday + datetime.timedelta(days)) for days in range(8)]
    assert week == ["2026-W47"] * 7 + ["2026-W48"]
    assert main(["verify", "--only", "random/3/program"]) == 0
    assert f"seed of the random draws: {weekly_seed()}" in capsys.readouterr().out


@pytest.mark.parametrize(("seed", "draws"), [("a b", 3), ("", 3), ("$(x)", DRAWS + 1)])
def test_replay_of_a_draw_is_read_by_the_shell_as_it_was_given(seed: str, draws: int) -> None:
    [check] = verify(Selection(only=[f"random/{draws - 1}/program"], seed=seed, draws=draws))
    words = shlex.split(check.replay)
    assert words[words.index("--seed") + 1] == seed
    # An option with its default value is not repeated.
    assert ("--draws" in words) == (draws > DRAWS)
    assert main(words[3:]) == 0


_produced = cache(update)


@pytest.mark.campaign
def test_record_is_what_is_produced() -> None:
    files, news = _produced(RECORD)
    if {file["mathematics"] for file in read_record(RECORD).values()} == {mathematics()}:
        exact = [line for line in news if any(f"--program {name}" in line for name in PROGRAMS)]
        assert exact == []
    assert sum(map(len, files.values())) < 200_000
    assert all(line.startswith("moved: ") for line in news)


def _written(folder: Path) -> Path:
    for name, content in _produced(RECORD)[0].items():
        (folder / name).write_bytes(content)
    return folder / "two-term.toml"


@pytest.mark.campaign
def test_record_that_was_changed_fails_and_is_mended(tmp_path: Path, capsys: Capture) -> None:
    path = _written(tmp_path)
    good = path.read_text()
    only = ["verify", "--only", "golden/two-term", "--record", str(tmp_path)]
    assert main(only) == 0
    value = next(row[3] for row in read_record(tmp_path)["two-term"]["trajectory"][5]["rows"][1:])
    moved = float.hex(math.nextafter(float.fromhex(value), math.inf))
    digest = read_record(tmp_path)["two-term"]["trajectory"][3]["digest"]
    for text, told in (
        (good.replace(value, moved, 1), "omega by 1 ulp"),
        (good.replace(digest, "0" * 32, 1), "between the rows that are shown"),
        (good.replace("--case 3 ", "--case 8 "), "no longer produced"),
        (good.rpartition("[[trajectory]]")[0], "is not recorded"),
    ):
        path.write_text(text)
        capsys.readouterr()
        assert main(only) == 1
        output = capsys.readouterr().out
        assert told in " ".join(output.split())
        assert f"--record {tmp_path}" in output
    last = good.rpartition("[[trajectory]]")[2]
    surplus = "[[trajectory]]" + re.sub(r"--case \d", "--case 8", last)
    path.write_text(good.replace(value, moved, 1) + "\n" + surplus)
    capsys.readouterr()
    due = [each for each in recorded() if each.source == "two-term"]
    with patch("pyharness.checks.golden.recorded", return_value=due):
        assert main(["verify", "--update", "--record", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "omega by 1 ulp" in told
    assert "gone: " in told
    assert path.read_text() == good


def test_record_of_a_method_has_all_rows(capsys: Capture) -> None:
    """Regression test: rows that are not in it were not compared."""

    class Wrong:
        def rows(self, scene: Scene) -> Trajectory:
            run = solve(scene, scene.times(), "closed-form", 1e-9)
            run.omega[50] += 1e-4
            return run

    with patch("pyharness.checks.golden.method_candidate", lambda *_: Wrong()):
        assert main(["verify", "--only", "golden/closed-form/case-2"]) == 1
    assert "golden/closed-form/case-2" in capsys.readouterr().out


def test_trajectory_in_two_files_is_told(tmp_path: Path) -> None:
    for name in ("rk4.toml", "rk5.toml"):
        (tmp_path / name).write_bytes((RECORD / "rk4.toml").read_bytes())
    with pytest.raises(InputError, match=r"rk5\.toml': .*--case 1 .* is in 'rk4\.toml' too"):
        read_record(tmp_path)


@pytest.mark.campaign
@pytest.mark.parametrize("damage", ["junk=", "x = 1\n", "trajectory = 3\n", "\xff", ""])
def test_record_that_is_none_is_told_in_one_line_and_mended(
    damage: str, tmp_path: Path, capsys: Capture
) -> None:
    """Mend, for instance, a merge conflict; files of programs that no longer exist are removed."""
    path = _written(tmp_path)
    good = path.read_text()
    path.write_bytes(damage.encode("latin-1"))
    assert main(["verify", "--only", "golden", "--record", str(tmp_path)]) == 2
    assert "two-term.toml" in capsys.readouterr().err
    (tmp_path / "rk9.toml").write_text(good)
    due = [each for each in recorded() if each.source == "two-term"]
    with patch("pyharness.checks.golden.recorded", return_value=due):
        assert main(["verify", "--update", "--record", str(tmp_path)]) == 0
    assert path.read_text() == good
    assert not (tmp_path / "rk9.toml").exists()


# Beside a record, a file with the name of another one, such as taylor.toml, is a damaged record.
@pytest.mark.parametrize(
    ("name", "beside"),
    [("mine.toml", ()), ("taylor.toml", ()), ("mine.toml", ("rk4.toml",)), ("mine", ("rk4.toml",))],
)
def test_update_refuses_files_of_others(
    name: str, beside: tuple[str, ...], tmp_path: Path, capsys: Capture
) -> None:
    """Regression test: every other TOML file in the folder was deleted."""
    for each in beside:
        shutil.copy(RECORD / each, tmp_path)
    (tmp_path / name).write_text("a = 1\n")
    with patch("pyharness.checks.golden.update", side_effect=AssertionError):
        assert main(["verify", "--update", "--record", str(tmp_path)]) == 2
    assert f"holds '{name}', which was not made by this verb" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {*beside, name}


def test_no_record_is_said(tmp_path: Path, capsys: Capture) -> None:
    with patch("pyharness.cli.verbs.verify.RECORD", tmp_path / "none"):
        assert main(["verify", "--only", "golden,orders/rk4/case-5"]) == 0
    assert "no stored trajectories are here" in capsys.readouterr().out


# One plant in both languages and one in a prepared solver; `verify --self-test` makes them all.
@pytest.mark.campaign
@pytest.mark.parametrize("name", ["sign-in-both", "stale-solver"])
def test_plant_is_caught_by_more_than_the_record(name: str) -> None:
    plant = BY_NAME[name]
    found = plants.outcome(plant, Selection(seed="fixed", draws=12, thin=True, only=plant.kinds))
    assert found.passed
    assert "(golden" not in found.note


@pytest.mark.campaign
def test_plant_that_nothing_catches_is_a_failure(capsys: Capture) -> None:
    harmless = replace(ONE_BIT, name="harmless", size=0.0)

    def few(chosen: Selection) -> Iterator[Check]:
        """Yield a few checks as the control; `verify --self-test` makes checks of all kinds."""
        return verify(replace(chosen, only=("cells",)))

    with patch.multiple(plants, PLANTS=(harmless,), verify=few):
        assert main(["verify", "--self-test"]) == 1
    output = capsys.readouterr().out
    assert "FAILED harmless" in output
    assert "1 plant and a control: 1 not as it should be" in output


def test_every_kind_but_the_record_has_a_plant() -> None:
    assert {kind for plant in PLANTS for kind in plant.kinds} == set(KINDS) - {"golden"}


def test_plants_leave_nothing_behind() -> None:
    def state() -> list[object]:
        return [dict(METHODS), dict(PROGRAM_REGISTRY), compiled.run, problem.normalized]

    before = state()
    for plant in PLANTS:
        with plant.planted(plant.size):
            pass
    assert state() == before


def _shorter(run: Trajectory) -> Trajectory:
    velocity = None if run.velocity is None else run.velocity[:-1]
    return replace(run, omega=run.omega[:-1], velocity=velocity)


def _other_stop(run: Trajectory, **change: Any) -> Trajectory:
    return run if run.stop is None else replace(run, stop=replace(run.stop, **change))


def _later(run: Trajectory) -> Trajectory:
    return run if run.stop is None else _other_stop(run, step=run.stop.step + 1)


def _off(run: Trajectory) -> Trajectory:
    factors = np.ones_like(run.omega)
    factors[-1, 1] += 1e-9
    return replace(run, omega=run.omega * factors)


@pytest.mark.sampled
@pytest.mark.parametrize(("change", "only", "note"), [
    (_shorter, "schemes", "complete, or no velocity"),
    (_shorter, "stops", "complete, or no velocity"),
    (partial(replace, velocity=None), "schemes", "complete, or no velocity"),
    (partial(_other_stop, variable="V3"), "stops/case-3", "due Stop("),
    (_later, "stops/case-3", "due Stop("),
    (_off, "schemes/runge-kutta/case-3", "most at step 100, U2"),
    (lambda run: replace(run, evaluations=run.evaluations - 1), "cells/two-term/case-3", "due"),
    (lambda run: replace(run, evaluations=run.evaluations + 1), "cells/two-term/case-3", "due"),
])  # fmt: skip
def test_what_is_not_as_due_in_both_languages_is_named(
    change: Callable[[Trajectory], Trajectory], only: str, note: str
) -> None:
    run = Program.run

    def altered(self: Program, *rest: Any, **named: Any) -> Trajectory:
        return change(run(self, *rest, **named))

    with patch.object(Program, "run", altered):
        checks = list(verify(Selection(only=[only])))
    assert checks
    assert all(not check.passed and note in check.note for check in checks)


@pytest.mark.parametrize("state", ["misses", "unsettled", "singular", "sensitive", "unbounded"])
def test_order_of_a_case_that_can_not_be_told_fails(state: State) -> None:
    assert not judged_order(Name("orders"), Order(4, state, None, 0.01)).passed


@pytest.mark.parametrize(
    ("method", "tolerance", "why", "growth", "may"),
    [("auto", 1e-6, "", 1e6, False), ("closed-form", 1e-6, "", 1e6, False),
     ("taylor", 1e-6, "", 1e6, True), ("radau", 1e-12, "gave up; allow more work", 2.0, True),
     ("radau", 1e-6, "gave up; allow more work", 2.0, False), ("quick", 1e-6, "gave up", 2.0, True),
     ("radau", 1e-12, "gave up", 2.0, False), ("dop853", 1e-12, "can't meet it", 2.0, False),
     ("taylor", 1e-12, "gave up; allow more work", 2.0, False)],
)  # fmt: skip
def test_in_a_plain_scene_only_few_may_refuse(
    method: str, tolerance: float, why: str, growth: float, may: bool
) -> None:
    drawn = draw("x", 0)
    truth = truth_of(drawn)
    truth = replace(truth, flow=replace(truth.flow, amplification=growth))
    assert may_refuse(MethodRun(method, tolerance, drawn.scene, Answer), truth, why) == may


def test_error_is_relative_to_the_largest_omega_on_the_way() -> None:
    law = TorqueLaw((-1.0, 0.0, 0.0))
    slowing = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    drawn: Any = SimpleNamespace(scene=slowing, time=1.0)
    assert truth_of(drawn).flow.largest == pytest.approx(1.0)

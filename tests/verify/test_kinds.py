"""`verify`: what it checks, that each check can fail, and what a user sees then."""

import datetime
import functools
import json
import math
import random
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree

import numpy as np
import pytest

from pyharness.cli.main import main
from pyharness.compare.checks import Check, bounded, selected
from pyharness.compare.orders import Order, State
from pyharness.compare.random_scenes import _far_scale, draw, weekly_seed
from pyharness.methods import problem, taylor
from pyharness.methods.registry import METHODS
from pyharness.model import facts as facts_room
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, corrected
from pyharness.model.scene import Scene, TorqueLaw
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import compiled
from pyharness.original.cells import all_cells, cell_name
from pyharness.original.programs import PROGRAM_REGISTRY, Program
from pyharness.verify import programs as verify_programs
from pyharness.verify.golden import mathematics, read_record, recorded, update
from pyharness.verify.kinds import KINDS, verify
from pyharness.verify.methods import _order
from pyharness.verify.plants import self_test
from pyharness.verify.plants.planted_twins import plant_in_twin
from pyharness.verify.plants.plants import PLANTS, Plant
from pyharness.verify.random_methods import Answer, Truth, _may_refuse, truth_of
from pyharness.verify.selection import DRAWS, RECORD, Selection

BY_NAME = {plant.name: plant for plant in PLANTS}


def _json(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    code = main(["verify", "--format", "json", *arguments])
    return code, json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


def test_every_cell_has_a_name_of_its_own() -> None:
    names = [cell_name(listing, case) for listing, case in all_cells()]
    assert len(names) == len(set(names)) == (8 * 2 + 4 + 64 * 2) * 7
    assert "two-term/case-3/original" in names


def test_checks_have_names_of_their_own_and_all_pass() -> None:
    """A part of everything; all of it is what `verify` is run for."""
    checks = list(verify(Selection(seed="fixed", draws=12, thin=True)))
    assert [check.id for check in checks if not check.passed] == []
    assert len({check.id for check in checks}) == len(checks)
    assert {check.kind for check in checks} == set(KINDS)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("_distances(slope[4], slope[1])", "_distances(slope[3], slope[1])"),
        ("_distances(point[3], first_point)", "_distances(point[2], first_point)"),
        ("_distances(result, base)", "_distances(result, point[3])"),
        ("order = [3, 4, 5, 0, 1, 2]", "order = [0, 1, 2, 3, 4, 5]"),
        ("else [0, 1, 2]", "else [0, 2, 1]"),
        ("last = 6 if velocity_counts else 3", "last = 3"),
        ("if norm_k > norm_u * lipschitz:", "if norm_k > 1.0000000001 * norm_u * lipschitz:"),
        ("> change_u[index] * lipschitz", "> 1.0000001 * change_u[index] * lipschitz"),
        ("total = total + each * each", "total = total + abs(each)"),
        ("Stop(step + 1, *found)", "Stop(step, *found)"),
    ],
)
def test_wrong_stop_test_in_both_languages_is_seen(right: str, wrong: str, tmp_path: Path) -> None:
    only = [f"stops/case-{case}" for case in (1, 3, 5, 6)]
    assert all(check.passed for check in verify(Selection(only=only)))
    faulty = plant_in_twin("runge-kutta", "runge_kutta.py", right, wrong, tmp_path)
    with patch.dict(PROGRAM_REGISTRY, {"runge-kutta": faulty}):
        assert not all(check.passed for check in verify(Selection(only=only)))


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("m[1] + b * u[0]", "m[1] + 1.000000001 * b * u[0]"),
        ("m[0] + a * u[1]", "1.000000001 * m[0] + a * u[1]"),
        ("acceleration[1] + v[2]", "1.000000001 * acceleration[1] + v[2]"),
        ("- v[1] * u[0]", "+ v[1] * u[0]"),
    ],
)
def test_small_fault_in_both_languages_is_seen(
    program: str, right: str, wrong: str, tmp_path: Path
) -> None:
    """Far below what an order shows."""
    chosen = Selection(only=[f"schemes/{program}/case-{case}" for case in (5, 7)])
    assert all(check.passed for check in verify(chosen))
    file, parts = "equations.py", (right, wrong)
    if program == "runge-kutta" and "v[" not in right:
        # It has the equations of omega in its own text.
        file = "runge_kutta.py"
        parts = {
            "m[1] + b * u[0]": ("r2 + b * u[2]", "r2 + 1.000000001 * b * u[2]"),
            "m[0] + a * u[1]": ("[r1 + a", "[1.000000001 * r1 + a"),
        }[right]
    faulty = plant_in_twin(program, file, *parts, tmp_path)
    with patch.dict(PROGRAM_REGISTRY, {program: faulty}):
        assert not all(check.passed for check in verify(chosen))


@pytest.mark.parametrize("kind", ["schemes", "stops"])
@pytest.mark.parametrize("change", [{"omega": np.zeros((99, 3))}, {"velocity": None}])
def test_part_of_a_run_fails(kind: str, change: dict[str, Any]) -> None:
    whole = Program.run

    def part(self: Program, *rest: Any, **named: Any) -> Trajectory:
        return replace(whole(self, *rest, **named), **change)

    with patch.object(Program, "run", part):
        checks = list(verify(Selection(only=[f"{kind}"])))
    assert len(checks) == {"schemes": 21, "stops": 56}[kind]
    assert not any(check.passed for check in checks)


def test_limit_is_not_passed_by_nan() -> None:
    assert not bounded("", math.nan, math.inf, "").passed
    assert not bounded("", 2.0, 1.0, "").passed
    assert bounded("", 1.0, 1.0, "").passed


def test_selection_is_by_whole_parts() -> None:
    assert selected("cells/two-term/case-3", ["cells/two-term"])
    assert not selected("cells/two-term/case-30", ["cells/two-term/case-3"])
    assert selected("cells", [])


def test_json_is_as_agreed(capsys: pytest.CaptureFixture[str]) -> None:
    code, record = _json(capsys, "--only", "cells/two-term/case-3,orders/rk4")
    assert code == 0
    assert record["schema"] == 1
    assert record["passed"] is True
    assert record["seed"] == weekly_seed()
    assert {"id", "passed", "value", "limit", "replay"} <= set(record["checks"][0])
    assert len(record["checks"]) == 16 + 7


def test_junit_is_well_formed(capsys: pytest.CaptureFixture[str]) -> None:
    with BY_NAME["ulp-in-fortran"].planted():
        assert main(["verify", "--format", "junit", "--only", "cells/two-term/case-3"]) == 1
    suite = ElementTree.fromstring(capsys.readouterr().out.encode())
    assert suite.get("tests") == suite.get("failures") == "16"
    failure = suite.find("testcase/failure")
    assert failure is not None
    assert failure.text is not None
    assert "python -m pyharness verify --only cells/" in failure.text


def test_failure_is_told_with_the_command_that_repeats_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with BY_NAME["ulp-in-fortran"].planted():
        assert main(["verify", "--only", "cells/two-term/case-3"]) == 1
        lines = capsys.readouterr().out.splitlines()
        assert all(len(line) <= 100 for line in lines if not line.startswith("  python"))
        place = next(i for i, line in enumerate(lines) if line.startswith("FAILED"))
        assert "omega" in lines[place]
        command = shlex.split(lines[place + 1])
        assert command[:3] == ["python", "-m", "pyharness"]
        assert main(command[3:]) == 1
        assert lines[place] in capsys.readouterr().out
    assert main(command[3:]) == 0
    assert "1 check, all well" in capsys.readouterr().out


@contextmanager
def _listed(cell: str) -> Iterator[None]:
    """List a divergence in the table."""
    known = facts_room.facts("divergences")
    entry = {"id": "tried", "kind": "cross-language", "cell": cell}
    table = {"divergence": [*known["divergence"], entry]}
    with patch.object(verify_programs, "facts", lambda name: table):
        yield


@pytest.mark.parametrize(
    ("listed", "planted", "code"), [(0, 0, 0), (0, 1, 1), (1, 1, 0), (1, 0, 1)]
)
def test_divergence_unlisted_or_no_longer_needed_fails(
    listed: bool, planted: bool, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = "two-term/case-3/corrected"
    contexts: list[AbstractContextManager[Any]] = [
        _listed(cell) if listed else nullcontext(),
        BY_NAME["ulp-in-fortran"].planted() if planted else nullcontext(),
    ]
    with contexts[0], contexts[1]:
        assert main(["verify", "--only", f"cells/{cell}"]) == code
    assert ("no longer occurs" in capsys.readouterr().out) == (listed and not planted)


def test_random_draws_can_be_had_again() -> None:
    assert draw("a", 3) == draw("a", 3)
    assert draw("a", 3) != draw("a", 4)
    assert draw("a", 3) != draw("b", 3)
    # As they were drawn when this was written: a replay must outlive the version of Python.
    assert draw("2026-W47", 0).scene.omega[0].hex() == "-0x1.5f01c99996168p+0"


def test_half_of_the_draws_are_nasty_in_every_way() -> None:
    names = [draw("c", number).scene.name for number in range(200)]
    assert names[::2] == ["plain"] * 100
    assert set(names[1::2]) == {
        "near-symmetric", "near-separatrix", "violent torque", "from rest", "slow waves",
        "many speeds", "far scale", "sensitive", "long", "coefficients", "extreme",
    }  # fmt: skip


def test_seed_changes_weekly_and_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    monday = datetime.date(2026, 11, 16)
    week = [weekly_seed(monday + datetime.timedelta(days)) for days in range(8)]
    assert week == ["2026-W47"] * 7 + ["2026-W48"]
    assert main(["verify", "--only", "random/3/program"]) == 0
    assert f"seed of the random draws: {weekly_seed()}" in capsys.readouterr().out


def test_random_failure_names_its_seed() -> None:
    with BY_NAME["ulp-in-fortran"].planted():
        checks = list(verify(Selection(only=["random"], seed="x", draws=40)))
    failed = [check for check in checks if not check.passed]
    assert failed
    assert all(check.replay.endswith(" --seed x") for check in failed)


@pytest.mark.parametrize(("seed", "draws"), [("a b", 3), ("", 3), ("$(x)", DRAWS + 1)])
def test_replay_of_a_draw_is_read_by_the_shell_as_it_was_given(seed: str, draws: int) -> None:
    chosen = Selection(only=[f"random/{draws - 1}/program"], seed=seed, draws=draws)
    [check] = verify(chosen)
    words = shlex.split(check.replay)
    assert words[words.index("--seed") + 1] == seed
    assert main(words[3:]) == 0


def test_record_is_what_is_produced(tmp_path: Path) -> None:
    files, news = update(RECORD)
    if {file["mathematics"] for file in read_record(RECORD).values()} == {mathematics()}:
        exact = [line for line in news if any(f"--program {name}" in line for name in PROGRAMS)]
        assert exact == []
    assert sum(map(len, files.values())) < 200_000
    assert all(line.startswith("moved: ") for line in news)


@functools.cache
def _produced() -> dict[str, bytes]:
    return update(RECORD)[0]


def _written(folder: Path) -> Path:
    for name, content in _produced().items():
        (folder / name).write_bytes(content)
    return folder / "two-term.toml"


def test_record_that_was_changed_fails_and_is_mended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One unit in the last place of one number, the digest of what is not shown, a lost entry."""
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
        assert told in " ".join(capsys.readouterr().out.split())
    last = good.rpartition("[[trajectory]]")[2]
    surplus = "[[trajectory]]" + re.sub(r"--case \d", "--case 8", last)
    path.write_text(good.replace(value, moved, 1) + "\n" + surplus)
    capsys.readouterr()
    assert main(["verify", "--update", "--record", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "omega by 1 ulp" in told
    assert "gone: " in told
    assert path.read_text() == good


def test_method_of_the_record_may_move_within_its_error(tmp_path: Path) -> None:
    _written(tmp_path)
    path = tmp_path / "taylor.toml"
    value = read_record(tmp_path)["taylor"]["trajectory"][4]["rows"][2][4]
    for factor, passed in ((1.0 + 1e-13, True), (1.0 + 1e-6, False)):
        text = path.read_text()
        path.write_text(text.replace(value, (float.fromhex(value) * factor).hex()))
        only = ["golden/taylor"]
        checks = list(verify(Selection(only=only, record=tmp_path)))
        assert all(check.passed for check in checks) == passed
        path.write_text(text)


@pytest.mark.parametrize("damage", ["junk=", "x = 1\n", "trajectory = 3\n", "\xff", ""])
def test_record_that_is_none_is_told_in_one_line_and_mended(
    damage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a conflict of a merge leaves, for instance; and files of what is gone are removed."""
    path = _written(tmp_path)
    good = path.read_text()
    path.write_bytes(damage.encode("latin-1"))
    assert main(["verify", "--only", "golden", "--record", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert "two-term.toml': is no record" in captured.err
    (tmp_path / "rk9.toml").write_text(good)
    due = [each for each in recorded() if each.source == "two-term"]
    with patch("pyharness.verify.golden.recorded", return_value=due):
        assert main(["verify", "--update", "--record", str(tmp_path)]) == 0
    assert path.read_text() == good
    assert not (tmp_path / "rk9.toml").exists()


def test_record_of_other_times_fails(tmp_path: Path) -> None:
    _written(tmp_path)
    path = tmp_path / "taylor.toml"
    entry = read_record(tmp_path)["taylor"]["trajectory"][4]
    row = entry["rows"][0]
    other = (2.0 * float.fromhex(row[1])).hex()
    path.write_text(path.read_text().replace(f'["1", "{row[1]}"', f'["1", "{other}"'))
    checks = list(verify(Selection(only=["golden/taylor"], record=tmp_path)))
    assert not all(check.passed for check in checks)
    assert all(str(tmp_path) in check.replay for check in checks)


def test_no_record_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with patch("pyharness.cli.verbs.verify.RECORD", tmp_path / "none"):
        assert main(["verify", "--only", "golden,orders/rk4/case-5"]) == 0
    assert "no golden record here" in capsys.readouterr().out
    assert main(["verify", "--record", str(tmp_path / "none")]) == 2
    assert "is not a folder" in capsys.readouterr().err


# One in the languages, one in a prepared solver: all are what `verify --self-test` is run for.
QUICK = ("sign-in-both", "stale-solver")


@pytest.mark.parametrize("name", QUICK)
def test_plant_is_caught_by_more_than_the_record(name: str) -> None:
    chosen = Selection(seed="fixed", draws=12, thin=True)
    with BY_NAME[name].planted():
        caught = self_test._caught(BY_NAME[name], chosen)
    assert caught.passed
    assert not caught.example.startswith("golden")


def test_plant_that_nothing_catches_is_a_failure(capsys: pytest.CaptureFixture[str]) -> None:
    harmless = Plant("harmless", "no fault at all", nullcontext)
    with patch.object(self_test, "PLANTS", (harmless,)):
        assert main(["verify", "--self-test"]) == 1
    output = capsys.readouterr().out
    assert "FAILED harmless" in output
    assert "1 plants and a control: 1 not as it should be" in output


def test_method_that_fails_in_an_ordinary_scene_is_no_lack_of_a_truth() -> None:
    """The truth is no method's: what a method makes endless is its own failure, and none of it."""
    known = taylor.taylor

    def wrong(scene: Scene, times: Sequence[float], *rest: float) -> Trajectory:
        found = known(scene, times, *rest)
        return replace(found, omega=found.omega * 1e9) if scene.name == "plain" else found

    chosen = Selection(seed="fixed", only=["random"], draws=40)
    with patch.object(taylor, "taylor", wrong):
        failed = [check.id for check in verify(chosen) if not check.passed]
    assert {id.rpartition("/")[2] for id in failed} >= {"solve-taylor"}
    assert not any(id.endswith("/no-truth") for id in failed)


def test_programs_that_solve_no_linear_equations_are_told() -> None:
    known = Program.run

    def singular(self: Program, *rest: Any, **named: Any) -> Trajectory:
        found = known(self, *rest, **named)
        return found if found.ier is None else replace(found, ier=np.full_like(found.ier, 129))

    chosen = Selection(only=["external/detest-b5"])
    with patch.object(Program, "run", singular):
        failed = [check.id for check in verify(chosen) if not check.passed]
    assert failed == ["external/detest-b5/20/two-term", "external/detest-b5/20/four-term"]


def test_plants_leave_nothing_behind() -> None:
    before = [dict(METHODS), dict(PROGRAM_REGISTRY), compiled.run, problem.normalized]
    for plant in PLANTS:
        with plant.planted():
            pass
    assert [dict(METHODS), dict(PROGRAM_REGISTRY), compiled.run, problem.normalized] == before


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--only", "cell"], "did you mean 'cells'?"),
        (["--only", "cells/nothing"], "no such check"),
        (["--draws", "-1"], "--draws"),
        (["--draws", "many"], "whole number"),
        (["--format", "csv"], "table, json, junit"),
        (["--update", "--only", "golden"], "--only has no meaning with --update"),
        (
            ["--update", "--self-test", "--record", "new"],
            "--self-test has no meaning with --update",
        ),
        (["--external", "x.toml", "--seed", "3"], "--seed has no meaning with --external"),
        (["--external", "x.toml", "--only", "cells"], "with --external"),
        (["--only", "random", "--draws", "0"], "no such check"),
        (["--only", "stops", "--seed", "x"], "--seed has no meaning with --only stops"),
        (["--only", "cells,stops", "--draws", "0"], "--draws has no meaning with --only cells"),
        (["--only", "stops", "--record", "."], "--record has no meaning with --only stops"),
        (["--self-test", "--draws", "3"], "--draws has no meaning with --self-test"),
        (["--external", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_mistakes_are_told_in_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert told in captured.err


def test_what_both_languages_count_or_time_alike_is_held_to_what_is_due() -> None:
    scene = case_scene(3)
    program = PROGRAM_REGISTRY["two-term"]
    run = program.run(scene, corrected("two-term"))

    def passes(**changes: Any) -> bool:
        changed = replace(run, **changes)
        return verify_programs.agreement("x", "y", "two-term", scene, changed, changed).passed

    assert passes()
    for evaluations in (run.evaluations - 1, run.evaluations + 1):
        assert not passes(evaluations=evaluations)
    assert not passes(time=np.arange(1, run.steps + 1) * scene.step_size * (1.0 + 1e-15))


def test_method_that_answers_what_it_was_not_asked_fails() -> None:
    """Refused where it has to answer, other times, and a closed form where there is none."""

    def checks(only: str, change: Callable[..., Trajectory]) -> list[Check]:
        name = only.split("/")[1]
        changed = replace(METHODS[name], solve=change)
        with patch.dict(METHODS, {name: changed}):
            return list(verify(Selection(only=[only])))

    def refuses(*_: Any) -> Trajectory:
        raise InputError("not today")

    def other_times(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        run = METHODS["taylor"].solve(scene, times, tolerance, effort)
        return replace(run, time=np.nextafter(run.time, 9.0))

    for change in (refuses, other_times):
        found = checks("methods/gauss-4/case-3", change)
        assert found
        assert not any(check.passed for check in found)
    assert all(check.passed for check in verify(Selection(only=["methods/closed-form/case-5"])))
    solved = checks("methods/closed-form/case-5", METHODS["taylor"].solve)
    assert [check.note for check in solved] == ["solved what has no closed form"] * len(solved)
    assert solved
    assert not any(check.passed for check in solved)


def _altered(change: Callable[[Trajectory], Trajectory]) -> AbstractContextManager[Any]:
    run = Program.run

    def altered(self: Program, *rest: Any, **named: Any) -> Trajectory:
        return change(run(self, *rest, **named))

    return patch.object(Program, "run", altered)


def test_step_and_component_that_are_off_the_scheme_are_named() -> None:
    def off(run: Trajectory) -> Trajectory:
        omega = run.omega.copy()
        omega[-1, 1] *= 1.0 + 1e-9
        return replace(run, omega=omega)

    with _altered(off):
        (check,) = verify(Selection(only=["schemes/runge-kutta/case-3"]))
    assert not check.passed
    assert check.note == "most at step 100, U2"


def test_stop_by_another_variable_or_at_another_step_fails() -> None:
    def renamed(run: Trajectory) -> Trajectory:
        return run if run.stop is None else replace(run, stop=replace(run.stop, variable="V3"))

    def later(run: Trajectory) -> Trajectory:
        stop = run.stop and replace(run.stop, step=run.stop.step + 1)
        return replace(run, stop=stop)

    asked = Selection(only=["stops/case-3"])
    assert all(check.passed for check in verify(asked))
    for change in (renamed, later):
        with _altered(change):
            checks = list(verify(asked))
        assert checks
        assert not any(check.passed for check in checks)


@pytest.mark.parametrize("state", ["misses", "unsettled", "singular", "sensitive", "unbounded"])
def test_order_of_a_case_that_can_not_be_told_fails(state: State) -> None:
    assert not _order("orders/x", Order(4, state, None, 0.01)).passed


@pytest.mark.parametrize("kind", ["schemes", "stops"])
def test_run_without_its_last_row_fails(kind: str) -> None:
    def shorter(run: Trajectory) -> Trajectory:
        velocity = None if run.velocity is None else run.velocity[:-1]
        return replace(run, omega=run.omega[:-1], velocity=velocity)

    with _altered(shorter):
        checks = list(verify(Selection(only=[f"{kind}/runge-kutta/case-3", f"{kind}/case-3"])))
    assert checks
    assert not any(check.passed for check in checks)


@pytest.mark.parametrize("name", ["auto", "closed-form"])
def test_choice_of_a_method_may_refuse_nothing(name: str) -> None:
    sensitive = Truth([1.0], np.ones((1, 3)), 1.0, 1e6)
    assert not _may_refuse(Answer(name, 1e-6, None), draw("x", 0), sensitive)
    assert _may_refuse(Answer("taylor", 1e-6, None), draw("x", 0), sensitive)


@pytest.mark.parametrize(
    ("method", "tolerance", "why", "may"),
    [
        ("radau", 1e-12, "gave up; allow more work", True),
        ("radau", 1e-6, "gave up; allow more work", False),
        ("radau", 1e-12, "gave up", False),
        ("dop853", 1e-12, "can't meet it", False),
        ("taylor", 1e-12, "gave up; allow more work", False),
        ("quick", 1e-6, "gave up", True),
    ],
)
def test_in_a_plain_scene_only_few_may_refuse(
    method: str, tolerance: float, why: str, may: bool
) -> None:
    drawn = draw("x", 0)
    calm = Truth([drawn.time], np.ones((1, 3)), 1.0, 2.0)
    assert _may_refuse(Answer(method, tolerance, None, why), drawn, calm) == may


def test_error_is_relative_to_the_largest_omega_on_the_way() -> None:
    law = TorqueLaw((-1.0, 0.0, 0.0))
    slowing = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    drawn: Any = SimpleNamespace(scene=slowing, time=1.0)
    assert truth_of(drawn).largest == pytest.approx(1.0)


def test_far_scales_are_far() -> None:
    for number in range(20):
        scene = _far_scale(random.Random(number))
        assert not 1e-4 < max(map(abs, scene.omega)) < 1e4

"""Reductions: each is compared with solutions of one scene at a time."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, TorqueLaw, case_scene, run_program, solve
from pyharness.model.codes import Statuses
from pyharness.model.trajectory import STOP_VARIABLES
from pyharness.sweep.batches import batches, listing_of, solve_chunk
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.report import summary, sweep_picture
from pyharness.sweep.run import swept
from pyharness.sweep.sweep import Sweep, points
from pyharness.sweep.sweep_file import read_sweep
from tests.sweep.claims import CLAIMS
from tests.sweep.sweeps import BASE, PROGRAM, TILT, axis, text, written

SAMPLES = 400


def _found(folder: Path, content: str) -> tuple[Sweep, dict[str, Any]]:
    sweep = read_sweep(written(folder, content), CLAIMS)
    assert sweep.n_chunks == 1
    return sweep, solve_chunk(sweep, 0)


def _tilted(sweep: Sweep) -> list[Scene]:
    tilts = sweep.axes[0].coordinates()
    return [Scene("", (np.sin(t), np.cos(t), 0.0), moments=(1.0, 2.0, 3.0)) for t in tilts]


@pytest.mark.campaign
def test_reductions_say_what_the_motion_does(tmp_path: Path) -> None:
    asked = ", ".join(
        f'{{name = "{name}", samples = {SAMPLES}}}' for name in ("largest-tilt", "flips", "drift")
    )
    top = f'reductions = ["end", "status", "error", {asked}]'
    sweep, found = _found(tmp_path, text(TILT, top=top))
    assert (found["status"] == Statuses.COMPLETE).all()
    times = [10.0 * (i + 1) / SAMPLES for i in range(SAMPLES)]
    for i, scene in enumerate(_tilted(sweep)):
        rows = solve(scene, times, tolerance=1e-13).omega
        assert np.allclose(found["end"][i], rows[-1], atol=1e-11)
        both = np.concatenate([[scene.omega], rows])
        cosines = rows @ np.array(scene.omega) / np.linalg.norm(rows, axis=1)
        assert found["largest-tilt"][i] == pytest.approx(np.arccos(cosines).max(), abs=1e-6)
        assert found["flips"][i] == (np.diff(np.sign(both[:, 1])) != 0).sum()
    assert found["flips"].max() > 0
    assert found["error"].max() < 1e-12
    assert 0.0 < found["drift"].max() < 1e-12


_AXES = ("least", "middle", "largest")
_START = [0.5, -0.1, 0.7, 0.3]
_LAW = "[torque]\nconstant = [0.1, 0.0, -0.2]\nsines = [{amplitude = [0.3, 0, 0], frequency = 2.0}]"
_WITH_DAMPING = "[torque]\nexpression = ['-0.1*w1', '-0.3*w2', '0.2*cos(t)']"
_IN_SPACE = "[torque]\nexpression = ['0.2*q1', '-0.1*w2', '0.3*q0*q3']"


_ABOUT_SPACE = _LAW.replace("[torque]", "[torque]\nframe = 'space'")


@pytest.mark.parametrize("torque", ["", _LAW, _WITH_DAMPING, _IN_SPACE, _ABOUT_SPACE])
def test_attitudes_are_those_of_single_scenes(tmp_path: Path, torque: str) -> None:
    towards = np.array([0.3, -2.0, 1.0])
    asked = ", ".join(
        f'{{name = "axis-tilt", of = "{axis}", samples = 50, as = "{axis}"}}, '
        f'{{name = "axis-flips", of = "{axis}", samples = 50, as = "flips-{axis}"}}, '
        f'{{name = "tilted-time", of = "{axis}", samples = 50, above = 1.0, as = "time-{axis}"}}, '
        f'{{name = "pointing-error", of = "{axis}", as = "error-{axis}"}}, '
        f'{{name = "pointing-error", of = "{axis}", towards = [0.3, -2.0, 1.0], as = "to-{axis}"}}'
        for axis in _AXES
    )
    scene = f"{BASE.replace('omega =', f'attitude = {_START}{chr(10)}omega =')}{torque}"
    content = text(TILT, top=f'reductions = ["attitude", "end", {asked}]', scene=scene)
    sweep, found = _found(tmp_path, content.replace("[torque]", "[scene.torque]"))
    times = [10.0 * (i + 1) / 50 for i in range(50)]
    for i, tilt in enumerate(sweep.axes[0].coordinates()):
        alone = replace(sweep.scene, omega=(np.sin(tilt), np.cos(tilt), 0.0))
        rows: Any = solve(alone, times, attitude=True)
        assert np.abs(found["attitude"][i] - rows.attitude[-1]).max() < 1e-9
        assert np.abs(found["end"][i] - rows.omega[-1]).max() < 1e-9
        matrices = rows.rotation().as_matrix()
        first = Rotation.from_quat(_START, scalar_first=True).as_matrix()
        for n, name in enumerate(_AXES):
            cosines = matrices[:, :, n] @ first[:, n]
            tilts = np.arccos(np.clip(cosines, -1.0, 1.0))
            assert found[name][i] == pytest.approx(tilts.max(), abs=1e-6)
            assert found[f"error-{name}"][i] == pytest.approx(tilts[-1], abs=1e-6)
            passed = np.diff(np.concatenate([[1.0], np.sign(cosines)])) != 0
            assert found[f"flips-{name}"][i] == passed.sum()
            assert found[f"time-{name}"][i] == pytest.approx(10.0 * (tilts > 1.0).mean())
            cosine = matrices[-1, :, n] @ towards / np.linalg.norm(towards)
            assert found[f"to-{name}"][i] == pytest.approx(np.arccos(cosine), abs=1e-6)
    assert found["middle"].max() > 1.5
    assert found["flips-middle"].max() > 0
    assert 0.0 < found["time-middle"].max() < 10.0


def test_initial_attitudes_may_vary_where_a_quantity_needs_them(tmp_path: Path) -> None:
    top = 'reductions = ["attitude", {name = "pointing-error", towards = [0, 0, 1]}, "status"]'
    sweep, found = _found(tmp_path, text(axis("attitude.1", [0.0, 0.5, 1e200]), top=top))
    scene = BASE.replace("omega =", "attitude = [2.0, 0.0, 0.0, 0.0]\nomega =")
    _, doubled = _found(tmp_path, text(axis("attitude.1", [0.0, 1.0]), top=top, scene=scene))
    assert doubled["attitude"] == pytest.approx(found["attitude"][:2], abs=1e-15)
    for i, x in enumerate((0.0, 0.5, 1e200)):
        rows: Any = solve(replace(sweep.scene, attitude=(1.0, x, 0.0, 0.0)), 10.0, attitude=True)
        assert np.abs(found["attitude"][i] - rows.attitude[-1]).max() < 1e-11
        axis3 = rows.rotation().as_matrix()[-1, 2, 2]
        assert found["pointing-error"][i] == pytest.approx(np.arccos(axis3), abs=1e-7)
    _, zero = _found(tmp_path, text(axis("attitude.0", [0.0, 1.0]), top=top))
    assert np.isfinite(zero["attitude"]).all(axis=1).tolist() == [False, True]
    assert (zero["status"] == Statuses.COMPLETE).tolist() == [False, True]


def test_torque_in_space_may_be_that_of_an_axis_alone(tmp_path: Path) -> None:
    """The scene's own torque is 0; attitude and omega are those of `solve` nevertheless."""
    more = "attitude = [2.0, 1.0, 0.0, -1.0]\n[scene.torque]\nframe = 'space'\n[scene.run]"
    scene, top = BASE.replace("[scene.run]", more), 'reductions = ["attitude", "end"]'
    axes = axis("torque.constant.1", [0.0, 1.0])
    sweep, found = _found(tmp_path, text(axes, top=top, scene=scene))
    for i, torque in enumerate((0.0, 1.0)):
        law = TorqueLaw((torque, 0.0, 0.0), frame="space")
        rows: Any = solve(replace(sweep.scene, torque=law), 10.0, attitude=True)
        # Side by side, steps differ; the tolerance is 1e-9 of about 6 rad/s.
        assert np.abs(found["attitude"][i] - rows.attitude[-1]).max() < 1e-9
        assert np.abs(found["end"][i] - rows.omega[-1]).max() < 6e-9
    program = text(axes, top="", scene=scene + "[solve]\nprogram = 'two-term'\n")
    with pytest.raises(InputError, match="about the axes of space"):
        _found(tmp_path, program)


def test_step_that_overflows_is_refused_silently(tmp_path: Path) -> None:
    solver = "[solve]\nprogram = 'two-term'\n"
    steps = axis("step_size", [0.1, 1e308])
    _, found = _found(tmp_path, text(steps, top='reductions = ["status"]', scene=BASE + solver))
    assert found["status"][1] != Statuses.COMPLETE


def test_component_that_begins_at_zero_has_no_flip(tmp_path: Path) -> None:
    """Two motions are mirror images, and omega 2 leaves 0 in opposite directions."""
    scene = BASE.replace("[0.0, 1.0, 0.0]", "[1.0, 0.0, 1.0]").replace("100", "10")
    top = 'reductions = ["flips", "flip-time"]'
    _, found = _found(tmp_path, text(axis("omega.1", [-1.0, 1.0, 0.0]), top=top, scene=scene))
    assert found["flips"].tolist() == [0, 0, 0]
    assert np.isfinite(found["flip-time"]).tolist() == [True, True, False]


def test_scenes_without_solution_have_no_count(tmp_path: Path) -> None:
    top = 'reductions = ["flips", "axis-flips", "status"]'
    sweep, found = _found(tmp_path, text(axis("omega.1", [1.0, 1e200]), top=top))
    assert (found["status"] == [Statuses.COMPLETE, Statuses.GAVE_UP]).all()
    with swept(sweep, str(tmp_path / "store")) as (store, _):
        for asked in sweep.reductions[:2]:
            assert (found[asked.name] >= 0).tolist() == [True, False]
            ((_, _, n, none, least, *_),), _ = summary(store, asked)
            assert (n, none, least) == (1, 1, found[asked.name][0])
            values = [row[-1] for row in sweep_picture(store, asked).numbers.rows]
            assert np.isfinite(values).tolist() == [True, False]


def test_map_of_values_in_any_order_is_that_of_ascending_values(tmp_path: Path) -> None:
    one, two = [3.0, 1.0, 2.0], [0.5, 4.0, 0.1]
    drawn: list[Any] = []
    mesh: Any
    for name, given in (("any", (one, two)), ("ascending", (sorted(one), sorted(two)))):
        axes = axis("omega.1", given[0]) + axis("omega.2", given[1])
        folder = tmp_path / name
        folder.mkdir()
        sweep, _ = _found(folder, text(axes, top='reductions = ["flip-time"]'))
        with swept(sweep, str(folder / "store")) as (store, _):
            (mesh,) = sweep_picture(store, sweep.reductions[0]).figure.axes[0].collections
        drawn.append((mesh.get_array().tolist(), mesh.get_coordinates().tolist()))
    assert drawn[0] == drawn[1]


@pytest.mark.campaign
def test_error_and_drift_are_those_of_the_method(tmp_path: Path) -> None:
    top = 'reductions = ["drift", "error", {name = "error", samples = 4, as = "on-the-way"}]'
    methods = axis("method", ["rk4", "improved-euler", "rk45"])
    sweep = read_sweep(written(tmp_path, text(methods, TILT, top=top, scene=_COARSE)))
    found = [solve_chunk(sweep, chunk) for chunk in range(sweep.n_chunks)]
    errors = [each["error"].max() for each in found]
    assert errors[1] > 10.0 * errors[0] > 100.0 * errors[2] > 0.0
    for each in found:
        assert (each["on-the-way"] >= each["error"] * 0.9).all()
    assert found[1]["drift"].max() > 10.0 * found[0]["drift"].max()
    scene = Scene("", (np.sin(1.0), np.cos(1.0), 0.0), moments=(1, 2, 3), step_size=0.2, steps=50)
    step = solve(scene, 10.0, "rk4", 1.0).omega[-1]
    expected = np.abs(step - solve(scene, 10.0, "reference", 1e-12).omega[-1]).max()
    assert found[0]["error"][0, -1] == pytest.approx(expected, rel=0.2)


_COARSE = BASE.replace("0.1", "0.2").replace("100", "50") + "[solve]\ntolerance = 1e-10\n"


@pytest.mark.parametrize(("moment", "speed"), [(1.0, 1e155), (1e-30, 1e-130), (1e-170, 1e-160)])
def test_reductions_do_not_depend_on_the_units(moment: float, speed: float, tmp_path: Path) -> None:
    """Regression test: squares of raw values were out of range."""
    top = 'reductions = ["drift", "largest-tilt", "growth"]'
    given = (
        "scene.body.moments = [{0}, {1}, {2}]\nscene.initial.omega = [{3}, {4}, {5}]\n"
        "scene.run = {{step_size = {6}, steps = 20}}\nsolve.method = 'taylor'\n"
    )
    found = []
    for m, w in ((1.0, 1.0), (moment, speed)):
        folder = tmp_path / f"{w}"
        folder.mkdir()
        scene = given.format(4 * m, 3 * m, 2 * m, 0.1 * w, w, 0.05 * w, 1 / w)
        _, each = _found(folder, text(axis("omega.2", [w, 1.01 * w]), top=top, scene=scene))
        found.append(each)
    one, other = found
    assert other["largest-tilt"] == pytest.approx(one["largest-tilt"], rel=1e-9, abs=0.0)
    assert other["growth"] / speed == pytest.approx(one["growth"], rel=1e-6, abs=0.0)
    assert (other["drift"] < 1e-9).all()


def test_growth_is_that_of_the_middle_axis(tmp_path: Path) -> None:
    _, found = _found(tmp_path, text(axis("t_end", [10.0, 15.0]), top='reductions = ["growth"]'))
    logarithms = found["growth"] * [10.0, 15.0]
    # In the long run a perturbation grows with the rate sqrt((I2 - I1) (I3 - I2) / (I1 I3)).
    assert np.diff(logarithms) / 5.0 == pytest.approx(3.0**-0.5, rel=1e-3)


def test_programs_stop_where_they_stop_alone(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, PROGRAM.replace("chunk = 20", "")))
    kinds = set()
    for chunk in range(sweep.n_chunks):
        found = solve_chunk(sweep, chunk)
        names = sweep.axes[0].coordinates()
        listing = listing_of("runge-kutta", names[sweep.box(chunk)[0].start], "adopted")
        for sample in (0, 5, 11):
            for number, step_size in enumerate((0.01, 0.02)):
                first, third = (sweep.axes[n].coordinates()[sample] for n in (1, 2))
                omega = first, case_scene(3).omega[1], third
                scene = Scene("", omega, moments=case_scene(3).moments, step_size=step_size)
                alone = run_program(scene, listing)
                at = (0, sample, number)
                stop = alone.stop
                assert found["stop-step"][at] == (stop.step if stop else 0)
                variable = 1 + STOP_VARIABLES.index(stop.variable) if stop else 0
                assert found["stop-variable"][at] == variable
                kinds.add(alone.ended)
                if alone.ended == "complete":
                    assert (found["end"][at] == alone.omega[-1]).all()
                else:
                    assert np.isnan(found["end"][at]).all()
    assert kinds == {"complete", "stopped"}


@pytest.mark.parametrize(
    ("field", "values"),
    [("lipschitz", [0.5, 3.0, 500.0]), ("body.moments.1", [1.0, 1e-300]),
     ("torque.constant.1", [0.0, 2.0]), ("steps", [10, 20]), ("torque.rate.1", [0.0, 1.0])],
)  # fmt: skip
def test_programs_side_by_side_have_the_bits_of_single_runs(
    field: str, values: list[float], tmp_path: Path
) -> None:
    sweep = read_sweep(written(tmp_path, PROGRAM + axis(field, values)))
    kinds = set()
    for chunk in range(sweep.n_chunks):
        for _, batch in batches(sweep, points(sweep.box(chunk))):
            at = [1, 7, batch.scene.steps]
            found = batch.run(at)
            assert batch.listing is not None
            for i in range(len(batch.omega0)):
                lipschitz = batch.arrays.get("lipschitz", np.full(i + 1, 500.0))[i]
                alone = run_program(batch.scene_of(i), batch.listing, lipschitz=lipschitz)
                reached = [step for step in at if step <= len(alone.time)]
                rows = found.omega[i]
                assert np.array_equal(rows[: len(reached)], alone.omega[[k - 1 for k in reached]])
                assert np.isnan(rows[len(reached) :]).all()
                stop = 1 + STOP_VARIABLES.index(alone.stop.variable) if alone.stop else 0
                assert (found.n_rows[i], found.ended[i]) == (len(alone.time), alone.ended)
                assert found.stop_variable[i] == stop
            kinds.update(found.status.tolist())
    assert len(kinds) > 1


def test_overflow_has_its_time(tmp_path: Path) -> None:
    scene = """
scene = { body.coefficients = [1.0, 1.0, 1.0], initial.omega = [1.0, 1.0, 1.0], run.steps = 500 }
solve = { program = "two-term", listing = "corrected" }
"""
    axes = axis("omega.1", [1.0, 2.0]), axis("step_size", [0.001, 0.02])
    top = 'reductions = ["overflow-time", "status"]'
    _, found = _found(tmp_path, text(*axes, top=top, scene=scene))
    overflown = found["status"] == Statuses.OVERFLOW
    assert overflown.tolist() == [[False, True], [False, True]]
    assert (np.isfinite(found["overflow-time"]) == overflown).all()
    assert found["overflow-time"][1, 1] < found["overflow-time"][0, 1]
    # omega = 1 / (1 - t): a program with finite steps overflows somewhat later than t = 1.
    assert 1.0 < found["overflow-time"][0, 1] < 1.4


def test_claims_are_asked_by_name(tmp_path: Path) -> None:
    top = 'reductions = [{name = "claim", id = "stays"}]'
    axes = axis("omega.2", [0.0, 1.0, 5.0]), axis("omega.1", [0.0, 0.5])
    _, found = _found(tmp_path, text(*axes, top=top))
    judged = found["claim-stays"]
    assert judged.dtype == np.int8
    assert judged[:, 0].tolist() == [2, 1, 1]
    assert 0 in judged[:, 1]


def test_every_reduction_has_words_for_people() -> None:
    for reduction in REDUCTIONS.values():
        assert reduction.title
        assert reduction.units
        assert bool(reduction.labels) == bool(reduction.dimension)


def test_error_is_relative_to_the_largest_component_up_to_there(tmp_path: Path) -> None:
    """A torque makes omega much larger than its initial value, which would be no scale."""
    coarse = _COARSE.partition("[solve]")[0]
    scene = coarse.replace("[0.0, 1.0, 0.0]", "[0.0, 1e-3, 0.0]").replace(
        "[scene.run]", "[scene.torque]\nconstant = [0.1, -0.2, 0.3]\n[scene.run]"
    )
    top = 'reductions = ["end", {name = "error", samples = 4, as = "on-the-way"}]'
    _, found = _found(tmp_path, text(axis("method", ["improved-euler"]), top=top, scene=scene))
    torque = TorqueLaw((0.1, -0.2, 0.3))
    body = Scene("", (0.0, 1e-3, 0.0), moments=(1, 2, 3), torque=torque, step_size=0.2, steps=50)
    times = [2.5, 5.0, 7.5, 10.0]
    rows = solve(body, times, "improved-euler", 1.0).omega
    truth = solve(body, times, "reference", 1e-12).omega
    assert np.abs(truth).max() > 100.0 * 1e-3
    wanted = np.abs(rows - truth).max() / np.abs(truth).max()
    assert found["on-the-way"][0] == pytest.approx(wanted, rel=0.2)


def test_what_is_no_number_is_no_flip() -> None:
    """A component changes its sign twice, and becomes NaN after a negative value."""
    middle = np.array([-1.0, 1.0, -1.0, np.nan, np.nan])
    rows = np.stack([middle * 0.0, middle, middle * 0.0], axis=1)[None, :, :]
    solved = SimpleNamespace(
        omega0=rows[:, 0], rows=lambda samples: rows[:, 1 : 1 + samples],
        bodies=np.array([[1.0, 2.0, 3.0]]), is_program=True,
    )  # fmt: skip
    assert REDUCTIONS["flips"].compute(solved, {"samples": 4}).tolist() == [2]  # type: ignore[arg-type]

"""Sweeps of scenes whose torque depends on omega or attitude."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, read_scene, solve, torques
from pyharness.engine.system.leaf_cache import folder
from pyharness.model.codes import Statuses
from pyharness.sweep.batches import batches, solve_points
from pyharness.sweep.executors import EXECUTORS
from pyharness.sweep.report import sweep_report
from pyharness.sweep.run import places_of_a_chunk, swept
from pyharness.sweep.store import opened
from pyharness.sweep.sweep import Sweep, spread
from pyharness.sweep.sweep_file import read_sweep
from pyharness.views.render import render
from tests.conftest import Patch
from tests.sweep.sweeps import axis, every, written

SCENE = """
[scene.body]
moments = [4.0, 3.0, 2.0]
[scene.initial]
omega = [0.1, 1.0, 0.8]
attitude = [0.5, 0.5, -0.5, 0.5]
[scene.torque]
expression = ["-k*w1 + m*q0*q1", "-k*w2", "a*cos(t)/(1 + k)"]
constants = { k = 0.3, m = 2.0, a = 0.5 }
[scene.run]
step_size = 0.1
steps = 20
"""
TERMS = """
[[scene.torque.terms]]
kind = "damping"
matrix = 0.2
[[scene.torque.terms]]
kind = "gravity_gradient"
rate = 0.7
"""


def text(*axes: str, scene: str = SCENE, solver: str = "") -> str:
    """Return a sweep file that stores omega at the end and the status."""
    return "\n".join(['reductions = ["end", "status"]\n', scene, f"[solve]\n{solver}", *axes])


def ends(sweep: Sweep) -> Any:
    """Return omega at the end for all scenes, and check that all were solved."""
    found = solve_points(sweep, every(sweep))
    assert (found["status"] == Statuses.COMPLETE).all()
    return found["end"]


def torque_of(k: float = 0.3, m: float = 2.0, a: float = 0.5) -> Callable[[Any, Any, Any], Any]:
    """Return the torque of the scene as a function, with its constants."""

    def torque(t: Any, w: Any, q: Any) -> Any:
        return [-k * w[0] + m * q[0] * q[1], -k * w[1], a * np.cos(t) / (1.0 + k)]

    return torque


def scene_of(**own: Any) -> Scene:
    """Return the scene of the sweep files, with other values."""
    given = {
        "omega": (0.1, 1.0, 0.8), "moments": (4.0, 3.0, 2.0), "attitude": (0.5, 0.5, -0.5, 0.5),
        "torque": torque_of(),
    }  # fmt: skip
    return Scene("own", **{**given, **own})


# For each field: values, and the scene and the time of the end that have one of the values.
FIELDS: dict[str, tuple[list[float], Callable[[float], tuple[Scene, float]]]] = {
    "omega.2": ([0.5, 1.5], lambda x: (scene_of(omega=(0.1, x, 0.8)), 2.0)),
    "body.moments.1": ([3.5, 4.5], lambda x: (scene_of(moments=(x, 3.0, 2.0)), 2.0)),
    "attitude.1": ([0.0, -0.7], lambda x: (scene_of(attitude=(0.5, x, -0.5, 0.5)), 2.0)),
    "t_end": ([-1.0, 3.0], lambda x: (scene_of(), x)),
    "torque.constants.k": ([0.0, 0.8], lambda x: (scene_of(torque=torque_of(k=x)), 2.0)),
    "torque.constants.m": ([0.0, -1.0], lambda x: (scene_of(torque=torque_of(m=x)), 2.0)),
}


@pytest.mark.sampled
@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("solver", ["", 'method = "dop853"'])
def test_each_scene_has_its_own_solution(field: str, solver: str, tmp_path: Path) -> None:
    values, scene = FIELDS[field]
    found = ends(read_sweep(written(tmp_path, text(axis(field, values), solver=solver))))
    for row, value in zip(found, values, strict=True):
        one, time = scene(value)
        assert np.abs(row - solve(one, time, attitude=True).omega[0]).max() < 1e-7
    assert np.abs(found[0] - found[1]).max() > 1e-3


def test_constants_and_omega_on_one_grid(tmp_path: Path) -> None:
    axes = axis("omega.1", [0.2, 0.4, 0.6]), axis("torque.constants.a", [0.0, 1.0])
    sweep = read_sweep(written(tmp_path, text(*axes)))
    found = ends(sweep).reshape(3, 2, 3)
    for i, x in enumerate((0.2, 0.4, 0.6)):
        for j, a in enumerate((0.0, 1.0)):
            one = scene_of(omega=(x, 1.0, 0.8), torque=torque_of(a=a))
            assert np.abs(found[i, j] - solve(one, 2.0, attitude=True).omega[0]).max() < 1e-10
    assert [len(members) for members, _ in batches(sweep, every(sweep))] == [3, 3]


@pytest.mark.parametrize("given", [None, (4.0, 3.0, 2.5), (4.0, 3.0, 2.0)])
def test_term_has_the_inertia_of_the_varied_body_by_default(given: Any, tmp_path: Path) -> None:
    terms = TERMS + (f"inertia = {list(given)}\n" if given else "")
    scene = SCENE.replace("[scene.run]", f"{terms}[scene.run]").replace("m*q0*q1", "0")
    sweep = read_sweep(written(tmp_path, text(axis("body.moments.1", [3.5, 4.5]), scene=scene)))
    for row, moment in zip(ends(sweep), (3.5, 4.5), strict=True):
        moments = (moment, 3.0, 2.0)
        gravity = torques.gravity_gradient(given or moments, 0.7)
        total = torques.damping(0.2) + gravity + torque_of(m=0.0)
        wanted = solve(scene_of(moments=moments, torque=total), 2.0, attitude=True).omega[0]
        assert np.abs(row - wanted).max() < 1e-10


def test_constant_that_is_not_allowed_refuses_its_scenes_alone(tmp_path: Path) -> None:
    sweep = read_sweep(written(tmp_path, text(axis("torque.constants.k", [-1.0, 0.3]))))
    found = solve_points(sweep, every(sweep))
    assert found["status"].tolist() == [Statuses.REFUSED, Statuses.COMPLETE]
    assert np.isnan(found["end"][0]).all()
    assert np.isfinite(found["end"][1]).all()


@pytest.mark.parametrize("constant", [0.0, 2.0])
def test_attitudes_are_relative_to_the_start(constant: float, tmp_path: Path) -> None:
    content = text(axis("torque.constants.m", [constant]), axis("attitude.2", [0.6, -0.5]))
    sweep = read_sweep(written(tmp_path, content))
    ((_, batch),) = batches(sweep, every(sweep))
    start = np.array([[0.5, 0.5, x, 0.5] for x in (0.6, -0.5)])
    for one, attitude in zip(start, replace(batch, attitude=True).attitudes(1)[:, 0], strict=True):
        path: Any = solve(scene_of(attitude=one, torque=torque_of(m=constant)), 2.0, attitude=True)
        before, after, turned = Rotation.from_quat(
            [one, path.attitude[0], attitude], scalar_first=True
        ).as_matrix()
        assert before.T @ after == pytest.approx(turned, abs=1e-9)


@pytest.mark.parametrize("other", [(), axis("torque.constants.m", [2.0]), axis("steps", [20])])
def test_attitude_beside_another_axis_replaces_a_number_of_the_file(
    other: Any, tmp_path: Path
) -> None:
    """Regression test: it replaced a number of the unit quaternion."""
    given = SCENE.replace("[0.5, 0.5, -0.5, 0.5]", "[1.0, 1.0, -1.0, 1.0]")
    content = text(axis("attitude.2", [3.0]), *([other] if other else []), scene=given)
    sweep = read_sweep(written(tmp_path, content))
    ((_, batch),) = batches(sweep, every(sweep))
    assert batch.first_attitudes * 12.0**0.5 == pytest.approx(np.array([[1.0, 1.0, 3.0, 1.0]]))


OMEGA = axis("omega.1", [0.2])


@pytest.mark.campaign
def test_store_has_the_torque_and_refuses_another(tmp_path: Path) -> None:
    scene = tmp_path / "damped.toml"
    scene.write_text(SCENE.replace("scene.", ""))
    content = text(OMEGA, scene='[scene]\nfile = "damped.toml"')
    store = tmp_path / "store"
    with swept(read_sweep(written(tmp_path, content)), str(store), EXECUTORS[0]):
        pass
    attributes = json.loads((store / "zarr.json").read_text())["attributes"]
    again = tmp_path / "again.toml"
    again.write_text(attributes["scene"])
    assert read_scene(again) == read_scene(scene)
    with opened(read_sweep(written(tmp_path, content)), str(store)) as same:
        assert same.done() == [True]
    scene.write_text(SCENE.replace("scene.", "").replace("k = 0.3", "k = 0.4"))
    with (
        pytest.raises(InputError, match="store"),
        opened(read_sweep(written(tmp_path, content)), str(store)),
    ):
        pass


def test_scenes_solved_one_by_one_refuse_what_they_can_not_solve(tmp_path: Path) -> None:
    """The attitude of the second scene has no direction."""
    scene = SCENE.replace("0.5, 0.5, -0.5, 0.5", "1.0, 0.0, 0.0, 0.0")
    for solver in ("", 'method = "dop853"'):
        content = text(axis("attitude.0", [1.0, 0.0]), scene=scene, solver=solver)
        sweep = read_sweep(written(tmp_path, content))
        ((_, batch),) = batches(sweep, every(sweep))
        assert batch.status.tolist() == [Statuses.COMPLETE, Statuses.REFUSED]


def test_forecast_keeps_constants_that_every_scene_has_of_its_own(tmp_path: Path) -> None:
    drawn = (
        '[[axis]]\nfield = "{}"\ndraw = "uniform"\nfrom = 0.1\nto = 1.0\nseed = 1\ncount = 900\n'
    )
    fields = "torque.constants.k", "omega.1"
    sweep = read_sweep(written(tmp_path, text(*map(drawn.format, fields))))
    (places,) = places_of_a_chunk(sweep, spread(sweep, 100))
    assert len({*places.tolist()}) == 100
    grid = axis("torque.constants.k", [x / 50 for x in range(50)])
    many = drawn.format("omega.1").replace("900", "9000")
    sweep = read_sweep(written(tmp_path, text(grid, many)))
    places, _ = places_of_a_chunk(sweep, spread(sweep, 100))
    assert len({*places.tolist()}) == 5


def test_torques_are_compiled(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    given = axis("torque.constants.k", [0.1, 0.2, 0.5])
    plain, compiled = (
        ends(read_sweep(written(tmp_path, text(given, solver=solver))))
        for solver in ("", "compiled = true")
    )
    assert compiled == pytest.approx(plain, rel=0.0, abs=1e-8)
    assert len(list(folder().glob("*.so"))) == 1


@pytest.mark.usefixtures("best_level")
def test_the_report_says_whether_torques_were_compiled(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    given = axis("torque.constants.k", [0.1, 0.2])
    sweep = read_sweep(written(tmp_path, text(given, solver="compiled = true")))
    with swept(sweep, str(tmp_path / "store")) as (store, outcome):
        report = sweep_report(store, outcome, "store")
        again = sweep_report(store, replace(outcome, computed=0), "store")
    assert "Taylor terms of the torque: compiled" in render(report, "table")
    assert "Taylor terms" not in render(again, "table")


@pytest.mark.parametrize(("solver", "message"), [
    ("compiled = 1", r"\[solve\] compiled"),
    ('program = "two-term"\ncompiled = true', "compiled has no meaning with a program"),
])  # fmt: skip
def test_a_wrong_request_to_compile_is_refused(solver: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        read_sweep(written(tmp_path, text(axis("omega.1", [0.5]), solver=solver)))


INERTIA = SCENE.replace(
    "moments = [4.0, 3.0, 2.0]", "inertia = [[4, 0.1, 0], [0.1, 3, 0.2], [0, 0.2, 2]]"
)


@pytest.mark.parametrize("terms", ["", TERMS])
@pytest.mark.parametrize("torque", ["", "expression"])
def test_elements_of_an_inertia_matrix_vary(terms: str, torque: str, tmp_path: Path) -> None:
    scene = INERTIA + terms
    if not torque:
        scene = scene.replace("expression = ", "#").replace("constants = ", "#")
    given = text(
        axis("body.inertia.12", [0.0, 0.3]), axis("body.inertia.33", [2.0, 2.2]), scene=scene
    )
    found = ends(read_sweep(written(tmp_path, given))).reshape(2, 2, 3)
    for i, off in enumerate((0.0, 0.3)):
        for j, last in enumerate((2.0, 2.2)):
            row = f"inertia = [[4, {off}, 0], [{off}, 3, 0.2], [0, 0.2, {last}]]"
            own = scene.replace("inertia = [[4, 0.1, 0], [0.1, 3, 0.2], [0, 0.2, 2]]", row)
            path = written(tmp_path, own.replace("scene.", ""), "own.toml")
            assert found[i, j] == pytest.approx(solve(read_scene(path), 2.0).omega[0], abs=1e-9)


@pytest.mark.parametrize(("field", "more", "message"), [
    ("body.moments.1", "", "given by inertia"), ("tilt", "", "give moments"),
    ("body.inertia.21", "", "unknown field"), ("omega.1", 'program = "two-term"', "inertia"),
])  # fmt: skip
def test_fields_of_other_bodies_are_refused(
    field: str, more: str, message: str, tmp_path: Path
) -> None:
    scene = INERTIA.replace("expression = ", "#").replace("constants = ", "#")
    with pytest.raises(InputError, match=message):
        read_sweep(written(tmp_path, text(axis(field, [0.5, 0.6]), scene=scene, solver=more)))

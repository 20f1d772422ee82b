"""Events and sensitivities of many bodies, against those of single calls of `solve`."""

import gc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import ChangingMoments, InputError, Scene, TorqueLaw, prepare, solve, solve_many
from pyharness.engine.prepared.many_scenes import scene_of_row
from pyharness.events import crosses, flip
from pyharness.model.arrays import unit_quaternions
from pyharness.model.attitude import angle_between
from pyharness.model.codes import Statuses
from pyharness.model.extension import extension
from pyharness.torques import damping

MANY: Any = solve_many  # whose results may lack events
TOP = Scene("top", (0.3, -0.4, 1.2), moments=(4.0, 3.0, 2.0))
N = 5
RNG = np.random.default_rng(2612)
STARTS = RNG.standard_normal((N, 3))
TURNS = RNG.standard_normal((N, 4))
TIMES = RNG.uniform(2.0, 6.0, N)
MATRIX: Any = ((3.0, 0.1, 0.1), (0.1, 2.0, 0.1), (0.1, 0.1, 1.0))
LAW = TorqueLaw((0.1, 0.2, 0.0), sines=[((0.1, 0.0, 0.2), 1.5)])
# One integration has all rows.
CONTINUED = "law", "constants", "in space", "damped"
CASES: dict[str, tuple[Scene, dict[str, Any], list[str]]] = {
    "free": (TOP, {"moments": RNG.uniform(2.0, 3.0, (N, 3))}, ["omega", "moments"]),
    "law": (replace(TOP, torque=LAW), {}, ["torque.constant", "torque.sines"]),
    "constants": (
        replace(TOP, torque=LAW), {"torque_constant": RNG.standard_normal((N, 3))}, ["omega"],
    ),
    "coefficients": (TOP, {"coefficients": [[0.3, -0.5, 0.2]]}, ["coefficients"]),
    "inertia": (TOP, {"inertia": MATRIX, "attitude": TURNS}, ["inertia", "attitude"]),
    "in space": (
        replace(TOP, torque=replace(LAW, frame="space")), {"attitude": TURNS}, ["attitude"],
    ),
    "damped": (replace(TOP, torque=damping(0.1)), {}, ["omega"]),
    "body no longer changing": (
        replace(TOP, moments=None, changing=ChangingMoments([[4.0, 0.1], [3.0], [2.0]])),
        {"moments": [4.0, 3.0, 2.0]}, ["moments"],
    ),
}  # fmt: skip


def small(t: Any, omega: Any) -> Any:
    return omega[0] ** 2 - 0.04


BODIES: dict[str, Any] = {
    "moments": (4.0, 3.0, 2.0), "coefficients": (0.3, -0.5, 0.2), "inertia": MATRIX,
    "changing": ChangingMoments([[4.0, 0.1], [3.0], [2.0]]),
}  # fmt: skip


@pytest.mark.parametrize("torque", [LAW, damping(0.1)], ids=["law", "damping"])
@pytest.mark.parametrize("given", ["moments", "coefficients", "inertia"])
@pytest.mark.parametrize("body", BODIES)
def test_an_array_replaces_any_body_of_the_scene(body: str, given: str, torque: Any) -> None:
    scene = Scene("old", TOP.omega, torque=torque, **{body: BODIES[body]})
    other = Scene("new", TOP.omega, torque=torque, **{given: BODIES[given]})
    asked: dict[str, Any] = {"events": small, "sensitivities": ["omega", given]}
    found = MANY(scene, [2.0], **{given: BODIES[given]}, **asked)
    wanted: Any = solve(other, 2.0, **asked)
    assert found.refusals == {}
    assert found.t_events[0][0] == pytest.approx(wanted.t_events[0], rel=1e-9)
    for name, slopes in wanted.sensitivities.items():
        assert found.sensitivities[name][0] == pytest.approx(slopes[0], rel=1e-8, abs=1e-10)


@pytest.mark.sampled
@pytest.mark.parametrize("name", CASES)
def test_details_are_those_of_single_calls(name: str) -> None:
    scene, own, names = CASES[name]
    found = MANY(
        scene, TIMES, omega=STARTS, tolerance=1e-10, events=[flip(1), small],
        sensitivities=names, **own,
    )  # fmt: skip
    plain = solve_many(scene, TIMES, omega=STARTS, tolerance=1e-10, **own)
    assert found.omega.tobytes() == plain.omega.tobytes()
    assert found.status.tobytes() == plain.status.tobytes()
    assert found.refusals == {}
    attitude = found.attitude is not None
    rows = {key: np.atleast_2d(each) for key, each in own.items()}
    if "inertia" in rows:
        rows["inertia"] = np.array([MATRIX])
    if attitude:
        rows["attitude"] = unit_quaternions(rows["attitude"])
    base = replace(scene, changing=None, moments=TOP.moments) if scene.changing else scene
    some = 0
    for i in range(N):
        one = scene_of_row(base, {**rows, "omega": STARTS}, i)
        alone: Any = solve(
            one, float(TIMES[i]), tolerance=1e-10, attitude=attitude, events=[flip(1), small],
            sensitivities=names,
        )  # fmt: skip
        assert np.allclose(alone.omega[0], found.omega[i], rtol=0.0, atol=1e-9)
        for k in range(2):
            assert np.array_equal(found.t_events[k][i], alone.t_events[k])
            assert np.array_equal(found.y_events[k][i], alone.y_events[k])
            some += len(alone.t_events[k])
        for each in names:
            assert np.array_equal(found.sensitivities[each][i], alone.sensitivities[each][0])
    assert some


def test_sequences_of_scenes() -> None:
    scenes = [
        replace(TOP, omega=tuple(STARTS[0])),
        replace(TOP, moments=None, inertia=MATRIX),
        replace(TOP, torque=damping(0.1)),
    ]
    found = MANY(scenes, [1.0, 2.0, 9.0], events=flip(2), sensitivities=["omega"])
    for i, (scene, time) in enumerate(zip(scenes, (1.0, 2.0, 9.0), strict=True)):
        alone: Any = solve(scene, time, events=flip(2), sensitivities=["omega"])
        assert np.array_equal(found.t_events[0][i], alone.t_events[0])
        assert np.array_equal(found.sensitivities["omega"][i], alone.sensitivities["omega"][0])


def test_a_refused_sequence_of_scenes_leaves_out_as_it_was() -> None:
    scenes = [TOP, replace(TOP, torque=replace(LAW, frame="space"))]
    out = np.zeros((2, 3))
    with pytest.raises(InputError, match="the torque needs the initial attitude"):
        MANY(scenes, 1.0, out=out)
    assert not out.any()


def test_events_without_sensitivities() -> None:
    found = MANY(TOP, 5.0, omega=STARTS, events=small)
    assert (found.refusals, found.sensitivities) == ({}, None)
    for start, times in zip(STARTS, found.t_events[0], strict=True):
        alone: Any = solve(replace(TOP, omega=tuple(start)), 5.0, events=small)
        assert np.array_equal(times, alone.t_events[0])


def test_a_body_without_result_has_no_details() -> None:
    moments = np.array([[4.0, 3.0, 2.0], [4.0, -3.0, 2.0], [4.0, 3.0, 2.0]])
    starts = [STARTS[0], STARTS[1], (np.inf, 0.0, 0.0)]
    found = MANY(
        TOP, 5.0, omega=starts, moments=moments, events=small, sensitivities=["moments"]
    )  # fmt: skip
    assert found.status[1] == Statuses.REFUSED
    assert found.t_events[0][0] is not None
    assert [each is None for each in found.t_events[0]] == [False, True, True]
    assert [each is None for each in found.y_events[0]] == [False, True, True]
    assert np.isnan(found.sensitivities["moments"]).all(axis=(1, 2)).tolist() == [False, True, True]
    assert list(found.refusals) == [1]
    assert "I2 is -3" in found.refusals[1]


def test_a_refused_body_has_its_reason_and_no_influence() -> None:
    def wrong(t: Any, omega: Any) -> Any:
        return np.where(np.asarray(omega[2]) > 5.0, np.nan, omega[0])

    starts = np.array([STARTS[0], (0.1, 0.2, 6.0), STARTS[1]])
    found = MANY(TOP, 1.0, omega=starts, events=wrong, sensitivities=["omega"])
    assert list(found.refusals) == [1]
    assert "the function returned nan" in found.refusals[1]
    assert found.has_result.all()
    assert [each is None for each in found.t_events[0]] == [False, True, False]
    assert np.isnan(found.sensitivities["omega"]).any(axis=(1, 2)).tolist() == [False, True, False]


def test_results_may_be_written_over_the_starts() -> None:
    starts, turns = STARTS.copy(), TURNS.copy()
    found = MANY(TOP, 3.0, omega=starts, attitude=turns, sensitivities=["omega"], events=flip(1))
    again = MANY(
        TOP, 3.0, omega=starts, attitude=turns, sensitivities=["omega"], events=flip(1),
        out=replace(found, omega=starts, attitude=turns),
    )  # fmt: skip
    assert again.omega is starts
    assert np.array_equal(again.sensitivities["omega"], found.sensitivities["omega"])
    assert all(map(np.array_equal, again.t_events[0], found.t_events[0]))
    plain = MANY(TOP, 2.0, omega=STARTS, attitude=TURNS, out=again)
    assert plain.omega is starts
    assert plain.t_events is plain.y_events is plain.sensitivities is plain.refusals is None


def test_no_bodies() -> None:
    found = MANY(TOP, 1.0, omega=np.empty((0, 3)), events=flip(1), sensitivities=["omega"])
    assert found.t_events == found.y_events == [[]]
    assert len(found.sensitivities["omega"]) == 0


@pytest.mark.parametrize("given", [{"events": crosses(1, 0.1, terminal=True)},
                                   {"sensitivities": ["mass"]}])  # fmt: skip
def test_mistakes_are_refused_before_any_body_is_solved(given: dict[str, Any]) -> None:
    out = np.full((N, 3), 7.0)
    with pytest.raises(InputError):
        MANY(TOP, 1.0, omega=STARTS, out=out, **given)
    assert (out == 7.0).all()


def test_bar_counts_the_bodies_again(capsys: pytest.CaptureFixture[str]) -> None:
    MANY(TOP, 1.0, omega=STARTS, events=flip(1), progress=True)
    assert capsys.readouterr().err.count("5.00/5.00") >= 2


def test_the_garbage_collector_sees_what_the_compiled_entry_refers_to() -> None:
    entry = prepare(Scene("", (1.0, 0.0, 0.0), moments=(3.0, 2.0, 1.0)), "taylor", 1e-9).many
    kernel, fallback = gc.get_referents(entry)
    assert kernel is extension().solve_packed_many
    assert callable(fallback)


@pytest.mark.sampled
@pytest.mark.parametrize("name", CASES)
def test_rows_over_time_are_those_of_final_times(name: str) -> None:
    scene, own, names = CASES[name]
    times = [3.0, 0.5, 0.0, -2.0]
    found = MANY(
        scene, times=times, omega=STARTS, tolerance=1e-10, estimates=True, threads=2,
        sensitivities=names, events=flip(1), **own,
    )  # fmt: skip
    assert found.times.tolist() == times
    for k, time in enumerate(times):
        one = MANY(
            scene, time, omega=STARTS, tolerance=1e-10, estimates=True, sensitivities=names, **own
        )  # fmt: skip
        assert found.ended[:, k].tolist() == one.ended.tolist()
        assert (found.attitude is None) == (one.attitude is None)
        if name in CONTINUED:
            away = np.abs(found.omega[:, k] - one.omega).max(axis=1)
            allowed = found.error[:, k] + one.error
            assert (away <= allowed * np.abs(STARTS).max(axis=1) + 1e-15).all()
            assert (allowed <= 1e-10).all()
        else:
            assert found.omega[:, k].tobytes() == one.omega.tobytes()
            assert np.array_equal(found.estimates[:, k], one.estimates, equal_nan=True)
        if one.attitude is not None and name in CONTINUED:
            assert angle_between(found.attitude[:, k], one.attitude).max() <= allowed.max() + 1e-15
        elif one.attitude is not None:
            assert found.attitude[:, k].tobytes() == one.attitude.tobytes()
        for each in names:
            slopes = found.sensitivities[each]
            wanted = one.sensitivities[each]
            assert slopes[:, k] == pytest.approx(wanted, rel=1e-7, abs=1e-8 * abs(wanted).max())
    frame, data = found.to_pandas(), found.to_xarray()
    assert np.array_equal(frame.loc[2].loc[0.5, "omega1"], found.omega[2, 1, 0])
    assert np.array_equal(data.omega.sel(body=2, time=0.5, axis=1), found.omega[2, 1, 0])
    assert ("q3" in frame) == ("attitude" in data) == (found.attitude is not None)
    assert data.growth.values.tobytes() == frame["growth"].to_numpy().tobytes()


def test_scenes_have_rows_over_time() -> None:
    scenes = [replace(TOP, torque=damping(0.1)), replace(TOP, moments=(2.0, 2.0, 1.0))]
    found = MANY(scenes, times=[1.0, 2.0])
    assert found.omega[:, 1] == pytest.approx(solve_many(scenes, 2.0).omega, rel=1e-11)
    assert found.omega.shape == (2, 2, 3)
    assert solve_many(TOP, times=[1.0, 2.0], omega=np.empty((0, 3))).omega.shape == (0, 2, 3)
    final = solve_many(TOP, 2.0).to_pandas()
    assert (list(final.columns), final.index.name) == (
        ["omega1", "omega2", "omega3", "ended"], "body",
    )  # fmt: skip
    assert final.attrs["units"]["omega3"] == "rad/s"


def test_attitudes_at_a_time_are_those_of_a_call_with_this_time() -> None:
    draw = np.random.default_rng(0)
    given: Any = {"omega": draw.normal(size=(200, 3)), "attitude": draw.normal(size=(200, 4))}
    found, last = MANY(TOP, times=[1.0, 2.0], **given), MANY(TOP, 2.0, **given)
    np.testing.assert_array_equal(found.attitude[:, 1], last.attitude)


@pytest.mark.parametrize("shape", [(3,), (4, 3), (3, 3), (4, 3, 3)])
def test_energy_and_angular_momentum_are_those_of_trajectories(shape: tuple[int, ...]) -> None:
    draw = np.random.default_rng(3)
    body = draw.uniform(1.0, 2.0, shape)
    if shape[-2:] == (3, 3):
        body = body @ np.swapaxes(body, -1, -2) + np.eye(3)
    starts, times = draw.normal(size=(4, 3)), [1.0, 2.5]
    key = "inertia" if shape[-2:] == (3, 3) else "moments"
    given: Any = {key: body}
    scene = Scene("many", (0.0, 0.0, 1.0), moments=(1.0, 2.0, 2.5))
    turned = (0.5, 0.5, -0.5, 0.5)
    settings: Any = {**given, "omega": starts, "attitude": turned, "tolerance": 1e-12}
    found = solve_many(scene, times=times, **settings)
    last = solve_many(scene, 2.5, **settings)
    for i in range(4):
        own: Any = body if len(shape) == 1 or shape == (3, 3) else body[i]
        of_one: Any = {key: own.tolist()}
        one = solve(Scene("one", starts[i], attitude=turned, **of_one), times, attitude=True)
        space = one.angular_momentum("space")
        assert found.energy(**given)[i] == pytest.approx(one.energy(), rel=1e-11)
        assert last.energy(**given)[i] == pytest.approx(one.energy()[-1], rel=1e-11)
        assert found.angular_momentum("space", **given)[i] == pytest.approx(space, rel=1e-10)
        assert last.angular_momentum("space", **given)[i] == pytest.approx(space[-1], rel=1e-10)

"""Batches that combine torques, bodies, parameters, own states and times, compared with `solve`."""

from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, TorqueLaw, solve, solve_many
from pyharness.engine.prepared import many_laws, many_prepared, many_scenes
from pyharness.engine.prepared.many_tape import sides_of
from tests.campaigns import driver
from tests.campaigns.combination_campaign import (
    BODIES,
    MATRIX,
    MOMENTS,
    TORQUES,
    clipped,
    draw,
    judge,
    linear,
)

RNG = np.random.default_rng(4)
N = 5
STARTS = RNG.standard_normal((N, 3))
TURNS = RNG.standard_normal((N, 4))


@pytest.mark.parametrize("torque", TORQUES)
@pytest.mark.parametrize("seed", range(4))
def test_random_combinations_are_within_their_tolerance(torque: str, seed: int) -> None:
    """`python -m tests.campaigns.combination_campaign 100 1` tries more, and prints run times."""
    tally = driver.Tally(seed=str(seed))
    batch = draw(Random(f"{torque} {seed}"), torque, N)
    judge(tally, batch, solve_many(batch.scene, **batch.arguments, estimates=True))
    assert tally.faults == []
    assert any(name.startswith("error, tolerances") for name in tally.ratios)


def own_body(body: str) -> dict[str, Any]:
    return {"inertia": MATRIX.tolist()} if body == "matrix" else {"moments": MOMENTS}


def arrays_of(body: str) -> dict[str, Any]:
    if body == "arrays of moments":
        return {"moments": np.add(MOMENTS, RNG.uniform(0.0, 0.5, (N, 3)))}
    if body == "arrays of matrices":
        return {"inertia": MATRIX + RNG.uniform(0.0, 0.5, (N, 3))[:, :, None] * np.eye(3)}
    return {}


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("torque", [linear, clipped])
def test_no_body_of_a_recorded_torque_is_prepared_alone(
    torque: Any, body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One kernel call solves all bodies, those with switches too."""
    scene = Scene("", (1.0, 1.0, 1.0), torque=torque, **own_body(body))
    arrays = {**arrays_of(body), "parameters": {"c": RNG.uniform(0.05, 0.15, N)}}

    def refused(*_: Any, **more: Any) -> None:
        raise AssertionError("a body is prepared")

    monkeypatch.setattr("pyharness.engine.many.many_recorded.prepare", refused)
    monkeypatch.setattr(many_prepared, "_solve_row", refused)
    found = solve_many(scene, 2.0, omega=STARTS, tolerance=1e-9, **arrays)
    assert found.has_result.all()
    assert found.refusals is None
    alone = f"; {N} of {N} bodies one by one, because of switches"
    assert found.leaves == "interpreter" + (alone if torque is clipped else "")


@pytest.mark.parametrize("law", [TorqueLaw((0.1, 0.2, -0.1)), TorqueLaw(), linear, clipped])
@pytest.mark.parametrize("times", [
    [0.5, 1.0, 2.5], [2.5, 1.0, 0.5], [-2.0, -0.1], [-0.1, -2.0], [1.0, 0.0, -2.0], [-1.0, 0.0],
])  # fmt: skip
def test_rows_are_at_their_times_in_any_order(law: Any, times: list[float]) -> None:
    scene = Scene("", (1.0, 1.0, 1.0), moments=MOMENTS, torque=law)
    found = solve_many(scene, times=times, omega=STARTS, tolerance=1e-10)
    assert found.times is not None
    assert found.times.tolist() == times
    for i, start in enumerate(STARTS):
        one = solve(replace(scene, omega=start), times, tolerance=1e-12)
        assert found.omega[i] == pytest.approx(one.omega, abs=1e-10 * np.abs(start).max())


@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("body", ["moments", "arrays of moments"])
@pytest.mark.parametrize(
    "law",
    [TorqueLaw(), TorqueLaw((0.1, 0.2, -0.1)), TORQUES["law"]],
    ids=["none", "constant", "waves"],
)
def test_a_body_is_solved_once_for_all_times(
    law: TorqueLaw, body: str, attitude: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows of a body cost less than as many bodies."""

    def refused(*_: Any, **more: Any) -> None:
        raise AssertionError("bodies are copied")

    monkeypatch.setattr(many_laws, "solve_bodies", refused)
    scene = Scene("", (1.0, 1.0, 1.0), torque=law, **own_body(body))
    given = {"omega": STARTS, **({"attitude": TURNS} if attitude else {}), **arrays_of(body)}
    times = [2.5, 1.0, 0.0, -0.1, -2.0]
    found = solve_many(scene, times=times, tolerance=1e-9, estimates=True, **given)
    assert found.error is not None
    assert (found.error <= 1e-9).all()
    monkeypatch.undo()
    for k, time in enumerate(times):
        one = solve_many(scene, time, tolerance=1e-13, **given)
        assert found.omega[:, k] == pytest.approx(one.omega, abs=1e-9 * np.abs(STARTS).max())
        if found.attitude is not None:
            assert found.attitude[:, k] == pytest.approx(one.attitude, abs=1e-9)


@pytest.mark.parametrize(
    "torque", [{}, {"torque_constant": STARTS}, {"sines": [[[1, 2, 3, 4]]] * N}]
)
def test_one_matrix_has_its_axes_found_once(
    torque: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    find, counts = many_scenes.find_frames, []

    def counted(matrices: Any, vectors: Any) -> Any:
        counts.append(len(matrices))
        return find(matrices, vectors)

    scene = Scene("", (1.0, 1.0, 1.0), inertia=MATRIX.tolist())
    given: Any = {"omega": STARTS, "attitude": TURNS, "tolerance": 1e-12, **torque}
    wanted = solve_many(scene, 2.0, inertia=[MATRIX] * N, **given)
    monkeypatch.setattr(many_scenes, "find_frames", counted)
    found = solve_many(scene, 2.0, **given)
    assert counts == [1]
    assert found.omega == pytest.approx(wanted.omega, rel=1e-12)
    assert found.attitude == pytest.approx(wanted.attitude, rel=1e-12)


def test_times_are_divided_into_the_two_sides_of_zero() -> None:
    rng = np.random.default_rng(1)
    for count in range(1, 7):
        for _ in range(20):
            times = np.unique(rng.integers(-4, 5, count)).astype(float)[:: rng.choice([1, -1])]
            wanted = times.copy()
            if len(times) > 2:  # beyond the span of a changing inertia
                times[[0, -1]] = np.where(np.abs(times[[0, -1]]) > 3.0, np.nan, times[[0, -1]])
            sides = [times[side].tolist() for side in sides_of(times)]
            for side in sides:
                assert side == sorted(side, key=abs)
                assert len({x < 0.0 for x in side}) == 1
            known = times[~np.isnan(times)] if len(times) > 1 else wanted
            assert sorted(time for side in sides for time in side) == sorted(known.tolist())


@pytest.mark.parametrize("own", [{}, {"parameters": {"c": 0.1}}, {"moments": [MOMENTS] * N}])
def test_results_of_own_states_do_not_depend_on_other_bodies(own: dict[str, Any]) -> None:
    def law(t: Any, omega: Any, states: Any, c: float = 0.1) -> Any:
        return -c * omega, {"x": omega[0] - 0.1 * states["x"]}

    scene = Scene("", (1.0, 1.0, 1.0), moments=MOMENTS, torque=law, states={"x": (0.0, 0.0)})
    starts = {"x": np.array([0.0, 0.1, 0.0, -2.0, 1e-3])}
    whole = solve_many(scene, times=[0.5, 2.0], omega=STARTS, states=starts, **own)
    assert whole.has_result.all()
    for i in range(N):
        rows = {
            name: values[i : i + 1] if name == "moments" else values for name, values in own.items()
        }
        part = solve_many(
            scene, times=[0.5, 2.0], omega=STARTS[i : i + 1], states={"x": starts["x"][i : i + 1]},
            **rows,
        )  # fmt: skip
        assert part.omega[0].tobytes() == whole.omega[i].tobytes()
        assert part.states["x"][0].tobytes() == whole.states["x"][i].tobytes()


@pytest.mark.parametrize("start", [(1.0, 0.0), (1.0, 5.0), (1e-3, 0.0)])
def test_own_states_faster_than_omega_are_solved_side_by_side(start: tuple[float, float]) -> None:
    def law(t: Any, omega: Any, states: Any, f: float = 20.0) -> Any:
        return -0.1 * omega, {"x": f * states["y"], "y": -f * states["x"]}

    given: Any = {"x": start, "y": (0.0, start[1])}
    scene = Scene("", (1.0, 0.5, 0.2), moments=MOMENTS, torque=law, states=given)
    for own in ({}, {"parameters": {"f": [20.0] * N}}, {"times": [0.7, 2.0]}):
        arguments: Any = {"t_end": None if "times" in own else 2.0, "omega": STARTS, **own}
        found = solve_many(scene, **arguments, tolerance=1e-9, estimates=True)
        assert found.leaves == "interpreter"
        x = found.states["x"].reshape(N, -1)[:, -1]
        assert x == pytest.approx(start[0] * np.cos(40.0), abs=1e-9 * max(start))
        y = found.states["y"].reshape(N, -1)[:, -1]
        assert y == pytest.approx(-start[0] * np.sin(40.0), abs=1e-9 * max(start))


def test_a_state_that_stays_zero_is_solved() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return -0.1 * omega, {"x": -states["x"], "y": omega[0] * 0.0 + t}

    scene = Scene("", (1.0, 0.5, 0.2), moments=MOMENTS, torque=law, states={"x": 0.0, "y": 0.0})
    found = solve_many(scene, 2.0, omega=STARTS, tolerance=1e-10)
    assert found.has_result.all()
    assert (found.states["x"] == 0.0).all()
    assert found.states["y"] == pytest.approx(2.0, rel=1e-10)


def reasons(**given: Any) -> dict[int, str]:
    scene = Scene("", (1.0, 1.0, 1.0), moments=MOMENTS, torque=given.pop("torque", TorqueLaw()))
    found: Ensemble = solve_many(scene, 1.0, **given)
    return found.refusals or {}


def test_the_mistake_of_a_body_is_named() -> None:
    moments = np.tile(MOMENTS, (N, 1))
    moments[2, 1] = -1.0
    inverse = {"torque": lambda t, omega, c=1.0: -omega / c, "parameters": {"c": [1.0, 1.0, 0.0]}}
    for given in (
        {"moments": moments}, {"moments": moments, "torque": linear},
        {"inertia": moments[:, :, None] * np.eye(3), "torque": clipped},
        {"omega": np.where(np.arange(N)[:, None] == 2, np.nan, STARTS), "torque": linear}, inverse,
    ):  # fmt: skip
        named = reasons(**given)
        assert list(named) == [2]
        assert "allowed" in named[2] or "constant 0" in named[2]
    assert reasons(omega=STARTS) == {}


def test_the_mistake_of_a_scene_in_a_list_is_named() -> None:
    scenes = [Scene("", start, moments=MOMENTS, torque=linear) for start in STARTS]
    found = solve_many(scenes, 1.0)
    for i, scene in enumerate(scenes):
        assert found.omega[i] == pytest.approx(solve(scene, 1.0).omega[0], abs=1e-11)
    with_state = Scene(
        "", (1.0, 0.0, 0.0), moments=MOMENTS, states={"x": 1.0},
        torque=lambda t, omega, states: (-omega, {"x": -states["x"]}),
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"scene 5: .*states of its own"):
        solve_many([*scenes, with_state], 1.0)

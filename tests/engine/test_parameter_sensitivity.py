"""Sensitivities: derivatives with respect to parameters, against solutions of 40 digits."""

import decimal
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import ChangingMoments, InputError, Scene, TorqueLaw, load, solve
from pyharness.engine.system.parameters import parameters_of
from pyharness.engine.torques.scene_reader import scene_of_file
from pyharness.events import crosses
from pyharness.model.attitude import product
from pyharness.torques import damping, recorded, table
from tests.campaigns import parameter_campaign
from tests.campaigns.parameter_campaign import KINDS, LIMIT, random_scene

LAW = TorqueLaw((0.1, -0.2, 0.05), sines=[((0.1, 0.2, 0.3), 1.3)])
BRICK = Scene("brick", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2))
MATRIX = ((3.0, 0.2, -0.1), (0.2, 2.0, 0.3), (-0.1, 0.3, 1.2))


def _decay(t: Any, omega: Any, *, rate: float = 0.1, on: bool = True) -> Any:
    return [-rate * w for w in omega]


def slopes(scene: Scene, times: Any, *names: str, **options: Any) -> Any:
    found: Any = solve(scene, times, **options, sensitivities=names)
    if len(names) == 1:
        return found.sensitivities[names[0]]
    return found.sensitivities


def differences(
    made: Callable[[Any], Scene], values: list[float], times: Any, attitude: bool = False
) -> Any:
    """Return derivatives of order four from solutions at a tolerance of 1e-15."""

    def rows(k: int, size: float) -> Any:
        changed = [x + size * (k == j) for j, x in enumerate(values)]
        return solve(made(changed), times, "taylor", 1e-15, attitude=attitude).y.T

    h = 2.0**-9
    columns = [
        (8.0 * (rows(k, h) - rows(k, -h)) - (rows(k, 2.0 * h) - rows(k, -2.0 * h))) / (12.0 * h)
        for k in range(len(values))
    ]
    return np.stack(columns, axis=2)


def check(found: Any, expected: Any, limit: float = 1e-9) -> None:
    """Check an error relative to the largest derivative."""
    assert np.abs(found - expected).max() <= limit * np.abs(expected).max()


@pytest.mark.sampled
@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_within_the_limit(kind: str) -> None:
    scene, time, names = random_scene(Random(f"tested {kind}"), kind)
    # Few columns and a short time suffice here; the campaign has all.
    found: Any = parameter_campaign.error_of(scene, np.copysign(1.5, time), names[::2])
    assert found[0] <= LIMIT / 100.0


@pytest.mark.parametrize("times", [[1.0, 4.0], [-3.0, -1.0, 0.0, 2.0], [2.0, 1.0, -1.0]])
def test_every_parameter_of_a_law_on_both_sides_of_0(times: list[float]) -> None:
    scene = replace(BRICK, torque=LAW, attitude=(0.6, 0.0, 0.8, 0.0))
    names = ["moments", "torque.constant", "omega", "attitude", "torque.rate", "torque.sines"]
    found = slopes(scene, times, *names, attitude=True)
    assert list(found) == names
    assert {name: found[name].shape for name in names} == {
        name: (len(times), 7, 4 if name == "torque.sines" else 3) for name in names
    }

    def turned(angles: Any) -> Scene:
        # To first order in the angles, and so are differences of the fourth order.
        half = np.array(angles) / 2.0
        size = np.sqrt(half @ half)
        turn = (np.cos(size), *(half * np.sinc(size / np.pi)))
        return replace(scene, attitude=product((0.6, 0.0, 0.8, 0.0), turn))

    made: dict[str, tuple[Callable[[Any], Scene], list[float]]] = {
        "moments": (lambda x: replace(scene, moments=x), [3.0, 2.0, 1.2]),
        "omega": (lambda x: replace(scene, omega=x), [0.3, 1.1, -0.7]),
        "attitude": (turned, [0.0, 0.0, 0.0]),
        "torque.constant": (
            lambda x: replace(scene, torque=replace(LAW, constant=x)), [0.1, -0.2, 0.05]
        ),
        "torque.rate": (lambda x: replace(scene, torque=replace(LAW, rate=x)), [0.0, 0.0, 0.0]),
        "torque.sines": (
            lambda x: replace(scene, torque=TorqueLaw(LAW.constant, sines=[(x[:3], x[3])])),
            [0.1, 0.2, 0.3, 1.3],
        ),
    }  # fmt: skip
    for name, (scene_of, values) in made.items():
        check(found[name], differences(scene_of, values, times, attitude=True), 2e-8)


def test_rows_at_time_0_are_the_derivatives_of_the_initial_state() -> None:
    found = slopes(BRICK, [-1.0, 0.0, 1.0], "omega", "moments", "attitude", attitude=True)
    assert np.array_equal(found["omega"][1], np.eye(7, 3))
    assert not found["moments"][1].any()
    assert np.array_equal(found["attitude"][1][3:], 0.5 * np.eye(4, 3, -1))
    for scene in (BRICK, _BOOMS, replace(_BOOMS, torque=TorqueLaw())):
        assert np.array_equal(slopes(scene, 0.0, "omega")[0], np.eye(3))


def test_times_in_any_number_have_the_same_derivatives() -> None:
    times = np.linspace(0.0, 9.0, 300)
    many = slopes(BRICK, times, "omega", "moments", tolerance=1e-12)
    one = slopes(BRICK, 9.0, "moments", tolerance=1e-12)
    assert np.abs(many["moments"][-1] - one[0]).max() <= 1e-12 * np.abs(one).max()
    few = slopes(BRICK, times[::50], "omega", tolerance=1e-12)
    assert np.abs(few - many["omega"][::50]).max() <= 1e-12 * np.abs(few).max()


def test_more_columns_than_lanes() -> None:
    law = LAW + TorqueLaw(cosines=[((0.3, 0.2, 0.1), 0.7), ((0.1, 0.1, 0.1), 2.0)])
    scene = replace(BRICK, torque=law)
    names = ("omega", "moments", "torque.cosines", "torque.sines", "torque.constant")
    together = slopes(scene, [2.0, 5.0], *names)
    for name in names:
        check(together[name], slopes(scene, [2.0, 5.0], name), 1e-12)


def pushed_by(torque: Any, scene: Scene = BRICK) -> Scene:
    return replace(scene, torque=torque)


def _full(values: Any) -> Scene:
    a, b, c, d, e, f = values
    return Scene("full", BRICK.omega, inertia=((a, d, e), (d, b, f), (e, f, c)), torque=LAW)


def _soon(t: Any) -> Any:
    return [3.0 + 0.1 * np.minimum(t, 1e-7), 4.0, 5.0]


def _brake(t: Any, omega: Any, *, gain: float) -> Any:
    return -gain * omega


_AXES = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
_NEEDLE = _AXES @ np.diag([1e-8, 1.0, 1.0 + 3e-9]) @ _AXES.T
_OMEGA = (_AXES @ [0.3, 0.5, 0.7]).tolist()


_ABC = Scene("body", BRICK.omega, coefficients=(0.3, -0.6, 0.4), torque=LAW)
_BOOMS = Scene("booms", BRICK.omega, ChangingMoments([(3.0, 0.1), (2.0, 0.2), (1.2,)]), torque=LAW)
# A table ends steps, and a body starts from rest.
_HELD = table([0.0, 1.0, 2.0], [(0.1, 0.0, 0.2), (-0.3, 0.2, 0.0), (0.0, 0.0, 0.1)], "held")
_THRUSTER = replace(BRICK, omega=(0.0, 0.0, 0.0), torque=_HELD)
# By a parameter: its values, the scene for other values, times, and whether there is an attitude.
# By a parameter: its values, the scene for other values, times, whether there is an attitude, the
# tolerance, and the largest relative error.
MADE: dict[str, tuple[str, list[float], Callable[[Any], Scene], list[float], bool, Any, float]] = {
    "inertia": (
        "inertia", [3.0, 2.0, 1.2, 0.2, -0.1, 0.3], _full, [1.0, 3.0], True, None, 1e-8
    ),
    "coefficients": (
        "coefficients", [0.3, -0.6, 0.4], lambda x: replace(_ABC, coefficients=x), [1.0, 3.0],
        False, None, 1e-9,
    ),
    "constant torque": (
        "torque.constant", [0.1, -0.2, 0.05],
        lambda x: replace(_BOOMS, torque=replace(LAW, constant=x)), [1.0, 3.0], False, None, 1e-9,
    ),
    "start of a thruster": (
        "omega", [0.0] * 3, lambda x: replace(_THRUSTER, omega=x), [0.5, 1.0, 1.5, 2.5], False,
        None, 1e-9,
    ),
    "moments of a thruster": (
        "moments", [3.0, 2.0, 1.2], lambda x: replace(_THRUSTER, moments=x), [0.5, 1.0, 1.5, 2.5],
        False, None, 1e-9,
    ),
    "rate of a function": (
        "torque.rate", [0.1], lambda x: pushed_by(partial(_decay, rate=x[0])), [2.0], False, None,
        1e-9,
    ),
    "tilted needle": (
        "omega", _OMEGA, lambda x: Scene("", tuple(x), inertia=(_NEEDLE + _NEEDLE.T) / 2), [3.0],
        False, 1e-12, 1e-9,
    ),
    # A short step to a switch does not count in the forecast of work.
    "switch of the inertia": (
        "torque.gain", [0.3],
        lambda x: Scene("", (0.3, 0.2, 0.9), moments=_soon, torque=partial(_brake, gain=x[0])),
        [1.0], False, None, 1e-9,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", MADE)
def test_parameters_of_bodies_and_starts(kind: str) -> None:
    name, values, made, times, attitude, tolerance, limit = MADE[kind]
    found = slopes(made(values), times, name, attitude=attitude, tolerance=tolerance)
    check(found, differences(made, values, times, attitude), limit)
    assert "moments" not in parameters_of(_BOOMS)


def test_parameters_of_functions_expressions_and_sums() -> None:
    brake: Any = _decay
    assert parameters_of(pushed_by(brake)) == {"moments": [3.0, 2.0, 1.2], "torque.rate": [0.1]}
    other: Any = partial(_decay, rate=0.3)
    assert parameters_of(pushed_by(other))["torque.rate"] == [0.3]
    # The name of two parameters is the name of none.
    twice = pushed_by(recorded(brake) + recorded(other) + LAW + damping(0.1))
    known = parameters_of(twice)
    assert list(known) == ["moments", "torque.rate", "torque.constant", "torque.sines"]
    assert [name for name, values in known.items() if values is None] == ["torque.rate"]
    assert parameters_of(pushed_by(twice.torque + recorded(brake)))["torque.rate"] is None
    first, again = (slopes(x, [2.0], "torque.sines") for x in (twice, pushed_by(twice.torque)))
    assert np.array_equal(first, again)


def test_an_argument_of_a_branch_is_no_parameter() -> None:
    def torque(t: Any, omega: Any, *, sign: float = 1.0, gain: float = 0.5, n: int = 3) -> Any:
        return [-(gain if sign > 0 else -gain) * w**n for w in omega]

    assert list(parameters_of(pushed_by(torque))) == ["moments", "torque.gain"]


def _constant(t: Any, omega: Any, *, constant: float = 0.0) -> Any:
    return [constant * np.sin(t), 0.0, constant]


@pytest.mark.parametrize(
    "law", [TorqueLaw(), TorqueLaw(sines=[((0, 0, 0), 0.4)]), _constant],
    ids=["no terms", "wave without amplitude", "function with the name of a term"],
)  # fmt: skip
def test_a_torque_that_is_0_need_not_have_periodic_derivatives(law: Any) -> None:
    scene = Scene("zero", (0.1, 0.5, 0.3), moments=(1.0, 2.0, 3.0), torque=law)
    assert scene.torque.is_zero
    names = [name for name in parameters_of(scene) if name.startswith("torque")]
    found, series = (slopes(scene, [10.0, 200.0], *names, method=x) for x in ("auto", "taylor"))
    if len(names) == 1:
        assert names == ["torque.constant"]
        assert found.shape == (2, 3, 1 if law is _constant else 3)
        found, series = {names[0]: found}, {names[0]: series}
    for name in names:
        check(found[name], series[name])


def _sized(t: Any, omega: Any, *, size: float = 0.3) -> Any:
    return [size, 0.0, size * np.sin(t)]


def test_names_of_summands() -> None:
    both = pushed_by(recorded(_decay) + pushed_by(_sized).law)
    assert list(parameters_of(both)) == ["moments", "torque.rate", "torque.size"]


def test_a_limit_of_the_inertia_that_is_not_reached_changes_nothing() -> None:
    def scene(length: Callable[[Any], Any]) -> Scene:
        def moments(t: Any) -> Any:
            return np.array([20.0, 22.0, 25.0]) + length(t) ** 2 * np.array([0.0, 4.0, 4.0])

        return Scene("booms", (0.1, 0.2, 1.0), moments=moments, torque=damping(0.5) + LAW)

    limited = scene(lambda t: 0.5 + 0.1 * np.minimum(t, 30.0))
    free = scene(lambda t: 0.5 + 0.1 * t)
    for name in ("torque.rate", "torque.constant", "torque.sines", "omega"):
        expected = slopes(free, 10.0, name, tolerance=1e-12)
        check(slopes(limited, 10.0, name, tolerance=1e-12), expected)


@pytest.mark.parametrize("expression", ['["a*w1", "b", "0"]', '["a", "b*sin(t)", "0"]'])
def test_constants_of_a_scene_file(expression: str) -> None:
    text = (
        'name = "named"\n[body]\nmoments = [3.0, 2.0, 1.2]\n'
        "[initial]\nomega = [0.3, 1.1, -0.7]\n"
        f"[torque]\nexpression = {expression}\n[torque.constants]\na = 0.2\nb = -0.1\n"
    )

    def scene(values: list[float]) -> Scene:
        given = text.replace("0.2\n", f"{values[0]!r}\n").replace("-0.1\n", f"{values[1]!r}\n")
        return scene_of_file(given.encode(), "", "scene file")

    found = slopes(scene([0.2, -0.1]), [2.0], "torque.a", "torque.b")
    expected = differences(scene, [0.2, -0.1], [2.0])
    for k, name in enumerate(("torque.a", "torque.b")):
        assert np.abs(found[name][..., 0] - expected[..., k]).max() <= 1e-9


def test_a_function_that_is_a_law_keeps_its_names_until_its_numbers_change() -> None:
    scene = pushed_by(_sized)
    assert list(parameters_of(replace(scene, omega=(1.0, 2.0, 3.0)))) == ["moments", "torque.size"]
    other = pushed_by(replace(scene.law, rate=(0.0, 1.0, 0.0)), scene)
    assert list(parameters_of(other)) == [
        "moments", "torque.constant", "torque.rate", "torque.sines",
    ]  # fmt: skip


def test_rows_that_are_removed_have_no_derivatives() -> None:
    found: Any = solve(
        BRICK, np.linspace(0.0, 20.0, 101), events=crosses(1, 0.0, terminal=True),
        sensitivities=["omega"],
    )  # fmt: skip
    assert 0 < len(found.time) < 101
    assert found.sensitivities["omega"].shape == (len(found.time), 3, 3)


def test_saved_and_loaded(tmp_path: Path) -> None:
    found: Any = solve(BRICK, [0.0, 1.0], sensitivities=["moments", "omega"])
    found.save(tmp_path / "found.npz")
    again: Any = load(tmp_path / "found.npz")
    assert list(again.sensitivities) == ["moments", "omega"]
    for name, array in found.sensitivities.items():
        assert again.sensitivities[name].tobytes() == np.ascontiguousarray(array).tobytes()
    assert solve(BRICK, 1.0, sensitivities=[]).sensitivities == {}
    assert solve(BRICK, 1.0).sensitivities is None


@pytest.mark.parametrize("names", ["omega", [1], 3])
def test_names_are_a_list_of_texts(names: Any) -> None:
    with pytest.raises(InputError, match="sensitivities"):
        solve(BRICK, 1.0, sensitivities=names)


def test_the_truth_of_this_file_is_known_for_a_sphere() -> None:
    # omega is (omega0 + N t/I), so that the derivatives are 1, -N t/I^2 and t/I.
    sphere = Scene(
        "sphere", (1.0, 0.0, 0.5), moments=(2.0, 2.0, 2.0), torque=TorqueLaw((0.4, 0, 0))
    )
    with decimal.localcontext() as context:
        context.prec = 40
        truth: Any = parameter_campaign.differences(
            replace(sphere, torque=TorqueLaw((0.4, 0, 0), (0, 0.5, 0))), ["torque.constant"], [3.0]
        )
    assert truth["torque.constant"][0, 0, 0] == pytest.approx(1.5, rel=1e-9)
    found = slopes(sphere, [3.0], "omega", "moments", "torque.constant")
    assert found["torque.constant"][0, 0, 0] == pytest.approx(1.5, rel=1e-14)
    assert found["moments"][0, 0, 0] == pytest.approx(-0.4 * 3.0 / 4.0, rel=1e-13)

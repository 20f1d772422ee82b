"""Sensitivities: derivatives with respect to parameters, against solutions of 40 digits."""

import decimal
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, TorqueLaw, load, solve
from pyharness.engine.parameters import INERTIA_ELEMENTS, parameters_of
from pyharness.engine.scene_reader import scene_of_file
from pyharness.engine.steps import rates
from pyharness.events import crosses
from pyharness.model.attitude import product
from pyharness.model.changing import ChangingMoments
from pyharness.model.errors import TimedError
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
        found = solve(made(changed), times, "taylor", 1e-15, attitude=attitude)
        return found.y.T

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
        expected = differences(scene_of, values, times, attitude=True)
        check(found[name], expected, 2e-8)


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
        alone = slopes(scene, [2.0, 5.0], name)
        check(together[name], alone, 1e-12)


def pushed_by(torque: Any, scene: Scene = BRICK) -> Scene:
    return replace(scene, torque=torque)


def _full(values: Any) -> Scene:
    a, b, c, d, e, f = values
    matrix = ((a, d, e), (d, b, f), (e, f, c))
    return Scene("full", BRICK.omega, inertia=matrix, torque=LAW)


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


def _shaken(t: Any, omega: Any, *, size: float = 0.0, rate: float = 2000.0) -> Any:
    return [size * np.sin(rate * t) * omega[1], 0.1 - 0.1 * omega[1], 0.0]


def _pushed(power: int) -> Any:
    def torque(t: Any, omega: Any, *, size: float = 0.1) -> Any:
        return [size * t**power - 0.1 * omega[0], 0.1, 0.1]

    return torque


def _driven(t: Any, omega: Any, *, drag: float = 0.02) -> Any:
    return [0.1 - drag * omega[0] ** 3, 0.1 - drag * omega[1] ** 3, -drag * omega[2] ** 3]


REST = replace(BRICK, omega=(0.0, 0.0, 0.0))
HARD: dict[str, tuple[Any, Any, list[str]]] = {
    # The first terms of the derivatives are 0.
    "cubic drag from rest": (REST, _driven, ["torque.drag"]),
    "cubic drag beside others": (REST, _driven, ["torque.drag", "omega"]),
    "square of the time": (BRICK, _pushed(2), ["torque.size"]),
    "sixth power of the time": (BRICK, _pushed(6), ["torque.size"]),
    "sixth power beside others": (BRICK, _pushed(6), ["torque.size", "omega"]),
    "moments from rest": (REST, TorqueLaw((0.1, -0.2, 0.3)), ["moments", "torque.rate"]),
    # omega grows by many orders of magnitude.
    "spin-up": (replace(BRICK, omega=(1e-8, 1e-8, -1e-8)), TorqueLaw((0.5, 0.3, -0.2)), ["omega"]),
    # The derivatives change faster than the solution.
    "fast wave without amplitude": (BRICK, TorqueLaw(sines=[((0, 0, 0), 1e3)]), ["torque.sines"]),
    "fast wave in a function": (BRICK, _shaken, ["torque.size"]),
}


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
@pytest.mark.parametrize("kind", HARD)
def test_derivatives_that_begin_late_or_change_fast(kind: str, tolerance: float) -> None:
    scene, torque, names = HARD[kind]
    scene = replace(scene, torque=torque)
    times = [0.3, 1.0, 5.0]
    found = slopes(scene, times, "moments", *names, tolerance=tolerance)
    exact = slopes(scene, times, "moments", *names, tolerance=1e-15)
    for name, array in exact.items():
        size = np.abs(array).max(axis=(0, 1))
        assert (np.abs(found[name] - array).max(axis=(0, 1)) <= 10.0 * tolerance * size).all()


def test_a_fast_wave_without_amplitude_is_that_of_theory() -> None:
    ball = Scene("ball", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0),
                 torque=TorqueLaw(sines=[((0.0, 0.0, 0.0), 1e3)]))  # fmt: skip
    found = slopes(ball, [0.3, 2.0], "torque.sines")
    expected = (1.0 - np.cos(1e3 * np.array([0.3, 2.0]))) / 1e3
    assert found[:, 0, 0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("tilt", [0.0, math.pi / 6.0])
@pytest.mark.parametrize("end", [0.1, 3.0])
def test_derivatives_may_begin_as_rounding_errors(tilt: float, end: float) -> None:
    """The rates of the derivatives at time 0 would be 0 without rounding."""
    c, s = math.cos(tilt), math.sin(tilt)
    axes = np.array([[c, -s, 0.0], [c * s, c * c, -s], [s * s, c * s, c]])
    inertia = axes @ np.diag([2.0, 2.0, 1.0]) @ axes.T + 1e-12
    values = [0.5 * (inertia[i, j] + inertia[j, i]) for i, j in INERTIA_ELEMENTS]

    def made(changed: list[float]) -> Scene:
        whole = np.zeros((3, 3))
        for (i, j), value in zip(INERTIA_ELEMENTS, changed, strict=True):
            whole[i, j] = whole[j, i] = value
        return Scene("steady", tuple(2.0 * axes[:, 2]), inertia=whole)

    check(slopes(made(values), end, "inertia"), differences(made, values, [end]), 1e-8)


def test_drag_from_rest_is_that_of_differences() -> None:
    ball = Scene("rest", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    found = slopes(pushed_by(_driven, ball), [0.5, 2.0], "torque.drag")
    expected = differences(
        lambda x: pushed_by(partial(_driven, drag=x[0]), ball), [0.02], [0.5, 2.0]
    )
    assert found[..., 0] == pytest.approx(expected[..., 0], rel=1e-8)


def _constant(t: Any, omega: Any, *, constant: float = 0.0) -> Any:
    return [constant * np.sin(t), 0.0, constant]


@pytest.mark.parametrize(
    "law", [TorqueLaw(), TorqueLaw(sines=[((0, 0, 0), 0.4)]), _constant],
    ids=["no terms", "wave without amplitude", "function with the name of a term"],
)  # fmt: skip
def test_a_torque_that_is_0_need_not_have_periodic_derivatives(law: Any) -> None:
    scene = Scene("zero", (0.1, 0.5, 0.3), moments=(1.0, 2.0, 3.0), torque=law)
    assert scene.torque.is_zero
    known = parameters_of(scene)
    names = [name for name in known if name.startswith("torque")]
    found, series = (slopes(scene, [10.0, 200.0], *names, method=x) for x in ("auto", "taylor"))
    if len(names) == 1:
        assert names == ["torque.constant"]
        assert found.shape == (2, 3, 1 if law is _constant else 3)
        found, series = {names[0]: found}, {names[0]: series}
    for name in names:
        check(found[name], series[name])


@pytest.mark.parametrize("factor", [1e-12, 1e-16, 1e6])
def test_slow_and_fast_motions(factor: float) -> None:
    slow = Scene("", tuple(factor * w for w in BRICK.omega), moments=BRICK.moments)
    found = slopes(slow, [3.0 / factor], "omega")
    assert np.abs(found - slopes(BRICK, [3.0], "omega")).max() <= 1e-10
    pushed = replace(slow, torque=TorqueLaw((0.1 * factor**2, 0.0, 0.0)))
    assert np.isfinite(slopes(pushed, [3.0 / factor], "omega", "torque.constant")["omega"]).all()


@pytest.mark.parametrize("end", [720.0, 800.0])
def test_derivatives_beyond_binary64_are_refused(end: float) -> None:
    """The derivative is exp(t), of an omega that is 1e-200 rad/s at first."""
    scene = Scene("", (1e-200, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(-1.0))
    assert solve(scene, end, tolerance=1e-3).omega[0, 0] > 1e100
    with pytest.raises(TimedError, match="sensitivities overflow"):
        slopes(scene, [1.0, end], "omega", tolerance=1e-3)


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


PERIODIC = {
    "brick": BRICK,
    "symmetric": Scene("top", (0.3, 0.4, 1.0), moments=(2.0, 2.0, 1.2)),
    "nearly symmetric": Scene("top", (0.3, 0.4, 1.0), moments=(2.0, 2.000001, 1.2)),
    "nearly flipping": Scene("flip", (1e-5, 1.0, 2e-5), moments=(1.0, 2.0, 3.0)),
    "small nutation": Scene("spin", (1.0, 0.05, 0.05), moments=(1.0, 2.0, 3.0)),
    "steady": Scene("spin", (1.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0)),
    "nearly steady": Scene("spin", (1.0, 1e-6, 0.0), moments=(1.0, 2.0, 3.0)),
    "coefficients": Scene("abc", (0.3, 1.1, -0.7), coefficients=(0.4, -0.7, 0.3)),
    "full": Scene("full", (0.3, 1.1, -0.7), inertia=MATRIX),
    "slow": Scene("slow", (3e-5, 1.1e-4, -7e-5), moments=(3.0, 2.0, 1.2)),
}


@pytest.mark.parametrize("kind", PERIODIC)
def test_many_periods_are_those_of_the_series(kind: str) -> None:
    scene = PERIODIC[kind]
    times = np.array([-400.0, -33.3, 0.0, 1.0, 77.0, 500.0]) * (1e4 if kind == "slow" else 1.0)
    names = [name for name in parameters_of(scene) if name != "torque.rate"]
    found = slopes(scene, times, "omega", *names)
    series = slopes(scene, times, "omega", *names, method="taylor")
    for name, array in series.items():
        limit = 1e-9 * np.abs(array).max()
        assert np.abs(found[name] - array).max() <= limit


def test_a_million_periods_take_as_long_as_one() -> None:
    # The series would need ten million steps.
    found = slopes(BRICK, [1e7, -1e7], "moments", "omega", effort=1e-3)
    assert np.isfinite(found["moments"]).all()
    # A change of all moments by the same factor changes nothing.
    assert np.abs(found["moments"] @ [3.0, 2.0, 1.2]).max() <= 1e-9 * np.abs(found["moments"]).max()
    # omega0 multiplied by c is the motion in the time t/c: w + t w' in omega and its derivative.
    scaled = found["omega"] @ np.array(BRICK.omega)
    state = solve(BRICK, [1e7, -1e7]).omega
    expected = state + np.array([[1e7], [-1e7]]) * rates(BRICK, np.zeros(2), state)
    check(scaled, expected, 1e-8)


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


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
def test_few_digits_near_the_separatrix_are_of_the_same_motion(tolerance: float) -> None:
    """A tolerance above the distance from the separatrix led to the derivatives of another one."""
    scene = Scene("", (1e-5, 1.0, -1e-5), moments=(1.5, 1.7, 1.9))
    found: Any = solve(scene, [2000.0], tolerance=tolerance, sensitivities=["omega"])
    assert found.ended == "complete"
    # From mpmath's elliptic functions with 60 digits.
    assert np.abs(found.sensitivities["omega"]).max() == pytest.approx(48.57, abs=0.01)

"""Tests of moments of inertia that are polynomials of time, as values and in scene files."""

import json
import math
import pickle
import warnings
from dataclasses import replace
from pathlib import Path
from random import Random
from time import process_time
from typing import Any

import numpy as np
import pytest

from pyharness import ChangingInertia, ChangingMoments, ImpossibleBodyWarning, Scene, read_scene
from pyharness.model.errors import InputError
from pyharness.model.records import scene_record
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading
from pyharness.torques import gravity_gradient
from tests.refused import refused

BOOMS = ChangingMoments([[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]])


def test_moments_and_their_rates_are_those_of_the_polynomials() -> None:
    assert BOOMS.at(2.0) == (42.0, 31.0, 20.0)
    assert BOOMS.matrix(2.0) == [[42.0, 0.0, 0.0], [0.0, 31.0, 0.0], [0.0, 0.0, 20.0]]
    assert BOOMS.matrix_rate(2.0) == [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0]]
    momentum = BOOMS.momentum(np.array([0.0, 2.0]), np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 0.5]]))
    assert momentum.tolist() == [[40.0, 30.0, 20.0], [84.0, 31.0, 10.0]]


@pytest.mark.filterwarnings("ignore::pyharness.ImpossibleBodyWarning")
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_body_is_impossible_if_it_is_at_time_0(sign: float) -> None:
    # One moment crosses the sum of the others within a microsecond.
    moments = [[3.0 + 1e-9 * sign, -1e-3 * sign], [2.0], [1.0]]
    matrices = [np.diag(each) for each in zip(*[[*m, 0.0][:2] for m in moments], strict=True)]
    both: list[Any] = [ChangingMoments(moments), ChangingInertia(matrices)]
    for changing in both:
        assert Scene("", (1.0, 2.0, 3.0), changing=changing).is_impossible is (sign > 0.0)


def test_further_coefficient_distinguishes_polynomials_from_a_matrix() -> None:
    rows = [[3.0, 0.1, 0.2], [0.1, 4.0, 0.3], [0.2, 0.3, 5.0, 0.0]]
    assert ChangingMoments(rows).at(1.0) == (3.0 + 0.1 + 0.2, 0.1 + 4.0 + 0.3, 0.2 + 0.3 + 5.0)


@pytest.mark.parametrize(("polynomial", "span"), [
    ([1.0], (-math.inf, math.inf)),
    ([1.0, -0.5], (-math.inf, 2.0)),
    ([1.0, 0.25], (-4.0, math.inf)),
    ([1.0, 0.0, -0.25], (-2.0, 2.0)),
    ([4.0, -4.0, 1.0], (-math.inf, 2.0)),  # a double zero
    ([4.0, -4.0, 1.000001], (-math.inf, math.inf)),
    ([1.0, -(2.0**-900)], (-math.inf, 2.0**900)),
    ([2.0**-900, -1.0], (-math.inf, 2.0**-900)),
    ([1.0, -1e-320], (-math.inf, math.inf)),  # the zero is beyond the range of binary64
    ([1.0, -3.0, 0.0, 0.0], (-math.inf, 1.0 / 3.0)),
    ([6.0, 11.0, 6.0, 1.0], (-1.0, math.inf)),
    ([120.0, -154.0, 71.0, -14.0, 1.0], (-math.inf, 2.0)),  # zeros 2, 3, 4 and 5
])  # fmt: skip
def test_span_ends_at_the_first_zeros(polynomial: list[float], span: tuple[float, float]) -> None:
    assert ChangingMoments([[9.0], polynomial, [8.0]]).span == span


@pytest.mark.parametrize("seed", range(20))
def test_span_of_a_random_polynomial_agrees_with_its_computed_zeros(seed: int) -> None:
    source = Random(f"zeros {seed}")
    polynomial = [1.0, *(source.gauss(0.0, 1.0) for _ in range(source.randint(1, 9)))]
    real = [float(z.real) for z in np.roots(polynomial[::-1]) if abs(z.imag) < 1e-9 * abs(z)]
    before, after = [z for z in real if z < 0.0], [z for z in real if z > 0.0]
    expected = max(before, default=-math.inf), min(after, default=math.inf)
    assert ChangingMoments([polynomial, [5.0], [5.0]]).span == pytest.approx(expected, rel=1e-9)


def test_times_up_to_a_zero_are_checked() -> None:
    changing = ChangingMoments([[10.0, -0.5], [8.0, 1.0], [5.0]])
    changing.check((-7.9, 0.0, 19.9))
    refused(r"\b20 s", changing.check, (1.0, 20.0))
    refused(r"-8 s; allowed: times before it", changing.check, (1.0, -8.5))


FIRST = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.25], [0.5, -0.25, 2.0]]
RATE = [[0.0, 0.5, 0.0], [0.5, -1.0, 0.0], [0.0, 0.0, 1.0]]
INERTIA = ChangingInertia([FIRST, RATE])


@pytest.mark.parametrize("seed", range(12))
def test_span_of_a_matrix_ends_where_a_principal_moment_is_0(seed: int) -> None:
    source = np.random.default_rng(seed)
    factor = source.normal(size=(3, 3))
    matrices = [factor @ factor.T + 0.1 * np.eye(3)]
    for _ in range(1 + seed % 3):
        part = source.normal(size=(3, 3))
        matrices.append(part + part.T)
    found = ChangingInertia(matrices)
    assert any(map(math.isfinite, found.span))
    for end in found.span:
        time = end if math.isfinite(end) else math.copysign(100.0, end)
        scale = max(np.abs(each * time**n).max() for n, each in enumerate(matrices))
        least = np.linalg.eigvalsh(found.at(time)).min()
        assert least > 0.0 if time != end else abs(least) < 1e-12 * scale
        for part in np.linspace(0.0, 0.999, 50):
            assert np.linalg.eigvalsh(found.at(float(part) * time)).min() > 0.0


def test_span_of_a_matrix_of_high_degree_is_found_soon() -> None:
    source = np.random.default_rng(1982)
    matrices = [np.eye(3)]
    for power in range(9):
        part = source.normal(size=(3, 3)) * 10.0 ** -source.uniform(0.0, 2.0 * power)
        matrices.append(part + part.T)
    begin = process_time()
    first, last = ChangingInertia(matrices).span
    assert process_time() - begin < 2.0
    assert -math.inf < first < 0.0 < last < math.inf


TERM = '[[torque.terms]]\nkind = "gravity_gradient"\nrate = 0.5\n'


def test_scene_with_a_changing_matrix(tmp_path: Path) -> None:
    scene = Scene("boom", (0.0, 1.0, 1.0), inertia=INERTIA)
    assert scene.inertia is None
    assert scene.changing is INERTIA
    assert pickle.loads(pickle.dumps(scene)) == scene
    path = tmp_path / "boom.toml"
    path.write_text(scene_text(scene))
    assert read_scene(path) == scene
    assert scene_record(scene)["body"] == {"inertia": [FIRST, RATE]}
    assert heading(scene)[1].startswith(
        "I = (4, 1 + 0.5 t, 0.5), (1 + 0.5 t, 3 - 1 t, -0.25), (0.5, -0.25, 2 + 1 t) kg m2;"
    )
    constant = Scene("constant", (0.0, 1.0, 1.0), inertia=ChangingInertia([FIRST]))
    assert constant == Scene("constant", (0.0, 1.0, 1.0), inertia=FIRST)
    zero = np.zeros((3, 3))
    assert Scene("constant", (0.0, 1.0, 1.0), inertia=ChangingInertia([FIRST, zero])) == constant


def test_gravity_gradient_in_a_file_takes_the_changing_matrix(tmp_path: Path) -> None:
    path = tmp_path / "boom.toml"
    text = scene_text(Scene("boom", (0.0, 1.0, 1.0), inertia=INERTIA))
    path.write_text(text.partition("[torque]")[0] + TERM)
    torque: Any = read_scene(path).torque
    state = 0.5, (0.1, 0.2, 0.3), (0.5, 0.1, 0.7, 0.5)
    assert torque.at(*state) == gravity_gradient(INERTIA, 0.5).at(*state)


def test_scene_has_changing_moments_in_place_of_constant_ones() -> None:
    scene = Scene("booms", (0.0, 1.0, 1.0), moments=BOOMS)
    assert scene.moments is None
    assert scene.changing is BOOMS
    assert replace(scene, omega=(1.0, 2.0, 3.0)).changing is BOOMS
    assert f"changing={BOOMS!r})" in repr(scene)
    assert "changing" not in repr(Scene("plain", (0.0, 1.0, 1.0), moments=(1, 2, 3)))
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert hash(scene) == hash(Scene("booms", (0.0, 1.0, 1.0), changing=BOOMS))
    with pytest.raises(InputError, match="has inertia and changing; allowed: one of them"):
        replace(scene, inertia=((2.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 4.0)))


@pytest.mark.parametrize("more", [[], [0.0], [0.0, -0.0]])
def test_constant_polynomials_are_constant_moments(more: list[float]) -> None:
    moments = ChangingMoments([[40.0, *more], [30.0], [20.0, *more]])
    scene = Scene("constant", (0.0, 1.0, 1.0), moments=moments)
    assert scene == Scene("constant", (0.0, 1.0, 1.0), moments=(40.0, 30.0, 20.0))


def test_impossible_moments_are_those_at_time_0() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", ImpossibleBodyWarning)
        Scene("later", (0.0, 1.0, 1.0), moments=ChangingMoments([[1.0, 9.0], [1.0], [1.0]]))
    with pytest.warns(ImpossibleBodyWarning):
        Scene("first", (0.0, 1.0, 1.0), moments=ChangingMoments([[3.0, -0.1], [1.0], [1.0]]))


def test_heading_shows_the_polynomials() -> None:
    line = heading(Scene("booms", (0.0, 1.0, 1.0), moments=BOOMS))[1]
    assert line.startswith("I = (40 + 1.5 t - 0.25 t^2, 30 + 0.5 t, 20) kg m2; no torque;")


FILE = """\
name = "booms"
[body]
moments = [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]
[initial]
omega = [0.0, 1.0, 1.0]
"""


def test_scene_file_has_lists_of_coefficients(tmp_path: Path) -> None:
    path = tmp_path / "booms.toml"
    path.write_text(FILE)
    scene = read_scene(path)
    assert scene == Scene("booms", (0.0, 1.0, 1.0), moments=BOOMS)
    path.write_text(scene_text(scene))
    assert read_scene(path) == scene
    body = json.loads(json.dumps(scene_record(scene)))["body"]
    assert body == {"moments": [[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]}


def test_gravity_gradient_in_a_file_takes_the_changing_moments(tmp_path: Path) -> None:
    path = tmp_path / "booms.toml"
    path.write_text(FILE + TERM)
    scene = read_scene(path)
    attitude = (0.5, 0.1, 0.7, 0.5)
    for time in (0.0, 3.0):
        constant = FILE.replace("[[40.0, 1.5, -0.25], [30.0, 0.5], [20.0]]", f"{[*BOOMS.at(time)]}")
        path.write_text(constant + TERM)
        torques: list[Any] = [scene.torque, read_scene(path).torque]
        found, wanted = (each.at(time, scene.omega, attitude) for each in torques)
        assert found == pytest.approx(wanted, rel=1e-14)
    path.write_text(scene_text(scene))
    assert read_scene(path) == scene

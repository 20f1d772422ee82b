"""Attitudes as given and as printed; full inertia matrices."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pyharness import Scene, TorqueLaw, prepare, principal, read_scene, solve, solve_many
from pyharness.model.attitude import angle_between, angles, matrices, of_angles, product
from pyharness.model.scene_file import scene_text
from pyharness.model.trajectory import Array

TILTED = ((40.0, 2.0, -1.0), (2.0, 30.0, 3.0), (-1.0, 3.0, 20.0))
BODY = "[body]\nmoments = [3, 2, 1]\n[initial]\nomega = [1, 2, 3]\n"


def _random(count: int) -> Array:
    found = np.random.default_rng(5).normal(size=(count, 4))
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


@pytest.mark.parametrize(("sequence", "scipy"), [("3-1-3", "ZXZ"), ("3-2-1", "ZYX")])
def test_angles_are_those_of_scipy(sequence: str, scipy: str) -> None:
    attitude = _random(500)
    turned = Rotation.from_quat(attitude[:, [1, 2, 3, 0]])
    found = angles(attitude, sequence)
    assert found == pytest.approx(turned.as_euler(scipy, degrees=True), abs=1e-10)
    assert matrices(attitude) == pytest.approx(turned.as_matrix(), abs=1e-15)
    for row, q in zip(found, attitude, strict=True):
        back = np.array(of_angles("", row, sequence))
        assert min(abs(back - q).max(), abs(back + q).max()) < 4e-15


@pytest.mark.parametrize(("sequence", "pole"), [("3-1-3", 0.0), ("3-1-3", 180.0), ("3-2-1", 90.0)])
@pytest.mark.parametrize("beside", [0.0, 1e-8])
def test_poles_keep_their_digits(sequence: str, pole: float, beside: float) -> None:
    tilt = abs(pole - beside)
    q = np.array([of_angles("", (30.0, tilt, 40.0), sequence)])
    found = angles(q, sequence)
    assert found[0, 1] == pytest.approx(tilt, abs=1e-13)
    assert found[0, 2] == pytest.approx(40.0 if beside else 0.0, abs=1e-5)
    back = np.array([of_angles("", found[0], sequence)])
    assert min(abs(back - q).max(), abs(back + q).max()) < 1e-15


def test_product_is_hamiltons() -> None:
    p, q = _random(2)
    turns = (Rotation.from_quat(each, scalar_first=True) for each in (p, q))
    both = math.prod(turns, start=Rotation.identity()).as_quat(scalar_first=True)
    found = np.array(product(tuple(p), tuple(q)))
    assert min(abs(found - both).max(), abs(found + both).max()) < 1e-15


def test_attitude_is_divided_by_its_length(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(BODY + "attitude = [2, 0, 0, 1]\n")
    scene = read_scene(file)
    assert scene.attitude == pytest.approx((2 / 5**0.5, 0.0, 0.0, 1 / 5**0.5))
    assert scene.attitude_length == pytest.approx(5**0.5)
    file.write_text(scene_text(scene))
    assert read_scene(file) == scene
    assert replace(scene, steps=3).attitude == scene.attitude
    huge = Scene("", (0.0, 0.0, 1.0), moments=(3.0, 2.0, 1.0), attitude=(1e308, 0.0, 1e308, 0.0))
    assert huge.attitude == pytest.approx((0.5**0.5, 0.0, 0.5**0.5, 0.0))


def test_inertia_near_the_end_of_numbers_has_its_moments() -> None:
    inertia = (1.0, 0.1, 0.0), (0.1, 1.0, 0.0), (0.0, 0.0, 1e308)
    assert principal(Scene("", (1.0, 2.0, 3.0), inertia=inertia))[0].moments == (0.9, 1.1, 1e308)


def test_full_inertia_is_solved_about_the_bodys_own_axes() -> None:
    law = TorqueLaw((1.0, 2.0, 1.5), sines=(((0.5, 0.0, 1.0), 3.0),))
    scene = Scene("", (0.3, 1.0, -1.0), inertia=TILTED, torque=law, attitude=(0.5, -0.1, 0.7, 0.5))
    inertia, times = np.array(TILTED), [1.0, 3.0]

    def rates(t: float, y: Array) -> Array:
        w, a, v = y[:3], y[3], y[4:]
        slope = np.linalg.solve(inertia, np.array(law.at(t)) - np.cross(w, inertia @ w))
        return np.concatenate([slope, [-0.5 * v @ w], 0.5 * (a * w + np.cross(v, w))])

    start = [*scene.omega, *(scene.attitude or ())]
    truth = solve_ivp(rates, (0.0, 3.0), start, "DOP853", times, rtol=1e-13, atol=1e-13).y.T
    found: Any = solve(scene, times, attitude=True)
    assert found.omega == pytest.approx(truth[:, :3], abs=1e-11)
    assert found.attitude == pytest.approx(truth[:, 3:], abs=1e-11)
    assert found.angular_momentum() == pytest.approx(found.omega @ inertia, abs=1e-12)
    energy = 0.5 * np.einsum("ni,ij,nj->n", found.omega, inertia, found.omega)
    assert found.energy() == pytest.approx(energy, rel=1e-13)


def test_diagonal_inertia_is_its_moments() -> None:
    scene = Scene("", (1.0, 2.0, 3.0), inertia=((3.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0)))
    bare, axes = principal(scene)
    assert (bare.moments, axes.tolist()) == ((3.0, 1.0, 2.0), np.eye(3).tolist())
    plain = solve(Scene("", (1.0, 2.0, 3.0), moments=(3.0, 1.0, 2.0)), [2.0])
    assert solve(scene, [2.0]).omega.tolist() == plain.omega.tolist()
    assert principal(bare)[0] is bare


def test_rounding_alone_may_make_inertia_unsymmetric() -> None:
    Scene("", (1, 2, 3), inertia=((2.0, 0.0, 0.0), (1.8e-12, 2.0, 0.0), (0.0, 0.0, 2.0)))


def test_principal_axes_are_a_right_handed_frame() -> None:
    generator = np.random.default_rng(8)
    for _ in range(200):
        turn = Rotation.from_quat(generator.normal(size=4)).as_matrix()
        moments = generator.uniform(1.0, 2.0, 3)
        matrix = turn @ np.diag(moments) @ turn.T
        rows = (0.5 * (matrix + matrix.T)).tolist()
        bare, axes = principal(Scene("", (1.0, 2.0, 3.0), inertia=rows))
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert sorted(bare.moments or ()) == pytest.approx(sorted(moments))
        assert axes @ np.diag(np.array(bare.moments)) @ axes.T == pytest.approx(matrix)


def test_a_rotation_of_scipy_is_an_attitude_everywhere() -> None:
    turns = Rotation.from_euler("ZXZ", [[10.0, 20.0, 30.0], [-40.0, 50.0, 170.0]], degrees=True)
    rows = turns.as_quat()[:, [3, 0, 1, 2]]
    body = Scene("body", (0.1, 0.2, 0.3), moments=(3.0, 2.0, 1.0), attitude=turns[0])
    assert body == replace(body, attitude=tuple(rows[0]))
    found: Any = solve(body, [1.0], attitude=True)
    expected = Rotation.from_quat(np.roll(found.attitude[0], -1))
    assert (found.rotation()[0] * expected.inv()).magnitude() < 1e-15
    starts = [[0.1, 0.2, 0.3], [0.3, 0.2, 0.1]]
    solver = prepare(body, attitude=True)
    for given, numbers in ((turns[1], rows[1]), (turns, rows)):
        batch = solve_many(body, 1.0, omega=starts, attitude=given)
        same = solve_many(body, 1.0, omega=starts, attitude=numbers)
        np.testing.assert_array_equal(batch.attitude, same.attitude)
        many = solver.many(starts, 1.0, given)[1]
        np.testing.assert_array_equal(many, solver.many(starts, 1.0, numbers)[1])
    one, other = (solver(starts[0], 1.0, given)[1] for given in (turns[1], rows[1]))
    np.testing.assert_array_equal(one, other)


def test_angle_between_nearly_equal_attitudes() -> None:
    p = np.array([[0.5, -0.1, 0.7, 0.5]])
    w, x, y, z = p[0]
    turned = p + 5e-9 * np.array([[-z, y, -x, w]])
    for other in (turned, -turned):
        assert angle_between(other, p)[0] == pytest.approx(1e-8, rel=1e-6)
    assert angle_between(p, p)[0] < 1e-15

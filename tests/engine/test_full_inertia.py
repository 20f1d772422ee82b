"""Bodies about tilted axes, also thin and nearly round ones, compared with exact solutions.

The axes are rational, of rotations by 3/5 and 4/5, and the moments are multiples of 625. So every
entry of the matrix is a float, and so is every component of omega about the principal axes.
"""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, TorqueLaw, prepare, principal, solve, solve_many
from pyharness.engine.prepared.many_scenes import about_principal
from pyharness.model.scene import Triple
from pyharness.truth.reference import reference

# The principal axes as columns, times 25.
_AXES = ((15, -16, 12), (20, 12, -9), (0, 15, 20))
# The moments over 625.
_BODIES: dict[str, tuple[float, float, float]] = {
    "plain": (1.0, 2.0, 2.5),
    "thin": (2.0**-30, 1.0, 1.0 + 2.0**-31),
    "thin, about another axis": (1.0 + 2.0**-31, 1.0, 2.0**-30),
    "nearly round": (1.0, 1.0 + 2.0**-30, 1.0 - 2.0**-31),
}
_TIMES = {"plain": 20.0, "nearly round": 1e6}
_SPIN: Triple = (25.0 / 32.0, -50.0 / 32.0, 75.0 / 64.0)  # about the principal axes


def _exact(found: np.ndarray) -> list[Any]:
    """Return the numbers of an array of fractions, which all are floats."""
    floats = found.astype(float)
    assert (floats == found).all()
    return floats.tolist()  # type: ignore[no-any-return]


def _turned(vector: Triple) -> Any:
    """Return the components about the body's axes of a vector about the principal axes."""
    return _exact(np.array(_AXES) @ [Fraction(x) / 25 for x in vector])


def _matrix(moments: Triple) -> Any:
    axes = np.array(_AXES, dtype=object)
    return _exact(axes @ np.diag([Fraction(x) for x in moments]) @ axes.T)


def _scenes(body: str, torque: Triple = (0.0, 0.0, 0.0)) -> tuple[Scene, Scene]:
    """Return a scene about tilted axes, and the same scene about its principal axes."""
    moments = _BODIES[body]
    bare = Scene(body, _SPIN, moments=[625.0 * each for each in moments], torque=TorqueLaw(torque))
    turned = TorqueLaw(_turned(torque))
    return Scene(body, _turned(_SPIN), inertia=_matrix(moments), torque=turned), bare


def _check_error(tilted: Scene, bare: Scene, time: float, method: str, tolerance: float) -> None:
    found: Any = solve(tilted, [time], method, tolerance)
    truth: Any = reference(bare, [time], precise=True)
    axes = np.array(_AXES) / 25.0
    expected = axes @ truth.omega[0] + axes @ truth.remainder[0]
    error = float(np.abs(found.omega[0] - expected).max()) / float(np.abs(truth.omega).max())
    assert found.ended == "complete"
    assert error <= tolerance + 4e-15 * (found.growth or 1.0)
    assert error <= 10.0 * found.error


@pytest.mark.parametrize("body", list(_BODIES))
@pytest.mark.parametrize("method", ["auto", "taylor", "gauss-6"])
def test_each_body_is_solved_to_the_tolerance(body: str, method: str) -> None:
    tilted, bare = _scenes(body)
    time = _TIMES.get(body, 5.0)
    if time > 100.0 and method != "auto":
        time = 50.0
    _check_error(tilted, bare, time, method, 1e-12)


def test_a_faint_torque_about_the_thin_axis_is_what_it_is() -> None:
    """Along the thin axis the components of the torque nearly cancel, and the moment is 1e-9."""
    tilted, bare = _scenes("thin", (25.0 * 2.0**-28, 25.0, -25.0 * 2.0**-3))
    _check_error(tilted, bare, 3.0, "auto", 1e-12)


def test_attitude_of_a_nearly_round_body() -> None:
    tilted, bare = _scenes("nearly round")
    about_principal, axes = principal(replace(tilted, attitude=(0.5, 0.5, -0.5, 0.5)))
    found = solve(replace(tilted, attitude=(0.5, 0.5, -0.5, 0.5)), [40.0], attitude=True)
    # `principal` may order the axes in any way: the truth uses this order.
    exact: Any = reference(about_principal, [40.0])
    assert found.attitude is not None
    back = found.rotation().as_matrix()[0] @ axes
    other = Rotation.from_quat(exact.attitude[:, [1, 2, 3, 0]]).as_matrix()[0]
    assert back == pytest.approx(other, abs=1e-12)
    assert sorted(about_principal.moments or ()) == sorted(bare.moments or ())


def test_the_moments_come_out_as_they_went_in() -> None:
    for body, moments in _BODIES.items():
        tilted, _ = _scenes(body)
        bare, axes = principal(tilted)
        assert sorted(bare.moments or ()) == sorted(625.0 * each for each in moments)
        assert bare.moments_low == pytest.approx((0.0, 0.0, 0.0), abs=1e-36)
        products = np.abs(axes.T @ (np.array(_AXES) / 25.0))
        assert np.sort(products, axis=1) == pytest.approx(
            np.array([[0.0, 0.0, 1.0]] * 3), abs=1e-15
        )


def test_what_rounding_takes_off_a_moment_is_kept() -> None:
    third = 1.0 / 3.0
    matrix = ((1.0, third, 0.0), (third, 1.0 + third, 0.1), (0.0, 0.1, 2.0))
    bare, _ = principal(Scene("", (1.0, 2.0, 3.0), inertia=matrix))
    exact: Any = bare.exact_moments
    assert any(bare.moments_low)
    i1, i2, i3 = exact
    assert bare.euler_coefficients == (
        float((i2 - i3) / i1),
        float((i3 - i1) / i2),
        float((i1 - i2) / i3),
    )
    # A copy with another start has the same body.
    assert replace(bare, omega=(3.0, 2.0, 1.0)).exact_moments == exact


@pytest.mark.parametrize(
    ("shape", "apart"),
    [("plain", 1e-15), ("thin", 1e-15), ("needle", 1e-15), ("nearly round", 1e-5)],
)
def test_many_matrices_have_the_principal_axes_of_each(shape: str, apart: float) -> None:
    """`apart` allows for axes that the rounding of the matrix determines."""
    rng = np.random.default_rng(55)
    turns = Rotation.random(20, random_state=rng).as_matrix()
    moments = rng.uniform(1.0, 1.5, (20, 3))
    if shape in ("thin", "needle"):
        moments[:, 0] *= 2.0**-35 if shape == "thin" else 2.0**-44
    if shape == "nearly round":
        moments = 1.0 + 1e-10 * rng.uniform(0.0, 1.0, (20, 3))
    matrices = np.einsum("nij,nj,nkj->nik", turns, moments, turns)
    matrices = 0.5 * matrices + 0.5 * matrices.transpose(0, 2, 1)
    torques, rows = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    waves = np.concatenate([rng.normal(size=(20, 2, 3)), np.full((20, 2, 1), 3.0)], axis=2)
    waves[:, 1, 3] = 5.0
    given = {
        "inertia": matrices, "torque_constant": torques, "torque_rate": rows, "sines": waves,
        "cosines": [], "omega": (1.0, 2.0, 3.0),
    }  # fmt: skip
    found, axes, _ = about_principal(given)
    for n, matrix in enumerate(matrices.tolist()):
        law = TorqueLaw(torques[n], rows[n], sines=[(each[:3], each[3]) for each in waves[n]])
        try:
            scene, own = principal(Scene("", (1.0, 2.0, 3.0), inertia=matrix, torque=law))
        except InputError:  # rounding has made a needle's least moment negative
            assert np.isnan(found["coefficients"][n]).all()
            continue
        due = pytest.approx(scene.euler_coefficients, rel=4e-16, abs=0.0)
        assert found["coefficients"][n] == due
        assert axes[n] == pytest.approx(own, rel=0.0, abs=apart)
        i = np.array(scene.moments)
        about = scene.law
        for name, vector in (
            ("torque_constant", about.constant), ("torque_rate", about.rate),
            ("sines", about.sines[0][0]),
        ):  # fmt: skip
            row = found[name][n, 0, :3] if name == "sines" else found[name][n]
            assert row * i == pytest.approx(vector, rel=1e-15, abs=10.0 * apart)


def test_a_matrix_in_an_array_is_refused_alone() -> None:
    good, thin = np.diag([1.0, 2.0, 2.5]), np.diag([2.0**-60, 1.0, 1.0])
    skew = good.copy()
    skew[0, 1] = 0.1
    matrices = [good, -good, skew, np.full((3, 3), np.nan), thin]
    found = solve_many(Scene("", (1.0, 2.0, 3.0), inertia=good), 1.0, inertia=matrices)
    assert found.ended.tolist() == ["complete", *["refused"] * 3, "complete"]
    assert found.omega[4] == pytest.approx(
        solve(Scene("", (1.0, 2.0, 3.0), inertia=thin), 1.0).omega[-1], rel=1e-9
    )


def test_a_needle_beyond_double_double_in_an_array() -> None:
    """Fibonacci numbers have f[75] f[77] - f[76]**2 = 1: the least moment is 1e-16 kg m2."""
    f = [0.0, 1.0]
    while len(f) < 78:
        f.append(f[-2] + f[-1])
    matrix = ((f[75], f[76], 0.0), (f[76], f[77], 0.0), (0.0, 0.0, f[77]))
    law = TorqueLaw((1.0, 2.0, 3.0))
    scene, axes = principal(Scene("", (1.0, 2.0, 3.0), inertia=matrix, torque=law))
    given = {"inertia": [matrix], "torque_constant": law.constant, "torque_rate": law.rate}
    found, own, _ = about_principal({**given, "sines": [], "cosines": [], "omega": scene.omega})
    assert found["coefficients"][0] == pytest.approx(scene.euler_coefficients, rel=4e-16, abs=0.0)
    assert found["torque_constant"][0] * scene.moments == pytest.approx(scene.law.constant)
    assert own[0] == pytest.approx(axes, rel=1e-15)


def test_moments_in_double_double_are_kept_in_many() -> None:
    matrix = [[1.0, 1e-14, 0.0], [1e-14, 1.0 + 1e-14, 2e-14], [0.0, 2e-14, 1.0]]
    bare = principal(Scene("", (3.0, 1.0, 2.0), inertia=matrix))[0]
    wanted = solve(bare, 1e13).omega[0]
    turned = replace(bare, attitude=(1.0, 0.0, 0.0, 0.0))
    found = [
        solve_many([bare, bare], 1e13).omega[1],
        solve_many(bare, 1e13, omega=[bare.omega]).omega[0],
        prepare(turned, attitude=True).many([turned.omega], 1e13)[0][0],
    ]
    assert np.abs(np.array(found) - wanted).max() < 1e-14
    other = solve_many(bare, 1.0, moments=[[3.0, 2.0, 1.0]]).omega[0]
    assert other == pytest.approx(solve(Scene("", bare.omega, (3, 2, 1)), 1.0).omega[0], abs=1e-12)


def test_estimates_of_many_count_the_rounding_of_a_matrix() -> None:
    matrix = np.diag((3.0, 2.0, 1.2)).tolist()
    scene = Scene("beside the middle axis", (1e-4, 2.0, 1e-4), inertia=matrix)
    for time in (1.0, 30.0, 60.0):
        one: Any = solve(scene, time)
        many: Any = solve_many([scene], time, estimates=True)
        assert many.error[0] == pytest.approx(one.error, rel=1e-6)
        assert one.error > one.growth * 2.0**-53

"""Principal axes of many inertia matrices in one call."""

import numpy as np
import pytest

from pyharness import Scene, solve_many
from pyharness.engine.prepared.many_scenes import find_frames
from pyharness.model.inertia import principal_frame
from pyharness.model.trajectory import Array


def draw(kind: str, n: int) -> Array:
    rng = np.random.default_rng(7)
    axes, _ = np.linalg.qr(rng.standard_normal((n, 3, 3)))
    moments = rng.uniform(1.0, 2.0, (n, 3))
    if kind == "nearly equal":
        moments[:, 1] = moments[:, 0] * (1.0 + 10.0 ** rng.uniform(-15.0, -2.0, n))
    elif kind == "thin":
        moments[:, 0] *= 10.0 ** rng.uniform(-11.0, 0.0, n)
    elif kind == "diagonal":
        axes[:] = np.eye(3)
    elif kind == "nearly diagonal":
        axes, _ = np.linalg.qr(np.eye(3) + 1e-9 * rng.standard_normal((n, 3, 3)))
    matrices: Array = np.einsum("nij,nj,nkj->nik", axes, moments, axes)
    return 0.5 * (matrices + matrices.transpose(0, 2, 1)) * 2.0 ** rng.integers(-9, 9, (n, 1, 1))


@pytest.mark.parametrize("kind", ["random", "nearly equal", "thin", "diagonal", "nearly diagonal"])
def test_axes_side_by_side_are_the_exact_ones(kind: str) -> None:
    """Matrices of all kinds may be beside each other."""
    matrices = np.concatenate([draw(kind, 9), draw("random", 3)])
    vectors = np.random.default_rng(3).standard_normal((12, 2, 3))
    numbers, axes, components = find_frames(matrices, vectors)
    for i, matrix in enumerate(matrices.tolist()):
        frame = principal_frame(tuple(map(tuple, matrix)))
        i1, i2, i3 = frame.exact_moments
        exact = [(i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3]
        assert numbers[i, :3] == pytest.approx(np.array(exact, float), rel=4e-16)
        ratios = [float(each / i1) for each in (i1, i2, i3)]
        assert numbers[i, 3:6] / numbers[i, 3] == pytest.approx(ratios, rel=1e-15)
        # Axes of nearly equal moments are less determined, but are orthogonal.
        assert axes[i].T @ axes[i] == pytest.approx(np.eye(3), abs=1e-15)
        assert matrix @ axes[i] == pytest.approx(
            axes[i] * np.array([i1, i2, i3], float), abs=1e-15 * np.abs(matrix).max()
        )
        turned = vectors[i] @ axes[i] / np.array([i1, i2, i3], float)
        assert components[i] == pytest.approx(turned, rel=1e-12, abs=1e-15 * np.abs(turned).max())


@pytest.mark.parametrize(
    "wrong", ["asymmetric", "infinite", "missing", "negative", "zero", "very thin"]
)
def test_a_wrong_matrix_spoils_no_other(wrong: str) -> None:
    matrices = draw("random", 20)
    scene = Scene("", (1.0, 1.0, 1.0), inertia=np.eye(3).tolist())
    wanted = solve_many(scene, 1.0, inertia=matrices)
    bad = {
        "infinite": np.inf, "missing": np.nan, "negative": -1.0, "zero": 0.0, "very thin": 1e-15,
    }  # fmt: skip
    if wrong == "asymmetric":
        matrices[7, 0, 1] += 1.0
    else:
        matrices[7] = np.diag([1.0, 1.0, bad[wrong]])
    found = solve_many(scene, 1.0, inertia=matrices)
    assert (found.ended[7] == "refused") == (wrong != "very thin")
    others = np.arange(20) != 7
    assert found.omega[others].tobytes() == wanted.omega[others].tobytes()

"""C-kernels, as SPICE itself reads them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, Trajectory, solve
from pyharness.interchange import interpolation_times, write_ck
from pyharness.model.attitude import matrices
from pyharness.torques import damping

spice: Any = pytest.importorskip("spiceypy", reason="spiceypy is not installed")

SCENES = (
    Scene("wing nut", moments=(1.0, 2.0, 3.0), omega=(1e-3, 2.0, 1e-3)),
    Scene("brick", moments=(40.0, 30.0, 20.0), omega=(0.0, 1.0, 1.0), torque=damping(0.5)),
)


@pytest.fixture(autouse=True)
def unloaded() -> Iterator[None]:
    yield
    spice.kclear()


def solved(scene: Scene, *times: float) -> Trajectory:
    return solve(scene, list(times), attitude=True, dense_output=True, tolerance=1e-13)


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-11])
def test_the_interpolation_of_spice_keeps_the_tolerance(
    tmp_path: Path, scene: Scene, tolerance: float
) -> None:
    found = solved(scene, -5.0, 25.0)
    assert found.sol is not None
    paths = [tmp_path / name for name in ("a.bc", "a.tk")]
    write_ck(found, *paths, tolerance=tolerance)
    for path in paths:
        spice.furnsh(str(path))
    times = np.random.default_rng(7).uniform(-5.0, 25.0, 1500)
    states = found.sol(times).T
    rotations = matrices(states[:, 3:])
    fastest = np.linalg.norm(states[:, :3], axis=1).max()
    worst = 0.0
    for time, state, rotation in zip(times, states, rotations, strict=True):
        matrix, omega, _ = spice.ckgpav(-1_000_000, spice.sce2c(-1000, time), 0.0, "J2000")
        turned = matrix @ rotation
        sine = np.linalg.norm(turned - turned.T) / np.sqrt(8.0)
        worst = max(worst, float(np.arcsin(min(1.0, sine))))
        # SPICE has omega about the axes of space.
        assert np.linalg.norm(omega - rotation @ state[:3]) <= tolerance * fastest + 1e-14
    assert tolerance / 1000.0 < worst <= tolerance


def test_the_frame_has_a_name_and_an_epoch(tmp_path: Path) -> None:
    found = solved(SCENES[0], 10.0)
    assert found.sol is not None
    paths = [tmp_path / name for name in ("a.bc", "a.tk")]
    write_ck(found, *paths, epoch="2026-01-31T12:00:00.5", body=-77000, name="NUT_1")
    for path in paths:
        spice.furnsh(str(path))
    # In this year SPICE rounds times to 6e-8 s.
    epoch, wrong = spice.tparse("2026 JAN 31 12:00:00.5")
    assert not wrong
    for time in (0.0, 3.0, 9.9):
        matrix = spice.pxform("NUT_1", "J2000", epoch + time)
        exact = matrices(found.sol([time])[3:].T)[0]
        np.testing.assert_allclose(matrix, exact, atol=3e-7)
    first = [path.read_bytes() for path in paths]
    write_ck(found, *paths, epoch="2026-01-31T12:00:00.5", body=-77000, name="NUT_1")
    assert first == [path.read_bytes() for path in paths]


def test_rows_are_where_the_motion_needs_them(tmp_path: Path) -> None:
    found = solved(SCENES[0], 60.0)
    assert found.sol is not None
    times = interpolation_times(found.sol, 1e-9)
    widths = np.diff(times)
    assert (widths > 0.0).all()
    assert widths.max() >= 2.0 * widths.min()
    assert len(interpolation_times(found.sol, 1e-6)) < len(times) < 1500


def test_the_package_is_named_if_it_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "spiceypy", None)
    with pytest.raises(InputError, match="spiceypy"):
        write_ck(solved(SCENES[0], 1.0), tmp_path / "a.bc", tmp_path / "a.tk")

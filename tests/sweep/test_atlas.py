"""The atlas: coarse versions of its sweeps, and the statements on its pages."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.atlas import draw
from docs.atlas.collocation import tenfold
from docs.atlas.maps import place_of
from docs.atlas.stops import case_scenes, predicted
from pyharness.checks.theory.flips import flip_times
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.run import places_of_a_chunk
from pyharness.sweep.sweep import Sweep, spread
from pyharness.sweep.sweep_file import read_sweep
from tests.conftest import Patch
from tests.sweep.sweeps import run_sweep, written

ATLAS = Path(__file__).parent.parent.parent / "docs/atlas"


def _coarse(folder: Path, name: str, count: int, **more: str) -> Sweep:
    """Return a sweep of the atlas with `count` points on each axis and other values for `more`."""
    content = re.sub(r"count = \d+", f"count = {count}", (ATLAS / f"{name}.toml").read_text())
    for old, new in more.items():
        content, n = re.subn(rf"(?m)^{old} = .*$", f"{old} = {new}", content)
        assert n
    return read_sweep(written(folder, content))


def _whole(sweep: Sweep) -> dict[str, Any]:
    """Return the arrays of a whole sweep."""
    found: dict[str, Any] = {}
    for chunk in range(sweep.n_chunks):
        for name, values in solve_chunk(sweep, chunk).items():
            shape = (*sweep.shape, *values.shape[len(sweep.shape) :])
            found.setdefault(name, np.empty(shape, values.dtype))[sweep.box(chunk)] = values
    return found


def _grid(sweep: Sweep) -> list[Array]:
    """Return tilt, c/b and b/a of all points of the sweep `torque`."""
    axes = [axis.coordinates() for axis in sweep.axes[3:]]
    return [each.ravel() for each in np.meshgrid(*axes, indexing="ij")]


def _axes(sweep: Sweep, *fields: str) -> list[Array]:
    found = {axis.field: axis.coordinates() for axis in sweep.axes}
    return [found[field] for field in fields]


@pytest.mark.campaign
@pytest.mark.parametrize("name", draw.PICTURES)
def test_every_sweep_has_its_picture(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    store = str(tmp_path / "store")
    sweep = _coarse(tmp_path, name, 4)
    (tmp_path / "sweep.toml").rename(tmp_path / f"{name}.toml")
    monkeypatch.setattr(draw, "_HERE", tmp_path)
    with pytest.raises(InputError, match=store):
        draw.main(name, store)
    run_sweep(sweep, store)
    draw.main(name, store)
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / f"{name}.csv").read_text().splitlines()) > 20
    assert (ATLAS / f"{name}.png").stat().st_size < 300_000
    assert f"{name}.toml" in (ATLAS / "README.md").read_text()


def test_the_sizes_are_those_of_the_pages() -> None:
    sizes = {name: read_sweep(ATLAS / f"{name}.toml").n_scenes for name in draw.PICTURES}
    assert sizes["stability"] >= 10**8
    assert sizes["torque"] >= 10**6


def test_square_of_all_bodies_is_symmetric_about_its_diagonal(tmp_path: Path) -> None:
    found = _whole(_coarse(tmp_path, "stability", 8))["flip-time"]
    other = _coarse(tmp_path, "stability", 8).text.replace("0.7853981633974483", f"{np.pi / 2}")
    mirrored = _whole(read_sweep(written(tmp_path, other)))["flip-time"]
    # This exchanges the axes of the least and the largest moment, and with them b/a and c/b.
    assert found[0] == pytest.approx(mirrored[1].swapaxes(1, 2), rel=1e-9)
    assert (np.diff(found[0], axis=0) < 0.0).all()
    # For the tilt half way between the two axes, the diagonal is the separatrix.
    at = np.arange(1, 8)
    for beside in (found[1][:, at, at - 1], found[1][:, at - 1, at]):
        assert (found[1][:, at, at] > beside).all()


def test_bodies_of_the_thesis_have_their_place_in_the_square() -> None:
    assert place_of((40.0, 30.0, 20.0)) == pytest.approx((0.6, 1.0 / 3.0))
    assert place_of((41.0, 39.0, 20.0)) == pytest.approx((11.0 / 30.0, 9.0 / 11.0))


@pytest.mark.campaign
def test_flips_without_torque_are_those_of_the_closed_form(tmp_path: Path) -> None:
    sweep = _coarse(tmp_path, "torque", 6)
    found = _whole(sweep)["flips"][0]
    tilt, c_b, b_a = _grid(sweep)
    times = flip_times(_bodies(b_a, c_b), _starts(tilt))
    # The trajectory begins half way between two flips.
    expected = np.floor(50.0 / times + 0.5)
    near = np.abs(50.0 / times + 0.5 - np.rint(50.0 / times + 0.5)) < 1e-6
    assert (found.ravel() == expected)[~near].all()


@pytest.mark.campaign
def test_torque_along_the_middle_axis_holds_nobody(tmp_path: Path) -> None:
    sweep = _coarse(tmp_path, "torque", 6)
    found = _whole(sweep)["flips"]
    tilt, c_b, b_a = _grid(sweep)
    for place in (0, 1, 2):
        torque = sweep.axes[1].coordinates()[place]
        times = _first_flip(_bodies(b_a, c_b), tilt, torque)
        assert np.isfinite(times).all()
        flips = found[place].ravel() > 0
        assert (flips == (times < 50.0))[np.abs(times - 50.0) > 1e-3].all()


def test_sample_of_the_estimate_shares_what_loads_share() -> None:
    sweep = read_sweep(ATLAS / "stops.toml")
    places = places_of_a_chunk(sweep, spread(sweep, 256))
    steps = sorted({*places[2].tolist()})
    assert (len(steps), steps[0], steps[-1]) == (5, 0, 600)
    assert len({*places[3].tolist()}) > 100


def _bodies(b_a: Array, c_b: Array) -> Array:
    c = b_a * c_b
    found: Array = np.stack([b_a + c, 1.0 + c, 1.0 + b_a], axis=1) / (1.0 + b_a[:, None])
    return found


def _starts(tilt: Array) -> Array:
    return np.stack([np.sin(tilt), np.cos(tilt), 0.0 * tilt], axis=1)


def _first_flip(bodies: Array, tilt: Array, torque: float) -> Array:
    """Return the first time at which omega2 is 0, by a quadrature over the integral of omega2.

    The integral of omega2 is an angle. Omega1 and omega3 are hyperbolic functions of it, with or
    without torque, so that omega2 squared is
    cos^2(tilt) + 2 M angle / I2 - (s2 / s1) sin^2(tilt) sinh^2(rate angle).
    """
    i1, i2, i3 = bodies.T
    s1, s2, s3 = (i3 - i2) / i1, (i3 - i1) / i2, (i2 - i1) / i3
    rate = np.sqrt(s1 * s3)

    def square(angle: Array) -> Array:
        shift = np.sqrt(s3 / s1) * np.sin(tilt) * np.sinh(rate * angle)
        found: Array = np.cos(tilt) ** 2 + 2.0 * torque / i2 * angle - s2 / s3 * shift**2
        return found

    low, high = np.zeros_like(tilt), 700.0 / rate * np.ones_like(tilt)
    with np.errstate(over="ignore"):
        for _ in range(200):
            middle = 0.5 * (low + high)
            above = square(middle) > 0.0
            low, high = np.where(above, middle, low), np.where(above, high, middle)
    # The upper end is a root of omega2 squared: a substitution makes the integrand smooth.
    nodes, weights = np.polynomial.legendre.leggauss(400)
    total = np.zeros_like(tilt)
    for at, w in zip(0.5 * (nodes + 1.0), weights, strict=True):
        total += w * at * low / np.sqrt(np.maximum(square(low * (1.0 - at * at)), 1e-300))
    return total


@pytest.mark.campaign
def test_corrected_program_stops_where_it_is_predicted(tmp_path: Path) -> None:
    sweep = _coarse(tmp_path, "stops", 41)
    found = _whole(sweep)
    stopped = found["status"] == Statuses.STOPPED
    steps, constants = _axes(sweep, "step_size", "lipschitz")
    scenes = case_scenes(sweep)
    assert [scene.name for scene in scenes] == ["Case 2", "Case 3", "Case 4", "Case 5"]
    for i, scene in enumerate(scenes):
        constant, step = predicted(scene, 10.0)
        short = steps < 0.1 * step
        below, above = constants < constant * (1.0 - 1e-3), constants > constant * (1.0 + 1e-3)
        assert stopped[2, i][np.ix_(short, below)].all()
        assert not stopped[2, i][np.ix_(short, above)].any()
        if 1 <= i <= 2:
            # Beyond rk4's stability region the stop test ends every run.
            assert stopped[2, i][steps > 1.05 * step].all()
            assert not stopped[2, i][np.ix_(steps < 0.95 * step, constants > 10.0)].any()
    # The test by component gives an edge like a comb. With one norm, and every other defect kept,
    # the edge is clean.
    changes = [
        (np.diff(stopped[i].astype(int), axis=1) != 0)[:, :, constants > 100.0].sum()
        for i in range(3)
    ]
    assert changes[0] > 5 * changes[1] > 0
    assert 0.5 < np.isin(found["stop-variable"][0][stopped[0]], (4, 5, 6)).mean() < 0.95


@pytest.mark.campaign
def test_collocation_diverges_where_a_wobble_grows(tmp_path: Path) -> None:
    sweep = _coarse(tmp_path, "collocation", 25)
    found = _whole(sweep)
    steps, sizes = _axes(sweep, "step_size", "omega.magnitude")
    line = tenfold(sweep.scene.euler_coefficients, sweep.scene.omega, sizes, 10.0)
    changed = ~(found["drift"][..., 0] < 1.0)
    for program, listing in ((0, 1), (1, 0), (1, 1)):
        assert not changed[program, listing][steps[:, None] < 0.8 * line].any()
        assert changed[program, listing][(steps[:, None] > 1.25 * line) & (line < 0.5)].all()
    assert (changed[1, 0] == changed[1, 1]).all()
    # The original two-term program diverges however small the step.
    assert changed[0, 0][:, sizes > 15.0].mean() > 0.95

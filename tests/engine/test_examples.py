"""The six examples of torques: each is solved by `solve`, and has the motion that theory predicts.

The example programs solve their scenes with the method "auto" and a tolerance of 1e-9.
"""

import csv
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.examples import draw
from pyharness import solve
from pyharness.model.trajectory import Array

ROOT = Path(__file__).parent.parent.parent
EXAMPLES = ROOT / "docs/examples"
PAGE = ROOT / "docs/how-to/torque-examples.md"


def example(name: str) -> Any:
    """Return the names of an example program, which is run at the first call."""
    return import_module(f"docs.examples.{name}")


def in_space(found: Any, vectors: Array) -> Array:
    """Return vectors about the body axes, one per time, in components about the axes of space."""
    return np.asarray(np.einsum("nij,nj->ni", found.found.rotation().as_matrix(), vectors))


def test_every_program_is_an_example() -> None:
    programs = {path.stem for path in EXAMPLES.glob("*.py")} - {"draw"}
    assert programs == set(draw.PLOTS)
    assert len(programs) == 6


@pytest.mark.campaign
@pytest.mark.parametrize("name", draw.PLOTS)
def test_end_is_that_of_scipy(name: str) -> None:
    found = example(name)
    with_attitude = found.found.attitude is not None
    assert found.found.has_all_rows
    assert found.found.tolerance == 1e-9
    assert found.found.error < 1e-9
    other: Any = solve(found.scene, found.time[-1], "dop853", 1e-9, attitude=with_attitude)
    largest = np.abs(found.found.omega).max()
    assert np.abs(other.omega[-1] - found.found.omega[-1]).max() < 2e-9 * largest
    if with_attitude:
        assert other.attitude[-1] == pytest.approx(found.found.attitude[-1], abs=2e-9)


def test_dissipation_ends_in_the_rotation_of_least_energy() -> None:
    found = example("flat_spin")
    assert np.ptp(found.length) < 1e-9 * found.length[0]
    assert (np.diff(found.energy) < 0.0).all()
    assert (np.diff(found.angle) > 0.0).all()
    assert found.energy[0] == pytest.approx(12.525)
    assert found.energy[-1] == pytest.approx(found.length[0] ** 2 / (2.0 * 20.0), rel=1e-5)
    assert found.angle[[0, -1]] == pytest.approx([11.31, 90.0], abs=0.02)


def test_direction_of_the_momentum_moves_by_the_angle_on_the_page() -> None:
    found = example("flat_spin")
    run = solve(found.scene, found.time, tolerance=1e-9, attitude=True)
    space = np.einsum("nij,nj->ni", run.rotation().as_matrix(), found.momentum)
    cosine = space @ space[0] / found.length**2
    assert np.degrees(np.arccos(cosine.min())) == pytest.approx(4.0, abs=0.3)
    assert "moves by 4 degrees" in " ".join(PAGE.read_text().split())


def test_gravity_gradient_captures_the_body_after_one_turn() -> None:
    found = example("gravity_capture")
    first, second, third = found.moments
    limit = np.sqrt(3.0 * (second - first) / third)
    assert limit == pytest.approx(1.46, abs=0.005)
    relative = found.found.omega[:, 2] / found.orbit - 1.0
    assert relative[0] == pytest.approx(2.0)
    assert relative[0] > limit
    # The body turns beyond the first horizontal position, but not beyond the second.
    assert 270.0 < found.angle.max() < 450.0
    assert found.angle[-1] == pytest.approx(360.0 - 1.4, abs=0.05)
    assert np.abs(found.angle[found.time > 0.9 * found.time[-1]] - 360.0).max() < 5.0
    assert found.found.omega[:, :2] == pytest.approx(0.0, abs=1e-12)
    assert relative[-1] == pytest.approx(0.0, abs=0.02)


def test_coils_stop_the_rotation_except_that_of_the_field() -> None:
    found = example("magnetic_detumbling")
    assert found.rate[[0, -1]] == pytest.approx([131.0, 1.5], abs=0.06)
    last = found.rate[found.time > 0.5 * found.time[-1]]
    assert 1.4 < last.min() < last.max() < 3.0
    # Without the rate of the field the energy decreases; here it does until the body follows it.
    energy = np.sum(found.found.omega**2 * found.scene.moments, axis=1)
    assert (np.diff(energy[: np.argmax(found.rate < 4.0)]) < 0.0).all()


def test_dual_spin_turn_keeps_the_momentum_in_space() -> None:
    found = example("dual_spin_turn")
    space = in_space(found, found.total)
    assert np.abs(space - space[0]).max() < 1e-8
    assert found.stored[-1] == pytest.approx([found.momentum, 0.0, 0.0])
    assert found.angle[[0, -1]] == pytest.approx([90.0, 9.0], abs=0.1)
    late = found.angle[found.time > 0.9 * found.time[-1]]
    assert (late > 8.0).all()
    assert (late < 10.0).all()


def test_slew_reaches_its_target_without_overshoot() -> None:
    found = example("slew")
    assert found.error[0] == pytest.approx(120.0)
    assert found.error[-1] < 1e-6
    assert (np.diff(found.error) < 0.0).all()
    assert np.abs(found.found.omega[-1]).max() < 1e-8
    attitude = np.array([0.1, -0.5, 0.5, 0.7])
    both = [found.scene.torque.at(0.0, (1.0, 2.0, 3.0), sign * attitude) for sign in (1.0, -1.0)]
    assert both[0] == both[1]


def test_reaction_wheel_turns_the_body_from_rest_to_rest() -> None:
    found = example("reaction_wheel")
    body = found.found.omega[:, 2] * found.moments[2]
    assert np.abs(body + found.stored).max() < 1e-9 * np.abs(body).max()
    assert found.angle[[0, -1]] == pytest.approx([0.0, 90.0], abs=1e-7)
    assert np.abs(found.found.omega[-1]).max() < 1e-10
    assert (np.diff(found.angle) > 0.0).all()


@pytest.mark.parametrize("name", draw.PLOTS)
def test_page_has_the_program_and_its_picture(name: str) -> None:
    text = PAGE.read_text()
    assert f"```python\n{(EXAMPLES / f'{name}.py').read_text()}```" in text
    assert f"](../examples/{name}.svg)" in text
    assert (EXAMPLES / f"{name}.svg").stat().st_size < 60_000


@pytest.mark.parametrize("name", draw.PLOTS)
def test_picture_is_that_of_its_numbers(name: str) -> None:
    """The stored numbers beside a picture are those of today, to six digits."""
    stored = list(csv.reader((EXAMPLES / f"{name}.csv").read_text().splitlines()))
    old, new = stored[1:], list(draw.picture(name).numbers.in_full())[1:]
    assert [row[0] for row in old] == [row[0] for row in new]
    was, now = (np.array([[float(x) for x in row[1:]] for row in rows]) for rows in (old, new))
    for curve in {row[0] for row in old}:
        own = [row[0] == curve for row in old]
        assert (np.abs(was[own] - now[own]) < 1e-5 * np.abs(was[own]).max(axis=0)).all(), curve


@pytest.mark.campaign
def test_pictures_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw, "_HERE", tmp_path)
    monkeypatch.setattr(draw, "PLOTS", {"slew": draw.PLOTS["slew"]})
    draw.main()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["slew.csv", "slew.svg"]
    assert (tmp_path / "slew.svg").read_text().startswith("<?xml")

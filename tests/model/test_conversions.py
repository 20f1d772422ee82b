"""Trajectories under SciPy's names, as frames, data sets, diagrams and HTML."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import InputError, Scene, Trajectory, case_scene, run_program, solve, subset

TIMES = [0.5, 1.0, 2.0]


def solved(**given: Any) -> Trajectory:
    """Return a trajectory of three rows."""
    return solve(case_scene(5), TIMES, **given)


def stopped() -> Trajectory:
    """Return the trajectory, with all quantities, of a program that the stop test ended."""
    return run_program(case_scene(2), subset("runge-kutta"), implementation="python")


def overflowed() -> Trajectory:
    """Return a trajectory without rows."""
    scene = Scene("rises", (1e300, 1e300, 1e300), coefficients=(1.0, 1.0, 1.0), step_size=1.0)
    return solve(scene, [1.0, 2.0], "rk4")


@pytest.mark.parametrize("attitude", [False, True])
def test_state_has_the_orientation_of_scipy(attitude: bool) -> None:
    found = solved(attitude=attitude)
    scene = case_scene(5)
    theirs = solve_ivp(
        scene.right_hand_side(), (0.0, 2.0), scene.omega, "DOP853", TIMES, rtol=1e-11, atol=1e-11
    )
    assert found.t is found.time
    assert found.t.tolist() == theirs.t.tolist()
    assert found.y.shape == ((7 if attitude else 3), len(TIMES))
    assert np.abs(found.y[:3] - theirs.y).max() < 1e-8
    if found.attitude is not None:
        assert (found.attitude == found.y[3:].T).all()
    assert (found.success, found.status) == (theirs.success, theirs.status) == (True, 0)
    assert type(found.success) is bool
    assert found.message == "The integration reached all requested times."
    assert found.nfev == found.evaluations
    assert solved(method="dop853").nfev > 10


def test_endings_are_sentences() -> None:
    sensitive = solve(case_scene(3), [30.0], "taylor", 1e-15)
    assert (sensitive.success, sensitive.status) == (True, 0)
    start = "The integration reached all requested times, but rounding errors, amplified by "
    assert sensitive.message.startswith(start)
    assert sensitive.message.endswith(" exceed the tolerance; omega has 14 correct digits.")
    unknown = replace(sensitive, growth=None, error=0.02).message
    assert "rounding errors exceed the tolerance; omega has 1 correct digit." in unknown
    test = stopped()
    assert test.message == (
        "The Lipschitz test ended the run at step 25, because the Lipschitz quotient of V2 was "
        "3.3e3 1/s."
    )
    assert overflowed().message == "Omega or the torque became infinite or NaN; no row."
    assert {(each.success, each.status) for each in (test, overflowed())} == {(False, -1)}


def test_frame_has_every_quantity_with_its_unit() -> None:
    found = replace(stopped(), attitude=np.tile([1.0, 0.0, -0.5, 0.25], (25, 1)))
    found = replace(found, ier=np.arange(25, dtype=np.int32), recorded_time=found.time)
    frame = found.to_pandas()
    vectors = [found.omega, found.velocity, found.attitude, found.ier]
    names = [f"{name}{k}" for name in ("omega", "velocity") for k in (1, 2, 3)]
    names += ["q0", "q1", "q2", "q3"]
    assert list(frame.columns) == [*names, "ier"]
    assert (frame.to_numpy() == np.column_stack(vectors)).all()
    assert (frame.index.name, frame.index.to_list()) == ("time", found.time.tolist())
    assert frame["ier"].dtype == np.int32
    units = frame.attrs["units"]
    assert units == {
        "time": "s", **dict.fromkeys(names[:3], "rad/s"), **dict.fromkeys(names[3:6], "m/s"),
        **dict.fromkeys([*names[6:], "ier"], "1"),
    }  # fmt: skip
    frame.iloc[0, 0] = 7.0
    assert found.omega[0, 0] != 7.0


@pytest.mark.campaign
def test_recorded_time_is_there_where_it_differs() -> None:
    found = solved()
    late = replace(found, recorded_time=found.time + 1.0)
    assert "recorded_time" not in found.to_pandas()
    assert late.to_pandas()["recorded_time"].to_list() == [1.5, 2.0, 3.0]
    assert late.to_xarray().recorded_time.dims == ("time",)
    assert "recorded_time" in late._repr_html_()


def test_dataset_has_dimensions_units_and_names() -> None:
    found = solved(attitude=True)
    data = found.to_xarray()
    assert dict(data.sizes) == {"time": 3, "axis": 3, "component": 4}
    assert (data.omega.dims, data.attitude.dims) == (("time", "axis"), ("time", "component"))
    assert (data.omega.to_numpy() == found.omega).all()
    assert (data.attitude.to_numpy() == found.attitude).all()
    assert data.attitude.sel(component="q0", time=1.0) == found.attitude[1, 0]
    assert (data.omega.units, data.time.units, data.attitude.units) == ("rad/s", "s", "1")
    for name in data.variables:
        assert data[name].attrs["long_name"], name
    assert data.attrs == {
        "title": case_scene(5).name, "ended": "complete", "steps": found.steps,
        "evaluations": found.evaluations, "error": found.error, "growth": found.growth,
        "tolerance": 1e-9,
    }  # fmt: skip
    data.omega[0, 0] = 7.0
    assert found.omega[0, 0] != 7.0
    of_program = stopped().to_xarray()
    assert of_program.velocity.units == "m/s"
    assert "error" not in of_program.attrs
    assert dict(overflowed().to_xarray().sizes) == {"time": 0, "axis": 3}
    assert len(overflowed().to_pandas()) == 0


@pytest.fixture
def pyplot() -> Iterator[Any]:
    """Return matplotlib's pyplot without windows; close what a test has opened."""
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    yield pyplot
    pyplot.close("all")


@pytest.mark.campaign
@pytest.mark.parametrize("times", [TIMES, TIMES[::-1], [-1.0, 1.0], [2.0]])
def test_diagram_shows_omega_in_the_order_of_time(pyplot: Any, times: list[float]) -> None:
    found = solve(case_scene(5), times)
    ax = found.plot()
    assert pyplot.gcf() is ax.figure
    order = np.argsort(found.time)
    assert len(ax.lines) == 3
    for axis, line in enumerate(ax.lines):
        assert np.asarray(line.get_xdata()).tolist() == sorted(times)
        assert (line.get_ydata() == found.omega[order, axis]).all()
        assert (line.get_marker() == "o") == (len(times) == 1)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "angular velocity (rad/s)")
    wanted = [rf"$\omega_{axis}$" for axis in (1, 2, 3)]
    legend: Any = ax.get_legend()
    assert [each.get_text() for each in legend.get_texts()] == wanted
    ax.figure.canvas.draw()


def test_diagram_is_drawn_where_the_user_wants_it(pyplot: Any) -> None:
    from matplotlib.figure import Figure

    given = Figure().subplots()
    assert solved().plot(given) is given
    assert overflowed().plot(ax=given) is given
    smooth = solve(case_scene(5), [2.0], dense_output=True).plot(Figure().subplots()).lines[0]
    assert np.ptp(np.asarray(smooth.get_xdata())) == 2.0
    assert len(np.asarray(smooth.get_xdata())) >= 1000
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize(
    ("package", "call", "install"),
    [("pandas", "to_pandas", "pandas"), ("xarray", "to_xarray", "xarray"),
     ("matplotlib", "plot", "'rigid-body-harness[plots]'")],
)  # fmt: skip
def test_missing_package_is_named_in_a_line(
    package: str, call: str, install: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = solved()
    monkeypatch.setitem(sys.modules, package, None)  # importing it fails
    with pytest.raises(InputError) as caught:
        getattr(found, call)()
    assert str(caught.value) == f"{call} needs {package}: pip install {install}"


def _table(found: Trajectory) -> tuple[str | None, list[list[str]]]:
    """Return the caption of a table in HTML, whose tags are closed, and the texts of its cells."""
    page = ElementTree.fromstring(f"<div>{found._repr_html_()}</div>")
    rows = [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]
    return page.findtext(".//caption"), rows


def test_notebook_shows_a_short_table() -> None:
    scene = Scene("<script>&", (0.0, 1.0, 10.0), moments=(40.0, 40.0, 20.0))
    found = solve(scene, np.arange(1.0, 101.0), attitude=True)
    caption, table = _table(found)
    assert "<script" not in found._repr_html_()
    assert caption == "Trajectory of <script>&"
    facts = {row[0]: row[1] for row in table if len(row) == 2}
    assert facts["ended"] == found.message
    assert facts["rows"] == "100"
    assert facts["estimated error"].endswith("e-15 of the largest |omega|")
    assert facts["correct digits"] == f"{found.digits:.1f}"
    assert float(facts["error amplification"]) == pytest.approx(found.growth, rel=0.1)
    head, *rows = (row for row in table if len(row) > 2)
    assert head[:2] == ["time (s)", "omega1 (rad/s)"]
    assert head[4:] == ["q0", "q1", "q2", "q3"]
    assert [row[0] for row in rows] == ["1", "2", "3", "...", "98", "99", "100"]
    assert [row[3] for row in rows] == ["10"] * 3 + ["..."] + ["10"] * 3


@pytest.mark.parametrize(("count", "shown"), [(1, 1), (7, 7), (8, 7)])
def test_notebook_shows_few_rows_in_full(count: int, shown: int) -> None:
    found = solve(case_scene(5), np.arange(1.0, count + 1.0))
    rows = [row for row in _table(found)[1] if len(row) > 2]
    assert len(rows) == 1 + shown
    assert (["..."] * 4 in rows) == (count > 7)


def test_notebook_shows_any_ending() -> None:
    for found in (stopped(), overflowed(), replace(solved(), scene=None)):
        caption, table = _table(found)
        assert dict(row for row in table if len(row) == 2)["ended"] == found.message
        assert caption == (f"Trajectory of {found.scene.name}" if found.scene else "Trajectory")
    assert not [row for row in _table(overflowed())[1] if len(row) > 2]

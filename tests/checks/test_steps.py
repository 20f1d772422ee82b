"""Trials of step sizes, stability regions and matrices: bounds hold, planted faults break them."""

import csv
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from pyharness import Listing, case_scene
from pyharness.checks.stress_report import regions_picture
from pyharness.checks.theory import collocation_matrices
from pyharness.checks.theory.amplification import (
    amplification,
    boundary,
    regions,
    weight_of_squares,
)
from pyharness.checks.theory.collocation_matrices import singular_below, solved
from pyharness.checks.theory.schemes import SCHEMES, TERMS, Numbers, Series, local_error
from pyharness.checks.theory.step_errors import Forecaster, path
from pyharness.cli.main import main
from pyharness.engine.plan.registry import FIXED_STEP
from pyharness.thesis import collocation
from pyharness.thesis.linear_solver import leqt1f
from pyharness.views.pictures import saved
from tests.checks.stressed import checks_of

FIGURES = Path(__file__).parent.parent.parent / "docs/figures"


def test_every_method_with_a_fixed_step_has_a_scheme() -> None:
    missing = sorted({*FIXED_STEP} - SCHEMES.keys())
    assert not missing, f"pyharness/checks/theory/schemes.py has no scheme of {missing}"


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("only", "limits"),
    [("matrices", 240), ("regions", 400),
     ("step-size/two-term/case-5,step-size/four-term/case-6/corrected,"
      "step-size/runge-kutta/case-3,step-size/rk4/case-5,step-size/gauss-2/case-4", 40)],
)  # fmt: skip
def test_bounds_hold(only: str, limits: int) -> None:
    checks = checks_of(*only.split(","))
    assert not [id for id, check in checks.items() if not check.passed]
    assert sum(check.limit is not None for check in checks.values()) > limits
    steps = [check.limit for id, check in checks.items() if "/first-step" in id]
    assert all(limit is not None and limit < 1e-5 for limit in steps), "it bounds nothing"


def test_programs_meet_the_singularity_that_was_predicted() -> None:
    """The original's moved points leave the singular range; corrected, every step prints 129."""
    for label, count in (("original", 19), ("corrected", 300)):
        (check,) = checks_of(f"matrices/four-term/{label}/ier-1e-06").values()
        assert check.note == f"IER = 129 in {count} of 300 steps"
    assert singular_below("four-term") == pytest.approx(1.9073e-5, rel=1e-4)
    assert singular_below("two-term") == pytest.approx(1.5 * 2.0**-52, rel=1e-12)


def test_in_24_bits_the_four_term_matrix_is_singular_at_the_step_of_the_thesis() -> None:
    """Compare the solver in NumPy's binary32 with the rule in exact fractions."""
    step = singular_below("four-term", bits=24)
    assert step == pytest.approx(0.0155, rel=1e-3)
    for factor, expected in ((0.01 / step, 129), (0.999, 129), (1.001, 0)):
        points = collocation_matrices.points("four-term", factor * step)
        matrix = np.array(collocation.collocation_matrix(points), dtype=np.float32)
        _, ier = leqt1f([list(row) for row in matrix], [[np.float32(1.0)] * 4])  # type: ignore[list-item]
        assert ier == expected


def test_condition_is_that_of_numpy() -> None:
    found = solved("four-term", 1.0)
    matrix = np.array(collocation.collocation_matrix(collocation_matrices.points("four-term", 1.0)))
    assert found.condition == pytest.approx(float(np.linalg.cond(matrix, np.inf)), rel=1e-9)


def test_polynomials_are_those_of_the_schemes() -> None:
    """Classical Runge-Kutta has the first five terms of exp, one correction the first three."""
    (((*exponential,),),) = amplification(Listing.corrected("runge-kutta")).coefficients
    assert exponential == [Fraction(1, math.factorial(k)) for k in range(5)]
    for program in ("two-term", "four-term"):
        for listing in (Listing.original(program), Listing.corrected(program)):
            for step in (1, 10, 100):
                (((*found,),),) = amplification(listing, step).coefficients
                assert found == [1, 1, Fraction(1, 2), 0, 0], "moved points change no straight line"
    before = amplification(Listing.original("runge-kutta"))
    assert before.text() == "[1 + 1/2 z, 0; z + 5/6 z^2 + 7/24 z^3 + 1/24 z^4, 1]"


def test_boundaries_are_the_known_ones() -> None:
    """Hairer and Wanner 1996, IV.2: 2.785 and the root of 8 for order 4; 2 and 0 for order 2."""
    fourth, second = (amplification(Listing.corrected(p)) for p in ("runge-kutta", "two-term"))
    distance, slope = boundary(fourth, -1.0)
    assert distance == pytest.approx(2.785293563405282, rel=1e-12)
    growth = abs(sum((-distance) ** k / math.factorial(k) for k in range(4)))
    assert slope == pytest.approx(growth, rel=1e-3)
    assert boundary(fourth, 1j)[0] == pytest.approx(math.sqrt(8.0), rel=1e-12)
    assert boundary(second, -1.0)[0] == pytest.approx(2.0, rel=1e-12)
    assert boundary(second, 1j)[0] == 0.0
    assert boundary(amplification(Listing.original("runge-kutta")), -1.0)[0] == pytest.approx(4.0)


def test_the_limit_of_the_punched_runge_kutta_is_in_its_matrix() -> None:
    """A decaying solution ends near minus its initial value: 2 y(t/2) - y(0) with y(t/2) near 0."""
    matrix = amplification(Listing.original("runge-kutta")).evaluate(np.array(-0.01)).real
    end = np.linalg.matrix_power(matrix, 5000) @ np.ones(2)
    assert end[1] == pytest.approx(-1.0, abs=0.02)


def test_weights_of_moved_points() -> None:
    """Two points extrapolate s**2 to -2/9 of t**2 (derived in docs/article/article.md)."""
    assert weight_of_squares(Listing.corrected("two-term"), 50) == Fraction(5, 18)
    for n in (1, 7, 100):
        moved = Fraction(n, 2) - Fraction(2 * n * n, 9)
        assert weight_of_squares(Listing.original("two-term"), n) == moved
        assert weight_of_squares(Listing.original("four-term"), n) == Fraction(1, 3)


@pytest.mark.campaign
def test_the_stored_picture_is_current(tmp_path: Path) -> None:
    made = saved(regions_picture(regions()), "regions.csv.svg")
    stored = FIGURES / "stability-regions.csv"
    found = list(csv.reader(made["regions.csv.csv"].decode().splitlines()))
    wanted = list(csv.reader(stored.read_text().splitlines()))
    assert found[0] == wanted[0]
    np.testing.assert_allclose(
        np.array(found[1:], dtype=float), np.array(wanted[1:], dtype=float), rtol=0.02, atol=1e-12
    )
    assert stored.with_suffix(".svg").exists()


@pytest.mark.campaign
def test_plot_of_regions_draws_the_regions(tmp_path: Path) -> None:
    target = tmp_path / "regions.svg"
    only = "regions/runge-kutta/original/polynomial"
    assert main(["stress", "--only", only, "--plot", str(target)]) == 0
    assert target.read_bytes().startswith(b"<?xml")
    assert target.with_suffix(".csv").exists()


def test_forecast_is_what_comes_of_it() -> None:
    """The forecast is no mere bound: it has the truncation error to 5 %, even where IER is 129."""
    forecast = Forecaster(path(case_scene(5), 1.0), "four-term")
    for count in (1000, 100_000):
        (check,) = checks_of(f"step-size/four-term/case-5/corrected/{1.0 / count:.0e}").values()
        assert check.value == pytest.approx(forecast.predict(count).truncation, rel=0.05)


@pytest.mark.parametrize("name", SCHEMES)
def test_schemes_have_their_orders(name: str) -> None:
    """The local error of a step begins one power of the step size above the order."""
    omega = np.array([[0.3, 1.0, -0.7]])
    missed = np.abs(local_error(SCHEMES[name].scheme, case_scene(5), omega)).max(axis=(1, 2))
    order = SCHEMES[name].order
    assert missed[: order + 1].max() < 1e-12
    assert missed[order + 1] > 1e-7


def test_series_and_numbers_agree() -> None:
    scene, omega = case_scene(6), np.array([[0.0, 1.0, 1.0]])
    h = 1e-3
    powers = h ** np.arange(TERMS)[:, None, None]
    for each in SCHEMES.values():
        series = local_error(each.scheme, scene, omega) + Series(scene).solution(omega)
        stepped = each.scheme(Numbers(scene, h), omega)
        np.testing.assert_allclose((series * powers).sum(axis=0), stepped, rtol=1e-14)


def test_linear_theory_does_not_see_the_moved_points() -> None:
    before, after = (
        checks_of(f"step-size/two-term/case-4/{label}/diverges").popitem()[1]
        for label in ("original", "corrected")
    )
    assert before.value == 0.0
    assert after.passed
    assert after.limit is not None


def test_growth_that_rounding_alone_makes_is_none() -> None:
    growth = {each.name: each.growth for each in regions().regions}["runge-kutta corrected, rk4"]
    assert (growth[:40] == 0.0).all()
    assert (abs(growth[growth != 0.0]) > 1e-13).all()

"""Trials of step sizes, stability regions and matrices: bounds hold, planted faults break them."""

import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pyharness.cli.main import main
from pyharness.compare.checks import Check
from pyharness.model.listing import Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import collocation
from pyharness.original.linear_solver import leqt1f
from pyharness.original.programs import PROGRAM_REGISTRY, Program
from pyharness.stress.disturbances import complex_step, moving_step
from pyharness.stress.divergence import divergence
from pyharness.stress.region_picture import regions_picture
from pyharness.stress.run import stress
from pyharness.theory import collocation_matrices
from pyharness.theory.amplification import (
    Amplification,
    amplification,
    boundary,
    weight_of_squares,
)
from pyharness.theory.collocation_matrices import singular_below, solved
from pyharness.theory.regions import regions
from pyharness.theory.schemes import SCHEMES, TERMS, Numbers, Series, local_error, spacing
from pyharness.theory.step_errors import Forecaster, path
from pyharness.verify.plants.planted_twins import plant_in_twin
from pyharness.views.pictures import saved

FIGURES = Path(__file__).parent.parent.parent / "docs/figures"


def _checks(*only: str) -> dict[str, Check]:
    return {outcome.check.id: outcome.check for outcome in stress(only)}


def _failed(*only: str) -> list[str]:
    return [id for id, check in _checks(*only).items() if not check.passed]


# Matrices


def test_all_matrices_are_within_their_bounds() -> None:
    checks = _checks("matrices")
    assert not [id for id, check in checks.items() if not check.passed]
    assert len(checks) > 300


def test_programs_meet_the_singularity_that_was_foretold() -> None:
    """In the original the points move out of danger; corrected every step prints 129."""
    checks = _checks("matrices/four-term/original", "matrices/four-term/corrected")
    assert checks["matrices/four-term/original/ier-1e-06"].note == "IER = 129 in 19 of 300 steps"
    assert checks["matrices/four-term/corrected/ier-1e-06"].note == "IER = 129 in 300 of 300 steps"
    assert singular_below("four-term") == pytest.approx(1.9073e-5, rel=1e-4)
    assert singular_below("two-term") == pytest.approx(1.5 * 2.0**-52, rel=1e-12)


def test_in_24_bits_the_four_term_matrix_is_singular_at_the_step_of_the_thesis() -> None:
    """The solver in NumPy's binary32, against the rule in fractions."""
    step = singular_below("four-term", bits=24)
    assert step == pytest.approx(0.0155, rel=1e-3)
    for factor, expected in ((0.01 / step, 129), (0.999, 129), (1.001, 0)):
        points = collocation_matrices.points("four-term", factor * step)
        matrix = np.array(collocation.collocation_matrix(points), dtype=np.float32)
        _, ier = leqt1f([list(row) for row in matrix], [[np.float32(1.0)] * 4])  # type: ignore[list-item]
        assert ier == expected


def _compiled(monkeypatch: pytest.MonkeyPatch, old: str, new: str, ulps: int = 0) -> None:
    """Put a solver with a fault where the compiled one stands."""
    source = Path(collocation.__file__).with_name("linear_solver.py").read_text()
    assert source.count(old) == 1
    planted: dict[str, object] = {}
    exec(source.replace(old, new), planted)
    factor = planted["_factor"]
    solve = planted["leqt1f"]

    def solve_linear(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        factors = a.tolist()
        factor(factors)  # type: ignore[operator]
        x, ier = solve(a.tolist(), b.T.tolist())  # type: ignore[operator]
        return np.array(factors), np.array(x).T * (1.0 + ulps * 2.0**-52), ier

    room = SimpleNamespace(solve_linear=solve_linear)
    monkeypatch.setattr("pyharness.model.extension.extension", lambda: room)


@pytest.mark.parametrize(
    ("old", "new", "broken"),
    [
        ("scaled > biggest", "scaled < biggest or not biggest", "matrices/four-term/1e+00/pivots"),
        ("scale[i] * abs(a[i][j])", "abs(a[i][j])", "matrices/four-term/1e+01/pivots"),
        ("n + biggest == n", "1 + biggest == 1", "matrices/four-term/threshold"),
        ("n + biggest == n", "biggest == 0.0", "matrices/four-term/1e-08/ier"),
        ("total = total - row[k] * a[k][j]", "total = total + row[k] * a[k][j]",
         "matrices/two-term/1e-02/residual"),
    ],
)  # fmt: skip
def test_a_fault_in_the_solver_is_caught(
    old: str, new: str, broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not _failed(broken)
    _compiled(monkeypatch, old, new)
    assert _failed(broken) == [broken]


def test_wrong_digits_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """One unit in the last place by the comparison with the twin, many by the bounds."""
    names = [f"matrices/two-term/1e-02/{name}" for name in ("bits", "residual", "forward")]
    names.append("matrices/two-term/1e-02/increment")
    _compiled(monkeypatch, "n + biggest == n", "n + biggest == n", ulps=1)
    assert _failed(*names) == names[:1]
    _compiled(monkeypatch, "n + biggest == n", "n + biggest == n", ulps=1000)
    assert sorted(_failed(*names)) == sorted(names)


def test_condition_is_that_of_numpy() -> None:
    found = solved("four-term", 1.0)
    matrix = np.array(collocation.collocation_matrix(collocation_matrices.points("four-term", 1.0)))
    assert found.condition == pytest.approx(float(np.linalg.cond(matrix, np.inf)), rel=1e-9)


# Regions


def test_polynomials_are_those_of_the_schemes() -> None:
    """Classical Runge-Kutta has the exponential's first five terms, one correction its first 3."""
    (((*exponential,),),) = amplification(corrected("runge-kutta")).coefficients
    assert exponential == [Fraction(1, math.factorial(k)) for k in range(5)]
    for program in ("two-term", "four-term"):
        for listing in (original(program), corrected(program)):
            for step in (1, 10, 100):
                (((*found,),),) = amplification(listing, step).coefficients
                assert found == [1, 1, Fraction(1, 2), 0, 0], "moved points change no straight line"
    before = amplification(original("runge-kutta"))
    assert before.text() == "[1 + 1/2 z, 0; z + 5/6 z^2 + 7/24 z^3 + 1/24 z^4, 1]"


def test_boundaries_are_the_known_ones() -> None:
    """Hairer and Wanner 1996, IV.2: 2.785 and the root of 8 for order 4, 2 and 0 for order 2."""
    fourth, second = amplification(corrected("runge-kutta")), amplification(corrected("two-term"))
    assert boundary(fourth, -1.0)[0] == pytest.approx(2.785293563405282, rel=1e-12)
    assert boundary(fourth, 1j)[0] == pytest.approx(math.sqrt(8.0), rel=1e-12)
    assert boundary(second, -1.0)[0] == pytest.approx(2.0, rel=1e-12)
    assert boundary(second, 1j)[0] == 0.0
    assert boundary(amplification(original("runge-kutta")), -1.0)[0] == pytest.approx(4.0)


def test_the_limit_of_the_punched_runge_kutta_is_in_its_matrix() -> None:
    """What decays ends near minus its beginning: 2 y(t/2) - y(0), with y gone."""
    matrix = amplification(original("runge-kutta")).at(np.array(-0.01)).real
    end = np.linalg.matrix_power(matrix, 5000) @ np.ones(2)
    assert end[1] == pytest.approx(-1.0, abs=0.02)


def test_weights_of_moved_points() -> None:
    """Two points extrapolate s**2 to -2/9 of time squared, as docs/findings.md derives it."""
    assert weight_of_squares(corrected("two-term"), 50) == Fraction(5, 18)
    for n in (1, 7, 100):
        assert weight_of_squares(original("two-term"), n) == Fraction(n, 2) - Fraction(2 * n * n, 9)
        assert weight_of_squares(original("four-term"), n) == Fraction(1, 3)


def test_the_matrix_of_a_system_is_the_polynomial_of_it() -> None:
    matrix = [[Fraction(0), Fraction(1, 2)], [Fraction(-1, 3), Fraction(1, 7)]]
    z = np.array(matrix, dtype=float)
    for listing in (corrected("runge-kutta"), original("runge-kutta")):
        found: Amplification = amplification(listing)
        expected = sum(
            np.kron(found.coefficients[..., k].astype(float), np.linalg.matrix_power(z, k))
            for k in range(5)
        )
        np.testing.assert_allclose(np.array(found.of(matrix), dtype=float), expected, rtol=1e-14)


def test_every_program_does_what_its_matrix_says() -> None:
    checks = _checks("regions")
    assert not [id for id, check in checks.items() if not check.passed]
    limits = [c.limit for id, c in checks.items() if "first-step" in id and c.limit is not None]
    assert len(limits) == 8 * 28
    assert max(limits) < 1e-5, "a bound that allows everything bounds nothing"


@pytest.mark.parametrize(
    ("program", "file", "old", "new", "broken"),
    [
        ("runge-kutta", "runge_kutta.py", "2.0 * (k2 + k3)", "2.00001 * (k2 + k3)",
         ("first-step-spiral-in-0.25", "10-steps-real-0.5", "boundary-imaginary")),
        ("runge-kutta", "runge_kutta.py", "evaluate(4, at=3)", "evaluate(4, at=2)",
         ("first-step-tilted-1", "100-steps-imaginary-0.125", "boundary-real")),
        ("two-term", "collocation.py", "2.0 * t, 3.0", "2.000001 * t, 3.0",
         ("first-step-saddle-0.5", "100-steps-imaginary-0.5", "boundary-real")),
        ("four-term", "collocation.py", "2.0 * t, 3.0", "2.000001 * t, 3.0",
         ("first-step-spin-0.25", "100-steps-imaginary-0.125")),
        ("four-term", "equations.py", "b * u[0] * u[2]", "b * u[0] * u[2] * 1.0001",
         ("first-step-spin-0.25", "10-steps-imaginary-0.5")),
    ],
)  # fmt: skip
def test_a_wrong_coefficient_is_caught(
    program: str,
    file: str,
    old: str,
    new: str,
    broken: Sequence[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    planted = plant_in_twin(program, file, old, new, tmp_path)
    monkeypatch.setitem(PROGRAM_REGISTRY, program, planted)
    names = [f"regions/{program}/corrected/{each}" for each in broken]
    assert sorted(_failed(*names)) == sorted(names)


@pytest.mark.parametrize(
    ("program", "column", "steady"), [("two-term", 1, True), ("four-term", 2, False)]
)
def test_a_wrong_coefficient_of_the_twin_is_caught(
    program: str, column: int, steady: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A steady rotation makes rates straight lines: powers above t**2 show in motion alone."""
    true = collocation.collocation_matrix

    def planted(points: Sequence[float]) -> list[list[float]]:
        return [[x * (1.01 if j == column else 1.0) for j, x in enumerate(row)]
                for row in true(points)]  # fmt: skip

    def agree() -> list[bool]:
        listing = original(program)
        probes = complex_step(listing, 10, -1.0 + 1.0j), moving_step(case_scene(6), listing, 10)
        return [probe.difference <= probe.limit for probe in probes]

    assert agree() == [True, True]
    monkeypatch.setattr(collocation, "collocation_matrix", planted)
    assert agree() == [not steady, False]


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


def test_plot_of_regions_draws_the_regions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "regions.svg"
    save = ["--save", str(tmp_path / "worst")]
    assert main(["stress", "--only", "matrices,regions", "--plot", str(target), *save]) == 2
    assert "--plot draws one trial" in capsys.readouterr().err
    assert not target.exists()
    only = "regions/runge-kutta/original/polynomial"
    assert main(["stress", "--only", only, "--plot", str(target)]) == 0
    assert target.read_bytes().startswith(b"<?xml")
    assert target.with_suffix(".csv").exists()


# Step sizes

_SOME = (
    "step-size/two-term/case-5",
    "step-size/four-term/case-6/corrected",
    "step-size/runge-kutta/case-3",
    "step-size/rk4/case-5",
    "step-size/gauss-2/case-4",
)


def test_errors_are_within_what_was_foretold() -> None:
    checks = _checks(*_SOME)
    assert not [id for id, check in checks.items() if not check.passed]
    bounded = [check for check in checks.values() if check.limit is not None]
    assert len(bounded) > 40


def test_forecast_is_what_comes_of_it() -> None:
    """Not a bound alone: truncation is foretold to a few per cent, even where IER is 129."""
    forecast = Forecaster(path(case_scene(5), 1.0), "four-term")
    for count in (1000, 10_000, 100_000):
        check = _checks(f"step-size/four-term/case-5/corrected/{1.0 / count:.0e}")
        ((_, found),) = check.items()
        assert found.value == pytest.approx(forecast.at(count).truncation, rel=0.05)


@pytest.mark.parametrize("name", SCHEMES)
def test_schemes_have_their_orders(name: str) -> None:
    """What a step misses begins one power above the order, and not later."""
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


def test_differences_are_exact_for_polynomials() -> None:
    for count in (1, 2, 8):
        weights = spacing(count)
        for degree in range(1, 2 * count + 1, 2):
            derivative = sum(2 * w * i**degree for i, w in enumerate(weights, 1))
            assert derivative == (1 if degree == 1 else 0)


def test_a_wrong_weight_is_caught_by_small_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planted = plant_in_twin(
        "runge-kutta", "runge_kutta.py", "(dt / 6.0)", "(dt / 6.0000001)", tmp_path
    )
    monkeypatch.setitem(PROGRAM_REGISTRY, "runge-kutta", planted)
    broken = "step-size/runge-kutta/case-5/corrected/1e-03"
    assert _failed(broken) == [broken]


class _Coarse(Program):
    """A program whose results are rounded to fewer digits, as if at every step."""

    def _computed(
        self, scene: Scene, listing: Listing, implementation: str, *options: Any
    ) -> Trajectory:
        """Run, then spoil the last digits."""
        run = super()._computed(scene, listing, implementation, *options)
        return replace(run, omega=np.round(run.omega, 9))


def test_too_much_rounding_moves_the_crossing(monkeypatch: pytest.MonkeyPatch) -> None:
    known = PROGRAM_REGISTRY["runge-kutta"]
    coarse = _Coarse(known.name, known.order, known.source)
    monkeypatch.setitem(PROGRAM_REGISTRY, "runge-kutta", coarse)
    broken = "step-size/runge-kutta/case-5/corrected/crossing"
    assert _failed(broken) == [broken]


def test_divergence_is_not_that_of_another_scheme() -> None:
    """The corrected Runge-Kutta held to the matrix of collocation, and to its own."""
    scene = case_scene(4)

    def runner(each: Scene) -> Trajectory:
        return PROGRAM_REGISTRY["runge-kutta"].run(
            each, corrected("runge-kutta"), may_stop=False, velocity=False
        )

    for listing, agrees in ((corrected("runge-kutta"), True), (corrected("two-term"), False)):
        seen = divergence(scene, 100.0, amplification(listing), runner, 2e-3)
        assert (abs(seen.found / seen.foretold - 1.0) <= seen.limit) == agrees


def test_linear_theory_does_not_see_the_moved_points() -> None:
    """The original two-term program leaves with every step; corrected it is as theory has it."""
    id = "step-size/two-term/case-4/{}/diverges"
    checks = _checks(id.format("original"), id.format("corrected"))
    assert checks[id.format("original")].value == 0.0
    assert checks[id.format("corrected")].passed
    assert checks[id.format("corrected")].limit is not None


def test_slope_of_a_boundary_is_that_of_the_growth_beyond_it() -> None:
    matrix = amplification(corrected("runge-kutta"))
    distance, slope = boundary(matrix, -1.0)
    assert distance == pytest.approx(2.785293563405282, rel=1e-9)
    z = -distance
    assert slope == pytest.approx(abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0), rel=1e-3)

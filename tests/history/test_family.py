"""The weighted residual family: its members, their orders, and what the thesis says of them."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pyharness import InputError, Scene, case_scene
from pyharness.cli.main import main
from pyharness.history.family import members as room
from pyharness.history.family.members import (
    WEIGHTINGS,
    Member,
    converged_order,
    march,
    predicted_order,
    run,
)
from pyharness.history.family.orders import (
    SCHEMES,
    SLACK,
    concurrence,
    family_members,
    measured_order,
    order_table,
    terms_findings,
)
from pyharness.history.family.rounding import (
    conditions,
    multiplied_out,
    rounding_findings,
    weighting_findings,
)
from pyharness.model.listing import corrected, original
from pyharness.model.report import short
from pyharness.original import compiled
from pyharness.original.linear_solver import SINGULAR, leqt1f
from pyharness.theory.tableau import Tableau, tableau
from pyharness.truth.reference import reference

Capture = pytest.CaptureFixture[str]

PAGE = Path(__file__).parent.parent.parent / "docs" / "family.md"

# A step rounds by some ten units in the last place of the largest omega, the motions of the cases
# amplify it less than tenfold: 100 steps stay below 100 * 10 * 10 * 1.1e-16.
ROUNDING = 1.1e-12


@pytest.mark.parametrize("case", range(1, 8))
@pytest.mark.parametrize(("program", "terms"), [("two-term", 2), ("four-term", 4)])
def test_mended_programs_are_members(program: str, terms: int, case: int) -> None:
    scene = case_scene(case)
    wanted = compiled.run(scene, corrected(program))
    found = run(scene, Member("collocation", terms))
    scale = np.abs(wanted.omega).max()
    np.testing.assert_allclose(found.omega, wanted.omega, rtol=0, atol=ROUNDING * scale)
    np.testing.assert_array_equal(found.time, wanted.time)
    np.testing.assert_array_equal(found.recorded_time, found.time)
    assert found.velocity is None
    assert (found.steps, found.evaluations, found.ended) == (
        wanted.steps, wanted.evaluations, wanted.ended,
    )  # fmt: skip


@pytest.mark.parametrize("case", [5, 6])
def test_every_order_is_the_one_derived(case: int) -> None:
    found = order_table(case_scene(case))
    assert len(found) == len(family_members()) == 200
    assert [each.member for each in found if not abs(each.deviation) <= SLACK] == []


@pytest.mark.parametrize("case", [1, 2, 3, 4, 7])
def test_no_order_is_below_the_one_derived(case: int) -> None:
    """Special scenes (no products, nearly linear, quick torque) may only do better."""
    found = order_table(case_scene(case), family_members(corrections=(1, 2, 4, 8)))
    assert [each.member for each in found if each.misses] == []
    if case == 1:
        assert all(each.measured is None and each.error < 2e-14 for each in found)
    elif case != 7:
        assert sum(abs(each.deviation) <= SLACK for each in found) > 90


def test_derived_orders() -> None:
    """For n = 1 ... 5, after as many corrections as it takes; docs/family.md states the same."""
    wanted = {
        ("collocation", "thesis"): [2, 2, 4, 4, 6],
        ("collocation", "gauss"): [2, 4, 6, 8, 10],
        ("subdomain", None): [2, 4, 4, 6, 6],
        ("galerkin", None): [1, 2, 3, 4, 5],
        ("least-squares", None): [2, 4, 6, 8, 10],
    }
    for weighting, points in SCHEMES:
        found = [converged_order(Member(weighting, n, points, 99)) for n in range(1, 6)]
        assert found == wanted[weighting, points]
        cells = [weighting, points or "-", *map(str, found)]
        assert f"| {' | '.join(cells)} |" in PAGE.read_text()
    assert [predicted_order(Member("galerkin", 3, None, k)) for k in range(5)] == [1, 2, 3, 3, 3]


@pytest.mark.parametrize(
    ("points", "order"),
    [
        ((1 / 3, 1.0), 3),  # Radau
        ((0.0, 0.5, 1.0), 4),  # Lobatto
        ((0.0, 0.4, 1.0), 3),
        ((0.1, 0.35), 2),
        ((0.5,), 2),
        ((0.4,), 1),
    ],
)
def test_points_of_ones_own(points: tuple[float, ...], order: int) -> None:
    member = Member("collocation", len(points), points, 6)
    assert converged_order(member) == order
    measured = measured_order(member, case_scene(5))
    assert measured is not None
    assert abs(measured - order) <= SLACK
    turned = replace(member, points=points[::-1])
    np.testing.assert_allclose(
        run(case_scene(5), member).omega, run(case_scene(5), turned).omega, rtol=1e-12
    )


@pytest.mark.parametrize("terms", range(1, 6))
@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_tableau_solves_the_conditions_of_the_thesis(weighting: str, terms: int) -> None:
    """Against eq. 23-26 in powers of t, which share no code with it, for f = s**j."""
    member = Member(weighting, terms)
    matrix = conditions(member, 1.0, np.float64, terms)
    moments = conditions(member, 1.0, np.float64, 2 * terms + 1)
    scheme = tableau(weighting, terms, member.points)
    powers = scheme.nodes[:, None] ** np.arange(1, terms + 1)
    for j in range(2 * terms + 1):
        c = np.linalg.solve(matrix, moments[:, j] / (j + 1))
        f = scheme.nodes**j
        np.testing.assert_allclose(scheme.weights @ f, c.sum(), atol=1e-10)
        np.testing.assert_allclose(scheme.matrix @ f, powers @ c, atol=1e-10)


def test_weights_of_eq_24_and_25() -> None:
    """Two entries by hand: integral of t (c1 + 2 c2 t), and of 2 t times 2 t."""
    galerkin = conditions(Member("galerkin", 2), 1.0, np.float64, 2)
    np.testing.assert_allclose(galerkin, [[1 / 2, 2 / 3], [1 / 3, 2 / 4]])
    least = conditions(Member("least-squares", 2), 1.0, np.float64, 2)
    np.testing.assert_allclose(least, [[1.0, 1.0], [1.0, 4 / 3]])
    parts = conditions(Member("subdomain", 2), 1.0, np.float64, 2)
    np.testing.assert_allclose(parts, [[1 / 2, 1 / 4], [1 / 2, 3 / 4]])


def test_no_correction_is_eulers_method() -> None:
    scene = replace(case_scene(7), steps=5)
    omega = np.array(scene.omega)
    rate = scene.right_hand_side()
    for step, row in enumerate(run(scene, Member("galerkin", 3, None, 0)).omega):
        omega = omega + scene.step_size * np.array(rate(step * scene.step_size, omega.tolist()))
        np.testing.assert_allclose(row, omega, rtol=1e-14)


def test_torque_is_taken_at_true_times() -> None:
    """Twice Gauss's order is reached under torques that turn by one radian a step."""
    scene = case_scene(7)
    truth = reference(scene, scene.times()).omega
    for member in (Member("collocation", 5, "gauss", 8), Member("least-squares", 5, None, 8)):
        assert np.abs(run(scene, member).omega - truth).max() < 1e-14


def test_overflow_ends_the_rows() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0), step_size=0.5, steps=50)
    for weighting in WEIGHTINGS:
        found = run(scene, Member(weighting, 3, None, 2))
        assert found.ended == "overflow"
        assert 0 < found.steps == len(found.omega) == len(found.time) < 50
        assert np.isfinite(found.omega).all()
        nodes = len(tableau(weighting, 3).nodes)
        assert found.evaluations == (found.steps + 1) * (1 + 2 * nodes)


def test_side_by_side_is_as_alone() -> None:
    scene = case_scene(5)
    members = family_members(terms=(2, 5), corrections=(0, 1, 3))
    for member, omega in zip(members, march(scene, members), strict=True):
        np.testing.assert_allclose(omega, run(scene, member).omega, rtol=1e-13)


# What the thesis says of the family.


@pytest.mark.claims
@pytest.mark.parametrize("case", range(1, 7))
def test_three_four_and_five_terms_are_one_method_after_one_correction(case: int) -> None:
    """Under constant torque f is a parabola after one estimate, which three terms can follow."""
    scene = case_scene(case)
    members = family_members(terms=(3, 4, 5), corrections=(1,))
    omega = march(scene, members)
    spread = np.ptp(omega, axis=0).max()
    assert spread < ROUNDING * np.abs(omega).max()


@pytest.mark.claims
def test_models_that_concur_in_case_6_concur_in_their_error() -> None:
    scene = case_scene(6)
    once, often = concurrence(scene), concurrence(scene, corrections=8)
    assert once.terms == (2, 3, 4, 5)
    assert max(once.differences[1:]) < 1e-12
    assert min(once.errors) > 0.03
    assert once.differences[0] < 0.1 * once.errors[0]
    assert often.errors[0] > 1e3 * often.errors[1] > 1e3 * often.errors[3]
    # With torques that vary three terms no longer follow f, and the models do differ.
    assert min(concurrence(case_scene(7)).differences) > 1e-9


@pytest.mark.claims
@pytest.mark.parametrize("case", [2, 3, 4, 5, 6])
def test_higher_powers_add_little_only_because_of_the_one_correction(case: int) -> None:
    once, often = terms_findings(case_scene(case))
    assert (once.corrections, often.corrections) == (1, 8)
    assert once.errors[0] < 1.1 * once.errors[-1]
    assert often.errors[0] > 1e6 * often.errors[-1]


@pytest.mark.claims
@pytest.mark.parametrize("terms", [2, 3, 4, 5])
@pytest.mark.parametrize("case", [1, 2])
def test_other_weightings_do_not_fail_and_rounding_is_not_to_blame(case: int, terms: int) -> None:
    found = weighting_findings(case_scene(case), terms)
    assert [each.member.weighting for each in found] == list(WEIGHTINGS)
    for each in found:
        assert each.error < (2e-14 if case == 1 else 2.1e-3)
        assert each.double < 1e-12
        assert each.single < 1e-4
        if case == 2:
            assert each.error < 1.01 * found[0].error
            assert 20 * each.single < each.error


@pytest.mark.claims
@pytest.mark.parametrize("case", [1, 2])
def test_rounding_at_small_steps_is_that_of_collocation(case: int) -> None:
    for each in rounding_findings(case_scene(case)):
        assert each.steps == 1000
        assert each.error < 1e-13


@pytest.mark.claims
def test_singularity_test_fires_only_for_five_terms_at_small_steps() -> None:
    for weighting in WEIGHTINGS:
        for terms in (2, 3, 4, 5):
            for h in (0.01, 0.001):
                matrix = conditions(Member(weighting, terms), h, np.float64, terms).tolist()
                _, ier = leqt1f(matrix, [[1.0] * terms])
                fires = weighting in ("galerkin", "least-squares") and (terms, h) == (5, 0.001)
                assert ier == (SINGULAR if fires else 0)


@pytest.mark.claims
@pytest.mark.parametrize("case", range(1, 7))
def test_points_out_of_place_do_not_show_in_four_terms(case: int) -> None:
    scene = case_scene(case)
    before, after = (compiled.run(scene, f("four-term")).omega for f in (original, corrected))
    np.testing.assert_allclose(before, after, rtol=0, atol=ROUNDING * np.abs(after).max())
    before, after = (compiled.run(scene, f("two-term")).omega for f in (original, corrected))
    shows = len(before) < len(after) or np.abs(before - after).max() > 1e-4
    assert shows == (case > 2)  # in Case 2 f is a straight line, which two terms follow


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_multiplied_out_products_give_the_same(weighting: str) -> None:
    scene, member = case_scene(3), Member(weighting)
    wanted = run(scene, member).omega
    found = multiplied_out(scene, member, np.float64)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-10)


def test_multiplied_out_products_are_refused_where_they_can_not_be() -> None:
    with pytest.raises(InputError, match="constant torques"):
        multiplied_out(case_scene(7), Member("galerkin"), np.float64)
    with pytest.raises(InputError, match="corrections is 2"):
        multiplied_out(case_scene(5), Member("galerkin", corrections=2), np.float64)
    with pytest.raises(InputError, match="points"):
        multiplied_out(case_scene(5), Member("collocation", points="gauss"), np.float64)


@pytest.mark.claims
def test_numbers_of_the_page_are_current() -> None:
    """Those of rounding (below 1e-12) may differ by machine and are bounded above."""
    rows = [
        [str(each.corrections), *map(short, each.errors)] for each in terms_findings(case_scene(5))
    ]
    often = concurrence(case_scene(6), corrections=8)
    rows.append(["8", *map(short, (*often.differences, *often.errors))])
    for cells in rows:
        assert f"| {' | '.join(cells)} |" in PAGE.read_text()
    once = concurrence(case_scene(6))
    assert f"| 1 | {short(once.differences[0])} | " in PAGE.read_text()
    assert f" | {' | '.join(map(short, once.errors))} |" in PAGE.read_text()
    for each in weighting_findings(case_scene(2)):
        assert f"| 2 | 2 | {each.member.weighting} | {short(each.error)} |" in PAGE.read_text()


# The checks above see a fault.

Fault = Callable[[Tableau], Tableau]
FAULTS: dict[str, Fault] = {
    "a weight": lambda s: replace(s, weights=s.weights * 1.001),
    "a sign": lambda s: replace(s, matrix=-s.matrix),
    "a node": lambda s: replace(s, nodes=s.nodes * 0.99),
    "one entry": lambda s: replace(s, matrix=s.matrix + 0.01 * np.eye(len(s.nodes))),
    "result for estimate": lambda s: replace(s, matrix=np.tile(s.weights, (len(s.nodes), 1))),
}


@pytest.mark.parametrize("weighting", WEIGHTINGS)
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_caught(fault: str, weighting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def faulty(weighting: str, terms: int, points: str | tuple[float, ...] | None) -> Tableau:
        return FAULTS[fault](tableau(weighting, terms, points))

    points = "gauss" if weighting == "collocation" else None
    members = [Member(weighting, n, points, k) for n in (3, 4) for k in (1, 2, 4)]
    assert not any(each.misses for each in order_table(case_scene(5), members))
    monkeypatch.setattr(room, "tableau", faulty)
    found = order_table(case_scene(5), members)
    assert any(not abs(each.deviation) <= SLACK for each in found)


# Mistakes, and the verb.


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("colocation", 2), "did you mean 'collocation'"),
        (("collocation", 0), "terms is 0"),
        (("collocation", 13), "terms is 13"),
        (("collocation", 2, "gaus"), "did you mean 'gauss'"),
        (("collocation", 2, (0.5,)), "1 given"),
        (("collocation", 2, (0.5, 1.5)), "1.5; allowed: 0 to 1"),
        (("collocation", 2, (0.5, math.nan)), "nan; allowed"),
        (("collocation", 2, (0.5, 0.5)), "given twice"),
        (("collocation", 3, (0.5, 0.5 + 1e-12, 0.6)), "too close"),
        (("galerkin", 2, "gauss"), "no meaning with galerkin"),
        (("galerkin", 2, None, -1), "corrections is -1"),
        (("galerkin", 2, None, 101), "corrections is 101"),
    ],
)
def test_what_is_no_member_is_refused(arguments: tuple[str, int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Member(*arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--weighting", "galrkin"], "did you mean 'galerkin'"),
        (["--weighting", ""], "unknown weighting ''"),
        (["--terms", "two"], "'two' where a whole number belongs"),
        (["--terms", "99"], "terms is 99"),
        (["--points", "gaus"], "did you mean 'gauss'"),
        (["--points", ""], "where a number belongs"),
        (["--points", "0.1,x"], "'x' where a number belongs"),
        (["--points", "-0.1,1"], "-0.1; allowed: 0 to 1"),
        (["--points", "0.1"], "as many as there are terms, 2"),
        (["--weighting", "galerkin", "--points", "gauss"], "no meaning with galerkin"),
        (["--corrections", "-1"], "corrections is -1"),
        (["--case", "9"], "unknown case '9'"),
        (["--steps", "20000"], "allowed for orders"),
        (["--format", "xml"], "unknown format"),
        (["--out", "no/such/folder/x"], "there is no folder"),
    ],
)
def test_mistake_is_one_line(arguments: list[str], words: str, capsys: Capture) -> None:
    assert main(["family", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err


def test_solution_that_leaves_every_bound_is_refused() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0), step_size=0.3)
    with pytest.raises(InputError, match=r"leaves every bound after 0\.9"):
        order_table(scene)


def test_table_fits_and_says_what_is_so(capsys: Capture) -> None:
    assert main(["family"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert max(map(len, captured.out.splitlines())) <= 100
    assert "200 of 200 orders within 0.25 of those derived" in captured.out
    assert captured.out.count("\ncollocation ") == 20


def test_long_and_short_scenes_have_orders_too() -> None:
    for changes in ({"steps": 400}, {"steps": 7}, {"step_size": 0.2}):
        scene = replace(case_scene(6), **changes)
        found = measured_order(Member("collocation", 3, "thesis", 2), scene)
        assert found is not None
        assert abs(found - 3) <= SLACK


def test_one_member_in_every_format(capsys: Capture) -> None:
    one = ["family", "--case", "4", "--weighting", "collocation", "--terms", "3"]
    one += ["--points", "0,0.5,1", "--corrections", "3"]
    assert main([*one, "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    (member,) = record["members"]
    assert member["points"] == [0.0, 0.5, 1.0]
    assert member["predicted"] == 4
    assert abs(member["measured"] - 4) < SLACK
    assert record["schema"] == 1
    assert record["unexpected"] == []
    assert main([*one, "--format", "csv"]) == 0
    head, row = capsys.readouterr().out.splitlines()
    assert head.startswith("weighting,points,terms,corrections,predicted,measured")
    assert row.endswith(repr(member["error"]))
    assert main([*one, "--format", "markdown"]) == 0
    assert "| collocation | 0,0.5,1 | 3 | 4/" in capsys.readouterr().out


def test_order_below_the_one_derived_is_exit_code_1(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pyharness.history.family.orders.predicted_order", lambda member: 3)
    assert main(["family", "--terms", "2"]) == 1
    assert "UNEXPECTED: collocation at points thesis, 2 terms, 1 corrections: order 2.0" in (
        capsys.readouterr().out
    )

"""Proved bounds of the functions hold, are those of the page, and see a changed source."""

import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from pyharness.model.codes import Waves
from tests.campaigns.function_errors import (
    lane_circular,
    measured,
    pair_circular,
    pair_operations,
    sources,
)
from tests.campaigns.function_errors.nearness import half_pi, hard_angle, least_distance
from tests.campaigns.function_errors.pair_operations import OPERATIONS, Operation

PAGE = (sources.ROOT / "docs/contributing/function-errors.md").read_text()
U = Fraction(1, 2**53)
SINE, COSINE = 1.24e-16, 1.9e-16  # as the page states them
WIDE_BITS, JAVASCRIPT_BITS = 53, 19
SLACK = 3.0  # of a proved bound over the measured error


def changed_digit(text: str, literal: str, place: int) -> str:
    """Return the text with one significant digit of a literal changed."""
    assert text.count(literal) == 1
    digits = [n for n, letter in enumerate(literal) if letter.isdigit()]
    where = digits[digits.index(next(n for n in digits if literal[n] != "0")) + place]
    other = str((int(literal[where]) + 3) % 10)
    return text.replace(literal, literal[:where] + other + literal[where + 1 :])


def lanes_keep_their_bounds(text: str) -> bool:
    try:
        found = lane_circular.bound(text)
    except ValueError:
        return False
    return found.sine <= SINE and found.cosine <= COSINE


def test_sine_and_cosine_of_many_angles_keep_their_bounds() -> None:
    found = lane_circular.bound(sources.LANES.read_text())
    assert 0.9 * SINE < found.sine <= SINE
    assert 0.9 * COSINE < found.cosine <= COSINE
    assert found.worst <= 2e-16
    given = measured.angles(4000)
    own = measured.circular_error(lane_circular.compute(sources.LANES.read_text(), given), given)
    assert float(found.worst) / SLACK < max(own) <= float(found.worst)
    assert "1.24e-16" in PAGE
    assert "1.90e-16" in PAGE
    assert f"{float(found.reduction.error):.1e}" in PAGE
    assert f"{float(found.reduction.nearest):.1e}" in PAGE


_LITERALS = re.findall(r"\d\.\d+(?:e-\d+)?(?=_dp)", sources.LANES.read_text().split("contains")[0])


@pytest.mark.sampled
@pytest.mark.parametrize("literal", [each for each in _LITERALS if each not in {"1.5", "2.0"}])
def test_a_changed_digit_of_a_constant_exceeds_the_bounds(literal: str) -> None:
    assert len(_LITERALS) == 17
    assert lanes_keep_their_bounds(sources.LANES.read_text())
    assert not lanes_keep_their_bounds(changed_digit(sources.LANES.read_text(), literal, 2))


@pytest.mark.parametrize(("old", "new"), [
    ("s_ = x + x*x2*(", "s_ = x - x*x2*("),
    ("x2*(S(2) + x2*(S(3)", "x2*(S(3) + x2*(S(2)"),
    ("c_ = (1.0_dp - 0.5_dp*x2)", "c_ = (1.0_dp - 0.5_dp*x)"),
    ("s_ = x + x*x2*(S(1) +", "s_ = 0.5_dp*x + (0.5_dp*x + x*x2*S(1)) + x*x2*("),
    ("x = (angle(i) - turns*HALF_PI) - turns", "x = angle(i) - turns*HALF_PI - 2.0_dp*turns"),
])  # fmt: skip
def test_other_statements_exceed_the_bounds(old: str, new: str) -> None:
    text = sources.LANES.read_text()
    assert text.count(old) == 1
    assert not lanes_keep_their_bounds(text.replace(old, new))


def test_distances_from_multiples_of_a_right_angle() -> None:
    low, high = half_pi()
    assert 0 < high - low < Fraction(1, 2**680)
    assert float(low) == math.pi / 2
    for exponent in (1, 6, 20, 30):
        angle = hard_angle(53, exponent)
        turns = round(angle / low)
        assert turns > 0
        assert least_distance(53, exponent) <= abs(angle - turns * low)
        assert abs(angle - turns * high) < 1.01 * least_distance(53, exponent)
    exhaustive = min(
        abs(m * Fraction(2) ** (e - 8) - n * low)
        for e in range(5) for m in range(128, 256) for n in range(1, 12)
    )  # fmt: skip
    assert min(least_distance(8, e) for e in range(5)) <= exhaustive


def test_wide_sine_and_cosine_keep_their_bound() -> None:
    text = sources.WIDE.read_text()
    method = pair_circular.of_fortran(text, Waves.ANGLE_BITS)
    found = pair_circular.bound(method)
    assert found.decided == WIDE_BITS
    assert f"next\n  !! {WIDE_BITS} bits decide the rounding" in text
    hard = [hard_angle(113, n) for n in (3, 30, 45, 59, 60)]
    assert 0 < max(measured.reduction_error(method, angle) for angle in hard) <= found.reduced
    assert pair_circular.bound(pair_circular.of_fortran(text, 33)).decided >= 80
    for old, new in (
        ("1.57079632679489661923132", "1.57079632679489661923133"),
        ("4.3359050650618905123985", "4.3359050650618905123986"),
        ("-1.42671545571947929", "-1.42671545571947928"),
        ("N_TERMS = 25", "N_TERMS = 16"),
    ):
        assert text.count(old) == 1
        other = pair_circular.bound(
            pair_circular.of_fortran(text.replace(old, new), Waves.ANGLE_BITS)
        )
        assert other.decided < WIDE_BITS, old


def test_sine_and_cosine_of_javascript_keep_their_bound() -> None:
    text = sources.JAVASCRIPT.read_text()
    found = pair_circular.bound(pair_circular.of_javascript(text))
    assert found.decided == JAVASCRIPT_BITS
    assert float(found.ulps) < 0.5000013
    for old, new in (
        ("1.5707963267948966", "1.5707963267948963"),
        ("6.123233995736766e-17", "6.123233995736566e-17"),
        ("-1.4973849048591698e-33", "-1.4983849048591698e-33"),
        ("terms.length < 15", "terms.length < 8"),
        ("2 ** -27", "2 ** -24"),
    ):
        assert text.count(old) == 1
        try:
            other = pair_circular.bound(pair_circular.of_javascript(text.replace(old, new)))
        except AssertionError:
            continue
        assert other.decided < JAVASCRIPT_BITS, old


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda o: f"{o.source.stem}-{o.name}")
def test_operations_keep_their_bounds_for_all_operands_of_few_bits(operation: Operation) -> None:
    digits = 4 if "s" in operation.operands else 5
    function = pair_operations.routines(digits)[operation.source][operation.name]
    limit = float(operation.bound(Fraction(1, 2**digits)) * 4**digits)
    assert 0.1 * limit < pair_operations.worst(operation, function, digits, 1) <= limit


@pytest.mark.parametrize(
    "operation", [o for o in OPERATIONS if o.source == sources.WORD_PAIRS], ids=lambda o: o.name
)
def test_operations_of_binary64_keep_their_bounds(operation: Operation) -> None:
    limit = float(operation.bound(U) / U**2)
    assert limit / SLACK < measured.operation_error(operation, 4000) <= limit
    assert f"| {limit:.0f} u² |" in PAGE


def test_longer_product_keeps_its_bound() -> None:
    limit = float(pair_operations.longer_product(U) / U**3)
    assert limit / SLACK < measured.longer_product_error(4000) <= limit
    assert f"| {limit:.0f} u³ |" in PAGE


@pytest.mark.sampled
@pytest.mark.parametrize(("path", "old", "new", "name"), [
    (sources.TWO_WORDS, "+ xl*yh) + xl*yl", "+ xl*yh)", "product_of"),
    (sources.TWO_WORDS, "y_low + x_low*factor", "y_low - x_low*factor", "multiple_of_pair"),
    (sources.TWO_WORDS, "(y - part)", "(part - y)", "sum_of_pairs"),
    (sources.WORD_PAIRS, "rest + (x%low + y%low)", "rest + x%low", "sum_of_pairs"),
    (sources.WORD_PAIRS, "- found%high*y%low)", "+ found%high*y%low)", "quotient_of_pairs"),
])  # fmt: skip
def test_a_changed_operation_exceeds_its_bound(path: Path, old: str, new: str, name: str) -> None:
    text = path.read_text()
    assert old in text
    function = pair_operations.routines(5, {path: text.replace(old, new)})[sources.WORD_PAIRS][name]
    operation = next(o for o in OPERATIONS if o.source == sources.WORD_PAIRS and o.name == name)
    limit = float(operation.bound(Fraction(1, 2**5)) * 4**5)
    assert pair_operations.worst(operation, function, 5, 1) > limit


def test_sums_and_differences_of_two_numbers_are_exact() -> None:
    for digits in (3, 4):
        known = pair_operations.routines(digits)
        for given in pair_operations.operands("ns", digits, 1):
            x, y = given[0], given[1].high
            for found, true in (
                (known[sources.WORD_PAIRS]["difference_of"](x, y), x.values - y.values),
                (known[sources.WIDE]["sum_of"](x, y), x.values + y.values),
            ):
                np.testing.assert_array_equal(found.high.values + found.low.values, true)


def test_products_with_halves_to_nearest_are_exact() -> None:
    known = pair_operations.routines(5)
    for x, y in pair_operations.operands("nn", 5, 1):
        product, rest = known[sources.WORD_PAIRS]["exact_product"](x, y)
        np.testing.assert_array_equal(product.values + rest.values, x.values * y.values)
        found = known[sources.WIDE]["product_of"](x, y)
        np.testing.assert_array_equal(found.high.values + found.low.values, x.values * y.values)


def test_the_splitters_are_those_of_the_translation() -> None:
    assert sources.fortran_numbers(sources.WORD_PAIRS.read_text(), "SPLITTER", 53) == [2**27 + 1]
    assert "SPLITTER = 2.0_wp**57 + 1.0_wp" in sources.WIDE.read_text()
    assert "UPPER_BITS = -134217728_i8" in sources.TWO_WORDS.read_text()


def test_numbers_are_rounded_to_nearest_and_to_even() -> None:
    for numerator in range(1, 2000):
        assert sources.rounded(Fraction(numerator, 7), 53) == Fraction(numerator / 7)
    assert sources.rounded(Fraction(17), 4) == 16
    assert sources.rounded(Fraction(19), 4) == 20
    assert sources.rounded(Fraction(-31), 4) == -32

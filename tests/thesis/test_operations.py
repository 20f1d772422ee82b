"""Operations of a step, counted by hand on the cards."""

from pyharness.model.listing import Listing
from pyharness.thesis.operations import operations_per_step


def test_runge_kutta_is_counted_as_by_hand() -> None:
    rates = 4 * (3 * 3 + 3 * 4)  # 800-850, 950-1000, 1120-1170
    stages = 2 * 6 * 3 + 6 * 2  # 860-910 twice, 1040-1090
    result = 6 * 7  # 1180-1230
    tests = 6 + 6 + 6  # 1270-1320, 1330-1380, 1410-1460
    found = operations_per_step(Listing.original("runge-kutta"))
    assert found.written == 1 + rates + stages + result + tests
    # Counted once are .5*DT, DT/6., and the slopes of stage 2, which the program computes at J = 1
    # again.
    assert found.once == found.written - 16
    # Of all, 6 are divisions by 6, and these are multiplications: slopes, stages, result, tests.
    products = 4 * 12 + 2 * 6 * 2 + 6 + 6 * 2 + 6
    times = {"+": 0, "-": 0, "*": 1, "/": 1000}
    assert operations_per_step(Listing.original("runge-kutta"), times).written == products + 6000
    # A correction takes off an addition to DT.
    two, four = (operations_per_step(Listing.original(p)) for p in ("two-term", "four-term"))
    assert operations_per_step(Listing.corrected("two-term")).written == two.written - 1  # 1660
    assert operations_per_step(Listing.corrected("four-term")).written == four.written - 1  # 2250


def test_powers_and_literals() -> None:
    """Cards 850-960 and 1390-1560 of the four-term deck have powers; equal literals count once."""
    four = operations_per_step(Listing.original("four-term"))
    solver = 2 * _crout(4, 6)
    points = 1 + 4 + 1  # 710-750, 2250
    matrix = 2 * 4 * (1 + (1 + 1) + (1 + 2))  # 2T, 3T**2, 4T**3
    rates = 5 * (3 * 3 + 3 * 4)
    polynomial = 4 + (1 + 2 + 2) + 4  # products, powers, sums: 1390-1400
    assert four.written == points + matrix + rates + 5 * 6 * polynomial + solver


def _crout(n: int, m: int) -> int:
    """Count LEQT1F's operations: scales, sums of products, tests, quotients, two substitutions."""
    sums = sum(2 * min(i, j) for i in range(n) for j in range(n))
    tests = sum(n - j for j in range(n)) + n
    return n + sums + tests + sum(range(n)) + m * (n * (n - 1) + n * (n - 1) + n)


def test_second_factors_of_the_matrix_are_those_of_the_first() -> None:
    """With the same literals and points, the second call saves all but its substitutions."""
    found = operations_per_step(Listing.original("two-term"))
    built_and_factored = 2 + _crout(2, 0)
    assert found.written - found.once >= built_and_factored
    assert found == (254, 225)
    four = operations_per_step(Listing.original("four-term"))
    assert four.once < four.written

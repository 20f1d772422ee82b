"""Certificates: genuine ones are accepted, and each kind of falsified certificate is refused."""

import ast
import copy
import json
import subprocess
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import factorial, nextafter
from pathlib import Path
from random import Random
from typing import Any

import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene, principal
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.truth import certificate_checker
from pyharness.truth.certificate import prove
from pyharness.truth.certificate_checker import NotProvedError, System, check, check_file
from pyharness.truth.enclosed import Balls, decimals, rounded_up
from pyharness.truth.reference import Reference, reference
from tests import intervals
from tests.campaigns import lohner

Record = dict[str, Any]
LAW = TorqueLaw(
    (1.0, -2.0, 0.3), (0.1, 0.0, -7.0),
    sines=[((3.0, 0.0, 1.0), 5.0), ((0.0, 1e-3, 0.0), 100.0), ((1.0, 1.0, 1.0), 0.0)],
    cosines=[((0.0, 2.0, -1.0), -0.7), ((0.1, 0.2, -1.0), 5.0)],
)  # fmt: skip
WAVES = Scene("waves", (0.3, -1.0, 2.0), moments=(40.0, 30.0, 20.0), torque=LAW)
TOP = Scene("top", (0.1, 0.7, 1.3), coefficients=(0.5, -0.25, 0.125))
SCENES = {
    "case 3": (case_scene(3), 0.7), "case 5": (case_scene(5), 0.2), "case 7": (case_scene(7), 0.1),
    "waves": (WAVES, 1.0), "before": (WAVES, -0.7), "coefficients": (TOP, 3.0),
}  # fmt: skip
# The kinds of random scenes whose numbers are neither huge nor tiny.
KINDS = (
    "plain", "near-symmetric", "near-separatrix", "violent torque", "from rest", "slow waves",
    "many speeds", "coefficients",
)  # fmt: skip


@cache
def genuine(name: str) -> Record:
    scene, end = SCENES[name]
    return prove(scene, [end / 2, end], 20).certificate


def refused(certificate: Any) -> bool:
    try:
        check(json.loads(json.dumps(certificate)))
    except Exception:
        return True
    return False


@pytest.mark.parametrize("name", SCENES)
def test_genuine_certificate_passes(name: str) -> None:
    certificate = genuine(name)
    assert check(json.loads(json.dumps(certificate))) == len(certificate["steps"]) > 1
    assert [row["time"] for row in certificate["rows"]] == [SCENES[name][1] / 2, SCENES[name][1]]
    assert all(0.0 < row["radius"] <= 2e-20 * 2 for row in certificate["rows"])


def test_certificate_reaches_the_least_times() -> None:
    """Regression test: 2.0**n overflowed for times below 1e-300 s."""
    for end in (1e-298, 5e-324):
        certificate = prove(case_scene(5), [end], 20).certificate
        assert check(json.loads(json.dumps(certificate))) == 1
        assert [row["time"] for row in certificate["rows"]] == [end]


def test_work_limit_is_on_bits_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression test: steps of numbers with 1000 bits took a minute up to the limit."""
    law = TorqueLaw((1e300, 1e300, 1e300))
    scene = Scene("h", (1.0, 2.0, 3.0), moments=(3.0, 2.0, 1.5), torque=law)
    with pytest.raises(InputError, match=r"more than 6\d steps; .*effort"):
        prove(scene, [3e-150], 25, effort=335 / 10_000)
    # Products of 3.4 times the bits take some ten times as long.
    monkeypatch.setattr(f"{prove.__module__}._BITS_OF_PRODUCT", 250 / 3.4)
    with pytest.raises(InputError, match=r"more than [67] steps"):
        prove(scene, [3e-150], 25, effort=335 / 10_000)


def test_work_limit_is_on_all_attempts() -> None:
    """Regression test: after a first attempt, case 6 took a minute up to the limit."""
    counts = []
    for effort in (0.03, 0.06):
        with pytest.raises(InputError, match=r"steps; .*effort") as caught:
            prove(case_scene(6), [100.0], 25, effort=effort)
        counts.append(int(str(caught.value).split()[3]))
    assert counts[0] > 250
    assert counts[1] < counts[0] + 30
    # Twice what is needed, of which the first attempt is a small part.
    assert 6.0 < float(str(caught.value).split("--effort ")[1].split()[0]) < 12.0


def test_waves_count_as_work() -> None:
    counts = []
    for n in (0, 6):
        law = TorqueLaw((0.1, 0.0, 0.0), sines=[((0.1, 0.0, 0.0), 1.0 + k) for k in range(n)])
        scene = Scene(omega=(1.0, 2.0, 3.0), moments=(3.0, 2.0, 1.5), torque=law)
        with pytest.raises(InputError, match=r"steps; .*effort") as caught:
            prove(scene, [1e3], 25, effort=0.01)
        counts.append(int(str(caught.value).split()[3]))
    assert counts[1] < 0.8 * counts[0]


@pytest.mark.parametrize("kind", KINDS)
def test_certificate_of_a_random_scene_passes(kind: str) -> None:
    for seed in range(3):
        scene = random_scene(kind, seed)
        end = (1.0, -1.0)[seed % 2] * 0.3 * scene.step_size * scene.steps
        proof = prove(scene, [end], 12)
        assert check(json.loads(json.dumps(proof.certificate))) == proof.enclosure.steps
        assert away(proof.enclosure.omega, reference(scene, [end], precise=True)) <= 0.0


def away(omega: tuple[Balls, ...], found: Reference) -> float:
    """Return how far the reference is outside the balls enlarged by its error (rad/s)."""
    assert found.remainder is not None
    largest = -float("inf")
    for balls, high, low in zip(omega, found.omega, found.remainder, strict=True):
        for x, *parts in zip(balls.middle, high, low, strict=True):
            value = sum(map(Fraction, map(float, parts)), Fraction(0))
            # The sum of two binary64 numbers has some 106 bits.
            error = Fraction(found.estimate) + abs(value) / 2**104 + Fraction(1, 10**300)
            largest = max(largest, float(abs(x - value) - balls.radius - error))
    return largest


@pytest.mark.sampled
@pytest.mark.parametrize("name", ["case 5", "case 3"])
def test_rows_contain_the_solution_of_another_prover(name: str) -> None:
    """Its intervals are much smaller than the balls."""
    scene, end = SCENES[name]
    row = genuine(name)["rows"][1]
    for text, interval in zip(row["omega"], lohner.enclosure(scene, [end], 32)[0], strict=True):
        low, high = (Fraction(each) for each in intervals.decimals(interval, 40))
        assert low <= Fraction(text) + Fraction(row["radius"])
        assert high >= Fraction(text) - Fraction(row["radius"])
        assert high - low < Fraction(row["radius"])


@pytest.mark.sampled
@pytest.mark.parametrize("name", SCENES)
def test_balls_contain_the_reference(name: str) -> None:
    scene, end = SCENES[name]
    proof = prove(scene, [end / 2, end], 28)
    assert away(proof.enclosure.omega, reference(scene, [end / 2, end], precise=True)) <= 0.0


def test_moments_of_a_principal_scene_are_exact() -> None:
    inertia = [[3.0, 0.1, 0.2], [0.1, 4.0, 0.3], [0.2, 0.3, 5.0]]
    scene = principal(Scene("full", (0.1, 1.0, 1.0), inertia=inertia))[0]
    certificate = prove(scene, [1.0], 30).certificate
    assert tuple(map(Fraction, certificate["scene"]["moments"])) == scene.exact_moments
    assert any(isinstance(x, str) for x in certificate["scene"]["moments"])
    assert check(certificate) > 0


def begun(record: Record) -> tuple[System, list[int], list[int]]:
    """Return the system of a certificate, its omega and its waves at time 0."""
    system = System(record["scene"], record["bits"], record["clock"], record["scales"])
    omega = [int(Fraction(x) * 2 ** record["bits"]) for x in record["scene"]["omega"]]
    return system, omega, [0, 1 << record["bits"]] * len(system.frequencies)


def replayed(record: Record) -> tuple[System, list[tuple[int, int, list[list[int]], int]]]:
    """Return the system, and for each step its begin, length, polynomials and radius.

    The last entry has the end of the last step.
    """
    system, middle, waves = begun(record)
    time, found = 0, []
    for h, _, radius, after in record["steps"]:
        series = system.expand([*middle, *waves], time, h, record["order"])[0]
        found.append((time, h, series, radius))
        middle, waves, time = after, [sum(each) for each in series[3:]], time + h
    return system, [*found, (time, 0, [], 0)]


def stated(
    system: System, series: list[list[int]], step: tuple[int, int], radius: int, seconds: float
) -> tuple[list[str], float]:
    """Return the omega and radius of a row, from a step that may not contain its time."""
    time, h = step
    middle, size = system.ball(series, (Fraction(seconds) * 2**system.clock - time) / h, radius)
    unit = 1 << system.bits
    return decimals(Balls(tuple(Fraction(x, unit) for x in middle), size / unit))


def digit(source: Random, text: str, last: int) -> str:
    """Return a decimal string with another digit in a place before the last."""
    place = source.choice([n for n, each in enumerate(text[:last]) if each.isdigit()])
    other = source.choice([each for each in "0123456789" if each != text[place]])
    return text[:place] + other + text[place + 1 :]


def put(holder: Any, key: Any, value: Any) -> None:
    """Replace the value at a place; `value` may be a function of the present value."""
    holder[key] = value(holder[key]) if callable(value) else value


def a_step(source: Random, record: Record) -> Any:
    return source.choice(record["steps"])


def a_row(source: Random, record: Record) -> Any:
    return source.choice(record["rows"])


def sign(source: Random, record: Record) -> None:
    step = a_step(source, record)
    holder, key = (step, 0) if source.random() < 0.4 else (step[3], source.randrange(3))
    holder[key] *= -1


def amplitude(source: Random, record: Record) -> None:
    torque = record["scene"]["torque"]
    places = [each[0] for each in torque["sines"] + torque["cosines"]]
    place = source.choice([*places, torque["constant"], torque["rate"]])
    put(place, source.randrange(3), lambda x: source.choice((x + 1.0, x + 1e-9)))


def frequency(source: Random, record: Record) -> None:
    torque = record["scene"]["torque"]
    torque["cosines"].append([[0.1, 0.2, 0.3], 2.0])
    wave = source.choice(torque["sines"] + torque["cosines"])
    wave[1] += source.choice((0.5, 1e-6))


def row_outside(source: Random, record: Record) -> None:
    """Move a row to a time in a step before or after its own, or in no step."""
    row = a_row(source, record)
    clock = 1 << record["clock"]
    ends = [0.0]
    for h, *_ in record["steps"]:
        ends.append(ends[-1] + h / clock)
    inside = [abs(a) <= abs(row["time"]) <= abs(b) for a, b in pairwise(ends)]
    middles = [(a + b) / 2 for (a, b), own in zip(pairwise(ends), inside, strict=True) if not own]
    row["time"] = source.choice((*middles, -row["time"], 1.5 * ends[-1]))


def row_of_a_neighbour(source: Random, record: Record) -> None:
    """Take the middle and the radius of a row from the step before its own."""
    place, row = 0, record["rows"][-1]
    system, states = replayed(record)
    while abs(states[place + 1][0]) < abs(row["time"]) * 2 ** record["clock"]:
        place += 1
    time, h, series, radius = states[place - 1]
    row["omega"], row["radius"] = stated(system, series, (time, h), radius, row["time"])


def row_radius_of_a_neighbour(source: Random, record: Record) -> None:
    """Give a row the radius of the first step, with its own middle."""
    system, states = replayed(record)
    row = record["rows"][-1]
    time, h, series, _ = states[-2]
    row["omega"], row["radius"] = stated(system, series, (time, h), states[0][3], row["time"])


def scales(source: Random, record: Record) -> None:
    factor, double = source.choice((2, 4)), source.random() < 0.5
    record["scales"] = [x * factor if double else x // factor for x in record["scales"]]


def no_integer(source: Random, record: Record) -> None:
    kind = source.choice((float, bool, str))
    place = source.choice(("bits", "clock", "order", "scales", "step", "middle"))
    if place in {"scales", "step", "middle"}:
        step = a_step(source, record)
        lists = {"scales": record["scales"], "step": step, "middle": step[3]}
        put(lists[place], source.randrange(3), kind)
    else:
        put(record, place, kind)


def missing(source: Random, record: Record) -> None:
    holder = source.choice((record, record["scene"], record["scene"]["torque"], record["rows"][0]))
    del holder[source.choice([each for each in holder if each != "name"])]


def long_list(source: Random, record: Record) -> None:
    choices = (record["scene"]["omega"], record["scales"], a_step(source, record)[3])
    place = source.choice((*choices, a_step(source, record)))
    if source.random() < 0.5:
        place.append(place[0])
    else:
        place.pop()


# Changes of a record `r` by random numbers `s`; `test_checker_lines.py` has the simplest ones.
FALSIFIED: dict[str, Callable[[Random, Record], object]] = {
    "middle": lambda s, r: put(
        a_step(s, r)[3], s.randrange(3), lambda x: int(digit(s, str(x), 9999))
    ),
    "least_digit": lambda s, r: put(
        a_step(s, r)[3], s.randrange(3), lambda x: x + s.choice((-1, 1))
    ),
    "stated": lambda s, r: put(a_step(s, r), 2, lambda x: s.choice((x - 1, x // 2, 0, -x))),
    # The error at the begin of the step is outside the tube.
    "tube": lambda s, r: put(
        r["steps"][n := s.randrange(1, len(r["steps"]))], 1, s.randint(-5, r["steps"][n - 1][2])
    ),
    "length": lambda s, r: put(
        a_step(s, r), 0, lambda x: s.choice((x + 1, x * 2, x * 1000, x * 3 // 2 + 1))
    ),
    "sign": sign,
    "shortened": lambda s, r: r["steps"].pop(s.randrange(len(r["steps"]))),
    "swapped": lambda s, r: put(
        r["steps"], slice(n := s.randrange(len(r["steps"]) - 1), n + 2), lambda x: x[::-1]
    ),
    "doubled": lambda s, r: r["steps"].insert(n := s.randrange(len(r["steps"])), r["steps"][n]),
    "amplitude": amplitude,
    "frequency": frequency,
    "torque_sign": lambda s, r: put(
        r["scene"]["torque"], "constant", lambda x: [-each - 1.0 for each in x]
    ),
    # The last digits are within the radius, which is at least 1e-24.
    "row_digit": lambda s, r: put(
        a_row(s, r)["omega"], s.randrange(3), lambda x: digit(s, x, x.index(".") + 18)
    ),
    "row_outside": row_outside,
    "row_of_a_neighbour": row_of_a_neighbour,
    "row_radius_of_a_neighbour": row_radius_of_a_neighbour,
    "row_order": lambda s, r: r["rows"].reverse(),
    "order": lambda s, r: put(r, "order", lambda x: s.choice((x // 2, x - 3, 1, 0, -1))),
    "scales": scales,
    "scale_sign": lambda s, r: put(r["scales"], s.randrange(3), lambda x: x * s.choice((0, -1))),
    "bits": lambda s, r: put(r, "bits", lambda x: x + s.choice((-3, -1, 1, 8))),
    "clock": lambda s, r: put(r, "clock", lambda x: x + s.choice((-3, -1, 1, 8, r["bits"]))),
    "no_integer": no_integer,
    "missing": missing,
    "other_list": lambda s, r: put(
        r, s.choice(("steps", "scales", "rows", "scene")), s.choice((None, 3, "steps", [[1]]))
    ),
    "long_list": long_list,
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", FALSIFIED)
def test_falsified_certificate_is_refused(kind: str, seed: int) -> None:
    source = Random(f"falsified {kind} {seed}")
    record = copy.deepcopy(genuine(source.choice(list(SCENES))))
    before = json.dumps(record)
    FALSIFIED[kind](source, record)
    assert json.dumps(record) != before
    assert refused(record)


@pytest.mark.campaign
def test_rows_take_no_steps() -> None:
    for name, (scene, end) in SCENES.items():
        times = [end * n / 25 for n in range(26)]
        proof = prove(scene, times, 20)
        record = json.loads(json.dumps(proof.certificate))
        assert record["steps"] == genuine(name)["steps"]
        assert [row["time"] for row in record["rows"]] == times[1:]
        assert check(record) == len(record["steps"])
        assert away(proof.enclosure.omega, reference(scene, times, precise=True)) <= 0.0


def test_row_is_the_value_of_the_polynomial() -> None:
    """The rounding errors of the middle are in the radius, and so is the error of the step."""
    system, states = replayed(genuine("waves"))
    _, _, series, radius = states[1]
    largest = Fraction(max(system.scales), 2**certificate_checker.SCALE_BITS)
    for place in (Fraction(0), Fraction(1, 3), Fraction(123_456_789, 987_654_321), Fraction(1)):
        middle, size = system.ball(series, place, radius)
        exact = [sum(x * place**k for k, x in enumerate(each)) for each in series[:3]]
        distances = [x - y for x, y in zip(exact, middle, strict=True)]
        assert all(0 <= each <= size - radius * largest for each in distances)


def test_row_at_the_end_of_a_step_is_in_it() -> None:
    system, states = replayed(genuine("case 5"))
    record = copy.deepcopy(genuine("case 5"))
    ends = [(time + h, time, h, series, radius) for time, h, series, radius in states[:-1]]
    record["rows"] = [
        {"time": end / 2**system.clock, "omega": omega, "radius": size}
        for end, time, h, series, radius in ends
        for omega, size in [stated(system, series, (time, h), radius, end / 2**system.clock)]
    ]
    assert check(record) == len(ends)
    record["rows"][-1]["time"] = nextafter(record["rows"][-1]["time"], 9.0)
    with pytest.raises(NotProvedError, match="no step contains"):
        check(record)


def test_every_digit_of_a_row_counts() -> None:
    record = genuine("case 5")
    for number, row in enumerate(record["rows"]):
        for axis in range(3):
            for sign in (-1, 1):
                changed = copy.deepcopy(record)
                moved = Fraction(row["omega"][axis]) + sign * 2 * Fraction(row["radius"])
                changed["rows"][number]["omega"][axis] = str(moved)
                assert refused(changed)


def test_error_of_the_waves_counts() -> None:
    """An error of a sine changes omega by at most its amplitude over the moment, times the time."""
    record = genuine("waves")
    system, omega, waves = begun(record)
    h = record["steps"][0][0]
    expansion = system.expand([*omega, *waves], 0, h, record["order"])
    tube, wide = 1 << record["bits"] - 10, 1 << record["bits"] - 20
    narrow, _ = system.radii(3, 0, expansion, tube, h)
    wider, kept = system.radii(3, wide, expansion, tube, h)
    seconds = Fraction(h, 1 << record["clock"])
    # The amplitudes of 5 rad/s on the first axis, 3.0 and 0.1 N m, for a moment of 40 kg m2.
    assert wider - narrow >= wide * seconds * Fraction(3) / 40
    assert kept >= wide
    # A residual of the waves has the same effect as an error at the begin of the step.
    series, residuals, own = expansion
    assert system.radii(3, 0, (series, residuals, own + wide), tube, h) == (wider, kept)


def test_bounds_of_a_step_are_upper_bounds() -> None:
    """The residual, at many points of a step, is at most its bound; so is an omitted term."""
    for name in ("waves", "before", "coefficients"):
        record = genuine(name)
        system, start, waves = begun(record)
        unit, h = 1 << record["bits"], record["steps"][0][0]
        series, residuals, wave_residual = system.expand([*start, *waves], 0, h, 6)
        length = Fraction(h, 1 << record["clock"])
        for s in (Fraction(n, 7) for n in range(8)):
            values = [sum(x * s**k for k, x in enumerate(each)) / unit for each in series]
            omega = values[:3]
            slopes = [sum(k * x * s ** (k - 1) for k, x in enumerate(each) if k) for each in series]
            for i, (common, (product, constant, rate, *amplitudes)) in enumerate(system.rows):
                push = constant + rate * length * s
                push += sum(a * x for a, x in zip(amplitudes, values[3:], strict=True))
                exact = (product * omega[i - 2] * omega[i - 1] + push) / common
                assert abs(slopes[i] - length * exact * unit) <= residuals[i]
            wrong = Fraction(0)
            for n, frequency in enumerate(system.frequencies):
                sine, cosine = values[3 + 2 * n : 5 + 2 * n]
                wrong += abs(slopes[3 + 2 * n] - length * frequency * cosine * unit)
                wrong += abs(slopes[4 + 2 * n] + length * frequency * sine * unit)
            assert wrong <= wave_residual


def test_logarithmic_norm_is_an_upper_bound() -> None:
    """The growth of a step is at least that of the symmetric part of the Jacobian, with its tube.

    A vector x gives a lower bound x A x of the largest eigenvalue of a symmetric matrix A.
    """
    for name in ("case 3", "case 5", "coefficients"):
        record = genuine(name)
        system, start, _ = begun(record)
        h = record["steps"][0][0]
        # A constant polynomial, whose mean absolute value is exact.
        growth = system.growth([[x] for x in start], (1 << record["bits"]) // 4, h)
        bound = Fraction(growth, certificate_checker.UNIT)
        scales = [x / 2**certificate_checker.SCALE_BITS for x in system.scales]
        a = [float(Fraction(terms[0], common)) for common, terms in system.rows]
        source = Random(name)
        for _ in range(200):
            x = [source.gauss(0.0, 1.0) for _ in range(3)]
            pairs = zip(record["scene"]["omega"], scales, strict=False)
            y = [w + source.uniform(-0.25, 0.25) * s for w, s in pairs]
            moved = [
                a[i] * (y[i - 2] * x[i - 1] * scales[i - 1] + y[i - 1] * x[i - 2] * scales[i - 2])
                for i in range(3)
            ]
            product = sum(u * v / s for u, v, s in zip(x, moved, scales, strict=False))
            lower = product / sum(u * u for u in x)
            assert lower * abs(h) / 2 ** record["clock"] <= float(bound) * (1 + 1e-9)


def test_exponential_and_mean_are_upper_bounds() -> None:
    unit = certificate_checker.UNIT
    exact = sum(Fraction(1, 2**k * factorial(k)) for k in range(40))
    assert exact * unit <= certificate_checker.exponential(unit // 2) <= exact * unit + 99
    whole = sum(Fraction(1, factorial(k)) for k in range(40))
    assert whole * unit <= certificate_checker.exponential(unit) <= whole * unit + 999
    # The root mean square of 6 - 12 s from 0 to 1 is the root of 12.
    assert 12 * 10**12 <= certificate_checker.mean([6 * 10**6, -12 * 10**6]) ** 2 < 12.001 * 10**12
    assert certificate_checker.over(-7, 2) == -3
    assert certificate_checker.over(7, 2) == 4


@pytest.mark.parametrize("x", [Fraction(12, 10**324), Fraction(1, 10**400), Fraction(1, 3), 0])
def test_radius_is_rounded_up(x: Fraction) -> None:
    """Near the least binary64 number, a factor of 1.01 changes nothing."""
    assert Fraction(rounded_up(Fraction(x))) >= x
    assert rounded_up(Fraction(x)) <= float(x) * 1.01 + 1e-323


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "[]", "1", "{}", "\u00e9", "[NaN]"])
def test_text_that_is_no_certificate_is_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "text.json"
    file.write_text(text, encoding="utf-8")
    steps, why = check_file(str(file))
    assert steps is None
    assert why


NUMBERS = (
    "NaN", "Infinity", "-1", "0", '"x"', "null", "true", "[30.0]", "1e20000000", '"1e20000000"',
    '"1e-20000000"', '"30.0 "', '"+30"', '"1_0"', '"\\u0663"', '"1/0"', "9" * 5000,
    f'"{"9" * 5000}"',
)  # fmt: skip
PLACES: tuple[tuple[Any, ...], ...] = (
    ("scene", "moments", 1), ("scene", "omega", 2), ("scene", "torque", "rate", 0), ("bits",),
    ("steps", 1, 2), ("rows", 0, "time"), ("rows", 1, "omega", 0), ("rows", 1, "radius"),
)  # fmt: skip


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_number_that_is_not_allowed_is_refused_at_once(
    place: tuple[Any, ...], tmp_path: Path
) -> None:
    record = copy.deepcopy(genuine("case 5"))
    holder: Any = record
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = "here"
    file = tmp_path / "number.json"
    begin = time.process_time()
    for number in NUMBERS:
        # The rate of the torque is 0 in this scene.
        if (place[-2:], number) == (("rate", 0), "0"):
            continue
        file.write_text(json.dumps(record).replace('"here"', number))
        found, why = check_file(str(file))
        assert found is None, number
        assert len(why) < 300
    assert time.process_time() - begin < 2.0


def test_checker_uses_the_standard_library_only() -> None:
    path = Path(certificate_checker.__file__)
    imported: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            imported |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.add(node.module or "")
    assert {each.partition(".")[0] for each in imported} <= set(sys.stdlib_module_names)
    assert "__import__" not in path.read_text()
    assert "import_module" not in path.read_text()
    assert len(path.read_text().splitlines()) <= 280


def test_checker_runs_as_a_script(tmp_path: Path) -> None:
    good, missing = tmp_path / "good.json", tmp_path / "missing.json"
    good.write_text(json.dumps(genuine("waves")))
    script = str(certificate_checker.__file__)
    for names, status in (([good], 0), ([good, missing], 1)):
        command = [sys.executable, "-I", script, *map(str, names)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (run.returncode, run.stderr) == (status, "")
        lines = run.stdout.splitlines()
        assert sum(line.startswith(f"{name}: ") for line in lines for name in names) == len(names)
        assert ("not proved" in run.stdout) == bool(status)
        proved = json.loads(good.read_text())
        found = [json.loads(line) for line in lines if line.startswith("  ")]
        assert found == [proved["scene"], *proved["rows"]]


def test_step_outside_its_limits_is_not_proved() -> None:
    record = genuine("case 3")
    system = System(record["scene"], record["bits"], record["clock"], record["scales"])
    series = [[1 << record["bits"] + 4]] * 3
    with pytest.raises(NotProvedError, match="grow too much"):
        system.radii(1, 0, (series, [0, 0, 0], 0), 10, 1 << record["clock"] + 2)
    with pytest.raises(NotProvedError, match="tube"):
        system.radii(10, 0, (series, [0, 0, 0], 0), 10, 1)

"""The compiled programs in the words of IEEE 754, and numbers that are passed as bytes."""

import math
import struct
import sys
from dataclasses import replace
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene, compare_programs, run_program
from pyharness.checks.compare.agreement import differences
from pyharness.model.extension import COMPLETE, REFUSED, extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import in_word
from pyharness.thesis.cells import all_listings
from pyharness.thesis.in_word import compiled_words, from_bytes, to_bytes
from pyharness.thesis.programs import BINARY64, COMPILED_WORDS, IMPLEMENTATIONS
from pyharness.thesis.word import WORDS, Number, Word

pytestmark = pytest.mark.bitwise
HERE = compiled_words()
WIDE = WORDS["binary128"]
needs_binary128 = pytest.mark.skipif("binary128" not in HERE, reason="no binary128 here")
EXTREMES = {
    "overflow": Scene("", (1.0, 1.0, 1.0), coefficients=(50.0, 60.0, 70.0), steps=60),
    "subnormal": Scene("", (1e-21, -2e-21, 1e-20), coefficients=(1e-3, 1e-2, 7.0), steps=4),
    "nothing": Scene("", (0.0, -0.0, 0.0), moments=(1.0, 2.0, 3.0), steps=3),
    "singular matrix": Scene("", (0.0, 1.0, 10.0), (40.0, 30.0, 20.0), step_size=1e-8, steps=5),
    "quarters": Scene(
        "", (1.0, 2.0, 3.0), moments=(3.0, 4.0, 5.0), steps=3,
        torque=TorqueLaw(
            (0.1, 0.0, -0.2), (0.5, 0.0, 0.0),
            sines=(((1.0, 2.0, 3.0), 1e9),), cosines=(((1.0, 0.3, 0.2), -7e5),),
        ),
    ),
}  # fmt: skip


def differing(scene: Scene, listing: Listing, word: str, *options: Any) -> list[str]:
    twin = in_word.run(scene, listing, WORDS[word], *options)
    return differences(twin, in_word.run_compiled(scene, listing, WORDS[word], *options))


@pytest.mark.parametrize("word", HERE)
@pytest.mark.parametrize("program", PROGRAMS)
def test_fortran_and_twin_agree_in_every_word(program: str, word: str) -> None:
    """Test some steps of a few cells; `verify --only words` tests every cell over all steps."""
    for case in (3, 6, 7):
        for listing in (Listing.original(program), Listing.corrected(program)):
            assert differing(replace(case_scene(case), steps=12), listing, word) == []
    # Case 2 has its own torque in the first step, and ends by the stop test.
    for index, listing in enumerate(all_listings(program)):
        if index % 7 == 0:
            listing = replace(listing, conjectures=listing.conjectures | {"initial-torque"})
            assert differing(replace(case_scene(2), steps=2), listing, word) == []


@pytest.mark.parametrize("word", HERE)
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_agree(name: str, word: str) -> None:
    for program in PROGRAMS:
        for listing in (Listing.original(program), Listing.corrected(program)):
            for options in ((500.0, True), (0.0, True), (math.inf, False)):
                assert differing(EXTREMES[name], listing, word, *options) == []


def test_runs_end_as_their_word_has_it() -> None:
    """The wider the range, the later a run overflows; a stop's quotient is returned as a float."""
    assert {"binary32", "binary64"} <= set(HERE) <= set(COMPILED_WORDS)
    scene, listing = EXTREMES["overflow"], Listing.original("two-term")
    names = sorted(HERE, key=lambda name: WORDS[name].p)
    runs = [in_word.run_compiled(scene, listing, WORDS[name]) for name in names]
    assert {run.ended for run in runs} == {"overflow"}
    assert sorted({run.steps for run in runs}) == [run.steps for run in runs]
    for name in HERE:
        run = in_word.run_compiled(case_scene(2), Listing.original("runge-kutta"), WORDS[name])
        assert run.stop is not None
        assert (run.stop.step, run.stop.variable) == (25, "V2")
        assert isinstance(run.stop.quotient, float)


def test_binary64_by_bytes_is_the_run_in_floats() -> None:
    for program in PROGRAMS:
        scene, listing = case_scene(7), Listing.original(program)
        by_bytes = in_word.run_compiled(scene, listing, WORDS["binary64"])
        assert differences(run_program(scene, listing), by_bytes) == []


@pytest.mark.campaign
def test_public_call_runs_both_languages() -> None:
    scene, listing = case_scene(5), Listing.corrected("four-term")
    for word in HERE:
        run, twin = (run_program(scene, listing, each, word=word) for each in IMPLEMENTATIONS)
        assert differences(run, twin) == []
        assert (run.exact is None) == (word == "binary64")


def test_word_that_the_compiler_lacks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, listing = case_scene(5), Listing.corrected("two-term")
    # Another build refuses words that its compiler lacks, as this build refuses words of 2 bytes.
    entry = extension().run_program_in_word

    def without(program: int, flags: int, by_moments: bool, *given: Any) -> Any:
        short = [each[:2] if isinstance(each, np.ndarray) else each for each in given]
        return entry(program, flags, by_moments, *short)

    monkeypatch.setattr(extension(), "run_program_in_word", without)
    with pytest.raises(InputError, match="--word binary128: "):
        run_program(scene, listing, word="binary128")
    _, status = extension().functions_of_word(np.zeros((2, 3), np.int8, order="F"))
    assert status == REFUSED


def functions(name: str, numbers: list[Number]) -> list[list[Number]]:
    word = WORDS[name]
    values, status = extension().functions_of_word(to_bytes(numbers, word, len(numbers)))
    assert status == COMPLETE
    found: list[list[Number]] = from_bytes(values, word).T.tolist()
    return found


def drawn(word: Word, random: Random, least: int, most: int) -> Number:
    bits = random.choice((1, 2, 20, word.p))
    m = random.getrandbits(bits) | 1 << bits - 1
    return word(Fraction(m) * Fraction(2) ** (random.randint(least, most) - bits))


@needs_binary128
def test_square_root_of_binary128_is_correctly_rounded() -> None:
    """Compare with the roots of integers: a root is never half way between two numbers."""
    random = Random("square roots")
    numbers = [drawn(WIDE, random, -16493, 16383) for _ in range(1200)]
    roots = [drawn(WIDE, random, -8000, 8000) for _ in range(400)]
    numbers += [each * each for each in roots]
    units = [WIDE(Fraction(1, 2**112)), WIDE(Fraction(-1, 2**113))]
    numbers += [WIDE(float(4**k)) * (WIDE(1.0) + unit) for k in range(3) for unit in units]
    numbers += [WIDE(Fraction(1, 2**16494)), WIDE(Fraction(2**113 - 1) * 2**16271)]
    for x, (root, _, _) in zip(numbers, functions("binary128", numbers), strict=True):
        # x = m 4**half, and the root of m is computed to 128 binary places.
        m, half = (x.m, x.e // 2) if x.e % 2 == 0 else (2 * x.m, x.e // 2)
        due = WIDE(Fraction(2 * math.isqrt(m << 256) + 1) * Fraction(2) ** (half - 129))
        assert (root.m, root.e) == (due.m, due.e), x
    plain = [WIDE(x) for x in (0.0, -0.0, math.inf, -1.0, -math.inf, math.nan)]
    told = [str(root.e) for root, _, _ in functions("binary128", plain)]
    assert told == ["0.0", "-0.0", "inf", "nan", "nan", "nan"]


@needs_binary128
def test_sine_and_cosine_of_binary128_are_the_nearest() -> None:
    """Compare with mpmath at 600 bits, above all for angles near right angles."""
    import mpmath

    random = Random("waves")
    numbers = [drawn(WIDE, random, least, 59) for least in (-200, -3, 40) for _ in range(150)]
    numbers = [each if random.random() < 0.5 else -each for each in numbers]
    with mpmath.workprec(600):
        right_angles = [mpmath.pi / 2 * random.getrandbits(bits) for bits in range(1, 60)]
        numbers += [_nearest(each) for each in right_angles]
        for x, (_, sine, cosine) in zip(numbers, functions("binary128", numbers), strict=True):
            angle = mpmath.mpf(x.fraction().numerator) / x.fraction().denominator
            for found, due in ((sine, mpmath.sin(angle)), (cosine, mpmath.cos(angle))):
                assert (found.m, found.e) == (_nearest(due).m, _nearest(due).e), x
    plain = [WIDE(x) for x in (0.0, -0.0, 1e-300, math.inf, math.nan)]
    rows = functions("binary128", plain)
    sines = [(sine.m, str(sine.e)) for _, sine, _ in rows[:3]]
    assert sines == [(each.m, str(each.e)) for each in plain[:3]]
    assert [float(cosine) for _, _, cosine in rows[:3]] == [1.0, 1.0, 1.0]
    assert [str(each.e) for row in rows[3:] for each in row[1:]] == ["nan"] * 4


def _nearest(value: Any) -> Number:
    sign, m, e, _ = value._mpf_
    return WIDE((-1 if sign else 1) * Fraction(int(m)) * Fraction(2) ** e)


def test_functions_of_binary32_are_the_nearest() -> None:
    word, random = WORDS["binary32"], Random("single")
    numbers = [drawn(word, random, least, 30) for least in (-149, -3) for _ in range(2000)]
    for x, row in zip(numbers, functions("binary32", numbers), strict=True):
        due = (x.sqrt(), x.sin(), x.cos())
        assert [(each.m, each.e) for each in row] == [(each.m, each.e) for each in due]
        assert float(row[0]) == float(np.sqrt(np.float32(float(x))))


@pytest.mark.parametrize(("name", "form"), [("binary32", "f"), ("binary64", "d")])
def test_bytes_are_those_of_the_processor(name: str, form: str) -> None:
    word, random = WORDS[name], Random("bytes")
    bits = 8 * struct.calcsize(form)
    patterns = [random.getrandbits(bits) for _ in range(2000)]
    patterns += [random.getrandbits(word.p - 1) | random.getrandbits(1) << bits - 1 for _ in "123"]
    values = [struct.unpack(form, each.to_bytes(bits // 8, "little"))[0] for each in patterns]
    values = [each for each in values if not math.isnan(each)] + [0.0, -0.0, math.inf, -math.inf]
    written = np.frombuffer(struct.pack(f"{len(values)}{form}", *values), np.int8)
    numbers = from_bytes(written.reshape((bits // 8, -1), order="F"), word)
    assert [*map(repr, map(float, numbers))] == [*map(repr, values)]
    assert to_bytes(numbers, word, len(values)).tobytes("F") == written.tobytes()


def test_bytes_of_binary128() -> None:
    """The format is a sign, 15 bits of exponent from -16383, and 112 bits of fraction."""
    patterns = {
        0x3FFF << 112: 1.0, 0xBFFF8 << 108: -1.5, 0x7FFF << 112: math.inf,
        1: Fraction(1, 2**16494), (1 << 112) - 1: Fraction(2**112 - 1, 2**16494),
        1 << 112: Fraction(1, 2**16382), (0x7FFF << 112) - 1: Fraction(2**113 - 1) * 2**16271,
    }  # fmt: skip
    numbers = [WIDE(each) for each in patterns.values()]
    written = to_bytes(numbers, WIDE, len(numbers))
    assert [int.from_bytes(each.tobytes(), sys.byteorder) for each in written.T] == list(patterns)
    back = from_bytes(written, WIDE)
    assert [(each.m, each.e) for each in back] == [(each.m, each.e) for each in numbers]
    (nan,) = from_bytes(to_bytes([WIDE(math.nan)], WIDE, 1), WIDE)
    assert (nan.m, str(nan.e)) == (0, "nan")


@pytest.mark.campaign
@pytest.mark.parametrize("word", HERE)
def test_compare_holds_fortran_against_the_twin(word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(case_scene(4), steps=20)
    listings = [Listing.original("two-term"), Listing.corrected("runge-kutta")]
    found = compare_programs(scene, listings, word=word)
    assert [each.ulps for each in found.programs] == [0.0, 0.0]
    assert not found.unexpected
    honest = in_word.run_compiled

    def wrong(*given: Any) -> Any:
        run: Any = honest(*given)
        numbers = run.exact.copy()
        numbers[7, 3] = numbers[7, 3] + numbers[7, 3]
        return replace(run, exact=numbers)

    if word != BINARY64:
        monkeypatch.setattr(in_word, "run_compiled", wrong)
        found = compare_programs(scene, listings, word=word)
        assert [each.differences for each in found.programs] == [("numbers of the word",)] * 2
        assert len(found.unexpected) == 2

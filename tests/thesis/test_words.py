"""Words: the bits of the processor, of exact rationals and of CDC's vectors; the twins in words."""

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np
import pytest

from pyharness import case_scene, run_program
from pyharness.checks.compare.agreement import differences
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import in_word
from pyharness.thesis.printer import page
from pyharness.thesis.programs import WORD_NAMES
from pyharness.thesis.vectors import answers, from_octal, to_octal
from pyharness.thesis.word import RULES, WORDS, Word
from tests.campaigns.words_campaign import FLOATS, differing
from tests.refused import refused
from tests.thesis.exact_words import disagreements
from tests.thesis.test_programs import NASTY

CDC, ROUNDED = WORDS["cdc48"], WORDS["cdc48-rounded"]


@pytest.mark.campaign
@pytest.mark.bitwise
@pytest.mark.parametrize("name", FLOATS)
def test_bits_are_those_of_numpy(name: str) -> None:
    """Test 8000 operations; `python -m tests.campaigns.words_campaign` draws a million."""
    assert differing(name, 8_000, "test") == []


@pytest.mark.sampled
@pytest.mark.bitwise
@pytest.mark.parametrize("p", [11, 24, 48])
@pytest.mark.parametrize("rule", RULES)
def test_every_rule_agrees_with_exact_rationals(rule: str, p: int) -> None:
    assert disagreements(p, rule, 1000, "test") == []


def test_vectors_agree(tmp_path: Path) -> None:
    found = answers()
    assert len(found) == 24
    assert [each.vector.name for each in found if not each.agrees] == []
    assert tuple(WORDS) == WORD_NAMES
    with pytest.raises(TypeError):  # words of two kinds have no sum
        CDC(1.0) + Word(48, "RX")(1.0)
    path = tmp_path / "vectors.json"
    for content in ("[3]", "3"):
        path.write_text(content)
        refused("vectors", answers, path)
    path.write_text('{"schema": 1, "vectors": []}')
    refused("vectors is empty; allowed: ", answers, path)


def test_octal_words_are_numbers_and_back() -> None:
    words = [
        "1720 4000 0000 0000 0000", "6060 3146 3146 3146 3145", "0000 0000 0000 0000 0000",
        "3777 0000 0000 0000 0000", "4000 7777 7777 7777 7777", "1777 0000 0000 0000 0000",
        "0000 4000 0000 0000 0000", "1776 4000 0000 0000 0000", "2000 4000 0000 0000 0000",
        "3776 7777 7777 7777 7777",
    ]  # fmt: skip
    for each in words:
        assert to_octal(from_octal(each)) == each
    assert from_octal(words[0]) == (2**47, -47)
    assert from_octal(words[3]) == (0, math.inf)
    assert [from_octal(each)[1] for each in words[7:9]] == [-1, 0]
    # Literals of the decks are the words of the vectors.
    for text, word in ((0.01, "1711 5075 3412 1727 0244"), (0.2, "1715 6314 6314 6314 6315")):
        assert to_octal((CDC(text).m, CDC(text).e)) == word


@pytest.mark.campaign
def test_pages_do_not_hang_on_how_literals_are_rounded() -> None:
    """FTN's conversion of literals is not known; truncated or rounded, they print the same page."""
    cut = Word(48, "FX", cut_literals=True)
    assert cut(0.2).fraction() < Fraction(1, 5) < CDC(0.2).fraction()
    assert cut(0.25).fraction() == Fraction(1, 4)
    for program in PROGRAMS:
        for case in (2, 4, 7):
            scene = case_scene(case)
            for listing in (Listing.original(program), Listing.corrected(program)):
                nearest, other = (in_word.run(scene, listing, each) for each in (CDC, cut))
                assert page(scene, program, nearest) == page(scene, program, other)


def test_no_guard_bit_survives() -> None:
    for word, due in ((CDC, 1 - Fraction(2) ** -47), (ROUNDED, Fraction(1))):
        assert (word(1.0) - word(2.0**-48)).fraction() == due
    below = CDC(1 - Fraction(2) ** -48)
    assert (CDC(1.0) - below).fraction() == 0
    # They are one unit apart, and equal by the zero of their difference, but not by its sign.
    assert below == CDC(1.0)
    assert below < CDC(1.0)
    assert not below > CDC(1.0)
    plain = Word(48)
    assert plain(1 - Fraction(2) ** -48) != plain(1.0)
    # Literals beside a tie go to their own side.
    tie, little = Fraction(17, 16), Fraction(1, 10**9)
    sides = {-little: Fraction(1), Fraction(0): Fraction(1), little: Fraction(9, 8)}
    assert {each: Word(4)(tie + each).fraction() for each in sides} == sides


def test_infinite_indefinite_and_underflow() -> None:
    largest = CDC.number((1 << 48) - 1, 1022)
    infinite = largest + largest
    assert (largest * largest).e == infinite.e == math.inf
    assert not infinite.is_finite
    assert math.isnan((infinite - infinite).e)
    assert math.isnan((CDC(0.0) / CDC(0.0)).e)
    assert (CDC(-1.0) / CDC(0.0)).e == -math.inf
    least = CDC.number(1 << 47, -1023)
    assert not least * CDC(0.5)
    assert CDC.number(1 << 47, -1022) * 0.5 == least
    # IEEE 754 has numbers below its least normal one, and a minus zero.
    assert (WORDS["binary32"](2.0**-149) * 1.0).fraction() == Fraction(2) ** -149
    assert math.copysign(1.0, float(-WORDS["binary32"](0.0))) == -1.0
    assert math.copysign(1.0, float(-CDC(0.0))) == 1.0
    wide = Word(113)(2.0**1000) * 2.0**1000
    assert wide.is_finite
    assert float(wide) == math.inf


def test_unordered_compares_with_nothing() -> None:
    for word in WORDS.values():
        nan, one = word(math.nan), word(1.0)
        for x, y in ((nan, one), (one, nan), (nan, nan)):
            assert not any([x < y, x > y, x == y, x <= y, x >= y])
        assert word(math.inf) > one >= one > word(-math.inf)
        assert word(0.0) == -word(0.0)
        assert one <= 1 < word(2) < 3.5
        assert bool(nan)
        assert not word(0)


def test_roots_and_waves_are_rounded_to_nearest() -> None:
    for word in (*WORDS.values(), Word(20, "chop")):
        for x in (2.0, 3.0, 1e-3, 0.25, 7e10):
            value, root = word(x).fraction(), word(x).sqrt()
            half = Fraction(2) ** root.e / 2
            assert (root.fraction() - half) ** 2 <= value <= (root.fraction() + half) ** 2
    random, single = Random("waves"), WORDS["binary32"]
    for _ in range(300):
        x = float(np.float32(random.uniform(-1e3, 1e3)))
        assert float(WORDS["binary64"](abs(x)).sqrt()) == math.sqrt(abs(x))
        assert float(single(Fraction(x)).sin()) == np.float32(math.sin(x))
        assert float(single(Fraction(x)).cos()) == np.float32(math.cos(x))
        assert float(Word(113)(Fraction(x)).sin()) == pytest.approx(math.sin(x), rel=1e-15, abs=0.0)
    assert Word(53)(-0.0).sin().e == 0.0
    assert Word(53)(0.0).cos() == 1
    assert math.isnan(Word(53)(math.inf).cos().e)
    assert math.isnan(Word(53)(-1.0).sqrt().e)
    assert Word(53)(math.inf).sqrt().e == math.inf
    # Just above the middle between two subnormal floats, a number is not rounded twice.
    for bits in range(1, 52):
        m, e = 2**112 + 2 ** (112 - bits) + 1, bits - 1187
        for number in (Word(113)(Fraction(sign * m) * Fraction(2) ** e) for sign in (1, -1)):
            assert float(number) == float(number.fraction()) != 0.0


SCENES = {
    "case 7": case_scene(7),
    "at rest": replace(NASTY["at rest"], omega=(0.0, -0.0, 0.0)),
    "singular matrix": replace(NASTY["singular matrix"], steps=5),
    **{name: NASTY[name] for name in ("huge", "tiny", "explodes")},
}


@pytest.mark.campaign
@pytest.mark.bitwise
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("program", PROGRAMS)
def test_binary64_has_the_bits_and_the_page_of_floats(program: str, name: str) -> None:
    """Test a few scenes; `verify --only words` tests every cell."""
    scene = SCENES[name]
    for listing in (Listing.original(program), Listing.corrected(program)):
        floats = run_program(scene, listing, "python")
        ours = in_word.run(scene, listing, WORDS["binary64"])
        assert differences(floats, ours) == []
        assert floats.exact is None
        assert (ours.exact is None) == (ours.steps == 0)
        if scene.moments is not None:
            assert page(scene, program, ours) == page(scene, program, floats)


def test_page_is_printed_from_the_exact_value() -> None:
    """A number nearer to a tie than any float is rounded to its own side of the tie."""
    scene, listing = case_scene(1), Listing.corrected("runge-kutta")
    run = run_program(scene, listing, "python")
    for offset, due in ((Fraction(1, 10**30), "0.0001"), (-Fraction(1, 10**30), "0.0000")):
        number = Word(113)(Fraction(5, 100_000) + offset)
        assert float(number) == 5e-5
        rows = np.array([[number] * 8], dtype=object)
        line = page(scene, "runge-kutta", replace(run, exact=rows)).splitlines()[-1]
        assert line.split().count(due) == 6
    # The trajectory has the numbers themselves.
    run = run_program(case_scene(5), Listing.corrected("two-term"), "python", word="binary128")
    assert run.exact is not None
    assert run.exact.shape == (100, 8)
    np.testing.assert_array_equal(run.exact[:, 2:5].astype(float), run.omega)
    step = case_scene(5).step_size
    assert run.exact[0, 0].fraction() == WORDS["binary128"](step).fraction() != Fraction(step)
    assert run.exact[-1, 2].m.bit_length() == 113

"""Waves of one frequency: they are one wave, whose amplitude is rounded once."""

import math

import numpy as np
import pytest

from pyharness import TorqueLaw
from pyharness.model.waves import exact_law, is_mergeable, merged, with_merged_rows

ONE = (1.0, 2.0, -3.0)


def test_a_law_of_different_frequencies_is_not_touched() -> None:
    law = TorqueLaw(ONE, ONE, [(ONE, 2.0), (ONE, 3.0)], [(ONE, 2.0), ((0.0, 0.0, 0.0), 2.0)])
    assert not is_mergeable(law)
    assert merged(law) is law
    assert merged(TorqueLaw()) == TorqueLaw()


def test_sines_are_odd_and_cosines_even() -> None:
    other = (0.25, -2.0, 1.0)
    law = TorqueLaw(sines=[(ONE, -2.0), (other, 2.0)], cosines=[(ONE, -2.0), (other, 2.0)])
    found = merged(law)
    assert found.sines == (((0.75, 4.0, -4.0), -2.0),)
    assert found.cosines == (((1.25, 0.0, -2.0), -2.0),)
    for time in (0.3, -1.7):
        assert found.at(time) == pytest.approx(law.at(time), abs=1e-14)


def test_a_wave_of_no_frequency_is_a_constant_or_nothing() -> None:
    law = TorqueLaw(ONE, sines=[(ONE, 0.0)], cosines=[(ONE, -0.0), (ONE, 1.0)])
    assert merged(law) == TorqueLaw((2.0, 4.0, -6.0), cosines=[(ONE, 1.0)])


def test_the_sum_is_rounded_once_and_an_exact_zero_is_no_wave() -> None:
    amplitudes = [(1e16, 1.0, 0.1), (1.0, -1.0, 0.2), (-1e16, 0.0, 0.3)]
    law = TorqueLaw(sines=[(each, 2.0) for each in amplitudes])
    assert merged(law).sines == (((1.0, 0.0, math.fsum([0.1, 0.2, 0.3])), 2.0),)
    nothing = TorqueLaw(sines=[(ONE, 2.0), (ONE, -2.0)], frame="space")
    assert merged(nothing) == TorqueLaw(frame="space")
    assert exact_law(nothing).sines == ()


def test_rows_become_what_each_law_becomes_alone() -> None:
    source = np.random.default_rng(25)
    n, k = 300, 4
    constant = source.normal(size=(n, 3))
    sines, cosines = source.normal(size=(2, n, k, 4))
    for waves in (sines, cosines):
        waves[..., 3] = source.choice([0.0, -0.0, 1.0, -1.0, 2.5, -2.5, 4.0], size=(n, k))
        waves[source.random((n, k)) < 0.2, :3] = 0.0
        waves[:, 1, :3] = np.where(source.random((n, 1)) < 0.3, -waves[:, 0, :3], waves[:, 1, :3])
    found = with_merged_rows(constant, sines, cosines)
    for row in range(n):
        law = merged(
            TorqueLaw(
                constant[row],
                sines=[(wave[:3], wave[3]) for wave in sines[row]],
                cosines=[(wave[:3], wave[3]) for wave in cosines[row]],
            )
        )
        assert found[0][row].tolist() == list(law.constant)
        for rows, waves in ((found[1][row], law.sines), (found[2][row], law.cosines)):
            acting = [wave for wave in rows.tolist() if any(wave[:3])]
            assert acting == [[*a, f] for a, f in waves if any(a)]


def test_rows_without_a_common_frequency_are_handed_back() -> None:
    constant, cosines = np.zeros((5, 3)), np.empty((1, 0, 4))
    sines = np.ones((1, 2, 4))
    sines[0, 1, 3] = 2.0
    found = with_merged_rows(constant, sines, cosines)
    assert found[0] is constant
    assert found[1] is sines
    assert found[2] is cosines
    # Zero rows that fill up shorter laws are no waves.
    padded = np.concatenate([sines, np.zeros((1, 3, 4))], axis=1)
    assert with_merged_rows(constant, padded, cosines)[1] is padded


def test_rows_that_are_no_numbers_spoil_no_other() -> None:
    sines = np.ones((3, 2, 4))
    sines[1, 0, 0] = np.nan
    sines[2, :, 0] = 1.7e308
    constant, found, _ = with_merged_rows(np.zeros((3, 3)), sines, np.empty((1, 0, 4)))
    assert found[0].tolist() == [[2.0, 2.0, 2.0, 1.0], [0.0, 0.0, 0.0, 0.0]]
    assert np.isnan(found[1, 0, 0])
    assert np.isinf(constant[2]).all()

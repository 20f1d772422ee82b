"""The second reading of a sample, and the estimate of the misreadings that remain."""

import csv
import json
import random
from itertools import product

import numpy as np
import pytest

from pyharness.history import second_reading
from pyharness.history.second_reading import chapman, misread_places, read_cards, recaptures
from pyharness.model.facts import facts
from pyharness.thesis.cards import tight
from pyharness.thesis.collation import witness_lines
from tests.conftest import Printed


def test_sample_is_the_one_that_the_seed_draws() -> None:
    read = {each.card.name for each in read_cards()}
    seed = facts("cards/second-reading")["seed"]
    assert read == set(random.Random(seed).sample([*witness_lines()], 120))
    assert len(read) == 120
    # Few misreadings remain if the readings are independent.
    found = second_reading.second_reading_report().record()["recaptures"]
    places, cards = found
    assert (places["unit"], cards["unit"]) == ("places", "cards")
    assert cards["both"] == cards["second"]
    for each in found:
        assert each["first"] <= each["lower"] <= each["upper"]
        assert each["uncorrected"] == each["upper"] - each["first"] <= 2


@pytest.mark.campaign
def test_interval_contains_the_size_as_often_as_promised() -> None:
    """All samples of a small population: the interval has the size in 95 % or more of them."""
    size, first = 12, 7
    samples = [(sum(each[:first]), sum(each)) for each in product((0, 1), repeat=size)]
    intervals = [
        second_reading.recapture_interval(first, second, both) for both, second in samples if both
    ]
    assert np.mean([lower <= size <= upper for lower, upper in intervals]) >= 0.95


def test_interval_contains_the_estimate() -> None:
    for first, second, both in ((43, 42, 42), (20, 10, 5), (9, 9, 9), (30, 30, 20)):
        lower, upper = second_reading.recapture_interval(first, second, both)
        assert first + second - both <= lower <= chapman(first, second, both) <= upper
    with pytest.raises(ValueError, match="both must be positive"):
        second_reading.recapture_interval(3, 3, 0)
    assert chapman(10, 8, 8) == 10
    assert chapman(20, 10, 5) == pytest.approx(21 * 11 / 6 - 1)
    assert chapman(2000, 1000, 500) == pytest.approx(4000, rel=2e-3)


def test_places_are_those_of_the_scan() -> None:
    assert misread_places("A1XU2", "A1*U2") == {2: "*"}
    assert misread_places("AB", "AB") == {}
    assert misread_places("AXB", "AB") == {1: ""}
    assert misread_places("AB", "A*B") == {0: "*"}
    assert misread_places("B", "AB") == {-1: "A"}


def test_the_readings_differ_in_a_name_alone() -> None:
    differing = second_reading.disagreeing()
    assert [each.card.name for each in differing] == ["two-term:110", "four-term:2010"]
    for each in differing:
        assert each.first.replace("WKA", "USA") == each.second
    # Names that we make uniform are no misreadings.
    (found,) = (each for each in read_cards() if each.card.name == "four-term:480")
    assert tight(found.card.text) == "M3=N3/I3"
    assert found.scan == found.first == found.second == "M3=M3/I3"


def test_the_verb_shows_it_in_every_form(printed: Printed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    text = printed("cards --second-reading")
    assert max(map(len, text.splitlines())) <= 100
    assert "at most" not in text  # the two readings are not independent: nothing is bounded
    record = json.loads(printed("cards --second-reading --format json"))
    assert record["sample"] == {"seed": 1982, "size": 120, "cards": 521}
    assert [each["first"] for each in record["recaptures"]] == [row[1] for row in recaptures().rows]
    table = list(csv.DictReader(printed("cards --second-reading --format csv").splitlines()))
    assert [each["unit"] for each in table] == ["places", "cards"]

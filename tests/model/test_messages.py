"""The catalogue of error messages is complete, and messages use the same words."""

import re

from tests.messages import CATALOGUE, catalogue
from tests.style import PATTERNS

MESSAGES = [line.partition(": ")[2] for line in CATALOGUE.read_text().splitlines()]


def test_catalogue_is_up_to_date() -> None:
    assert CATALOGUE.read_text() == catalogue(), "python -m tests.messages"
    assert len(MESSAGES) > 300


def test_messages_have_no_expression_that_our_prose_avoids() -> None:
    assert [each for each in MESSAGES if each.endswith(".")] == []
    assert [each for each in MESSAGES for pattern, _ in PATTERNS if pattern.search(each)] == []
    assert [each for each in MESSAGES if re.search(r"\ballowed \{", each)] == []

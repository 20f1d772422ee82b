"""Fixtures of more than one file."""

from collections.abc import Iterator

import pytest

from pyharness.kernels import extension
from tests.instruction_sets import BEST, LEVELS, level_here


@pytest.fixture(params=range(len(LEVELS)), ids=LEVELS)
def level(request: pytest.FixtureRequest) -> Iterator[int]:
    """Run the kernels of one instruction set, where this machine has it."""
    wanted: int = request.param
    if wanted > level_here():
        pytest.skip(f"this processor has no {LEVELS[wanted]}")
    assert extension().choose_instructions(wanted) == wanted
    yield wanted
    extension().choose_instructions(BEST)

"""Fixtures of more than one file."""

import os
from collections.abc import Iterator

import pytest

from pyharness.model.extension import extension
from tests.instruction_sets import BEST, LEVELS, level_here
from tests.traps import guard

# `make cross-check` asks for this; each call of a kernel takes some microseconds longer.
if os.environ.get("PYHARNESS_TRAPS"):
    assert guard(extension()) > 0


@pytest.fixture(params=range(len(LEVELS)), ids=LEVELS)
def level(request: pytest.FixtureRequest) -> Iterator[int]:
    """Run the kernels of one instruction set, where this machine has it."""
    wanted: int = request.param
    if wanted > level_here():
        pytest.skip(f"no {LEVELS[wanted]} in this build, or in this processor")
    assert extension().choose_instructions(wanted) == wanted
    yield wanted
    extension().choose_instructions(BEST)

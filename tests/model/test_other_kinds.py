"""Values of another kind or number: refused with messages that the catalogue has in parts only."""

import tomllib
from pathlib import Path

import pytest

from pyharness import InputError
from tests.refusals import names

CALLS: dict[str, str] = tomllib.loads(Path(__file__).with_name("other_kinds.toml").read_text())


@pytest.mark.parametrize("call", CALLS, ids=range(len(CALLS)))
def test_value_of_another_kind_is_refused_in_a_line(call: str) -> None:
    with pytest.raises(InputError) as caught:
        exec(call, vars(names).copy())
    assert CALLS[call] in str(caught.value)
    assert str(caught.value).isprintable()

"""Whether a call is refused as a user's mistake: by an InputError, which is one line by itself."""

from collections.abc import Callable
from typing import Any

import pytest

from pyharness import InputError


def refused(words: str, call: Callable[..., object], *given: Any, **named: Any) -> str:
    """Call a function that must refuse its arguments in such words, and return its message."""
    with pytest.raises(InputError, match=words or None) as caught:
        call(*given, **named)
    return str(caught.value)

"""A torque function may store values on which its result does not depend."""

from typing import Any

from pyharness import Scene


def test_function_that_counts_its_calls_is_taken() -> None:
    calls = []

    def damping(t: Any, w: Any) -> Any:
        calls.append(t)
        return -0.1 * w

    Scene("", (0.1, 0.2, 0.3), moments=(1.0, 2.0, 3.0), torque=damping)
    assert len(calls) == 2

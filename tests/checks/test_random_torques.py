"""The checks of `verify` under random torques that depend on omega or attitude."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from pyharness.checks import judge
from pyharness.checks import random_methods as room
from pyharness.checks.check import Check, Selection, make_checks
from pyharness.checks.compare import candidates
from pyharness.checks.random_methods import random_torques
from pyharness.engine import solve
from pyharness.engine.many import many_recorded
from pyharness.engine.methods import taylor
from pyharness.engine.system import recorded
from pyharness.model import arrays
from pyharness.model.tape import Linear, Tape
from pyharness.model.trajectory import Trajectory

TRUTH = cache(judge.reference_truth)


def checks(only: str, draws: int = 100) -> list[Check]:
    """Return the checks in the random scenes of a seed whose ids begin with `only`."""
    chosen = Selection(only=[only] if only else [], seed="fixed", draws=draws, thin=True)
    with patch.object(room, "reference_truth", TRUTH):
        return list(make_checks(random_torques(chosen), chosen.only))


@pytest.mark.campaign
def test_all_pass_and_have_names_of_their_own() -> None:
    found = checks("")
    assert [check.id for check in found if not check.passed] == []
    assert len({check.id for check in found}) == len(found) > 30
    assert all(check.value is not None for check in found)
    names = {check.id.split("/", 2)[2] for check in found}
    assert {"torque-solve-many/omega", "torque-prepare-auto/angle"} <= names


def test_only_requested_checks_are_made() -> None:
    found = checks("random/20/torque-solve-taylor")
    assert found
    assert {check.name.subject for check in found} == {"torque-solve-taylor"}
    again = found[0].replay.partition("--only ")[2].split()[0]
    (same,) = [check for check in checks(again) if check.id == again]
    assert same.value == found[0].value


def _off(scene: Any, real: Callable[..., Tape] = recorded.system_of) -> Tape:
    return _with_fault(real(scene))


def _packed_off(tape: Tape, *more: Any, real: Callable[..., Any] = recorded.packed_tape) -> Any:
    return real(_with_fault(tape), *more)


def _with_fault(tape: Tape) -> Tape:
    first, *rest = tape.outputs
    terms = tuple((slot, x * (1.0 + 1e-6)) for slot, x in first.terms)
    return replace(tape, outputs=(Linear(first.constant, terms), *rest))


def _moved(real: Callable[..., Trajectory], *given: Any, **more: Any) -> Trajectory:
    found = real(*given, **more)
    return replace(found, omega=found.omega * (1.0 + 1e-3))


def _turned(name: str, rows: Any, *shape: int, real: Callable[..., Any] = arrays.rows_of) -> Any:
    found = real(name, rows, *shape)
    return found + 1e-3 * np.eye(4)[0] if name == "attitude" else found


FAULTS: dict[str, tuple[Any, str, Any, str]] = {
    "equations of motion": (taylor, "system_of", _off, "torque-solve-taylor"),
    "prepared": (recorded, "system_of", _off, "torque-prepare-taylor"),
    "many": (many_recorded, "packed_tape", _packed_off, "torque-solve-many"),
    "solve": (candidates, "solve", partial(_moved, solve.solve), "torque-solve-auto"),
    "initial attitude": (many_recorded, "rows_of", _turned, "torque-solve-many"),
}


@pytest.mark.campaign
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_seen(fault: str) -> None:
    module, name, planted, subject = FAULTS[fault]
    with patch.object(module, name, planted):
        found = [check for check in checks("") if check.name.subject == subject]
    assert not all(check.passed for check in found)

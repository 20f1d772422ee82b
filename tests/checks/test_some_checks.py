"""A few checks of each kind of `verify` and each trial of `stress`, by their ids."""

import pytest

from pyharness.checks.check import Selection
from pyharness.checks.kinds import verify
from pyharness.checks.stress import stress

BESSEL = "external/bessel-j0/6.28318530717958647693"
VERIFIED = (
    ["orders/rk4/case-5", "orders/two-term/case-5", "orders/two-term/case-5/velocity"],
    [f"{BESSEL}/two-term", f"{BESSEL}/gauss-4", f"{BESSEL}/auto"],
    ["prepared/taylor/case-3/1/1.0e-03", "prepared/taylor/case-3/1/1.0e-12"],
    ["prepared/rk4/case-3/bits", "stops/case-3/corrected", "golden/two-term/case-1/original"],
    ["methods/gauss-4/case-2/1.0e-06", "attitudes/taylor/case-2/1.0e-09"],
)
STRESSED = [
    "attitude/taylor/back/random-7", "invariance/quick/split/random-7/1e-06",
    "invariance/taylor/cyclic/free/1e-15", "invariance/taylor/split/random-7/1e-06",
    "matrices/two-term/1e-10/condition", "near-symmetry/taylor/small-pair-1e-01/1e-15/error",
    "regions/two-term/original/polynomial", "scales/closed-form/1e-300/1e-14/error",
    "scales/taylor/1e-300/1e-15/error", "separatrix/taylor/early-1e-01/1e-06/error",
    "shapes/taylor/needle-123/1e-15/drift", "step-size/rk4/case-2/3e-01",
    "torque/taylor/resonant-off/1e-06",
]  # fmt: skip


@pytest.mark.parametrize("ids", VERIFIED)
def test_verified(ids: list[str]) -> None:
    checks = {check.id: check.passed for check in verify(Selection(only=ids))}
    assert checks == dict.fromkeys(ids, True)


def test_a_random_check_says_what_it_tried() -> None:
    (check,) = verify(Selection(only=["random/0/solve-taylor"], seed="fixed", draws=1))
    assert check.passed
    assert "tolerance" in (check.note or "")


@pytest.mark.parametrize("ids", [STRESSED[::3], STRESSED[1::3], STRESSED[2::3]])
def test_stressed(ids: list[str]) -> None:
    assert {check.id: check.passed for check in stress(ids)} == dict.fromkeys(ids, True)

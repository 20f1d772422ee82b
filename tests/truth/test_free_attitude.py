"""The truth of the attitude without torque, compared with independent series of 200 bits."""

import random
from decimal import Decimal, localcontext

import mpmath
import pytest

from pyharness import Scene
from pyharness.model.attitude import product
from pyharness.model.scene import Triple
from pyharness.truth.free_attitude import conjugate, free_attitude, is_steady, period_of
from tests.checks.scenes.free_motions import KINDS, draw
from tests.exact_attitude import DIGITS, exact


@pytest.mark.sampled
@pytest.mark.parametrize("kind", KINDS)
def test_attitude_agrees_however_far(kind: str) -> None:
    source = random.Random(f"truth {kind}")
    for longest in (1.0, 6.0):
        moments, omega, attitude, time = draw(source, kind, longest)
        start = attitude[0], attitude[1], attitude[2], attitude[3]
        scene = Scene("", tuple(omega), moments=tuple(moments), attitude=start)
        found = free_attitude(scene, time)
        assert scene.attitude is not None
        _, wanted = exact(moments, omega, scene.attitude, time)
        with mpmath.workdps(DIGITS):
            pairs = zip(found, wanted, strict=True)
            assert max(abs(mpmath.mpf(str(x)) - y) for x, y in pairs) < mpmath.mpf("1e-30")


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("omega", "steady", "endless"),
    [((0.0, 1.0, 0.0), True, False), ((0.0, 0.0, 0.0), True, True),
     ((1e-3, 1.0, 1e-3), False, True), ((1e-3, 1.0, -2e-3), False, False)],
)  # fmt: skip
def test_separatrix_and_rest_are_told(omega: Triple, steady: bool, endless: bool) -> None:
    scene = Scene("", omega, moments=(6.0, 5.0, 2.0), attitude=(1.0, 0.0, 0.0, 0.0))
    assert is_steady(scene) == steady
    assert (period_of(scene) is None) == (endless or steady)
    if steady:
        assert free_attitude(scene, 0.0) == [1, 0, 0, 0]
    elif not endless:
        # The sign is continuous beyond a period as within it.
        period = period_of(scene) or Decimal(0)
        near, far = (free_attitude(scene, float(period) * part) for part in (0.999999, 1.000001))
        assert sum(abs(x - y) for x, y in zip(near, far, strict=True)) < Decimal("1e-3")


@pytest.mark.campaign
@pytest.mark.parametrize("end", [-400.0, 1e6])
def test_a_settled_motion_on_the_separatrix_is_a_steady_rotation(end: float) -> None:
    """The limit of omega2 is above 0 before the flip, and below 0 after it."""
    scene = Scene("", (1e-3, 1.0, 1e-3), moments=(6.0, 5.0, 2.0), attitude=(0.5, -0.1, 0.7, 0.5))
    early, late = free_attitude(scene, end / 2), free_attitude(scene, end)
    with localcontext(prec=50):
        turn = product(conjugate(early), late)
    with mpmath.workdps(DIGITS):
        angle = -mpmath.sqrt(1 + 8 * mpmath.mpf(1e-3) ** 2 / 5) * abs(end) / 4
        pairs = zip(turn, [mpmath.cos(angle), 0, mpmath.sin(angle), 0], strict=True)
        assert max(abs(mpmath.mpf(str(x)) - y) for x, y in pairs) < mpmath.mpf("1e-30")

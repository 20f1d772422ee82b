"""The second reference, compared with exact solutions, the first reference, and at every scale."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene
from pyharness.engine.problem.rescaled import scaled
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import reference

BODY = (40.0, 30.0, 20.0)
REST = (0.0, 0.0, 0.0)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("case", "sign"), [*zip(range(1, 8), [1.0, -1.0] * 4, strict=False), (5, -1.0)]
)
def test_both_references_agree_to_the_last_bit_but_one(case: int, sign: float) -> None:
    """The references share no code, and differ in arithmetic, steps and treatment of waves."""
    scene, times = case_scene(case), [sign * t for t in (0.3, 1.0, 1.7)]
    first = reference(scene, times, precise=True)
    second = integer_series(scene, times)
    assert np.abs(first.omega - second.omega).max() <= np.spacing(np.abs(first.omega).max())


@pytest.mark.sampled
@pytest.mark.parametrize("frequency", [1e-300, 1e-30, 1e-8, 1.0, 700.0])
@pytest.mark.parametrize("is_sine", [True, False])
def test_wave_on_one_axis_is_its_integral(frequency: float, is_sine: bool) -> None:
    """From rest nothing else moves; for a slow sine the whole answer is one small number."""
    wave = (((0.0, 0.0, 20.0), frequency),)
    law = TorqueLaw(sines=wave) if is_sine else TorqueLaw(cosines=wave)
    path = integer_series(Scene("", REST, BODY, torque=law), [3.0])
    with mpmath.workdps(40):
        angle = mpmath.mpf(frequency) * 3
        half = mpmath.sin(angle / 2)
        exact = 2 * half * half / frequency if is_sine else mpmath.sin(angle) / frequency
        assert abs(path.omega[0, 2] - float(exact)) <= np.spacing(float(abs(exact)))
    assert not path.omega[0, :2].any()


@pytest.mark.parametrize("power", [-400, -40, 40, 400])
def test_units_change_no_digit(power: int) -> None:
    scene = replace(case_scene(5), torque=TorqueLaw(sines=(((3.0, -2.0, 5.0), 2.5),)))
    if abs(power) > 300:
        scene = replace(scene, torque=TorqueLaw())
    factor = 2.0**power
    here = integer_series(scene, [1.0]).omega
    there = integer_series(scaled(scene, factor), [1.0 / factor]).omega
    assert np.array_equal(here, there / factor)


def test_way_passes_through_the_largest_omega() -> None:
    """A spin about the middle axis flips: omega3 is large only at intermediate times."""
    scene = Scene("", (1e-3, 1.0, 0.0), (40.0, 30.0, 20.0))
    path = integer_series(scene, [40.0])
    finer = integer_series(scene, np.linspace(0.0, 40.0, 201)[1:].tolist())
    assert np.abs(path.way).max() == pytest.approx(np.abs(finer.omega).max(), rel=1e-3)
    assert (path.nodes[0], path.nodes[-1]) == (0.0, 40.0)
    assert (np.diff(path.nodes) > 0.0).all()


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("scene", "time", "steps"),
    [(Scene("", (1.0,) * 3, coefficients=(1.0,) * 3), 2.0, 300),
     (Scene("", (1.0, 2.0, 3.0), BODY), 1e5, 20)],
)  # fmt: skip
def test_what_has_no_truth_is_refused(
    scene: Scene, time: float, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pyharness.truth.integer_series._MOST_STEPS", steps)
    with pytest.raises(InputError, match="integer series"):
        integer_series(scene, [time])


def test_sine_of_a_negative_speed_is_that_of_the_other_sign() -> None:
    one, other = (
        integer_series(Scene("", (1.0, 2.0, -1.0), BODY, torque=TorqueLaw(sines=(wave,))), [1.5])
        for wave in (((1.0, -2.0, 3.0), -2.0), ((-1.0, 2.0, -3.0), 2.0))
    )
    assert one.omega.tolist() == other.omega.tolist()

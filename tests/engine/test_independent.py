"""Solutions against right-hand sides that are written a second time, in mpmath's arithmetic."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest
from mpmath import mp, mpf

from pyharness import Scene
from pyharness.torques import damping
from tests.engine.independent import compared, error_of, integrated, main
from tests.engine.independent_terms import Drawn, draw

# Scenes that take less than a second; together they have most kinds of torques and of bodies.
SCENES = (8, 15, 23, 45, 58, 89, 92, 124)


@pytest.mark.campaign
@pytest.mark.parametrize("number", SCENES)
def test_errors_are_within_their_limits(number: int) -> None:
    drawn = draw(Random(f"independent tests {number}"))
    result = compared(drawn)
    assert not result.note
    assert set(result.ratios) == {"taylor", "auto", "reference"}
    assert max(result.ratios.values()) <= 1.0
    # Where pyharness rounds no constant, the decimal reference agrees in all digits.
    assert (result.last_digits is not None) == drawn.is_exact
    assert result.last_digits is None or result.last_digits < 1e-20


def test_the_extrapolation_has_the_digits_of_a_known_solution() -> None:
    """A damped sphere turns about a fixed axis, by an angle that approaches a limit."""
    scene = Scene("sphere", (0.5, -0.25, 1.0), (2.0,) * 3, torque=damping(0.5),
                  attitude=(1, 0, 0, 0))  # fmt: skip
    drawn = Drawn(
        scene, [1.0, 3.0], 1e-9, [], lambda n, w: n / 2, [lambda t, w, q, _: -w / 2], False,
    )  # fmt: skip
    truth = integrated(drawn)
    assert truth is not None
    with mp.workdps(40):
        omega, turned = [], []
        for t in drawn.times:
            left = mp.exp(-mpf(t) / 4)
            omega.append([x * left for x in scene.omega])
            speed = mp.sqrt(sum(mpf(x) ** 2 for x in scene.omega))
            half = 2 * speed * (1 - left)
            axis = [x * mp.sin(half) / speed for x in scene.omega]
            turned.append([mp.cos(half), *axis])
        assert error_of(truth, np.array(omega), np.array(turned)) < 1e-23


def test_a_wrong_formula_is_found() -> None:
    drawn = draw(Random("independent tests 5"))
    drawn = replace(drawn, tolerance=1e-12)
    assert max(compared(drawn).ratios.values()) <= 1.0
    wrong = replace(
        drawn, formulas=[*drawn.formulas, lambda t, w, q, _: mpf("1e-9") * (w.sum() - w)]
    )
    assert min(compared(wrong).ratios.values()) > 10.0


def test_the_command_reports_its_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["2", "command", "--first", "1"]) == 0
    shown = capsys.readouterr().out
    assert "taylor: largest ratio of an error to its limit " in shown
    assert "2 scenes of seed command: 2 compared, 0 violations" in shown

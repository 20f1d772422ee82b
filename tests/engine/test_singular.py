"""Recorded torques that are not defined at some time: the ending, the reason, and the advice."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, Stepper, solve
from pyharness.cli.main import main
from pyharness.engine.system.singular import SingularError
from pyharness.model.scene_report import ending


def _scene(torque: Any) -> Scene:
    return Scene("", (0.1, 0.2, 0.3), moments=(1.0, 2.0, 3.0), torque=torque)


UNDEFINED = {
    "root of time": (lambda t, w: [np.sqrt(0.5 - t), 0.0, 0.0], "t = 0.5 s: the square root", 1),
    "root at the start": (lambda t, w: [np.sqrt(t), 0.0, 0.0], "t = 0 s: the square root", 0),
    "root of the past": (lambda t, w: [np.sqrt(-t), 0.0, 0.0], "t = 0 s: the square root", 0),
    "0/0": (lambda t, w: [0.1 * np.sin(t) / t, 0.0, 0.0], "t = 0 s: 0/0; write", 0),
    "arcsine": (lambda t, w: [np.arcsin(0.5 + t), 0.0, 0.0], "t = 0.5 s: the arcsine", 1),
    "arccosine": (lambda t, w: [0.1 * np.arccos(np.cos(t)), 0.0, 0.0], "t = 0 s: the arcsine", 0),
    "logarithm of a root": (
        lambda t, w: [np.log(np.sqrt(0.5 - t)), 0.0, 0.0],
        "t = 0.5 s: the square root",
        1,
    ),
    "sign": (lambda t, w: [-w[0] / np.sqrt(w[0] ** 2), 0.0, 0.0], "s: the square root", 0),
}


@pytest.mark.parametrize("method", ["auto", "dop853", "reference"])
@pytest.mark.parametrize("name", UNDEFINED)
def test_undefined_torque_ends_with_operation_time_and_advice(name: str, method: str) -> None:
    if name in ("root at the start", "arccosine"):
        # A step without a series passes them; the reference has none.
        found: Any = solve(_scene(UNDEFINED[name][0]), [0.25, 1.0], method, 1e-6)
        assert found.ended == "stalled" or method != "reference"
        assert found.success == (method != "reference")
        return
    if method == "dop853" and name == "sign":
        return  # it does not pass the jump
    torque, words, rows = UNDEFINED[name]
    found = solve(_scene(torque), [0.25, 1.0], method, 1e-6)
    assert (found.ended, len(found.time), found.success) == ("singular", rows, False)
    assert words in found.reason
    assert "; write" in found.reason
    assert found.message.startswith("The torque is not defined at t = ")


@pytest.mark.sampled
@pytest.mark.parametrize("method", ["auto", "dop853", "reference"])
@pytest.mark.parametrize("torque", [
    lambda t, w: [0.01 / (0.5 - t), 0.0, 0.0],
    lambda t, w: [40.0 * w[0] * w[0], 0.0, 0.0],
    # Neither the root of a small number nor 0 over a small number is the reason.
    lambda t, w: [np.sqrt(np.exp(-60.0 * t)), 0.0, 0.01 / (0.5 - t)],
    lambda t, w: [0.0, 0.01 * (w[1] - w[1] ** 2 / 0.2) / (0.5 - t), 0.01 / (0.5 - t)],
])  # fmt: skip
def test_infinite_torque_or_omega_is_an_overflow(torque: Any, method: str) -> None:
    found = solve(_scene(torque), [0.2, 1.0], method, 1e-6)
    assert (found.ended, len(found.time), found.reason) == ("overflow", 1, None)


def test_reason_before_and_after_time_0() -> None:
    found = solve(_scene(UNDEFINED["root of time"][0]), [-1.0, 0.25, 1.0])
    assert found.time.tolist() == [-1.0, 0.25]
    found = solve(_scene(lambda t, w: [np.sqrt(t + 0.5), 0.0, 0.0]), [-1.0, 0.25, 1.0])
    assert found.time.tolist() == [0.25, 1.0]
    assert "at t = -0.5 s" in str(found.reason)


def test_stepper_refuses_it_in_one_line() -> None:
    stepper = Stepper(_scene(UNDEFINED["root of time"][0]))
    with pytest.raises(InputError, match=r"t = 0\.5 s") as caught:
        stepper.until(1.0)
    assert isinstance(caught.value, SingularError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.what) == (str(caught.value), caught.value.what)


def test_endings_are_shown_by_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    kink = _scene(lambda t, w: [np.sqrt((t - 0.5) ** 2), 0.0, 0.0])
    for method, words in (("auto", "complete"), ("reference", "stalled: no step is short enough")):
        assert words in ending(solve(kink, [0.25, 1.0], method, 1e-6))
    path = tmp_path / "kink.toml"
    path.write_text(
        "[body]\nmoments = [1.0, 1.0, 1.0]\n[initial]\nomega = [1.0, 0.0, 0.0]\n"
        '[torque]\nexpression = ["sqrt((t - 0.5)**2)", "0", "0"]\n'
    )
    asked = ["run", "--scene", str(path), "--method", "dop853", "--times", "0.25,1"]
    assert main(asked) == 0
    assert main([*asked, "--strict"]) == 0
    capsys.readouterr()

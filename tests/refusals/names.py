"""Names that the calls of `calls.toml` use."""

from dataclasses import replace
from math import inf, nan, pi
from types import SimpleNamespace

import numpy as np

import pyharness
from pyharness import *  # noqa: F403
from pyharness import ChangingMoments, Scene, Taylor, TorqueLaw, case_scene, events, opaque, torques
from tests.refusals.names_cli import *  # noqa: F403
from tests.refusals.names_cli import BRICK
from tests.refusals.names_model import *  # noqa: F403

__all__ = ["BRICK", "IN_SPACE", "SHRINKING", "WEAK", "SimpleNamespace", "Taylor", "case_scene",
           "events", "inf", "nan", "np", "opaque", "pi", "pyharness", "replace",
           "torques"]  # fmt: skip

IN_SPACE = replace(BRICK, torque=TorqueLaw((1.0, 0.0, 0.0), frame="space"))
# For the method `averaged`.
WEAK = replace(BRICK, omega=(0.3, 0.2, 1.1), torque=TorqueLaw((1e-6, 2e-6, 1e-6)))
SHRINKING = Scene("shrinking", BRICK.omega, ChangingMoments([[9.0], [8.0, -0.4], [7.0]]))

"""Names that the calls of `calls.toml` use."""

from math import inf, nan, pi
from types import SimpleNamespace

import numpy as np

import pyharness
from pyharness import *  # noqa: F403
from pyharness import Scene, case_scene, events, interchange, opaque, torques

__all__ = ["BRICK", "SimpleNamespace", "case_scene", "events", "inf", "interchange", "nan", "np",
           "opaque", "pi", "pyharness", "torques"]  # fmt: skip

BRICK = Scene("brick", (0.1, 1.0, 0.2), moments=(1.0, 2.0, 2.5))

"""Orekit's closed form of torque-free motion, `TorqueFree`, run by Java in this process."""

from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from pyharness.bench.contenders import Maker
from pyharness.compare.candidates import End, Ready
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

# Duration (s) of the calls before the first timed call. They are needed because Java compiles code
# only after it has run often.
WARMING = 2.0


def orekit(scene: Scene) -> Maker:
    """Return a maker of `TorqueFree`; the setting has no effect.

    Each run computes the elliptic integrals again.
    """
    if not scene.torque.is_zero or scene.moments is None:
        raise InputError("TorqueFree does not take this scene; allowed: moments, and no torque")
    jpype = _machine()
    named = jpype.JClass
    try:
        vector = named("org.hipparchus.geometry.euclidean.threed.Vector3D")
        axis = named("org.orekit.attitudes.InertiaAxis")
        motion = named("org.orekit.attitudes.TorqueFree")
        # This date and this frame need none of Orekit's data on the Earth or on leap seconds.
        begin = named("org.orekit.time.AbsoluteDate").ARBITRARY_EPOCH
        frame = named("org.orekit.frames.FramesFactory").getGCRF()
        axes = vector.PLUS_I, vector.PLUS_J, vector.PLUS_K
        inertia = named("org.orekit.attitudes.Inertia")(*map(axis, scene.moments, axes))
        rotation = named("org.hipparchus.geometry.euclidean.threed.Rotation")
        turned = rotation(*(scene.attitude or ()), False)
        spin = vector(*scene.omega)
        start = named("org.orekit.attitudes.Attitude")(begin, frame, turned, spin, vector.ZERO)
    except (TypeError, jpype.JException) as error:
        raise _unable(error) from error

    def make(horizon: float, setting: float) -> Ready:
        end = begin.shiftedBy(horizon)

        def run() -> Any:
            return motion(start, inertia).getAttitude(None, end, frame)

        try:
            until = perf_counter() + WARMING
            run()
            while perf_counter() < until:
                run()
        except jpype.JException as error:
            raise _unable(error) from error
        return Ready(run, _end)

    return make


def _end(found: Any) -> End:
    # Orekit's rotation takes vectors from space to the body, and Hipparchus applies the inverse of
    # a quaternion. The four components therefore agree with our convention.
    q, w = found.getRotation(), found.getSpin()
    attitude = np.array([q.getQ0(), q.getQ1(), q.getQ2(), q.getQ3()])
    return End(np.array([w.getX(), w.getY(), w.getZ()]), attitude=attitude)


def _machine() -> Any:
    """Return JPype with a started Java machine, of which a process can have one."""
    try:
        # JPype's type hints declare only some of its names.
        jpype, package = map(import_module, ("jpype", "orekit_jpype"))
        if not jpype.isJVMStarted():
            # With the option -Xrs Java does not handle signals, so that Python can handle Ctrl-C.
            package.initVM("-Xrs")
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:
        raise _unable(error) from error
    return jpype


def _unable(error: Exception) -> InputError:
    return InputError(f"Java or Orekit fails: {' '.join(str(error).split())}")

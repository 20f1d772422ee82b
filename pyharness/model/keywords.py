"""Hints for keyword arguments of SciPy that users may expect."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

_TOLERANCE = "tolerance, the largest error of the result relative to the largest |omega|"
_TIMES = "times, all in one argument; the initial omega is at Scene.t0, by default 0"
_START = "t0 of the Scene, the time of its initial omega"
_ARGUMENTS = "keyword arguments with defaults in the torque's function, or functools.partial"
_STEPS = "nothing; steps follow from the tolerance"
_OMEGA = "omega, of the Scene or of solve_many"
_ATTITUDE = "attitude, a quaternion with the scalar first, or a Rotation of SciPy"
_INERTIA = "moments, three principal moments, or inertia, a matrix"
_HINTS = {
    **dict.fromkeys(("rtol", "atol", "tol", "rel_tol", "abs_tol"), _TOLERANCE),
    **dict.fromkeys(("t", "t_eval", "t_span", "t_end", "tspan"), _TIMES),
    **dict.fromkeys(("saveat", "ts", "t1"), _TIMES),
    **dict.fromkeys(("t0", "t_start"), _START),
    **dict.fromkeys(("args", "kwargs"), _ARGUMENTS),
    **dict.fromkeys(
        ("max_step", "first_step", "min_step", "dt", "dt0", "stepsize_controller"), _STEPS
    ),
    **dict.fromkeys(("y0", "w", "w0", "omega0", "omega_0"), _OMEGA),
    **dict.fromkeys(("q", "q0", "attitude0", "quaternion", "rotation"), _ATTITUDE),
    **dict.fromkeys(("I", "J", "tensor", "inertia_tensor", "moments_of_inertia"), _INERTIA),
    "solver": "method, a name such as 'dop853'",
    "fun": "torque, a function of (t, omega), as an argument of the Scene",
    "jac": "nothing; derivatives come from the recorded torque",
    "vectorized": "nothing; the torque is recorded once",
}


def with_hints(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function, so that its TypeError for a SciPy keyword names our keyword."""
    allowed = [each for each in inspect.signature(function).parameters if each != "self"]
    names = frozenset(allowed)

    @wraps(function)
    def call(*args: P.args, **keywords: P.kwargs) -> R:
        if not names.issuperset(keywords):
            wrong = next(each for each in keywords if each not in names)
            called = function.__qualname__.removesuffix(".__init__")
            hint = _HINTS.get(wrong)
            instead = f"write {hint}" if hint else f"allowed: {', '.join(allowed)}"
            raise TypeError(f"{called} has no argument {wrong!r}; {instead}")
        return function(*args, **keywords)

    return call

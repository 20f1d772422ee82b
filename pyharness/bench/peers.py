"""Third-party integrators for `bench`, set up for speed as their documentation recommends."""

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from pyharness.bench import compiled_peers as compiled
from pyharness.bench.contenders import TOLERANCES, Maker, SceneContender, refuse_rounding
from pyharness.checks.compare.candidates import End, Ready, not_finite
from pyharness.engine.scipy_ivp import RightHandSide, state_of, with_attitude
from pyharness.engine.system import slopes_of, system_of
from pyharness.model.attitude import quaternion_rates
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import Functions, Table, evaluate
from pyharness.truth.reference import exact_coefficients

# A torque about the body axes (N m), as a function of time, omega, attitude, sine and cosine.
Formula = Callable[..., Sequence[Any]]
_SOLVE_IVP = ("DOP853", "RK45", "LSODA", "Radau")


def peers() -> list[SceneContender]:
    """Return all third-party contenders for single scenes, installed or not."""
    # 2**-52 is the default tolerance of heyoka.
    finest = (*TOLERANCES, 2.0**-52)

    def adaptive(name: str, package: str, prepare: Callable[[Scene], Maker]) -> SceneContender:
        settings = finest if name == "heyoka" else TOLERANCES
        return SceneContender(name, "tolerance", prepare, settings, package=package, attitude=True)

    def fixed(name: str, order: int) -> SceneContender:
        prepare = partial(compiled.numba_fixed, name)
        return SceneContender(f"numba-{name}", "steps", prepare, order=order, package="numba")

    return [
        adaptive("heyoka", "heyoka", heyoka_maker),
        fixed("rk4", 4),
        fixed("dop8", 8),
        adaptive("odeint", "scipy", _odeint),
        *(
            adaptive(f"solve_ivp-{name.lower()}", "scipy", partial(_solve_ivp, name))
            for name in _SOLVE_IVP
        ),
    ]


def heyoka_maker(scene: Scene, formula: Formula | None = None) -> Maker:
    """Return a maker of heyoka integrations, with one integrator for each tolerance.

    Each run first resets time and state. `formula` is as in `heyoka_equations`.
    """
    import heyoka

    equations = heyoka_equations(scene, formula)
    integrators: dict[float, Any] = {}
    start = np.array(state_of(scene))

    def make(horizon: float, setting: float) -> Ready:
        if setting not in integrators:
            # Compilation is timed, so code from an earlier compilation must not be reused.
            heyoka.llvm_state.clear_memcache()
            if hasattr(heyoka.llvm_state, "set_diskcache_enabled"):
                heyoka.llvm_state.set_diskcache_enabled(False)
            integrators[setting] = heyoka.taylor_adaptive(
                equations, start.tolist(), tol=setting, compact_mode=False
            )
        integrator = integrators[setting]
        state = integrator.state
        reached = heyoka.taylor_outcome.time_limit

        def run() -> Any:
            integrator.time = 0.0
            state[:] = start
            return integrator.propagate_until(horizon)

        def read(result: Any) -> End:
            return compiled.end_of(state) if result[0] == reached else not_finite(str(result[0]))

        return Ready(run, read)

    return make


def _problem(scene: Scene) -> tuple[RightHandSide, Sequence[float], Any]:
    """Return right-hand side, start, and the ratio of absolute to relative tolerance.

    The ratio is a number, or an array with one for each unknown.
    """
    is_free, largest = scene.attitude is None, max(map(abs, scene.omega)) or 1.0
    if isinstance(scene.torque, StateTorque):
        slopes = slopes_of(scene)
    else:
        slopes = scene.right_hand_side()
        slopes = slopes if is_free else with_attitude(slopes)
    size = largest if is_free else np.array([largest] * 3 + [1.0] * 4)
    return slopes, state_of(scene), size


def _solve_ivp(name: str, scene: Scene) -> Maker:
    from scipy.integrate import solve_ivp

    slope, start, size = _problem(scene)

    def make(horizon: float, setting: float) -> Ready:
        refuse_rounding("solve_ivp", setting)
        run = partial(
            solve_ivp, slope, (0.0, horizon), start, method=name, rtol=setting, atol=setting * size,
        )  # fmt: skip
        return Ready(run, read)

    def read(result: Any) -> End:
        if not result.success:
            return not_finite(str(result.message))
        return compiled.end_of(result.y[:, -1], int(result.nfev))

    return make


def _odeint(scene: Scene) -> Maker:
    from scipy.integrate import ODEintWarning, odeint

    slope, start, size = _problem(scene)

    def make(horizon: float, setting: float) -> Ready:
        refuse_rounding("LSODA", setting)
        run = partial(
            odeint, slope, start, np.array([0.0, horizon]), rtol=setting, atol=setting * size,
            tfirst=True, mxstep=compiled.MOST_STEPS,
        )  # fmt: skip

        def read(rows: Any) -> End:
            # The call is repeated, because the evaluations are counted only with an option that the
            # timed call omits.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ODEintWarning)
                _, told = run(full_output=True)
            if "successful" not in told["message"]:
                return not_finite(told["message"])
            return compiled.end_of(rows[-1], int(told["nfe"][-1]))

        return Ready(run, read)

    return make


def heyoka_equations(scene: Scene, formula: Formula | None = None) -> list[tuple[Any, Any]]:
    """Return pairs of an unknown and its derivative, for omega and any attitude of the scene.

    `formula`, or else the tape of recorded operations, gives a torque that depends on the state.
    Raise InputError for an opaque torque or a table.
    """
    import heyoka

    unknowns = compiled.state_names(scene)
    coefficients = list(map(float, exact_coefficients(scene)))
    x, y, z, *q = state = heyoka.make_vars(*unknowns)
    found: list[Any]
    if formula is not None:
        torque = formula(heyoka.time, (x, y, z), q, heyoka.sin, heyoka.cos)
        products, moments = (y * z, z * x, x * y), scene.moments or (1.0,) * 3
        terms = zip(coefficients, products, torque, moments, strict=True)
        found = [a * product + push / moment for a, product, push, moment in terms]
        found += quaternion_rates((x, y, z), q) if q else ()
    elif not isinstance(scene.torque, StateTorque):
        names = {"sin": heyoka.sin, "cos": heyoka.cos, "t": heyoka.time}
        names |= dict(zip(unknowns, state, strict=True))
        found = [eval(rate, names) for rate in compiled.rates(scene, "t", unknowns, coefficients)]
    elif scene.torque.tape is None:
        raise InputError(
            "heyoka can't evaluate an opaque torque; allowed: a torque that can be recorded"
        )
    else:
        # The inputs without attitude are not read.
        inputs = [heyoka.time, *state, *[None] * (7 - len(state))]
        found = evaluate(system_of(scene, bool(q)), inputs, heyoka_functions())
    return [(x, heyoka.expression(rate)) for x, rate in zip(state, found, strict=True)]


def heyoka_functions() -> Functions[Any]:
    """Return the functions of a tape in heyoka's arithmetic."""
    import heyoka

    def table(_: Table, time: Any) -> Any:
        raise InputError("heyoka can't evaluate a table; allowed: a torque without tables")

    elementary = heyoka.sqrt, heyoka.exp, heyoka.tanh, heyoka.sin, heyoka.cos
    return Functions(heyoka.expression, *elementary, table)

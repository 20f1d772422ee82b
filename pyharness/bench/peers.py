"""Third-party integrators for `bench`, set up for speed as their documentation recommends.

numba compiles a Runge-Kutta method for each scene, with the scene's numbers in the right-hand sides
and an unrolled loop over stages.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from pyharness.bench.contenders import TOLERANCES, Maker, SceneContender, refuse_rounding
from pyharness.checks.compare.candidates import End, Ready, copied_result, not_finite
from pyharness.engine.methods.scipy_ivp import RightHandSide, state_of, with_attitude
from pyharness.engine.system.recorded import slopes_of, system_of
from pyharness.model.attitude import quaternion_rates
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import Functions, Table, evaluate
from pyharness.model.trajectory import Array
from pyharness.truth.reference import exact_coefficients

# Returns a torque about body axes (N m) from time, omega, attitude, and the functions sin and cos.
Formula = Callable[..., Sequence[Any]]
MOST_STEPS = 10_000_000
Tableau = tuple[Sequence[Sequence[float]], Sequence[float], Sequence[float]]
# The tableau: coefficients below the diagonal, weights and nodes of the stages.
RK4 = [[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], [0.0, 0.5, 0.5, 1.0]
_SOLVE_IVP = ("DOP853", "RK45", "LSODA", "Radau")


def peers() -> list[SceneContender]:
    """Return all third-party contenders for single scenes, installed or not."""
    # 2**-52 is the default tolerance of heyoka.
    finest = (*TOLERANCES, 2.0**-52)

    def adaptive(name: str, package: str, prepare: Callable[[Scene], Maker]) -> SceneContender:
        settings = finest if package == "heyoka" else TOLERANCES
        return SceneContender(name, "tolerance", prepare, settings, package=package, attitude=True)

    def fixed(name: str, order: int) -> SceneContender:
        prepare = partial(numba_fixed, name)
        return SceneContender(f"numba-{name}", "steps", prepare, order=order, package="numba")

    return [
        adaptive("heyoka", "heyoka", heyoka_maker),
        # With derivatives with respect to the initial state, as for our error amplification.
        adaptive("heyoka-variational", "heyoka", partial(heyoka_maker, variational=True)),
        fixed("rk4", 4),
        fixed("dop8", 8),
        adaptive("odeint", "scipy", _odeint),
        *(
            adaptive(f"solve_ivp-{name.lower()}", "scipy", partial(_solve_ivp, name))
            for name in _SOLVE_IVP
        ),
    ]


def heyoka_maker(
    scene: Scene, formula: Formula | None = None, *, variational: bool = False
) -> Maker:
    """Return a maker of heyoka's integrations, which are compiled once for each tolerance.

    `variational` adds derivatives with respect to the initial state.
    """
    import heyoka

    equations: Any = heyoka_equations(scene, formula)
    integrators: dict[float, Any] = {}
    start = np.array(state_of(scene))
    n = len(start)
    if variational:
        equations = heyoka.var_ode_sys(equations, heyoka.var_args.vars, order=1)
        start = np.concatenate([start, np.eye(n).ravel()])

    def make(horizon: float, setting: float) -> Ready:
        if setting not in integrators:
            # Compile anew, because the compilation is timed.
            heyoka.llvm_state.clear_memcache()
            if hasattr(heyoka.llvm_state, "set_diskcache_enabled"):
                heyoka.llvm_state.set_diskcache_enabled(False)
            integrators[setting] = heyoka.taylor_adaptive(
                equations, start[:n].tolist(), tol=setting, compact_mode=False
            )
        integrator = integrators[setting]
        state = integrator.state
        reached = heyoka.taylor_outcome.time_limit

        def run() -> Any:
            integrator.time = 0.0
            state[:] = start
            return integrator.propagate_until(horizon)

        def read(result: Any) -> End:
            return end_of(state[:n]) if result[0] == reached else not_finite(str(result[0]))

        return Ready(run, read)

    return make


def _problem(scene: Scene) -> tuple[RightHandSide, Sequence[float], Any]:
    """Return right-hand side, initial state, and absolute divided by relative tolerance."""
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
        return end_of(result.y[:, -1], int(result.nfev))

    return make


def _odeint(scene: Scene) -> Maker:
    from scipy.integrate import ODEintWarning, odeint

    slope, start, size = _problem(scene)

    def make(horizon: float, setting: float) -> Ready:
        refuse_rounding("LSODA", setting)
        run = partial(
            odeint, slope, start, np.array([0.0, horizon]), rtol=setting, atol=setting * size,
            tfirst=True, mxstep=MOST_STEPS,
        )  # fmt: skip

        def read(rows: Any) -> End:
            # Repeat the call with an option, omitted in the timed call, that counts evaluations.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ODEintWarning)
                _, told = run(full_output=True)
            if "successful" not in told["message"]:
                return not_finite(told["message"])
            return end_of(rows[-1], int(told["nfe"][-1]))

        return Ready(run, read)

    return make


def heyoka_equations(scene: Scene, formula: Formula | None = None) -> list[tuple[Any, Any]]:
    """Return heyoka's pairs (unknown, derivative) for omega and any attitude of the scene.

    Raise InputError if heyoka cannot evaluate the torque.
    """
    import heyoka

    unknowns = "xyz" if scene.attitude is None else "xyzabcd"
    coefficients = list(map(float, exact_coefficients(scene)))
    x, y, z, *q = state = heyoka.make_vars(*unknowns)
    found: list[Any]
    if formula is not None:
        torque = formula(heyoka.time, (x, y, z), q, heyoka.sin, heyoka.cos)
        products, moments = (y * z, z * x, x * y), scene.moments or (1.0,) * 3
        terms = zip(coefficients, products, torque, moments, strict=True)
        found = [a * product + push / moment for a, product, push, moment in terms]
    elif not isinstance(scene.torque, StateTorque):
        names = {"sin": heyoka.sin, "cos": heyoka.cos, "t": heyoka.time, "x": x, "y": y, "z": z}
        found = [eval(rate, names) for rate in rates(scene, "t", "xyz", coefficients)]
    elif scene.torque.tape is None:
        raise InputError(
            "heyoka can't evaluate an opaque torque; allowed: a torque that can be recorded"
        )
    else:
        inputs = [heyoka.time, *state, *[None] * (7 - len(state))]
        found = evaluate(system_of(scene, attitude=False), inputs, heyoka_functions())
    found += quaternion_rates((x, y, z), q) if q else ()
    return [(x, heyoka.expression(rate)) for x, rate in zip(state, found, strict=True)]


def heyoka_functions() -> Functions[Any]:
    """Return functions that evaluate a recorded torque in heyoka's arithmetic."""
    import heyoka

    def table(_: Table, time: Any) -> Any:
        raise InputError("heyoka can't evaluate a table; allowed: a torque without tables")

    def chosen(condition: Any, first: Any, second: Any) -> Any:
        return heyoka.select(heyoka.gt(condition, heyoka.expression(0.0)), first, second)

    def refused(_: Any) -> Any:
        raise InputError("heyoka can't evaluate a floor; allowed: a torque without floor")

    elementary = heyoka.sqrt, heyoka.exp, heyoka.tanh, heyoka.sin, heyoka.cos
    names = ("log", "atan", "asin", "acos", "asinh", "acosh", "atanh")
    others = {name: getattr(heyoka, name) for name in names} | {
        "log1p": lambda x: heyoka.log(1.0 + x),
        "log2": lambda x: heyoka.log(x) / math.log(2.0),
        "log10": lambda x: heyoka.log(x) / math.log(10.0),
        "cbrt": lambda x: heyoka.exp(heyoka.log(x) / 3.0),
        "expm1": lambda x: heyoka.exp(x) - 1.0,
        "exp2": lambda x: heyoka.exp(x * math.log(2.0)),
    }
    one, zero = heyoka.expression(1.0), heyoka.expression(0.0)
    return Functions(
        heyoka.expression, *elementary, table, others, lambda x: chosen(x, one, zero), refused,
        chosen,
    )  # fmt: skip


def numba_fixed(method: str, scene: Scene) -> Maker:
    """Return a maker of numba's integrations by "rk4" or "dop8" (DOP853's formula of order 8)."""
    import numba

    formula: Tableau = RK4
    if method != "rk4":
        # No public module of SciPy has these coefficients.
        from scipy.integrate._ivp import dop853_coefficients as table  # noqa: PLC2701

        count = table.N_STAGES
        stages = [table.A[i, :i].tolist() for i in range(count)]
        formula = stages, table.B.tolist(), table.C[:count].tolist()
    kernel = numba.njit(fastmath=False)(compiled_function(steps_source(scene, formula)))
    omega0, omega = np.array(scene.omega), np.empty(3)

    def make(horizon: float, setting: float) -> Ready:
        steps = int(setting)

        def run() -> Any:
            kernel(omega0, horizon, steps, omega)
            return omega

        return Ready(
            run, lambda result: End(copied_result(result), evaluations=steps * len(formula[1]))
        )

    return make


def compiled_function(source: str) -> Any:
    names: dict[str, Any] = {}
    exec(compile(source, "<bench>", "exec"), {"sin": np.sin, "cos": np.cos}, names)
    return names["function"]


def rates(
    scene: Scene, time: str, state: Sequence[str], coefficients: Sequence[float] = ()
) -> list[str]:
    """Return omega's three derivatives as Python expressions in `time` and in the names `state`.

    `coefficients` are Euler's A, B, C, by default the scene's.
    """
    x, y, z = state
    moments = scene.moments or (1.0, 1.0, 1.0)
    law = scene.body_torque
    found = []
    for axis, product in enumerate((f"{y} * {z}", f"{x} * {z}", f"{x} * {y}")):
        terms = []
        coefficient = (coefficients or scene.euler_coefficients)[axis]
        if coefficient:
            terms.append(f"{coefficient!r} * {product}")
        if law.constant[axis]:
            terms.append(repr(law.constant[axis] / moments[axis]))
        if law.rate[axis]:
            terms.append(f"{law.rate[axis] / moments[axis]!r} * ({time})")
        for waves, function in ((law.sines, "sin"), (law.cosines, "cos")):
            for amplitude, frequency in waves:
                if amplitude[axis]:
                    wave = f"{function}({frequency!r} * ({time}))"
                    terms.append(f"{amplitude[axis] / moments[axis]!r} * {wave}")
        found.append(" + ".join(terms) or "0.0")
    return found


def end_of(state: Array, evaluations: int | None = None) -> End:
    found = copied_result(state)
    attitude = found[3:] if len(found) > 3 else None
    return End(found[:3], evaluations=evaluations, attitude=attitude)


def steps_source(scene: Scene, formula: Tableau) -> str:
    """Return the Python source of a Runge-Kutta integration with unrolled stages."""
    stages, weights, nodes = formula
    step = ["t = step * h"]
    for i, row in enumerate(stages):
        step += [f"{name}s = {name}{_increment(row, name)}" for name in "xyz"]
        time = f"t + {nodes[i]!r} * h" if nodes[i] else "t"
        found = zip("xyz", rates(scene, time, ("xs", "ys", "zs")), strict=True)
        step += [f"k{name}{i} = {rate}" for name, rate in found]
    step += [f"{name} = {name}{_increment(weights, name)}" for name in "xyz"]
    start = "h = t_end / steps", "x, y, z = omega0[0], omega0[1], omega0[2]"
    lines = (*start, "for step in range(steps):", *(f"    {line}" for line in step))
    body = (*lines, "omega[0], omega[1], omega[2] = x, y, z")
    head = "def function(omega0, t_end, steps, omega):\n"
    return head + "".join(f"    {line}\n" for line in body)


def _increment(factors: Sequence[float], name: str) -> str:
    terms = [f"{factor!r} * k{name}{j}" for j, factor in enumerate(factors) if factor]
    return f" + h * ({' + '.join(terms)})" if terms else ""

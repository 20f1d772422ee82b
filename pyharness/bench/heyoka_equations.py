"""The equations of motion of a scene as expressions of the package heyoka."""

from collections.abc import Callable, Sequence
from typing import Any

from pyharness.bench import compiled_peers as compiled
from pyharness.engine.system import system_of
from pyharness.model.attitude import quaternion_rates
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import Functions, Table, evaluate
from pyharness.truth.reference import exact_coefficients

# A torque about the body axes (N m), as a function of time, omega, attitude, sine and cosine.
Formula = Callable[..., Sequence[Any]]


def heyoka_equations(scene: Scene, formula: Formula | None = None) -> list[tuple[Any, Any]]:
    """Return pairs of an unknown and its derivative, for omega and any attitude of the scene.

    `formula`, or else the tape of recorded operations, gives a torque that depends on the state.
    Raise InputError for an opaque torque or a table.
    """
    import heyoka

    unknowns = compiled.state_names(scene)
    state = heyoka.make_vars(*unknowns)
    if formula is not None:
        found = _by_formula(scene, formula, state)
    elif isinstance(scene.torque, StateTorque):
        found = _by_tape(scene, state)
    else:
        names = {"sin": heyoka.sin, "cos": heyoka.cos, "t": heyoka.time}
        names |= dict(zip(unknowns, state, strict=True))
        rates = compiled.rates(scene, "t", unknowns, list(map(float, exact_coefficients(scene))))
        found = [eval(rate, names) for rate in rates]
    return [(x, heyoka.expression(rate)) for x, rate in zip(state, found, strict=True)]


def _by_formula(scene: Scene, formula: Formula, state: Sequence[Any]) -> list[Any]:
    import heyoka

    x, y, z, *q = state
    torque = formula(heyoka.time, (x, y, z), q, heyoka.sin, heyoka.cos)
    found: list[Any] = [
        coefficient * product + component / moment
        for coefficient, product, component, moment in zip(
            map(float, exact_coefficients(scene)), (y * z, z * x, x * y), torque,
            scene.moments or (1.0,) * 3,
            strict=True,
        )
    ]  # fmt: skip
    if q:
        found += quaternion_rates((x, y, z), q)
    return found


def _by_tape(scene: Scene, state: Sequence[Any]) -> list[Any]:
    import heyoka

    assert isinstance(scene.torque, StateTorque)
    if scene.torque.tape is None:
        raise InputError(
            "heyoka can't evaluate an opaque torque; allowed: a torque that can be recorded"
        )

    # The inputs without attitude are not read.
    inputs = [heyoka.time, *state, *[None] * (7 - len(state))]
    return evaluate(system_of(scene, scene.attitude is not None), inputs, heyoka_functions())


def heyoka_functions() -> Functions[Any]:
    """Return the functions of a tape in heyoka's arithmetic."""
    import heyoka

    def table(_: Table, time: Any) -> Any:
        raise InputError("heyoka can't evaluate a table; allowed: a torque without tables")

    elementary = heyoka.sqrt, heyoka.exp, heyoka.tanh, heyoka.sin, heyoka.cos
    return Functions(heyoka.expression, *elementary, table)

"""Comparison of methods on one scene with each other and with the reference."""

from collections.abc import Sequence
from dataclasses import replace

from pyharness.checks.compare.comparison import Comparison, method_finding
from pyharness.engine.registry import (
    METHODS,
    SCIPY_METHODS,
    check_attitude,
    check_torque,
    requested_tolerance,
)
from pyharness.engine.sensitivity import motion_growth
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.values import boolean
from pyharness.truth.bounded import bound_of
from pyharness.truth.reference import reference


def compare_methods(
    scene: Scene,
    methods: Sequence[str] = ("auto", *SCIPY_METHODS),
    *,
    tolerance: float | None = None,
    effort: float = 1.0,
    attitude: bool = False,
) -> Comparison:
    """Compare methods on one scene with each other and with the reference solution.

    Parameters
    ----------
    scene : Scene
        The scene; times are the ends of its steps. A torque may depend on omega or attitude if it
        can be recorded.
    methods : sequence of str
        Names in `pyharness.engine.registry.METHODS`; by default `auto` and SciPy's methods.
    tolerance : float, optional
        The tolerance of each method, relative to the largest component of omega; by default that of
        `solve`. Methods with a fixed step ignore it.
    effort : float
        Factor on the work limits of the methods and the reference.
    attitude : bool
        Whether attitudes are compared too; always if the torque depends on the attitude.

    Returns
    -------
    Comparison
        The results; its property `unexpected` is empty if every method meets its tolerance.

    Raises
    ------
    NotBuiltError
        If the extension is not built.
    InputError
        If a method is unknown or can't solve the scene, a tolerance is out of range, or the
        reference would exceed its work limit.

    Examples
    --------
    >>> from pyharness import case_scene, compare_methods
    >>> compare_methods(case_scene(2), ["auto", "dop853"]).unexpected
    ()
    """
    checked_scene(scene, any_state=True)
    attitude = boolean("attitude", attitude)
    if isinstance(methods, str):
        raise InputError(f"methods is text; allowed: a list of names, as in ['{methods}']")
    attitude = attitude or scene.torque.needs_attitude
    tolerances = {name: _tolerance_of_method(name, tolerance) for name in methods}
    if not tolerances:
        raise InputError(f"methods: the list is empty; allowed: {', '.join(METHODS)}")
    for name in tolerances:
        check_torque(scene, name, attitude)
        if attitude:
            check_attitude(name)
    scene = replace(scene, attitude=(scene.attitude or IDENTITY) if attitude else None)
    truth = reference(scene, scene.times(), effort=effort)
    import scipy.integrate  # noqa: F401  (not to be timed with the first method)

    found = tuple(method_finding(scene, *each, effort, truth) for each in tolerances.items())
    growth = motion_growth(scene, scene.times()[-1])
    bound = bound_of(scene, truth, effort=effort)
    return Comparison(scene, None, truth, bound, (), found, growth)


def _tolerance_of_method(name: str, tolerance: float | None) -> float:
    if name not in METHODS:
        raise unknown("method", name, METHODS)
    chosen = METHODS[name]
    found = requested_tolerance(name, None if chosen.is_fixed_step else tolerance)
    if not chosen.finest <= found <= 1.0:
        raise InputError(f"tolerance is {found:g}; allowed for {name}: {chosen.finest:.2g} to 1")
    return found

"""Comparisons of programs, original and corrected, and methods on one scene.

Errors (rad/s) below the error of the reference have no meaning. Differences between Fortran and
Python are in units in the last place.
"""

import itertools
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from pyharness.checks.compare.agreement import accuracy, differences, distance
from pyharness.checks.compare.candidates import method_candidate, program_candidate
from pyharness.checks.compare.findings import Comparison, MethodFinding, ProgramFinding
from pyharness.checks.compare.orders import measured_order
from pyharness.checks.compare.timing import seconds as timed
from pyharness.engine.methods.sensitivity import motion_growth
from pyharness.engine.plan.registry import (
    METHODS,
    SCIPY_METHODS,
    check_torque,
    computes_attitude,
    requested_tolerance,
)
from pyharness.engine.steps.from_rows import attitude_from_rows
from pyharness.model.attitude import IDENTITY
from pyharness.model.effort import check_steps
from pyharness.model.errors import InputError, kind_of, known, unknown
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset, switchable
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.values import are_several, boolean, checked_effort
from pyharness.thesis.in_word import compiled_words
from pyharness.thesis.programs import (
    BINARY64,
    IMPLEMENTATIONS,
    PROGRAM_REGISTRY,
    checked_word,
    work_of,
)
from pyharness.truth.bounded import bound_of
from pyharness.truth.reference import Reference, reference

_TIMING_BATCHES = 3
_TIMING_SECONDS = 3e-4


def compare_programs(
    scene: Scene,
    listings: Sequence[Listing] | None = None,
    *,
    lipschitz: float = 500.0,
    may_stop: bool = True,
    tolerance: float | None = None,
    effort: float = 1.0,
    attitude: bool = False,
    word: str = BINARY64,
    methods: bool = True,
) -> Comparison:
    """Compare programs and SciPy's methods on one scene with each other and with the reference.

    Parameters
    ----------
    scene : Scene
        The motion and its steps.
    listings : sequence of Listing, optional
        The programs to run; by default all three, original and corrected.
    lipschitz : float
        The constant of the Runge-Kutta program's stop test (1/s).
    may_stop : bool
        Whether the stop test may end a run.
    tolerance : float, optional
        The tolerance of each method of `solve_ivp`, relative to the largest component of omega; the
        default is as in `solve`.
    effort : float
        Factor on the work limits of the programs, the methods and the reference.
    attitude : bool
        Whether attitudes are compared too, from the scene's initial attitude or the identity. A
        program's attitude is integrated from its omega by a method of order 4.
    word : str
        The arithmetic of the programs, one of `pyharness.thesis.programs.WORD_NAMES`. Without
        compiled programs for it, only the Python ports run. Orders are measured in binary64 only.
    methods : bool
        Whether SciPy's methods run; `unexpected` and `is_sensitive` do not depend on it.

    Returns
    -------
    Comparison
        The results; `unexpected` is empty if Fortran and Python agree, and no corrected program
        misses its order of convergence.

    Raises
    ------
    NotBuiltError
        If the extension is not built.
    InputError
        If a program or the reference would exceed its work limit, or the scene or word is invalid.

    Examples
    --------
    >>> from pyharness import case_scene, compare_programs
    >>> compare_programs(case_scene(2)).unexpected
    ()
    """
    checked_scene(scene)
    may_stop = boolean("may_stop", may_stop)
    attitude = boolean("attitude", attitude)
    methods = boolean("methods", methods)
    effort = checked_effort(effort)
    listings = listings_for() if listings is None else listings
    for each in listings if are_several(listings) else [listings]:
        if not isinstance(each, Listing) or not are_several(listings):
            raise InputError(f"listings: {kind_of(each)}; allowed: a list of Listing, as of subset")
    in_floats = checked_word(word, "python") == BINARY64
    has_fortran = in_floats or word in compiled_words()
    languages = IMPLEMENTATIONS if has_fortran else ("python",)
    for listing, language in itertools.product(listings, languages):
        check_steps(scene, listing.program, work_of(word, language), effort)
    scene = replace(scene, attitude=(scene.attitude or IDENTITY) if attitude else None)
    truth = reference(scene, scene.times(), velocity=True, effort=effort)
    programs = []
    for listing in listings:
        own = partial(program_candidate, listing, effort=effort, word=word)
        candidates = [own(each, lipschitz, may_stop) for each in languages]
        run, *other = (each.rows(scene) for each in candidates)
        judged = in_floats and not listing.active
        program = PROGRAM_REGISTRY[listing.program]
        order = measured_order(scene, program, listing, truth) if judged else None
        if attitude:
            run = replace(run, attitude=attitude_from_rows(scene, run.time, run.omega))
        (seconds,) = timed([partial(candidates[0].rows, scene)], _TIMING_SECONDS, _TIMING_BATCHES)
        ulp = distance(run, *other) if other else None
        found = tuple(differences(run, *other)) if other else ()
        good, per_step = accuracy(scene, run, truth), seconds / max(run.steps, 1)
        programs.append(ProgramFinding(listing, run, good, ulp, found, order, per_step))
    tolerances = {name: requested_tolerance(name, tolerance) for name in SCIPY_METHODS}
    return _with_methods(scene, lipschitz, truth, programs, tolerances, effort, word, methods)


def listings_for(
    programs: Iterable[str] = PROGRAMS,
    base: str | None = None,
    fix: Sequence[str] = (),
    keep: Sequence[str] = (),
    readings: Sequence[str] = (),
    conjectures: Sequence[str] | None = None,
) -> list[Listing]:
    """Return each program's original and corrected listing and, between them, a changed one.

    `fix` and `keep` change `base`; without both, a specified `base` is the only listing.
    """
    chosen = list(programs)
    assumed = [name for name in conjectures or () if name != "none"]
    given = {"--fix": fix, "--keep": keep, "--reading": readings, "--conjecture": assumed}
    for option, names in given.items():
        kind = "defect" if option in ("--fix", "--keep") else option.removeprefix("--")
        names_in = switchable if kind == "defect" else partial(names_of, kind)
        allowed = {name for program in chosen for name in names_in(program)}
        for name in names:
            if name not in allowed:
                raise unknown(kind, name, sorted(allowed), option)
    for name in sorted(set(fix) & set(keep)):
        raise InputError(f"'{name}' is given to both --fix and --keep; give it to one of them")
    result = []
    for program in chosen:
        own = switchable(program)
        fixed, kept, selected = ([n for n in names if n in own] for names in (fix, keep, readings))
        bases = [base] if base and not (fix or keep) else ["original", "corrected"]
        listing = partial(subset, program, readings=selected, conjectures=conjectures)
        rows = [listing(each) for each in bases]
        if fixed or kept:
            rows.insert(1, listing(base, fixed, keep=kept))
        result += rows
    return result


def compare_methods(
    scene: Scene,
    methods: Sequence[str] = ("auto", *SCIPY_METHODS),
    *,
    tolerance: float | None = None,
    effort: float = 1.0,
    attitude: bool | None = None,
) -> Comparison:
    """Compare methods on one scene with each other and with the reference solution.

    Parameters
    ----------
    scene : Scene
        The motion; methods are compared at the ends of its steps. A torque may depend on omega or
        attitude if its arithmetic can be recorded.
    methods : sequence of str
        Names in `pyharness.engine.plan.registry.METHODS`.
    tolerance : float, optional
        The tolerance of each method, relative to the largest component of omega; the default is as
        in `solve`. Methods with a fixed step ignore it.
    effort : float
        Factor on the work limits of the methods and the reference.
    attitude : bool, optional
        Whether attitudes are compared too. By default they are if the torque needs them, or the
        scene has one, and all methods can compute them.

    Returns
    -------
    Comparison
        The results; `unexpected` is empty if every method meets its tolerance.

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
    if not are_several(methods):
        raise InputError(f"methods is {kind_of(methods)}; allowed: a list, as in ['auto', 'rk45']")
    effort = checked_effort(effort)
    tolerances = {}
    for given in methods:
        name = known("method", given, METHODS)
        chosen = METHODS[name]
        found = requested_tolerance(name, None if chosen.is_fixed_step else tolerance)
        if not chosen.finest <= found <= 1.0:
            finest = f"{chosen.finest:.2g}"
            raise InputError(f"tolerance is {found:g}; allowed for {name}: {finest} to 1")
        tolerances[name] = found
    if not tolerances:
        raise InputError(f"methods: the list is empty; allowed: {', '.join(METHODS)}")
    if attitude is None:
        attitude = all(computes_attitude(scene, name, None) for name in tolerances)
    for name in tolerances:
        attitude = computes_attitude(scene, name, attitude)
        check_torque(scene, name, attitude)
    scene = replace(scene, attitude=(scene.attitude or IDENTITY) if attitude else None)
    truth = reference(scene, scene.times(), effort=effort)
    return _with_methods(scene, None, truth, (), tolerances, effort)


def _with_methods(
    scene: Scene,
    lipschitz: float | None,
    truth: Reference,
    programs: Sequence[ProgramFinding],
    tolerances: Mapping[str, float],
    effort: float,
    word: str = BINARY64,
    are_run: bool = True,
) -> Comparison:
    if are_run:
        import scipy.integrate  # noqa: F401  (not to be timed with the first method)

    methods = []
    for name, tolerance in tolerances.items():
        run, failure, start = None, "", time.perf_counter()
        try:
            run = method_candidate(name, tolerance, effort).rows(scene) if are_run else None
        except InputError as error:
            failure = str(error)
        seconds = math.nan if run is None else time.perf_counter() - start
        good = None if run is None else accuracy(scene, run, truth)
        given = None if METHODS[name].is_fixed_step else tolerance
        methods.append(MethodFinding(name, given, run, good, seconds, failure))
    growth = motion_growth(scene, scene.times()[-1])
    bound = bound_of(scene, truth, effort=effort)
    found = tuple(programs), tuple(methods)
    return Comparison(scene, lipschitz, truth, bound, *found, growth, word)

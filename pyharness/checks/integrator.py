"""Checks of an integrator of rigid bodies in any language, against the true solution.

The integrator is another program, which answers requests. Its errors are measured with smaller and
smaller steps (or tolerances) in random scenes. If it converges to another motion than the true one,
the fault is named. docs/how-to/integrators.md describes requests, answers and checks.
"""

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pyharness.checks.check import Check, Name
from pyharness.checks.integrator_faults import OUTPUTS, State, as_output, motions
from pyharness.checks.integrator_protocol import Motion, read_motion, request
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.compare.orders import ORDER_SLACK
from pyharness.model.attitude import angle_between, product
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.scenes.moderate import KINDS, draw_moderate
from pyharness.truth.bounded import ErrorBound, bound_of
from pyharness.truth.reference import Reference, reference

LEVELS = 6
"""The number of step sizes or tolerances with which a scene is requested."""
DRAWS = 2
"""The default number of random scenes of each kind."""
_COARSEST, _PER_LEVEL = 1e-4, 0.1  # tolerances
_EACH = 2  # coarsest steps between two requested times
# An error above this many roundings, times the square root of the number of steps, is that of the
# formula.
_ROUNDINGS = 240.0
# A motion is that of a known fault if it explains all but this part of the error.
_UNEXPLAINED = 0.1
_ORDER_ONE = 1.5  # a measured order below this counts as 1
# Conserved up to rounding, in roundings a step.
_CONSERVED = 8.0
_LONG_TIME, _LONG_ROWS, _LONG_STEP, _LONG_TOLERANCE = 512.0, 64, 1.0 / 32.0, 1e-6
_NORM = 1e-3
PARTS = ("omega", "attitude")

_SLACK = Basis(
    "measured",
    "missing part of the order of convergence",
    "the slack of measured orders (`compare/orders.py`)",
)
_UNIT = Basis(
    "measured",
    "difference of the norm of a quaternion from 1",
    "far above what an integrator that does not normalise leaves (`checks/integrator.py`)",
)
_SAME = Basis(
    "derived",
    "rows that differ between two answers to one request",
    "a deterministic program gives the same answer (`checks/integrator.py`)",
)

FIRST_ORDER = {
    "first-order": "omega converges with order 1 only",
    "first-order-splitting": "omega converges with order 1 only, although the magnitude of the "
    "angular momentum is conserved: the parts of a step are composed without symmetry (first-order "
    "splitting)",
    "first-order-attitude": "the attitude converges with order 1 and omega with a higher order: the "
    "attitude advances with the omega of one end of the step (first-order splitting)",
    "torque-held": "the order is 1 under a torque that varies with time, and higher otherwise: the "
    "torque of a step is that at one end of the step",
}
"""The faults that are recognised by measured orders, each with a sentence that says what is wrong."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A random scene in which an integrator is judged; its name is as in ``wave-1``."""

    scene: Scene

    @property
    def name(self) -> str:
        """Return the name of the scene: its kind of torque, and its number."""
        return self.scene.name

    @property
    def kind(self) -> str:
        """Return the kind of the torque, a member of the kinds of `scenes.moderate`."""
        return self.scene.name.partition("-")[0]

    @cached_property
    def times(self) -> Array:
        """Return the requested times (s)."""
        steps = np.arange(_EACH, self.scene.steps + 1, _EACH)
        return self.scene.step_size * steps

    @cached_property
    def truth(self) -> Reference:
        """Return the true states at the requested times."""
        return reference(self.scene, self.times.tolist())

    @cached_property
    def bound(self) -> ErrorBound:
        """Return the proved or estimated bound of the error of the true states."""
        bound = bound_of(self.scene, self.truth, any_torque=True)
        return bound.over(float(np.abs(self.truth.omega).max()))

    def step_size(self, level: int) -> float:
        """Return the step size of a level, from 0 to `LEVELS` - 1 (s)."""
        return self.scene.step_size / 2.0**level

    def request(self, level: int) -> bytes:
        """Return the line of JSON that requests the states at a level of accuracy."""
        tolerance = _COARSEST * _PER_LEVEL**level
        return request(self.scene, self.times.tolist(), self.step_size(level), tolerance)

    def errors(self, motion: Motion) -> tuple[float, float | None]:
        """Return the errors of omega, relative to the largest, and of the attitude (rad).

        An error is infinite if a number is not finite. That of an attitude that was not computed is
        None.
        """
        assert self.truth.attitude is not None
        return errors_between(State(self.truth.omega, self.truth.attitude), motion)


def errors_between(state: State, motion: Motion) -> tuple[float, float | None]:
    """Return the errors of an answer against the states: of omega, relative, and attitude (rad).

    The result is as that of `Problem.errors`.
    """
    with np.errstate(all="ignore"):
        omega = float(np.abs(motion.omega - state.omega).max() / np.abs(state.omega).max())
        angle = None
        if motion.attitude is not None:
            angle = _finite(float(angle_between(motion.attitude, state.attitude).max()))
    return _finite(omega), angle


def _finite(x: float) -> float:
    return x if math.isfinite(x) else math.inf


@dataclass(frozen=True)
class Convergence:
    """The errors of an integrator in one problem, of omega or of the attitude, and their order.

    Attributes
    ----------
    part : str
        A member of `PARTS`.
    settings : tuple of float
        The step sizes (s) or the tolerances, from the largest to the smallest.
    errors : tuple of float
        The error for each of them.
    order : float or None
        The power of the step size, or of the tolerance, with which the error falls; None if the
        errors are rounding errors from the start.
    """

    part: str
    settings: tuple[float, ...]
    errors: tuple[float, ...]
    order: float | None

    @property
    def is_first(self) -> bool:
        """Return whether the order is 1, up to the accuracy of the measurement."""
        return self.order is not None and 1.0 - ORDER_SLACK <= self.order < _ORDER_ONE

    @property
    def is_higher(self) -> bool:
        """Return whether the order is above 1, or the errors are only rounding errors."""
        return self.order is None or self.order >= _ORDER_ONE


def convergence(
    part: str, settings: Sequence[float], errors: Sequence[float], floor: float, overall: bool
) -> Convergence:
    """Return the measured order of convergence of some errors.

    Parameters
    ----------
    part : str
        A member of `PARTS`.
    settings : sequence of float
        The step sizes (s) or the tolerances, in descending order.
    errors : sequence of float
        The error for each of them.
    floor : float
        An error that may be rounding error. Errors below it are not used.
    overall : bool
        Whether the order is that from the first to the last error above the floor, as for
        tolerances, with which errors fall irregularly. Otherwise it is that of the last pair whose
        second error is above the floor.

    Returns
    -------
    Convergence
        The order, together with the arguments.
    """
    seen = [k for k in range(1, len(errors)) if not errors[k] <= floor]
    order = None
    if seen:
        last = seen[-1]
        first = 0 if overall else last - 1
        order = _power(errors[first] / errors[last], settings[first] / settings[last])
    return Convergence(part, tuple(settings), tuple(errors), order)


def _power(errors: float, settings: float) -> float:
    """Return p if a ratio of errors is the power p of a ratio of step sizes or tolerances."""
    if math.isnan(errors) or errors <= 0.0:  # the error of the smaller step is infinite
        return 0.0
    return math.log(errors) / math.log(settings)


@dataclass(frozen=True)
class Finding:
    """A known fault that was recognised, a sentence about it, and the problems that show it."""

    name: str
    says: str
    problems: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Drift:
    """The drift of conserved quantities in a long motion without torque.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Times, s.
    energy, momentum : ndarray, shape (n,)
        Differences of energy and of the magnitude of the angular momentum from those at time 0,
        relative to these.
    direction : ndarray of shape (n,), or None
        Angle between the angular momentum in space and that at time 0 (rad); None without attitude.
    """

    times: Array
    energy: Array
    momentum: Array
    direction: Array | None

    def named(self) -> dict[str, Array]:
        """Return the quantities by name; the direction is left out if it is not known."""
        found = {"energy": self.energy, "momentum": self.momentum}
        return found if self.direction is None else {**found, "direction": self.direction}


def growth_power(times: Array, drift: Array) -> float | None:
    """Return p if the largest drift up to a time grows with its power p; None if it is rounding.

    The power is that from a quarter of the last time to the last.
    """
    quarter = times <= times[-1] / 4.0
    early, late = float(np.abs(drift[quarter]).max()), float(np.abs(drift).max())
    if not math.isfinite(late) or early <= 0.0:
        return None
    return math.log(late / early) / math.log(4.0)


@dataclass(frozen=True, eq=False)
class Judged:
    """The results of an integrator in one problem: all answers, and the measured orders."""

    problem: Problem
    answers: tuple[Motion, ...]
    convergences: tuple[Convergence, ...]

    @property
    def finest(self) -> Motion:
        """Return the answer with the smallest step size or tolerance."""
        return self.answers[-1]

    def of(self, part: str) -> Convergence | None:
        """Return the measured order of omega or of the attitude, or None if it was not computed."""
        return next((each for each in self.convergences if each.part == part), None)


@dataclass(eq=False)
class Verdict:
    """All results of the checks of an integrator, in the order in which they were made."""

    command: str
    checks: list[Check] = field(default_factory=list)
    judged: list[Judged] = field(default_factory=list)
    drift: Drift | None = None
    findings: list[Finding] = field(default_factory=list)
    control: str = ""


def problems(seed: str, draws: int, names: Sequence[str] = ()) -> list[Problem]:
    """Return the random scenes in which an integrator is judged, `draws` of each kind.

    `names` selects scenes by their names, as in ``wave-1``, or by the kind; empty selects all.
    """
    drawn = [draw_moderate(seed, kind, number) for number in range(draws) for kind in KINDS]
    return [
        Problem(scene)
        for scene in drawn
        if not names or scene.name in names or scene.name.partition("-")[0] in names
    ]


def judge_integrator(
    command: str,
    chosen: Sequence[Problem],
    again: Callable[[str], str],
    due: float = 1.0,
    told: Callable[[int, str], None] = lambda done, what: None,
    patience: float = PATIENCE,
) -> Verdict:
    """Return the results of all checks of an integrator.

    Parameters
    ----------
    command : str
        The command that starts the integrator.
    chosen : sequence of Problem
        The scenes in which it is judged.
    again : callable
        Returns the command that repeats the checks in the scene of a name.
    due : float
        The order of convergence that the integrator should have at least.
    told : callable
        Is called with the number of finished problems, and the name of the next.
    patience : float
        The longest time to wait for an answer (s).

    Returns
    -------
    Verdict
        The checks and what was measured. An invalid answer is a failed check and ends the checks.

    Raises
    ------
    InputError
        If the command is empty.
    """
    found = Verdict(command)
    where = "start"
    try:
        with PortProcess(command, patience, "--integrator") as process:

            def ask(line: bytes, rows: int) -> Motion:
                return read_motion(process.ask(line), rows)

            for done, problem in enumerate(chosen):
                where = problem.name
                told(done, where)
                judge_problem(ask, problem, due, found, again)
            where = "long"
            told(len(chosen), where)
            _judge_long(ask, chosen, found, again)
    except PortError as error:
        name = Name("integrator", where)
        found.checks.append(replace(name.judged(False, str(error)), again=again("")))
    found.findings = recognised(found.judged)
    return found


Ask = Callable[[bytes, int], Motion]


def judge_problem(
    ask: Ask, problem: Problem, due: float, found: Verdict, again: Callable[[str], str]
) -> None:
    """Add to `found` the checks of an integrator in one problem.

    `ask` sends a request of some rows, and returns the answer. The other arguments are those of
    `judge_integrator`. Raise PortError if an answer is not valid.
    """
    rows = len(problem.times)
    answers = []
    for level in range(LEVELS):
        motion = ask(problem.request(level), rows)
        if motion.refusal:
            name = Name("integrator", problem.name)
            check = name.described(None, f"refused: {motion.refusal}")
            found.checks.append(replace(check, again=again(problem.name)))
            return
        answers.append(motion)
    finest = answers[-1]
    found.control = finest.control
    by_tolerance = finest.control == "tolerance"
    settings = [
        _COARSEST * _PER_LEVEL**level if by_tolerance else problem.step_size(level)
        for level in range(LEVELS)
    ]
    steps = problem.times[-1] / problem.step_size(LEVELS - 1)
    floor = _ROUNDINGS * finest.rounding * math.sqrt(steps)
    errors = [problem.errors(motion) for motion in answers]
    judged = []
    for k, part in enumerate(PARTS):
        values = [each[k] for each in errors]
        if any(value is None for value in values):
            continue
        known = [math.inf if value is None else value for value in values]
        judged.append(convergence(part, settings, known, floor, by_tolerance))
    found.judged.append(Judged(problem, tuple(answers), tuple(judged)))
    wanted = 1.0 if by_tolerance else due
    checks = [_order_check(each, problem, wanted, floor) for each in judged]
    if finest.attitude is not None:
        name = Name("integrator", "norm", problem.name)
        checks.append(name.bounded(finest.norm, _NORM, _UNIT))
    if problem is found.judged[0].problem:
        checks += [_repeated(ask, found.judged[0]), *_returned(ask, found.judged[0])]
    found.checks += [
        replace(check, again=again(problem.name), reference_bound=lambda: problem.bound)
        for check in checks
    ]


def _order_check(each: Convergence, problem: Problem, due: float, floor: float) -> Check:
    name = Name("integrator", each.part, problem.name, quantity="order")
    unit = "" if each.part == "omega" else " rad"
    note = f"error {each.errors[-1]:.1e}{unit}"
    if each.order is None:
        return name.judged(True, f"{note}, rounding from the start", None, ORDER_SLACK, _SLACK)
    missing = due - each.order
    settled = each.errors[-1] <= floor or missing <= ORDER_SLACK
    note = f"order {each.order:.2f}, {note}"
    return name.judged(settled, note, max(missing, -99.0), ORDER_SLACK, _SLACK)


def _repeated(ask: Ask, judged: Judged) -> Check:
    """Return the check that the same request has the same answer, to the last bit."""
    problem, level = judged.problem, LEVELS // 2
    motion, before = ask(problem.request(level), len(problem.times)), judged.answers[level]
    pairs = [(motion.omega, before.omega)]
    if motion.attitude is not None and before.attitude is not None:
        pairs.append((motion.attitude, before.attitude))
    differs = np.zeros(len(problem.times), bool)
    for one, other in pairs:
        if one.shape != other.shape:
            differs[:] = True
        else:
            differs |= ~((one == other) | (np.isnan(one) & np.isnan(other))).all(axis=1)
    return Name("integrator", "repeated", problem.name).bounded(float(differs.sum()), 0.0, _SAME)


def _returned(ask: Ask, judged: Judged) -> list[Check]:
    """Return how far the body is from its initial state after it went forth and back.

    Without torque, a motion with the opposite omega is that with the opposite time.
    """
    problem, level = judged.problem, LEVELS // 2
    forth = judged.answers[level]
    if not problem.scene.torque.is_zero or forth.attitude is None:
        return []
    if not (np.isfinite(forth.omega[-1]).all() and np.isfinite(forth.attitude[-1]).all()):
        return []
    x, y, z = (-forth.omega[-1]).tolist()
    a, b, c, d = forth.attitude[-1].tolist()
    scene = replace(problem.scene, omega=(x, y, z), attitude=(a, b, c, d))
    times = problem.times.tolist()
    tolerance = _COARSEST * _PER_LEVEL**level
    back = ask(request(scene, times, problem.step_size(level), tolerance), len(times))
    name = Name("integrator", "return", problem.name)
    if back.refusal or back.attitude is None:
        return [name.described(None, f"refused: {back.refusal or 'no attitude'}")]
    start = np.array(problem.scene.omega)
    omega = _finite(float(np.abs(back.omega[-1] + start).max() / np.abs(start).max()))
    attitude = np.array([problem.scene.attitude])
    angle = float(angle_between(back.attitude[-1:], attitude)[0])
    error = max(omega, angle)
    there = max(x for x in problem.errors(forth) if x is not None)
    limit = _CONSERVED * forth.rounding * (problem.times[-1] / problem.step_size(level))
    kept = "the integrator is reversible" if error <= max(limit, 1e-3 * there) else "not reversible"
    return [name.described(error if math.isfinite(error) else None, kept)]


def _judge_long(
    ask: Ask, chosen: Sequence[Problem], found: Verdict, again: Callable[[str], str]
) -> None:
    """Add the drift of energy and angular momentum in a long motion without torque."""
    free = next((each for each in chosen if each.scene.torque.is_zero), None)
    if free is None or not any(each.problem is free for each in found.judged):
        return
    times = (np.arange(1, _LONG_ROWS + 1) * (_LONG_TIME / _LONG_ROWS)).tolist()
    motion = ask(request(free.scene, times, _LONG_STEP, _LONG_TOLERANCE), len(times))
    if motion.refusal:
        return
    found.drift = drift_of(free.scene, np.array(times), motion)
    for quantity, values in found.drift.named().items():
        name = Name("integrator", quantity, free.name, quantity="drift")
        largest = float(np.abs(values).max())
        power = growth_power(found.drift.times, values)
        note = "" if power is None else f"grows with the power {power:.1f} of the time"
        check = name.described(largest if math.isfinite(largest) else None, note)
        found.checks.append(replace(check, again=again(free.name)))


def drift_of(scene: Scene, times: Array, motion: Motion) -> Drift:
    """Return the drift of the conserved quantities of a motion without torque.

    `times` (s) are those of the rows of `motion`.
    """
    moments = np.array(scene.moments)
    with np.errstate(all="ignore"):
        energies = (moments * motion.omega**2).sum(axis=1)
        lengths = np.linalg.norm(moments * motion.omega, axis=1)
        first = moments * np.array(scene.omega)
        energy = energies / (first @ np.array(scene.omega)) - 1.0
        momentum = lengths / np.linalg.norm(first) - 1.0
        direction = None
        if motion.attitude is not None:
            start = _in_space(np.array([scene.attitude]), first[None, :])[0]
            there = _in_space(motion.attitude, moments * motion.omega)
            sine = np.linalg.norm(np.cross(there, start), axis=1)
            direction = np.arctan2(sine, there @ start)
    return Drift(times, energy, momentum, direction)


def _in_space(attitude: Array, vectors: Array) -> Array:
    """Return vectors about the body axes as vectors about the axes of space, shape (n, 3)."""
    q = attitude.T
    turned = product(product(q, (np.zeros(len(vectors)), *vectors.T)), (q[0], *-q[1:]))
    return np.array(turned[1:]).T


def recognised(results: Sequence[Judged]) -> list[Finding]:
    """Return the known faults that explain the errors of an integrator, those of most problems first.

    A fault explains the errors in a problem if its motion leaves at most a tenth of them. In the
    problems that no such fault explains, the orders of convergence are interpreted.
    """
    names: dict[str, tuple[str, list[str]]] = {}

    def add(name: str, says: str, problem: str) -> None:
        names.setdefault(name, (says, []))[1].append(problem)

    rest = []
    for judged in results:
        found = _explained(judged)
        for name, says in found:
            add(name, says, judged.problem.name)
        if not found:
            rest.append(judged)
    for name, problem in _by_orders(rest):
        add(name, FIRST_ORDER[name], problem)
    listed = [Finding(name, says, tuple(where)) for name, (says, where) in names.items()]
    return sorted(listed, key=lambda each: -len(each.problems))


def _explained(judged: Judged) -> list[tuple[str, str]]:
    """Return names and sentences of the faults that explain the errors in one problem."""
    if all(each.is_higher for each in judged.convergences):
        return []
    problem, motion = judged.problem, judged.finest
    errors = [x for x in problem.errors(motion) if x is not None]
    known = list(motions(problem.scene, problem.times, problem.step_size(LEVELS - 1)))
    scores = []
    for fault, state in known:
        left = [x for x in errors_between(state, motion) if x is not None]
        scores.append((max(left), fault, left, state))
    worst, fault, left, _ = min(scores, key=lambda each: each[0])
    if worst <= _UNEXPLAINED * max(errors):
        return [(fault.name, fault.says)]
    # One fault of omega, and one of the attitude that is given out.
    omega_is_right = judged.convergences[0].is_higher
    assert problem.truth.attitude is not None
    true = State(problem.truth.omega, problem.truth.attitude)
    _, first, left, state = min(scores, key=lambda each: each[2][0])
    named = []
    if not omega_is_right:
        if left[0] > _UNEXPLAINED * errors[0]:
            return []
        named.append((first.name, first.says))
    if motion.attitude is not None:
        base = true if omega_is_right else state
        for name in OUTPUTS:
            other = State(base.omega, as_output(name, base.attitude, problem.scene))
            angle = errors_between(other, motion)[1]
            if angle is not None and angle <= _UNEXPLAINED * errors[1]:
                named.append((name, next(f.says for f, _ in known if f.name == name)))
    return named


def _by_orders(results: Sequence[Judged]) -> list[tuple[str, str]]:
    """Return pairs of a fault in `FIRST_ORDER` and the name of a problem whose orders show it."""
    found = []
    calm_is_higher = any(
        each.convergences[0].is_higher for each in results if each.problem.kind != "wave"
    )
    for judged in results:
        omega, attitude = judged.of("omega"), judged.of("attitude")
        if judged.finest.control == "tolerance" or omega is None:
            continue
        name = ""
        if omega.is_first:
            name = "first-order-splitting" if _conserves_momentum(results) else "first-order"
            if judged.problem.kind == "wave" and calm_is_higher:
                name = "torque-held"
        elif omega.is_higher and attitude is not None and attitude.is_first:
            name = "first-order-attitude"
        if name:
            found.append((name, judged.problem.name))
    return found


def _conserves_momentum(results: Sequence[Judged]) -> bool:
    """Return whether |L| is constant, up to rounding, in all problems without torque."""
    free = [each for each in results if each.problem.scene.torque.is_zero]
    for judged in free:
        problem, motion = judged.problem, judged.finest
        steps = problem.times[-1] / problem.step_size(LEVELS - 1)
        drift = np.abs(drift_of(problem.scene, problem.times, motion).momentum).max()
        if not drift <= _CONSERVED * motion.rounding * steps:
            return False
    return bool(free)


def replay_command(command: str, seed: str, draws: int, name: str = "") -> str:
    """Return the command that repeats the checks of an integrator in one problem or in all."""
    verb = f"python -m pyharness verify --integrator {shlex.quote(command)}"
    where = f" --cell {name}" if name else ""
    return f"{verb} --seed {shlex.quote(seed)} --draws {draws}{where}"

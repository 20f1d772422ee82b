"""Checks of a rigid-body integrator in any language against the true solution.

Errors are measured in random scenes with decreasing steps or tolerances. If results converge to the
motion of a known fault, the report names it (docs/how-to/integrators.md).
"""

import math
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from pyharness.checks.check import Check, Name
from pyharness.checks.compare.orders import ORDER_SLACK
from pyharness.checks.integrators.coverage import Tried
from pyharness.checks.integrators.faults import true_motion
from pyharness.checks.integrators.problem import (
    CHANGE,
    LEVELS,
    PARTS,
    Convergence,
    Drift,
    Judged,
    Problem,
    convergence,
    drift_of,
    growth_power,
    long_motion,
)
from pyharness.checks.integrators.protocol import Ask, asking_of
from pyharness.checks.integrators.recognition import FIRST_ORDER, UNKNOWN, Finding, recognised
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.model.attitude import angle_between
from pyharness.model.basis import Basis
from pyharness.model.trajectory import Array

_CONSERVED = 8.0  # most rounding errors per step of a reversible integrator
_NORM = 1e-3

_SLACK = Basis(
    "measured",
    "missing part of the order of convergence",
    "the slack of measured orders (`compare/orders.py`)",
)
_UNIT = Basis(
    "measured",
    "difference of the norm of a quaternion from 1: 0.001, or the error of the attitude (rad)",
    "an integrator that does not normalise has a smaller error of the norm than of the angle "
    "(`checks/integrators/judging.py`)",
)
_SAME = Basis(
    "derived",
    "rows that differ between two answers to one request",
    "a deterministic program gives the same answer (`checks/integrators/judging.py`)",
)


_FINITE = Basis(
    "derived",
    "rows with a number that is not finite",
    "the true motion is finite; with a large step the measured order may predict an overflow "
    "(`checks/integrators/problem.py`)",
)


@dataclass(eq=False)
class Verdict:
    command: str
    again: Callable[[str], str] = lambda name: ""  # returns the command to repeat a scene's checks
    checks: list[Check] = field(default_factory=list)
    judged: list[Judged] = field(default_factory=list)
    tried: list[Tried] = field(default_factory=list)
    drift: Drift | None = None
    findings: list[Finding] = field(default_factory=list)
    begin: float = field(default_factory=time.perf_counter)  # start (s) of the next checks

    @property
    def control(self) -> str:
        """The request field that sets the accuracy, or "" without answers."""
        return self.judged[-1].finest.control if self.judged else ""

    def add(self, scene: str, *checks: Check) -> None:
        # The first of several checks gets the time of all.
        now = time.perf_counter()
        times = [now - self.begin, *[0.0] * len(checks)]
        self.begin = now
        again = self.again(scene)
        pairs = zip(checks, times, strict=False)
        self.checks += [replace(check, again=again, took=each) for check, each in pairs]


def judge_integrator(
    command: str,
    chosen: Sequence[Problem],
    again: Callable[[str], str],  # returns the command that repeats a scene's checks
    due: float = 1.0,  # required order of convergence
    # Receives the number of finished problems and the next problem's name.
    told: Callable[[int, str], None] = lambda done, what: None,
) -> Verdict:
    """Return the results of all checks of the integrator that `command` starts.

    An invalid answer ends the checks.
    """
    found = Verdict(command, again)
    where = "start"
    try:
        with PortProcess(command, PATIENCE, "--integrator") as process:
            ask = asking_of(process)
            for done, problem in enumerate(chosen):
                where = problem.name
                told(done, where)
                judge_problem(ask, problem, due, found)
            where = "long"
            told(len(chosen), where)
            _judge_long(ask, found)
    except PortError as error:
        found.add("", Name("integrator", where).judged(False, str(error)))
    if all(check.passed for check in found.checks) and not found.judged:
        name = Name("integrator", "judged")
        found.add("", name.judged(False, "the integrator refused every scene"))
    found.findings = recognised(found.judged)
    for each in found.findings:
        name = Name("integrator", "fault", each.name)
        # Whether order 1 is too low, the checks of the order decide.
        found.add("", name.judged(each.name in FIRST_ORDER, each.text))
    if found.judged and (unexplained := _unexplained(found)):
        says = "no known fault explains the failed checks"
        found.findings.append(Finding(UNKNOWN, says, unexplained))
    return found


def _unexplained(found: Verdict) -> tuple[str, ...]:
    """Return the problems with failed checks that no recognised fault explains."""
    # A fault also explains an overflow of its motion and, if it lowers the order, a low order.
    faults = {x.name: x.problems for x in found.findings if x.name not in FIRST_ORDER}
    explained = {*chain.from_iterable(faults.values()), *(["long"] if faults else [])}
    remarked = {problem for each in found.findings for problem in each.problems}
    low = set()
    for judged in found.judged:
        problem = judged.problem
        states = [state for fault, state in problem.faulty if fault.name in faults]
        if not all(np.isfinite(each.omega).all() for each in states):
            explained.add(problem.name)
        if problem.name in remarked:
            low |= {(each.part, problem.name) for each in judged.convergences if each.converges}
    failed = [check.name for check in found.checks if not check.passed]
    due = [x for x in failed if x.subject != "fault" and (x.subject, x.circumstance) not in low]
    where = dict.fromkeys(each.circumstance or each.subject for each in due)
    return tuple(each for each in where if each not in explained)


def judge_problem(ask: Ask, problem: Problem, due: float, found: Verdict) -> None:
    """Append one problem's checks to `found`; raise PortError for an invalid answer."""
    answers = []
    for level in range(LEVELS):
        motion = ask(problem.request(level), len(problem.times))
        if motion.refusal:
            name = Name("integrator", problem.name)
            found.add(problem.name, name.described(None, f"refused: {motion.refusal}"))
            return
        answers.append(motion)
    finest = answers[-1]
    if len({each.attitude is None for each in answers}) > 1:
        raise PortError("only some of the answers in a scene have an attitude")
    by_tolerance = finest.control == "tolerance"
    settings = [*map(problem.tolerance if by_tolerance else problem.step_size, range(LEVELS))]
    truth = problem.truth.omega
    found.tried.append(Tried(problem.scene, problem.times, truth, settings, finest))
    floor = problem.floor(finest.rounding)
    parts = []
    errors = zip(*(problem.errors(motion) for motion in answers), strict=True)
    for part, values in zip(PARTS, errors, strict=True):
        known = [value for value in values if value is not None]
        if known:
            parts.append(convergence(part, settings, known, floor, by_tolerance))
    judged = Judged(problem, tuple(answers), tuple(parts))
    found.judged.append(judged)
    wanted = 1.0 if by_tolerance else due
    checks = [Name("integrator", "finite", problem.name).bounded(judged.lost, 0.0, _FINITE)]
    orders = [_order_check(each, problem, wanted, floor) for each in parts]
    checks += [replace(each, reference_bound=lambda: problem.bound) for each in orders]
    if finest.attitude is not None:
        name = Name("integrator", "norm", problem.name)
        angle = parts[1].errors[-1]
        limit = max(_NORM, angle) if math.isfinite(angle) else _NORM
        checks.append(name.bounded(finest.norm, limit, _UNIT))
    if judged is found.judged[0]:
        checks += [_repeated(ask, judged), *_returned(ask, judged)]
    found.add(problem.name, *checks)


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
    problem, level = judged.problem, LEVELS // 2
    motion, before = ask(problem.request(level), len(problem.times)), judged.answers[level]
    if motion.refusal or (motion.attitude is None) != (before.attitude is None):
        raise PortError("a repeated request has an answer of another form")
    differs = ~_same(motion.omega, before.omega)
    if motion.attitude is not None and before.attitude is not None:
        one, other = motion.attitude, before.attitude
        differs |= ~(_same(one, other) | _same(one, -other))
    return Name("integrator", "repeated", problem.name).bounded(float(differs.sum()), 0.0, _SAME)


def _same(one: Array, other: Array) -> Any:
    return ((one == other) | (np.isnan(one) & np.isnan(other))).all(axis=1)


def _returned(ask: Ask, judged: Judged) -> list[Check]:
    """Return the check that a free body returns to its initial state after omega is reversed."""
    problem, level = judged.problem, LEVELS // 2
    forth = judged.answers[level]
    if not problem.scene.torque.is_zero or forth.attitude is None:
        return []
    if not np.isfinite([*forth.omega[-1], *forth.attitude[-1]]).all():
        return []
    scene = replace(problem.scene, omega=-forth.omega[-1], attitude=forth.attitude[-1])
    back = ask(problem.request(level, scene), len(problem.times))
    name = Name("integrator", "return", problem.name)
    if back.refusal or back.attitude is None:
        return [name.described(None, f"refused: {back.refusal or 'no attitude'}")]
    if back.lost:
        return [name.bounded(back.lost, 0.0, _FINITE)]
    start = np.array(problem.scene.omega)
    omega = float(np.abs(back.omega[-1] + start).max() / np.abs(start).max())
    angles = angle_between(back.attitude[-1:], np.array([problem.scene.attitude]))
    error = max(omega, float(angles[0]))
    there = max(x for x in problem.errors(forth) if x is not None)
    limit = _CONSERVED * forth.rounding * (problem.times[-1] / problem.step_size(level))
    kept = "the integrator is reversible" if error <= max(limit, 1e-3 * there) else "not reversible"
    return [name.described(error, kept)]


def _judge_long(ask: Ask, found: Verdict) -> None:
    free = next((each for each in found.judged if each.problem.scene.torque.is_zero), None)
    if free is None:
        return
    problem = free.problem
    level, times, limit = long_motion(free)
    motion = ask(problem.request(level, times=times), len(times))
    if motion.refusal:
        told = Name("integrator", "long").described(None, f"refused: {motion.refusal}")
        found.add(problem.name, told)
        return
    setting = (problem.tolerance if motion.control == "tolerance" else problem.step_size)(level)
    truth = true_motion(problem.scene, times).omega
    found.tried.append(Tried(problem.scene, times, truth, [setting], motion))
    found.drift = drift_of(problem.scene, times, motion)
    checks = [Name("integrator", "finite", "long").bounded(motion.lost, 0.0, _FINITE)]
    change = Name("integrator", "conserved", "long")
    if limit is None:
        checks.append(change.described(None, "no limit: the errors of the short motion are large"))
    else:
        checks.append(change.bounded(found.drift.change, limit, CHANGE))
    for quantity, values in found.drift.named.items():
        name = Name("integrator", quantity, problem.name, quantity="drift")
        largest, power = float(np.abs(values).max()), growth_power(times, values)
        note = "" if power is None else f"grows with the power {power:.1f} of the time"
        checks.append(name.described(largest if math.isfinite(largest) else None, note))
    found.add(problem.name, *checks)


def replay_command(command: str, seed: str, draws: int, name: str = "") -> str:
    verb = f"python -m pyharness verify --integrator {shlex.quote(command)}"
    where = f" --cell {name}" if name else ""
    return f"{verb} --seed {shlex.quote(seed)} --draws {draws}{where}"

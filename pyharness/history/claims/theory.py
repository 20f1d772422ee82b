"""Tests of the thesis's claims about history, theory and orders.

Arguments and verdicts are as in `verdicts`, errors as in `rules`. `limit` is the largest allowed
error divided by the largest omega.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.checks.theory.rotations import steady_rotations
from pyharness.engine.methods.linearised import jacobians
from pyharness.engine.solve import solve
from pyharness.history.claims.laboratory import Laboratory, distance, largest
from pyharness.history.claims.verdicts import FALSE, REPRODUCED, Judged, graded
from pyharness.history.family import Member, run
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Array
from pyharness.thesis.cards import deck
from pyharness.truth.reference import reference

Weights = Sequence[Callable[[Array], Any]]


def known_in_closed_form(lab: Laboratory, cases: list[int], limit: float) -> Judged:
    """Judge whether the solutions of `cases` are unknown; closed forms refute the claim."""
    numbers = {}
    for case in cases:
        scene, truth = lab.scene(case), lab.truth(case)
        found = solve(scene, truth.time, method="closed-form")
        share = distance(found.omega, truth.omega) / largest(truth)
        numbers[f"case {case}: closed form against the reference"] = share
    known = max(numbers.values()) <= limit
    return graded(numbers, not known, otherwise=FALSE)


def by_sources(lab: Laboratory, holds: bool) -> Judged:
    """Return the verdict on a historical statement, which holds if sources support it."""
    return Judged(REPRODUCED if holds else FALSE, {})


def hamilton_ordinary(lab: Laboratory, cases: list[int], limit: float) -> Judged:
    """Judge whether Hamilton's equations are partial differential equations.

    The claim is false if ordinary equations reproduce omega within `limit`.
    """
    from scipy.integrate import solve_ivp

    (case,) = cases
    scene, truth = lab.scene(case), lab.truth(case)
    assert scene.moments is not None
    moments = scene.moments
    # 3-1-3 Euler angles (rad), far from the singularity.
    begin = (0.3, 1.1, -0.4)
    momenta = _angle_rates_to_omega(begin).T @ (np.array(moments) * scene.omega)
    found = solve_ivp(
        lambda t, y: _hamilton(moments, y), (0.0, float(truth.time[-1])), [*begin, *momenta],
        method="DOP853", t_eval=truth.time, rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    omega = np.array([_omega(moments, y) for y in found.y.T])
    share = distance(omega, truth.omega) / largest(truth)
    numbers = {"six ordinary equations against the reference": share}
    return graded(numbers, share > limit, otherwise=FALSE)


def _angle_rates_to_omega(angles: Sequence[float] | Array) -> Array:
    _, theta, psi = angles
    sin, cos = math.sin, math.cos
    first = [sin(theta) * sin(psi), cos(psi), 0.0]
    second = [sin(theta) * cos(psi), -sin(psi), 0.0]
    return np.array([first, second, [cos(theta), 0.0, 1.0]])


def _omega(moments: Triple, state: Array) -> Array:
    """Return omega (rad/s) from a state: 3-1-3 Euler angles (rad) and their conjugate momenta."""
    momentum = np.linalg.solve(_angle_rates_to_omega(state[:3]).T, np.asarray(state[3:]))
    return np.asarray(momentum / np.array(moments))


def _hamilton(moments: Triple, state: Array) -> Array:
    """Return dH/dp and -dH/dq of H = sum I omega**2 / 2, with q and p as in `_omega`."""
    theta, psi = float(state[1]), float(state[2])
    sin_theta, cos_theta = math.sin(theta), math.cos(theta)
    sin_psi, cos_psi = math.sin(psi), math.cos(psi)
    omega = _omega(moments, state)
    rates = np.linalg.solve(_angle_rates_to_omega(state[:3]), omega)
    momentum = omega * moments
    # dH/dq at constant p is -L . (dM/dq) rates, where the matrix M takes the rates to omega.
    by_theta, by_psi = np.zeros((3, 3)), np.zeros((3, 3))
    by_theta[:, 0] = cos_theta * sin_psi, cos_theta * cos_psi, -sin_theta
    by_psi[:2, :2] = [[sin_theta * cos_psi, -sin_psi], [-sin_theta * sin_psi, -cos_psi]]
    forces = [0.0, momentum @ by_theta @ rates, momentum @ by_psi @ rates]
    return np.array([*rates, *forces])


def bounded_not_lipschitz(lab: Laboratory, decades: float, above: float) -> Judged:
    """Judge whether every bounded function satisfies a Lipschitz condition.

    The claim is false if a difference quotient of the square root exceeds `above`.
    """
    points = 10.0 ** -np.arange(2.0, decades + 1.0, 2.0)
    quotients = (np.sqrt(2.0 * points) - np.sqrt(points)) / points
    numbers = {"bound of the function": 1.0, "largest quotient": float(quotients.max())}
    return graded(numbers, bool(quotients.max() <= above), otherwise=FALSE)


def local_error(
    lab: Laboratory, cases: list[int], method: str, power: float, within: float
) -> Judged:
    """Judge whether the error of a step of size h is O(h**p), with p = `power`."""
    stepped = partial(_stepped, method=method)
    numbers = {f"case {n}: power of the step": _power(lab.scene(n), stepped) for n in cases}
    near = [abs(each - power) <= within for each in numbers.values()]
    return graded(numbers, all(near), any(near))


def same_as_taylor(lab: Laboratory, cases: list[int], within: float) -> Judged:
    """Judge whether Runge-Kutta and the Taylor series up to h**4 are the same method."""
    numbers, same, near = {}, True, True
    for case in cases:
        scene = lab.scene(case)
        step = replace(scene, steps=1)
        kutta = _stepped(step, "rk4")
        series = _taylor_step(step, 4)
        truth = reference(step, step.times()).omega[-1]
        apart, error = float(np.abs(kutta - series).max()), float(np.abs(series - truth).max())
        power = _power(scene, lambda each: _stepped(each, "rk4"), lambda s: _taylor_step(s, 4))
        numbers[f"case {case}: distance over the error of the series"] = apart / error
        numbers[f"case {case}: power of the step of the distance"] = power
        same &= apart <= 1e-14 * float(np.abs(truth).max())
        # Reproduced in part if the results of a step differ by O(h**5).
        near &= abs(power - 5.0) <= within
    return graded(numbers, same, near)


def _stepped(scene: Scene, method: str) -> Array:
    return np.asarray(solve(scene, scene.times(), method).omega[-1])


def _power(
    scene: Scene, method: Callable[[Scene], Array], truth: Callable[[Scene], Array] | None = None
) -> float:
    """Return p if a method's error in a step of size h is O(h**p)."""
    apart = []
    for step_size in (scene.step_size, scene.step_size / 2.0):
        short = replace(scene, step_size=step_size, steps=1)
        exact = reference(short, short.times()).omega[-1] if truth is None else truth(short)
        apart.append(float(np.linalg.norm(method(short) - exact)))
    return math.log2(apart[0] / apart[1])


def _taylor_step(scene: Scene, order: int) -> Array:
    """Return omega (rad/s) after a Taylor step, up to h**order, under constant torque."""
    coefficients = np.array(scene.euler_coefficients)
    torque = np.array(scene.normalized_torque(0.0))
    terms = [np.array(scene.omega)]
    for n in range(order):
        product = np.zeros(3)
        for k in range(n + 1):
            x, y = terms[k], terms[n - k]
            product += [x[1] * y[2], x[0] * y[2], x[0] * y[1]]
        terms.append((coefficients * product + (torque if n == 0 else 0.0)) / (n + 1))
    powers = scene.step_size ** np.arange(len(terms))
    return np.asarray(powers @ np.array(terms))


def crandall_example(lab: Laboratory, best: list[str], rate: float) -> Judged:
    """Judge whether four weightings are better than the Taylor series in Crandall's example.

    `best` names the two that must be most accurate.
    """
    # The example is dx/dt = rate x, x(0) = 1 on (0, 1), with the trial function 1 + c1 t + c2 t**2.
    t, weight = np.polynomial.legendre.leggauss(12)
    t, weight = (t + 1.0) / 2.0, weight / 2.0
    # The residual is -rate + c1 r1 + c2 r2; the columns of `rows` are for r1, r2 and rate.
    factors: Weights = (lambda s: 1 - rate * s, lambda s: 2 * s - rate * s**2)
    weighted = partial(_weighted, t, weight, factors, rate)
    points = np.array([1.0, 2.0]) / 3.0
    rows = {
        "collocation": np.array([[*(r(s) for r in factors), rate] for s in points]),
        "subdomain": weighted((lambda s: s < 0.5, lambda s: s >= 0.5)),
        "galerkin": weighted((lambda s: s, lambda s: s**2)),
        "least squares": weighted(factors),
    }
    fine = np.linspace(0.0, 1.0, 201)
    numbers = {}
    for name, row in rows.items():
        c1, c2 = np.linalg.solve(row[:, :2], row[:, 2])
        numbers[f"{name}: largest error"] = float(
            np.abs(1.0 + c1 * fine + c2 * fine**2 - np.exp(rate * fine)).max()
        )
    taylor = 1.0 + rate * fine + (rate * fine) ** 2 / 2.0
    series = float(np.abs(taylor - np.exp(rate * fine)).max())
    better = all(error < series / 2.0 for error in numbers.values())
    two = {name.partition(":")[0] for name in sorted(numbers, key=lambda n: numbers[n])[:2]}
    numbers["Taylor series: largest error"] = series
    return graded(numbers, better and two == set(best), better)


def _weighted(t: Array, weight: Array, factors: Weights, rate: float, by: Weights) -> Array:
    """Return the integrals of `factors` and `rate`, a row for each weight function in `by`."""
    halves = [(t / 2.0, weight / 2.0), ((t + 1.0) / 2.0, weight / 2.0)]
    rows = []
    for function in by:
        row = np.zeros(3)
        for s, w in halves:
            factor = w * function(s)
            row += [*((factor * r(s)).sum() for r in factors), rate * factor.sum()]
        rows.append(row)
    return np.array(rows)


def rates_tell_growth(lab: Laboratory, cases: list[int], within: float) -> Judged:
    """Judge whether perturbations of steady rotations grow at the rates Re Q (1/s) of eq. 32."""
    numbers, told = {}, True
    for case in cases:
        scene = lab.scene(case)
        for each in steady_rotations(scene, 1e-8).rotations:
            disturbance = 1e-8 * math.hypot(*each.omega) * np.array([0.6, 0.5, 0.4])
            start = tuple((each.omega + disturbance).tolist())
            rate = each.rates[0].real
            # At these times the decaying part has vanished, and the growing part is still small.
            steady = np.linspace(0.1, 10.0, 100) * (each.period or 1.0)
            times = np.array([8.0, 10.0]) / rate if rate else steady
            found = solve(replace(scene, omega=start), times, tolerance=1e-14).omega - each.omega
            sizes = np.linalg.norm(found, axis=1)
            name = f"case {case}, {each.place}"
            if rate:
                measured = math.log(sizes[1] / sizes[0]) / (times[1] - times[0]) / rate
                numbers[f"{name}: growth over Re Q"] = measured
                told &= abs(measured - 1.0) <= within
            else:
                # Without growth, the perturbation may become ten times as large in ten periods.
                largest_size = float(sizes.max() / np.linalg.norm(disturbance))
                numbers[f"{name}: largest disturbance over the first"] = largest_size
                told &= largest_size <= 10.0
    return graded(numbers, told, otherwise=FALSE)


def trial_form_solves(lab: Laboratory, cases: list[int], limit: float) -> Judged:
    """Judge whether the trial solution of eq. 32 of the thesis solves a case exactly."""
    numbers = {}
    for case in cases:
        scene, truth = lab.scene(case), lab.truth(case)
        # The trial solution is a steady rotation about axis 3 plus exponentials of time.
        steady = np.array([0.0, 0.0, scene.omega[2]])
        rates, amplitudes = np.linalg.eig(jacobians(scene, steady[None])[0])
        shares = np.linalg.solve(amplitudes, scene.omega - steady)
        grown = np.exp(np.outer(truth.time, rates)) * shares
        omega = steady + (grown @ amplitudes.T).real
        share = distance(omega, truth.omega) / largest(truth)
        numbers[f"case {case}: error over the largest omega"] = share
    return graded(numbers, min(numbers.values()) <= limit)


def one_term_suffices(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge whether one-term collocation suffices for the linear equations of a sphere (Case 1)."""
    found = run(lab.scene(case), Member("collocation", 1))
    truth = lab.truth(case)
    share = distance(found.omega, truth.omega) / largest(truth)
    numbers = {"one-term error over the largest omega": share}
    return graded(numbers, share <= limit, otherwise=FALSE)


def symmetric_uncoupled(lab: Laboratory, cases: list[int]) -> Judged:
    """Judge whether Euler's equations of a symmetric body have no products of components."""
    bodies = {case: lab.scene(case).euler_coefficients for case in cases}
    left = {f"case {n}: largest coefficient": max(map(abs, x)) for n, x in bodies.items()}
    none = [each == 0.0 for each in left.values()]
    return graded(left, all(none), any(none))


def step_on_cards(lab: Laboratory, step: float) -> Judged:
    """Judge whether each of the three decks sets DT to `step` (s) before its loop."""
    cards = [card for program in PROGRAMS for card in deck(program).cards.values()]
    setting = (card for card in cards if card.statement.startswith("DT=."))
    numbers = {f"{x.program}: DT (s)": float(x.statement.partition("=")[2]) for x in setting}
    same = len(numbers) == 3 and set(numbers.values()) == {step}
    return graded(numbers, same)


def points_inside(lab: Laboratory, cases: list[int]) -> Judged:
    """Judge whether the collocation points are within the step."""
    (case,) = cases
    numbers, shares = {}, []
    for program, last in (("two-term", 2.0 / 3.0), ("four-term", 0.8)):
        run_of = lab.run(program, case)
        # The increments of TIME are the lengths DT that determine the points.
        lengths = np.diff(run_of.recorded_time, prepend=0.0)
        inside = last * lengths < lab.scene(case).step_size
        shares.append(float(inside.mean()))
        numbers[f"{program}: share of steps with all points inside"] = shares[-1]
    return graded(numbers, min(shares) == 1.0, min(shares) >= 0.5, FALSE)


def possible_bodies(lab: Laboratory, cases: list[int]) -> Judged:
    excess = {}
    for case in cases:
        first, second, third = sorted(lab.scene(case).moments or (), reverse=True)
        excess[f"case {case}: largest moment over the sum of the others"] = first / (second + third)
    possible = [each <= 1.0 for each in excess.values()]
    return graded(excess, all(possible), otherwise=FALSE)

"""The stop test of the Runge-Kutta program, against eq. 19 worked out anew along its own run.

Both languages could test the wrong thing alike: here all steps are done at once, with the stages
of the textbook, and what no two spellings of them can agree on is granted to rounding.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pyharness.cells import listing_name, subsets
from pyharness.checks import Check, bounded
from pyharness.facts import facts
from pyharness.listing import Listing, corrected, names_of
from pyharness.methods import PROGRAM_REGISTRY
from pyharness.scene import Scene
from pyharness.scene_file import case_numbers, case_scene
from pyharness.selection import Selection, replay
from pyharness.trajectory import STOP_VARIABLES, Array, Stop, Trajectory

_PROGRAM = "runge-kutta"
_FLAGS = tuple(name for name in names_of("defect", _PROGRAM) if name.startswith("lipschitz"))
# Roundings of a stage, and of the sums that it is put together from.
_ROUNDINGS = 16.0 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Changes:
    """What the test looks at, in each step; columns are U1 ... U3, V1 ... V3.

    Attributes
    ----------
    k, u : ndarray, shape (n, 6)
        Of the right-hand sides, and of the unknowns.
    k_size, u_size : ndarray, shape (n, 6)
        The sum of what each is the difference of, to which rounding is relative.
    """

    k: Array
    u: Array
    k_size: Array
    u_size: Array


def stops(chosen: Selection) -> Iterator[Check]:
    """Hold where the program stops, why and at which quotient against the formula.

    With every way of testing that a listing can have, and four constants: the deck's, and one by
    which it stops at the first step, at the largest quotient, and never.
    """
    program = PROGRAM_REGISTRY[_PROGRAM]
    for case in (3,) if chosen.thin else case_numbers():
        scene = case_scene(case)
        if not chosen.may_ask(f"stops/case-{case}"):
            continue
        run = program.run(scene, corrected(_PROGRAM), may_stop=False)
        if run.velocity is None or run.steps != scene.steps:
            id, note = f"stops/case-{case}", f"{run.ended} after {run.steps} steps, or no velocity"
            yield Check(id, False, None, None, replay(id), note)
            continue
        for defects in subsets(_FLAGS):
            listing = Listing(_PROGRAM, defects)
            name = f"stops/case-{case}/{listing_name(listing)}"
            if not chosen.may_ask(name):
                continue
            quotients, errors, names = _quotients(changes(scene, run, listing), listing)
            for which, constant in _constants(quotients).items():
                id = f"{name}/{which}"
                if chosen.asks(id):
                    found = program.run(scene, listing, lipschitz=constant)
                    due = _due(quotients, names, constant)
                    yield _held(id, found, due, quotients, errors, names)


def changes(scene: Scene, run: Trajectory, listing: Listing) -> Changes:
    """Work out the stages of every step from the state before it (W. Kutta, 1901).

    Parameters
    ----------
    run : Trajectory
        Of the mended program to the end, with velocity.
    listing : Listing
        Says which change of U belongs to that of K.
    """
    assert run.velocity is not None
    h = scene.step_size
    time = h * np.arange(run.steps, dtype=np.float64)
    rows = np.hstack([run.omega, run.velocity])
    before = np.vstack([[*scene.omega, 0.0, 0.0, 0.0], rows[:-1]])
    first, first_size = _right_hand_sides(scene, time, before)
    second, _ = _right_hand_sides(scene, time + 0.5 * h, before + 0.5 * h * first)
    third, _ = _right_hand_sides(scene, time + 0.5 * h, before + 0.5 * h * second)
    end = before + h * third
    fourth, fourth_size = _right_hand_sides(scene, time + h, end)
    after = rows if listing.has("lipschitz-mismatched-pairs") else end
    return Changes(
        np.abs(fourth - first),
        np.abs(after - before),
        first_size + fourth_size,
        np.abs(before) + np.abs(after),
    )


def _right_hand_sides(scene: Scene, time: Array, state: Array) -> tuple[Array, Array]:
    """Return dU/dt and dV/dt in every row, and the sum of the sizes of their terms."""
    omega, velocity = state[:, :3], state[:, 3:]
    torque = np.array([scene.normalized_torque(t) for t in time])
    products = scene.euler_coefficients * omega[:, [1, 2, 0]] * omega[:, [2, 0, 1]]
    pull = np.divide(scene.forces, scene.masses)
    turned = np.cross(velocity, omega)
    rates = np.hstack([torque + products, pull + turned])
    crossed = np.abs(velocity)[:, [1, 2, 0]] * np.abs(omega)[:, [2, 0, 1]]
    crossed += np.abs(velocity)[:, [2, 0, 1]] * np.abs(omega)[:, [1, 2, 0]]
    return rates, np.hstack([np.abs(torque) + np.abs(products), np.abs(pull) + crossed])


def _quotients(change: Changes, listing: Listing) -> tuple[Array, Array, list[str]]:
    """Return the quotients, how far rounding moves them, and what they are called.

    One column for each quotient of a step, in the order in which the program looks.
    """
    counts_velocity = listing.has("lipschitz-tests-velocity")
    columns = [3, 4, 5, 0, 1, 2] if counts_velocity else [0, 1, 2]
    k, u = change.k[:, columns], change.u[:, columns]
    k_error, u_error = (_ROUNDINGS * size[:, columns] for size in (change.k_size, change.u_size))
    if listing.has("lipschitz-per-component"):
        names = [STOP_VARIABLES[column] for column in columns]
    else:
        names = ["UV" if counts_velocity else "U"]
        k, u, k_error, u_error = (
            np.linalg.norm(each, axis=1, keepdims=True) for each in (k, u, k_error, u_error)
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        # 0 over 0 stops nothing.
        quotients = np.where(k > 0.0, k / u, 0.0)
        return quotients, quotients * (k_error / k + u_error / u), names


def _constants(quotients: Array) -> dict[str, float]:
    """Return the deck's constant, and where a quotient says anything three: see `stops`."""
    constants = {"deck": float(facts("cases")["deck"]["lipschitz"])}
    largest = quotients.max(axis=1)
    # Quotients that no later rounding confuses: each above all before it.
    records = [float(largest[0])]
    for each in np.maximum.accumulate(largest).tolist():
        if each > 1.001 * records[-1]:
            records.append(each)
    if records[0] > 0.0:
        constants["first"] = 0.5 * records[0]
        constants["never"] = 2.0 * records[-1]
    if len(records) > 1:
        constants["last"] = math.sqrt(records[-2] * records[-1])
    return constants


def _due(quotients: Array, names: list[str], constant: float) -> Stop | None:
    """Return the stop at the first quotient above `constant`, or None."""
    above = np.argwhere(quotients > constant)
    if not len(above):
        return None
    row, column = above[0]
    return Stop(int(row) + 1, names[column], float(quotients[row, column]))


def _held(
    id: str, found: Trajectory, due: Stop | None, quotients: Array, errors: Array, names: list[str]
) -> Check:
    """Return the check of step, variable and quotient; its value is the quotient's error."""
    stop = found.stop
    rows = len(quotients) if due is None else due.step
    ended = "complete" if due is None else "stopped"
    if (found.ended, found.steps) != (ended, rows):
        note = f"{found.ended} after {found.steps} steps, due {ended} after {rows}"
        return Check(id, False, None, None, replay(id), note)
    if stop is None or due is None:
        return Check(id, stop is due, None, None, replay(id), ended)
    if (stop.step, stop.variable) != (due.step, due.variable):
        note = f"{stop.variable} at step {stop.step}, due {due.variable} at step {due.step}"
        return Check(id, False, None, None, replay(id), note)
    note = f"{stop.variable} at step {stop.step}"
    limit = float(errors[due.step - 1, names.index(due.variable)])
    return bounded(id, abs(stop.quotient - due.quotient), limit, replay(id), note)

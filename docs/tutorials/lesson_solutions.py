"""Check the numbers of the solutions in the notes for the instructor.

``python docs/tutorials/lesson_solutions.py`` prints nothing if all are right.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction as F

import numpy as np

from pyharness import Listing, case_scene, run_program, subset

# Exercise 1


def last_u1(
    moments: Sequence[float],
    sign: int = 1,
    second: int = 2,
    divisor: int = 6,
    weights: Sequence[int] = (1, 2, 2, 1),
) -> float:
    """Return U1 after 100 steps of the Runge-Kutta deck under the torques of Case 1.

    `sign` and `second` are the sign of A and the second factor of the product on card 800;
    `divisor` and `weights` are those of card 1180.
    """
    i1, i2, i3 = moments

    def slopes(u: np.ndarray, sign: int = 1, second: int = 2) -> np.ndarray:
        return np.array([
            100 / i1 + sign * (i2 - i3) / i1 * u[1] * u[second],
            100 / i2 + (i3 - i1) / i2 * u[2] * u[0],
            100 / i3 + (i1 - i2) / i3 * u[0] * u[1],
        ])  # fmt: skip

    base = u = np.ones(3)
    for _ in range(100):
        k1 = slopes(u, sign, second)  # card 800 with I = 1
        u = u + 0.005 * k1  # cards 860 to 880 with I = 1: U(1) is overwritten
        k2 = slopes(u, sign, second)  # card 800 with I = 2
        later = u + 0.005 * k2
        k3 = slopes(later)  # card 950, without the change
        k4 = slopes(later + 0.01 * k3)  # card 1120, without the change
        u1 = base[0] + 0.01 / divisor * np.dot(weights, [k1[0], k2[0], k3[0], k4[0]])
        base = base + 0.01 / 6 * (k1 + 2 * (k2 + k3) + k4)
        base[0] = u1
    return round(float(base[0]), 4)


changes: list[dict] = [{"sign": -1}, {"second": 0}, {"divisor": 5}, {"weights": (2, 1, 1, 2)}]
assert last_u1((40, 40, 40)) == 3.5
assert [last_u1((40, 40, 40), **each) for each in changes] == [3.5, 3.5, 4.0, 3.5]
assert last_u1((40, 30, 40)) == 2.6210
assert [last_u1((40, 30, 40), **each) for each in changes] == [3.4844, 2.6946, 2.9451, 2.6184]

# Exercise 2

dt = time = 0.0
points = {}
for step in range(1, 101):
    dt += 0.01
    time += dt
    points[step] = (round(time, 2), round(dt / 3, 4), round(2 * dt / 3, 4))
assert points[1] == (0.01, 0.0033, 0.0067)
assert points[2] == (0.03, 0.0067, 0.0133)
assert points[3] == (0.06, 0.01, 0.02)
assert points[100] == (50.5, 0.3333, 0.6667)

# Exercise 3

with_card = run_program(case_scene(2), subset("two-term", keep=["x3-reads-acl2", "three-masses"]))
mended = run_program(case_scene(2), subset("two-term", keep=["three-masses"]))
acl1, acl2 = 10 / 100, 20 / 110
assert round(with_card.velocity[0, 0], 5) == 0.00148
assert round(mended.velocity[0, 0], 5) == 0.00107
assert abs(with_card.velocity[0, 0] - 0.01 * ((acl1 + acl2) / 2 + 0.0074)) < 5e-7
assert abs(mended.velocity[0, 0] - 0.01 * (acl1 + 0.0074)) < 5e-7
assert (with_card.omega == mended.omega).all()

# Exercise 4


def equation_31(f: Callable[[F], F], y: F, h: F) -> F:
    """Return the result of one step of the classical Runge-Kutta method."""
    k1 = f(y)
    k2 = f(y + h / 2 * k1)
    k3 = f(y + h / 2 * k2)
    k4 = f(y + h * k3)
    return y + h / 6 * (k1 + 2 * (k2 + k3) + k4)


def step_of_cards(f: Callable[[F], F], base: F, u1: F, h: F) -> tuple[F, F]:
    """Return the result and U1(1) after one step of the deck (cards 770 to 1180)."""
    k1 = f(u1)  # card 800, I = 1, J = 1
    u1 = u1 + h / 2 * k1  # card 860, I = 1, J = 1
    k2 = f(u1)  # card 800, I = 2, J = 1
    u2 = u1 + h / 2 * k2  # card 860, I = 2, J = 1
    k3 = f(u2)  # card 950, I = 3, J = 2
    u3 = u2 + h * k3  # card 1040
    k4 = f(u3)  # card 1120, I = 4, J = 3
    return base + h / 6 * (k1 + 2 * (k2 + k3) + k4), u1


assert equation_31(lambda y: y, F(1), F(1)) == F(65, 24)
assert step_of_cards(lambda y: y, F(1), F(1), F(1))[0] == F(19, 6)


def error_of_omega1(step_size: float, keep: Sequence[str]) -> float:
    """Return the largest error of omega1 (rad/s) in 1 s of Case 2, with only the faults `keep`."""
    scene = replace(case_scene(2), step_size=step_size, steps=round(1 / step_size))
    run = run_program(scene, Listing("runge-kutta", keep))
    return abs(run.omega[:, 0] - np.sin(5 * run.time)).max()


errors = [error_of_omega1(h, ["stage-base"]) for h in (0.01, 0.005, 0.0025)]
assert [f"{each:.3f}" for each in errors] == ["0.078", "0.039", "0.020"]
assert 1.9 < errors[0] / errors[1] < 2.1
assert 1.9 < errors[1] / errors[2] < 2.1
right = [error_of_omega1(h, []) for h in (0.01, 0.005)]
assert 15 < right[0] / right[1] < 17

# Exercise 5

base, u1, begins = 0.0, 0.0, []
for _ in range(4):
    begins.append((base, u1))
    base, u1 = step_of_cards(lambda y: 1.0, base, u1, 1.0)
assert begins == [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (3.0, 1.5)]

for step_size, step, largest in ((0.01, 62, 1.956), (0.0025, 250, 1.989)):
    scene = replace(case_scene(2), step_size=step_size, steps=round(1 / step_size))
    run = run_program(scene, subset("runge-kutta", "original"), may_stop=False)
    omega1 = run.omega[:, 0]
    assert omega1.argmax() + 1 == step
    assert round(omega1.max(), 3) == largest

for alone in ("stage-base", "base-not-restored"):
    first, second = (error_of_omega1(h, [alone]) for h in (0.01, 0.005))
    assert 1.9 < first / second < 2.1

mended = subset("runge-kutta", fix=["stage-base", "base-not-restored"])
run = run_program(case_scene(2), mended)
assert (run.stop.step, run.stop.variable) == (32, "U1")
assert abs(run.omega[:, 0] - np.sin(5 * run.time)).max() < 1e-7
assert round(run.omega[12, 0], 4) == 0.6052

# Exercise 6

steps = np.arange(1, 101)
before, after = 0.01 * (steps - 1), 0.01 * steps
slopes = abs(5 * np.cos(5 * after) - 5 * np.cos(5 * before))
quotients = slopes / abs(np.sin(5 * after) - np.sin(5 * before))
assert steps[quotients > 500][0] == 32
assert round(quotients[31]) == 1189

run = run_program(case_scene(2), subset("runge-kutta", keep=["lipschitz-per-component"]))
assert (run.stop.step, run.stop.variable, round(run.stop.quotient)) == (32, "U1", 1187)
run = run_program(case_scene(2), subset("runge-kutta", "original"))
assert (run.stop.step, run.stop.variable, round(run.stop.quotient)) == (25, "V2", 3305)
assert [f"{each:.5f}" for each in run.velocity[22:, 1]] == ["0.02268", "0.02274", "0.02273"]

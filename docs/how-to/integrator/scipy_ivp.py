"""SciPy's integrators, for `verify --integrator`: python scipy_ivp.py METHOD [fixed].

METHOD is RK45, DOP853, Radau or LSODA. With `fixed`, RK45 and DOP853 take steps of the requested
size; otherwise the method chooses its steps by the tolerance.
"""

import json
import sys

import numpy as np
from scipy.integrate import DOP853, RK45, solve_ivp


def right_hand_side(asked):
    i1, i2, i3 = asked["moments"]
    law = asked["torque"]
    constant, rate = np.array(law["constant"]), np.array(law["rate"])
    waves = [
        (function, np.array(wave["amplitude"]), wave["frequency"])
        for field, function in (("sines", np.sin), ("cosines", np.cos))
        for wave in law[field]
    ]

    def slopes(t, y):
        n1, n2, n3 = constant + rate * t + sum(a * g(f * t) for g, a, f in waves)
        p, q, r, a, b, c, d = y
        return [
            (n1 + (i2 - i3) * q * r) / i1,
            (n2 + (i3 - i1) * r * p) / i2,
            (n3 + (i1 - i2) * p * q) / i3,
            0.5 * (-b * p - c * q - d * r),
            0.5 * (a * p + c * r - d * q),
            0.5 * (a * q + d * p - b * r),
            0.5 * (a * r + b * q - c * p),
        ]

    return slopes


def by_steps(asked, method):
    h, times = asked["step_size"], asked["times"]
    start = asked["omega"] + asked["attitude"]
    # With so large a tolerance, every step is accepted and has the length max_step.
    solver = method(
        right_hand_side(asked), 0.0, start, times[-1], first_step=h, max_step=h, atol=1e9
    )
    wanted, rows, n = {round(t / h) for t in times}, [], 0
    while solver.status == "running":
        solver.step()
        n += 1
        if n in wanted:
            rows.append(solver.y)
    return np.array(rows), "step_size"


def by_tolerance(asked, name):
    times, tolerance = asked["times"], asked["tolerance"]
    start = asked["omega"] + asked["attitude"]
    span = (0.0, times[-1])
    f = right_hand_side(asked)
    run = solve_ivp(f, span, start, name, times, rtol=tolerance, atol=tolerance)
    return run.y.T, "tolerance"


name, *fixed = sys.argv[1:]
for line in sys.stdin:
    asked = json.loads(line)
    if fixed:
        rows, control = by_steps(asked, {"RK45": RK45, "DOP853": DOP853}[name])
    else:
        rows, control = by_tolerance(asked, name)
    rows = rows.astype(str)  # JSON has no infinity and no NaN
    answer = {"omega": rows[:, :3].tolist(), "attitude": rows[:, 3:].tolist(), "control": control}
    print(json.dumps(answer), flush=True)

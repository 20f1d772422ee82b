"""The Taylor series of heyoka, for `verify --integrator`; needs the package heyoka."""

import json
import sys

import heyoka


def equations(asked):
    p, q, r, a, b, c, d = heyoka.make_vars("p", "q", "r", "a", "b", "c", "d")
    i1, i2, i3 = asked["moments"]
    law, torque = asked["torque"], []
    for axis in range(3):
        n = heyoka.expression(law["constant"][axis]) + law["rate"][axis] * heyoka.time
        for field, function in (("sines", heyoka.sin), ("cosines", heyoka.cos)):
            for wave in law[field]:
                n = n + wave["amplitude"][axis] * function(wave["frequency"] * heyoka.time)
        torque.append(n)
    return [
        (p, (torque[0] + (i2 - i3) * q * r) / i1),
        (q, (torque[1] + (i3 - i1) * r * p) / i2),
        (r, (torque[2] + (i1 - i2) * p * q) / i3),
        (a, 0.5 * (-b * p - c * q - d * r)),
        (b, 0.5 * (a * p + c * r - d * q)),
        (c, 0.5 * (a * q + d * p - b * r)),
        (d, 0.5 * (a * r + b * q - c * p)),
    ]


for line in sys.stdin:
    asked = json.loads(line)
    start = asked["omega"] + asked["attitude"]
    solver = heyoka.taylor_adaptive(equations(asked), start, tol=asked["tolerance"])
    rows = solver.propagate_grid([0.0, *asked["times"]])[-1][1:].astype(str)  # may be infinite
    answer = {"omega": rows[:, :3].tolist(), "attitude": rows[:, 3:].tolist()}
    print(json.dumps({**answer, "control": "tolerance"}), flush=True)

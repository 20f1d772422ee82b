"""An example for `verify --integrator`: the Runge-Kutta method of order 4."""

import json
import math
import sys

SCHEMA = 1


def torque(law, t):
    total = [c + r * t for c, r in zip(law["constant"], law["rate"])]
    for waves, function in ((law["sines"], math.sin), (law["cosines"], math.cos)):
        for wave in waves:
            value = function(wave["frequency"] * t)
            total = [x + a * value for x, a in zip(total, wave["amplitude"])]
    return total


def slopes(asked, t, y):
    (i1, i2, i3), (n1, n2, n3) = asked["moments"], torque(asked["torque"], t)
    x, y_, z, a, b, c, d = y
    return [
        (n1 + (i2 - i3) * y_ * z) / i1,
        (n2 + (i3 - i1) * z * x) / i2,
        (n3 + (i1 - i2) * x * y_) / i3,
        0.5 * (-b * x - c * y_ - d * z),
        0.5 * (a * x + c * z - d * y_),
        0.5 * (a * y_ + d * x - b * z),
        0.5 * (a * z + b * y_ - c * x),
    ]


def step(asked, t, y, h):
    k1 = slopes(asked, t, y)
    k2 = slopes(asked, t + h / 2, [a + h / 2 * k for a, k in zip(y, k1)])
    k3 = slopes(asked, t + h / 2, [a + h / 2 * k for a, k in zip(y, k2)])
    k4 = slopes(asked, t + h, [a + h * k for a, k in zip(y, k3)])
    return [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(y, k1, k2, k3, k4)]


def solve(asked):
    y, n, h, rows = asked["omega"] + asked["attitude"], 0, asked["step_size"], []
    for time in asked["times"]:
        while n < round(time / h):
            y = step(asked, n * h, y, h)
            n += 1
        rows.append(y)
    return {"omega": [y[:3] for y in rows], "attitude": [y[3:] for y in rows]}


for line in sys.stdin:
    asked = json.loads(line)
    schema = asked.get("schema")
    if type(schema) is not int or schema != SCHEMA:
        sys.exit(f"schema {schema}; this integrator reads schema {SCHEMA} of an integrator request")
    # Numbers are text, because JSON has no infinity and no NaN.
    answer = {k: [list(map(repr, row)) for row in rows] for k, rows in solve(asked).items()}
    print(json.dumps(answer), flush=True)

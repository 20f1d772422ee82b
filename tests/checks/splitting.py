"""A first-order splitting for `verify --integrator`: three rotations in each step."""

import json
import math
import sys


def rotated(vector: list[float], axis: int, angle: float) -> list[float]:
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found, c, s = list(vector), math.cos(angle), math.sin(angle)
    found[j], found[k] = c * vector[j] + s * vector[k], c * vector[k] - s * vector[j]
    return found


def times_axis(q: list[float], axis: int, angle: float) -> list[float]:
    turn = [math.cos(angle / 2), 0.0, 0.0, 0.0]
    turn[axis + 1] = math.sin(angle / 2)
    (a, b, c, d), (e, f, g, h) = q, turn
    return [
        a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e,
    ]  # fmt: skip


for line in sys.stdin:
    asked = json.loads(line)
    if any(asked["torque"]["constant"]) or asked["torque"]["sines"]:
        print(json.dumps({"refused": "a torque"}), flush=True)
        continue
    moments, h = asked["moments"], asked["step_size"]
    momentum = [m * w for m, w in zip(moments, asked["omega"])]
    q, n, omega, attitude = asked["attitude"], 0, [], []
    for t in asked["times"]:
        while n < round(t / h):
            for axis in range(3):
                angle = h * momentum[axis] / moments[axis]
                momentum = rotated(momentum, axis, angle)
                q = times_axis(q, axis, angle)
            n += 1
        omega.append([x / m for x, m in zip(momentum, moments)])
        attitude.append(q)
    print(json.dumps({"omega": omega, "attitude": attitude}), flush=True)

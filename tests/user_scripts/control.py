"""A feedback law, its sensitivities, and a controller between steps."""

from typing import Any

from pyharness import Scene, Stepper, solve


def torque(t: float, w: Any, q: Any, *, gain: float = 0.5) -> Any:
    return -0.2 * q[1:] * q[0] - gain * w


scene = Scene("cube", (0.1, -0.2, 0.3), [1.0, 1.2, 0.8], torque=torque, attitude=(1, 1, 0, 0))
found = solve(scene, [1.0, 10.0], sensitivities=["torque.gain"])
slope = found.sensitivities["torque.gain"][-1, :3, 0]
print(found.attitude[-1, 0], slope, found.work()[-1], found.power().shape)
stepper, now = Stepper(scene), 0.0
for k in range(5):
    stepper.held_torque = -0.1 * stepper.omega
    now = stepper.until(0.2 * (k + 1))
print(now, stepper.attitude[0], stepper.omega.round(3), stepper)

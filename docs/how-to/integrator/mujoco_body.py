"""A free body in MuJoCo, for `verify --integrator`: python mujoco_body.py INTEGRATOR.

INTEGRATOR is Euler, implicit, implicitfast or RK4. Needs the package mujoco.
"""

import json
import math
import sys

import mujoco
import numpy as np

MODEL = """
<mujoco>
  <option timestep="{step!r}" gravity="0 0 0" integrator="{integrator}"/>
  <worldbody>
    <body><freejoint/>
      <inertial pos="0 0 0" quat="1 0 0 0" mass="1" diaginertia="{moments}"/>
    </body>
  </worldbody>
</mujoco>
"""


def torque(law, t):
    total = np.array(law["constant"]) + np.array(law["rate"]) * t
    for field, function in (("sines", math.sin), ("cosines", math.cos)):
        for wave in law[field]:
            total += np.array(wave["amplitude"]) * function(wave["frequency"] * t)
    return total


def states(asked, integrator):
    h = asked["step_size"]
    moments = asked["moments"]
    text = MODEL.format(step=h, integrator=integrator, moments=" ".join(map(repr, moments)))
    model = mujoco.MjModel.from_xml_string(text)
    # Undo MuJoCo's sorting of the axes by moment, and its rotation of the inertial frame.
    model.body_inertia[1], model.body_iquat[1] = moments, (1.0, 0.0, 0.0, 0.0)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    data.qvel[3:], data.qpos[3:] = asked["omega"], asked["attitude"]
    # MuJoCo calls this function at each stage of a step.
    mujoco.set_mjcb_passive(
        lambda m, d: d.qfrc_passive.__setitem__(slice(3, 6), torque(asked["torque"], d.time))
    )
    rows, n = [], 0
    for t in asked["times"]:
        count = round(t / h)
        mujoco.mj_step(model, data, nstep=count - n)
        n = count
        rows.append([data.qvel[3:].astype(str).tolist(), data.qpos[3:].astype(str).tolist()])
    mujoco.set_mjcb_passive(None)
    return rows


for line in sys.stdin:
    rows = states(json.loads(line), sys.argv[1])
    omega, attitude = zip(*rows)
    print(json.dumps({"omega": omega, "attitude": attitude}), flush=True)

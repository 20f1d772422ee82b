"""A free body in MuJoCo and by `free_rotor_step`: drift of energy and angular momentum.

Needs the package `mujoco` and a C compiler: python mujoco_drift.py FOLDER, where FOLDER has
`free_rotor.h`. It prints a Markdown table.
"""

import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

MOMENTS = np.array([3.0, 2.0, 1.25])
OMEGA = np.array([0.25, 1.125, -0.75])
STEP = 1e-3  # s
TIMES = (10, 100, 1000)  # s

MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0" integrator="{integrator}"/>
  <worldbody>
    <body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{moments}"/></body>
  </worldbody>
</mujoco>
"""

SOURCE = """
#include "free_rotor.h"
int steps(int n, const double *moments, double dt, double *omega, double *q);
int steps(int n, const double *moments, double dt, double *omega, double *q)
{
  int status = FREE_ROTOR_OK;
  while (n-- > 0 && status == FREE_ROTOR_OK) status = free_rotor_step(moments, dt, omega, q);
  return status;
}
"""


def invariants(omega: Any, q: Any) -> tuple[float, Any]:
    """Return twice the energy and the angular momentum in space."""
    momentum = MOMENTS * omega
    turned = np.cross(q[1:], momentum)
    return omega @ momentum, momentum + 2.0 * (q[0] * turned + np.cross(q[1:], turned))


def drift(omega: Any, q: Any) -> tuple[float, float, float]:
    """Return the relative drift of energy and |L|, and the angle of L from the first (rad)."""
    energy0, first = invariants(OMEGA, np.array([1.0, 0.0, 0.0, 0.0]))
    energy, last = invariants(omega, q)
    lengths = np.linalg.norm(first), np.linalg.norm(last)
    angle = np.arctan2(np.linalg.norm(np.cross(first, last)), first @ last)
    return energy / energy0 - 1.0, lengths[1] / lengths[0] - 1.0, angle


def mujoco_states(integrator: str) -> Iterator[tuple[Any, Any]]:
    """Yield omega and attitude of MuJoCo's body at each of TIMES."""
    numbers = " ".join(map(str, MOMENTS))
    text = MODEL.format(step=STEP, integrator=integrator, moments=numbers)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    # MuJoCo sorts the axes of the body by moment; here they are sorted, so that it turns none.
    assert np.array_equal(model.body_inertia[1], MOMENTS)
    data.qvel[3:] = OMEGA
    done = 0
    for time in TIMES:
        count = round(time / STEP)
        mujoco.mj_step(model, data, nstep=count - done)
        done = count
        yield data.qvel[3:].copy(), data.qpos[3:].copy()


def our_states(include: str) -> Iterator[tuple[Any, Any]]:
    """Yield omega and attitude by `free_rotor_step` at each of TIMES."""
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "steps.c"), Path(folder, "steps.so")
        source.write_text(SOURCE)
        flags = ["-std=c99", "-O2", "-shared", "-fPIC", f"-I{include}"]
        subprocess.run(["cc", *flags, str(source), "-o", str(library), "-lm"], check=True)
        steps = ctypes.CDLL(str(library)).steps
        omega, q, moments = OMEGA.copy(), np.array([1.0, 0.0, 0.0, 0.0]), MOMENTS.copy()
        done = 0
        for time in TIMES:
            count = round(time / STEP)
            addresses = [ctypes.c_void_p(each.ctypes.data) for each in (moments, omega, q)]
            steps(count - done, addresses[0], ctypes.c_double(STEP), *addresses[1:])
            done = count
            yield omega.copy(), q.copy()


def main() -> None:
    """Print the table."""
    print("| integrator | time, s | energy, relative | \\|L\\|, relative | direction of L, rad |")
    print("| --- | ---: | ---: | ---: | ---: |")
    names = ("Euler", "implicitfast", "implicit", "RK4")
    for name in names:
        for time, state in zip(TIMES, mujoco_states(name), strict=True):
            energy, length, angle = drift(*state)
            print(f"| MuJoCo, `{name}` | {time} | {energy:+.1e} | {length:+.1e} | {angle:.1e} |")
    for time, state in zip(TIMES, our_states(sys.argv[1]), strict=True):
        energy, length, angle = drift(*state)
        print(f"| `free_rotor_step` | {time} | {energy:+.1e} | {length:+.1e} | {angle:.1e} |")


if __name__ == "__main__":
    main()

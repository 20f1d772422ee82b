"""A campaign of random operations: Taylor series of compiled leaves against the interpreter.

The command is ``python -m tests.campaigns.term_campaign COUNT SEED [FIRST]``. A number stands for a
hundred random torques, whose functions `expand` are compiled as one library.
"""

import ctypes
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from pyharness import Scene
from pyharness.engine.system.leaf_cache import compiler
from pyharness.engine.system.leaf_text import structure
from pyharness.engine.system.leaves import source
from pyharness.engine.system.recorded import listing, system_of
from pyharness.model.constant_body import with_constant_body
from pyharness.model.tape import Tape
from tests.campaigns import driver
from tests.campaigns.driver import Tally
from tests.campaigns.leaf_campaign import compare_terms

_TOGETHER = 100
_FLAGS = ("-O1", "-ffp-contract=fast", "-march=native", "-shared", "-fPIC", "-w")
_FUNCTIONS: tuple[Callable[[Any], Any], ...] = (
    np.sin,
    np.cos,
    np.tanh,
    np.arctan,
    lambda x: np.exp(-x * x),
    lambda x: np.sqrt(0.3 + x * x),
    lambda x: np.log(1.5 + x * x),
    lambda x: np.arcsin(0.9 * np.sin(x)),
    lambda x: 1.0 / (1.2 + x * x),
)


def expression(source: Random, inputs: list[Any], depth: int) -> Any:
    """Return a random function of the inputs."""
    kind = source.random()
    if depth == 0 or kind < 0.15:
        return source.uniform(-1.5, 1.5) * source.choice(inputs)
    if kind < 0.3:
        return np.cos(source.uniform(0.1, 9.0) * inputs[0] + source.choice((0.0, 0.7)))
    if kind < 0.65:
        return source.choice(_FUNCTIONS)(expression(source, inputs, depth - 1))
    one, other = (expression(source, inputs, depth - 1) for _ in range(2))
    return one * other if kind < 0.85 else one + other


def drawn(seed: str) -> tuple[Scene, Tape]:
    """Return a scene with a random torque, and its tape."""
    source = Random(seed)
    depth, with_attitude = source.randrange(1, 5), source.random() < 0.4

    def torque(t: Any, omega: Any, *attitude: Any) -> list[Any]:
        random = Random(f"{seed} torque")
        inputs = [t, *omega, *(part for each in attitude for part in each)]
        parts = [expression(random, inputs, depth) for _ in range(3)]
        return [parts[0] - 0.1 * omega[0], *parts[1:]]

    state = [source.gauss(0.0, 1.0) for _ in range(7)]
    turn = np.array(state[3:]) / np.linalg.norm(state[3:])
    function: Any = (
        (lambda t, w, q: torque(t, w, q)) if with_attitude else (lambda t, w: torque(t, w))
    )
    attitude = tuple(turn) if with_attitude else None
    scene = Scene("", state[:3], (1.0, 1.4, 2.1), torque=function, attitude=attitude)
    return scene, system_of(with_constant_body(scene))


def addresses(tapes: list[Tape], place: Path) -> list[int]:
    """Return the addresses of leaves that only expand."""
    texts = []
    for number, tape in enumerate(tapes):
        shape: Any = structure(listing(tape))
        text = source(shape, f"_{number}")
        text = text[: text.index("static void set_jacobian")]
        texts.append(text if number == 0 else text[text.index("static void expand") :])
        texts.append(f"const void *const leaves_{number}[9] = {{(void *)expand_{number}}};")
    place.joinpath("terms.c").write_text("\n".join(texts))
    library = place / "terms.so"
    subprocess.run([*compiler(), *_FLAGS, str(place / "terms.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    names = (f"leaves_{number}" for number in range(len(tapes)))
    return [ctypes.addressof(ctypes.c_void_p.in_dll(loaded, name)) for name in names]


def try_torques(tally: Tally) -> None:
    """Compare the terms of one step of each torque."""
    source = Random(f"terms {tally.seed} {tally.number}")
    found = [drawn(f"{tally.seed} {tally.number} {n}") for n in range(_TOGETHER)]
    with TemporaryDirectory() as place:
        for (scene, tape), address in zip(
            found, addresses([tape for _, tape in found], Path(place)), strict=True
        ):
            compare_terms(tally, scene, tape, address, source.uniform(-5.0, 5.0), source)


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.term_campaign", try_torques, sys.argv[1:]))

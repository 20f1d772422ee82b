"""Trial of threads: concurrent calls must return bit-for-bit identical results."""

import random
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import product

import numpy as np

from pyharness.checks.check import BITS, Check, may_hold
from pyharness.checks.compare.candidates import method_candidate, program_candidate
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.tolerances import finest
from pyharness.engine.plan.registry import METHODS, PREPARED
from pyharness.engine.prepared.solver import Solver, prepare
from pyharness.engine.solve import solve
from pyharness.engine.torques.terms import damping
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.thesis.programs import IMPLEMENTATIONS

THREADS = 8
_REPEATS = 30
# Interval (s) between switches of threads, a hundredth of the default.
_SWITCH = 5e-5
_TOLERANCE = 1e-9
_TIMES = (0.05, 0.1, 0.2)

_WAVE = TorqueLaw(sines=(((100.0, 0.0, 3.0), 5.0),))
_WAVES = TorqueLaw(
    (10.0, 0.0, 2.0), (0.0, 0.0, 1.0),
    (((1.0, 0.0, 0.0), 100.0), ((0.0, 2.0, 0.0), 3.0)), (((0.0, 1.0, 0.0), 100.0),),
)  # fmt: skip
SCENES = (
    Scene("free", (0.3, 1.1, 2.7), moments=(40.0, 30.0, 20.0), steps=20),
    Scene("sphere", (1.0, 1.0, 1.0), moments=(40.0, 40.0, 40.0), torque=_WAVE, steps=20),
    Scene("driven", (0.0, 1.0, 1.0), moments=(40.0, 30.0, 20.0), torque=_WAVES, steps=20),
)
# A scene whose error amplification needs many steps.
_BRAKED = Scene("braked", (0.3, 1.1, 2.7), moments=(40.0, 30.0, 20.0), torque=damping(0.5))
_LATE = 20.0  # end time (s)


@dataclass(frozen=True)
class Job:
    subject: str
    scene: Scene
    call: Callable[[], bytes]


def _run(only: Sequence[str]) -> Iterator[Check]:
    asked = [job for job in jobs() if may_hold(f"threads/{job.subject}", only)]
    differing = different(asked)
    for subject in dict.fromkeys(job.subject for job in asked):
        own = [job for job in asked if job.subject == subject]
        wrong = [job for job in differing if job.subject == subject]
        note = f"{_REPEATS * len(own)} calls in {THREADS} threads"
        scene = (wrong or own)[0].scene
        yield named("threads", subject, scene=scene).bounded(len(wrong), 0.0, BITS, note)


def different(jobs: Sequence[Job], repeats: int = _REPEATS) -> list[Job]:
    """Return the jobs whose results differ in threads, once for each differing call."""
    alone = [bits(job) for job in jobs]
    order = [index for index in range(len(jobs)) for _ in range(repeats)]
    random.Random("threads").shuffle(order)
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    try:
        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(lambda index: bits(jobs[index]), order))
    finally:
        sys.setswitchinterval(before)
    return [jobs[i] for i, each in zip(order, found, strict=True) if each != alone[i]]


def bits(job: Job) -> bytes:
    try:
        return job.call()
    except InputError as refusal:
        return str(refusal).encode()


def jobs() -> list[Job]:
    found = []
    for scene in SCENES:
        found += [Job(name, scene, partial(_rows, scene, name)) for name in METHODS]
        found += [Job(f"prepared-{x}", scene, partial(_prepared, scene, x)) for x in PREPARED]
        for listing, implementation in product(LISTINGS, IMPLEMENTATIONS):
            call = partial(_program, scene, listing, implementation)
            found.append(Job(listing.program, scene, call))
        found.append(Job("refusals", scene, partial(_refusal, scene)))
    found.append(Job("taylor", _BRAKED, partial(_estimates, _BRAKED)))
    return found + [Job("linear-solver", case_scene(n), partial(_linear, n)) for n in range(1, 8)]


def _rows(scene: Scene, name: str) -> bytes:
    tolerance = max(_TOLERANCE, finest(name, scene, _TIMES[-1]))
    found = method_candidate(name, tolerance).rows(scene, _TIMES)
    return found.omega.tobytes() + f"{found.steps} {found.evaluations} {found.ended}".encode()


def _estimates(scene: Scene) -> bytes:
    found = solve(scene, _LATE, "taylor", _TOLERANCE)
    return found.omega.tobytes() + f"{found.error} {found.growth}".encode()


def _prepared(scene: Scene, name: str) -> bytes:
    solver, other = _shared(scene, name), _shared(SCENES[0], name)
    found = []
    for k in range(20):
        start = np.array(scene.omega) + 0.1 * k
        found.append(solver(start, _TIMES[-1]).tobytes() + solver.status.encode())
        found.append(other(start, -_TIMES[0]).tobytes())
    return b"".join(found)


@cache
def _shared(scene: Scene, name: str) -> Solver:
    return prepare(scene, name, 1e-7, attitude=False)


def _program(scene: Scene, listing: Listing, implementation: str) -> bytes:
    found = program_candidate(listing, implementation).rows(scene)
    velocity = b"" if found.velocity is None else found.velocity.tobytes()
    return found.recorded_time.tobytes() + found.omega.tobytes() + velocity + found.ended.encode()


def _refusal(scene: Scene) -> bytes:
    return method_candidate("taylor", 1e-30).rows(scene, _TIMES).omega.tobytes()


def _linear(seed: int) -> bytes:
    source = np.random.default_rng(seed)
    a, b = source.normal(size=(5, 5)), source.normal(size=(5, 3))
    factors, x, ier = extension().solve_linear(a, b)
    return bytes(factors.tobytes() + x.tobytes() + str(ier).encode())


TITLE = "the same calls from eight threads"
BOUND = "No bit may differ, since calls share no state."
TRIAL = Trial("threads", TITLE, BOUND, _run)

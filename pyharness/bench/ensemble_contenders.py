"""The loads of `bench --ensemble`, many bodies with equal moments, and our contenders."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pyharness.bench.contenders import Contender
from pyharness.checks.scenes.random_scenes import text_generator
from pyharness.engine.many.many import solve_many
from pyharness.engine.solve import solve
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.truth.reference import exact_coefficients

MOMENTS: Triple = (40.0, 30.0, 20.0)  # kg m2
HORIZON = 3.0  # end time (s)
SAMPLE = 200  # number of bodies whose error is measured
_FASTEST = 2.0  # largest component of the initial omega, rad/s
_HARDEST = 1.0  # largest torque about an axis divided by this axis's moment, rad/s2


def coefficients() -> list[float]:
    return [float(each) for each in exact_coefficients(Scene("", (0.0, 0.0, 0.0), MOMENTS))]


@dataclass(frozen=True, eq=False)
class EnsembleLoad:
    """Many bodies with the moments `MOMENTS`."""

    name: str
    omega0: Array  # (n, 3), rad/s
    torque: Array | None  # (n, 3), N m about the body's axes; None without torque
    # (n, 4): unit quaternions; None if attitudes are not requested
    attitude0: Array | None = field(default=None, kw_only=True)
    horizon: float = field(default=HORIZON, kw_only=True)  # end time, s

    @property
    def n(self) -> int:
        return len(self.omega0)

    @property
    def scene(self) -> Scene:
        return Scene(self.name, (0.0, 0.0, 0.0), MOMENTS)

    @property
    def acceleration(self) -> Array:
        """The torques divided by the moments (rad/s2), shape (n, 3)."""
        if self.torque is None:
            return np.zeros_like(self.omega0)
        return np.asarray(self.torque / np.array(MOMENTS))

    def part(self, rows: "slice | list[int]") -> "EnsembleLoad":
        given = {name: getattr(self, name) for name in ("omega0", "torque", "attitude0")}
        own: dict[str, Any]
        own = {k: np.ascontiguousarray(x[rows]) for k, x in given.items() if x is not None}
        return replace(self, **own)

    def ends(self) -> Array:
        """Return all bodies' omega (rad/s) or, if requested, attitudes at the end time."""
        found = []
        for scene in self.scenes():
            attitude = scene.attitude is not None
            path = solve(scene, [self.horizon], tolerance=1e-15, attitude=attitude)
            found.append((path.omega if self.attitude0 is None else np.asarray(path.attitude))[0])
        return np.array(found)

    def scenes(self) -> Iterator[Scene]:
        for i, start in enumerate(self.omega0.tolist()):
            law = TorqueLaw() if self.torque is None else TorqueLaw(self.torque[i].tolist())
            attitude = None if self.attitude0 is None else self.attitude0[i].tolist()
            yield Scene(self.name, start, MOMENTS, torque=law, attitude=attitude)


# A function of the load, the setting and the number of threads. It returns a function that
# integrates to the end time, and returns omega, shape (n, 3), or the requested attitudes, shape
# (n, 4).
EnsembleMaker = Callable[[EnsembleLoad, float, int], Callable[[], Array]]


@dataclass(frozen=True)
class EnsembleContender(Contender):
    prepare: EnsembleMaker  # the first call of the prepared function may compile code
    threads: tuple[int, ...] = (1, 2)  # numbers of threads to measure with
    torque_free: bool = False  # solves only bodies without torque
    attitude: bool = False
    # Ways to prepare the solver, by notes on them. All are timed; the fastest counts.
    variants: Mapping[str, EnsembleMaker] = field(default_factory=dict, kw_only=True)

    @property
    def ways(self) -> Mapping[str, EnsembleMaker]:
        return self.variants or {"": self.prepare}


def draw(seed: str, n: int) -> list[EnsembleLoad]:
    """Return two loads of the same n random bodies, without and with torques."""
    source = text_generator(f"ensemble/{seed}")
    omega0 = source.uniform(-_FASTEST, _FASTEST, (n, 3))
    torque = source.uniform(-_HARDEST, _HARDEST, (n, 3)) * np.array(MOMENTS)
    pushed = EnsembleLoad("constant torque, each its own", omega0, torque)
    return [EnsembleLoad("no torque", omega0, None), pushed]


def with_attitudes(loads: list[EnsembleLoad], seed: str) -> list[EnsembleLoad]:
    source = text_generator(f"ensemble attitudes/{seed}")
    turned = source.standard_normal((loads[0].n, 4))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return [replace(each, name=f"{each.name}, attitude", attitude0=turned) for each in loads]


def own_ensembles(compiled: bool = False) -> list[EnsembleContender]:
    one, closed = EnsembleContender, _make_own("closed-form")
    return [
        one("closed-form", "none", closed, torque_free=True, attitude=True),
        one("taylor", "tolerance", _make_own("taylor", compiled), attitude=True),
        one("rk4", "steps", _make_own("rk4")),
    ]


def _make_own(method: str, compiled: bool = False) -> EnsembleMaker:
    def prepare(load: EnsembleLoad, setting: float, threads: int) -> Callable[[], Array]:
        # Each call reuses the arrays of the previous call's results.
        tolerance = setting if method == "taylor" else None
        step = load.horizon / setting if method == "rk4" else None
        kept = None

        def run() -> Array:
            nonlocal kept
            kept = solve_many(
                load.scene, load.horizon, omega=load.omega0, torque_constant=load.torque,
                attitude=load.attitude0, method=method, tolerance=tolerance, step=step,
                threads=threads, out=kept, compiled=compiled,
            )  # fmt: skip
            if load.attitude0 is None:
                return kept.omega
            assert kept.attitude is not None
            return kept.attitude

        return run

    return prepare

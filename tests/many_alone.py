"""`python -m tests.many_alone 100000 SEED`: check that a body's result depends on that body alone.

Batches of every kind of body, start, torque and time are solved whole, permuted, in chunks, in 1 to
4 threads and one body at a time. Every bit and every status must be the same.
"""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness import Ensemble, Scene, prepare, solve_many
from pyharness.engine.plan.registry import FIXED_STEP
from pyharness.model.trajectory import Array

BASE = Scene("", (1.0, 1.0, 1.0), moments=(1.0, 1.0, 1.0), step_size=0.05)
# Methods, each with the finest tolerance that is drawn for it (10 to minus this power).
METHODS = {
    "auto": 15, "taylor": 15, "gauss-2": 12, "quick": 11,
}  # fmt: skip
METHODS |= dict.fromkeys(FIXED_STEP, 3)
_BATCH = 2000
_ALONE = 40  # bodies of a batch that are also solved alone
_WAVES = 3  # sines and as many cosines; one batch in eight has more than lanes can take
_LITTLE_WORK = 1e-4  # few bodies exceed this work limit, or take long before they do


def mixed(n: int, seed: int, by_moments: bool = True, waves: int = _WAVES) -> dict[str, Any]:
    """Draw bodies of every kind, in random order, as the arrays of `solve_many`."""
    rng = np.random.default_rng([seed, n])
    body = 10.0 ** rng.uniform(-1.0, 1.0, (n, 3)) if by_moments else rng.uniform(-1, 1, (n, 3))
    if not by_moments:  # most motions are bounded
        body[:, 1] = np.where(rng.random(n) < 0.9, -np.sign(body[:, 0]), 1) * np.abs(body[:, 1])
        body[:, 2] = np.where(rng.random(n) < 0.9, np.sign(body[:, 0]), 1) * np.abs(body[:, 2])
    kind = rng.integers(8, size=n)
    body[kind == 0, 1] = body[kind == 0, 0] if by_moments else 0.0  # symmetric
    body[kind == 1] = body[kind == 1, :1] if by_moments else 0.0  # spheres
    close = kind == 2  # nearly spheres
    body[close] = body[close, :1] * (1.0 + 1e-6 * rng.standard_normal((np.sum(close), 3)))
    omega0 = rng.standard_normal((n, 3))
    kind = rng.integers(10, size=n)
    one = np.eye(3)[rng.integers(3, size=n)] * rng.choice([-1.0, 1.0], (n, 1))
    tilt = 10.0 ** rng.uniform(-15.0, -1.0, (n, 1)) * rng.standard_normal((n, 3))
    omega0 = np.where(kind[:, None] == 0, one, omega0)  # steady rotations
    omega0 = np.where(np.isin(kind, (1, 2))[:, None], one + tilt, omega0)  # near them
    omega0[kind == 3] = _beside_separatrix(body, omega0, tilt[:, 0], by_moments)[kind == 3]
    omega0[kind == 4] *= 10.0 ** rng.choice([-150.0, -70.0, 70.0, 150.0], (np.sum(kind == 4), 1))
    omega0[kind == 5] = 0.0
    with np.errstate(over="ignore"):
        omega0 *= 10.0 ** rng.uniform(-1.0, 1.0, (n, 1))
    rate = np.abs(omega0).max(axis=1, keepdims=True)
    rate = np.where((rate > 1e-20) & (rate < 1e20), rate, 1.0)
    unit = np.where(by_moments, np.abs(body), 1.0) * rate**2
    kind = rng.integers(6, size=(n, 1))
    size = unit * 10.0 ** rng.uniform(-4.0, 0.5, (n, 1))

    def vectors() -> Array:
        return rng.standard_normal((n, 3)) * (rng.random((n, 3)) < 0.8)

    t_end = 10.0 ** rng.uniform(-1.0, 1.5, n) * rng.choice([-1.0, 1.0], n) / rate[:, 0]
    t_end[rng.random(n) < 0.05] = 0.0
    t_end[rng.random(n) < 0.05] *= 30.0
    drawn = {
        "moments" if by_moments else "coefficients": body, "omega": omega0,
        "torque_constant": np.where(kind >= 2, size * vectors(), 0.0),
        "torque_rate": np.where(kind >= 4, 0.1 * size * rate * vectors(), 0.0), "t_end": t_end,
    }  # fmt: skip
    for name in ("sines", "cosines"):
        drawn[name] = np.zeros((n, waves, 4))
        for wave in range(waves):
            acts = (kind == 5) & (rng.random((n, 1)) < 0.6)
            drawn[name][:, wave, :3] = np.where(acts, size * vectors(), 0.0)
            # A wave without amplitude may have any frequency.
            drawn[name][:, wave, 3] = (rate * rng.uniform(0.0, 3.0, (n, 1)))[:, 0]
            drawn[name][rng.random(n) < 0.01, wave, 3] = 1e10
    for array in drawn.values():  # rows with invalid numbers
        rows = rng.integers(n, size=max(1, n // 300))
        array.reshape(n, -1)[rows, rng.integers(array[0].size)] = rng.choice(
            [np.nan, np.inf, -1.0, 1e300, 1e-300], len(rows)
        )
    return drawn


def _beside_separatrix(body: Array, omega0: Array, tilt: Array, by_moments: bool) -> Array:
    """Return starts whose relative distance from the separatrix is `tilt`."""
    found = omega0.copy()
    with np.errstate(all="ignore"):
        low, middle, high = np.argsort(body, axis=1).T
        rows = np.arange(len(body))
        least, mean, most = body[rows, low], body[rows, middle], body[rows, high]
        # the separatrix: 2 E I2 = L**2
        ratio = np.sqrt(most * (most - mean) / (least * (mean - least)))
        found[rows, low] = found[rows, high] * ratio * (1.0 + tilt)
    return np.nan_to_num(found) if by_moments else omega0


def same_bits(one: Ensemble, other: Ensemble, rows: Any = slice(None)) -> NDArray[np.bool_]:
    """Return for each row whether `one` and `other` have the same status and the same bits."""
    same: NDArray[np.bool_] = one.status[rows] == other.status
    for found, beside in ((one.omega, other.omega), (one.attitude, other.attitude)):
        assert (found is None) == (beside is None)
        if found is not None and beside is not None:
            bits = found[rows].view(np.uint64) == beside.view(np.uint64)
            same &= (bits | (np.isnan(found[rows]) & np.isnan(beside))).all(axis=1)
    return same


def parts_of(drawn: dict[str, Any], rows: Any) -> dict[str, Any]:
    """Return the arrays of some of the bodies."""
    return {name: values[rows] for name, values in drawn.items()}


def regroupings(
    drawn: dict[str, Any], rng: np.random.Generator, alone: int
) -> Iterator[tuple[str, Any, int]]:
    """Yield groupings of the bodies, each with its name, rows and number of threads."""
    n = len(drawn["omega"])
    # Bodies of one kind, so that a call has no other kind.
    pushed, ramped, waved = (
        (drawn[name].reshape(n, -1) != 0.0).any(axis=1) if name in drawn else np.zeros(n, bool)
        for name in ("torque_constant", "torque_rate", "sines")
    )
    for name, members in (
        ("those without torque", ~(pushed | ramped | waved)),
        ("those under a constant torque", pushed & ~ramped & ~waved),
        ("those without waves", ~waved),
        ("those of one time", drawn["t_end"] == drawn["t_end"][0]),
    ):
        yield name, np.flatnonzero(members), 1
    for threads in (2, 3, 4):
        yield f"{threads} threads", slice(None), threads
    yield "permuted", rng.permutation(n), 1
    size = int(rng.integers(2, 130))
    for begin in range(0, n, size):
        yield f"chunks of {size}", slice(begin, begin + size), 1
    for _ in range(3):
        count = int(rng.integers(1, n))
        yield f"{count} of them", rng.permutation(n)[:count], int(rng.integers(1, 5))
    for row in rng.permutation(n)[:alone]:
        yield "alone", slice(int(row), int(row) + 1), 1


def differing(
    drawn: dict[str, Any], seed: int, alone: int = _ALONE, **settings: Any
) -> dict[str, set[int]]:
    """Return the bodies whose result changed, by the name of the grouping."""
    rng = np.random.default_rng(seed)
    n = len(drawn["omega"])
    whole = solve_many(BASE, **drawn, **settings)
    found: dict[str, set[int]] = {}
    for name, rows, threads in regroupings(drawn, rng, alone):
        part = solve_many(BASE, **parts_of(drawn, rows), threads=threads, **settings)
        off = np.arange(n)[rows][~same_bits(whole, part, rows)]
        if off.size:
            found.setdefault(name, set()).update(off.tolist())
    return found


def differing_starts(scene: Scene, omega0: Array, t_end: Array, seed: int, **settings: Any) -> int:
    """Return how many starts change with their place, chunk or threads, for a prepared scene."""
    rng = np.random.default_rng(seed)
    many = prepare(scene, **settings).many
    whole = Ensemble(*many(omega0, t_end))
    changed = np.zeros(len(omega0), bool)
    for _, rows, threads in regroupings({"omega": omega0, "t_end": t_end}, rng, _ALONE):
        part = Ensemble(*many(np.ascontiguousarray(omega0[rows]), t_end[rows], threads=threads))
        changed[rows] |= ~same_bits(whole, part, rows)
    return int(changed.sum())


def settings_of(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a method and a tolerance."""
    method = str(rng.choice(list(METHODS), p=[0.4, 0.2, 0.1, 0.05, 0.05, 0.1, 0.1]))
    tolerance = 10.0 ** -float(rng.integers(3, METHODS[method] + 1))
    return {"method": method, "tolerance": tolerance, "effort": _LITTLE_WORK}


def main(count: int, seed: int) -> int:
    """Print which bodies changed; return exit status 1 if one did."""
    generator = np.random.default_rng(seed)
    n_changed = n_alone = done = batch = 0
    ends: dict[str, int] = {}
    while done < count:
        n, own = min(_BATCH, count - done), int(generator.integers(2**31))
        settings = settings_of(generator)
        drawn = mixed(n, own, bool(generator.random() < 0.7), 9 if batch % 8 == 7 else _WAVES)
        if settings["method"] in ("auto", "taylor") and generator.random() < 0.3:
            drawn["attitude"] = generator.standard_normal((n, 4))
        changed = differing(drawn, own, **settings)
        for name, rows in changed.items():
            print(
                f"batch {batch}, {settings}: {len(rows)} of {n} changed, {name}: {sorted(rows)[:5]}"
            )
        n_changed += len(set().union(*changed.values()))
        for end in solve_many(BASE, **drawn, **settings).ended:
            ends[str(end)] = ends.get(str(end), 0) + 1
        n_alone += min(n, _ALONE)
        done += n
        batch += 1
    told = ", ".join(f"{number} {name}" for name, number in sorted(ends.items()))
    print(f"{done} bodies of seed {seed} in {batch} batches ({told}), {n_alone} of them alone too:")
    print(f"{n_changed} depend on other bodies, their order, chunks or threads")
    return 1 if n_changed else 0


if __name__ == "__main__":
    number, seed = [*sys.argv[1:], *("100000", "1")[len(sys.argv) - 1 :]]
    sys.exit(main(int(number), int(seed)))

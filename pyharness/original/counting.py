"""Floating-point operations, counted by running a twin on numbers that count."""

import importlib
from typing import Any

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, TorqueLaw


class Counted(float):
    """A float whose arithmetic is counted; results are counted floats too."""

    operations = 0

    def __new__(cls, value: float) -> "Counted":
        """Make one of any number."""
        return super().__new__(cls, value)


def _counting(name: str) -> Any:
    plain = getattr(float, name)

    def operate(self: Counted, *others: float) -> Any:
        result = plain(self, *others)
        if result is NotImplemented:
            return result
        Counted.operations += 1
        return Counted(result)

    return operate


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv"):
    setattr(Counted, f"__{_name}__", _counting(f"__{_name}__"))


def operations_per_step(listing: Listing) -> int:
    """Return the additions, multiplications and divisions that a program spends on a step.

    The difference between two runs of different length, on an unsymmetric body under constant
    torque, so that what is done once does not count.
    """
    counts = [_operations(listing, steps) for steps in (1, 3)]
    return (counts[1] - counts[0]) // 2


def _operations(listing: Listing, steps: int) -> int:
    def three(x: float, y: float, z: float) -> tuple[Counted, Counted, Counted]:
        return Counted(x), Counted(y), Counted(z)

    counted = {
        "omega": three(0.1, 1.0, 1.0),
        "moments": three(40.0, 30.0, 20.0),
        "step_size": Counted(0.01),
        "masses": three(100.0, 110.0, 120.0),
        "forces": three(10.0, 20.0, 40.0),
    }
    torque = TorqueLaw(three(100.0, 200.0, 150.0))
    scene = Scene("counting", **counted, torque=torque, steps=steps)  # type: ignore[arg-type]
    # A scene keeps plain floats, which do not count.
    object.__setattr__(torque, "constant", three(*torque.constant))
    for name, value in counted.items():
        object.__setattr__(scene, name, value)
    twin = importlib.import_module(f"pyharness.original.{listing.program.replace('-', '_')}")
    Counted.operations = 0
    twin.run(scene, listing, may_stop=False)
    return Counted.operations

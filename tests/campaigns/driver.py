"""The loop of a random campaign: scenes by seed and number, counts, faults, exit status.

A command ``python -m MODULE COUNT SEED [FIRST]`` tries the scenes FIRST to FIRST + COUNT - 1, by
default from 0. It prints a line for each fault, which begins with the command that repeats the
scene, and then a table. It returns exit status 1 if there is a fault.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Tally:
    """The counts of a campaign, the ratios of errors to their limits by name, and the faults."""

    command: str = ""  # that repeats a scene, with {seed} and {number}
    seed: str = ""
    number: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    ratios: dict[str, list[float]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def judge(self, name: str, error: float, limit: float, more: str = "") -> None:
        """Record an error, which is a fault if it is not within the limit."""
        ratio = error / limit
        self.record(name, ratio)
        if not ratio <= 1.0:
            self.fault(f"{name}: error {error:.3g}, {ratio:.3g} times the limit{more}")

    def record(self, name: str, ratio: float) -> None:
        """Record a ratio, of which the table has quantiles."""
        self.ratios.setdefault(name, []).append(ratio)

    def fault(self, text: str) -> None:
        """Record and print a fault."""
        command = self.command.format(seed=self.seed, number=self.number)
        self.faults.append(f"{command}: {text}")
        print(self.faults[-1], flush=True)

    def __str__(self) -> str:
        """Return the table."""
        lines = [f"{n:8}  {name}" for name, n in sorted(self.counts.items())]
        if self.ratios:
            lines.append(f"{'ratios':48}{'n':>8}{'1 %':>9}{'median':>9}{'99 %':>9}{'largest':>9}")
        for name, ratios in sorted(self.ratios.items()):
            # No interpolation, because infinity minus infinity is not a number.
            each = np.quantile(ratios, [0.01, 0.5, 0.99, 1.0], method="nearest")
            lines.append(f"{name:48}{len(ratios):8}" + "".join(f"{x:9.2g}" for x in each))
        return "\n".join([*lines, f"{len(self.faults)} faults"])


Try = Callable[[Tally], None]


def campaign(command: str, try_scene: Try, count: int, seed: str, first: int = 0) -> Tally:
    """Return the tally of `count` scenes from number `first` on."""
    tally = Tally(command, seed)
    for tally.number in range(first, first + count):
        try_scene(tally)
    return tally


def run(module: str, try_scene: Try, arguments: Sequence[str]) -> int:
    """Run the campaign of a command line, print its table, and return the exit status."""
    count, seed, first = [*arguments, "0"][:3]
    command = f"python -m {module} 1 {{seed}} {{number}}"
    tally = campaign(command, try_scene, int(count), seed, int(first))
    print(tally)
    return int(bool(tally.faults))

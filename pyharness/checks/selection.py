"""The selection of checks for one run of `verify`, with their seed and files."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pyharness.checks.check import Name, may_hold, selected
from pyharness.checks.scenes.random_scenes import weekly_seed

if TYPE_CHECKING:
    from pyharness.checks.external_file import Problem

DRAWS = 1000
RECORD = Path(__file__).parent.parent.parent / "tests" / "golden"


@dataclass(frozen=True)
class Selection:
    """The checks that one run of `verify` makes."""

    only: Sequence[str] = ()  # leading parts of names, as in ``cells/two-term``; empty: all
    seed: str = field(default_factory=weekly_seed)  # of random draws; by default the week
    draws: int = DRAWS  # number of random draws
    record: Path = RECORD  # folder of the golden record; by default tests/golden
    # problems with published results; None selects the problems of the package
    problems: Sequence["Problem"] | None = None
    thin: bool = False  # only a few checks of every kind, for `verify --self-test`

    def asks(self, id: str) -> bool:
        """Return whether the check `id` is requested."""
        return selected(id, self.only)

    def may_ask(self, id: str) -> bool:
        """Return whether a check whose id equals or begins with `id` may be requested."""
        return may_hold(id, self.only)

    def name_draw(self, number: int, subject: str = "") -> Name:
        """Return the name of the check of `subject` in random draw `number`."""
        draws = f" --draws {self.draws}" if self.draws > DRAWS else ""
        options = f"{draws} --seed {shlex.quote(self.seed)}"
        return Name("random", subject, str(number), options=options)

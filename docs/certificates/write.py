"""The certificates of the documents: proofs of the solutions of the seven cases.

``python -m docs.certificates.write``, in a checkout, writes the certificates beside this file. The
check of a certificate needs nothing but Python (`pyharness/truth/certificate_checker.py`).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pyharness.history.claims.laboratory import starts
from pyharness.model.assumptions import open_starts
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.truth.certificate import prove

HERE = Path(__file__).parent
DIGITS = 25
TIMES = (1.0, 3.0)
"""The times (s) of the proved solutions of all certificates."""


@dataclass(frozen=True)
class Planned:
    """A certificate to be written: the name of its file, its case, scene and times (s)."""

    name: str
    case: int
    scene: Scene
    times: Sequence[float]

    def text(self) -> str:
        """Return the text of the file, with a proof that is computed now."""
        proof = prove(self.scene, self.times, DIGITS)
        return json.dumps(proof.certificate, separators=(",", ":")) + "\n"


def planned() -> list[Planned]:
    """Return all certificates to be written.

    Each case has one with its initial omega. This certificate has rows at the times of the case's
    steps, with which the results of the programs are compared, and at 1.5 s for a limit. A case
    whose initial omega the thesis does not give has one for each other omega that this edition
    tries.
    """
    found = []
    for case in case_numbers():
        scene = case_scene(case)
        times = sorted({*scene.times(), *TIMES, *(t / 2.0 for t in TIMES)})
        found.append(Planned(file_name(case), case, scene, times))
        if case in open_starts():
            for start in starts():
                if start != scene.omega:
                    name = f"case-{case}-from-{'-'.join(f'{x:g}' for x in start)}.json"
                    found.append(Planned(name, case, replace(scene, omega=start), TIMES))
    return found


def file_name(case: int) -> str:
    """Return the name of the certificate of a case with its initial omega."""
    return f"case-{case}.json"


def main() -> None:
    """Write all certificates."""
    for each in planned():
        (HERE / each.name).write_text(each.text(), encoding="ascii")


if __name__ == "__main__":
    main()

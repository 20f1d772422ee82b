"""The certificates of the documents: proofs of the solutions of the seven cases.

``python -m docs.certificates.write``, in a checkout, writes the certificates beside this file.
`pyharness/truth/certificate_checker.py` checks them with Python alone.
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
"""Times (s) in all certificates."""


@dataclass(frozen=True)
class Planned:
    """A certificate to be written: name of its file, case, scene and times (s)."""

    name: str
    case: int
    scene: Scene
    times: Sequence[float]

    def text(self) -> str:
        """Compute the proof, and return the text of the file."""
        proof = prove(self.scene, self.times, DIGITS)
        return json.dumps(proof.certificate, separators=(",", ":")) + "\n"


def planned() -> list[Planned]:
    """Return all certificates to be written.

    The certificate of a case has rows at the times of its steps, to compare the programs, at
    `TIMES`, and at half of `TIMES`, for the limit of the Runge-Kutta program. A case whose initial
    omega the thesis does not give has further certificates, for other initial omegas.
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

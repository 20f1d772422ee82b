"""Write leaves (C code of the Taylor series) of ready torques, and a header with their keys.

The leaves are for a body with three different moments, and for torques whose arguments have no
zeros, except some wheels and drag.
"""

from typing import Any

from pyharness import Scene, TorqueLaw
from pyharness.engine.system.leaf_text import key, structure
from pyharness.engine.system.leaves import names, source
from pyharness.engine.system.recorded import listing, system_of
from pyharness.engine.torques.term_file import KINDS


def texts() -> dict[str, str]:
    """Return the C source of all leaves with a table of them, and the header, by file."""
    three = (0.1, 0.2, 0.3)
    waves = [(three, 0.4), (three, 0.5), (three, 0.6)]
    terms: list[Any] = [
        *(each.function(**each.sample | own) for each in KINDS.values() for own in each.leaves),
        *(TorqueLaw(three, three, waves[:n], frame="space") for n in range(4)),
    ]
    structures = {}
    for term in terms:
        for attitude in (None, (1.0, 0.0, 0.0, 0.0)):
            scene = Scene("ready", (1.0, 2.0, 3.0), (1.0, 1.2, 1.5), torque=term, attitude=attitude)
            if attitude or not scene.torque.needs_attitude:
                shape = structure(listing(system_of(scene)))
                assert shape is not None
                structures[key(shape)] = shape
    parts = ['#include "tape.h"']
    for number, shape in enumerate(structures.values()):
        text = source(shape, f"_{number}")
        # Common definitions are written once.
        parts.append(text if number == 0 else text[text.index("static void expand") :])
    each = [
        f"{{{', '.join(names(shape, f'_{number}'))}}}"
        for number, shape in enumerate(structures.values())
    ]
    parts.append(f"const struct leaves OF_LEVEL(ready_leaves, LEVEL)[] = {{{', '.join(each)}}};")
    keys = ", ".join(f"INT64_C({each})" for each in structures)
    return {
        "ready_leaves.c": "\n".join(parts) + "\n",
        "ready_keys.h": f"static const int64_t ready_keys[] = {{{keys}}};\n",
    }

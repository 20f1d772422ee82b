"""Tables, and the functions of a tape (recorded operations), for arrays."""

from typing import Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.tape import Functions, Table


def table_values(table: Table, times: Any) -> Array:
    piece = np.maximum(0, np.searchsorted(table.breaks, times, side="right") - 1)
    c0, c1, c2, c3 = table.pieces[piece].T
    s = times - table.breaks[piece]
    found: Array = c0 + s * (c1 + s * (c2 + s * c3))
    return found


def without_equal_constants(table: Table) -> Table:
    """Return a continuous table without breaks between equal constants."""
    # Equal neighbours must be constants, because the table is continuous.
    changes = (table.pieces[1:] != table.pieces[:-1]).any(axis=1)
    kept = np.concatenate(([True], changes))
    return Table(table.breaks[kept], table.pieces[kept])


def value_of_table(table: Table, time: Any) -> Any:
    return time.of_table(table) if len(table.breaks) > 1 else float(table.pieces[0, 0])


OF_NUMPY = {kind: getattr(np, each.of_numpy) for kind, each in WITH_DERIVATIVE.items()}
ARRAYS: Functions[Any] = Functions(
    float, np.sqrt, np.exp, np.tanh, np.sin, np.cos, table_values, OF_NUMPY,
    lambda x: np.where(x > 0.0, 1.0, 0.0), np.floor, lambda h, x, y: np.where(h > 0.0, x, y),
)  # fmt: skip

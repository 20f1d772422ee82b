"""Pictures of the atlas, drawn from the stores of its sweeps.

``python -m docs.atlas.draw stops stops.zarr``, in a checkout, draws the store of ``stops.toml``,
and writes ``stops.png`` and its numbers, ``stops.csv``, beside this file.
"""

import sys
from pathlib import Path

from docs.atlas.collocation import collocation_picture
from docs.atlas.stability import stability_picture
from docs.atlas.stops import stops_picture
from docs.atlas.torque import torque_picture
from pyharness.model.errors import InputError
from pyharness.sweep.store import check_store, opened
from pyharness.sweep.sweep_file import read_sweep
from pyharness.views.pictures import saved

PICTURES = {
    "stability": stability_picture,
    "torque": torque_picture,
    "stops": stops_picture,
    "collocation": collocation_picture,
}
_HERE = Path(__file__).parent


def main(name: str, path: str) -> None:
    """Draw the picture `name` from the store at `path`."""
    sweep = read_sweep(_HERE / f"{name}.toml")
    if not check_store(sweep, path):
        raise InputError(f"'{path}' is not there; 'pyharness sweep' makes it")
    with opened(sweep, path) as store:
        if not all(store.done()):
            raise InputError(f"'{path}' is not finished; 'pyharness sweep' goes on with it")
        content = saved(PICTURES[name](store), str(_HERE / f"{name}.png"))
    for file, data in content.items():
        Path(file).write_bytes(data)


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in PICTURES:
        sys.exit(f"usage: python -m docs.atlas.draw {{{','.join(PICTURES)}}} STORE")
    try:
        main(*sys.argv[1:])
    except InputError as error:
        sys.exit(str(error))

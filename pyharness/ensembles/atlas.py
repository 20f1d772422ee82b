"""The atlas: pictures of sweeps whose file asks for one by name, `picture = "stops"`."""

from collections.abc import Callable
from typing import NamedTuple

from pyharness.ensembles.atlas_collocation import collocation_picture
from pyharness.ensembles.atlas_stability import stability_picture
from pyharness.ensembles.atlas_stops import stops_picture
from pyharness.ensembles.atlas_torque import torque_picture
from pyharness.ensembles.store import Store
from pyharness.ensembles.sweep import Sweep
from pyharness.model.errors import InputError, unknown
from pyharness.model.report import Picture


class Page(NamedTuple):
    """A picture: what draws it, and the dimensions and reductions that it takes."""

    draw: Callable[[Store], Picture]
    dimensions: tuple[str, ...]
    reductions: tuple[str, ...]


_SQUARE = ("body.square.2", "body.square.1")
PAGES = {
    "stability": Page(stability_picture, ("azimuth", "tilt", *_SQUARE), ("flip-time",)),
    "torque": Page(torque_picture, ("torque", "tilt", *_SQUARE), ("flips", "largest-tilt")),
    "stops": Page(
        stops_picture, ("listing", "case", "step_size", "lipschitz"), ("stop-variable", "status")
    ),
    "collocation": Page(
        collocation_picture,
        ("program", "listing", "step_size", "omega.magnitude"),
        ("overflow-time", "drift"),
    ),
}


def check_page(sweep: Sweep) -> None:
    """Refuse a name that is no page, and a sweep that it can't draw."""
    if not sweep.picture:
        return
    if sweep.picture not in PAGES:
        raise unknown("picture", sweep.picture, PAGES, "picture")
    page = PAGES[sweep.picture]
    if tuple(sweep.dimensions) != page.dimensions:
        raise InputError(
            f"picture {sweep.picture}: dimensions {', '.join(sweep.dimensions)}; allowed: "
            f"{', '.join(page.dimensions)}, in this order"
        )
    names = [asked.name for asked in sweep.reductions if asked.name == asked.reduction]
    for name in page.reductions:
        if name not in names:
            raise InputError(f"picture {sweep.picture}: it takes the reduction {name}")


def atlas_picture(store: Store) -> Picture:
    """Draw the picture that a sweep's file asks for."""
    return PAGES[store.sweep.picture].draw(store)

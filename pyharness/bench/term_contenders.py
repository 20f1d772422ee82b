"""The contenders of `bench --terms`."""

from collections.abc import Sequence
from dataclasses import replace

from pyharness.bench.contenders import TOLERANCES, Maker, SceneContender, list_own_contenders
from pyharness.bench.ensemble_contenders import EnsembleContender, own_ensembles
from pyharness.bench.ensemble_peers import ensemble_peers
from pyharness.bench.peers import heyoka_maker, peers
from pyharness.bench.term_loads import TermScene
from pyharness.model.scene import Scene

OURS, HEYOKA, DOP853 = "auto", "heyoka", "solve_ivp-dop853"
MANY_OURS, MANY_HEYOKA = "taylor", "heyoka-batch"
# The tolerance of DOP853, at which our solver is compared with it.
DOP853_TOLERANCE = 1e-9
# Coarser tolerances give errors above all target errors. The finest is the default of heyoka.
_TOLERANCES = (*(each for each in TOLERANCES if each < 1e-4), 2.0**-52)


def term_methods() -> list[SceneContender]:
    """Return our contender for single bodies, `auto`, without coarse tolerances."""
    return [
        replace(each, settings=_TOLERANCES[:-1])
        for each in list_own_contenders()
        if each.name == OURS
    ]


def term_peers(scenes: Sequence[TermScene]) -> list[SceneContender]:
    """Return heyoka and DOP853, installed or not.

    heyoka computes a ready term's torque by its formula, and an expression's from its tape.
    """
    formulas = {each.scene.name: each.formula for each in scenes}

    def prepare(scene: Scene) -> Maker:
        return heyoka_maker(scene, formulas[scene.name])

    known = {each.name: each for each in peers()}
    return [
        replace(known[HEYOKA], prepare=prepare, settings=_TOLERANCES),
        replace(known[DOP853], settings=(DOP853_TOLERANCE,)),
    ]


def body_contenders() -> list[EnsembleContender]:
    """Return our and heyoka's contender for many bodies, each on one core."""
    found = [*own_ensembles(), *ensemble_peers()]
    return [replace(each, threads=(1,)) for each in found if each.name in (MANY_OURS, MANY_HEYOKA)]

"""A seed gives the same random scenes in every version of the project."""

import hashlib
import re
from itertools import islice
from random import Random

import pytest

from pyharness.bench.random_loads import BODIES, LAWS, SPEEDS, WAVES, by_torque
from pyharness.checks.scenes.random_scenes import KINDS, NASTY, draw, random_scene, text_generator
from tests.checks.scenes import free_motions, timed_kinds
from tests.checks.scenes.cancelling import LEFT, MERGED, cancelling
from tests.checks.scenes.timed_kinds import timed_scenes


def digest(*found: object) -> str:
    return hashlib.sha256(repr(found).encode()).hexdigest()[:16]


# `repr` shows every drawn number to the last bit.
@pytest.mark.parametrize(
    ("seed", "recorded"), [("base", "64630c69cdde089e"), ("2026-W47", "f787324a4f96851d")]
)
def test_draws_are_as_they_were(seed: str, recorded: str) -> None:
    found = [draw(seed, number) for number in range(400)]
    assert {each.scene.name for each in found} == {"plain", *NASTY}
    assert digest([(each.scene, each.listing.label, each.time) for each in found]) == recorded


def test_scenes_by_torque_are_as_they_were() -> None:
    found = []
    for law in LAWS:
        for body in BODIES:
            for speed in SPEEDS if law in WAVES else ("",):
                found.append(by_torque(Random(f"{law} {body} {speed}"), "", law, speed, body))
    assert digest(found) == "7234121a037dad4d"


@pytest.mark.parametrize(
    ("kind", "recorded"), [("pointing", "59984f392d4480af"), ("driven", "cd460ea41eb98454")]
)
def test_scenes_of_trials_are_as_they_were(kind: str, recorded: str) -> None:
    seeds = [f"attitude {k}" if kind == "pointing" else k for k in range(8)]
    assert digest([random_scene(kind, seed, "name") for seed in seeds]) == recorded


def test_scenes_with_times_are_as_they_were() -> None:
    found = [list(islice(timed_scenes(kind, [1982, 3]), 40)) for kind in timed_kinds.KINDS]
    # The last digits of powers depend on the processor.
    rounded = re.sub(r"-?\d+\.\d+(e[-+]\d+)?", lambda m: f"{float(m[0]):.12g}", repr(found))
    assert digest(rounded) == "1aed882b45d60aec"


def test_other_motions_are_as_they_were() -> None:
    tops = ("plain", "middle axis", "near symmetry", "near separatrix", "wild")
    recorded = {
        "42ad277f30fc4feb": [cancelling(kind, k) for kind in (*MERGED, *LEFT) for k in range(20)],
        "0072db722665f989": [free_motions.draw(Random(k), k) for k in free_motions.KINDS],
        "a1b68adb3412768f": [free_motions.draw_top(Random(kind), kind) for kind in tops],
    }
    assert list(map(digest, recorded.values())) == list(recorded)
    assert text_generator("ensemble/a").random() == 0.011321796958609465


def test_every_kind_gives_a_scene_with_its_name() -> None:
    for kind in KINDS:
        assert random_scene(kind, 1, kind).name == kind
        assert repr(random_scene(kind, 1)) == repr(random_scene(kind, 1))


def test_far_scales_are_far() -> None:
    for number in range(20):
        assert not 1e-4 < max(map(abs, random_scene("far scale", number).omega)) < 1e4

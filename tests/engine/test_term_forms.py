"""Ready terms that Python made, and their sums, are written to scene files and read again."""

import itertools
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, StateTorque, TorqueLaw, solve, torques
from pyharness.model.expressions import parsed
from pyharness.model.records import scene_record
from pyharness.model.scene_file import MOST_TERMS
from pyharness.model.scene_report import heading
from tests.engine.test_term_file import LAW, MATRIX, SPACE, TERMS, is_documented, restored
from tests.engine.test_terms import INERTIA

WRITTEN = parsed(["-k*w1**3", "q0", "0"], {"k": 0.1})


def scene_with(torque: Any, **body: Any) -> Scene:
    """Return a scene with a torque, and moments unless `body` has an inertia."""
    return Scene("made", (1.0, 2.0, 3.0), torque=torque, attitude=(0.5, 0.5, -0.5, 0.5),
                 **(body or {"moments": (3.0, 2.0, 1.5)}))  # fmt: skip


def check_restored(scene: Scene, folder: Path) -> None:
    """Check that the scene read from a scene's text has the same torque and tape."""
    again = restored(scene, folder)
    assert isinstance(again.torque, StateTorque)
    assert isinstance(scene.torque, StateTorque)
    assert again.torque.tape == scene.torque.tape
    assert again == scene
    assert is_documented(scene_record(scene))


@pytest.mark.parametrize("number", range(20))
def test_random_sum_is_restored_with_its_order_and_grouping(number: int, tmp_path: Path) -> None:
    source = Random(f"sum {number}")
    chosen = [make() for _, make in source.sample(TERMS, source.choice((2, 3, 4, 5)))]
    others: list[Any] = [LAW, SPACE, TorqueLaw(), WRITTEN, LAW]
    groups: list[Any] = [*chosen, others[number % 5]]
    if number % 5 == 4:  # two laws about the same axes
        groups.append(TorqueLaw((0.1, 0.2, 0.3), cosines=[((0.1, 0.7, 0.3), 0.3)]))
    source.shuffle(groups)
    while len(groups) > 1:
        place = source.randrange(len(groups) - 1)
        groups[place : place + 2] = [groups[place] + groups[place + 1]]
    check_restored(scene_with(groups[0]), tmp_path)


def test_every_form_of_an_argument_is_restored(tmp_path: Path) -> None:
    given: list[StateTorque] = [
        torques.damping(np.float32(0.1)),
        torques.damping(np.array([1, 2, 3])),
        torques.damping(x * 0.1 for x in range(3)),
        torques.damping(np.eye(3) * 0.3),
        torques.damping(0.0),
        torques.drag(iter([1, np.array(MATRIX)])),  # type: ignore[arg-type]
        torques.drag([0.5], per_axis=np.True_),  # type: ignore[arg-type]
        torques.rate_control(1e-300, target=(0.0, -0.0, 5e-324)),
        torques.attitude_control(1, 2, target=(x for x in (3, 4, 5, 6))),
        torques.wheels((1, 2, 3), motor=(0, 0, 0)),
        torques.wheels((1, 2, 3), motor=TorqueLaw(sines=[((0, 0, 0), 1.0)])),
        torques.gravity_gradient((2, 2, 2), 0.5),
        torques.gravity_gradient(INERTIA, 0.5),
        torques.gravity_gradient(np.diag([5.0, 4.0, 3.0]), 0.5),
        torques.in_space(TorqueLaw((1, 0, 0), frame="space")),
        torques.table(iter([0, 1, 2, 5]), np.arange(12).reshape(4, 3), "cubic"),
        torques.pulses(iter([1, 0]), (0.5, 0.25), iter([(1, 2, 3), (1, 2, 3)])),
        torques.pulses((0.1, 0.3), (0.2, 0.1), (1e22, 0.0, -1.0)),
    ]
    for torque in given:
        check_restored(scene_with(torque, inertia=INERTIA), tmp_path)
    assert isinstance(sum(given), StateTorque)
    check_restored(scene_with(sum(given)), tmp_path)


def test_the_restored_scene_has_the_same_solution(tmp_path: Path) -> None:
    torque = torques.damping(0.3) + LAW + torques.gravity_gradient((3.0, 2.0, 1.5), 0.7)
    scene = scene_with(torque)
    found = [solve(each, 2.0, attitude=True) for each in (scene, restored(scene, tmp_path))]
    assert found[0].omega.tolist() == found[1].omega.tolist()
    assert "N m + damping + gravity gradient" in heading(scene)[1]
    assert repr(scene.torque).startswith("StateTorque(TorqueLaw(")


def test_law_that_cancels_is_not_written(tmp_path: Path) -> None:
    torque = TorqueLaw((1.0, 2.0, 3.0)) + torques.damping(0.3) + TorqueLaw((-1.0, -2.0, -3.0))
    assert torque == torques.damping(0.3)
    check_restored(scene_with(torque), tmp_path)


def test_sum_of_fifty_terms_is_restored(tmp_path: Path) -> None:
    terms = itertools.islice(itertools.cycle(make() for _, make in TERMS), MOST_TERMS)
    check_restored(scene_with(sum(terms)), tmp_path)

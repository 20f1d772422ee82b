"""The nodes at which methods return their steps, and the dense output from these."""

from pyharness.engine.problem.problem import problem_of
from pyharness.model.dense_output import POINTS, DenseOutput, Pieces
from pyharness.model.scene import Scene

STEP_NODES = 0.5 + 0.5 * POINTS  # in parts of a step
MOST_STEPS = 20_000  # in `sol`, to limit its memory


def steps_output(scene: Scene, pieces: Pieces) -> DenseOutput:
    low, high = pieces.edges[[0, -1]].tolist()
    rates = problem_of(scene, scene.attitude is not None).rates
    return DenseOutput(low, high, pieces, rates, len(scene.states))

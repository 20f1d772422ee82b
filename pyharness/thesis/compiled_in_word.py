"""Runs of the compiled programs in a floating-point format of IEEE 754.

Numbers are exchanged with the extension module as bytes.
"""

import itertools
from dataclasses import replace

import numpy as np

from pyharness.model.codes import Waves
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, REFUSED, columns, extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.compiled import program_arguments, read_rows
from pyharness.thesis.in_word import scene_in
from pyharness.thesis.interchange import from_bytes, n_bytes, to_bytes
from pyharness.thesis.word import Word


def run(
    scene: Scene, listing: Listing, word: Word, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run a listing's compiled program in the arithmetic `word`; the result is `in_word.run`'s.

    Raise InputError if the compiler does not support the word, or angles of the torque are too
    large for its sine; NotBuiltError if the extension is not built.
    """
    if word.p > 53:
        _check_angles(scene)
    inside = scene_in(scene, word)
    given = program_arguments(inside, listing, lipschitz, may_stop, True)
    law = inside.body_torque
    waves = [columns(each, object) for each in (law.sines, law.cosines)]
    triples = itertools.chain(
        given.body, given.omega, given.masses, given.forces,
        given.torque_constant, given.torque_rate, given.torque_first,
    )  # fmt: skip
    rows, ier, n_rows, status, evaluations, variable, quotient = extension().run_program_in_word(
        given.program,
        given.flags,
        given.by_moments,
        to_bytes(map(word, triples), word, 3, 7),
        to_bytes([given.step_size, word(lipschitz)], word, 2),
        given.torque_varies,
        *(to_bytes(map(word, each.T.flat), word, *each.shape) for each in waves),
        given.n_steps,
        may_stop,
        True,
    )
    if status == REFUSED:
        raise InputError(
            f"--word binary{8 * n_bytes(word)}: the compiler of this build does not have it; "
            "allowed: implementation python"
        )
    exact = from_bytes(rows[:, :, :n_rows], word).T
    results, found = exact.astype(np.float64), float(from_bytes(quotient, word)[()])
    ended = ENDS[status], variable, found
    trajectory = read_rows(listing, results, ier, evaluations, *ended)
    return replace(trajectory, exact=exact if n_rows else None)


def compiled_words() -> tuple[str, ...]:
    """Return the names of the words that the compiled programs support; none if not built."""
    try:
        from pyharness import _build
    except ImportError:
        return ()
    return tuple(_build.WORDS)


def _check_angles(scene: Scene) -> None:
    # In the collocation programs TIME grows with the square of the number of steps.
    latest = scene.step_size * scene.steps**2
    law = scene.law
    for _, frequency in (*law.sines, *law.cosines):
        if not abs(frequency) * latest < 2.0**Waves.ANGLE_BITS:
            raise InputError(
                f"frequency {frequency:g} rad/s over {scene.steps} steps of {scene.step_size:g} s: "
                f"too large for the compiled sine of 128 bits; allowed: implementation python"
            )

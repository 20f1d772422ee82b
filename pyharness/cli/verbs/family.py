"""The verb `family`."""

import argparse
from typing import Any

from pyharness.cli import options as shared
from pyharness.history.family import POINTS, WEIGHTINGS, Member, family_report, order_table
from pyharness.thesis.programs import BINARY64, WORD_NAMES

_OF_A_MEMBER = ("weighting", "terms", "points", "corrections")
_DEFAULT_CASE = "5"
OPTIONS = {
    **shared.SCENE,
    "--case N": f"Case 1 to 7 of the thesis (default: {_DEFAULT_CASE}, without --scene).",
    "--weighting W": "Measure one method, with this weighting of its residual: "
    f"{', '.join(WEIGHTINGS)} (default: several methods; collocation alone if --terms, --points or "
    "--corrections is given).",
    "--terms N": "Number of terms of the trial function, 1 to 12 (default 2).",
    "--points P": "Collocation points in each step: thesis (equally spaced, default), gauss "
    "(Legendre nodes), or one fraction of the step for each term, as in 0.3,0.6.",
    "--corrections K": "Number of times that each step corrects its first estimate, 0 to 100 "
    "(default 1).",
    "--lost": "Look for programming mistakes that explain why three unprinted programs of the "
    "thesis failed (section IV.2).",
    "--word W": "Arithmetic of the programs of --lost: "
    f"{', '.join(WORD_NAMES)} (default {WORD_NAMES[0]}). cdc48 truncates results, as CDC "
    "computers did.",
    **shared.outputs(plot=""),
}
EXAMPLE = "family --case 5 --weighting galerkin --terms 3"


def run(options: argparse.Namespace) -> int:
    """Print measured and derived orders; return 1 if a measured order is below the derived one."""
    if options.lost:
        return _lost(options)
    shared.refuse(options, "the measurement of orders; give --lost", ("word",))
    if options.case is None and options.scene is None:
        options.case = _DEFAULT_CASE
    scene = shared.chosen_scene(options)
    one = any(getattr(options, name) is not None for name in _OF_A_MEMBER)
    members = [_member(options)] if one else None
    shared.check_outputs(options)
    found = order_table(scene, members, shared.progress)
    failed = any(each.misses for each in found)
    return shared.show(family_report(scene, found), options, failed=failed)


def _member(options: argparse.Namespace) -> Member:
    points: Any = options.points
    if points is not None and points not in POINTS:
        letters = all(character.isalpha() or character == "-" for character in str(points))
        if not (points and letters):
            points = tuple(shared.numbers(options.points, "--points"))
    fields = {"weighting": options.weighting, "points": points}
    for name in ("terms", "corrections"):
        text = getattr(options, name)
        fields[name] = None if text is None else shared.whole(text, f"--{name}")
    return Member(**{name: value for name, value in fields.items() if value is not None})


def _lost(options: argparse.Namespace) -> int:
    from pyharness.history.lost import lost_report, ranked

    shared.refuse(options, "--lost", (*shared.SCENE, *_OF_A_MEMBER))
    shared.check_known("word", options.word, WORD_NAMES)
    shared.check_outputs(options)
    word = options.word or BINARY64
    return shared.show(lost_report(ranked(word), word), options)

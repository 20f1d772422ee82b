"""Values from Python: every valid form is accepted."""

import dataclasses
import json
import re
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare, read_scene, solve, subset
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.plan.report import trajectory_report
from pyharness.model.errors import InputError
from pyharness.model.listing import Listing
from pyharness.model.records import scene_record
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading
from pyharness.thesis import compiled
from pyharness.views.render import json_text, render
from tests.refused import refused

LAW = TorqueLaw((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), (((1.0, 0.0, 0.5), 4.0),))
PLAIN = Scene("brick", (0.5, 1.0, 2.0), (40.0, 30.0, 20.0), torque=LAW, step_size=0.5, steps=7)

# Each pair converts three numbers, and one number, to another form of the same value.
FORMS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "list": (list, float),
    "array": (np.array, np.float64),
    "float32": (lambda x: np.array(x, dtype="f4"), np.float32),
    "big-endian": (lambda x: np.array(x, dtype=">f8"), lambda x: np.array(x)),
    "object": (lambda x: np.array(x, dtype=object), Fraction),
    "generator": (iter, Decimal),
    "fractions": (lambda x: [Fraction(v) for v in x], Fraction),
    "decimals": (lambda x: tuple(map(Decimal, x)), Decimal),
    "scalars": (lambda x: [np.float64(x[0]), np.float16(x[1]), np.longdouble(x[2])], np.longdouble),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_numbers_makes_the_same_scene(form: str) -> None:
    three, one = FORMS[form]
    waves: Any = (wave for wave in [[three((1.0, 0.0, 0.5)), one(4.0)]])
    law = TorqueLaw(three((1.0, 2.0, 3.0)), three((0.0, 0.0, 1.0)), waves)
    scene = Scene(
        "brick", three((0.5, 1.0, 2.0)), moments=three((40.0, 30.0, 20.0)), torque=law,
        step_size=one(0.5), steps=np.int64(7),
    )  # fmt: skip
    assert scene == PLAIN
    assert hash(scene) == hash(PLAIN)
    assert repr(scene) == repr(PLAIN)
    assert dataclasses.replace(scene) == PLAIN
    assert json.loads(json_text(scene_record(scene))) == scene_record(PLAIN)
    for field in [scene.omega, scene.moments, law.constant, law.rate, law.sines[0][0]]:
        assert type(field) is tuple
        assert all(type(x) is float for x in field or ())
    assert [type(x) for x in (scene.step_size, scene.steps, law.sines[0][1])] == [float, int, float]
    forces = Scene("", (1, 2, 3), [3, 2, 1], masses=three((1.0, 2.0, 3.0)), forces=three((0, 1, 2)))
    assert (forces.masses, forces.forces) == ((1.0, 2.0, 3.0), (0.0, 1.0, 2.0))


SAME_WORDS: list[tuple[str, Callable[[], object]]] = [
    ("[initial]\nomega = [1, 2, true]", lambda: Scene("", [1, 2, True], (3, 2, 1))),
    ("[run]\nsteps = 0", lambda: Scene("", (1, 2, 3), (3, 2, 1), steps=0)),
    ("[torque]\nrate = [0, inf, 0]", lambda: TorqueLaw(rate=(0, np.inf, 0))),
    ("[torque]\nsines = [{ amplitude = [1, 2], frequency = 3 }]",
     lambda: TorqueLaw(sines=[((1, 2), 3)])),
]  # fmt: skip


@pytest.mark.parametrize(("text", "call"), SAME_WORDS, ids=range(len(SAME_WORDS)))
def test_a_file_is_refused_with_the_words_of_python(
    text: str, call: Callable[[], object], tmp_path: Path
) -> None:
    path = tmp_path / "scene.toml"
    start = "" if "initial" in text else "[initial]\nomega = [1, 2, 3]\n"
    path.write_text(f"[body]\nmoments = [3, 2, 1]\n{start}{text}\n")
    with pytest.raises(InputError) as in_file:
        read_scene(path)
    with pytest.raises(InputError) as in_python:
        call()
    assert str(in_file.value) == f"scene file '{path}': {in_python.value}"


@pytest.mark.sampled
@pytest.mark.parametrize("method", ["auto", "taylor", "dop853", "gauss-4", "rk4", "reference"])
def test_times_on_both_sides_are_two_marches(method: str) -> None:
    tolerance = max(1e-9, METHODS[method].finest)
    times = [-2.0, -0.5, 0.0, 0.25, 1.5]
    backward = solve(PLAIN, [-0.5, -2.0], method, tolerance)
    forward = solve(PLAIN, [0.0, 0.25, 1.5], method, tolerance)
    both = solve(PLAIN, times, method, tolerance)
    np.testing.assert_array_equal(both.omega, [*backward.omega[::-1], *forward.omega])
    assert both.time.tolist() == both.recorded_time.tolist() == times
    assert both.steps == backward.steps + forward.steps
    assert both.evaluations == backward.evaluations + forward.evaluations
    assert both.ended == "complete"
    turned = solve(PLAIN, times[::-1], method, tolerance)
    np.testing.assert_array_equal(turned.omega, both.omega[::-1])
    assert turned.time.tolist() == times[::-1]
    rows = prepare(PLAIN, tolerance=1e-9).trajectory(PLAIN.omega, times)
    np.testing.assert_allclose(rows.omega, solve(PLAIN, times).omega, rtol=0.0, atol=3e-9)


@pytest.mark.parametrize("method", ["auto", "taylor", "dop853", "gauss-4"])
def test_zero_costs_nothing(method: str) -> None:
    one, two = (solve(PLAIN, times, method, 1e-9) for times in ([-1.0], [-1.0, 0.0]))
    assert (two.steps, two.evaluations) == (one.steps, one.evaluations)
    assert two.time.tolist() == [-1.0, 0.0]
    np.testing.assert_array_equal(two.omega, [*one.omega, PLAIN.omega])
    assert solve(PLAIN, 0.0, method, 1e-9).omega.tolist() == [list(PLAIN.omega)]


@pytest.mark.parametrize("method", ["auto", "dop853", "gauss-4"])
def test_rows_around_zero_are_kept_where_a_march_overflows(method: str) -> None:
    """Omega = 1 / (1 - t) on all axes is infinite at t = 1, or with the other sign at t = -1."""
    for sign in (1.0, -1.0):
        runaway = Scene("", (sign, sign, sign), coefficients=(1.0, 1.0, 1.0))
        times = [-2.0, -0.5, 0.0, 0.5, 2.0]
        kept = times[:4] if sign > 0.0 else times[1:]
        for asked, wanted in ((times, kept), (times[::-1], kept[::-1])):
            found = solve(runaway, asked, method, 1e-6)
            assert found.ended == "overflow"
            assert found.time.tolist() == wanted
            exact = [[sign / (1.0 - sign * t)] * 3 for t in wanted]
            np.testing.assert_allclose(found.omega, exact, rtol=1e-5)
    # An integration that ends before its first row leaves no row.
    found = solve(runaway, [-2.0, 0.5], method, 1e-6)
    assert (found.time.tolist(), found.ended) == ([0.5], "overflow")


TIMES: list[Any] = [
    1, 1.0, np.float32(1.0), np.array(1.0), [1], (1.0,), range(1, 2), np.array([1]),
    iter([1.0]), (t for t in [Fraction(1)]), [Decimal(1)], np.array([1.0], dtype=object),
]  # fmt: skip


def _words(value: Any) -> str:
    return re.sub(" at 0x[0-9a-f]+", "", repr(value))  # the same in every process


@pytest.mark.parametrize("times", TIMES, ids=_words)
def test_times_are_taken_in_every_form(times: Any) -> None:
    np.testing.assert_array_equal(solve(PLAIN, times).omega, solve(PLAIN, [1.0]).omega)


NASTY = "\x1b[31m red \x07\u202eevil\u2066 \r\nnew\tline \ud800 \x9b2J é 日本"
SHOWN = "\\x1b[31m red \\x07\\u202eevil\\u2066 new line \\ud800 \\x9b2J é 日本"[:60]


def test_a_name_that_steers_a_terminal_is_shown_escaped(tmp_path: Path) -> None:
    scene = dataclasses.replace(PLAIN, name=NASTY)
    assert scene.name == SHOWN
    assert dataclasses.replace(scene) == scene
    assert heading(scene)[0] == SHOWN
    assert SHOWN in repr(prepare(scene))
    listing = subset("two-term")
    run = compiled.run(scene, listing)
    record = render(trajectory_report(scene, "two-term", listing, "", run), "json")
    assert json.loads(record)["scene"]["name"] == SHOWN
    for length in range(55, 66):
        name = dataclasses.replace(PLAIN, name="x" * length + " \x1b y").name
        assert len(name) <= 60
        assert dataclasses.replace(PLAIN, name=name).name == name


@pytest.mark.parametrize("name", ["brick", "\U0001f600 日本", 'a "b" \\ c', "\\x1b"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_saved_scene_is_read_back_whatever_its_name(
    name: str, mark: bytes, tmp_path: Path
) -> None:
    """A byte order mark is ignored."""
    path = tmp_path / "scene.toml"
    scene = dataclasses.replace(PLAIN, name=name)
    path.write_bytes(mark + scene_text(scene).encode())
    assert read_scene(path) == read_scene(str(path)) == scene


@pytest.mark.skipif(np.finfo(np.longdouble).maxexp == 1024, reason="long double is a double here")
def test_long_double_of_more_range_is_too_large() -> None:
    solver = prepare(PLAIN)
    refused("", solver, (1.0, 2.0, np.longdouble("1e400")), 1.0)
    refused("", solver, (1.0, 2.0, 3.0), np.longdouble("1e400"))


def test_values_of_numpy_and_other_numbers_are_taken() -> None:
    yes: Any = np.True_
    assert solve(case_scene(3), 1.0, attitude=yes).attitude is not None
    assert case_scene(np.int64(3)) == case_scene(3)
    assert Listing("two-term", ["dt-accumulates"]) == subset("two-term", keep=["dt-accumulates"])
    for good in (np.float32(1e-6), np.array(1e-6), Fraction(1, 10**6), Decimal("1e-6")):
        assert solve(PLAIN, 1.0, "auto", good).ended == "complete"
        prepare(PLAIN, "auto", good)

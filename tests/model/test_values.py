"""Values from Python: every valid form is accepted, and any other is refused in one line."""

import dataclasses
import itertools
import json
import re
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyharness
from pyharness import (
    InputError,
    Listing,
    Scene,
    TorqueLaw,
    case_scene,
    prepare,
    read_scene,
    solve,
    subset,
)
from pyharness.methods.registry import METHODS
from pyharness.methods.report import trajectory_report
from pyharness.model.records import scene_record
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading
from pyharness.original import compiled
from pyharness.original.programs import PROGRAM_REGISTRY
from pyharness.views.json import json_text
from pyharness.views.render import render

PLAIN = Scene(
    "brick",
    (0.5, 1.0, 2.0),
    moments=(40.0, 30.0, 20.0),
    torque=TorqueLaw((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), (((1.0, 0.0, 0.5), 4.0),)),
    step_size=0.5,
    steps=7,
)

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
    fields = [scene.omega, scene.moments, law.constant, law.rate, law.sines[0][0]]
    for field in fields:
        assert type(field) is tuple
        assert all(type(x) is float for x in field or ())
    assert [type(x) for x in (scene.step_size, scene.steps, law.sines[0][1])] == [float, int, float]
    forces = Scene("", (1, 2, 3), [3, 2, 1], masses=three((1.0, 2.0, 3.0)), forces=three((0, 1, 2)))
    assert (forces.masses, forces.forces) == ((1.0, 2.0, 3.0), (0.0, 1.0, 2.0))


class _Evil:
    def __float__(self) -> float:
        raise ZeroDivisionError


GOOD: dict[str, Any] = {"name": "x", "omega": (1.0, 2.0, 3.0), "moments": (3.0, 2.0, 1.0)}
TOO_LARGE = 10**400
NOT_THREE: list[Any] = [
    3.0, "abc", "123", b"123", object(), (), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), np.zeros(4),
    itertools.count(), np.array(1.0), {1.0, 2.0, 3.0}, {1.0: 0, 2.0: 0, 3.0: 0}, 1j, TOO_LARGE,
]  # fmt: skip
NOT_NUMBERS: list[Any] = [
    None, "3", b"3", memoryview(b"3"), bytearray(b"3"), True, np.True_, 1j, np.complex128(1.0),
    [1.0], np.ones(1), object(), _Evil(), float("nan"), float("inf"), Decimal("sNaN"), TOO_LARGE,
    Fraction(TOO_LARGE), np.datetime64("2020"), 10**5000,
]  # fmt: skip
NO_VECTORS = [
    *NOT_THREE, *((1.0, 2.0, x) for x in NOT_NUMBERS), *((x, 2.0, 1.0) for x in NOT_NUMBERS),
    np.zeros((3, 1)), np.zeros((1, 3)),
]  # fmt: skip
NO_WAVES: list[Any] = [
    None, 3.0, "abc", True, [3.0], [None], ["ab"], [()], [((1.0, 2.0, 3.0),)], np.zeros(3),
    [((1.0, 2.0, 3.0), 1.0, 2.0)], [{"amplitude": [1, 2, 3], "frequency": 1}], {(1, 2): 3},
    *([(x, 1.0)] for x in NO_VECTORS), *([((1.0, 2.0, 3.0), x)] for x in NOT_NUMBERS),
]  # fmt: skip


def _refused(where: str, call: Callable[..., object], *given: Any, **named: Any) -> str:
    with pytest.raises(InputError) as caught:
        call(*given, **named)
    text = str(caught.value)
    assert text.startswith(where), text
    assert "\n" not in text
    assert len(text) < 250
    assert "allowed" in text or "belongs" in text or "must be" in text or "too large" in text, text
    return text


def test_what_is_no_vector_is_refused_everywhere() -> None:
    good = GOOD
    for bad in NO_VECTORS:
        _refused("[initial] omega", Scene, **{**good, "omega": bad})
        _refused("[body] moments", Scene, **{**good, "moments": bad})
        _refused("[body] coefficients", Scene, "x", (1.0, 2.0, 3.0), coefficients=bad)
        for name in ("masses", "forces"):
            _refused(name, Scene, **good, **{name: bad})
        for name in ("constant", "rate"):
            _refused(f"[torque] {name}", TorqueLaw, **{name: bad})
        _refused("omega0", prepare(PLAIN).trajectory, bad, 1.0)
    for name, bad in itertools.product(("sines", "cosines"), NO_WAVES):
        _refused(f"[torque] {name}", TorqueLaw, **{name: bad})
    for name in ("omega", "masses", "forces"):
        _refused("[initial] omega" * (name == "omega"), Scene, **{**good, name: None})
    for name in ("moments", "masses"):
        for number in (0.0, -1.0):
            where = {"moments": "[body] moments: I2 is", "masses": "masses: m2 is"}[name]
            _refused(where, Scene, **{**good, name: (1.0, number, 1.0)})


def test_other_fields_are_checked() -> None:
    good = GOOD
    for bad in (*NOT_NUMBERS, 0.0, -1.0, np.zeros(3)):
        _refused("[run] step_size", Scene, **good, step_size=bad)
    for bad in (2.5, 3.0, "3", True, np.True_, None, [3], 0, -1, np.array([3]), 1j, TOO_LARGE):
        _refused("[run] steps", Scene, **good, steps=bad)
    for bad in (None, "wave", (1.0, 2.0, 3.0), {}, TorqueLaw):
        _refused("[torque]", Scene, **good, torque=bad)
    for bad in (None, 3, b"x", ["x"]):
        _refused("name", Scene, **{**good, "name": bad})
    for bad in ("3", 3.5, True):
        _refused("case", Scene, **good, case=bad)
    with pytest.raises(InputError, match="either moments or coefficients"):
        Scene("x", (1.0, 2.0, 3.0))
    with pytest.raises(InputError, match="either moments or coefficients"):
        Scene(**good, coefficients=(1.0, 2.0, 3.0))


SAME_WORDS: list[tuple[str, Callable[[], object]]] = [
    ("[initial]\nomega = [1, 2, true]", lambda: Scene("", [1, 2, True], (3, 2, 1))),
    ("[run]\nsteps = 0", lambda: Scene("", (1, 2, 3), (3, 2, 1), steps=0)),
    ("[torque]\nrate = [0, inf, 0]", lambda: TorqueLaw(rate=(0, np.inf, 0))),
    (
        "[torque]\nsines = [{ amplitude = [1, 2], frequency = 3 }]",
        lambda: TorqueLaw(sines=[((1, 2), 3)]),
    ),
]


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


@pytest.mark.parametrize(
    "times",
    [
        None, "1", "", b"1", True, [True], ["1"], [None], 1j, [1j], np.array([1j]), [[1.0]],
        np.ones((1, 1)), np.ones((2, 2)), float("nan"), [float("inf")], TOO_LARGE, [TOO_LARGE],
        {1.0}, {1.0: 2.0}, object(), [], (), np.array([]), iter(()), [1.0, 1.0], [1.0, 3.0, 2.0],
        [-1.0, 1.0, 0.0], [0.0, -0.0], np.datetime64("2020"), np.array([True]),
    ],
    ids=_words,
)  # fmt: skip
def test_times_that_are_none_are_refused(times: Any) -> None:
    with pytest.raises(InputError, match=r"^times: [^\n]*$"):
        solve(PLAIN, times)
    with pytest.raises(InputError, match=r"^times: [^\n]*$"):
        prepare(PLAIN).trajectory((1.0, 2.0, 3.0), times)


@pytest.mark.parametrize("bad", ["1e-9", 1j, [1e-9], np.full(1, 1e-9), True, TOO_LARGE, _Evil()])
def test_tolerance_that_is_no_number_is_refused(bad: Any) -> None:
    for call in (lambda: solve(PLAIN, 1.0, "auto", bad), lambda: prepare(PLAIN, "auto", bad)):
        with pytest.raises(
            InputError, match=r"^tolerance is .*; allowed: a number from 1e-15 to 1"
        ):
            call()
    for good in (np.float32(1e-6), np.array(1e-6), Fraction(1, 10**6), Decimal("1e-6")):
        assert solve(PLAIN, 1.0, "auto", good).ended == "complete"
        prepare(PLAIN, "auto", good)


def test_other_arguments_of_public_calls_are_checked(tmp_path: Path) -> None:
    listing, program = subset("two-term"), PROGRAM_REGISTRY["two-term"]
    bad: Any
    for bad in (None, 3, "case 3", [PLAIN], Scene, object()):
        _refused("scene is ", solve, bad, 1.0)
        _refused("scene is ", prepare, bad)
        _refused("scene is ", program.run, bad, listing, "python")
    for bad in (None, 3, ["auto"], np.array(["auto"]), b"auto"):
        _refused("method is ", solve, PLAIN, 1.0, bad)
        _refused("method is ", prepare, PLAIN, bad)
        _refused("implementation is ", program.run, PLAIN, listing, bad)
        _refused("program is ", subset, bad)
        _refused("listing is ", program.run, PLAIN, bad)
        _refused("may_stop is ", program.run, PLAIN, listing, "python", 500.0, bad)
        _refused("velocity is ", program.run, PLAIN, listing, "fortran", 500.0, True, bad)
    for bad in (None, "500", [500.0], -1.0, float("nan"), TOO_LARGE):
        _refused("lipschitz", program.run, PLAIN, listing, "python", bad)
    for bad in (None, "dt-accumulates", 3, [3], np.array("x"), {"dt-accumulates": 1}):
        _refused("fix: ", subset, "two-term", fix=bad)
        _refused("defects: ", Listing, "two-term", bad)
    assert Listing("two-term", ["dt-accumulates"]) == subset("two-term", keep=["dt-accumulates"])
    with pytest.raises(
        InputError, match="program two-term: the listing belongs to program four-term"
    ):
        program.run(PLAIN, subset("four-term"))
    for bad in ("3", 3.0, None, True, 10**5000, 0, [3]):
        with pytest.raises(InputError, match="case"):
            case_scene(bad)
    assert case_scene(np.int64(3)) == case_scene(3)
    for bad in (None, 3, b"x", ["x"]):
        _refused("scene file: ", read_scene, bad)


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


@pytest.mark.filterwarnings("ignore")
def test_imaginary_part_is_never_dropped() -> None:
    """NumPy would drop it with a warning, which not everyone sees."""
    for given in (np.complex128(3.0 + 1.0j), np.complex64(3.0)):
        with pytest.raises(InputError):
            Scene("x", (1.0, 2.0, given), moments=(3.0, 2.0, 1.0))


def test_number_of_more_range_is_too_large() -> None:
    with pytest.raises(InputError, match="too large for binary64"):
        Scene("x", (1.0, 2.0, Decimal("1e400")), moments=(3.0, 2.0, 1.0))


@pytest.mark.skipif(np.finfo(np.longdouble).maxexp == 1024, reason="long double is a double here")
def test_long_double_of_more_range_is_too_large() -> None:
    solver = prepare(PLAIN)
    with pytest.raises(InputError, match="too large for binary64"):
        solver((1.0, 2.0, np.longdouble("1e400")), 1.0)
    with pytest.raises(InputError, match="too large for binary64"):
        solver((1.0, 2.0, 3.0), np.longdouble("1e400"))


# Without types, for arguments of wrong ones.
_UNTYPED: Any = pyharness


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda s: _UNTYPED.solve(s, 1.0, attitude="no"),
            "attitude is text; allowed: True or False",
        ),
        (
            lambda s: _UNTYPED.solve(s, 1.0, dense_output=None),
            "dense_output is nothing; allowed: True or",
        ),
        (
            lambda s: _UNTYPED.prepare(s, attitude=1),
            "attitude is a whole number; allowed: True or False",
        ),
        (lambda s: _UNTYPED.Stepper(s, attitude="no"), "attitude is text; allowed: True or False"),
        (
            lambda s: _UNTYPED.compare_methods(s, attitude="no"),
            "attitude is text; allowed: True or False",
        ),
        (
            lambda s: _UNTYPED.compare_methods(s, "auto"),
            r"methods is text; allowed: a list .*\['auto'\]",
        ),
        (
            lambda s: _UNTYPED.compare_programs(s, may_stop=1),
            "may_stop is a whole number; allowed: True or",
        ),
        (
            lambda s: _UNTYPED.compare_programs(s, "original"),
            "listings: text; allowed: a list of Listing",
        ),
        (lambda s: _UNTYPED.compare_programs(3), "scene is a whole number; it must be a Scene"),
        (lambda s: _UNTYPED.principal(None), "scene is nothing; it must be a Scene"),
        (
            lambda s: _UNTYPED.Scene("", s.omega, inertia=(4.0, 3.0, 2.0)),
            "for three moments: moments",
        ),
    ],
)
def test_wrong_kinds_of_arguments_are_refused(call: Callable[[Scene], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(case_scene(3))


def test_truth_values_of_numpy_are_accepted() -> None:
    assert _UNTYPED.solve(case_scene(3), 1.0, attitude=np.True_).attitude is not None

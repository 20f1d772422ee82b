"""The tool that changes the sources: its operators, its draws, its list of equivalent changes."""

from collections import Counter
from itertools import islice
from pathlib import Path

import pytest

from tests.campaigns.mutations import python_source, sample, text_source
from tests.campaigns.mutations.__main__ import caught_share, table
from tests.campaigns.mutations.ci import PLANTED, find
from tests.campaigns.mutations.reach import Check
from tests.campaigns.mutations.sample import (
    Mutation,
    draw,
    equivalent,
    files,
    lines_of_code,
    mutations,
    stale,
)
from tests.campaigns.mutations.text_source import FORTRAN, JAVASCRIPT, C, language_of
from tests.campaigns.mutations.tree import ROOT
from tests.campaigns.mutations.trial import Verdict, near


def _of_text(text: str, language: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for _, operator, changed in text_source.changes(text, language):
        found.setdefault(operator, []).append(changed())
    return found


@pytest.mark.parametrize(("language", "line", "operator", "wanted"), [
    (FORTRAN, "x = a - b", "sign", ["x = a + b"]),
    (FORTRAN, "x = -a", "sign", ["x = a"]),
    (FORTRAN, "x = a - b", "order of operands", ["x = b - a"]),
    (FORTRAN, "x = s%a(i, 1)/b(2)", "order of operands", ["x = b(2)/s%a(i, 1)"]),
    (FORTRAN, "x = a*b**c", "product", ["x = a/b**c"]),
    (FORTRAN, "if (a < b) x = c", "bound", ["if (a <= b) x = c"]),
    (FORTRAN, "if (a >= b) x = c", "bound", ["if (a > b) x = c"]),
    (FORTRAN, "if (a /= b) x = c", "equality", ["if (a == b) x = c"]),
    (FORTRAN, "if (a < b) x = c", "condition", ["if (.not. (a < b)) x = c"]),
    (FORTRAN, "if (a < b) x = c", "dropped statement", ["continue"]),
    (FORTRAN, "y = a .and. .not. b", "logical", ["y = a .or. .not. b", "y = a .and. b"]),
    (FORTRAN, "x = 1e-3_dp*y", "constant", ["x = 0.01_dp*y"]),
    (FORTRAN, "real(dp), parameter :: P = 2.0_dp", "constant", [
        "real(dp), parameter :: P = 2.02_dp"
    ]),
    (FORTRAN, "x = y(3)", "constant", ["x = y(4)"]),
    (FORTRAN, "x = max(y, z)", "min/max", ["x = min(y, z)"]),
    (FORTRAN, "call f(a, b(1, 2), c)", "swapped arguments", [
        "call f(b(1, 2), a, c)", "call f(a, c, b(1, 2))", "call f(a, b(2, 1), c)"
    ]),
    (FORTRAN, "do i = 1, n", "index", ["do i = 1, n - 1"]),
    (FORTRAN, "x = y + &\n  z", "dropped statement", ["continue\n"]),
    (C, "  if (!a && b != c) d = e - 1;", "logical", [
        "  if (!a || b != c) d = e - 1;", "  if (a && b != c) d = e - 1;"
    ]),
    (C, "  f(a, b);", "dropped statement", ["  ;"]),
    (JAVASCRIPT, "  if (a === b) return;", "equality", ["  if (a !== b) return;"]),
    (JAVASCRIPT, "  x[i] = Math.floor(y);", "min/max", ["  x[i] = Math.ceil(y);"]),
])  # fmt: skip
def test_operators_on_text(language: str, line: str, operator: str, wanted: list[str]) -> None:
    assert sorted(_of_text(line, language)[operator]) == sorted(wanted)


@pytest.mark.parametrize(("language", "text"), [
    (FORTRAN, "  ! x = 1 - 2\n  use kinds, only : dp\n  real(dp), intent(in) :: x(3)"),
    (FORTRAN, "  subroutine f(a, b)\n  end subroutine f\n#:if WORD == 3"),
    (C, "/* x = 1 - 2; */\n// x = 1;\n#define N (3 - 1)"),
    (JAVASCRIPT, "// x = 1 - 2;\nimport { a } from './b.js';"),
])  # fmt: skip
def test_nothing_but_code_is_changed(language: str, text: str) -> None:
    assert _of_text(text, language) == {}


def _of_python(text: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for _, operator, changed in python_source.changes(text):
        found.setdefault(operator, []).append(changed())
    return found


def test_operators_on_python() -> None:
    found = _of_python("if a < 2.0:\n    f(a - b, c)\n")
    assert found["mutmut swap op"] == [
        "if a <= 2.0:\n    f(a - b, c)\n",
        "if a < 2.0:\n    f(a + b, c)\n",
    ]
    assert found["constant"] == ["if a < 2.02:\n    f(a - b, c)\n"]
    assert found["condition"] == ["if not (a < 2.0):\n    f(a - b, c)\n"]
    assert found["dropped statement"] == ["if a < 2.0:\n    pass\n"]
    assert found["swapped arguments"] == ["if a < 2.0:\n    f(c, a - b)\n"]
    assert found["order of operands"] == ["if a < 2.0:\n    f((b) - (a), c)\n"]
    assert _of_python("x = np.argmin(y)\n")["min/max"] == ["x = np.argmax(y)\n"]


def test_what_is_for_readers_of_python_is_left_alone() -> None:
    text = '"""Text - 1."""\nimport a\n\n# 1 - 2\nclass B:\n    c: int | None\n    """3 - 1"""\n'
    assert _of_python(text) == {}
    found = _of_python('raise InputError(f"{a - 1}: no such", "two words", b - 1)\n')
    assert set(found) == {"dropped statement"}


def _drawn(seed: str, n: int) -> list[Mutation]:
    return list(islice(draw(seed), n))


@pytest.mark.campaign
def test_a_seed_gives_the_same_draw_and_another_seed_another() -> None:
    first = [(each.file, each.id) for each in _drawn("a", 2)]
    assert first == [(each.file, each.id) for each in _drawn("a", 2)]
    assert first[:1] != [(each.file, each.id) for each in _drawn("b", 1)]
    assert len(set(first)) == 2


@pytest.mark.campaign
def test_a_draw_can_be_restricted_to_parts_of_file_names(monkeypatch: pytest.MonkeyPatch) -> None:
    # Few and short files, because each file that is drawn is parsed.
    short = (
        "engine/steps/step_nodes.py",
        "modern/tape.f90",
        "checks/kinds.py",
        "engine/problem/sides.py",
    )
    some = [each for each in files() if each.endswith(short)]
    assert len(some) == len(short)
    monkeypatch.setattr(sample, "files", lambda: some)
    drawn = list(islice(draw("1", "steps,modern/tape"), 8))
    assert all("steps" in each.file or "modern/tape" in each.file for each in drawn)
    assert {each.is_compiled for each in drawn} == {False, True}
    whole = {(each.file, each.id) for each in islice(draw("1"), 50)}
    assert {(each.file, each.id) for each in drawn} < whole
    with pytest.raises(ValueError, match="no file that may be changed has nothing in its name"):
        next(draw("1", "nothing"))


def test_a_file_without_changes_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    one = find(*PLANTED[2][:2])
    changes = {"empty.py": [], "full.py": [one]}
    monkeypatch.setattr(sample, "files", lambda: [*changes])
    monkeypatch.setattr(sample, "lines_of_code", lambda file: 1000 if file == "empty.py" else 1)
    monkeypatch.setattr(sample, "mutations", changes.__getitem__)
    assert _drawn("a", 1) == [one]


def test_every_language_has_its_share() -> None:
    lines: Counter[str] = Counter()
    for file in files():
        lines[language_of(file)] += lines_of_code(file)
    assert set(lines) == {"Python", FORTRAN, C, JAVASCRIPT}
    assert lines["Python"] > lines[FORTRAN] > lines[C]
    core = {"pyharness/engine/methods/gauss.py", "pyharness/sweep/store.py", "web/port.js",
            "pyharness/thesis/word.py", "fortran/modern/taylor.f90", "pyharness/model/tape.py",
            "pyharness/engine/steps/step_nodes.py", "fortran/modern/tape_solve.f90"}  # fmt: skip
    assert core <= set(files())
    assert not any("report" in file or "picture" in file for file in files())


@pytest.mark.campaign
def test_names_are_unique_and_the_change_is_one() -> None:
    for file in ("pyharness/engine/methods/gauss.py", "fortran/modern/sphere.f90"):
        found = mutations(file)
        assert len({each.id for each in found}) == len(found)
        for each in found[::50]:
            assert each.changed() != (ROOT / file).read_text()
            assert each.diff().startswith(f"@@ -{each.line}")


def test_the_function_around_a_mutation_is_known() -> None:
    for (file, id, _), wanted in zip(
        PLANTED, ("factor", "evaluate", "_ordinal", "factor"), strict=True
    ):
        assert find(file, id).function() == wanted


@pytest.mark.parametrize(("module", "library"), [("taylor_march", "hot"), ("tape_march", "tapes")])
def test_tests_of_a_module_that_is_compiled_for_each_instruction_set_are_near(
    module: str, library: str
) -> None:
    mutation = next(each for each in mutations(f"fortran/modern/{module}.f90") if each.function())
    entered = Check("a", 1.0, frozenset({f"{module}_{library}:{mutation.function()}"}))
    other = Check("b", 1.0, frozenset({f"taylor_rows_{library}:{mutation.function()}"}))
    assert [each.name for each in near(mutation, [other, entered])] == ["a"]


@pytest.mark.parametrize(("file", "function", "entered"), [
    ("tape_step.f90", "step_tape", ":step_tape_avx512"),
    # A function that is inlined, and therefore entered by no test.
    ("tape_step.f90", "is_continued", ":step_tape_plain"),
    ("tape_terms.c", "expand_tape", ":expand_tape_avx2"),
])  # fmt: skip
def test_tests_of_a_function_with_the_name_of_an_instruction_set_are_near(
    file: str, function: str, entered: str
) -> None:
    changes = mutations(f"fortran/modern/{file}")
    mutation = next(each for each in changes if each.function() == function)
    checks = [Check("a", 1.0, frozenset({entered})), Check("b", 1.0, frozenset({":weigh"}))]
    assert [each.name for each in near(mutation, checks)] == ["a"]


def test_planted_mutations_and_their_tests_are_there() -> None:
    """The mutations of `--ci`; if a line changes, choose another one that a short test catches."""
    for file, id, test in PLANTED:
        assert find(file, id).id == id
        path, _, name = test.partition("::")
        assert f"def {name}(" in (ROOT / path).read_text()


@pytest.mark.campaign
def test_equivalent_ones_are_argued_and_still_there() -> None:
    known = equivalent()
    assert stale(known) == []
    assert all(len(why.split()) >= 4 for why in known.values())


def test_a_stale_entry_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "equivalent.toml"
    path.write_text(
        '["pyharness/engine/methods/gauss.py"]\n"sign 1: no = such" = "a reason of four words"\n'
    )
    assert stale(equivalent(path)) == ["pyharness/engine/methods/gauss.py: sign 1: no = such"]
    path.write_text('["no/such.py"]\n"sign 1: x" = "a reason of four words"\n')
    assert stale(equivalent(path)) == ["no/such.py: sign 1: x"]


def test_score_leaves_out_what_is_equivalent_or_does_not_count() -> None:
    one = find(*PLANTED[2][:2])
    outcomes = ["caught"] * 3 + ["lives", "equivalent", "same binary", "does not compile"]
    verdicts = [Verdict(one, outcome, None, 2.0) for outcome in outcomes]
    assert caught_share(verdicts) == 0.75
    assert table(verdicts).splitlines()[1].split() == ["all", "3", "1", "2", "1", "2.0"]


@pytest.mark.parametrize(
    ("text", "wanted"), [("2.0", "2.02"), ("1e-9", "1e-08"), ("0.0", "0.01"), ("1e308", "1.0")]
)
def test_a_constant_becomes_another_number(text: str, wanted: str) -> None:
    assert text_source.constant(text) == wanted

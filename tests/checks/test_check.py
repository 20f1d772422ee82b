"""Names of checks, and the selection of the attempts to compute."""

from collections.abc import Iterator

import pytest

from docs.certificates.limits import counts_table, limits
from pyharness.checks.check import (
    BITS,
    Attempt,
    Attempts,
    Check,
    Name,
    make_checks,
    run_suites,
    without_check,
)
from pyharness.checks.report import basis_note, marks
from pyharness.model.basis import MARKS, Basis
from pyharness.model.errors import InputError, NotBuiltError

_MEASURED = Basis("measured", "a value", "a run")


def test_an_id_is_made_of_the_parts_of_a_name() -> None:
    name = Name("methods", "taylor", "case-4", "1.0e-09", "error", options=" --seed x")
    assert name.id == "methods/taylor/case-4/1.0e-09/error"
    assert name.place == "case-4/1.0e-09/error"
    assert name.replay == f"python -m pyharness verify --only {name.id} --seed x"
    assert Name("separatrix", "rk4", "none", command="stress").replay == (
        "python -m pyharness stress --only separatrix/rk4/none"
    )
    # In suites of problems, the name of the problem comes first.
    assert Name("random", "solve-auto", "17").id == "random/17/solve-auto"
    assert (
        Name("external", "rk45", "b5/20", quantity="attitude").id == "external/b5/20/rk45/attitude"
    )


def test_only_what_is_requested_is_computed() -> None:
    computed: list[str] = []

    def parts(name: Name) -> Iterator[Attempt]:
        for setting in ("fine", "coarse"):
            yield Attempt(Name(name.suite, name.subject, setting=setting), both)

    def both(name: Name) -> list[Check]:
        computed.append(name.id)
        return [
            name.with_quantity("error").bounded(1.0, 2.0, BITS),
            name.with_quantity("drift").bounded(3.0, 2.0, BITS),
        ]

    attempts = [Attempt(Name("a", "b"), parts), Attempt(Name("a", "c"), both)]
    found = list(make_checks(attempts, ["a/b/coarse/drift"]))
    assert [check.id for check in found] == ["a/b/coarse/drift"]
    assert computed == ["a/b/coarse"]
    assert len(list(make_checks(attempts, []))) == 6
    # Checks that have been computed already were selected before.
    assert list(make_checks(found, ["d"])) == found


def test_requested_ids_without_a_check_are_found_unless_one_failed() -> None:
    passed, failed = (Name("a", x).judged(x == "b", "") for x in "bc")
    assert without_check(["a/b", "a", "z", "a/b/none", "a/n"], [passed]) == ["a/b/none", "a/n"]
    assert without_check(["a/b", "a/b/none"], [passed, failed]) == []


def test_a_record_tells_id_and_replay_and_what_a_number_is_compared_with() -> None:
    record = Name("a", "b").bounded(1.0, 2.0, _MEASURED, "seen").record()
    assert record == {
        "id": "a/b", "passed": True, "value": 1.0, "limit": 2.0, "basis": "measured",
        "replay": "python -m pyharness verify --only a/b", "note": "seen",
    }  # fmt: skip
    assert Name("a", "b").described(1.0).record()["basis"] is None


@pytest.mark.parametrize(
    ("limit", "basis"), [(1.0, None), (0.0, None), (None, BITS)], ids=["limit", "zero", "basis"]
)
def test_no_limit_is_without_a_basis(limit: float | None, basis: Basis | None) -> None:
    with pytest.raises(ValueError, match=r"a/b: a limit has a basis"):
        Name("a", "b").judged(True, "", 1.0, limit, basis)


@pytest.mark.parametrize(
    "parts", [("certain", "a value", "a run"), ("proved", "a value", ""), ("proved", "", "a book")]
)
def test_a_basis_has_a_known_mark_and_a_source(parts: tuple[str, str, str]) -> None:
    with pytest.raises(ValueError, match="not a basis"):
        Basis(*parts)


def test_reports_count_the_limits_by_mark() -> None:
    name = Name("a")
    checks = [name.bounded(1.0, 2.0, each) for each in (_MEASURED, BITS, BITS)]
    assert marks([*checks, name.described(1.0)]) == "derived, measured"
    (legend,) = basis_note(checks)
    assert legend.endswith("0 proved, 2 derived, 1 measured.")
    assert (marks([name.described(1.0)]), basis_note([name.described(1.0)])) == ("-", [])


@pytest.mark.campaign
def test_the_document_counts_every_basis_in_the_source() -> None:
    found = limits()
    assert {each.mark for each in found} == MARKS.keys()
    assert BITS in found
    for mark in MARKS:
        count = sum(each.mark == mark for each in found)
        assert f"| {mark} | {MARKS[mark]} | {count} |" in counts_table()


def test_an_exception_is_a_failed_check_and_the_rest_is_computed() -> None:
    def suite(error: Exception) -> Attempts:
        def broken(name: Name) -> Iterator[Check]:
            yield name.with_quantity("error").bounded(1.0, 2.0, BITS)
            raise error

        yield Attempt(Name("some", "rk4"), broken)
        yield Attempt(Name("some", "rk45"), lambda name: name.judged(True, ""))
        raise error

    def run(error: Exception, of_the_user: tuple[str, ...] = ()) -> dict[str, Check]:
        suites = {"some": lambda: suite(error), "more": lambda: [Name("more").judged(True, "")]}
        return {check.id: check for check in run_suites(suites, (), "verify", of_the_user)}

    found = run(KeyError("x\ny"))
    assert {id: check.passed for id, check in found.items()} == {
        "some/rk4/error": True, "some/rk4/exception": False, "some/rk45": True,
        "some/exception": False, "more": True,
    }  # fmt: skip
    failed = found["some/rk4/exception"]
    assert failed.note.startswith("ended here: KeyError: 'x\\ny' (test_check.py, line ")
    assert failed.replay == "python -m pyharness verify --only some/rk4"
    assert run(InputError("too long"))["some/exception"].note == "ended here: too long"
    for error, of_the_user in ((InputError("x"), ("some",)), (NotBuiltError(), ())):
        with pytest.raises(type(error)):
            run(error, of_the_user)

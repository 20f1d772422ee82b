"""Names of checks, and the selection of the attempts to compute."""

from collections.abc import Iterator

from pyharness.checks.check import Attempt, Check, Name, made


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
        return [name.of("error").bounded(1.0, 2.0), name.of("drift").bounded(3.0, 2.0)]

    attempts = [Attempt(Name("a", "b"), parts), Attempt(Name("a", "c"), both)]
    found = list(made(attempts, ["a/b/coarse/drift"]))
    assert [check.id for check in found] == ["a/b/coarse/drift"]
    assert computed == ["a/b/coarse"]
    assert len(list(made(attempts, []))) == 6
    # Checks that have been computed already were selected before.
    assert list(made(found, ["d"])) == found


def test_a_record_tells_id_and_replay_and_what_a_number_is_compared_with() -> None:
    record = Name("a", "b").bounded(1.0, 2.0, "seen").record()
    assert record == {
        "id": "a/b", "passed": True, "value": 1.0, "limit": 2.0,
        "replay": "python -m pyharness verify --only a/b", "note": "seen",
    }  # fmt: skip

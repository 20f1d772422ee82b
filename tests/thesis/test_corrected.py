"""Corrected listings with every reading and conjecture: their orders, and equal bits everywhere."""

import itertools
import json
import subprocess
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from pyharness.checks.compare.agreement import differences
from pyharness.checks.compare.orders import Order, measured_order
from pyharness.checks.port_protocol import read_answer, request
from pyharness.edition.laboratory import data
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.cells import subsets
from pyharness.thesis.programs import PROGRAM_REGISTRY, run_program
from pyharness.truth.reference import Reference, reference
from tests.conftest import ResultOf
from tests.ports import WEB, engine, run_javascript

ASSUMED = [
    (program, tuple(sorted(readings)), tuple(sorted(conjectures)))
    for program in PROGRAMS
    for readings in subsets(names_of("reading", program))
    for conjectures in subsets(names_of("conjecture", program))
]


def _listing(assumed: tuple[str, tuple[str, ...], tuple[str, ...]]) -> Listing:
    program, readings, conjectures = assumed
    return subset(program, "corrected", readings=readings, conjectures=conjectures or ["none"])


@cache
def _truth(case: int) -> Reference:
    return reference(case_scene(case), case_scene(case).times())


def _order(case: int, listing: Listing) -> Order:
    program = PROGRAM_REGISTRY[listing.program]
    return measured_order(case_scene(case), program, listing, _truth(case))


def _misses(listings: list[Listing]) -> Iterator[tuple[Listing, int]]:
    for listing, case in itertools.product(listings, case_numbers()):
        if _order(case, listing).state not in ("as due", "rounding"):
            yield listing, case


@pytest.mark.campaign
def test_corrected_programs_have_their_orders_under_every_reading_and_conjecture() -> None:
    assert len(ASSUMED) == 4 + 8 + 8, "a new reading or conjecture changes this number"
    assert not list(_misses([_listing(each) for each in ASSUMED]))


@pytest.mark.campaign
def test_the_faults_that_readings_and_conjectures_are_cost_an_order_where_they_are_kept() -> None:
    """The test above would find a reading or conjecture in a corrected statement by its order."""
    kept = {
        (listing.program, name): case
        for program in PROGRAMS
        for kind in ("reading", "conjecture")
        for name in names_of(kind, program)
        for listing, case in _misses([subset(program, "corrected", keep=[name])])
    }
    readings = {("two-term", "c1-for-c"), ("runge-kutta", "do-variable")}
    conjectures = itertools.product(PROGRAMS, names_of("conjecture"))
    assert set(kept) == {*readings, *conjectures}, (
        "a reading, or a conjecture of one program: extend the list"
    )


@pytest.mark.campaign
def test_languages_agree_bit_for_bit_on_all_of_them() -> None:
    """Compare Fortran, twin and JavaScript, whose sines may differ in Case 7."""
    cells = list(itertools.product(ASSUMED, case_numbers()))
    given = b"".join(request(case_scene(case), _listing(each)) + b"\n" for each, case in cells)
    port = [engine(), str(WEB / "port.js")]
    answers = subprocess.run(port, input=given, capture_output=True, check=True).stdout.splitlines()
    assert len(answers) == len(cells)
    for (assumed, case), line in zip(cells, answers, strict=True):
        scene, listing = case_scene(case), _listing(assumed)
        fortran, twin = (run_program(scene, listing, each) for each in ("fortran", "python"))
        assert not differences(fortran, twin), (assumed, case)
        rows = read_answer(line, scene.steps).rows
        assert fortran.velocity is not None
        wanted = np.column_stack([fortran.recorded_time, fortran.omega, fortran.velocity])
        if case == 7:
            np.testing.assert_allclose(rows, wanted, rtol=1e-12, atol=1e-14)
        else:
            assert rows.tobytes() == wanted.tobytes(), (assumed, case)


@pytest.mark.parametrize("program", PROGRAMS)
def test_laboratory_has_the_same_listing(program: str) -> None:
    words = [
        f"program={program}&listing=corrected"
        + (f"&reading={','.join(readings)}" if readings else "")
        + f"&conjecture={','.join(conjectures) or 'none'}"
        for name, readings, conjectures in ASSUMED
        if name == program
    ]
    modules = {"S": WEB / "laboratory/state.js"}
    body = "return given.map((each) => S.stateFrom(data, each));"
    for found in run_javascript(modules, body, data=data(), given=words):
        assert found["problems"] == []
        assert Listing(program, found["state"]["active"]) == Listing.corrected(program)


def test_a_correction_of_what_is_not_active_is_told(result_of: ResultOf) -> None:
    command = ["run", "--case", "4", "--program", "two-term", "--fix", "c1-for-c"]
    assert "--fix c1-for-c: it is not active" in result_of(command).err
    assert result_of([*command, "--reading", "c1-for-c"]).err == ""


@pytest.mark.campaign
@pytest.mark.parametrize("case", case_numbers())
def test_compare_tells_what_is_in_vain(case: int, result_of: ResultOf) -> None:
    words = "--listing corrected --reading do-variable,c1-for-c --conjecture initial-torque"
    told = result_of(["compare", "--case", str(case), *words.split(), "--format", "json"])
    orders = [each["order"] for each in json.loads(told.out)["programs"]]
    assert len(orders) == 3
    # Case 1 has only rounding errors at every step.
    assert case == 1 or all(each is not None for each in orders)
    for name in ("c1-for-c", "do-variable", "initial-torque"):
        assert f"'{name}' has no effect on corrected statements; --keep {name}" in told.err

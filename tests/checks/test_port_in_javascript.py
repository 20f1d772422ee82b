"""The port in JavaScript: bits in random scenes, planted faults, sine and cosine."""

import math
import random
from dataclasses import replace
from pathlib import Path

import pytest
from mpmath import mp

from pyharness import Scene, run_program
from pyharness.checks.port import differences, port
from pyharness.checks.port_process import PortProcess
from pyharness.checks.port_protocol import ENDINGS, read_answer, request
from pyharness.checks.scenes.random_scenes import draw
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.thesis.linear_solver import leqt1f
from tests.ports import WEB, node, run_javascript, sample, with_fault
from tests.tables import tables


@pytest.mark.campaign
def test_the_javascript_has_the_twins_bits_in_random_scenes() -> None:
    """Random scenes show what no cell shows, for example a test of velocity before omega."""
    seen = set()
    with PortProcess(node(WEB)) as process:
        for number in range(200):
            drawn = draw("port", number)
            if drawn.scene.law.sines or drawn.scene.law.cosines:
                continue
            lipschitz, may_stop = drawn.lipschitz, drawn.may_stop
            line = process.ask(request(drawn.scene, drawn.listing, lipschitz, may_stop))
            answer = read_answer(line, drawn.scene.steps)
            twin = run_program(
                drawn.scene, drawn.listing, "python", lipschitz=lipschitz, may_stop=may_stop
            )
            assert differences(twin, answer) == [], number
            seen.add((drawn.listing.program, twin.ended))
    assert {ended for program, ended in seen if program == "runge-kutta"} == set(ENDINGS)
    assert {program for program, _ in seen} == set(PROGRAMS)


@pytest.mark.sampled
@pytest.mark.parametrize("waves", ["sines", "cosines"])
@pytest.mark.parametrize("program", PROGRAMS)
def test_a_torque_of_waves_alone_acts(program: str, waves: str) -> None:
    """No case has a torque of cosines alone, and the test above skips scenes with waves."""
    wave: Wave = ((0.3, -0.2, 0.5), 1.7)
    law = TorqueLaw(**{waves: [wave]})  # type: ignore[arg-type]
    scene = Scene("waves", (0.1, 0.2, 0.3), moments=(3, 2, 4), torque=law, step_size=0.1, steps=20)
    for listing in (Listing.original(program), Listing.corrected(program)):
        twin = run_program(scene, listing, "python", may_stop=False)
        with PortProcess(node(WEB)) as process:
            line = process.ask(request(scene, listing, may_stop=False))
        found = read_answer(line, scene.steps)
        idle = run_program(replace(scene, torque=TorqueLaw()), listing, "python", may_stop=False)
        assert abs(twin.omega - idle.omega).max() > 0.01
        # Here the last bit of a sine may differ from the twin's.
        assert abs(found.rows[:, 1:4] - twin.omega).max() < 1e-13


# File, passage, faulty passage, and the programs in which the fault shows.
FAULTS = tables(__file__)["faults"]


@pytest.mark.sampled
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_javascript_is_found(fault: str, tmp_path: Path) -> None:
    name, here, planted, shows = FAULTS[fault]
    web = with_fault(tmp_path, f"programs/{name}", here, planted)
    failed = [check for check in port(node(web), sample()) if not check.passed]
    assert all("step" in check.note or "stop" in check.note for check in failed)
    assert {check.id.split("/")[1] for check in failed} == set(shows.split())


@pytest.mark.campaign
def test_sine_and_cosine_of_the_javascript_are_the_nearest_floats() -> None:
    source = random.Random(1982)
    angles = [source.uniform(-1.0, 1.0) * 10.0 ** source.uniform(-9.0, 8.0) for _ in range(20_000)]
    # Angles close to a multiple of a quarter turn, where digits cancel.
    angles += [n * (math.pi / 2) for n in range(-500, 500)]
    angles += [0.0, -0.0, 1e-300, 2.0**-27, 29.2, 112.60000000000004, 170.00000000000006]
    body = "return angles.map((x) => [circular.sine(x), circular.cosine(x)])"
    found = run_javascript({"circular": WEB / "programs/circular.js"}, body, angles=angles)
    assert len(found) == len(angles)
    with mp.workprec(300):
        wanted = [[float(mp.sin(x)), float(mp.cos(x))] for x in map(mp.mpf, angles)]
    assert found == wanted


def test_the_linear_solver_of_the_javascript_has_the_twins_bits() -> None:
    # The programs' own systems exchange no rows with the first one.
    source = random.Random(3)
    systems = []
    for n in (1, 2, 3, 5, 8) * 20:
        matrix = [[source.gauss(0.0, 1.0) * 10.0 ** source.randint(-3, 3) for _ in range(n)]
                  for _ in range(n)]  # fmt: skip
        systems.append([matrix, [[source.gauss(0.0, 1.0) for _ in range(n)] for _ in range(2)]])
    systems.append([[[1.0, 2.0], [2.0, 4.0]], [[1.0, 1.0]]])
    body = "return systems.map(([a, b]) => solver.leqt1f(a, b))"
    found = run_javascript({"solver": WEB / "programs/linear-solver.js"}, body, systems=systems)
    wanted = [[[list(column) for column in x], ier] for x, ier in (leqt1f(*s) for s in systems)]
    assert found == wanted

"""`verify --integrator` states the ranges of the requests that it judged, in every format."""

import json
import math
import re
import shlex
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from pyharness.checks.integrators.coverage import covered
from pyharness.checks.integrators.problem import problems
from pyharness.cli.main import main
from tests.campaigns import integrator_campaign as campaign
from tests.campaigns.integrator_campaign import Drawn, right
from tests.checks.integrators import RK4, command_of, edited, json_of
from tests.conftest import Capture

# Writes each request and the states that it answers, also that at time 0, to a file.
LOGGING = """
import pathlib
LOG = pathlib.Path(__file__).with_name("log")
known = solve
def solve(asked):
    answer = known(asked)
    states = [asked["omega"], *answer["omega"]]
    with LOG.open("a") as file:
        print(json.dumps(asked | {"states": states}), file=file)
    return answer
for line in sys.stdin:"""


def _logged(path: Path) -> Any:
    """Return the ranges of all requests and states in the file of a logging integrator."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    finest: dict[str, Any] = {}  # by scene and times, the request with the smallest step
    for each in sorted(lines, key=lambda x: -x["step_size"]):
        finest[json.dumps([each[x] for x in ("moments", "omega", "torque", "times")])] = each
    logged = [*finest.values()]
    torqued = [x for x in logged if any(map(any, x["torque"].values()))]
    waves = [wave for x in logged for wave in x["torque"]["sines"] + x["torque"]["cosines"]]
    values = {
        "omega": [math.hypot(*omega) for x in logged for omega in x["states"]],
        "moments": [moment for x in logged for moment in x["moments"]],
        "moment_ratio": [max(x["moments"]) / min(x["moments"]) for x in logged],
        "duration": [x["times"][-1] for x in logged],
        "torque_duration": [x["times"][-1] for x in torqued],
        "frequency": [wave["frequency"] for wave in waves],
        "step_size": [x["step_size"] for x in lines],
        "tolerance": [x["tolerance"] for x in lines],
    }
    return {name: [min(each), max(each)] if each else None for name, each in values.items()}


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("cells", "control"), [("free,wave", "step_size"), ("constant-1,wave-2", "tolerance")]
)
def test_the_covered_ranges_are_those_of_the_requests(
    cells: str, control: str, tmp_path: Path, capsys: Capture
) -> None:
    words = ("--cell", cells, "--seed", f"covered {cells}", "--draws", "1")
    command = edited(
        tmp_path,
        ("\nfor line in sys.stdin:", LOGGING),
        ("json.dumps(answer)", f"json.dumps(answer | {{'control': '{control}'}})"),
    )
    ranges, logged = json_of(capsys, command, *words)["covered"], _logged(tmp_path / "log")
    other = {"step_size": "tolerance", "tolerance": "step_size"}[control]
    assert ranges.pop(other) is None
    assert logged.pop(other)
    assert ranges.pop("attitude")
    torques = ranges.pop("torques")
    assert sum("sine" in each for each in torques) == cells.count("wave")
    assert ("none" in torques) == ("free" in cells)
    assert ("constant" in torques) == ("constant" in cells)
    assert ranges.keys() == logged.keys()
    for name, values in ranges.items():
        assert values == (logged[name] and pytest.approx(logged[name], rel=1e-6)), name


def test_what_was_refused_is_not_covered() -> None:
    def only_free(asked: dict[str, Any]) -> dict[str, Any]:
        free = not any(map(any, asked["torque"].values()))
        return {"omega": solve(asked)["omega"]} if free else {"refused": "a torque"}

    solve = next(right("refused")).solve
    ranges: Any = covered(campaign.judged(Drawn("", only_free, ""), problems("refused", 1)).tried)
    assert ranges.torques == ("none",)
    assert ranges.torque_duration is None
    assert not ranges.attitude
    assert "torques: none; steps" in str(ranges)
    assert str(ranges).endswith("without attitude. Nothing else was tried.")


@pytest.mark.campaign
def test_every_format_says_what_was_covered(tmp_path: Path, capsys: Capture) -> None:
    names = [str(tmp_path / name) for name in ("page.md", "cases.xml", "report.json")]
    words = ["--cell", "free-0,constant-0", "--seed", "formats", "--order", "4"]
    for more in ([], ["--self-test"]):
        assert main(["verify", "--integrator", command_of(RK4), *words, *more,
                     "--also", ",".join(names)]) == 0  # fmt: skip
        printed = " ".join(capsys.readouterr().out.split())
        page, cases, report = (Path(name).read_text() for name in names)
        (told,) = re.findall(r"covered: (.*? was tried\.)", printed)
        record = json.loads(report)["covered"]
        assert f"|omega| {record['omega'][0]:.3g} to {record['omega'][1]:.3g} rad/s; " in told
        assert f"covered: {told}" in " ".join(page.split())
        (properties,) = ElementTree.fromstring(cases).iter("properties")
        assert [each.attrib for each in properties] == [{"name": "covered", "value": told}]


def test_an_integrator_without_a_valid_answer_covers_nothing(capsys: Capture) -> None:
    command = shlex.join([sys.executable, "-c", "print(input() and '{}', flush=True); input()"])
    assert main(["verify", "--integrator", command, "--draws", "1"]) == 1
    assert "\ncovered: nothing\n" in capsys.readouterr().out
    assert json_of(capsys, command, "--draws", "1", status=1)["covered"] is None

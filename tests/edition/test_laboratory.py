"""The laboratory without a page: runs, addresses, reference and printer page in JavaScript."""

import html
import itertools
import json
import math
import random
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, case_scene, run_program, solve
from pyharness.checks.compare.agreement import differences
from pyharness.checks.port_protocol import requested_scene
from pyharness.checks.scenes.random_scenes import draw
from pyharness.edition.laboratory import MOST_STEPS, context, data
from pyharness.history.limits import limit_solution
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.report import short
from pyharness.model.scene_file import case_numbers
from pyharness.thesis.printer import page
from pyharness.truth.reference import reference
from tests.conftest import Printed
from tests.ports import run_javascript
from tests.tables import tables


def ask(name: str, given: Any) -> Any:
    """Return what a function of `laboratory.mjs` returns for the laboratory's data and `given`."""
    module = Path(__file__).parent / "laboratory.mjs"
    return run_javascript({"T": module}, f"return T.{name}(data, given);", data=data(), given=given)


@pytest.mark.campaign
def test_printer_pages_are_those_of_the_program() -> None:
    cells = list(itertools.product(case_numbers(), PROGRAMS, ("original", "corrected"), (100, 300)))
    found = ask("printerPages", cells)
    for (number, program, listing, steps), text in zip(cells, found, strict=True):
        scene = replace(case_scene(number), steps=steps)
        run = run_program(scene, subset(program, listing))
        assert text == page(scene, program, run), (number, program, listing)


def test_numbers_that_do_not_fit_are_printed_as_the_formats_have_it() -> None:
    """Test asterisks, four-digit steps, zeros without a sign, and halves rounded away from zero."""
    values = [0.0, -0.0, -0.00001, 0.03125, -0.03125, 99999.99994, 99999.99996, -9999.99994]
    values += [-9999.99996, 1e22, 0.00005, -0.99999, 1e-300, math.inf, -math.inf, math.nan]
    source = random.Random(1982)
    values += [source.uniform(-1.0, 1.0) * 10.0 ** source.uniform(-6.0, 6.0) for _ in range(301)]
    scene = replace(case_scene(2), steps=1200)
    run = run_program(scene, subset("two-term", "corrected"))
    omega, velocity = (np.resize(np.array(each), (1200, 3)) for each in (values, values[::-1]))
    ier = np.resize(np.array([0, 129], np.int32), 1200)
    changed = replace(run, omega=omega, velocity=velocity, ier=ier)
    names = {"inf": "Infinity", "-inf": "-Infinity", "nan": "NaN"}
    rows = [
        ["0", *(names.get(repr(x), repr(x)) for x in row)]
        for row in np.hstack([omega, velocity]).tolist()
    ]
    given = {"scene": requested_scene(scene), "rows": rows, "ier": ier.tolist()}
    assert ask("printedRows", given) == page(scene, "two-term", changed)


def _words() -> list[str]:
    source = random.Random(1982)
    found = []
    for _ in range(300):
        program = source.choice(PROGRAMS)
        listing = source.choice(("original", "corrected"))
        words = [f"case={source.choice(case_numbers())}", f"program={program}"]
        words.append(f"listing={listing}")
        option = "fix" if listing == "original" else "keep"
        kinds = {option: "defect", "reading": "reading", "conjecture": "conjecture"}
        for word, kind in kinds.items():
            names = [name for name in names_of(kind, program) if source.random() < 0.5]
            if names and source.random() < 0.7:
                words.append(f"{word}={','.join(names)}")
        if source.random() < 0.3:
            words.append(f"omega0={source.uniform(-9, 9)},-0.0,1e-7")
        if source.random() < 0.3:
            words.append(f"step-size={10.0 ** source.uniform(-4, -1)}")
            words.append(f"steps={source.randint(1, 50)}")
        if program == "runge-kutta" and source.random() < 0.5:
            words.append(source.choice(("no-stop", "lipschitz=60", "lipschitz=0.5")))
        found.append("&".join(words))
    return found


@pytest.mark.campaign
def test_states_go_round_through_words_and_mean_what_commands_mean(printed: Printed) -> None:
    found = ask("statesOfWords", _words())
    for each in found:
        assert each["problems"] == []
        assert each["again"] == each["state"]
    for each in found[:60]:
        command = each["command"].removeprefix("pyharness ")
        told = json.loads(printed(f"{command} --implementation python --format json"))
        assert each["run"]["ended"] == told["ended"]
        assert told["stop"] is None or each["run"]["stop"]["variable"] == told["stop"]["variable"]
        if each["state"]["case"] == 7:
            continue  # the sines of another C library may differ
        rows = [row[1:4] for row in each["run"]["rows"]]
        assert rows == told["trajectory"]["omega"], each["command"]


def test_only_what_differs_is_in_the_address() -> None:
    first = "case=2&program=runge-kutta&listing=original"
    asked = [
        "", "#", "keep=stage-base", "omega0=-0.0,1,10&steps=100", "conjecture=none&no-stop",
        "listing=corrected&program=two-term&case=7&keep=torque-held&steps=+30",
        "listing=corrected&reading=do-variable&conjecture=torque-held,initial-torque",
        "omega0=0,1,10&steps=100",
    ]  # fmt: skip
    found = ask("addresses", asked)
    assert [each[0] for each in found] == [
        first, first, "case=2&program=runge-kutta&listing=corrected&keep=stage-base",
        f"{first}&omega0=-0,1,10", f"{first}&conjecture=none&no-stop",
        "case=7&program=two-term&listing=corrected&keep=torque-held&steps=30",
        "case=2&program=runge-kutta&listing=corrected", f"{first}&omega0=0,1,10",
    ]  # fmt: skip
    given = "--case 2 --program runge-kutta --listing original --conjecture none --no-stop"
    assert found[4][1] == f"pyharness run {given}"
    # Another program keeps the switches that both have.
    four, third = ask(
        "addressesOfPrograms", "case=2&program=two-term&fix=dt-accumulates&conjecture=none"
    )
    assert four == "case=2&program=four-term&listing=original&fix=dt-accumulates&conjecture=none"
    assert third == "case=2&program=runge-kutta&listing=original&conjecture=none"


# What is wrong in an address, and the beginning of the line that says so.
_WRONG = {
    "case=8": "case: unknown '8'; allowed: 1, 2, 3, 4, 5, 6, 7",
    "case": "case: unknown ''; allowed: 1",
    "program=euler": "program: unknown 'euler'; allowed: two-term, four-term, runge-kutta",
    "listing=mine": "listing: unknown 'mine'; allowed: original, corrected",
    "fix=dt-accumulates": "fix: unknown defect 'dt-accumulates'; allowed: stage-base",
    "fix=stage-base&keep=stage-base": "'stage-base' is given to both fix and keep",
    "reading=": "reading: unknown reading ''; allowed: do-variable",
    "conjecture=none,torque-held": "conjecture: unknown conjecture 'none'",
    "omega0=1,2": "omega0: 2 numbers; allowed: three, as in 0,1,10",
    "omega0=1,2,x": "omega0: 'x' where a number belongs",
    "omega0=1,2,0x10": "omega0: '0x10' where a number belongs",
    "omega0=1,2,1e999": "omega0: '1e999' is not finite",
    "step-size=0": "step-size: 0; allowed: a number above 0",
    "steps=0": f"steps: '0'; allowed: a whole number from 1 to {MOST_STEPS}",
    "steps=1e3": "steps: '1e3'; allowed: a whole number",
    "steps=4000": "steps: '4000'",
    "lipschitz=-1": "lipschitz: -1; allowed: a number above 0",
    "no-stop=1": "no-stop: '1' where no value belongs",
    "no-stop&lipschitz=60": "lipschitz has no meaning with no-stop",
    "program=two-term&no-stop": "no-stop has no meaning with program=two-term",
    "spin=3": "unknown word 'spin'; allowed: case, program",
    "%zz=%": "unknown word '%zz'",
    "case=" + "9" * 5000: "case: unknown '9999",
}
_WRONG_PINS = {
    "case%3D9": "pin: case: unknown '9'; allowed: 1, 2",
    "spin%3D1": "pin: unknown word 'spin'; allowed: case, program",
    "case%3D1%26pin%3Dcase%253D1": "pin: unknown word 'pin'",
    "program%3Dtwo-term%26no-stop": "pin: no-stop has no meaning with program=two-term",
}


def test_what_an_address_has_wrong_is_told_in_a_line_and_the_default_taken() -> None:
    answers = ask("problemsOfWords", list(_WRONG))
    for (words, told), (fragment, problems) in zip(_WRONG.items(), answers, strict=True):
        (problem,) = problems
        assert problem.startswith(told)
        assert "\n" not in problem
        assert len(problem) < 240
        program = "two-term" if "two-term" in words else "runge-kutta"
        kept = [word for word in ("no-stop", "fix=stage-base") if word in words.split("&")[:-1]]
        assert fragment == "&".join([f"case=2&program={program}&listing=original", *kept])
    answers = ask("problemsOfPins", list(_WRONG_PINS))
    for told, ((problem,), fragment) in zip(_WRONG_PINS.values(), answers, strict=True):
        assert problem.startswith(told)
        assert fragment.endswith("listing=original")


def _asked(scenes: list[Scene]) -> list[dict[str, Any]]:
    return [{"scene": requested_scene(scene), "times": scene.times()} for scene in scenes]


def _motions() -> list[Scene]:
    found = [replace(case_scene(number), steps=300) for number in case_numbers()]
    source = random.Random(1982)
    for _ in range(15):
        omega = tuple(source.gauss(0.0, 1.0) * 10.0 ** source.uniform(-1.0, 1.0) for _ in range(3))
        step = 10.0 ** source.uniform(-4.0, -1.0)
        scene = case_scene(source.choice(case_numbers()))
        found.append(replace(scene, omega=omega, step_size=step, steps=30))
    drawn = (draw("laboratory", number).scene for number in range(0, 40, 2))
    return found + [replace(scene, steps=min(scene.steps, 30)) for scene in drawn]


@pytest.mark.campaign
def test_the_reference_is_the_decimal_one_to_rounding() -> None:
    """Over the most steps rounding does not add up: there no amplification is allowed for."""
    long = [replace(case_scene(number), steps=MOST_STEPS) for number in (2, 3, 4)]
    scenes = [*long, *_motions()]
    answers = ask("references", _asked(scenes))
    for index, (scene, rows) in enumerate(zip(scenes, answers, strict=True)):
        truth = reference(scene, scene.times()).omega
        largest = np.abs([*truth, scene.omega]).max()
        growth = 1.0
        if index >= len(long):
            growth = max(growth, solve(scene, scene.times(), "taylor").growth or 1.0)
        assert np.abs(np.array(rows) - truth).max() < 1e-15 * growth * largest, scene


def test_a_reference_that_would_take_too_long_or_leaves_every_bound_ends() -> None:
    scenes = [replace(case_scene(4), omega=(start,) * 3) for start in (1e7, 1e200, 0.0)]
    fast, without_bound, rest = ask("references", _asked(scenes))
    assert len(fast) < 100
    assert without_bound == []
    assert rest == [[0.0, 0.0, 0.0]] * 100


def test_endings_are_told() -> None:
    words = [
        "", "fix=stage-base", "case=6&program=two-term", "program=two-term&steps=1",
        "case=6&listing=corrected&lipschitz=1", "case=1&lipschitz=1e-9&steps=3&omega0=0,0,0",
    ]  # fmt: skip
    found, steep, length, known = ask("endings", words)
    (first, other, *_), told, (error, *_) = zip(*found, strict=True)
    assert (first["step"], first["variable"]) == (25, "V2")
    assert (other["step"], other["variable"]) != (25, "V2")
    assert 0.2 < error < 0.3
    stopped, _, overflow, complete, norm, at_rest = told
    where = "at step 25 of 100, at 0.25 s, by V2, the velocity along axis 2"
    assert stopped.startswith(f"Stopped {where}")
    assert overflow == "Overflow in step 57 of 100: omega is not finite any more."
    assert complete == "Complete: 1 step."
    assert "by U, the angular velocity: " in norm
    assert "Stopped" in at_rest
    # A slope that changes alone has no quotient.
    who = "by UV, angular velocity and velocity together"
    assert f"{who}: its slope changed though its value did not;" in steep
    # Where the solution ends there is no error.
    assert 0 < length < len(known)
    assert known == [n < length for n in range(len(known))]


def test_the_page_without_script_has_the_default_state(built_site: dict[str, bytes]) -> None:
    first = context()["first"]
    assert first["ending"].startswith("Stopped at step 25 by V2")
    assert [row[0] for row in first["rows"]] == ["1", "2", "3", "23", "24", "25"]
    twin = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert float(first["rows"][-1][2]) == twin.omega[-1, 0]
    truth = reference(case_scene(2), case_scene(2).times()).omega
    for row in first["rows"]:
        at = int(row[0]) - 1
        assert row[-1] == short(float(np.abs(twin.omega[at] - truth[at]).max()))
    assert first["page"] == page(case_scene(2), "runge-kutta", twin)
    text = html.unescape(built_site["laboratory.html"].decode())
    assert first["page"] in text
    assert repr(float(twin.omega[-1, 0])) in text
    assert "step 25 by V2" in " ".join(text.split())
    assert first["command"] == "pyharness run --case 2 --program runge-kutta --listing original"
    given = json.loads(json.dumps(data(), allow_nan=False))
    assert [scene["case"] for scene in given["scenes"]] == list(case_numbers())
    for program in PROGRAMS:
        names = {each["id"] for each in given["flags"] if program in each["programs"]}
        kinds = ("defect", "reading", "conjecture")
        assert names == {name for kind in kinds for name in names_of(kind, program)}


_STEPS = tables(__file__)["steps"]


@pytest.mark.sampled
@pytest.mark.parametrize(("words", "step"), _STEPS)
def test_every_card_of_a_step_gives_the_value_beside_it(words: str, step: int) -> None:
    """Compute each card, as FORTRAN, from the values that the cards before it have given."""
    found = ask("cardsOfStep", {"words": words, "step": step})
    known = _constants(*found["rates"])
    for name, value in found["values"]:
        if name.startswith("before "):
            known[name.removeprefix("before ")] = value
    known["TIME"] = found["before"][0] if found["before"] else 0.0
    # Card 1660 or 2250 of the original collocation programs adds the step size in every step.
    grows = "DT" in dict(found["values"]) and "corrected" not in words
    known["DT"] = sum([0.01] * step) if grows else 0.01
    computed = 0
    for part in found["passes"]:
        for line in part["lines"]:
            text = line["text"].strip()
            for letter, number in part["subscripts"].items():
                text = re.sub(rf"(?<=[(,]){letter}(?=[),])", str(number), text)
            if line["values"] and (formula := re.fullmatch(r"([\w(),]+?) *=(.*)", text)):
                ((name, value),) = line["values"]
                assert name == formula[1]
                assert _value(formula[2], known) == value, text
                computed += 1
            known |= dict(line["values"])
    assert computed > 60
    end = max((name for name in known if name.startswith("U1(")), key=lambda name: int(name[3:-1]))
    names = [f"{unknown}{end[2:]}" for unknown in ("U1", "U2", "U3", "V1", "V2", "V3")]
    assert [known["TIME"], *(known[name] for name in names)] == found["row"]


def _constants(rates: Any, torque: Any, acceleration: Any) -> dict[str, float]:
    names = ["A", "B", "C", "A1", "B1", "C", "R1", "R2", "R3", "M1", "M2", "M3", "ACL1", "ACL2"]
    values = [*rates, *rates, *torque, *torque, *acceleration]
    return dict(zip([*names, "ACL3"], values, strict=True))


def _value(formula: str, known: dict[str, float]) -> float:
    """Return the value of a FORTRAN expression in binary64, with powers as products."""
    text = re.sub(r"([A-Z]\w*(?:\([\d,]+\))?)", r"known['\1']", formula)
    text = re.sub(r"known\['(ABS|SQRT)'\]", r"\1", text)
    factor = r"(known\['[^']+'\])"
    text = re.sub(rf"{factor}\*\*4", r"((\1*\1)*(\1*\1))", text)
    text = re.sub(rf"{factor}\*\*3", r"(\1*\1*\1)", text)
    text = re.sub(rf"{factor}\*\*2", r"(\1*\1)", text)
    return float(eval(text, {"known": known, "ABS": abs, "SQRT": math.sqrt}))


@pytest.mark.campaign
def test_a_trace_changes_no_bit_of_a_run() -> None:
    for plain, traced, stop, traced_stop in ask("traces", _words()[:60]):
        assert traced == plain
        assert traced_stop == stop


def test_a_pinned_state_goes_round_through_the_address() -> None:
    for found, state, pinned, plain in ask("pinnedStates", list(itertools.pairwise(_words()))):
        assert found == {"state": state, "pinned": pinned, "problems": []}
        assert "pin" not in plain


@pytest.mark.campaign
def test_limits_are_those_that_python_computes() -> None:
    cells = [(n, program) for n in case_numbers() for program in ("two-term", "runge-kutta")]
    kinds = set()
    for (number, program), (found, truth) in zip(cells, ask("limits", cells), strict=True):
        scene = case_scene(number)
        exact = reference(scene, scene.times())
        expected, *_ = limit_solution(program, scene, scene.times(), exact)
        kinds.add(found["kind"])
        if found["kind"] == "nothing":
            assert np.isnan(expected).all()
            continue
        omega = np.array(found["omega"] or truth)
        size = max(np.abs(omega[: len(omega) // 2]).max(), 1.0)
        # Near its blow-up a limit amplifies every rounding error.
        near = np.abs(expected[: len(omega)]).max(axis=1) < 1e3 * size
        assert near.sum() > 25
        assert np.abs(omega[near] - expected[: len(omega)][near]).max() < 1e-6 * size
        same = np.abs(np.array(truth) - expected).max() < 1e-9 * size
        assert same == (found["omega"] is None), (number, program)
    assert kinds == {"half-speed", "equation", "nothing"}


def _switched() -> Iterator[str]:
    names = {
        "two-term": ("dt-accumulates", "torque-held", "initial-torque", "x3-reads-acl2"),
        "four-term": ("dt-accumulates", "torque-held", "initial-torque"),
        "runge-kutta": ("stage-base", "base-not-restored", "torque-held", "initial-torque"),
    }
    for program, number in itertools.product(PROGRAMS, (4, 7)):
        for kept in itertools.product((False, True), repeat=len(names[program])):
            keep = ",".join(itertools.compress(names[program], kept))
            words = f"case={number}&program={program}&listing=corrected&steps=30"
            yield words + (f"&keep={keep}" if keep else "")


@pytest.mark.campaign
def test_every_program_converges_to_its_limit() -> None:
    words = list(_switched())
    kinds: dict[str, int] = {}
    answers = ask("distancesToLimit", words)
    for each, (problems, (kind, coarse), (again, fine)) in zip(words, answers, strict=True):
        assert problems == []
        assert kind == again
        kinds[kind] = kinds.get(kind, 0) + 1
        if kind not in ("nothing", "unknown"):
            assert fine < max(coarse / 6.0, 1e-11), (each, kind, coarse, fine)
    assert min(kinds[kind] for kind in ("solution", "half-speed", "equation", "nothing")) >= 4
    assert set(kinds) == {"solution", "half-speed", "equation", "nothing", "unknown"}


EXPERIMENTS = facts("experiments")["experiment"]


@pytest.mark.sampled
@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each["id"])
def test_guided_experiments_show_what_they_say(experiment: dict[str, Any]) -> None:
    problems, fragment, shown, pinned = ask("experimentShown", experiment["state"])
    assert problems == []
    assert fragment == experiment["state"]
    for name, value in experiment["expect"].items():
        of_pinned = name.startswith("pinned_")
        assert (pinned if of_pinned else shown)[name.removeprefix("pinned_")] == value, name
        if name in ("quotient", "error", "from_limit", "pinned_from_limit"):
            assert value in experiment["explanation"]
        if name == "pinned_error" and experiment["id"] != "test-omega-alone":
            told = [experiment[part] for part in ("explanation", "goal", "question")]
            assert value in " ".join([*told, *experiment["choices"]])
    assert 1 <= experiment["answer"] <= len(experiment["choices"])
    assert 2 <= len(experiment["choices"]) <= 4
    if experiment["expect"]["ended"] == "stopped":
        assert f"step {experiment['expect']['steps']}" in experiment["explanation"]


def test_there_are_eight_experiments_on_the_page(built_site: dict[str, bytes]) -> None:
    text = html.unescape(built_site["laboratory.html"].decode())
    assert len(EXPERIMENTS) == len({each["id"] for each in EXPERIMENTS}) == 8
    for each in EXPERIMENTS:
        for part in ("title", "goal", "question", "explanation"):
            assert each[part] in text, part
        assert all(choice in text for choice in each["choices"])
        assert f"laboratory.html#{each['state']}" in text


def test_the_reason_of_an_end_is_computed_from_the_run() -> None:
    words = [
        "", "case=5", "no-stop", "program=two-term", "case=6&program=two-term",
        "listing=corrected", "fix=lipschitz-per-component&lipschitz=6",
        "fix=lipschitz-tests-velocity",
    ]  # fmt: skip
    velocity, omega, off, none, overflow, complete, joint, later = ask("reasons", words)
    twin: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    before, after = twin.velocity[-2:, 1]
    assert f"V2 went from {before:#.4g} to {after:#.4g} m/s" in velocity
    assert "V2 had just passed a turning point" in velocity
    assert after < before > twin.velocity[-3, 1]
    assert f"the quotient is {twin.stop.quotient:.0f}." in velocity
    assert "V2 is a velocity, on which omega does not depend" in velocity
    assert "In that step omega had an error of 0.271 rad/s" in velocity
    assert "In step 92 U2 had just passed a turning point" in omega
    assert "a velocity, on which" not in omega
    assert "With it, the run would have ended at step 25, where the quotient of V2 is 3305" in off
    assert none.startswith("This program has no stop test")
    assert "In its last step alone it grew more than a million times" in overflow
    assert complete.startswith("No quotient exceeded the limit of 500")
    assert "the slope of omega and the velocity together changed by" in joint
    assert "In step 62 U1 was near a turning point" in later


@pytest.mark.campaign
def test_quotients_end_the_run_where_they_exceed_the_limit() -> None:
    words = [each for each in _words() if "runge-kutta" in each]
    stopped = 0
    for stop, quotients, rows, state in ask("quotients", words):
        assert len(quotients) == rows
        limit = state["lipschitz"]
        over = [
            [n + 1, name, value]
            for n, step in enumerate(quotients)
            for name, value in step
            if value is not None and value > limit
        ]
        if stop is None:
            assert not over or not state["stops"]
        elif stop["quotient"] is not None:  # infinity is null in JSON
            stopped += 1
            first = next(each for each in over if each[0] == stop["step"])
            assert first == [stop["step"], stop["variable"], stop["quotient"]]
            assert all(each[0] >= stop["step"] for each in over)
    assert stopped > 20


@pytest.mark.campaign
def test_a_switch_without_effect_is_found_by_running() -> None:
    words = ["", "no-stop", "case=7&program=four-term", "case=6&program=two-term"]
    for state, reasons in ask("idleSwitches", words):
        scene, program = case_scene(state["case"]), state["program"]
        own = {name for kind in ("defect", "reading", "conjecture")
               for name in names_of(kind, program)}  # fmt: skip
        active = own & set(state["active"])
        run = run_program(scene, Listing(program, active), "python", may_stop=state["stops"])
        for name, reason in reasons:
            if name not in own:
                assert reason == f"not in the {program} program"
                continue
            changed = Listing(program, active ^ {name})
            other = run_program(scene, changed, "python", may_stop=state["stops"])
            same = not differences(run, other)
            assert same == (reason is not None), (state["case"], name)


def test_every_link_to_the_laboratory_names_a_state(built_site: dict[str, bytes]) -> None:
    links = {
        html.unescape(each)
        for name, content in built_site.items()
        if name.endswith(".html")
        for each in re.findall(r'href="(?:\.\./)*laboratory\.html#([^"]*)"', content.decode())
    }
    assert len(links) > 20
    words = sorted(links)
    found = ask("problems", words)
    assert {word: told for word, told in zip(words, found, strict=True) if told} == {}

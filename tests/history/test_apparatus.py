"""Statements of the apparatus about the programs, checked entry by entry."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pyharness.history.ablation import entries, entry
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, subset
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.cards import chosen, deck, numbers
from pyharness.thesis.programs import PROGRAM_REGISTRY, run_program
from pyharness.truth.reference import reference


def test_entries_rest_on_grounds_that_are_no_witnesses() -> None:
    sigla = {each["siglum"] for each in facts("cards/scan")["ground"]}
    assert {each["siglum"] for each in facts("cards/scan")["witness"]} == {"S"}
    for each in entries():
        assert each["grounds"], each["id"]
        assert set(each["grounds"]) <= sigla, each["id"]
    assert {siglum for each in entries() for siglum in each["grounds"]} == sigla


def test_with_one_mass_whichever_case_2_stops_at_step_26() -> None:
    def step(scene: Scene, listing: Listing) -> int | None:
        stop = run_program(scene, listing).stop
        return stop.step if stop else None

    printed, mended = Listing.original("runge-kutta"), subset("runge-kutta", fix=["three-masses"])
    assert (step(case_scene(2), printed), step(case_scene(2), mended)) == (25, 26)
    for mass in (100.0, 110.0, 120.0):
        scene = replace(case_scene(2), masses=(mass,) * 3)
        assert step(scene, printed) == step(scene, mended) == 26
    assert "step 26" in entry("three-masses")["why"]


@pytest.mark.parametrize(("kept", "told", "weights"), [
    (["x3-reads-acl2"], "(ACL1 + ACL2)/2 in place of ACL1", (0.5, 0.5)),
    (["x3-reads-acl2", "dt-accumulates"], "with dt-accumulates by 2 ACL1 - ACL2", (2.0, -1.0)),
])  # fmt: skip
def test_x3_on_acl2_is_as_told(kept: list[str], told: str, weights: tuple[float, float]) -> None:
    """A sphere at rest, so that V1 is the acceleration times the time."""
    scene = replace(case_scene(1), omega=(0.0, 0.0, 0.0), step_size=1e-4, steps=10000)
    scene = replace(scene, torque=case_scene(2).torque)
    run = run_program(scene, subset("two-term", "corrected", keep=kept))
    assert run.velocity is not None
    first, second = np.array(scene.forces[:2]) / scene.masses[0]
    expected = weights[0] * first + weights[1] * second
    assert run.velocity[-1, 0] / run.time[-1] == pytest.approx(expected, abs=1e-3)
    assert told in entry("x3-reads-acl2")["why"]


@pytest.mark.sampled
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("case", [3, 5])
def test_corrected_velocity_is_that_of_one_mass(program: str, case: int) -> None:
    scene = case_scene(case)
    assert len(set(scene.masses)) == 3
    finer = replace(scene, step_size=1e-3, steps=1000)
    truth = reference(finer, finer.times(), velocity=True).velocity
    listings = subset(program, "corrected"), subset(program, keep=["three-masses"])
    found = [run_program(finer, each, may_stop=False).velocity for each in listings]
    errors = [np.abs(np.subtract(each, truth)).max() for each in found]  # type: ignore[arg-type]
    assert errors[0] < 1e-4 < 1e-2 < errors[1]


@pytest.mark.parametrize("program", PROGRAMS)
def test_omega_does_not_change_by_a_bit_without_the_translational_block(program: str) -> None:
    run = partial(PROGRAM_REGISTRY[program].run, listing=Listing.original(program), may_stop=False)
    for case in case_numbers():
        one, other = (run(case_scene(case), velocity=velocity) for velocity in (True, False))
        assert one.omega.tobytes() == other.omega.tobytes()
    of_velocity = re.compile(r"V[123]|ACL|FRC|MS|[XYZ]\(|[XYZ]\d|B\(\d,[456]\)|VV|[XYZ]L")
    for number in numbers(entry("translational-block")["cards"][program]):
        card = deck(program).cards[number]
        assert card.continues or of_velocity.search(card.text), card.name


def test_torque_of_case_7_falls_and_is_sampled_once_a_radian() -> None:
    scene = case_scene(7)
    given = next(each for each in facts("printer")["initial_torque"] if each["case"] == 7)
    assert list(given["torque"]) == [100.0, 200.0, 150.0]
    moments = np.array(scene.moments)
    law = np.array([scene.normalized_torque(t) for t in scene.times()]) * moments
    assert np.abs(law).max() <= 1.0 + 1e-12
    assert max(f for _, f in scene.law.sines + scene.law.cosines) * scene.step_size == 1.0
    assert np.abs(np.cumsum(law / moments * scene.step_size, axis=0)).max() < 0.05


def test_what_is_redundant_or_unread_is_so_on_the_cards() -> None:
    four, kutta = (
        {n: card.text for n, card in deck(name).cards.items() if not card.is_comment}
        for name in ("four-term", "runge-kutta")
    )
    body = "\n".join(text for n, text in four.items() if n > 120)
    for name in "TFGHXYZ":
        assert set(re.findall(rf"\b{name}\((\w+)\)", body)) <= {"2", "3", "4", "5", "L"}, name
    assert "DO 400 L=2,5,1" in body
    assert "WKA(24)" in four[110]
    assert "WKA(12)" in deck("two-term").cards[110].text
    assert not any("WRITE" in text for n, text in kutta.items() if n > 1250)
    assert [kutta[n].strip() for n in (770, 780, 790)] == [
        "DO 100 I=1,2,1", "J=I-1", "IF(I.EQ.1)J=1",
    ]  # fmt: skip
    for program in ("two-term", "four-term"):
        jumps = [card.text for card in deck(program).cards.values() if "GO TO" in card.text]
        assert not any(text.rstrip().endswith("30") for text in jumps)


def test_our_names_of_the_torques_decide_which_names_are_unused() -> None:
    unused = {}
    for program in entry("unused-torques")["cards"]:
        cards = [c for c in deck(program).cards.values() if not (c.is_comment or "REAL" in c.text)]
        ours = " ".join(card.text for card in cards)
        scan = " ".join(card.text_with_scanned_names for card in cards)
        unused[program] = [
            [name for name in "MN" if not re.search(rf"\b{name}[123]\b", text)]
            for text in (ours, scan)
        ]
    assert unused == {"four-term": [[], ["N"]], "runge-kutta": [["M"], ["N"]]}
    assert entry("unused-torques")["certainty"] == entry("torque-names")["certainty"] == "probable"
    # In the scan both decks set, divide and print variables of one name, so that none is unset.
    named = [c for c in chosen(()) if any(d.entry == "torque-names" for d in c.differences)]
    assert len(named) == 14
    for card in named:
        scan = (card.scan or "").partition("-")[2]
        assert not re.search(r"\bN[123]\b", scan)
        assert re.search(r"M[123]", scan)

"""Listings: names, options, and the bits that the Fortran reads."""

from typing import Any

from pyharness import subset
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, flagged, names_of, switches


def test_each_flag_is_a_bit_of_its_own() -> None:
    assert sorted(entry["flag"] for entry in flagged()) == list(range(len(flagged())))


def test_every_entry_names_its_cards_in_every_program_that_has_it() -> None:
    for entry in flagged():
        assert set(entry["cards"]) == set(entry["programs"])
        assert entry["kind"] in ("defect", "reading", "conjecture")


def test_programs_have_the_defects_of_the_apparatus() -> None:
    found = {
        (kind, program): names_of(kind, program)
        for kind in ("defect", "reading", "conjecture")
        for program in PROGRAMS
    }
    assert len(found.pop(("defect", "runge-kutta"))) == 6, "a new defect changes this number"
    assert found == {
        ("defect", "two-term"): ("dt-accumulates", "x3-reads-acl2", "three-masses"),
        ("defect", "four-term"): ("dt-accumulates", "three-masses"),
        ("reading", "two-term"): ("c1-for-c",),
        ("reading", "four-term"): (),
        ("reading", "runge-kutta"): ("do-variable",),
        **{("conjecture", each): ("torque-held", "initial-torque") for each in PROGRAMS},
    }, "extend this list"
    for program in PROGRAMS:
        switched = {*names_of("defect", program), "torque-held"}
        assert set(switches(program)) == switched, "extend this list"


def test_labels() -> None:
    for program in PROGRAMS:
        assert Listing.original(program).label == "original"
        assert Listing.corrected(program).label == "corrected"
    assert subset("two-term", conjectures=["none"]).label == "custom"
    assert subset("two-term", "corrected", keep=["torque-held"]).label == "custom"
    assert subset("two-term", conjectures=["torque-held"]) == Listing.original("two-term")


def test_conjectures_are_known_among_defects() -> None:
    """Code that lists what is active need not know which of it is on a card."""
    found = Listing("two-term", ["dt-accumulates", "torque-held"])
    assert found.defects == {"dt-accumulates"}
    assert found.conjectures == {"torque-held"}
    assert found.has("torque-held")
    assert Listing("two-term", ["c1-for-c"]).readings == {"c1-for-c"}
    others = Listing("two-term", ["x3-reads-acl2", "three-masses"])
    assert found.flags == Listing.original("two-term").flags - others.flags


def test_options_of_the_command_line() -> None:
    assert subset("two-term").label == "original"
    assert subset("two-term", fix=["dt-accumulates"]).defects == {"x3-reads-acl2", "three-masses"}
    assert subset("two-term", keep=["dt-accumulates"]).defects == {"dt-accumulates"}
    assert subset("two-term", "original", keep=["dt-accumulates"]).label == "original"
    assert subset("two-term", "corrected", fix=["dt-accumulates"]).label == "corrected"
    both = subset("two-term", fix=["dt-accumulates"], keep=["x3-reads-acl2"])
    assert both.defects == {"x3-reads-acl2", "three-masses"}
    assert both.conjectures == {"torque-held"}


def test_no_reading_or_conjecture_changes_a_corrected_listing() -> None:
    """A corrected listing uses the intended name and index; an entry that is kept stays active."""
    given: dict[str, Any] = {
        "readings": ["do-variable"], "conjectures": ["torque-held", "initial-torque"],
    }  # fmt: skip
    assert subset("runge-kutta", "corrected", **given) == Listing.corrected("runge-kutta")
    kept = subset("runge-kutta", keep=["do-variable"], **given)
    assert kept.label == "custom"
    assert kept.active == {"do-variable"}
    assert subset("runge-kutta", "original", readings=["do-variable"]).label == "original"
    fixed = subset("runge-kutta", fix=["do-variable", "initial-torque"], **given)
    assert fixed == Listing.original("runge-kutta")
    everything = [*switches("runge-kutta"), "do-variable"]
    assert subset("runge-kutta", fix=everything, **given).active == {"initial-torque"}


def test_divergences_are_complete_entries() -> None:
    kinds = {
        "cross-language", "cross-build", "from-the-listing", "in-the-javascript", "from-the-plan",
    }  # fmt: skip
    entries = facts("divergences")["divergence"]
    assert len({entry["id"] for entry in entries}) == len(entries)
    for entry in entries:
        assert entry["kind"] in kinds
        assert all(entry[key] for key in ("what", "reason", "evidence"))

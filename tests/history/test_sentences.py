"""Sentences of the thesis: none is missing, each is judged or says why not, all commands run."""

import re
import shlex
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.history.claims.ledger import claims
from pyharness.history.claims.stories import Sentence, sentences
from tests.conftest import Printed

SENTENCES = sentences()
STATES = sorted({each.laboratory for each in SENTENCES if each.laboratory})
COMMANDS = sorted({each.command for each in SENTENCES if each.command})
THESIS = Path(__file__).parents[3] / "shared" / "thesis" / "thesis.txt"
KEYS = {
    "case", "program", "listing", "fix", "keep", "reading", "conjecture", "omega0", "step-size",
    "steps", "lipschitz", "no-stop",
}  # fmt: skip


def _lies_in(sentence: Sentence, place: str) -> bool:
    """Whether a sentence is in a place of claims.toml, such as `V.3 and VI`."""
    return any(f"{sentence.where},".startswith(f"{each},") for each in place.split(" and "))


def _command_of(state: str) -> str:
    """Return the command of a state; raise KeyError if a key is unknown, ValueError if repeated."""
    words = ["run"]
    for key, values in parse_qs(state, keep_blank_values=True).items():
        (value,) = values
        if key not in KEYS:
            raise KeyError(key)
        words += [f"--{key}", value] if value else [f"--{key}"]
    return shlex.join(words)


def test_every_claim_of_these_sections_judges_a_sentence_at_its_place_and_no_other_does() -> None:
    named = {(name, each) for each in SENTENCES for name in each.claims}
    wanted = [each for each in claims() if re.match(r"VI?\b", each["where"])]
    assert len(wanted) >= 29
    for claim in wanted:
        assert any(n == claim["id"] and _lies_in(s, claim["where"]) for n, s in named), claim["id"]
    assert {name for name, _ in named} == {each["id"] for each in wanted}
    assert all(len(set(each.claims)) == len(each.claims) for each in SENTENCES)


@pytest.mark.parametrize("sentence", SENTENCES, ids=lambda each: each.quote)
def test_sentence_is_quoted_briefly_and_judged_or_not(sentence: Sentence) -> None:
    assert 3 <= len(sentence.quote.split()) <= 8
    assert sentence.quote in " ".join(sentence.text.split())
    assert sentence.text == sentence.text.strip()
    assert sentence.text.count("$") % 2 == 0
    assert bool(sentence.claims) != bool(sentence.why)
    assert re.match(r"(V, introduction|V\.[123], |VI, )", sentence.where)
    if sentence.laboratory and (found := re.fullmatch(r"V\.2, Case (\d)", sentence.where)):
        assert parse_qs(sentence.laboratory)["case"] == [found[1]]


def test_sentences_stand_once_in_the_order_of_the_sections() -> None:
    places = [each.where for each in SENTENCES]
    quoted = [(each.where, each.quote) for each in SENTENCES]
    assert len(set(quoted)) == len(quoted) == 67
    blocks = [place for n, place in enumerate(places) if n == 0 or places[n - 1] != place]
    assert len(set(blocks)) == len(blocks)
    sections = [each.split(",")[0] for each in blocks]
    assert sections == sorted(sections, key=["V", "V.1", "V.2", "V.3", "VI"].index)
    cases = [each.split(", ")[1] for each in blocks if each.startswith("V.2, C")]
    assert cases == [f"Case {n}" for n in range(1, 8)]


@pytest.mark.parametrize("state", STATES)
def test_state_of_the_laboratory_runs(state: str, printed: Printed) -> None:
    assert printed(_command_of(state))


def test_state_that_no_run_has_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    for state in (
        "case=8&program=two-term", "case=2&program=three-term", "case=2&program=two-term&no-stop",
        "case=2&program=two-term&fix=stage-base", "case=2&program=two-term&listing=modern",
        "case=2&program=runge-kutta&reading=c1-for-c", "program=two-term",
    ):  # fmt: skip
        assert main(shlex.split(_command_of(state))) == 2
    assert capsys.readouterr().out == ""
    for state in ("case=2&sigma=3", "case=2&case=3"):
        with pytest.raises((KeyError, ValueError)):
            _command_of(state)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_is_one_and_ends_well(command: str, printed: Printed) -> None:
    verb, *rest = shlex.split(command)
    assert verb in VERBS
    Parser(verb).read(verb, rest)
    if verb in ("run", "plan", "cards", "deck", "rotations"):
        assert printed(command)


@pytest.mark.skipif(not THESIS.exists(), reason="the text of the thesis is not beside the project")
def test_every_sentence_has_its_quote_and_its_letters() -> None:
    found = _sentences_of(THESIS.read_text())
    assert len(found) == len(SENTENCES)
    for text, sentence in zip(found, SENTENCES, strict=True):
        assert sentence.quote in text
    # Only blanks and signs are ours, and nothing but formulas is skipped.
    thesis = THESIS.read_text()
    letters = _letters(thesis[thesis.index("## SECTION V\n") : thesis.index("## REFERENCES\n")])
    at = 0
    for each in SENTENCES:
        for line in each.text.split("\n"):
            start = letters.find(_letters(line), at)
            assert start >= 0, line
            # Between two sentences are at most headings and the captions of the figures.
            assert start - at <= 200, letters[at:start]
            at = start + len(_letters(line))


def _letters(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]", "", text)


def _sentences_of(thesis: str) -> list[str]:
    """Return the sentences of V and VI, and Table 1, without formulas, headings and captions."""
    _, _, text = thesis.rpartition("## RESULTS\n")
    text, _, _ = text.partition("## REFERENCES")
    found = []
    for block in re.split(r"\n\s*\n", text):
        lines = " ".join(block.split())
        if lines.startswith("TABLE 1"):
            found.append(lines)
        elif not re.match(r"#|\$\$|Figure \d+\.|PART|\d\. \$|SUMMARY", lines):
            parts = re.split(r"(?<=[.:)])\s+(?=[A-Z(])", re.sub(r"^\d\. ", "", lines))
            found += [each for each in parts if each]
    return found

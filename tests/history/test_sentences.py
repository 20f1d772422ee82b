"""Sentences of the thesis: none is missing, each is judged or says why not, all commands run."""

import re
import shlex
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.history.claims.ledger import claims
from pyharness.history.claims.sentences import Sentence, sentences

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
    return any(
        sentence.where == each or sentence.where.startswith(f"{each},")
        for each in place.split(" and ")
    )


def _command_of(state: str) -> str:
    """Return the command of a state; raise KeyError if a key is unknown, ValueError if repeated."""
    words = ["run"]
    for key, values in parse_qs(state, keep_blank_values=True).items():
        (value,) = values
        if key not in KEYS:
            raise KeyError(key)
        words += [f"--{key}", value] if value else [f"--{key}"]
    return shlex.join(words)


def test_every_claim_of_these_sections_judges_a_sentence_at_its_place() -> None:
    named = {(name, each) for each in SENTENCES for name in each.claims}
    wanted = [each for each in claims() if re.match(r"VI?\b", each["where"])]
    assert len(wanted) >= 29
    for claim in wanted:
        assert any(n == claim["id"] and _lies_in(s, claim["where"]) for n, s in named), claim["id"]


def test_every_claim_that_is_named_exists_and_is_of_these_sections() -> None:
    known = {each["id"]: each["where"] for each in claims()}
    for each in SENTENCES:
        assert len(set(each.claims)) == len(each.claims)
        for name in each.claims:
            assert re.match(r"VI?\b", known[name]), name


@pytest.mark.parametrize("sentence", SENTENCES, ids=lambda each: each.quote)
def test_sentence_is_quoted_briefly_and_judged_or_not(sentence: Sentence) -> None:
    assert 3 <= len(sentence.quote.split()) <= 8
    assert bool(sentence.claims) != bool(sentence.why)
    assert re.match(r"(V, introduction|V\.[123], |VI, )", sentence.where)


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
def test_state_of_the_laboratory_runs(state: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shlex.split(_command_of(state))) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    "state",
    [
        "case=8&program=two-term", "case=2&program=three-term", "case=2&program=two-term&no-stop",
        "case=2&program=two-term&fix=stage-base", "case=2&program=two-term&listing=modern",
        "case=2&program=runge-kutta&reading=c1-for-c", "program=two-term",
    ],
)  # fmt: skip
def test_state_that_no_run_has_is_refused(state: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shlex.split(_command_of(state))) == 2
    capsys.readouterr()


@pytest.mark.parametrize("state", ["case=2&sigma=3", "case=2&case=3"])
def test_state_with_a_strange_key_or_one_twice_is_found(state: str) -> None:
    with pytest.raises((KeyError, ValueError)):
        _command_of(state)


def test_state_is_of_the_case_that_the_sentence_is_about() -> None:
    for each in SENTENCES:
        if each.laboratory and (found := re.fullmatch(r"V\.2, Case (\d)", each.where)):
            assert parse_qs(each.laboratory)["case"] == [found[1]]


@pytest.mark.parametrize("command", COMMANDS)
def test_command_is_one(command: str) -> None:
    verb, *rest = shlex.split(command)
    assert verb in VERBS
    Parser(verb).read(verb, rest)


@pytest.mark.parametrize(
    "command",
    [each for each in COMMANDS if each.split()[0] in ("run", "plan", "cards", "deck", "rotations")],
)
def test_command_ends_well(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shlex.split(command)) == 0
    assert capsys.readouterr().out


@pytest.mark.skipif(not THESIS.exists(), reason="the text of the thesis is not beside the project")
def test_every_sentence_of_the_thesis_has_its_quote() -> None:
    found = _sentences_of(THESIS.read_text())
    assert len(found) == len(SENTENCES)
    for text, sentence in zip(found, SENTENCES, strict=True):
        assert sentence.quote in text


def test_quote_is_a_part_of_the_sentence() -> None:
    for each in SENTENCES:
        assert each.quote in " ".join(each.text.split()), each.quote
        assert each.text == each.text.strip()
        assert each.text.count("$") % 2 == 0


@pytest.mark.skipif(not THESIS.exists(), reason="the text of the thesis is not beside the project")
def test_every_sentence_has_the_letters_of_the_thesis_in_its_order() -> None:
    """Letter for letter: only blanks and signs are ours, and nothing but formulas is skipped."""
    thesis = THESIS.read_text()
    found = _letters(thesis[thesis.index("## SECTION V\n") : thesis.index("## REFERENCES\n")])
    at = 0
    for each in SENTENCES:
        for line in each.text.split("\n"):
            start = found.find(_letters(line), at)
            assert start >= 0, line
            # Between two sentences are at most headings and the captions of the figures.
            assert start - at <= 200, found[at:start]
            at = start + len(_letters(line))


def _letters(text: str) -> str:
    """Return the letters and digits of a text alone."""
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

"""The data of the pages on claims, sentences and apparatus.

A claim is a statement of the thesis that we test. A judgement has our verdicts on it, for original
and corrected programs; `judged` has the judgements of all claims.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from pyharness.edition.markdown import inline
from pyharness.history.ablation import effects_of, entries
from pyharness.history.apparatus_report import FIELDS, entry_report
from pyharness.history.claims.evidence import evidence
from pyharness.history.claims.evidence_report import evidence_report
from pyharness.history.claims.ledger import Judgement
from pyharness.history.claims.report import KINDS, claims_report, kinds_table
from pyharness.history.claims.sentences import Sentence, sentences
from pyharness.history.claims.stories import Story, story
from pyharness.history.claims.verdicts import REPRODUCED
from pyharness.model.facts import facts
from pyharness.model.report import Column, Table
from pyharness.views import html


class SentenceVerdicts(NamedTuple):
    """A sentence of the thesis, with its anchor and the judgements of its claims."""

    sentence: Sentence
    judged: list[Judgement]
    anchor: str

    @property
    def statements(self) -> str:
        """Return the statements of the sentence's claims, joined."""
        return " ".join(each.claim["statement"] for each in self.judged)


def counts(judged: Sequence[Judgement]) -> dict[str, tuple[int, int]]:
    """Return the numbers of claims about results, original and corrected, by verdict."""
    judged = [each for each in judged if each.claim["kind"] == "result"]
    found: dict[str, tuple[int, int]] = {}
    for each in judged:
        for verdict in (each.original.verdict, each.corrected.verdict):
            found[verdict] = (0, 0)
    for verdict in found:
        found[verdict] = (
            sum(each.original.verdict == verdict for each in judged),
            sum(each.corrected.verdict == verdict for each in judged),
        )
    return found


def kinds(judged: Sequence[Judgement]) -> Markup:
    """Return an HTML table of verdicts by kind of claim."""
    return Markup(html.table(kinds_table(judged), "verdicts by kind of claim"))


def account() -> dict[str, Markup]:
    """Return the HTML texts of ``data/account.toml`` and the effects of single defects, by id."""
    texts = {each["id"]: each["text"] for each in facts("account")["statement"]}
    texts |= {each["id"]: each["part"] for each in entries() if "part" in each}
    return {name: inline(text) for name, text in texts.items()}


class ClaimStory(NamedTuple):
    """A claim on the claims page.

    `story` is HTML in three sentences. `sentences` are pairs of place and anchor on the page of the
    thesis. `laboratory` is a state of the laboratory that shows the claim, or empty.
    """

    judgement: Judgement
    story: Story
    sentences: list[tuple[str, str]]
    laboratory: str


def claim_stories(judged: Sequence[Judgement]) -> dict[str, list[ClaimStory]]:
    """Return the claims with their stories, by kind in the order of `KINDS`."""
    found: dict[str, list[ClaimStory]] = {kind: [] for kind in KINDS}
    for each in judged:
        making = [
            (sentence, f"sentence-{number}")
            for number, sentence in enumerate(sentences(), 1)
            if each.claim["id"] in sentence.claims
        ]
        states = [sentence.laboratory for sentence, _ in making if sentence.laboratory]
        found[each.claim["kind"]].append(
            ClaimStory(
                each, Story(*map(inline, story(each))),
                [(sentence.where, anchor) for sentence, anchor in making], (states or [""])[0],
            )
        )  # fmt: skip
    return found


def context(judged: Sequence[Judgement]) -> dict[str, Any]:
    """Return the data of the claims page: tables, stories and evidence, mostly as HTML."""
    table = claims_report(judged).data
    assert table is not None
    links = {each.claim["id"]: f"#{each.claim['id']}" for each in judged}
    return {
        "table": Markup(html.table(table, "all claims", links)),
        "kinds": kinds(judged),
        "about": KINDS,
        "groups": claim_stories(judged),
        "evidence": Markup(html.sections(evidence_report(list(evidence())).text)),
    }


def thesis_counts(sections: Mapping[str, Sequence[SentenceVerdicts]]) -> Markup:
    """Return an HTML table of sentences and claims by section.

    `sections` is the result of `thesis`. Only claims about results count as reproduced.
    """
    columns = [
        Column("section", left=True), Column("sentences"), Column("that make a claim"),
        Column("results claimed"), Column("reproduced as printed"),
        Column("reproduced as corrected"),
    ]  # fmt: skip
    rows = []
    for section, told in sections.items():
        results = {
            each.claim["id"]: each
            for sentence in told
            for each in sentence.judged
            if each.claim["kind"] == "result"
        }.values()
        reproduced = [
            sum(getattr(each, state).verdict == REPRODUCED for each in results)
            for state in ("original", "corrected")
        ]
        makes = sum(bool(sentence.judged) for sentence in told)
        rows.append([section, len(told), makes, len(results), *reproduced])
    return Markup(html.table(Table(columns, rows), "sentences and claims by section"))


def apparatus() -> list[tuple[dict[str, Any], Markup]]:
    """Return each entry of the apparatus with its report as HTML.

    The report of an entry with a switch includes its effect in every case.
    """
    found = []
    for entry in entries():
        effects = list(effects_of(entry["id"])) if "flag" in entry else []
        # The page shows the cards as links.
        report = entry_report(entry, effects, [name for name in FIELDS if name != "cards"])
        found.append((entry, Markup(html.sections(report.text[1:]))))
    return found


def thesis(judged: Iterable[Judgement]) -> dict[str, list[SentenceVerdicts]]:
    """Return the thesis's sentences with verdicts, by section in order."""
    by_name = {each.claim["id"]: each for each in judged}
    found: dict[str, list[SentenceVerdicts]] = {}
    for number, each in enumerate(sentences(), 1):
        section = each.where.partition(",")[0]
        judged_by = [by_name[name] for name in each.claims]
        found.setdefault(section, []).append(
            SentenceVerdicts(each, judged_by, f"sentence-{number}")
        )
    return found

"""The data of the pages on claims, thesis, figures and apparatus.

A claim is a tested statement of the thesis; a judgement has our verdicts on it, for original and
corrected programs. `judged` has the judgements of all claims, `told` all sentences with judgements,
`figures` our Figures 6 to 12 by file name without suffix.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from pyharness.edition.markdown import inline
from pyharness.history.ablation import FIELDS, effects_of, entries, entry_report
from pyharness.history.claims.evidence import evidence, evidence_report
from pyharness.history.claims.ledger import KINDS, Judgement
from pyharness.history.claims.stories import Sentence, Story, sentences, story
from pyharness.history.claims.verdicts import FALSE, IN_PART, NOT_TESTABLE, REPRODUCED
from pyharness.history.figures import SETS, FigureFinding, figure_picture, together_picture
from pyharness.model.assumptions import assumed, open_starts
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Table
from pyharness.model.scene_file import case_scene
from pyharness.views import html
from pyharness.views.pictures import saved


class SentenceVerdicts(NamedTuple):
    sentence: Sentence
    judged: list[Judgement]
    anchor: str


class Formula(NamedTuple):
    """A displayed formula of the thesis."""

    number: str  # such as ``34a`` or ``13-15``, or empty
    where: str
    lines: list[Markup]  # MathML
    what: Markup  # explanation
    cards: dict[str, str]  # cards that compute the formula, by program
    entry: str  # apparatus entry, or empty

    @property
    def title(self) -> str:
        if not self.number:
            return f"Without a number, {self.where}"
        return f"Equation{'s' if '-' in self.number else ''} {self.number}, {self.where}"


def counts(judged: Sequence[Judgement]) -> dict[str, tuple[int, int]]:
    """Return the numbers of claims on results, for original and corrected programs, by verdict."""
    results = [each for each in judged if each.claim["kind"] == "result"]
    pairs = [(each.original.verdict, each.corrected.verdict) for each in results]
    original, corrected = map(Counter, zip(*pairs, strict=True))
    verdicts = dict.fromkeys(verdict for pair in pairs for verdict in pair)
    return {verdict: (original[verdict], corrected[verdict]) for verdict in verdicts}


def verdicts(judgement: Judgement) -> list[tuple[str, str]]:
    """Return pairs of the programs ("as printed", "corrected" or "") and their verdict."""
    original, corrected = judgement.original.verdict, judgement.corrected.verdict
    if judgement.claim["kind"] == "result":
        return [("as printed", original), ("corrected", corrected)]
    return [("", original if judgement.claim["kind"] == "design" else corrected)]


def assumption(case: int, programs: Iterable[str] = (), listing: str = "original") -> str:
    """Return a text on our assumptions in a case and runs of `programs`, or "" without any."""
    found = ["its initial omega"] if case in open_starts() else []
    start = " and ".join([*found, *(["its cards"] if case_scene(case).torque.varies else [])])
    among = assumed(case_scene(case), map(SETS[listing], programs))
    on_cards = [each["what"] for each in among if each["on"] == "listing"]
    return "; ".join([*filter(None, [start]), *on_cards])


def counted(judged: Sequence[Judgement]) -> str:
    results = counts(judged)
    others = [verdicts(each)[0][1] for each in judged if each.claim["kind"] != "result"]
    number = Counter(others)
    printed, corrected = results[REPRODUCED]
    return (
        f"Of {len(judged) - len(others)} claims about results, the programs as printed reproduce "
        f"{printed}, and the corrected ones {corrected}; of the {len(others)} others, "
        f"{number[REPRODUCED]} hold, {number[IN_PART]} hold in part, {number[FALSE]} are false, "
        f"and {number[NOT_TESTABLE]} cannot be tested."
    )


def account() -> dict[str, Markup]:
    """Return HTML of the statements of `data/account.toml` and of each defect's effect, by id."""
    texts = {each["id"]: each["text"] for each in facts("account")["statement"]}
    texts |= {each["id"]: each["part"] for each in entries() if "part" in each}
    return {name: inline(text) for name, text in texts.items()}


def claims_context(judged: Sequence[Judgement], told: Sequence[SentenceVerdicts]) -> dict[str, Any]:
    """Return the claims page's data.

    `groups` has, by kind, each claim with its verdicts, story and sentences.
    """
    groups: dict[str, list[Any]] = {kind: [] for kind in KINDS}
    for each in judged:
        making = [other for other in told if each.claim["id"] in other.sentence.claims]
        told_of = Story(*map(inline, story(each)))
        groups[each.claim["kind"]].append((each, verdicts(each), told_of, making))
    shown = Markup(html.sections(evidence_report(list(evidence())).text))
    found = {"judged": judged, "counted": counted(judged), "about": KINDS}
    return found | {"groups": groups, "evidence": shown}


def thesis(judged: Sequence[Judgement]) -> list[SentenceVerdicts]:
    by_name = {each.claim["id"]: each for each in judged}
    return [
        SentenceVerdicts(each, [by_name[name] for name in each.claims], f"sentence-{number}")
        for number, each in enumerate(sentences(), 1)
    ]


def thesis_context(told: Sequence[SentenceVerdicts]) -> dict[str, Any]:
    """Return the thesis page's data: sentences, formulas and a table of counts, by section."""
    columns = [
        Column("section", left=True), Column("sentences"), Column("that make a claim"),
        Column("results claimed"), Column("reproduced as printed"),
        Column("reproduced as corrected"),
    ]  # fmt: skip
    sections: dict[str, list[SentenceVerdicts]] = {}
    for each in told:
        sections.setdefault(each.sentence.where.partition(",")[0], []).append(each)
    rows = []
    for section, found in sections.items():
        claimed = {each.claim["id"]: each for sentence in found for each in sentence.judged}
        results = [each for each in claimed.values() if each.claim["kind"] == "result"]
        reproduced = [
            sum(getattr(each, state).verdict == REPRODUCED for each in results)
            for state in ("original", "corrected")
        ]
        makes = sum(bool(sentence.judged) for sentence in found)
        rows.append([section, len(found), makes, len(results), *reproduced])
    table = html.table(Table(columns, rows), "sentences and claims by section")
    return {"sections": sections, "table": Markup(table), "formulas": formulas()}


def formulas() -> dict[str, list[Formula]]:
    found: dict[str, list[Formula]] = {}
    for row in facts("formulas")["formula"]:
        lines = [inline(f"${tex}$") for tex in row["tex"].strip().split("\n")]
        head = (row.get("number", ""), row["where"], lines, inline(row["what"]))
        formula = Formula(*head, row.get("cards", {}), row.get("entry", ""))
        found.setdefault(row["where"].partition(".")[0], []).append(formula)
    return found


def draw_figures(figures: Mapping[str, FigureFinding]) -> dict[str, bytes]:
    """Return the files of the figures, and of a picture of both versions of Figure 7."""
    together = together_picture(figures["figure-07"], figures["figure-07-corrected"])
    files = saved(together, "figure-07-together.svg", "preview.png")
    for stem, each in figures.items():
        files |= saved(figure_picture(each), f"{stem}.svg")
    return files


def printed_figures(
    figures: Mapping[str, FigureFinding], told: Sequence[SentenceVerdicts]
) -> list[dict[str, Any]]:
    """Return the thesis's figures in order, with our drawings (`drawn`) or our text (`ours`).

    `says` has the thesis's sentences with their anchors.
    """
    found = []
    for each in facts("figures")["printed"]:
        drawn = {
            stem: figure for stem, figure in figures.items() if figure.plan.number == each["number"]
        }
        cases = {f"V.2, Case {figure.plan.case}" for figure in drawn.values()}
        about = [(x.sentence.text, x.anchor) for x in told if x.sentence.where in cases]
        quoted = [(each["says"], "")] if "says" in each else about
        says = [(inline(text), anchor) for text, anchor in quoted]
        found.append({**each, "says": says, "ours": inline(each.get("ours", "")), "drawn": drawn})
    return found


def apparatus() -> dict[str, list[tuple[dict[str, Any], Markup]]]:
    """Return each apparatus entry with its report as HTML, by the programs of its cards."""
    found: dict[str, list[tuple[dict[str, Any], Markup]]] = {name: [] for name in PROGRAMS}
    found |= {"several programs": [], "no card": []}
    for entry in entries():
        effects = list(effects_of(entry["id"])) if "flag" in entry else []
        # The page shows the cards as links.
        report = entry_report(entry, effects, [name for name in FIELDS if name != "cards"])
        programs = [*entry["cards"]]
        group = programs[0] if len(programs) == 1 else "several programs" if programs else "no card"
        found[group].append((entry, Markup(html.sections(report.text[1:]))))
    return found

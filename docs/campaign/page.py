"""The document `docs/contributing/promises.md`, made from the tally of a campaign.

The text is in the template `promises.md.in`, the tally in `tally.json`, and explanations of
broken promises in `exceptions.toml`. ``python -m tests.campaigns.proved --merge FILE --page``
replaces the tally by the sum of several, and writes the document.
"""

import tomllib
from collections import defaultdict
from pathlib import Path
from typing import Any

from docs.article.build import rendered, wrapped
from docs.campaign.tally import Tally, read
from pyharness.edition.made_pages import table

HERE = Path(__file__).parent
PAGE = "contributing/promises.md"
"""The path of the document in the folder `docs`."""

DATA = HERE / "tally.json"
"""The file of the tally."""

_NONE = "not explained yet"
_NEAR = 0.9  # of its limit: the page shows errors above
_COUNTS = 6  # columns of the table; the page tells the others, of estimates, in words


def promises_page() -> str:
    """Return the document on the campaign as Markdown."""
    tally = read(DATA)
    template = (HERE / "promises.md.in").read_text(encoding="utf-8")
    found = {
        "table": tally.markdown(_NEAR, _COUNTS),
        "estimates": _estimates(tally),
        "commands": "\n".join(run.command for run in tally.runs),
        "scenes": tally.summary(),
        "exceptions": _exceptions(tally),
    }
    return wrapped(rendered(template, found))


def write_page() -> None:
    """Write the document from the stored tally."""
    (HERE.parent / PAGE).write_text(promises_page(), encoding="utf-8")


def _estimates(tally: Tally) -> str:
    """Return a paragraph for each row of the table that has estimates."""
    found = []
    for name, row in tally.shown(_NEAR).items():
        count, below, *quantiles = row.cells()[_COUNTS - 1 :]
        if row.estimates:
            median, ninth, last, largest = quantiles
            found.append(
                f"The row *{name}* also has {count} estimates of errors, of which {below} are too "
                f"small. The error divided by its estimate has the median {median} (smaller "
                f"ratios count as 1e-9), the 90 % quantile {ninth}, the 99 % quantile {last} and "
                f"the largest value {largest}.\n"
            )
    return "\n".join(found)


def _exceptions(tally: Tally) -> str:
    """Return a table of broken promises, by result and explanation."""
    if not tally.broken:
        return "No promise was broken.\n"
    text = (HERE / "exceptions.toml").read_text(encoding="utf-8")
    known = tomllib.loads(text).get("exception", [])
    groups: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for each in tally.broken:
        groups[each["result"], _explanation(each, known)].append(each)
    rows = []
    for (result, why), those in sorted(groups.items()):
        worst = max(those, key=lambda each: each["error"] / (each["limit"] or 1e-300))
        numbers = [f"{worst[name]:.2g}" for name in ("error", "limit")]
        rows.append([result, str(len(those)), *numbers, f"`{worst['command']}`", why])
    return table("result | broken | worst error | its limit | its scene | explanation", rows)


def _explanation(broken: dict[str, Any], known: list[dict[str, Any]]) -> str:
    """Return the explanation of a broken promise, by its scene or else its result."""
    for each in known:
        if broken["result"] in each["results"] and (
            "commands" not in each or broken["command"] in each["commands"]
        ):
            return " ".join(each["text"].split())
    return _NONE

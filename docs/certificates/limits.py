"""The tables of limits in the document `docs/explanation/proofs.md`, read from the source code."""

import pkgutil
from collections import Counter
from importlib import import_module

from pyharness import checks
from pyharness.edition.made_pages import table
from pyharness.model.basis import MARKS, Basis


def limits() -> list[Basis]:
    """Return all bases of limits in `pyharness.checks`, sorted by mark (proved first) and limit."""
    found = set()
    for each in pkgutil.walk_packages(checks.__path__, "pyharness.checks."):
        values = vars(import_module(each.name)).values()
        found |= {value for value in values if isinstance(value, Basis)}
    order = list(MARKS)
    return sorted(found, key=lambda each: (order.index(each.mark), each.limit))


def counts_table() -> str:
    """Return a Markdown table of the marks, with their meaning and number of limits."""
    counts = Counter(each.mark for each in limits())
    rows = [[mark, meaning, str(counts[mark])] for mark, meaning in MARKS.items()]
    return table("mark | basis of the limit | limits", rows)


def limits_table() -> str:
    """Return a Markdown table of all limits, with marks and sources."""
    return table("mark | limit | source", [[x.mark, x.limit, x.source] for x in limits()])

"""Choice of the output format; each has a module of the same name."""

from importlib import import_module

from pyharness.model.report import Report


def render(report: Report, form: str) -> str:
    """Return a report as ``table``, ``csv``, ``markdown``, ``json``, ``junit`` or ``html``."""
    text: str = import_module(f"pyharness.views.{form}").write(report)
    return text

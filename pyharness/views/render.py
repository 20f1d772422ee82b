"""Choice of an output format: each format is a module of this package, named as in `--format`."""

from importlib import import_module

from pyharness.model.report import Report


def render(report: Report, form: str) -> str:
    """Return a report as ``table`` (text), ``csv``, ``markdown``, ``json`` or ``junit``."""
    text: str = import_module(f"pyharness.views.{form}").write(report)
    return text

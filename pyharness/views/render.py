"""Choice of an output format: a format of `--format` is the module of that name in this package."""

from importlib import import_module

from pyharness.model.report import Report


def render(report: Report, form: str) -> str:
    """Return a report in the format `form`: table (text), csv, markdown, json, junit or html."""
    text: str = import_module(f"pyharness.views.{form}").write(report)
    return text
